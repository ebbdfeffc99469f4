"""Limits beyond which a calibration is no rig, but a sign that its pictures are wrong."""

from __future__ import annotations

import numpy as np

from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._quality import CalibrationQuality
from turnscan.calibrate._rig import Calibration
from turnscan.errors import Degenerate

_WIDTH = 1280.0
"""px of a picture for which the limits in pixels hold; wider ones may be off by more."""
_CORNERS_PX, _STRIPE_PX, _TABLE_PX = 2.0, 2.0, 3.0
_STRIPE_MM = 2.0
_BULGE = 0.03
"""Of half the length of a board, or of the platter's radius."""
_COVERAGE = 0.08
"""Of the picture: less says nothing about a lens. One board far away fills so much."""


def refuse_poor(c: Calibration, f: CalibrationQuality) -> None:
    """Raise Degenerate, naming value and limit, where residuals, bulges or coverage are beyond
    what pictures of a rig can give."""
    scale = max(c.rig.camera.width / _WIDTH, 1.0)
    given = c.stages.given
    one = "check the board's size, and that all pictures are of one camera with one focus"
    _most("the board's corners are {} px rms off", f.camera_rms_px, _CORNERS_PX * scale, one)
    if "camera" in given and f.coverage < _COVERAGE:
        raise Degenerate(
            f"camera: corners fill {f.coverage:.0%} of the picture; at least {_COVERAGE:.0%} are "
            "needed to say anything about the lens",
            hint="bring the board nearer, and into all corners of the picture",
        )
    for laser in (name for name in given if name in f.sheet_rms_px):
        away = f"the stripes of laser {laser!r} lie {{}} "
        moved = (
            "check that the laser did not move between the pictures, and that they are of one laser"
        )
        limit = _STRIPE_PX * scale
        _most(away + "px rms off one sheet", f.sheet_rms_px[laser], limit, moved)
        _most(away + "mm rms off one sheet", f.sheet_rms_mm[laser], _STRIPE_MM, moved)
    _refuse_bulge(c)
    if "table" in given:
        _refuse_table(c, f, scale)


def _refuse_bulge(c: Calibration) -> None:
    if not c.network.boards:
        return
    x0, y0, x1, y1 = c.network.boards[0].board.extent
    half = np.array([x1 - x0, y1 - y0]) / 2
    bulge = np.abs(c.fit.state.bend[[0, 2]]) * half**2
    k = int((bulge / half).argmax())
    words = f"by the fit the board bulges by {{}} mm over {half[k]:.0f} mm"
    hint = "leave out pictures in which the board is bent, or the stripe lies on something else"
    _most(words, float(bulge[k]), _BULGE * float(half[k]), hint)


def _refuse_table(c: Calibration, f: CalibrationQuality, scale: float) -> None:
    still = "check that neither markers nor camera moved between the pictures"
    words = "markers or board on the table are {} px rms off one rotation"
    _most(words, f.table_rms_px, _TABLE_PX * scale, still)
    empty = "check that nothing stands on the table, and give pictures of the empty one"
    words = "the stripe lies {} mm rms off the plane of the platter"
    _most(words, f.platter_rms_mm, _STRIPE_MM, empty)
    layout = c.fit.state.layout
    if isinstance(layout, MarkerLayout):
        reach = float(np.linalg.norm(layout.squares[:, :2], axis=1).max())
        warp = float(np.abs(layout.shape[2:]).max()) * reach**2
        words = f"by the fit the platter is warped by {{}} mm at {reach:.0f} mm"
        _most(words, warp, _BULGE * reach, empty)


def _most(words: str, value: float, limit: float, hint: str) -> None:
    """Raise where a value (NaN for none) is beyond its limit."""
    if value > limit:
        raise Degenerate(
            f"{words.format(f'{value:.2f}')}; at most {limit:.2f} is accepted", hint=hint
        )
