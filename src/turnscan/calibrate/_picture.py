"""What the detectors need of a picture: grey, eight bits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

Grey = npt.NDArray[np.uint8]

_EYE = (0.299, 0.587, 0.114)
"""Parts of red, green and blue in grey."""
_DARK, _FLAT = 40.0, 30.0
"""Of 255: a picture whose brightest parts stay below the one is dark, whose contrast stays below
the other shows nothing."""
_TOP, _MOST_AT_TOP = 252, 0.5
"""Grey from which a pixel is clipped, and the share of such pixels in an overexposed picture."""
_BLURRED_PX = 3.5
"""Standard deviation of the blur of the sharpest edges, from which corners are not found well."""


def grey_of(image: Image) -> npt.NDArray[np.float32]:
    """A picture (H, W) or (H, W, 3) in RGB, 8 or 16 bits → grey (H, W), in its own levels.

    Raises ValueError for any other shape.
    """
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"picture: shape {image.shape}, expected (H, W) or (H, W, 3)")
    grey = image.astype(np.float32)
    return grey @ np.array(_EYE, dtype=np.float32) if image.ndim == 3 else grey


def grey8(image: Image) -> Grey:
    """As `grey_of`, but 8 bits, contiguous."""
    grey = grey_of(image)
    if image.dtype == np.uint16:
        # A camera of 10 or 12 bits leaves the upper bits empty: scale by what is there.
        grey = grey * (255.0 / max(float(grey.max()), 255.0))
    return np.ascontiguousarray(np.clip(grey + 0.5, 0, 255), dtype=np.uint8)


def picture_fault(image: Image) -> str:
    """What makes a picture (H, W) or (H, W, 3) useless for measuring, in words; "" for nothing.

    Overexposed, dark, without contrast, or blurred: the width of the steepest edges is their
    contrast over their slope, √(2π) σ for an edge blurred by a Gaussian.
    """
    grey = grey8(image)
    low, high = (float(x) for x in np.percentile(grey[::2, ::2], (1, 99)))
    clipped = float(np.mean(grey[::2, ::2] >= _TOP))
    if clipped > _MOST_AT_TOP:
        return f"overexposed ({clipped:.0%} of the pixels are at the top of their range)"
    if high < _DARK:
        return f"too dark (99 % of the pixels are below {high:.0f} of 255)"
    if high - low < _FLAT:
        return f"almost without contrast ({high - low:.0f} of 255)"
    steps = grey.astype(np.float32)
    slope = np.maximum(
        np.percentile(np.abs(steps[:, 2:] - steps[:, :-2]) / 2, 99.8),
        np.percentile(np.abs(steps[2:] - steps[:-2]) / 2, 99.8),
    )
    blur = (high - low) / (np.sqrt(2 * np.pi) * max(float(slope), 1e-3))
    if blur > _BLURRED_PX:
        return f"blurred (its sharpest edges are {2.36 * blur:.0f} px wide)"
    return ""
