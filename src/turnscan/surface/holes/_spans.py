"""Whether a smooth surface could go on across a hole: only then can it be too dark and in sight.

Where a part turns off at an edge, what comes next looks another way; where something stands before
it, what comes next lies elsewhere. There a flat patch over the hole lies off the part, though light
and look reach it. A dark place on a face has surface on all its sides that goes on from one to the
other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh._mesh import Mesh
from turnscan.surface.holes._holes import Hole, vector_area

_CORNERS = 48
"""Corners of a border that are asked, about; fewer where there are many borders."""
_ALL = 6000
"""Corners of all borders that are asked, about."""
_ALONG = 2
"""Corners to either side over which the direction of a border is taken: single ones zigzag."""
_VAGUE, _FEW = 0.5, 0.25
"""Part of what two samples are apart by which a corner may lie off to say how the surface goes on;
all say it where fewer than this part of a border do."""
_INTO, _STEEP = 0.5, 0.8
"""Cosine between a normal and the way to the middle of a hole from which a surface looks into it,
and between a normal and the hole's plane from which it is a wall. At the border of a hollow face
that turns by 90° in all the latter is sin 45°, 0.71."""


def spanned(mesh: Mesh, found: Sequence[Hole], apart: float, normals: Floats) -> Floats:
    """(h,) share of each hole's border that some border faces over a smooth arc, of those corners
    that are known well beside what two samples are ``apart``, mm. ``normals`` (v, 3) are the
    mesh's.

    At the rim of a dark patch the last of the light is bright beside, and points lie off.
    """
    from turnscan.surface.holes import _span_kernels as kernels

    most = max(8, min(_CORNERS, _ALL // max(len(found), 1)))
    p = mesh.provenance
    vague = np.zeros(len(normals), np.bool_) if p is None else p.sigma > _VAGUE * apart
    X, n, outward, known = [], [], [], []
    for h in found:
        corners = mesh.vertices[h.loop]
        up = unit(smoothed(normals[h.loop]))
        along = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
        few = slice(None, None, max(1, len(corners) // most))
        X.append(corners[few])
        n.append(up[few])
        outward.append(unit(np.cross(smoothed(along), up))[few])
        well = ~vague[h.loop][few]
        known.append(well if well.mean() >= _FEW else np.ones_like(well))
    owner = np.repeat(np.arange(len(found)), [len(x) for x in X])
    ok = kernels.facing(np.concatenate(X), np.concatenate(n), np.concatenate(outward))
    told = np.concatenate(known)
    share = np.bincount(owner, ok & told, len(found)) / np.bincount(owner, told, len(found))
    return np.asarray(share, dtype=np.float64)


def walled(mesh: Mesh, found: Sequence[Hole], normals: Floats) -> Floats:
    """(h,) share of each hole's border, by length, along which the surface looks into the hole.

    So does the wall of a bore whose upper part was measured: the part goes down there, and no
    surface goes on across. A hollow face that is `spanned` is less steep: it turns by less than 90°
    from one side of its border to the other. ``normals`` (v, 3) are the mesh's.
    """
    share = np.zeros(len(found))
    for k, h in enumerate(found):
        corners = mesh.vertices[h.loop]
        open_to = unit(vector_area(corners)[None])[0]
        across = corners.mean(axis=0) - corners
        across = unit(across - (across @ open_to)[:, None] * open_to)
        up = unit(smoothed(normals[h.loop]))
        steep = np.linalg.norm(up - (up @ open_to)[:, None] * open_to, axis=1) > _STEEP
        into = steep & (np.einsum("ij,ij->i", up, across) > _INTO)
        along = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
        long = np.linalg.norm(along, axis=1)
        share[k] = long[into].sum() / max(float(long.sum()), 1e-12)
    return share


def smoothed(values: Floats) -> Floats:
    """(m, 3) sums over the vertices of a border (m, 3) and those beside them."""
    return np.asarray(sum(np.roll(values, k, axis=0) for k in range(-_ALONG, _ALONG + 1)))


def unit(v: Floats) -> Floats:
    """(m, 3) of length 1; zero where there is none."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12))
