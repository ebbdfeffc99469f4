"""Coordinates as decimal text: how many digits, and rows of numbers between fixed words."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from turnscan import __version__
from turnscan.arrays import Floats
from turnscan.errors import ExportError

LARGEST = 1e9
"""mm. A coordinate beyond a thousand kilometres is an error, and would cost digits."""
LEAST_DECIMALS = 6
RELATIVE = 1e-8
"""The last decimal is no coarser than this part of the longest side."""
HEX = -1
"""As a column's decimals: an upper-case hexadecimal integer (a DXF handle)."""
_LARGEST_WHOLE = 9e18
_CHUNK = 1 << 16
_COMMENT = 200
_HEAD = 1 << 16
"""Bytes of a file in which its origin stands."""

Longs = npt.NDArray[np.int64]


def decimals_for(points: Floats) -> int:
    """Return how many decimals keep the shape of (n, 3) points.

    At least 6 (a nanometre for coordinates in mm), and enough that the last one is at most
    1e-8 of the longest side; never more than a double of the largest coordinate holds.

    Raises ExportError where a coordinate is not finite or is beyond 1e9 mm.
    """
    if not points.size:
        return LEAST_DECIMALS
    largest = float(np.abs(points).max())
    if not largest <= LARGEST:
        raise ExportError(
            f"a coordinate of {largest:g} mm cannot be written, the limit is {LARGEST:g} mm",
            hint="check the unit and the rig's calibration",
        )
    side = float(np.ptp(points, axis=0).max())
    wanted = LEAST_DECIMALS if side <= 0 else math.ceil(-math.log10(max(side, 1e-300) * RELATIVE))
    exact = 15 if largest < 1 else 15 - math.ceil(math.log10(largest))
    return max(LEAST_DECIMALS, min(wanted, exact))


def scaled(values: npt.ArrayLike, decimals: int) -> Longs:
    """Return values × 10**decimals rounded to integers; NaN becomes the missing mark."""
    array = np.asarray(values, np.float64)
    missing = np.isnan(array)
    shifted = np.where(missing, 0.0, array) * 10.0**decimals
    if float(np.abs(shifted).max(initial=0.0)) >= _LARGEST_WHOLE:
        raise ExportError(
            f"a value of {np.nanmax(np.abs(array)):g} does not fit the digits of a text file",
            hint="check the unit and the rig's calibration",
        )
    whole: Longs = np.rint(shifted).astype(np.int64)
    whole[missing] = np.iinfo(np.int64).min
    return whole


def rows_text(
    values: Longs, decimals: Sequence[int], literals: Sequence[str], chunk: int = _CHUNK
) -> Iterator[bytes]:
    """Yield each row of integers as literal, number, literal, number … literal, chunk by chunk.

    values (r, k) as `scaled` gives them; decimals: k numbers, or `HEX`;
    literals: k + 1 ASCII texts.
    """
    from turnscan.formats._write_kernels import WIDEST, put_rows

    words = [text.encode("ascii") for text in literals]
    text = np.frombuffer(b"".join(words), np.uint8)
    cuts = np.concatenate([[0], np.cumsum([len(w) for w in words])]).astype(np.int64)
    places = np.array(decimals, np.int64)
    out = np.empty((len(text) + WIDEST * len(places)) * min(chunk, max(len(values), 1)), np.uint8)
    for start in range(0, len(values), chunk):
        block = np.ascontiguousarray(values[start : start + chunk])
        yield out[: put_rows(block, places, text, cuts, out)].tobytes()


def read_about(data: bytes) -> dict[str, object]:
    """What `about_lines` put into a file of text, or a PLY; empty where there is nothing."""
    found = re.findall(rb"turnscan (\d+)/(\d+) ([^\r\n]*)", data[:_HEAD])
    pieces = [text for i, (number, _, text) in enumerate(found) if int(number) == i + 1]
    try:
        value = json.loads(b"".join(pieces))
    except ValueError:  # no such lines, or truncated
        return {}
    return value if isinstance(value, dict) else {}


def about_lines(about: Mapping[str, object]) -> list[str]:
    """Return what a file says of its origin, as short ASCII lines that `read_about` joins again."""
    text = json.dumps({"turnscan": __version__, **about}, sort_keys=True, separators=(",", ":"))
    pieces = [text[i : i + _COMMENT] for i in range(0, len(text), _COMMENT)]
    return [f"turnscan {i + 1}/{len(pieces)} {piece}" for i, piece in enumerate(pieces)]
