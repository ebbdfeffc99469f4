"""How thick a sheet of light is, by the widths of its stripes on boards that lie unlike to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._evidence import LaserPicture
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
        known = {(u, v): w for (u, v), w in zip(picture.candidates, picture.widths, strict=True)}
        width = np.array([known.get((u, v), np.nan) for u, v in stripe.pixels])
        walk = _walk(rig, laser, stripe, pose)
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


def _walk(rig: Rig, laser: str, stripe: StripeView, pose: Pose) -> Floats:
    """(n,) mm for each px across: how fast rays lead away from the sheet on a board's plane."""
    across = 0 if stripe.direction[0] else 1
    xy, normal = rig.camera.normalised(stripe.pixels), pose.rotation[:, 2]
    rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
    points = rays * ((pose.translation @ normal) / (rays @ normal))[:, None]
    turn = np.zeros_like(rays)
    turn[:, :2] = rig.camera.ray_derivatives(xy)[..., :, across]
    along = turn - rays * ((turn @ normal) / (rays @ normal))[:, None]
    away = np.einsum("ij,ij->i", points[:, 2:] * along, rig.sheet(laser).gradient(points))
    return np.asarray(np.abs(away))
