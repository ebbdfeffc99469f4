"""Compiled kernels that find faces which cut through each other; imported only when used."""
# mypy: disable-error-code="untyped-decorator,no-any-return"

from __future__ import annotations

from typing import Any

import numpy as np

from turnscan.compiled import njit

_FLAT = 1e-12
"""Corners nearer to a plane than this share of a triangle's size lie in it."""


@njit(cache=True, nogil=True)
def crossings(corners: Any, numbers: Any, asked: Any, low: Any, high: Any, most: int) -> Any:
    """Pairs (k, 2) of triangles (f, 3, 3) that have more in common than vertices and edges.

    ``numbers`` (f, 3) are the vertices; only pairs with a triangle ``asked`` (f,) for are looked
    for, and no more than ``most`` of them. ``low`` and ``high`` are the boxes of a heap over the
    triangles, as `boxes` gives them.
    """
    leaves = len(low) // 2
    count = len(corners)
    found = np.empty((64, 2), dtype=np.int32)
    made = 0
    stack = np.empty(128, dtype=np.int64)
    n, d = np.empty(3), np.empty(3)
    for leaf in range(leaves):
        node = leaf + leaves
        begin, end = leaf * count // leaves, (leaf + 1) * count // leaves
        stack[0], top = 1, int(asked[begin:end].any())
        while top:
            top -= 1
            other = stack[top]
            if not _meet(low, high, node, other):
                continue
            if other < leaves:
                stack[top], stack[top + 1] = 2 * other, 2 * other + 1
                top += 2
                continue
            for i in range(begin, end):
                if not asked[i]:
                    continue
                for j in range(
                    (other - leaves) * count // leaves, (other - leaves + 1) * count // leaves
                ):
                    # A pair that is asked for twice is looked at once.
                    if j == i or (asked[j] and j < i) or _apart(corners, i, j):
                        continue
                    if not _cross(corners[i], corners[j], numbers[i], numbers[j], n, d):
                        continue
                    if made == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    found[made, 0], found[made, 1] = i, j
                    made += 1
                    if made == most:
                        return found[:made].copy()
    return found[:made].copy()


@njit(cache=True, nogil=True)
def _meet(low: Any, high: Any, a: int, b: int) -> bool:
    return (
        low[a, 0] <= high[b, 0]
        and low[b, 0] <= high[a, 0]
        and low[a, 1] <= high[b, 1]
        and low[b, 1] <= high[a, 1]
        and low[a, 2] <= high[b, 2]
        and low[b, 2] <= high[a, 2]
    )


@njit(cache=True, nogil=True)
def _apart(c: Any, i: int, j: int) -> bool:
    """Whether the boxes of two triangles do not meet."""
    for k in range(3):
        if min(c[i, 0, k], c[i, 1, k], c[i, 2, k]) > max(c[j, 0, k], c[j, 1, k], c[j, 2, k]):
            return True
        if min(c[j, 0, k], c[j, 1, k], c[j, 2, k]) > max(c[i, 0, k], c[i, 1, k], c[i, 2, k]):
            return True
    return False


@njit(cache=True, nogil=True)
def _cross(a: Any, b: Any, of_a: Any, of_b: Any, n: Any, d: Any) -> bool:
    size = _plane(a, n)
    if not size > 0.0:
        return False
    flat = True
    above, below = False, False
    for i in range(3):
        d[i] = 0.0
        for k in range(3):
            d[i] += n[k] * (b[i, k] - a[0, k])
        if of_b[i] == of_a[0] or of_b[i] == of_a[1] or of_b[i] == of_a[2]:
            d[i] = 0.0
        flat = flat and abs(d[i]) <= _FLAT * size
        above, below = above or d[i] > 0.0, below or d[i] < 0.0
    if flat:
        return _overlap(a, b, n)
    if above and below and _pierced(b, a, of_b, of_a, d):
        return True
    if not _plane(b, n) > 0.0:
        return False
    for i in range(3):
        d[i] = 0.0
        for k in range(3):
            d[i] += n[k] * (a[i, k] - b[0, k])
    return _pierced(a, b, of_a, of_b, d)


@njit(cache=True, nogil=True)
def _plane(a: Any, n: Any) -> float:
    """Write the unit normal; gives the longest side, 0 where there is no area."""
    longest = 0.0
    for i in range(3):
        s = 0.0
        for k in range(3):
            s += (a[(i + 1) % 3, k] - a[i, k]) ** 2
        longest = max(longest, s)
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        n[k] = (a[1, p] - a[0, p]) * (a[2, q] - a[0, q]) - (a[1, q] - a[0, q]) * (a[2, p] - a[0, p])
    twice = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if not twice > 1e-14 * longest:
        return 0.0
    for k in range(3):
        n[k] /= twice
    return np.sqrt(longest)


@njit(cache=True, nogil=True)
def _pierced(a: Any, b: Any, of_a: Any, of_b: Any, d: Any) -> bool:
    """Whether a side of ``a`` runs through ``b``; ``d`` are a's distances from b's plane."""
    for i in range(3):
        j = (i + 1) % 3
        if not d[i] * d[j] < 0.0:
            continue
        common = False
        for k in range(3):
            common = common or of_a[i] == of_b[k] or of_a[j] == of_b[k]
        if common:
            continue
        x = _volume(a[i], a[j], b[0], b[1])
        y = _volume(a[i], a[j], b[1], b[2])
        z = _volume(a[i], a[j], b[2], b[0])
        if (x >= 0.0 and y >= 0.0 and z >= 0.0) or (x <= 0.0 and y <= 0.0 and z <= 0.0):
            return True
    return False


@njit(cache=True, nogil=True)
def _volume(p: Any, q: Any, a: Any, b: Any) -> float:
    """Six times the signed volume of the tetrahedron."""
    u0, u1, u2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    v0, v1, v2 = a[0] - p[0], a[1] - p[1], a[2] - p[2]
    w0, w1, w2 = b[0] - p[0], b[1] - p[1], b[2] - p[2]
    return u0 * (v1 * w2 - v2 * w1) + u1 * (v2 * w0 - v0 * w2) + u2 * (v0 * w1 - v1 * w0)


@njit(cache=True, nogil=True)
def _overlap(a: Any, b: Any, n: Any) -> bool:
    """Whether triangles in one plane of normal n overlap: no side of either parts them."""
    k = 0
    for i in range(1, 3):
        if abs(n[i]) > abs(n[k]):
            k = i
    x, y = (k + 1) % 3, (k + 2) % 3
    return not (_parted(a, b, x, y) or _parted(b, a, x, y))


@njit(cache=True, nogil=True)
def _parted(a: Any, b: Any, x: int, y: int) -> bool:
    for i in range(3):
        j, o = (i + 1) % 3, (i + 2) % 3
        ux, uy = a[j, x] - a[i, x], a[j, y] - a[i, y]
        inside = ux * (a[o, y] - a[i, y]) - uy * (a[o, x] - a[i, x])
        outside = True
        for k in range(3):
            side = ux * (b[k, y] - a[i, y]) - uy * (b[k, x] - a[i, x])
            outside = outside and side * inside <= 1e-12 * inside * inside
        if outside:
            return True
    return False
