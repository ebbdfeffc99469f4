"""The real turntable and the real board pairs made by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.calibrate.mouse import calibrate_mouse
from tests.needs import needs_shared
from tests.once import once
from turnscan.calibrate import (
    CalibrationSettings,
    LaserPicture,
    calibrate_rig,
    detect_board,
    figures,
    fit_sheet,
    parse_board,
    platter_seen,
    stripe_light,
    white_margin,
)
from turnscan.rig import Camera, Rig, rig_from_json
from turnscan.scan import list_pictures, read_picture

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, str, str]:
    """The rig of the turntable, what was said, the report."""
    needs_shared()
    made = once(tmp_path_factory, "mouse-rig", calibrate_mouse)
    rig, said, report = ((made / n).read_text() for n in ("rig.json", "said.txt", "report.html"))
    return rig_from_json(rig), said, report


def figure(said: str, line: str, at: int) -> float:
    return float(next(x for x in said.splitlines() if x.startswith(line)).split()[at])


def test_residuals(calibrated: tuple[Rig, str, str]) -> None:
    said = calibrated[1]
    assert 0.03 < figure(said, "camera ", 1) < 0.3
    assert 0.02 < figure(said, "sheet ", 1) < 0.5
    assert 0.05 < figure(said, "table ", 1) < 0.5


def test_what_is_odd_about_this_table_is_named(calibrated: tuple[Rig, str, str]) -> None:
    said = calibrated[1]
    for code in ("marker-size", "marker-centre", "step-start", "board-bent", "rejected"):
        assert f"calibrate.{code}" in said


def test_report_is_one_file_with_the_failures(calibrated: tuple[Rig, str, str]) -> None:
    page = calibrated[2]
    assert page.count("data:image/png;base64") > 8
    assert "extra_Image137.jpg" in page
    assert "<script" not in page
    assert 'src="http' not in page


def test_the_stripe_on_the_table_of_the_object_lies_on_the_platter(
    calibrated: tuple[Rig, str, str],
) -> None:
    rig = calibrated[0]
    picture = read_picture(needs_shared("turntable-mouse", "object", "step_num161.jpg"))
    angle = platter_seen(picture, rig).angle
    assert angle is not None
    assert angle.residual_px < 0.7
    light = stripe_light(picture, None, (0, 1, 0)).places
    low = light[(light[:, 1] > 360) & (light[:, 1] < 410) & (light[:, 0] > 360)]
    points = rig.T_camera_table.inverse().apply(rig.sheets[0].intersect(rig.camera.rays(low)))
    assert abs(float(np.median(points[:, 2]))) < 1.0


def test_covariance_is_that_of_the_rig(calibrated: tuple[Rig, str, str]) -> None:
    rig = calibrated[0]
    assert rig.covariance is not None
    assert np.linalg.eigvalsh(rig.covariance).min() > -1e-9
    k = rig.parameter_names.index("camera.fx")
    assert 0.1 < np.sqrt(rig.covariance[k, k]) < 10


@pytest.mark.parametrize("name", ["1eab3c9", "2e27c85", "c092317", "e0aa104"])
def test_charuco_pairs(shared_data: Path, name: str) -> None:
    folder = shared_data / "charuco-pairs"
    K = np.load(next(folder.glob("*.npz")))["mtx"]
    on = read_picture(folder / f"{name}_charuco_board_laser.png")
    off = read_picture(folder / f"{name}_charuco_board.png")
    camera = Camera(on.shape[1], on.shape[0], K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    light = stripe_light(on, off, (1, 0, 0))
    boards = [parse_board(f"charuco:7x5:25:19:DICT_{n}X{n}_50") for n in (4, 5)]
    fit = fit_sheet(camera, [LaserPicture.of(detect_board(off, b), light) for b in boards])
    assert 0.02 < fit.rms_mm <= 0.17
    assert min(fit.points) > 200


def test_green_boards_all_six_without_a_hint(shared_data: Path) -> None:
    """The stripe runs over corners, and from the paper straight on along the floor."""
    board, pictures = parse_board("chessboard:8x6:40"), []
    for path in list_pictures(shared_data / "laser-boards-green"):
        picture = read_picture(path)
        view = detect_board(picture, board, path.name)
        light = stripe_light(picture, None, (0, 1, 0)).places
        pictures.append(LaserPicture(view, light, white_margin(picture, view)))
    c = calibrate_rig([p.view for p in pictures], {"laser": pictures}, (), CalibrationSettings())
    assert not c.rejected
    assert figures(c).sheet_views == {"laser": 6}
    assert 0.05 < figures(c).camera_rms_px < 0.25
