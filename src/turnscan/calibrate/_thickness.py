"""How thick a sheet of light is, by the widths of its stripes on boards that lie unlike to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._evidence import LaserPicture
from turnscan.calibrate._select import NEAR_PX
from turnscan.calibrate._state import StripeView
from turnscan.rig import Pose, Rig

_FEWEST = 4
"""Boards that are enough."""
_UNLIKE = 1.2
"""Squares of two slopes differ by this much where they can tell thickness from blur."""
_SURE = 0.25
"""Relative uncertainty of the thickness above which none is stated."""


def sheet_thickness(
    rig: Rig, laser: str, boards: Sequence[tuple[LaserPicture, StripeView, Pose]]
) -> float | None:
    """mm rms of a sheet's light, or None where boards do not tell it from the picture's blur.

    A stripe on a plane is as wide as the root of (thickness / walk)² + blur², walk being how far
    the ray of the next pixel leads away from the sheet on that plane. Both squares are fitted to
    the boards' medians; speckle and squares of the board move single widths.
    """
    places = list[tuple[float, float]]()
    for picture, stripe, pose in boards:
        if stripe.laser != laser or picture.widths is None:
            continue
        on = _on_stripe(picture.candidates, stripe)
        width = picture.widths[on]
        walk = _walk(rig, laser, picture.candidates[on], stripe, pose)
        good = np.isfinite(width) & (width > 0) & (walk > 0)
        if good.sum() >= _FEWEST:
            steep, wide = 1.0 / walk[good] ** 2, width[good] ** 2
            places.append((float(np.median(steep)), float(np.median(wide))))
    if len(places) < _FEWEST:
        return None
    x, y = np.array(sorted(places)).T
    if x[-1] < _UNLIKE * x[0]:
        return None
    # A width's noise is a part of it.
    A = np.stack([x, np.ones_like(x)], axis=1) / y[:, None]
    fit, *_ = np.linalg.lstsq(A, np.ones_like(y), rcond=None)
    if fit[1] < 0:
        fit = np.array([1.0 / np.mean(x / y), 0.0])
        A = A[:, :1]
    left = 1.0 - A @ fit[: A.shape[1]]
    scatter = float(left @ left) / max(len(y) - A.shape[1], 1)
    spread = float(np.sqrt(scatter * np.linalg.inv(A.T @ A)[0, 0]))
    # Of the square, half of the part of its root.
    if not fit[0] > 0 or 0.5 * spread / fit[0] > _SURE:
        return None
    thickness = float(np.sqrt(fit[0]))
    return thickness if thickness <= rig.sheet(laser).thickest else None


def _on_stripe(candidates: Floats, stripe: StripeView) -> Bools:
    """Which candidates (n, 2) px are the stripe's: those next to the line through its points."""
    across = 0 if stripe.direction[0] else 1
    line = stripe.pixels[np.argsort(stripe.pixels[:, 1 - across], kind="stable")]
    at, along = candidates[:, across], candidates[:, 1 - across]
    inside = (along >= line[0, 1 - across]) & (along <= line[-1, 1 - across])
    off = at - np.interp(along, line[:, 1 - across], line[:, across])
    return np.asarray(inside & (np.abs(off) < NEAR_PX))


def _walk(rig: Rig, laser: str, pixels: Floats, stripe: StripeView, pose: Pose) -> Floats:
    """(n,) mm for each px across: how fast rays through ``pixels`` (n, 2) of a stripe lead away
    from the sheet on a board's plane."""
    across = 0 if stripe.direction[0] else 1
    xy, normal = rig.camera.normalised(pixels), pose.rotation[:, 2]
    rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
    points = rays * ((pose.translation @ normal) / (rays @ normal))[:, None]
    turn = np.zeros_like(rays)
    turn[:, :2] = rig.camera.ray_derivatives(xy)[..., :, across]
    along = turn - rays * ((turn @ normal) / (rays @ normal))[:, None]
    away = np.einsum("ij,ij->i", points[:, 2:] * along, rig.sheet(laser).gradient(points))
    return np.asarray(np.abs(away))
