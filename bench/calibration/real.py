"""Pictures of real scanners made by others: residuals in px and mm beside what was asked."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.calibration._figures import Figure, at_most
from turnscan.calibrate import (
    Board,
    CalibrationQuality,
    CalibrationSettings,
    LaserPicture,
    calibrate_rig,
    detect_board,
    fit_sheet,
    parse_board,
    stripe_light,
    white_margin,
)
from turnscan.calibrate import figures as figures_of
from turnscan.rig import Camera
from turnscan.scan import list_pictures, read_picture
from turnscan.workflows import CalibrationPictures, calibrate

SHARED = Path(__file__).parents[3] / "shared" / "data"
MOUSE = SHARED / "turntable-mouse"
_PAIR_MM = 0.16
"""What the authors of the pairs say of their planes."""


def figures(quick: bool) -> Iterator[Figure]:
    """Every data set that is there; ``quick`` leaves the mouse out."""
    if not SHARED.is_dir():
        yield Figure("the shared real data", "", "not here")
        return
    yield from _charuco_pairs()
    yield from _green_boards()
    yield from _ciclop()
    if not quick:
        yield from _mouse()


def _charuco_pairs() -> Iterator[Figure]:
    """Two ChArUco boards in one picture, laser on and off; the camera is known."""
    folder = SHARED / "charuco-pairs"
    K = np.load(next(folder.glob("*.npz")))["mtx"]
    boards = [parse_board(f"charuco:7x5:25:19:DICT_{n}X{n}_50") for n in (4, 5)]
    for lit in sorted(folder.glob("*_laser.png")):
        on = read_picture(lit)
        off = read_picture(lit.with_name(lit.name.replace("_laser", "")))
        # The pictures were saved after undistortion.
        camera = Camera(on.shape[1], on.shape[0], K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        tried = [_pair(camera, on, off, boards, way) for way in ("vertical", "horizontal")]
        _, rms, words = max(tried, key=lambda some: some[0])
        name = f"charuco-pairs {lit.name[:7]}: plane through both stripes, rms"
        line = at_most(name, rms, _PAIR_MM, "mm")
        yield Figure(name, line.asked, f"{rms:.3f} mm ({words})", line.met)


def _pair(camera, on, off, boards: list[Board], way) -> tuple[int, float, str]:  # type: ignore[no-untyped-def]
    light = stripe_light(on, off, (1, 0, 0), way)
    pictures = [LaserPicture.of(detect_board(off, b), light) for b in boards]
    try:
        fit = fit_sheet(camera, pictures, orientation=way)
    except ValueError as e:
        return -1, float("nan"), str(e)
    count = sum(fit.points)
    return count, fit.rms_mm, f"{fit.rms_px:.3f} px, corners {fit.corner_rms_px:.3f} px"


def _green_boards() -> Iterator[Figure]:
    """Six boards with a green stripe on the pattern; they must do for the camera as well."""
    board = parse_board("chessboard:8x6:40")
    pictures = []
    paths = list_pictures(SHARED / "laser-boards-green")
    for path in paths:
        picture = read_picture(path)
        light = stripe_light(picture, None, (0, 1, 0)).places
        view = detect_board(picture, board, path.name)
        pictures.append(LaserPicture(view, light, white_margin(picture, view)))
    views = [p.view for p in pictures]
    f = figures_of(calibrate_rig(views, {"laser": pictures}, (), CalibrationSettings()))
    used = f.sheet_views["laser"]
    yield Figure(
        "laser-boards-green: boards used, no hint of margin", f"all {len(paths)}", str(used),
        used == len(paths),
    )  # fmt: skip
    told = f"{f.sheet_rms_mm['laser']:.3f} mm ({f.sheet_rms_px['laser']:.3f} px)"
    yield Figure("laser-boards-green: stripes off the sheet, rms", "", told)


def _ciclop() -> Iterator[Figure]:
    """Sixteen chessboards of a desktop scanner's camera, 1280×960 lying on its side."""
    board = parse_board("chessboard:11x6:13")
    paths = list_pictures(SHARED / "ciclop-bust" / "chessboard")
    views = [detect_board(read_picture(p), board, p.name) for p in paths]
    f = figures_of(calibrate_rig(views, {}, (), CalibrationSettings()))
    yield at_most("ciclop-bust: camera", f.camera_rms_px, 0.25, "px")
    met = f.camera_views == len(paths) == 16
    yield Figure("ciclop-bust: boards used", "all 16", str(f.camera_views), met)


def _mouse() -> Iterator[Figure]:
    """All pictures of the turntable, and the same with half of the boards under the laser."""
    f, half = mouse(), mouse(every=2)
    sides = (f.marker_side_mm, half.marker_side_mm)
    assert sides[0] is not None
    assert sides[1] is not None
    yield Figure("turntable-mouse: camera, table", "",
                 f"{f.camera_rms_px:.3f} px, {f.table_rms_px:.3f} px")  # fmt: skip
    told = f"{f.sheet_rms_mm['laser']:.3f} mm ({f.sheet_rms_px['laser']:.3f} px)"
    yield Figure("turntable-mouse: stripes off the sheet, rms", "", told)
    yield Figure("turntable-mouse: side of the markers", "", sides[0].text("mm", 3))
    name = "turntable-mouse: that side with half of the laser boards, off the full set's"
    yield at_most(name, sides[1].value - sides[0].value, 0.15, "mm")


def mouse(every: int = 1, times: int = 1) -> CalibrationQuality:
    """`turnscan.workflows.calibrate` with each so manyth of the boards under the laser, and each
    picture of the table so many times."""
    with tempfile.TemporaryDirectory() as folder:
        lit, table = Path(folder) / "lit", Path(folder) / "table"
        lit.mkdir()
        table.mkdir()
        for path in list_pictures(MOUSE / "laser-boards")[::every]:
            (lit / path.name).symlink_to(path)
        for k, path in enumerate(list_pictures(MOUSE / "empty-table")):
            for n in range(times):
                (table / f"step{times * k + n:04d}.jpg").symlink_to(path)
        done = calibrate(
            CalibrationPictures(str(MOUSE / "camera-boards"), {"laser": str(lit)}, str(table)),
            "chessboard:8x6:40",
            Path(folder) / "rig.json",
            markers="DICT_4X4_50:30",
            table_step_deg=2.25 / times,
        )
    assert done.figures is not None
    return done.figures


__all__ = ["figures", "mouse"]
