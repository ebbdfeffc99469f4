"""Kept: how much of what was measured a merged surface holds, and the way of merging by it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.surface.fusion._range_surface import RangeSurface

Merged = tuple[Mesh, list[Finding]]
_ENOUGH = 0.9
"""Share of the measured area of which a surface that holds it is not compared with another."""
_AS_GOOD = 0.95
"""Part of the most that any way holds, with which the first one is taken."""
_SAMPLES = 20_000
_SIGMAS = 3.0


def kept(mesh: Mesh, surfaces: Sequence[RangeSurface]) -> float:
    """Share of the area of ``surfaces`` that a merged mesh holds; NaN where they have none.

    A measured point stands for a third of the faces about it. It is held where the mesh passes
    within three of its sigma.
    """
    import igl

    whole = held = 0.0
    every = max(1, sum(len(s.mesh.vertices) for s in surfaces) // _SAMPLES)
    for s in surfaces:
        some = np.arange(0, len(s.mesh.vertices), every)
        t = s.mesh.triangles
        double = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
        area = np.bincount(s.mesh.faces.ravel(), np.repeat(double, 3), len(s.mesh.vertices))[some]
        whole += float(area.sum())
        if not len(mesh.faces):
            continue
        squared, _, _ = igl.point_mesh_squared_distance(
            np.array(s.mesh.vertices[some]), np.array(mesh.vertices), mesh.faces.astype(np.int64)
        )
        held += float(area[np.sqrt(squared) <= _SIGMAS * s.sigma[some]].sum())
    return held / whole if whole > 0 else np.nan


def keeping(
    surfaces: Sequence[RangeSurface], ways: Sequence[Callable[[str], Merged]], why: str
) -> tuple[int, str, Merged]:
    """Which of the ``ways`` of merging to take, why, and what it makes: the first one, unless that
    loses much of what was measured.

    Each takes the reason for which it was chosen; ``why`` is the first one's. Where that one holds
    less than nine tenths of the measured area (`kept`), as it drops what is known badly, the others
    are tried, and the first one that holds nearly as much as the best is taken.
    """
    made = [ways[0](why)]
    shares = [kept(made[0][0], surfaces)]
    if shares[0] < _ENOUGH:
        other = f"what fits this part by its shape holds {shares[0]:.0%} of what was measured"
        for way in ways[1:]:
            made.append(way(other))
            shares.append(kept(made[-1][0], surfaces))
    best = int(np.argmax(np.array(shares) >= _AS_GOOD * max(shares)))
    return best, why if best == 0 else other, made[best]
