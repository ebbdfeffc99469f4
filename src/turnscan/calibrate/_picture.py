"""What the detectors need of a picture: grey, eight bits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

Grey = npt.NDArray[np.uint8]


def grey8(image: Image) -> Grey:
    """A picture (H, W) or (H, W, 3) in RGB, 8 or 16 bits → grey (H, W), 8 bits, contiguous.

    Raises ValueError for any other shape.
    """
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"picture: shape {image.shape}, expected (H, W) or (H, W, 3)")
    grey = image.astype(np.float32)
    if image.ndim == 3:
        grey = grey @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
    if image.dtype == np.uint16:
        # A camera of 10 or 12 bits leaves the upper bits empty: scale by what is there.
        grey = grey * (255.0 / max(float(grey.max()), 255.0))
    return np.ascontiguousarray(np.clip(grey + 0.5, 0, 255), dtype=np.uint8)
