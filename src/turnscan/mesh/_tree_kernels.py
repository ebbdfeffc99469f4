"""Compiled kernels of a balanced tree of boxes over triangles; imported only when it is used.

Triangles are sorted along a Morton curve, so that neighbours in the list are neighbours in space;
the tree halves the list. Node 1 is the root, 2i and 2i + 1 are the halves of i; of ``leaves``
leaves number k holds the triangles from k · count // leaves up to those of the next.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints, Longs, Singles
from turnscan.compiled import njit

_ROUND = 1e-6
"""What rounding to 32 bits may take from a box is less than this share of its place."""
_CELLS = 1023
"""Along the longest side of what is sorted."""
_DIGIT = 10
"""Bits of a Morton code that are sorted by at a time."""


@njit(cache=True, nogil=True)
def morton_order(vertices: Floats, faces: Ints) -> Longs:
    """(f,) triangles (f, 3) in the order in which a Morton curve meets their centres."""
    count = len(faces)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for f in range(count):
        for k in range(3):
            at = _centre(vertices, faces, f, k)
            low[k], high[k] = min(low[k], at), max(high[k], at)
    size = 1e-9
    for k in range(3):
        size = max(size, high[k] - low[k])
    # The code in the upper half of a word, the triangle in the lower: both move together.
    word, other = np.empty(count, np.int64), np.empty(count, np.int64)
    for f in range(count):
        code = 0
        for k in range(3):
            cell = int((_centre(vertices, faces, f, k) - low[k]) / size * _CELLS)
            code |= _spread(cell) << k
        word[f] = code << 32 | f
    for shift in range(32, 32 + 3 * 10, _DIGIT):
        starts = np.zeros((1 << _DIGIT) + 1, np.int64)
        for i in range(count):
            starts[((word[i] >> shift) & ((1 << _DIGIT) - 1)) + 1] += 1
        starts = np.cumsum(starts)
        for i in range(count):
            digit = (word[i] >> shift) & ((1 << _DIGIT) - 1)
            other[starts[digit]] = word[i]
            starts[digit] += 1
        word, other = other, word
    for i in range(count):
        word[i] &= 0xFFFFFFFF
    return word


@njit(cache=True, nogil=True, inline="always")
def _spread(cell: int) -> int:
    """The ten bits of a number, each with two zeros before it."""
    cell = (cell | cell << 16) & 0x030000FF
    cell = (cell | cell << 8) & 0x0300F00F
    cell = (cell | cell << 4) & 0x030C30C3
    return (cell | cell << 2) & 0x09249249


@njit(cache=True, nogil=True, inline="always")
def _centre(vertices: Floats, faces: Ints, f: int, k: int) -> float:
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    return (vertices[a, k] + vertices[b, k] + vertices[c, k]) / 3.0


@njit(cache=True, nogil=True)
def spans(vertices: Floats, faces: Ints) -> Singles:
    """(f, 6) float32: from where to where triangles reach along each axis, a little more."""
    out = np.empty((len(faces), 6), np.float32)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for k in range(3):
            low = min(vertices[a, k], vertices[b, k], vertices[c, k])
            high = max(vertices[a, k], vertices[b, k], vertices[c, k])
            out[f, k] = low - abs(low) * _ROUND
            out[f, 3 + k] = high + abs(high) * _ROUND
    return out


@njit(cache=True, nogil=True)
def boxes(spans: Singles, leaves: int) -> Singles:
    """(2 · leaves, 6) boxes of the nodes, as `spans` has them; triangles in order."""
    count = len(spans)
    out = np.empty((2 * leaves, 6), np.float32)
    out[:, :3], out[:, 3:] = np.inf, -np.inf
    for leaf in range(leaves):
        node = leaves + leaf
        for f in range(leaf * count // leaves, (leaf + 1) * count // leaves):
            for k in range(3):
                out[node, k] = min(out[node, k], spans[f, k])
                out[node, 3 + k] = max(out[node, 3 + k], spans[f, 3 + k])
    for node in range(leaves - 1, 0, -1):
        for k in range(3):
            out[node, k] = min(out[2 * node, k], out[2 * node + 1, k])
            out[node, 3 + k] = max(out[2 * node, 3 + k], out[2 * node + 1, 3 + k])
    return out


@njit(cache=True, nogil=True, inline="always")
def meet(one: Singles, a: int, other: Singles, b: int) -> bool:
    """Whether a box meets another one."""
    return (
        (one[a, 0] <= other[b, 3])
        & (other[b, 0] <= one[a, 3])
        & (one[a, 1] <= other[b, 4])
        & (other[b, 1] <= one[a, 4])
        & (one[a, 2] <= other[b, 5])
        & (other[b, 2] <= one[a, 5])
    )
