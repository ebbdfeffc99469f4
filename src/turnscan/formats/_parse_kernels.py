"""Text to lines, words and numbers: what the compiled loops of the readers share.

A reader that stumbles returns a code below and the byte at which it did.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bytes, Floats, Scalar
from turnscan.compiled import njit

OK, NOT_A_NUMBER, TOO_MANY, CUT_SHORT, BAD_INDEX, NO_CODE, NOT_FINITE = range(7)
"""What stopped a reader; a number that is no finite number is NOT_FINITE."""
NUMBER, NAN, WORD = range(3)


@njit(cache=True, nogil=True)
def _digits(text: Bytes, p: int, b: int) -> tuple[int, int, int, int]:
    """Return mantissa and power of ten of digits with a point, how many, and where they end."""
    mantissa, power, count, point = 0, 0, 0, 0
    while p < b:
        c = text[p]
        if 48 <= c <= 57:
            count += 1
            if mantissa < 100_000_000_000_000_000:
                mantissa = mantissa * 10 + (c - 48)
                power -= point
            else:
                power += 1 - point
        elif c == 46 and not point:
            point = 1
        else:
            break
        p += 1
    return mantissa, power, count, p


@njit(cache=True, nogil=True)
def _exponent(text: Bytes, p: int, b: int) -> tuple[int, bool]:
    """Return the signed whole number that ``text[p:b]`` is, and whether it is one."""
    down = p < b and text[p] == 45
    if p < b and (text[p] == 45 or text[p] == 43):
        p += 1
    value, start = 0, p
    while p < b and 48 <= text[p] <= 57:
        value = min(value * 10 + (text[p] - 48), 9999)
        p += 1
    return (-value if down else value), p == b and p > start


@njit(cache=True, nogil=True)
def _times_ten_to(mantissa: int, power: int) -> float:
    value = float(mantissa)
    if mantissa == 0 or power == 0:
        return value
    if power < -300:
        return value / 1e300 / 10.0 ** min(-power - 300, 300)
    if power < 0:
        return value / 10.0 ** (-power)
    return value * 10.0**power if power <= 308 else np.inf


@njit(cache=True, nogil=True)
def parse(text: Bytes, a: int, b: int) -> tuple[int, float]:
    """Return what ``text[a:b]`` is (number, nan or infinity, another word) and its value.

    Correctly rounded for up to 17 digits below 2**53 and powers of ten up to 22 (Clinger's fast
    path); to 2 units in the last place beyond. D stands for E, as Fortran writes it.
    """
    p = a
    if p < b and (text[p] == 45 or text[p] == 43):
        p += 1
    if p < b and (text[p] | 32 == 105 or text[p] | 32 == 110):
        return NAN, np.nan
    mantissa, power, count, p = _digits(text, p, b)
    if count == 0:
        return WORD, 0.0
    if p < b:
        if text[p] | 32 != 101 and text[p] | 32 != 100:
            return WORD, 0.0
        more, good = _exponent(text, p + 1, b)
        if not good:
            return WORD, 0.0
        power += more
    value = _times_ten_to(mantissa, power)
    if np.isinf(value):
        return NAN, np.nan
    return NUMBER, -value if text[a] == 45 else value


@njit(cache=True, nogil=True)
def next_line(text: Bytes, p: int) -> tuple[int, int, int]:
    """Return where the line at ``p`` begins and ends without blanks, and the next line's start."""
    end = p
    while end < len(text) and text[end] != 10:
        end += 1
    a, b = p, end
    while a < b and text[a] <= 32:
        a += 1
    while b > a and text[b - 1] <= 32:
        b -= 1
    return a, b, end + 1


@njit(cache=True, nogil=True)
def next_word(text: Bytes, p: int, end: int) -> tuple[int, int]:
    """Return where the next word before ``end`` begins and ends; empty where there is none."""
    while p < end and text[p] <= 32:
        p += 1
    q = p
    while q < end and text[q] > 32:
        q += 1
    return p, q


@njit(cache=True, nogil=True)
def same(text: Bytes, a: int, b: int, word: Bytes) -> bool:
    """Tell whether ``text[a:b]`` is the ASCII word, upper or lower case."""
    if b - a != len(word):
        return False
    for i in range(len(word)):
        c = text[a + i]
        if 97 <= c <= 122:
            c -= 32
        if c != word[i]:
            return False
    return True


@njit(cache=True, nogil=True)
def room(array: npt.NDArray[Scalar], n: int) -> npt.NDArray[Scalar]:
    """Return the array, or one twice as long when row n does not fit."""
    if n < len(array):
        return array
    longer = np.empty((2 * len(array), *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    return longer


@njit(cache=True, nogil=True)
def whole_index(text: Bytes, s: int, e: int) -> int:
    """Return the whole number from 0 that ``text[s:e]`` is, or −1."""
    kind, value = parse(text, s, e)
    whole = kind == NUMBER and value == np.floor(value) and 0 <= value < 2**31
    return int(value) if whole else -1


@njit(cache=True, nogil=True)
def read_triple(text: Bytes, at: int, end: int, row: Floats) -> tuple[int, int]:
    """Read three numbers into ``row``; returns a code and the byte where reading stopped."""
    for c in range(3):
        s, at = next_word(text, at, end)
        kind, value = parse(text, s, at)
        if kind != NUMBER:
            return (NOT_FINITE if kind == NAN else NOT_A_NUMBER), s
        row[c] = value
    return OK, at
