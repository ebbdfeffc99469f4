"""Triangles of revolved, extruded and radial solids, with a known distance from the true surface.

Every function returns vertices (v, 3) mm and faces (f, 3), counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.mesh import Mesh

CHORD = 1e-3
"""mm: how far the flat triangles of a part may lie from its true surface."""


def sides(radius: float, chord: float = CHORD) -> int:
    """Number of chords round a circle of ``radius`` mm that stay within ``chord`` of it."""
    ratio = min(max(chord / max(radius, chord), 1e-9), 1.0)
    return int(np.clip(8 * np.ceil(np.pi / np.arccos(1.0 - ratio) / 8), 48, 2400))


def even_radius(count: int) -> float:
    """How much further out the vertices of a polygon lie than the circle that it stands for, so
    that its sides are as far from the middle as the circle is, on average."""
    return 1.0 + (np.pi / count) ** 2 / 3.0


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one; overlaps stay (a ray meets the outermost surface first)."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def _grid_faces(rows: int, columns: int, wrap: bool) -> npt.NDArray[np.int64]:
    """Two triangles per cell of a (rows, columns) grid; columns run counter-clockwise, rows up."""
    i, j = np.meshgrid(
        np.arange(rows - 1), np.arange(columns if wrap else columns - 1), indexing="ij"
    )
    a = i * columns + j
    b = i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate(
        [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    )


def _without_slivers(vertices: Floats, faces: npt.NDArray[np.int64]) -> Mesh:
    """Merge equal vertices and drop the triangles that this leaves without area."""
    merged, back = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    f = back.reshape(-1)[faces]
    whole = (f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])
    return Mesh(merged, f[whole])


def revolved(profile: npt.ArrayLike, count: int | None = None) -> Mesh:
    """Solid of revolution about z.

    ``profile`` (n, 2) is the polyline (r, z) seen with r to the right, going round the solid's
    half section counter-clockwise: from the bottom on the axis, out, up, and back to the axis.
    The mean distance of its sides from the axis is that of the profile.
    """
    p = np.asarray(profile, dtype=np.float64)
    n = count or sides(float(p[:, 0].max()))
    turn = np.arange(n) * (2 * np.pi / n)
    r, z = p[:, :1] * even_radius(n), p[:, 1:]
    grid = np.stack([r * np.cos(turn), r * np.sin(turn), z + 0 * turn], axis=-1)
    return _without_slivers(grid.reshape(-1, 3), _grid_faces(len(p), n, wrap=True))


def radial(radius: Callable[[Floats, Floats], Floats], heights: npt.ArrayLike, count: int) -> Mesh:
    """Free form r = radius(z, φ) about z, closed by flat fans at its lowest and highest height."""
    z = np.asarray(heights, dtype=np.float64)[:, None]
    turn = np.arange(count) * (2 * np.pi / count)
    r = radius(z + 0 * turn, turn + 0 * z)
    grid = np.stack([r * np.cos(turn), r * np.sin(turn), z + 0 * turn], axis=-1)
    ends = np.array([[[0.0, 0.0, z[0, 0]]], [[0.0, 0.0, z[-1, 0]]]])
    grid = np.concatenate([np.repeat(ends[:1], count, 1), grid, np.repeat(ends[1:], count, 1)])
    return _without_slivers(grid.reshape(-1, 3), _grid_faces(len(z) + 2, count, wrap=True))


def patch(grid: Floats) -> Mesh:
    """Surface through a grid (rows, columns, 3) of points, two triangles per cell."""
    rows, columns, _ = grid.shape
    return _without_slivers(grid.reshape(-1, 3), _grid_faces(rows, columns, wrap=False))


def extruded(
    outline: npt.ArrayLike, z0: float, z1: float, centre: tuple[float, float] = (0.0, 0.0)
) -> Mesh:
    """Prism over a polygon (n, 2), counter-clockwise, all of which is visible from ``centre``."""
    xy = np.asarray(outline, dtype=np.float64)
    n = len(xy)
    low, high = (np.column_stack([xy, np.full(n, z)]) for z in (z0, z1))
    ends = [np.tile([*centre, z], (n, 1)) for z in (z0, z1)]
    grid = np.concatenate([ends[0], low, high, ends[1]])
    return _without_slivers(grid, _grid_faces(4, n, wrap=True))


def ribbon(across: npt.ArrayLike, top: npt.ArrayLike, base: float, length: float) -> Mesh:
    """Prism along y whose section in (x, z) lies between z = ``base`` and the polyline ``top``.

    ``across`` (n,) ascends (equal neighbours make a vertical wall); ``length`` is centred on 0.
    """
    x = np.asarray(across, dtype=np.float64)
    z = np.asarray(top, dtype=np.float64)
    n = len(x)

    def row(height: Floats, y: float) -> Floats:
        return np.column_stack([x, np.full(n, y), height])

    flat = np.full(n, base)
    h = length / 2
    # Round the prism: bottom, front, top, back, and the two ends x = first and x = last.
    ring = [row(flat, h), row(flat, -h), row(z, -h), row(z, h), row(flat, h)]
    round_faces = _grid_faces(5, n, wrap=False)
    ends = []
    for k in (0, n - 1):
        quad = [k, n + k, 2 * n + k, 3 * n + k]
        a, b, c, d = quad[::-1] if k else quad
        ends += [[a, b, c], [a, c, d]]
    return _without_slivers(np.concatenate(ring), np.concatenate([round_faces, np.array(ends)]))


def ball(radius: float, chord: float = CHORD) -> Mesh:
    """Sphere about the origin from a subdivided icosahedron, its mean distance from it zero."""
    g = (1 + 5**0.5) / 2
    v = np.array(
        [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g]]
        + [[0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]]
    )
    f = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4]]
        + [[11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8]]
        + [[3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]]
    )
    edge = 1.2 * radius
    while edge * edge / (6 * radius) > chord and len(f) < 600_000:
        v, f = split_once(v, f)
        v = v / np.linalg.norm(v, axis=1, keepdims=True) * radius
        edge /= 2
    v = v / np.linalg.norm(v, axis=1, keepdims=True) * radius
    # A flat triangle lies below the sphere by 3/4 of what its middle does, on average.
    sag = 0.75 * (radius - np.linalg.norm(v[f].mean(axis=1), axis=1)).mean()
    return Mesh(v * (1.0 + sag / radius), f)


def swept(path: Floats, radii: tuple[float, float], count: int = 64) -> Mesh:
    """Tube of elliptic section along a path (n, 3) in the plane y = 0, closed at both ends.

    ``radii`` mm: in the plane of the path, and across it.
    """
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.array([0.0, 1.0, 0.0])
    inward = np.cross(across, along)
    turn = np.arange(count) * (2 * np.pi / count)
    ring = (
        path[:, None]
        + radii[0] * np.cos(turn)[None, :, None] * inward[:, None]
        + radii[1] * np.sin(turn)[None, :, None] * across
    )
    ends = [np.repeat(path[[k], None], count, axis=1) for k in (0, -1)]
    grid = np.concatenate([ends[0], ring, ends[1]])
    mesh = _without_slivers(grid.reshape(-1, 3), _grid_faces(len(path) + 2, count, wrap=True))
    return mesh if mesh.volume > 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])


def split_once(v: Floats, f: npt.NDArray[np.integer]) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Each triangle into four through the middles of its edges."""
    pairs, back = _pairs(f.T.ravel(), f[:, [1, 2, 0]].T.ravel(), len(v))
    middle = len(v) + back.reshape(3, -1).T
    a, b, c = f[:, 0], f[:, 1], f[:, 2]
    ab, bc, ca = middle[:, 0], middle[:, 1], middle[:, 2]
    faces = np.concatenate(
        [np.stack(t, -1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    ).astype(np.int64)
    return np.concatenate([v, v[pairs].mean(axis=1)]), faces


def _pairs(
    a: npt.NDArray[np.integer], b: npt.NDArray[np.integer], count: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(m, 2) the different edges from ``a`` (n,) to ``b`` (n,) among ``count`` vertices, either way
    round, and (n,) which of them each is."""
    # One number for each pair sorts many times faster than rows of two.
    first, last = np.minimum(a, b).astype(np.int64), np.maximum(a, b)
    key, which = np.unique(first * count + last, return_inverse=True)
    return np.stack(np.divmod(key, count), axis=-1), which


def bisected(mesh: Mesh, longest: float) -> Mesh:
    """Split triangles until no edge is longer than ``longest`` mm (corners may hang on edges)."""
    v, f = mesh.vertices, mesh.faces.astype(np.int64)
    done = []
    while len(f):
        t = v[f]
        lengths = np.linalg.norm(t - np.roll(t, -1, axis=1), axis=2)
        big = lengths.max(axis=1) > longest
        done.append(f[~big])
        f, k = f[big], lengths[big].argmax(axis=1)
        if not len(f):
            break
        rows = np.arange(len(f))
        a, b, c = f[rows, k], f[rows, (k + 1) % 3], f[rows, (k + 2) % 3]
        pairs, back = _pairs(a, b, len(v))
        m = len(v) + back
        v = np.concatenate([v, v[pairs].mean(axis=1)])
        f = np.concatenate([np.stack([a, m, c], -1), np.stack([m, b, c], -1)])
    return Mesh(v, np.concatenate(done))
