"""What is known too badly: points and vertices of more sigma than the user wants."""

from __future__ import annotations

from typing import overload

import numpy as np

from turnscan.arrays import Bools
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import submesh
from turnscan.points import RangeGrid, usual_sigma, without
from turnscan.remedy import Option, Remedy
from turnscan.stripes import StripeFlag

_FAR = 5.0
"""Usual sigma from which a point is known badly …"""
_MANY = 0.1
"""… and the share of such points from which they are worth a word."""


@overload
def drop_uncertain(what: RangeGrid, limit: float | None) -> tuple[RangeGrid, list[Finding]]: ...


@overload
def drop_uncertain(what: Mesh, limit: float | None) -> tuple[Mesh, list[Finding]]: ...


def drop_uncertain(
    what: RangeGrid | Mesh, limit: float | None
) -> tuple[RangeGrid | Mesh, list[Finding]]:
    """The grid or the mesh without what is known worse than ``limit`` mm, and a finding if any was.

    In a grid points of a larger sigma go, flagged EDGE: their stripes lie on two surfaces, mostly.
    In a mesh the faces at vertices of a larger sigma go. What states no sigma stays: a range scan's
    points, a mesh without provenance; and everything where ``limit`` is None. A mesh is made of all
    points before any goes: one that is known badly still shows that the surface bends there.
    """
    if limit is None:
        return what, []
    if isinstance(what, RangeGrid):
        with np.errstate(invalid="ignore"):
            drop = np.asarray(what.found & (what.sigma > limit))
        left = without(what, drop, StripeFlag.EDGE)
        return left, _findings(drop, limit, "points", f"laser {what.laser}")
    if what.provenance is None:
        return what, []
    drop = np.asarray(what.provenance.sigma > limit)
    if not drop.any():
        return what, []
    keep = np.asarray(~drop[what.faces].any(axis=1))
    return submesh(what, keep), _findings(drop, limit, "merged vertices", "")


def uncertain_findings(grid: RangeGrid) -> list[Finding]:
    """A note where many points are known far worse than the others, and how to leave them out."""
    sigma = grid.sigma[grid.found & np.isfinite(grid.sigma)]
    usual = usual_sigma(sigma)
    share = float((sigma > _FAR * usual).mean()) if len(sigma) else 0.0
    if share < _MANY:
        return []
    limit = float(f"{_FAR * usual:.1g}")
    text = (
        f"{share:.0%} of the points state more than {_FAR:g} times the usual sigma, "
        f"{usual:.2g} mm: their stripes lie on two surfaces or bend within the light"
    )
    remedy = Remedy(
        "look at the quality map; leave such points out with ", Option("largest_sigma", limit)
    )
    return [Finding("surface.uncertain", "note", text, f"laser {grid.laser}", remedy)]


def _findings(drop: Bools, limit: float, what: str, where: str) -> list[Finding]:
    if not drop.any():
        return []
    text = f"{int(drop.sum())} {what} of a standard uncertainty above {limit:g} mm are removed"
    remedy = Remedy("keep them: leave ", Option("largest_sigma"), " empty")
    return [Finding("surface.uncertain", "note", text, where, remedy)]
