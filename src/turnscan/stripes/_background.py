"""The background of a scan that has no laser-off pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Image
from turnscan.errors import InputError
from turnscan.stripes._stripe import Candidates, Orientation

_ROWS = 32
"""Picture rows sorted together: keeps the copy small."""
_FAR = 32
"""px from a stripe's middle at which its light is over: the window of a stripe up to 5 px wide
(rms) and the flanks its own background is taken from …"""
_GLOW = 6.0
"""… or so many of its own widths, where it is wider."""
_LEAST = 3
"""Pictures that a median needs …"""
_SHARE = 0.1
"""… and the share of all in which a pixel must be far from the stripe: fewer are chance."""

Frames = Sequence[Image] | npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


def temporal_background(frames: Frames, quantile: float = 0.5) -> Image:
    """What a pixel shows in most pictures of a scan, (H, W) from n pictures (n, H, W).

    The default is the (lower) median: noise does not shift it, and it ignores whatever lights a
    pixel in less than half of the pictures, as the stripe on a turning object does. What never
    moves is background: so is a laser line on the wall, rightly, but so would be the stripe on a
    part that is nearly round (`background_beside`). A lower ``quantile`` bears a stripe that stays
    longer, and comes out darker than the background by the noise.

    Raises InputError for fewer than 3 pictures, or pictures of different shape or type.
    """
    _check(frames)
    if not 0.0 <= quantile <= 1.0:
        raise InputError(f"quantile is {quantile}", hint="give 0 to 1; 0.5 is the median")
    rank = int(quantile * (len(frames) - 1))
    background: Image = np.empty_like(frames[0])
    for v in range(0, background.shape[0], _ROWS):
        stack = np.stack([frame[v : v + _ROWS] for frame in frames], axis=-1)
        stack.partition(rank, axis=-1)
        background[v : v + _ROWS] = stack[..., rank]
    return background


def without_lines(picture: Image, orientation: Orientation = "vertical") -> Image:
    """A picture (H, W) or (H, W, 3) without what is bright and narrow across the stripe.

    The opening along each scan line: the largest picture below it without bright structures
    narrower than 65 px. It stands in for a laser-off picture where all that matters is where
    there may be laser light.
    """
    from scipy.ndimage import grey_opening

    size = [1] * picture.ndim
    size[1 if orientation == "vertical" else 0] = 2 * _FAR + 1
    opened: Image = grey_opening(picture, size=tuple(size), mode="nearest")
    return opened


def background_beside(frames: Frames, seen: Sequence[Candidates]) -> Image:
    """What a pixel shows in the pictures in which the stripe is elsewhere, (H, W) or (H, W, 3).

    ``seen`` are the centres that may be a stripe in each of the pictures (n, H, W[, 3]); pixels
    within 32 px of one, or six of its widths, are left out, and of the others the (lower) median is
    taken. So a stripe may stay in place for most of the scan, as on a part that is nearly round,
    and does not become background; what the room lights is not taken for laser light where a dark
    part passes before a bright wall. Pixels that are far from a stripe in fewer than a tenth of the
    pictures are interpolated along the scan line; in lines without any others they are the
    darkest that they ever were.

    Raises InputError like `temporal_background`.
    """
    _check(frames)
    across = seen[0].orientation == "horizontal"
    laid = [np.swapaxes(frame, 0, 1) if across else frame for frame in frames]
    background: Image = np.empty_like(laid[0])
    for v in range(0, len(background), _ROWS):
        rows = slice(v, v + _ROWS)
        stack = np.stack([frame[rows] for frame in laid], axis=-1)
        hidden = np.stack([_near(c, rows, stack.shape[1]) for c in seen], axis=-1)
        background[rows] = _median_of_shown(stack, hidden)
    back: Image = np.ascontiguousarray(np.swapaxes(background, 0, 1) if across else background)  # type: ignore[assignment]
    return back


def _check(frames: Frames) -> None:
    """Raise InputError where the pictures are too few or differ in shape or type."""
    n = len(frames)
    if n < 3:
        raise InputError(
            f"a background needs at least 3 pictures, not {n}", hint="use a laser-off picture"
        )
    first = frames[0]
    for i, frame in enumerate(frames):
        if frame.shape != first.shape or frame.dtype != first.dtype:
            raise InputError(
                f"picture {i} is {frame.dtype} {frame.shape}, picture 0 "
                f"{first.dtype} {first.shape}",
                hint="all pictures must come from one camera",
            )


def _near(c: Candidates, rows: slice, width: int) -> Bools:
    """(rows, width) True near a centre."""
    reach = np.maximum(_FAR, _GLOW * c.width[rows])[:, None]
    away = np.abs(np.arange(width)[:, None] - c.position[rows][:, None])
    with np.errstate(invalid="ignore"):
        return np.asarray((away <= reach).any(axis=-1))


def _median_of_shown(stack: Image, hidden: Bools) -> Image:
    """(rows, W[, 3]) the lower median of the values (rows, W[, 3], n) not hidden (rows, W, n)."""
    shown = stack.shape[-1] - hidden.sum(axis=-1)
    known = shown >= max(_LEAST, _SHARE * stack.shape[-1])
    rank = np.maximum(shown - 1, 0) // 2
    darkest = stack.min(axis=-1)
    if stack.ndim == 4:
        hidden, rank = hidden[:, :, None], rank[:, :, None]
    ordered = np.sort(np.where(hidden, np.iinfo(stack.dtype).max, stack), axis=-1)
    at = np.broadcast_to(rank, darkest.shape)[..., None]
    out: Image = np.take_along_axis(ordered, at, axis=-1)[..., 0]
    out[~known] = _between(out, known, darkest)[~known]
    return out


def _between(values: Image, known: Bools, otherwise: Image) -> Image:
    """Rows (r, W[, 3]) interpolated where not ``known`` (r, W), at their ends the nearest known.

    ``otherwise`` has what rows without any take.
    """
    width = known.shape[1]
    u = np.arange(width)
    left = np.maximum.accumulate(np.where(known, u, -1), axis=1)
    right = np.minimum.accumulate(np.where(known, u, width)[:, ::-1], axis=1)[:, ::-1]
    left, right = np.where(left < 0, right, left), np.where(right >= width, left, right)
    none = ~known.any(axis=1)
    left[none], right[none] = 0, 0
    share = (u - left) / np.maximum(right - left, 1)
    row = np.arange(len(known))[:, None]
    low, high = values[row, left].astype(np.float64), values[row, right].astype(np.float64)
    share = share[..., None] if values.ndim == 3 else share
    out: Image = np.rint(low + share * (high - low)).astype(values.dtype)
    out[none] = otherwise[none]
    return out
