"""Calibration on pictures of real scanners made by others: residuals in px and mm."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from turnscan.calibrate import (
    Board,
    CalibrationSettings,
    LaserPicture,
    calibrate_rig,
    detect_board,
    figures,
    fit_sheet,
    parse_board,
    stripe_light,
    white_margin,
)
from turnscan.rig import Camera
from turnscan.scan import list_pictures, read_picture

SHARED = Path(__file__).parents[2] / "shared" / "data"


def run() -> None:
    """Print the figures of every data set that is there."""
    if not SHARED.is_dir():
        print("the shared real data is not here")
        return
    charuco_pairs()
    green_boards()
    ciclop()
    turntable()


def charuco_pairs() -> None:
    """Two ChArUco boards in one picture, laser on and off; the camera is known."""
    folder = SHARED / "charuco-pairs"
    K = np.load(next(folder.glob("*.npz")))["mtx"]
    boards = [parse_board(f"charuco:7x5:25:19:DICT_{n}X{n}_50") for n in (4, 5)]
    for lit in sorted(folder.glob("*_laser.png")):
        on = read_picture(lit)
        off = read_picture(lit.with_name(lit.name.replace("_laser", "")))
        # The pictures were saved after undistortion.
        camera = Camera(on.shape[1], on.shape[0], K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        best = min(
            (_pair(camera, on, off, boards, way) for way in ("vertical", "horizontal")),
            key=lambda text: text[0],
        )
        print(f"charuco-pairs {lit.name[:7]}: {best[1]}")


def _pair(camera, on, off, boards: list[Board], way) -> tuple[float, str]:  # type: ignore[no-untyped-def]
    light = stripe_light(on, off, (1, 0, 0), way)[0]
    pictures = [LaserPicture(detect_board(off, b), light) for b in boards]
    try:
        fit = fit_sheet(camera, pictures, orientation=way)
    except ValueError as e:
        return float("inf"), str(e)
    return -sum(fit.points), (
        f"plane through both stripes {fit.rms_mm:.3f} mm rms ({fit.rms_px:.3f} px), corners "
        f"{fit.corner_rms_px:.3f} px, {fit.points} points, {way}"
    )


def green_boards() -> None:
    """Six boards with a green stripe on the pattern; they must do for the camera as well."""
    board = parse_board("chessboard:8x6:40")
    pictures = []
    for path in list_pictures(SHARED / "laser-boards-green"):
        picture = read_picture(path)
        light = stripe_light(picture, None, (0, 1, 0))[0]
        view = detect_board(picture, board, path.name)
        pictures.append(LaserPicture(view, light, white_margin(picture, view)))
    settings = CalibrationSettings()
    f = figures(calibrate_rig([p.view for p in pictures], {"laser": pictures}, (), settings))
    print(
        f"laser-boards-green: camera {f.camera_rms_px:.3f} px, sheet "
        f"{f.sheet_rms_mm['laser']:.3f} mm ({f.sheet_rms_px['laser']:.3f} px) on "
        f"{f.sheet_views['laser']} boards"
    )


def ciclop() -> None:
    """Sixteen chessboards of a desktop scanner's camera, 1280×960 lying on its side."""
    board = parse_board("chessboard:11x6:13")
    views = [
        detect_board(read_picture(p), board, p.name)
        for p in list_pictures(SHARED / "ciclop-bust" / "chessboard")
    ]
    f = figures(calibrate_rig(views, {}, (), CalibrationSettings()))
    print(f"ciclop-bust: camera {f.camera_rms_px:.3f} px over {f.camera_views} views")


def turntable() -> None:
    """`turnscan calibrate` from end to end."""
    data = SHARED / "turntable-mouse"
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *(sys.executable, "-m", "turnscan", "calibrate", "--json"),
            *("--camera", str(data / "camera-boards"), "--board", "chessboard:8x6:40"),
            *("--laser", str(data / "laser-boards"), "--table", str(data / "empty-table")),
            *("--markers", "DICT_4X4_50:30", "--table-step-deg", "2.25"),
            *("-o", str(Path(folder) / "rig.json")),
        ]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds = time.perf_counter() - begin
    f = json.loads(done.stdout)["figures"]
    print(
        f"turntable-mouse: camera {f['camera_rms_px']:.3f} px, sheet "
        f"{f['sheet_rms_mm']['laser']:.3f} mm ({f['sheet_rms_px']['laser']:.3f} px), table "
        f"{f['table_rms_px']:.3f} px, marker side {f['marker_side_mm']['value']:.3f} ± "
        f"{f['marker_side_mm']['sigma']:.3f} mm, {seconds:.1f} s"
    )
