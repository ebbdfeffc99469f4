"""What pixels see and where shadows cannot fall, without a ray for each: numba kernels.

Both answer only where rounding cannot matter, and leave the rest to rays, so that the answers are
those of `turnscan.mesh.Caster`. It imports numba; import it inside functions only. Frames as in
`_rays`.
"""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit
from turnscan.simulate._airy import Numbers, Singles
from turnscan.simulate._cut import CLUSTER, can_face
from turnscan.simulate._random import mix

NEAR = 5e-6
"""Rad that a ray of single precision may pass on the wrong side of an edge, with room to spare."""
_LEVEL = 3e-5
"""Share of the distance within which two surfaces may come in either order."""
_EDGE_ON = 1e-3
"""Cosine to the lamp below which a triangle may keep light off what lies beneath it."""
_ABOVE = 1e-3
"""mm that a shadow's height may be wrong."""
_GRAIN = 1e6
"""Steps per mm: vertices of one step are one."""


@njit(cache=True, nogil=True, error_model="numpy")
def projected(vertices: Floats, R: Floats, t: Floats, lens: Numbers, out: Singles) -> bool:
    """Vertices' pixels and 1/depth, (v, 3), of a pinhole (fx, fy, cx, cy); False where one lies
    behind it. Single precision is a hundredth of the margin that `nearest` is given."""
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    before = True
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        depth = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2]
        before &= depth > 1.0
        near = 1.0 / depth
        out[i, 0] = fx * (R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0]) * near + cx
        out[i, 1] = fy * (R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1]) * near + cy
        out[i, 2] = near
    return before


@njit(cache=True, nogil=True, error_model="numpy")
def nearest(
    at: Singles, faces: Ints, boxes: Floats, eye: Numbers, closed: bool, place: tuple[int, int],
    margin: float, face: Ints,
) -> Bools:  # fmt: skip
    """Fill ``face`` (h, w) with the triangle that each pixel's middle sees, −1 for none; returns
    (h, w) True where only a ray can tell.

    ``at`` (v, 3) from `projected`; ``boxes`` of `_cut.clusters`; of ``closed`` bodies only what
    faces the camera, which is at ``eye`` in the object's frame, can be seen;
    ``place`` is the first row and column; ``margin`` pixels from an edge nothing is certain.
    """
    h, w = face.shape
    best, doubt = np.zeros((h, w), np.float32), np.zeros((h, w), np.float32)
    top, left = float(place[0]), float(place[1])
    for box in _facing(boxes, eye, closed):
        for f in range(box * CLUSTER, min((box + 1) * CLUSTER, len(faces))):
            a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
            ua, va = float(at[a, 0]) - left, float(at[a, 1]) - top
            ub, vb = float(at[b, 0]) - left, float(at[b, 1]) - top
            uc, vc = float(at[c, 0]) - left, float(at[c, 1]) - top
            u0, u1 = _ends(ua, ub, uc)
            v0, v1 = _ends(va, vb, vc)
            c0, c1 = math.ceil(max(u0 - margin, 0.0)), math.floor(min(u1 + margin, w - 1.0))
            r0, r1 = math.ceil(max(v0 - margin, 0.0)), math.floor(min(v1 + margin, h - 1.0))
            if (c0 > c1) | (r0 > r1):  # as most: one question, whose answer is hard to foresee
                continue
            area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va)
            if closed and area > margin * (u1 - u0 + v1 - v0):
                continue
            side = 1.0 if area > 0.0 else -1.0
            # No edge is longer than this: most pixels are clear without a root.
            clear = margin * (u1 - u0 + v1 - v0)
            close = max(at[a, 2], at[b, 2], at[c, 2])
            for r in range(r0, r1 + 1):
                for k in range(c0, c1 + 1):
                    eab = (ub - ua) * (r - va) - (vb - va) * (k - ua)
                    ebc = (uc - ub) * (r - vb) - (vc - vb) * (k - ub)
                    eca = (ua - uc) * (r - vc) - (va - vc) * (k - uc)
                    inside = min(side * eab, side * ebc, side * eca)
                    if abs(inside) <= clear:
                        inside = min(
                            _beside(side * eab, ub - ua, vb - va),
                            _beside(side * ebc, uc - ub, vc - vb),
                            _beside(side * eca, ua - uc, va - vc),
                        )
                        if abs(inside) <= margin:
                            doubt[r, k] = max(doubt[r, k], close)
                            continue
                    if inside < 0.0:
                        continue
                    near = (ebc * at[a, 2] + eca * at[b, 2] + eab * at[c, 2]) / area
                    if abs(near - best[r, k]) <= _LEVEL * near:
                        doubt[r, k] = max(doubt[r, k], near, best[r, k])
                    if near > best[r, k]:
                        best[r, k] = near
                        face[r, k] = f
    return doubt > best * np.float32(1.0 - 2.0 * _LEVEL)


@njit(cache=True, nogil=True, error_model="numpy")
def _facing(boxes: Floats, eye: Numbers, closed: bool) -> Ints:
    """The boxes (n, 12) of triangles that may be seen from a place; all of open bodies."""
    found, count = np.empty(len(boxes), np.int32), 0
    for box in range(len(boxes)):
        if not closed or can_face(boxes, box, eye):
            found[count] = box
            count += 1
    return found[:count]


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _beside(product: float, u: float, v: float) -> float:
    """Distance from an edge (u, v), from its vector product with the way there."""
    return product / max(math.sqrt(u * u + v * v), 1e-9)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _ends(a: float, b: float, c: float) -> tuple[float, float]:
    low, high = (a, b) if a < b else (b, a)
    return (c if c < low else low), (c if c > high else high)


@njit(cache=True, nogil=True, error_model="numpy")
def open_edges(vertices: Floats, faces: Ints) -> np.uint64:
    """0 where every edge of the triangles has its opposite (but for 1 in 2⁶⁴), by place alone.

    A sum of hashes over all edges less that over all reversed edges: order does not matter to it.
    """
    total = np.uint64(0)
    word = np.empty(len(vertices), np.uint64)
    for i in range(len(vertices)):
        own = np.uint64(0)
        for j in range(3):
            own = mix(own, np.uint64(np.int64(math.floor(vertices[i, j] * _GRAIN + 0.5))))
        word[i] = own
    for f in range(len(faces)):
        for j in range(3):
            one, other = word[faces[f, j]], word[faces[f, (j + 1) % 3]]
            total += mix(one, other) - mix(other, one)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def shadow_heights(
    vertices: Floats, faces: Ints, normals: Floats, boxes: Floats, axes: Floats, low: Numbers,
    per_mm: float, heights: Singles,
) -> None:  # fmt: skip
    """Greatest height towards a lamp of what turns away from it, over each cell of a grid (n, m).

    ``boxes`` (c, 12) as of `_cut.clusters`; ``axes`` (3, 3): two axes across the light, and the
    unit vector towards the lamp; ``low`` (2,) is where the grid begins. Light enters a closed body
    through nothing that faces the lamp, so what stands on the way from a place outside all bodies
    to the lamp turns away from it.
    """
    n, m = heights.shape
    at = np.empty((len(vertices), 3), np.float32)
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        at[i, 0] = (axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z - low[0]) * per_mm
        at[i, 1] = (axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z - low[1]) * per_mm
        at[i, 2] = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    above, round_ = np.float32(_ABOVE), np.float32(_ABOVE * per_mm)
    for box in range(len(boxes)):
        facing = 0.0
        for j in range(3):
            facing += min(axes[2, j] * boxes[box, 6 + j], axes[2, j] * boxes[box, 9 + j])
        if facing > _EDGE_ON:
            continue
        for f in range(box * CLUSTER, min((box + 1) * CLUSTER, len(faces))):
            facing = 0.0
            for j in range(3):
                facing += normals[f, j] * axes[2, j]
            if facing > _EDGE_ON:
                continue
            a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
            s0, s1 = _ends(at[a, 0], at[b, 0], at[c, 0])
            t0, t1 = _ends(at[a, 1], at[b, 1], at[c, 1])
            top = _ends(at[a, 2], at[b, 2], at[c, 2])[1] + above
            i0, i1 = int(s0 - round_), int(s1 + round_)
            j0, j1 = int(t0 - round_), int(t1 + round_)
            for i in range(max(i0, 0), min(i1, n - 1) + 1):
                for j in range(max(j0, 0), min(j1, m - 1) + 1):
                    heights[i, j] = max(heights[i, j], top)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _below(
    x: float, y: float, z: float, axes: Floats, low: Numbers, per_mm: float, heights: Singles
) -> bool:
    """False where nothing can stand between a point and the lamp of `shadow_heights`."""
    i = int((axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z - low[0]) * per_mm)
    j = int((axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z - low[1]) * per_mm)
    if not (0 <= i < heights.shape[0] and 0 <= j < heights.shape[1]):
        return True
    return bool(heights[i, j] >= axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z)


@njit(cache=True, nogil=True, error_model="numpy")
def lamp_light(
    face: Ints, points: Floats, normals: Floats, up: Numbers, lamp: Numbers,
    shadows: tuple[Floats, Numbers, float, Singles],
) -> tuple[Floats, Floats, Bools]:  # fmt: skip
    """How much of the sky points (n, 3) look at, 0.2 to 1; the cosine to the lamp, not below 0; and
    whether something may stand between; object frame.

    No light for a ``face`` below 0 or a point NaN. ``shadows``: what `shadow_heights` takes and
    fills, its heights (0, 0) where nothing is to be asked.
    """
    n = len(face)
    sky, facing, asked = np.zeros(n), np.zeros(n), np.zeros(n, np.bool_)
    axes, low, per_mm, heights = shadows
    for i in range(n):
        if face[i] < 0 or math.isnan(points[i, 0]):
            continue
        above = normals[i, 0] * up[0] + normals[i, 1] * up[1] + normals[i, 2] * up[2]
        sky[i] = 0.6 + 0.4 * above
        towards = normals[i, 0] * lamp[0] + normals[i, 1] * lamp[1] + normals[i, 2] * lamp[2]
        if towards > 0.0:
            facing[i] = towards
            asked[i] = _below(points[i, 0], points[i, 1], points[i, 2], axes, low, per_mm, heights)
    return sky, facing, asked
