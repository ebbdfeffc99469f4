"""The envelope: a JSON header and arrays in one message, the same way in every direction.

u32 little endian: n, the bytes of the header
n bytes of JSON (UTF-8); its key ``arrays`` lists {name, dtype, shape}
zeros up to the next multiple of 8, counted from the beginning of the message
the arrays, little endian, in the order listed, each begun at a multiple of 8
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.errors import FormatError
from turnscan.json_text import strict_json

Array = npt.NDArray[Any]
DTYPES = {
    "f32": "<f4",
    "i32": "<i4",
    "u32": "<u4",
    "i16": "<i2",
    "u16": "<u2",
    "u8": "u1",
    "i8": "i1",
}
"""Names in the header, and what they are to NumPy."""
_NAMES = {np.dtype(code): name for name, code in DTYPES.items()}
_MOST_ARRAYS = 64


def pack(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """Put a header and arrays of the types in `DTYPES` into one message."""
    listed = [
        {"name": name, "dtype": _NAMES[a.dtype], "shape": list(a.shape)}
        for name, a in arrays.items()
    ]
    text = json.dumps({**header, "arrays": listed}, allow_nan=False).encode()
    parts = [struct.pack("<I", len(text)), text, _gap(4 + len(text))]
    for a in arrays.values():
        data = np.ascontiguousarray(a).astype(a.dtype.newbyteorder("<"), copy=False).tobytes()
        parts += [data, _gap(len(data))]
    return b"".join(parts)


def unpack(message: bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """Take a message apart; the arrays are read-only views of it.

    Raises FormatError where it is not one; sizes are checked before anything is made of them.
    """
    if len(message) < 4:
        raise FormatError("message: shorter than its own length")
    (n,) = struct.unpack_from("<I", message)
    if 4 + n > len(message):
        raise FormatError(f"message: a header of {n} bytes in {len(message)}")
    header = _json(message[4 : 4 + n])
    listed = header.pop("arrays", [])
    if not isinstance(listed, list) or len(listed) > _MOST_ARRAYS:
        raise FormatError("message: arrays are not a list of at most 64")
    arrays: dict[str, Array] = {}
    place = 4 + n
    for item in listed:
        name, dtype, shape = _described(item)
        place += -place % 8
        size = math.prod(shape) * dtype.itemsize
        if place + size > len(message) or name in arrays:
            raise FormatError(f"message: array {name!r} does not fit into it, or is given twice")
        arrays[name] = np.frombuffer(message, dtype, math.prod(shape), place).reshape(shape)
        place += size
    return header, arrays


def _described(item: Any) -> tuple[str, np.dtype[Any], tuple[int, ...]]:
    if not isinstance(item, dict) or item.keys() != {"name", "dtype", "shape"}:
        raise FormatError("message: an array is described by name, dtype and shape")
    name, code, shape = item["name"], item["dtype"], item["shape"]
    sizes = isinstance(shape, list) and len(shape) <= 4 and all(type(k) is int for k in shape)
    if not (isinstance(name, str) and isinstance(code, str) and code in DTYPES and sizes):
        raise FormatError("message: an array has a name, a known dtype and a shape")
    if any(not 0 <= k < 2**32 for k in shape):
        raise FormatError(f"message: array {name!r} of shape {shape}")
    return name, np.dtype(DTYPES[code]), tuple(shape)


def _json(text: bytes) -> dict[str, Any]:
    try:
        header = strict_json(text.decode(), "message")
    except UnicodeDecodeError:
        raise FormatError("message: not UTF-8") from None
    if not isinstance(header, dict):
        raise FormatError("message: not an object")
    return header


def _gap(length: int) -> bytes:
    return bytes(-length % 8)
