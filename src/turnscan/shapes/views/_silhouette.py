"""The outline of a part as it is seen from far away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh
from turnscan.shapes._outline_curves import Arc, Line, Outline, Piece, Size
from turnscan.shapes._section import Chain, Cut

_OUTSIDE = 1.5
"""The outermost of some twenty points lies so many standard deviations outside their middle, and
does so on either side."""

Edges = npt.NDArray[np.int64]


def silhouette(mesh: Mesh, cut: Cut) -> list[Chain]:
    """The border of what the faces cover in the drawing, the longest chain first.

    Seen from the viewer of the cut, all faces turned to it: edges that two of them share in
    opposite directions cancel, those left are the contours, and what they wind round is covered
    (Clipper2, through Manifold). Where two contours cross is a point of the outline that lies on no
    vertex; it has the noise of the nearest one. Empty where all faces are seen from the side.
    """
    from scipy.spatial import cKDTree

    xy = mesh.vertices @ np.stack([cut.right, cut.up], axis=1)
    around = np.unique(edges := _contours(mesh, xy))
    if not len(edges):
        return []
    tree, known = cKDTree(xy[around]), _known(mesh)
    loops = _covered([xy[walk] for walk in _walks(edges)])
    chains = [_chain(mesh, loop, around[tree.query(loop)[1]], known) for loop in loops]
    return sorted(chains, key=lambda c: -c.length)


def _contours(mesh: Mesh, xy: Floats) -> Edges:
    """(n, 2) from, to: what does not cancel of the sides of all faces, all counter-clockwise."""
    t = xy[mesh.faces]
    a, b = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    faces = np.where((twice > 0)[:, None], mesh.faces, mesh.faces[:, ::-1])[twice != 0]
    sides = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    low, high = sides.min(axis=1), sides.max(axis=1)
    keys, number = np.unique(low * len(xy) + high, return_inverse=True)
    net = np.bincount(number, np.where(sides[:, 0] == low, 1.0, -1.0)).astype(np.int64)
    if not (net % 2).any():
        net //= 2
    first, last = keys // len(xy), keys % len(xy)
    start, end = np.where(net > 0, first, last), np.where(net > 0, last, first)
    return np.repeat(np.stack([start, end], axis=1), np.abs(net), axis=0)


def _walks(edges: Edges) -> list[npt.NDArray[np.int64]]:
    """The edges as closed walks of vertices; as many edges end in each vertex as begin there."""
    leave, arrive = np.argsort(edges[:, 0], kind="stable"), np.argsort(edges[:, 1], kind="stable")
    after = np.empty(len(edges), dtype=np.int64)
    after[arrive] = leave
    walks, follow, start = [], after.tolist(), edges[:, 0]
    seen = np.zeros(len(edges), dtype=np.bool_)
    for k in range(len(edges)):
        if seen[k]:
            continue
        walk = [k]
        while (n := follow[walk[-1]]) != k:
            walk.append(n)
        seen[walk] = True
        walks.append(start[walk])
    return walks


def _covered(loops: list[Floats]) -> list[Floats]:
    """The border of what closed polylines wind round, the covered side on its left."""
    from manifold3d import CrossSection, FillRule

    whole = CrossSection([np.ascontiguousarray(p) for p in loops if len(p) > 2], FillRule.Positive)
    return [np.asarray(p, dtype=np.float64) for p in whole.to_polygons() if len(p) > 2]


def _known(mesh: Mesh) -> Bools:
    """(v,) whether a vertex belongs to a face that was measured."""
    known = np.ones(len(mesh.vertices), dtype=np.bool_)
    if mesh.measured is not None:
        known[:] = False
        known[mesh.faces[mesh.measured]] = True
    return known


def _chain(mesh: Mesh, points: Floats, near: npt.NDArray[np.int64], known: Bools) -> Chain:
    m = len(points)
    sigma = np.full(m, np.nan) if mesh.provenance is None else mesh.provenance.sigma[near]
    filled = ~(known[near] & np.roll(known[near], -1))
    ends = np.stack([near, near], axis=1).astype(np.int32)
    shares = np.tile([1.0, 0.0], (m, 1))
    return Chain(points, True, filled, sigma, np.zeros((m, 2)), ends, shares)


def outermost(outline: Outline) -> Outline:
    """An outline of a silhouette, whose points are the outermost of many: its uncertainties hold
    what that adds to each side."""
    far = _OUTSIDE * outline.noise
    return replace(
        outline,
        pieces=tuple(_wider(p, far) for p in outline.pieces),
        box_sigma=np.hypot(outline.box_sigma, far),
        sizes=tuple(_wider_size(s, far) for s in outline.sizes),
    )


def _wider(piece: Piece, far: float) -> Piece:
    if isinstance(piece, Line):
        length = float(np.hypot(piece.length_sigma, 2 * far))
        return replace(piece, sigma=float(np.hypot(piece.sigma, far)), length_sigma=length)
    if isinstance(piece, Arc):
        return replace(piece, radius_sigma=float(np.hypot(piece.radius_sigma, far)))
    return replace(piece, sigma=float(np.hypot(piece.sigma, far)))


def _wider_size(size: Size, far: float) -> Size:
    if size.kind == "angle":
        return size
    return replace(size, sigma=float(np.hypot(size.sigma, 2 * far)))
