"""One grey picture from a colour one: the channels weighed so that the laser stands out."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from turnscan.arrays import ColourWeights, Floats, Image
from turnscan.errors import InputError

COLOURS: Final[dict[str, ColourWeights]] = {
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "grey": (1 / 3, 1 / 3, 1 / 3),
}
"""Weights (red, green, blue) by name."""

UINT16_SCALE = 64
"""An 8-bit picture projected to 16 bits is multiplied by this, so that no rounding is added."""

_NEAR = 25
"""px: without a laser-off picture, what is above the mean this far left and right is a line."""
_SHARE = 0.9
"""Laser pixels are those above this part of the light of the brightest pixel of their row."""
_CLIPPED = 0.97
"""A channel above this part of full scale counts as clipped."""


def learn_colour(lit: Image, dark: Image | None = None) -> Floats:
    """Learn the weights of red, green and blue that separate the laser best from all the rest.

    ``lit`` and ``dark`` are (H, W, 3), laser on and off. Fisher's linear discriminant: the inverse
    covariance of the background times the mean colour of the laser; a channel counts less the
    more of the line is clipped in it, since a plateau says little about where its middle is. With
    a laser-off picture the weights are ≥ 0 (the background is gone already); without one they may
    be negative, which takes away what is grey.

    Returns (3,) weights; the positive ones sum to 1. Raises InputError where no line is seen.
    """
    _check(lit)
    on = lit.astype(np.float32)
    if dark is not None:
        _check(dark)
        if dark.shape != lit.shape:
            raise InputError(
                f"laser on is {lit.shape}, laser off {dark.shape}",
                hint="both pictures must come from the same camera",
            )
        light = on - dark.astype(np.float32)
    else:
        light = on - _row_mean(on)
    light -= np.median(light[::7, ::7].reshape(-1, 3), axis=0)
    axis = _best_axis(light)
    seen = light @ axis
    best = seen.max(axis=1, keepdims=True)
    spread = 1.4826 * float(np.median(np.abs(seen[::7, ::7]))) + 0.3
    laser = (seen >= _SHARE * best) & (best > max(8.0 * spread, 6.0 * np.median(np.abs(best)) / 8))
    if laser.sum() < 20:
        raise InputError(
            "no laser line seen in the picture from which its colour should be learned",
            hint="give a picture with a bright line, or name the colour",
        )
    rest = light[seen < 3.0 * spread][::11].astype(np.float64)
    covariance = np.cov(rest, rowvar=False) + 0.5 * np.eye(3)
    full = float(np.iinfo(lit.dtype).max)
    clipped = (on[laser] > _CLIPPED * full).mean(axis=0)
    mean = light[laser].astype(np.float64).mean(axis=0) * (1.0 - 0.9 * clipped)
    return _discriminant(covariance, mean, positive=dark is not None)


def project_colour(
    rgb: Image,
    weights: npt.ArrayLike | str,
    dtype: type[np.uint8] | type[np.uint16] | None = None,
) -> Image:
    """Make one (H, W) picture of a colour one, (H, W, 3), by weights or by a name of `COLOURS`.

    The map is linear and clips nothing: with negative weights the result is shifted and shrunk to
    fit. ``dtype`` is the type of the result, by default that of ``rgb``; an 8-bit picture projected
    to uint16 is multiplied by 64 so that no rounding is added.
    """
    _check(rgb)
    if isinstance(weights, str):
        if weights not in COLOURS:
            raise InputError(
                f"laser colour {weights!r}", hint=f"give one of {', '.join(COLOURS)}, or weights"
            )
        w = np.array(COLOURS[weights])
    else:
        w = np.asarray(weights, dtype=np.float64)
        if w.shape != (3,) or not np.isfinite(w).all() or not (w > 0).any():
            raise InputError(
                f"colour weights {weights!r}", hint="give three numbers, at least one above 0"
            )
    out: Any = dtype or rgb.dtype.type
    full_in, full_out = float(np.iinfo(rgb.dtype).max), float(np.iinfo(out).max)
    if np.count_nonzero(w) == 1 and w.max() == 1.0:
        channel: Image = np.ascontiguousarray(rgb[:, :, int(w.argmax())])  # type: ignore[assignment]
        if out is rgb.dtype.type:
            return channel
        if rgb.dtype == np.uint8 and out is np.uint16:
            # As by the floats below, in a tenth of the time.
            return channel.astype(np.uint16) * np.uint16(UINT16_SCALE)
    if rgb.dtype == np.uint8 and out is np.uint16:
        full_out = full_in * UINT16_SCALE
    down = -w[w < 0].sum()
    scale = full_out / full_in / (w[w > 0].sum() + down)
    shift = down * full_in * scale + 0.5
    grey = rgb.reshape(-1, 3).astype(np.float32) @ (w * scale).astype(np.float32)
    grey += np.float32(shift)
    projected: Image = np.clip(grey, 0, full_out).astype(out).reshape(rgb.shape[:2])
    return projected


def _check(rgb: Image) -> None:
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"a colour picture is expected, not {rgb.dtype} of shape {rgb.shape}",
            hint="give (H, W, 3) uint8 or uint16 in the order red, green, blue",
        )


def _row_mean(on: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Mean of the pixels within ±_NEAR in the same row, the picture's edge repeated."""
    width = on.shape[1]
    padded = np.pad(on, ((0, 0), (_NEAR + 1, _NEAR), (0, 0)), mode="edge")
    total = np.cumsum(padded, axis=1, dtype=np.float64)
    reach = 2 * _NEAR + 1
    mean: npt.NDArray[np.float32] = (
        (total[:, reach:] - total[:, :-reach])[:, :width] / reach
    ).astype(np.float32)
    return mean


def _best_axis(light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The channel, or channel minus the others, in which the brightest of a row stands out most."""
    axes = np.vstack([np.eye(3), 1.5 * np.eye(3) - 0.5, np.full((1, 3), 1 / 3)]).astype(np.float32)
    scores = []
    for axis in axes:
        seen = light @ axis
        noise = 1.4826 * float(np.median(np.abs(seen[::7, ::7]))) + 0.5
        # The line is one narrow thing: what else is nearly as bright counts against the axis.
        rivals = float(np.percentile(seen[::3], 97.0))
        scores.append(float(np.median(seen.max(axis=1))) / (noise + max(rivals, 0.0)))
    best: npt.NDArray[np.float32] = axes[int(np.argmax(scores))]
    return best


def _discriminant(covariance: Floats, mean: Floats, *, positive: bool) -> Floats:
    """Fisher's weights; with ``positive`` the channels that would subtract are left out."""
    use = np.ones(3, dtype=bool)
    while True:
        w = np.zeros(3)
        w[use] = np.linalg.solve(covariance[np.ix_(use, use)], mean[use])
        bad = (w < 0) & use
        if not positive or not bad.any():
            break
        use &= ~bad
    if not (w > 0).any():
        w = np.maximum(mean, 0.0) + 1e-9
    return np.asarray(w / w[w > 0].sum())
