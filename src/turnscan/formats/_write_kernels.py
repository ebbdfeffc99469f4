"""Numbers to text, and faces to polyfaces: the compiled loops of the writers.

Numba compiles on first use and keeps the result, so this module is imported inside functions.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bytes, Ints, Longs
from turnscan.compiled import njit

MISSING = np.iinfo(np.int64).min
"""As a value: no number is known; written ``nan``."""
WIDEST = 24
"""No number takes more bytes: sign, 19 digits, point, and leading zeros up to 15 decimals."""


@njit(cache=True, nogil=True)
def _put(out: Bytes, p: int, value: int, decimals: int) -> int:
    if value == MISSING:
        out[p], out[p + 1], out[p + 2] = 110, 97, 110
        return p + 3
    if value < 0:
        out[p] = 45
        p += 1
        value = -value
    base = 16 if decimals < 0 else 10
    digits = 1
    rest = value // base
    while rest > 0:
        digits += 1
        rest //= base
    point = max(decimals, 0)
    digits = max(digits, point + 1)
    q = p + digits + (1 if point else 0)
    end = q
    for i in range(digits):
        if point and i == point:
            q -= 1
            out[q] = 46
        q -= 1
        d = value % base
        value //= base
        out[q] = d + 48 if d < 10 else d + 55
    return end


@njit(cache=True, nogil=True)
def put_rows(values: Longs, decimals: Longs, text: Bytes, cuts: Longs, out: Bytes) -> int:
    """Write each row of integers as literal, number, literal, number … literal; return the length.

    values (r, k) int64: the number times 10**decimals; decimals (k,); text: the literals end to
    end, literal j is ``text[cuts[j]:cuts[j + 1]]``; out: uint8, large enough.
    """
    rows, columns = values.shape
    p = 0
    for r in range(rows):
        for j in range(columns + 1):
            for i in range(cuts[j], cuts[j + 1]):
                out[p] = text[i]
                p += 1
            if j < columns:
                p = _put(out, p, values[r, j], decimals[j])
    return p


@njit(cache=True, nogil=True)
def split_polyfaces(
    faces: Ints, vertex_count: int, max_vertices: int, max_faces: int
) -> tuple[Longs, Longs, Ints, Ints]:
    """Cut faces into runs that each use few enough vertices, renumbered within the run.

    faces (f, 3). Returns the face each run starts with (r + 1,), the place in ``used`` where
    each run's vertices start (r + 1,), the vertices used by each run end to end, and the
    faces (f, 3) counted from 0 within their run.
    """
    stamp = np.full(vertex_count, -1, np.int32)
    number = np.zeros(vertex_count, np.int32)
    local = np.empty_like(faces)
    used = np.empty(3 * len(faces), np.int32)
    face_starts = np.empty(len(faces) + 1, np.int64)
    vertex_starts = np.empty(len(faces) + 1, np.int64)
    run, here, total = 0, 0, 0
    face_starts[0] = vertex_starts[0] = 0
    for f in range(len(faces)):
        fresh = 0
        for c in range(3):
            if stamp[faces[f, c]] != run:
                fresh += 1
        if here + fresh > max_vertices or f - face_starts[run] >= max_faces:
            run += 1
            face_starts[run] = f
            vertex_starts[run] = total
            here = 0
        for c in range(3):
            v = faces[f, c]
            if stamp[v] != run:
                stamp[v] = run
                number[v] = here
                used[total] = v
                here += 1
                total += 1
            local[f, c] = number[v]
    face_starts[run + 1] = len(faces)
    vertex_starts[run + 1] = total
    return face_starts[: run + 2], vertex_starts[: run + 2], used[:total], local
