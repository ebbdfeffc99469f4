"""Pictures as PNG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from turnscan.arrays import Image
from turnscan.workflows._files._writing import write_atomically


def write_png(path: Path, picture: Image) -> None:
    """Write a picture, red first when it has colours, as PNG of 8 or 16 bits.

    Raises ExportError where it cannot be written.
    """
    import cv2

    page = picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., ::-1])
    _, data = cv2.imencode(".png", page)
    write_atomically(path, data.tobytes())
