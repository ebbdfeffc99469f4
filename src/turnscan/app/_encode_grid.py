"""Grids, profiles and pictures of an open scan as arrays for the browser."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from turnscan import edit, points
from turnscan.app._envelope import Array
from turnscan.arrays import Floats, Image
from turnscan.detection import View
from turnscan.errors import InputError
from turnscan.points import RangeGrid
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import Candidates, Stripe, StripeFlag
from turnscan.surface.holes import CAUSE_WORDS, Cause

CAUSES = ["", *CAUSE_WORDS.values()]
"""Words by the numbers in the array cause; 0: nothing is missing."""
_NUMBER = {name: k for k, name in enumerate(CAUSE_WORDS, start=1)}
_FLAG_CAUSES: tuple[tuple[StripeFlag, Cause], ...] = (
    (StripeFlag.AMBIGUOUS, "ambiguous"),
    (StripeFlag.OUTSIDE, "outside"),
    (StripeFlag.SATURATED, "saturated"),
    (StripeFlag.DARK, "dark"),
)
"""Which flag of a missing point tells its cause, the most telling last."""
_SAME = 0.5
"""px within which a point is one of the candidates."""


def grid_arrays(
    grid: RangeGrid, entries: Sequence[edit.Entry], step: int | None
) -> dict[str, Array]:
    """A whole grid, or one step of it. Raises InputError for a step there is not."""
    rows: npt.NDArray[np.intp] = np.arange(len(grid.steps))
    if step is not None:
        rows = np.flatnonzero(grid.steps == step)
        if not len(rows):
            raise InputError(f"there is no step {step} in this grid")
    edited, off = _edited(grid, entries)
    return {
        "steps": grid.steps[rows].astype("<i4"),
        "angles": grid.angles[rows].astype("<f4"),
        "points": grid.points[rows].astype("<f4"),
        "sigma": grid.sigma[rows].astype("<f4"),
        "amplitude": grid.amplitude[rows].astype("<f4"),
        "flags": grid.flags[rows].astype("<u2"),
        "cause": _causes(grid)[rows],
        "edited": edited[rows],
        "off": off[rows],
    }


def profile_arrays(view: View, grid: RangeGrid, step: int) -> dict[str, Array]:
    """The stripe of one step as it is used now, and everything it could be instead.

    Raises InputError for a step there is not, ScanCorrupt.
    """
    rig = view.rig
    k = int(np.flatnonzero(grid.steps == step)[0]) if step in grid.steps else -1
    if k < 0:
        raise InputError(f"there is no step {step} in this grid")
    angle = float(grid.angles[k])
    position = _seen_at(rig, grid.points[k], angle, view.scan.plan.orientation)
    found = view.candidates(step)
    places = np.stack(
        [
            points.build_grid(rig, grid.laser, [one], [step], [angle]).points[0]
            for one in _each(found)
        ],
        axis=1,
    )
    return {
        "position": position.astype("<f4"),
        "candidates": found.position.astype("<f4"),
        "candidate_amplitude": found.amplitude.astype("<f4"),
        "candidate_points": places.astype("<f4"),
        "chosen": _chosen(position, found.position),
    }


def picture_png(view: View, step: int) -> bytes:
    """The lit picture of a step, 8 bits, as PNG. Raises InputError where there is none."""
    shown = eight_bits(view.scan.frame(step, view.lit).lit)
    done, data = cv2.imencode(".png", shown if shown.ndim == 2 else shown[..., ::-1])
    if not done:
        raise InputError(f"the picture of step {step} cannot be shown")
    return bytes(data)


def eight_bits(picture: Image) -> npt.NDArray[np.uint8]:
    """A picture for the screen: what is brightest in it is white, where it has 16 bits."""
    if picture.dtype == np.uint8:
        return picture.astype(np.uint8)
    top = max(int(picture.max(initial=0)), 1)
    shown: npt.NDArray[np.uint8] = (picture.astype(np.float32) * (255.0 / top)).astype(np.uint8)
    return shown


def _causes(grid: RangeGrid) -> npt.NDArray[np.uint8]:
    cause: npt.NDArray[np.uint8] = np.full(grid.flags.shape, _NUMBER["removed"], np.uint8)
    for flag, name in _FLAG_CAUSES:
        cause[(grid.flags & int(flag)) != 0] = _NUMBER[name]
    cause[grid.found] = 0
    return cause


def _edited(
    grid: RangeGrid, entries: Sequence[edit.Entry]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """What people did to the grid: (s, n) 1 moved or picked, 2 deleted; (s,) 1 switched off."""
    edited: npt.NDArray[np.uint8] = np.zeros(grid.flags.shape, np.uint8)
    off: npt.NDArray[np.uint8] = np.zeros(len(grid.steps), np.uint8)
    for entry in entries:
        what = entry.edit
        if getattr(what, "laser", None) != grid.laser:
            continue
        match what:
            case edit.DeletePoints():
                lines = [n for n in what.lines if n < edited.shape[1]]
                edited[np.ix_(grid.steps == what.step, lines)] = 2
            case edit.SetPoint():
                if what.line < edited.shape[1]:
                    edited[grid.steps == what.step, what.line] = 1
            case edit.PickCandidate():
                edited[grid.steps == what.step, what.lines[0] : what.lines[1] + 1] = 1
            case edit.ProfileOff():
                off[(grid.steps >= what.steps[0]) & (grid.steps <= what.steps[1])] = 1
    return edited, off


def _seen_at(rig: Rig, profile: Floats, angle: float, orientation: str) -> Floats:
    """(n,) px across the stripe at which the camera sees each point (n, 3) of a profile."""
    there = ~np.isnan(profile[:, 0])
    out = np.full(len(profile), np.nan)
    table = profile[there] @ rotation_z(angle).T
    pixels = rig.camera.project(rig.T_camera_table.apply(table))
    out[there] = pixels[:, 0 if orientation == "vertical" else 1]
    return out


def _chosen(position: Floats, candidates: Floats) -> npt.NDArray[np.int8]:
    """(n,) which candidate a point is; −1 none there, −2 a place of its own."""
    apart = np.abs(candidates - position[:, None])
    apart = np.where(np.isnan(apart), np.inf, apart)
    best = apart.argmin(axis=1)
    out = np.where(apart[np.arange(len(best)), best] <= _SAME, best, -2)
    return np.where(np.isnan(position), -1, out).astype(np.int8)


def _each(found: Candidates) -> list[Stripe]:
    """The k-th candidates of all lines, as a stripe each."""
    return [
        Stripe(
            found.position[:, k],
            found.sigma[:, k],
            found.amplitude[:, k],
            found.width[:, k],
            found.flags[:, k],
            found.orientation,
        )
        for k in range(found.position.shape[1])
    ]
