"""What the detectors need of a picture: grey, eight bits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image

Grey = npt.NDArray[np.uint8]

_DARK, _FLAT = 40.0, 30.0
"""Of 255: a picture whose brightest parts stay below the one is dark, whose contrast stays below
the other shows nothing."""
_DARKER = 10.0
"""Percent of a board's pixels that are darker than its black, and brighter than its white."""
_TOP, _MOST_AT_TOP = 252, 0.5
"""Grey from which a pixel is clipped, and the share of such pixels in an overexposed picture."""
_BLURRED_PX = 3.5
"""Standard deviation of the blur of the sharpest edges, from which corners are not found well."""


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


def evened_grey(image: Image, places: Floats) -> Floats:
    """A picture (H, W) or (H, W, 3) in RGB as grey (H, W) in which all sites of a colour filter
    count alike, by the black and white about ``places`` (n, 2) px.

    Behind a Bayer filter each colour is seen at every second pixel and interpolated between: an
    edge in red alone is drawn to the red sites, in blue by as much the other way, in green by half.
    Red, green and blue in the parts 1 : 2 : 1 of what differs in each leave nothing of it; those of
    the eye, 0.3 : 0.59 : 0.11, draw corners by 0.05 px.
    """
    if image.ndim == 2:
        return np.asarray(image, dtype=np.float64)
    h, w = image.shape[:2]
    first = np.clip(places.min(axis=0).astype(int), 0, (w - 2, h - 2))
    last = np.clip(places.max(axis=0).astype(int) + 1, first + 1, (w, h))
    part = image[first[1] : last[1], first[0] : last[0]].reshape(-1, 3)
    low, high = np.percentile(part, (_DARKER, 100 - _DARKER), axis=0)
    differs = np.maximum(high - low, 1.0)
    share = np.array([1.0, 2.0, 1.0]) / differs
    return np.asarray(image @ (share / share.sum()), dtype=np.float64)


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
