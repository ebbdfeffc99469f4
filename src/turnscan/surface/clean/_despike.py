"""Despike: single points that stick out of a grid or of a mesh go."""

from __future__ import annotations

from typing import overload

import numpy as np

from turnscan.arrays import Bools
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import submesh
from turnscan.points import RangeGrid, without
from turnscan.stripes import StripeFlag
from turnscan.surface.clean._denoise import outliers
from turnscan.surface.clean._smooth import spikes


@overload
def despike(what: RangeGrid, beyond: float = ...) -> tuple[RangeGrid, list[Finding]]: ...


@overload
def despike(what: Mesh, beyond: float = ...) -> tuple[Mesh, list[Finding]]: ...


def despike(what: RangeGrid | Mesh, beyond: float = 5.0) -> tuple[RangeGrid | Mesh, list[Finding]]:
    """The grid or the mesh without its spikes, and a finding where there were any.

    In a grid those points go that lie more than ``beyond`` sigma off the surface of their
    neighbours (`outliers`), flagged AMBIGUOUS; a grid that does not know where its camera stood
    stays as it is. In a mesh the faces about `spikes` go: the holes are for `fill`, nothing is
    made up here. Raises InputError where ``beyond`` is not positive.
    """
    if not (beyond > 0 and np.isfinite(beyond)):
        raise InputError(f"spikes beyond {beyond} sigma", hint="give a positive number, like 5")
    if isinstance(what, Mesh):
        off = spikes(what, beyond)
        keep = np.asarray(~off[what.faces].any(axis=1))
        return submesh(what, keep), _findings(off, beyond, "")
    if what.eyes is None or not what.found.any():
        return what, []
    drop = outliers(what, beyond)
    left = without(what, drop, StripeFlag.AMBIGUOUS)
    return left, _findings(drop, beyond, f"laser {what.laser}")


def _findings(drop: Bools, beyond: float, place: str) -> list[Finding]:
    if not drop.any():
        return []
    text = f"{int(drop.sum())} points more than {beyond:g} sigma off the surface are removed"
    return [Finding("surface.spikes", "note", text, place)]
