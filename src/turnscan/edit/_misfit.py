"""Whether a surface has the patch that a region was chosen on, or may be that of another part."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.edit._region import Region
from turnscan.mesh import Mesh, submesh
from turnscan.shapes import deviation

_ENOUGH = 0.8
"""Share of a patch that lies on the surface of the same part, scanned again."""
_MOST = 1000
"""Samples of a patch that are looked at."""
_ABOUT = 12
"""Samples from which the direction of the patch is taken."""
_TURNED = np.cos(np.radians(30.0))
"""Normals of the same place of the same part differ by less."""
_FLAT = 0.1
"""Share of the variance across a plane in that along it, below which it has a normal."""


def misfit(region: Region, mesh: Mesh) -> str:
    """What speaks against the surface having the region's patch, in words; empty for nothing.

    A sample of the patch (`Place.inside`) fits where the surface is within the reach of the region,
    and where the surface points nearest to it and to the samples about it make a plane that is
    turned by less than 30° from that of the samples themselves.
    """
    inside = region.place.samples()
    inside = inside[:: max(1, len(inside) // _MOST)]
    if not len(inside):
        return ""
    reach = region.place.reach
    t = mesh.triangles
    low, high = inside.min(axis=0) - reach, inside.max(axis=0) + reach
    near = ((t.max(axis=1) >= low) & (t.min(axis=1) <= high)).all(axis=1)
    if not near.any():
        return "no surface lies where it was measured"
    found = deviation(inside, submesh(mesh, near))
    there = np.abs(found.distance) <= reach
    turned = there & _turned(inside, found.closest)
    share = float((there & ~turned).mean())
    if share >= _ENOUGH:
        return ""
    said = f"only {share:.0%} of where it was measured lies on this surface"
    parts = [
        f"{part.mean():.0%} {how}"
        for part, how in ((~there, f"is more than {reach:.1f} mm off"), (turned, "is turned"))
        if part.any()
    ]
    return f"{said} ({', '.join(parts)})"


def _turned(one: Floats, other: Floats) -> Bools:
    """(n,) where the points (n, 3) about one are turned from those that belong to them."""
    from scipy.spatial import cKDTree

    if len(one) < _ABOUT:
        return np.zeros(len(one), dtype=np.bool_)
    about = np.asarray(cKDTree(one).query(one, k=_ABOUT)[1])
    (normal, flat), (there, also) = (_planes(points[about]) for points in (one, other))
    return np.asarray(flat & also & (np.abs((normal * there).sum(axis=1)) < _TURNED))


def _planes(points: Floats) -> tuple[Floats, Bools]:
    """(n, 3) normals of the planes through points (n, k, 3), and whether they are flat."""
    off = points - points.mean(axis=1, keepdims=True)
    size, axes = np.linalg.eigh(np.swapaxes(off, 1, 2) @ off)
    return axes[:, :, 0], size[:, 0] < _FLAT * size[:, 1]
