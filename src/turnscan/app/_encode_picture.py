"""Pictures as they go to the browser."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.errors import InputError

JPEG_QUALITY = 80
_WIDEST = 1280
"""px of a live picture; wider ones are sent smaller."""


def png(picture: Image) -> bytes:
    """A picture, 8 bits, as PNG. Raises InputError where it cannot be shown."""
    shown = eight_bits(picture)
    done, data = cv2.imencode(".png", shown if shown.ndim == 2 else shown[..., ::-1])
    if not done:
        raise InputError("this picture cannot be shown")
    return bytes(data)


def jpeg(picture: Image, widest: int = _WIDEST) -> npt.NDArray[np.uint8] | None:
    """A picture as the bytes of a JPEG, at most ``widest`` px wide; None for one without."""
    height, width = picture.shape[:2]
    shown = eight_bits(picture)
    if width > widest:
        size = (widest, round(height * widest / width))
        shown = cv2.resize(shown, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    page = shown if shown.ndim == 2 else shown[..., ::-1]
    done, data = cv2.imencode(".jpg", page, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return np.asarray(data, np.uint8).ravel() if done else None


def eight_bits(picture: Image) -> npt.NDArray[np.uint8]:
    """A picture for the screen: what is brightest in it is white, where it has 16 bits."""
    if picture.dtype == np.uint8:
        return picture.astype(np.uint8)
    top = max(int(picture.max(initial=0)), 1)
    shown: npt.NDArray[np.uint8] = (picture.astype(np.float32) * (255.0 / top)).astype(np.uint8)
    return shown
