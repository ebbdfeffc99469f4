"""The compiled loops that read a DXF: where its entities are, and the numbers in them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Bytes, Floats, Longs
from turnscan.compiled import njit
from turnscan.formats._parse_kernels import (
    CUT_SHORT,
    NAN,
    NO_CODE,
    NOT_A_NUMBER,
    NOT_FINITE,
    NUMBER,
    OK,
    TOO_MANY,
    next_line,
    parse,
    room,
    same,
)


@njit(cache=True, nogil=True)
def _group(text: Bytes, p: int) -> tuple[int, int, int, int, int]:
    """Return the group code at ``p`` (−1 at the end, −2 for none), its value's bounds, what is
    after the pair, and where the code stood."""
    a, b, after = next_line(text, p)
    if after >= len(text):
        return -1, a, b, len(text), a
    code = 0
    for i in range(a, b):
        if not 48 <= text[i] <= 57 or code > 100_000:
            return -2, a, b, p, a
        code = code * 10 + (text[i] - 48)
    s, e, after = next_line(text, after)
    return (code if a < b else -2), s, e, after, a


@njit(cache=True, nogil=True)
def find_entities(
    text: Bytes, marks: tuple[Bytes, ...], words: tuple[Bytes, ...], limit: int
) -> tuple[int, int, npt.NDArray[np.int8], Longs, int]:
    """Find the entities of the ENTITIES section.

    marks: the words SECTION, ENTITIES, ENDSEC, EOF; words: the entities of interest. Returns a
    code, the byte, what each entity is (its place in ``words``, or −1), where its groups
    begin, and how many there are.
    """
    kinds = np.empty((1024, 1), np.int8)
    starts = np.empty((1024, 1), np.int64)
    n, p = 0, 0
    inside, opening = False, False
    while True:
        group, a, b, p, at = _group(text, p)
        if group < 0:
            return (CUT_SHORT if group == -1 else NO_CODE), at, kinds, starts, n
        if group == 2 and opening:
            inside = same(text, a, b, marks[1])
        if group != 0:
            opening = False
            continue
        opening = same(text, a, b, marks[0])
        if same(text, a, b, marks[3]):
            return OK, p, kinds, starts, n
        if same(text, a, b, marks[2]):
            inside = False
        if not inside:
            continue
        if n >= limit:
            return TOO_MANY, a, kinds, starts, n
        kinds, starts = room(kinds, n), room(starts, n)
        kinds[n, 0] = -1
        for k in range(len(words)):
            if same(text, a, b, words[k]):
                kinds[n, 0] = k
        starts[n, 0] = p
        n += 1


@njit(cache=True, nogil=True)
def read_groups(
    text: Bytes, starts: Longs, reals: Floats, seen: Bools, wholes: Longs
) -> tuple[int, int]:
    """Read groups 10 to 33 and 70 to 74 of entities that begin at ``starts`` (e,).

    Coordinates go to reals (e, 3c): x y z of corner 0, of corner 1 …, and are marked in seen;
    groups 70 to 74 go to wholes (e, 5). What is absent keeps its value. Returns a code, the byte.
    """
    corners = reals.shape[1] // 3
    for i in range(len(starts)):
        group, a, b, p, _ = _group(text, starts[i])
        while group > 0:
            real = 10 <= group <= 39 and group % 10 < corners
            if real or 70 <= group <= 74:
                what, value = parse(text, a, b)
                if what != NUMBER:
                    return (NOT_FINITE if what == NAN else NOT_A_NUMBER), a
                if real:
                    column = group % 10 * 3 + group // 10 - 1
                    reals[i, column] = value
                    seen[i, column] = True
                elif value != np.floor(value) or abs(value) > 1e9:
                    return NOT_A_NUMBER, a
                else:
                    wholes[i, group - 70] = int(value)
            group, a, b, p, _ = _group(text, p)
    return OK, 0


@njit(cache=True, nogil=True)
def on_layers(text: Bytes, starts: Longs, word: Bytes) -> Bools:
    """(e,) True for entities that begin at ``starts`` and whose layer's name has the word in it."""
    out = np.zeros(len(starts), np.bool_)
    for i in range(len(starts)):
        group, a, b, p, _ = _group(text, starts[i])
        while group > 0 and group != 8:
            group, a, b, p, _ = _group(text, p)
        if group == 8:
            for k in range(a, b - len(word) + 1):
                out[i] = out[i] or same(text, k, k + len(word), word)
    return out


@njit(cache=True, nogil=True)
def read_mesh_entity(
    text: Bytes, start: int, limit: int
) -> tuple[int, int, Floats, int, Longs, int]:
    """Read one MESH; returns a code, the byte, points, how many, polygons, how many numbers.

    Polygons stand end to end as n i j k …, counted from 0, as in the file.
    """
    points = np.empty((1024, 3), np.float64)
    lists = np.empty(4096, np.int64)
    n, k, declared, expected = 0, 0, 0, 0
    group, a, b, p, at = _group(text, start)
    while group > 0:
        if group in (10, 20, 30, 90, 92, 93):
            what, value = parse(text, a, b)
            if what != NUMBER:
                return (NOT_FINITE if what == NAN else NOT_A_NUMBER), a, points, n, lists, k
            if n > 3 * limit or k > 4 * limit:
                return TOO_MANY, a, points, n, lists, k
            if group == 10:
                points = room(points, n)
                points[n] = 0.0
                n += 1
            if group <= 30 and n > 0:
                points[n - 1, group // 10 - 1] = value
            elif group == 92:
                declared = int(value)
            elif group == 93:
                expected = int(value)
            elif group == 90 and k < expected:
                lists = room(lists, k)
                lists[k] = int(value)
                k += 1
        group, a, b, p, at = _group(text, p)
    code = OK if k == expected and n == declared else CUT_SHORT
    return code, at, points, n, lists, k
