"""What PLY, OBJ, STL and XYZ say, polygons to triangles, equal points: compiled loops.

A reader that stumbles returns a code of `_parse_kernels` and the byte at which it did.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bytes, Floats, Ints, Longs
from turnscan.compiled import njit
from turnscan.formats._parse_kernels import (
    BAD_INDEX,
    CUT_SHORT,
    NOT_A_NUMBER,
    OK,
    TOO_MANY,
    WORD,
    next_line,
    next_word,
    parse,
    read_triple,
    room,
    same,
    whole_index,
)


@njit(cache=True, nogil=True)
def shape_of_table(text: Bytes) -> tuple[int, int]:
    """Return how many lines are neither blank nor comments, and how many words the first has."""
    rows, columns, p = 0, 0, 0
    while p < len(text):
        a, b, p = next_line(text, p)
        if a == b or text[a] == 35:
            continue
        rows += 1
        while rows == 1 and a < b:
            s, a = next_word(text, a, b)
            columns += s < a
    return rows, columns


@njit(cache=True, nogil=True)
def read_table(text: Bytes, p: int, table: Floats, comments: bool) -> tuple[int, int]:
    """Fill ``table`` (r, k) from r lines of exactly k numbers; NaN is allowed.

    Blank lines, and with ``comments`` lines that begin with #, are passed over. Returns a code
    and the byte where reading stopped.
    """
    for r in range(len(table)):
        a, b, after = p, p, p
        while p < len(text):
            a, b, after = next_line(text, p)
            if a < b and not (comments and text[a] == 35):
                break
            p = after
        if p >= len(text):
            return CUT_SHORT, len(text)
        at = a
        for c in range(table.shape[1]):
            s, e = next_word(text, at, b)
            if s == e:
                return NOT_A_NUMBER, a
            kind, value = parse(text, s, e)
            if kind == WORD:
                return NOT_A_NUMBER, s
            table[r, c] = value
            at = e
        if next_word(text, at, b)[0] != b:
            return NOT_A_NUMBER, at
        p = after
    return OK, p


@njit(cache=True, nogil=True)
def read_lists(
    text: Bytes, p: int, count: int, before: int, limit: int
) -> tuple[int, int, Longs, int]:
    """Read ``count`` lines of polygons, "n i j k …" after ``before`` numbers, end to end.

    Returns a code, the byte where reading stopped, the numbers (n i j k n i j …) and how many.
    """
    out = np.empty(4 * max(count, 1), np.int64)
    n = 0
    for _ in range(count):
        a, b, after = p, p, p
        while p < len(text):
            a, b, after = next_line(text, p)
            if a < b:
                break
            p = after
        if p >= len(text):
            return CUT_SHORT, len(text), out, n
        at = a
        for _skip in range(before):
            _, at = next_word(text, at, b)
        left = 1
        sized = False
        while left:
            s, at = next_word(text, at, b)
            number = whole_index(text, s, at)
            if number < 0:
                return NOT_A_NUMBER, s, out, n
            if n >= 4 * limit:
                return TOO_MANY, s, out, n
            out = room(out, n)
            out[n] = number
            n += 1
            left = left - 1 if sized else number
            sized = True
        p = after
    return OK, p, out, n


@njit(cache=True, nogil=True)
def fans(lists: Longs, limit: int) -> tuple[int, Longs]:
    """Cut polygons, written end to end as n i j k …, into triangles (t, 3).

    Returns a code: CUT_SHORT where a polygon says it is longer than the list.
    """
    triangles, p = 0, 0
    while p < len(lists):
        size = lists[p]
        if size < 0 or p + size >= len(lists):
            return CUT_SHORT, np.empty((0, 3), np.int64)
        triangles += max(size - 2, 0)
        p += size + 1
    if triangles > limit:
        return TOO_MANY, np.empty((0, 3), np.int64)
    out = np.empty((triangles, 3), np.int64)
    t, p = 0, 0
    while p < len(lists):
        for i in range(2, lists[p]):
            out[t, 0], out[t, 1], out[t, 2] = lists[p + 1], lists[p + i], lists[p + i + 1]
            t += 1
        p += lists[p] + 1
    return OK, out


@njit(cache=True, nogil=True)
def cells(lists: Longs, count: int) -> tuple[int, Longs]:
    """The entry of each of ``count`` lists of one or none, written end to end; −1 for none.

    Returns the length of the longest list before it.
    """
    out = np.full(count, -1, np.int64)
    longest, p = 0, 0
    for k in range(count):
        longest = max(longest, lists[p])
        if lists[p] > 0:
            out[k] = lists[p + 1]
        p += lists[p] + 1
    return longest, out


@njit(cache=True, nogil=True)
def read_stl_text(text: Bytes, word: Bytes, limit: int) -> tuple[int, int, Floats, int]:
    """Read the lines "vertex x y z"; returns a code, the byte, corners (n, 3) and n."""
    out = np.empty((1024, 3), np.float64)
    n, p = 0, 0
    while p < len(text):
        a, b, after = next_line(text, p)
        s, at = next_word(text, a, b)
        if same(text, s, at, word):
            if n >= 3 * limit:
                return TOO_MANY, a, out, n
            out = room(out, n)
            code, at = read_triple(text, at, b, out[n])
            if code != OK:
                return code, at, out, n
            n += 1
        p = after
    return OK, p, out, n


@njit(cache=True, nogil=True)
def _obj_face(
    text: Bytes, at: int, end: int, v: int, out: Longs, n: int
) -> tuple[int, int, Longs, int]:
    """Add one "f" line, after v vertices, to the polygons in ``out``."""
    start = n
    out = room(out, n)
    n += 1
    while True:
        s, at = next_word(text, at, end)
        if s == at:
            break
        back = 1 if text[s] == 45 else 0
        e = s
        while e < at and text[e] != 47:
            e += 1
        number = whole_index(text, s + back, e)
        index = v - number if back else number - 1
        if number < 0:
            return NOT_A_NUMBER, s, out, n
        if number == 0 or index < 0:
            return BAD_INDEX, s, out, n
        out = room(out, n)
        out[n] = index
        n += 1
    out[start] = n - start - 1
    return (OK if out[start] >= 3 else CUT_SHORT), at, out, n


@njit(cache=True, nogil=True)
def read_obj(text: Bytes, limit: int) -> tuple[int, int, Floats, int, Longs, int, Floats]:
    """Read "v" and "f" lines; returns a code, the byte, vertices, how many, polygons, how many, and
    the colours that stand behind the coordinates of vertices, NaN where none do.

    Polygons stand end to end as n i j k …, counted from 0.
    """
    points, colours = np.empty((1024, 3), np.float64), np.empty((1024, 3), np.float64)
    faces = np.empty(4096, np.int64)
    code, v, n, p, at = OK, 0, 0, 0, 0
    while p < len(text) and code == OK:
        a, b, p = next_line(text, p)
        at = a
        if b - a < 2 or text[a + 1] > 32:
            continue
        if v > 3 * limit or n > 4 * limit:
            return TOO_MANY, a, points, v, faces, n, colours
        if text[a] == 118:
            points, colours = room(points, v), room(colours, v)
            code, at = read_triple(text, a + 1, b, points[v])
            if code == OK and read_triple(text, at, b, colours[v])[0] != OK:
                colours[v] = np.nan
            v += 1
        elif text[a] == 102:
            code, at, faces, n = _obj_face(text, a + 1, b, v, faces, n)
    return code, at, points, v, faces, n, colours


@njit(cache=True, nogil=True)
def merge(points: npt.NDArray[np.uint64]) -> tuple[Ints, Ints]:
    """Find equal points; returns which of each is the first (m,), and each one's number (n,).

    points (n, 3) float64 seen as uint64, without negative zeros.
    """
    n = len(points)
    size = 1
    while size < 2 * n:
        size *= 2
    slots = np.full(size, -1, np.int32)
    first = np.empty(n, np.int32)
    number = np.empty(n, np.int32)
    m = 0
    for i in range(n):
        h = points[i, 0] * np.uint64(0x9E3779B97F4A7C15)
        h = (h ^ (h >> np.uint64(32)) ^ points[i, 1]) * np.uint64(0xC2B2AE3D27D4EB4F)
        h = (h ^ (h >> np.uint64(29)) ^ points[i, 2]) * np.uint64(0x165667B19E3779F9)
        s = np.int64((h ^ (h >> np.uint64(32))) & np.uint64(size - 1))
        while True:
            k = slots[s]
            if k < 0:
                slots[s] = m
                first[m] = i
                number[i] = m
                m += 1
                break
            j = first[k]
            if (
                points[j, 0] == points[i, 0]
                and points[j, 1] == points[i, 1]
                and points[j, 2] == points[i, 2]
            ):
                number[i] = k
                break
            s = (s + 1) & (size - 1)
    return first[:m], number


@njit(cache=True, nogil=True)
def _whole(data: Bytes, p: int, width: int, little: bool) -> int:
    value = 0
    for i in range(width):
        value |= int(data[p + i]) << (8 * (i if little else width - 1 - i))
    return value


@njit(cache=True, nogil=True)
def read_binary_lists(
    data: Bytes, p: int, count: int, widths: tuple[int, int, int, int], little: bool, limit: int
) -> tuple[int, int, Longs, int]:
    """Read ``count`` polygons of unsigned numbers, end to end.

    widths: bytes before the list, of its length, of each index, after the list. Returns a code,
    the byte where reading stopped, the numbers (n i j k n i j …) and how many.
    """
    before, wide, each, after = widths
    out = np.empty(4 * max(count, 1), np.int64)
    n = 0
    for _ in range(count):
        p += before
        if p + wide > len(data):
            return CUT_SHORT, len(data), out, n
        size = _whole(data, p, wide, little)
        p += wide
        if size < 0 or p + size * each + after > len(data):
            return CUT_SHORT, len(data), out, n
        if n + size >= 4 * limit:
            return TOO_MANY, p, out, n
        out = room(out, n)
        out[n] = size
        n += 1
        for _i in range(size):
            out = room(out, n)
            out[n] = _whole(data, p, each, little)
            n += 1
            p += each
        p += after
    return OK, p, out, n
