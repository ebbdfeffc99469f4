"""A laser sheet from boards seen by a camera that is already known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._adjust import adjust
from turnscan.calibrate._evidence import LaserPicture
from turnscan.calibrate._layout import stacked
from turnscan.calibrate._light import measuring_direction
from turnscan.calibrate._observations import BOARD, RigNetwork
from turnscan.calibrate._observations import stripe_kind as kind_of
from turnscan.calibrate._residuals import trace
from turnscan.calibrate._select import straighter
from turnscan.calibrate._start import board_pose, start_sheet
from turnscan.calibrate._state import State, StripeView, board_stripe
from turnscan.rig import Camera, LaserSheet, Pose, Rig
from turnscan.stripes import Orientation


@dataclass(frozen=True)
class SheetFit:
    """A laser sheet and how well the stripes lie in it."""

    sheet: LaserSheet
    rms_mm: float
    """Distance of the stripe points from the sheet."""
    rms_px: float
    corner_rms_px: float
    """Corners of the boards."""
    points: tuple[int, ...]
    """Stripe points used on every board."""


def fit_sheet(
    camera: Camera,
    boards: Sequence[LaserPicture],
    name: str = "laser",
    margin: float = 0.0,
    orientation: Orientation = "vertical",
) -> SheetFit:
    """Fit one laser's sheet to stripes on boards, the camera being known.

    The boards may be several in one picture: give one `LaserPicture` for each. Poses and sheet are
    adjusted together in pixels. Raises NotEnoughViews or Degenerate.
    """
    views = [p.view for p in boards]
    poses = [board_pose(camera, v) for v in views]
    pixels = [straighter(camera, p, T, margin)[1] for p, T in zip(boards, poses, strict=True)]
    seen = [i for i, px in enumerate(pixels) if len(px)]
    clouds = []
    for i in seen:
        rays, normal = camera.rays(pixels[i]), poses[i].rotation[:, 2]
        clouds.append(rays * ((poses[i].translation @ normal) / (rays @ normal))[:, None])
    sheet, agree = start_sheet(name, clouds)
    used = [i for i, good in zip(seen, agree, strict=True) if good]
    direction = measuring_direction(orientation)
    stripes = {i: StripeView(name, pixels[i], direction) for i in used}
    network = RigNetwork(
        tuple(views[i] for i in used), tuple((stripes[i],) for i in used), (), (name,)
    )
    state = State(Rig(camera, (sheet,), Pose()), None, tuple(poses[i] for i in used), np.zeros(0))
    fit = adjust(network, state, network.free(state, camera=False))
    distance: list[Floats] = []
    for i, pose in zip(used, fit.state.poses, strict=True):
        seen_by = trace(camera, pixels[i])
        lies = stacked((pose,), (len(pixels[i]),))
        term, _ = board_stripe(fit.state, stripes[i], seen_by, views[i].board, lies)
        distance.append(term.distance)
    return SheetFit(
        fit.state.rig.sheets[0],
        float(np.sqrt(np.mean(np.concatenate(distance) ** 2))),
        fit.rms(kind_of("boards", name)),
        fit.rms(BOARD),
        tuple(len(d) for d in distance),
    )
