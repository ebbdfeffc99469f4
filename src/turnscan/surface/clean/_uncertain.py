"""What is known too badly: points and vertices of more sigma than the user wants."""

from __future__ import annotations

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


def drop_uncertain(grid: RangeGrid, limit: float | None) -> tuple[RangeGrid, list[Finding]]:
    """The grid without points of more than ``limit`` mm sigma, and a finding if there were any.

    They are flagged EDGE: their stripes lie on two surfaces, mostly. What states no sigma stays, as
    a range scan's points do; and everything where ``limit`` is None.
    """
    if limit is None:
        return grid, []
    with np.errstate(invalid="ignore"):
        drop = np.asarray(grid.found & (grid.sigma > limit))
    left = without(grid, drop, StripeFlag.EDGE)
    return left, _findings(drop, limit, "points", f"laser {grid.laser}")


def part_uncertain(mesh: Mesh, limit: float | None) -> tuple[Mesh, Mesh, list[Finding]]:
    """The mesh without the faces at vertices of more than ``limit`` mm sigma, those faces, and a
    finding if there were any. What states no sigma stays; and everything where ``limit`` is None.

    The mesh is to be made of all points: one that is known badly still shows that the surface bends
    there, and a merge without it would go straight past.
    """
    p, nothing = mesh.provenance, Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    if p is None or limit is None or not (p.sigma > limit).any():
        return mesh, nothing, []
    drop = np.asarray(p.sigma > limit)
    keep = np.asarray(~drop[mesh.faces].any(axis=1))
    said = _findings(drop, limit, "merged vertices", "")
    return submesh(mesh, keep), submesh(mesh, ~keep), said


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
