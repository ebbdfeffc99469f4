"""Bytes of a camera → Image: the pixel formats of GenICam (PFNC) that scanners meet."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.errors import DeviceGarbled, DeviceRefused

Samples = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

_FORM = re.compile(r"(Mono|Bayer(?:RG|GR|GB|BG)|RGBa?|BGRa?)(8|10|12|14|16)(p|Packed)?")
_CHANNELS = {"RGB": 3, "BGR": 3, "RGBa": 4, "BGRa": 4}
KNOWN = "Mono and Bayer of 8 to 16 bits, packed or not, RGB8, BGR8, RGBa8 or BGRa8"


def image_of(data: npt.ArrayLike | bytes, form: str, width: int, height: int) -> Image:
    """Turn a camera's bytes into a picture of its own memory.

    ``form`` is the format's PFNC name, such as ``Mono8``, ``Mono12p``, ``BayerRG8``. Returns
    (H, W) for grey, (H, W, 3) red, green, blue for colour (Bayer is interpolated bilinearly),
    uint8 or uint16, C-contiguous and read-only. 10, 12 and 14 bits fill the 16 of the result,
    so that a clipped pixel is 65535 whatever the camera.

    Raises DeviceRefused for a format it does not know, DeviceGarbled where bytes are missing.
    """
    match = _FORM.fullmatch(form)
    if match is None or (match[1] in _CHANNELS and match[2] != "8"):
        raise DeviceRefused(f"camera: pixels of kind {form!r}", hint=f"set it to {KNOWN}")
    colour, bits, packing = match[1], int(match[2]), match[3] if match[2] in ("10", "12") else None
    channels = _CHANNELS.get(colour, 1)
    count = width * height * channels
    raw = np.frombuffer(data, np.uint8) if isinstance(data, bytes) else _bytes(data)
    need = _size(count, bits, packing)
    if len(raw) < need:
        raise DeviceGarbled(
            f"camera: {len(raw)} bytes of a {width}×{height} {form} picture of {need}",
            hint="the picture came only in part; check cable, network and packet size",
        )
    samples = _filled(_unpacked(raw[:need], bits, packing, count), bits)
    if colour.startswith("Bayer"):
        return locked(_demosaiced(samples.reshape(height, width), colour))
    if channels == 1:
        return locked(samples.reshape(height, width))
    pixels = samples.reshape(height, width, channels)[..., :3]
    return locked(pixels[..., ::-1] if colour.startswith("BGR") else pixels)


def locked(pixels: npt.NDArray[Any]) -> Image:
    """A read-only, C-contiguous copy that no buffer of a camera is part of."""
    image: Image = np.array(pixels, order="C")
    image.flags.writeable = False
    return image


def _bytes(data: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    return np.ascontiguousarray(data).reshape(-1).view(np.uint8)


def _size(count: int, bits: int, packing: str | None) -> int:
    if packing == "p":
        return -(-count * bits // 8)
    if packing == "Packed":
        return -(-count * 3 // 2)
    return count * (1 if bits == 8 else 2)


def _unpacked(
    raw: npt.NDArray[np.uint8], bits: int, packing: str | None, count: int
) -> npt.NDArray[Any]:
    if packing is None:
        return raw if bits == 8 else raw.view("<u2")
    group, samples = (5, 4) if (packing, bits) == ("p", 10) else (3, 2)
    padded = np.zeros(-(-len(raw) // group) * group, np.uint16)
    padded[: len(raw)] = raw
    b = padded.reshape(-1, group).T
    out = np.empty((b.shape[1], samples), np.uint16)
    if packing == "Packed":  # GigE Vision: high bytes outside, low bits shared in the middle
        low = bits - 8
        out[:, 0] = b[0] << low | b[1] & (1 << low) - 1
        out[:, 1] = b[2] << low | b[1] >> 4 & (1 << low) - 1
    elif bits == 12:  # PFNC "p": a stream of bits, lowest first
        out[:, 0] = b[0] | (b[1] & 0xF) << 8
        out[:, 1] = b[1] >> 4 | b[2] << 4
    else:
        for k in range(4):
            out[:, k] = (b[k] >> 2 * k | b[k + 1] << 8 - 2 * k) & 0x3FF
    return out.reshape(-1)[:count]


def _filled(samples: npt.NDArray[Any], bits: int) -> Samples:
    """Stretch 10, 12 or 14 bits to 16 by repeating the highest below the lowest."""
    if bits in (8, 16):
        return samples
    wide = samples.astype(np.uint16)
    return np.asarray(wide << (16 - bits) | wide >> (2 * bits - 16), np.uint16)


def _demosaiced(mosaic: Samples, colour: str) -> npt.NDArray[Any]:
    import cv2

    # GenICam names the first two pixels of the first row.
    first = colour.removeprefix("Bayer")
    names = {"RG": "RGGB", "GR": "GRBG", "GB": "GBRG", "BG": "BGGR"}
    return np.asarray(cv2.cvtColor(mosaic, getattr(cv2, f"COLOR_Bayer{names[first]}2RGB")))
