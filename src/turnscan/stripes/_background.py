"""The background of a scan that has no laser-off pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.errors import InputError

_ROWS = 32
"""Picture rows sorted together: keeps the copy small."""


def temporal_background(
    frames: Sequence[Image] | npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
    quantile: float = 0.5,
) -> Image:
    """What a pixel shows in most pictures of a scan, (H, W) from n pictures (n, H, W).

    The default is the (lower) median: noise does not shift it, and it ignores whatever lights a
    pixel in less than half of the pictures, as the stripe on a turning object does. What never
    moves is background: so is a laser line on the wall, rightly, but so would be the stripe on a
    part that is perfectly round; such a part needs laser-off pictures. A lower ``quantile`` bears
    a stripe that stays longer, and comes out darker than the background by the noise.

    Raises InputError for fewer than 3 pictures, or pictures of different shape or type.
    """
    n = len(frames)
    if n < 3:
        raise InputError(
            f"a background needs at least 3 pictures, not {n}", hint="use a laser-off picture"
        )
    if not 0.0 <= quantile <= 1.0:
        raise InputError(f"quantile is {quantile}", hint="give 0 to 1; 0.5 is the median")
    first = frames[0]
    for i, frame in enumerate(frames):
        if frame.shape != first.shape or frame.dtype != first.dtype:
            raise InputError(
                f"picture {i} is {frame.dtype} {frame.shape}, picture 0 "
                f"{first.dtype} {first.shape}",
                hint="all pictures must come from one camera",
            )
    rank = int(quantile * (n - 1))
    background: Image = np.empty_like(first)
    for v in range(0, first.shape[0], _ROWS):
        stack = np.stack([frame[v : v + _ROWS] for frame in frames], axis=-1)
        stack.partition(rank, axis=-1)
        background[v : v + _ROWS] = stack[..., rank]
    return background
