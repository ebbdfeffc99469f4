# mypy: disable-error-code="no-any-return"
"""What a picture shows of a mesh: depth of its pixels, and the best views of each vertex.

This module imports numba; import it inside functions only.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Singles
from turnscan.compiled import njit

Words = npt.NDArray[np.uint16]


@njit(cache=True, nogil=True)
def draw_nearness(uv: Floats, z: Floats, faces: Ints, near: Singles) -> None:
    """Draw faces (f, 3) into ``near`` (H, W), 1/mm: 1/z of what stands nearest; 0 stays nothing.

    ``uv`` (v, 2) px, NaN outside the lens; ``z`` (v,) mm. 1/z is linear over a triangle's picture.
    """
    h, w = near.shape
    for f in range(len(faces)):
        a, b, c = faces[f]
        if not (z[a] > 0.0 and z[b] > 0.0 and z[c] > 0.0):
            continue
        xa, ya, xb, yb, xc, yc = uv[a, 0], uv[a, 1], uv[b, 0], uv[b, 1], uv[c, 0], uv[c, 1]
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        if not abs(area) > 0.0:  # NaN too
            continue
        na, nb, nc = 1.0 / z[a], 1.0 / z[b], 1.0 / z[c]
        first, last = max(0.0, math.ceil(min(ya, yb, yc))), min(h - 1.0, max(ya, yb, yc))
        left, right = max(0.0, math.ceil(min(xa, xb, xc))), min(w - 1.0, max(xa, xb, xc))
        for v in range(int(first), math.floor(last) + 1):
            for u in range(int(left), math.floor(right) + 1):
                s = ((xb - u) * (yc - v) - (xc - u) * (yb - v)) / area
                t = ((xc - u) * (ya - v) - (xa - u) * (yc - v)) / area
                r = 1.0 - s - t
                if s < 0.0 or t < 0.0 or r < 0.0:
                    continue
                n = s * na + t * nb + r * nc
                if n > near[v, u]:
                    near[v, u] = n


@njit(cache=True, nogil=True)
def keep_best_views(
    number: int, uv: Floats, z: Floats, cosine: Floats, slack: Floats, pixels: Words, full: float,
    cover: Singles, margin: Singles, views: tuple[Singles, Singles, Ints, Bools],
) -> None:  # fmt: skip
    """Sample picture ``number`` at the vertices it shows; each keeps its best k views.

    Shown is a vertex that faces the camera (``cosine`` (v,) of the angle of incidence, NaN or low:
    not), and lies at most ``slack`` (v,) mm behind ``cover`` (H, W) mm, the nearest of what the
    pixels around its own show. Its weight is the squared cosine, times ``margin`` (H, W), less
    near an edge in depth and 0 at one; next to nothing where a pixel is full. ``views``: weight
    (v, k), colour (v, k, channels) as share of ``full``, number of the picture (v, k), and whether
    a picture shows the vertex at all, if only at such an edge (v,).
    """
    h, w, channels = pixels.shape
    weights, colours, numbers, glimpsed = views
    k = weights.shape[1]
    for i in range(len(z)):
        x, y = uv[i, 0], uv[i, 1]
        if not (cosine[i] > 0.0 and 0.0 <= x < w - 1.0 and 0.0 <= y < h - 1.0):
            continue
        u, v = int(x + 0.5), int(y + 0.5)
        if z[i] > cover[v, u] + slack[i]:
            continue
        glimpsed[i] = True
        weight = cosine[i] * cosine[i] * margin[v, u]
        u, v = int(x), int(y)
        if _is_full(pixels, u, v, full):
            weight *= 1e-3
        worst = 0
        for j in range(1, k):
            if weights[i, j] < weights[i, worst]:
                worst = j
        if weight <= weights[i, worst]:
            continue
        weights[i, worst], numbers[i, worst] = weight, number
        x -= u
        y -= v
        for c in range(channels):
            top = (1.0 - x) * pixels[v, u, c] + x * pixels[v, u + 1, c]
            low = (1.0 - x) * pixels[v + 1, u, c] + x * pixels[v + 1, u + 1, c]
            colours[i, worst, c] = ((1.0 - y) * top + y * low) / full


@njit(cache=True, nogil=True, inline="always")
def _is_full(pixels: Words, u: int, v: int, full: float) -> bool:
    """Whether one of the four pixels from (u, v) on is as good as full in any channel."""
    for dv in range(2):
        for du in range(2):
            for c in range(pixels.shape[2]):
                if pixels[v + dv, u + du, c] >= 0.98 * full:
                    return True
    return False
