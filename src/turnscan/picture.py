"""Small pictures and tables, as a notebook shows them beside a value."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats

Pixels = npt.NDArray[np.uint8]
_GAMMA = 0.6
_BRIGHTEST = 99.9
"""Percentile of the pixels that is shown as white: a stripe lights few of them."""
_LEAST = 16.0
"""Grey levels of 255: a dark picture is not brightened beyond this being white."""

# Purple to yellow, dark to light, read the same by the colour-blind (after viridis, CC0).
_RAMP = np.array(
    [(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)], np.float64
)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that a notebook shows."""

    pixels: Pixels
    """(H, W) grey or (H, W, 3) red, green, blue."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Of `pixels`."""
        return self.pixels.shape

    def save(self, path: str | PathLike[str]) -> None:
        """Write it as PNG. Raises OSError where that cannot be."""
        Path(path).write_bytes(self._repr_png_())

    def _repr_png_(self) -> bytes:
        return png(self.pixels)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.pixels, dtype=dtype)


def png(pixels: Pixels) -> bytes:
    """A picture (H, W), (H, W, 3) or, with opacity, (H, W, 4) as PNG, the same each time."""
    height, width = pixels.shape[:2]
    kind = 0 if pixels.ndim == 2 else {3: 2, 4: 6}[pixels.shape[2]]
    rows = np.ascontiguousarray(pixels, np.uint8).reshape(height, -1)
    body = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    head = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    parts = (b"IHDR", head), (b"IDAT", zlib.compress(body, 6)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(map(_chunk, parts))


def _chunk(part: tuple[bytes, bytes]) -> bytes:
    name, data = part
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def brightened(pixels: npt.NDArray[Any]) -> Pixels:
    """A camera picture (H, W) or (H, W, 3) as an eye would see it: the stripe near white."""
    top = 255.0 if pixels.dtype == np.uint8 else 65535.0
    white = max(float(np.percentile(pixels, _BRIGHTEST)), _LEAST / 255.0 * top)
    light: Pixels = np.rint(255.0 * np.clip(pixels / white, 0, 1) ** _GAMMA).astype(np.uint8)
    return light


def shrunk(pixels: npt.NDArray[Any], widest: int) -> npt.NDArray[Any]:
    """A picture of at most ``widest`` columns: each pixel the brightest of those it stands for.

    A stripe of a pixel's width stays to be seen.
    """
    n = -(-pixels.shape[1] // widest)
    if n == 1:
        return pixels
    height, width = (pixels.shape[0] // n, pixels.shape[1] // n)
    cut = pixels[: height * n, : width * n]
    tiles = cut.reshape(height, n, width, n, *pixels.shape[2:])
    brightest: npt.NDArray[Any] = tiles.max(axis=(1, 3))
    return brightest


def coloured(values: Floats) -> Pixels:
    """Values (H, W) as colours (H, W, 3), the lowest purple, the highest yellow, NaN white."""
    there = np.isfinite(values)
    out = np.full((*values.shape, 3), 255.0)
    if there.any():
        low, high = np.percentile(values[there], (1, 99))
        share = np.clip((values[there] - low) / max(high - low, 1e-12), 0, 1) * (len(_RAMP) - 1)
        at = np.minimum(share.astype(np.intp), len(_RAMP) - 2)
        part = (share - at)[:, None]
        out[there] = (1 - part) * _RAMP[at] + part * _RAMP[at + 1]
    return np.rint(out).astype(np.uint8)


def image(pixels: Pixels) -> str:
    """A picture within a page."""
    data = base64.b64encode(png(pixels)).decode()
    return f'<img src="data:image/png;base64,{data}" alt="" style="max-width: 100%">'


def card(title: str, rows: Iterable[tuple[str, object]], drawing: str = "") -> str:
    """What a value shows of itself in a notebook: a title, names with values, a drawing (HTML)."""
    cells = "".join(
        f'<tr><td style="text-align: left"><i>{escape(name)}</i></td>'
        f'<td style="text-align: left">{escape(str(value))}</td></tr>'
        for name, value in rows
    )
    side = f'<div style="flex: none; max-width: 340px">{drawing}</div>' if drawing else ""
    return (
        '<div style="display: flex; flex-wrap: wrap; gap: 16px; align-items: flex-start">'
        f"{side}<div><b>{escape(title)}</b><table>{cells}</table></div></div>"
    )
