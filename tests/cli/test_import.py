"""turnscan import: a folder of pictures becomes a scan file, or one line says why not."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image as Pillow

from turnscan.cli import turnscan
from turnscan.errors import ExportError, FormatError, InputError, ScanError, TurnscanError
from turnscan.rig import Camera, LaserSheet, Marker, Pose, Rig, rig_to_json, rotation_z
from turnscan.scan import Scan, read_picture
from turnscan.stripes import Signal, StripeSettings

SIZE = (60, 80)


def picture(step: int, lit: bool = True, colour: bool = False, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng([step, lit, seed])
    v, u = np.mgrid[: SIZE[0], : SIZE[1]]
    scene = 30 + 20 * np.sin(u / 7) * np.cos(v / 5)
    light = 150 * np.exp(-((u - 25 - 3 * step % 30 - 4 * np.sin(v / 9)) ** 2) / 2 / 1.5**2) * lit
    if not colour:
        return np.rint(scene + light + rng.normal(0, 0.8, SIZE)).clip(0, 255).astype(np.uint8)
    rgb = scene[..., None] * (1.0, 0.9, 0.8) + light[..., None] * (0.2, 1.0, 0.1)
    return np.rint(rgb + rng.normal(0, 0.8, rgb.shape)).clip(0, 255).astype(np.uint8)


def folder(
    path: Path, steps: list[int], *, lit: bool = True, colour: bool = False, suffix: str = "png"
) -> Path:
    path.mkdir()
    for step in steps:
        Pillow.fromarray(picture(step, lit, colour)).save(path / f"step_num{step}.{suffix}")
    return path


def run(*args: object) -> str:
    """Run the verb; errors of turnscan pass through, other failures fail the test."""
    result = CliRunner().invoke(turnscan, ["import", *map(str, args)], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.output


def rig_file(path: Path, width: int = SIZE[1]) -> Path:
    camera = Camera(width, SIZE[0], 90.0, 90.0, 39.5, 29.5)
    sheet = LaserSheet("laser", np.array([0.6, 0.0, -0.8]), np.array([0.0, 0.0, 300.0]))
    rig = Rig(camera, (sheet,), Pose(np.eye(3), np.array([0.0, 0.0, 300.0])))
    path.write_text(rig_to_json(rig))
    return path


def test_pairs_with_gaps_and_a_rig(tmp_path: Path) -> None:
    steps = [1, 3, 5, 9, 11]
    lit = folder(tmp_path / "on", steps)
    dark = folder(tmp_path / "off", steps, lit=False)
    rig = rig_file(tmp_path / "rig.json")
    said = run(
        lit, "--dark", dark, "-o", tmp_path / "a.turnscan", "--angles", "step:-2.5", "--rig", rig
    )
    assert "5 frames, 6 steps" in said
    assert "scan.missing-step" in said
    assert "steps 3" in said
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.steps == 6
        assert scan.complete
        assert scan.missing("laser") == {3: "no picture"}
        assert scan.steps() == [0, 1, 2, 4, 5]
        np.testing.assert_allclose(np.degrees(scan.angles()), [0, -2.5, -5, -10, -12.5])
        assert scan.rig is not None
        assert 3 < scan.plan.threshold < 8
        for frame, number in zip(scan.frames(), steps, strict=True):
            assert dict(frame.settings) == {"picture": f"step_num{number}.png", "number": number}
            on, off = picture(number), picture(number, lit=False)
            bright = on.astype(int) - off > 12
            assert bright.sum() > 200
            np.testing.assert_array_equal(frame.lit[bright], on[bright])
            np.testing.assert_array_equal(frame.dark[bright], off[bright])
    checked = CliRunner().invoke(turnscan, ["check", str(tmp_path / "a.turnscan"), "--json"])
    assert checked.exit_code == 1, "a missing step is a warning"
    report = json.loads(checked.output)
    assert report["lasers"]["laser"]["frames"] == 5
    assert report["lasers"]["laser"]["missing"] == {"3": "no picture"}
    assert [f["code"] for f in report["findings"]] == ["scan.missing-step"]


def test_the_background_is_learned_where_there_is_no_dark(tmp_path: Path) -> None:
    lit = folder(tmp_path / "on", list(range(12)))
    said = run(lit, "-o", tmp_path / "a.turnscan", "--angles", "step:30")
    assert "median of 12 pictures" in said
    with Scan.open(tmp_path / "a.turnscan") as scan:
        background = scan.background("laser")
        assert background is not None
        truth = picture(0, lit=False).astype(int)
        assert np.abs(background.astype(int) - truth).mean() < 2
        frame = scan.frame(4, "laser")
        bright = picture(4).astype(int) - background > 25
        np.testing.assert_array_equal(frame.lit[bright], picture(4)[bright])
        np.testing.assert_array_equal(frame.dark, background)


def test_a_stripe_that_stays_in_place_is_not_taken_for_background(tmp_path: Path) -> None:
    """A round part: the stripe stands still in two of three pictures. The median would eat it."""
    lit = tmp_path / "on"
    lit.mkdir()
    for k in range(18):
        where = 7 if k % 3 else 2
        Pillow.fromarray(picture(where, seed=k)).save(lit / f"s{k}.png")
    found = {}
    for choice in ("auto", "median", "beside", "darkest"):
        path = tmp_path / f"{choice}.turnscan"
        said = run(lit, "-o", path, "--angles", "step:20", "--background", choice)
        assert ("outside the stripe" in said) == (choice in ("auto", "beside"))
        with Scan.open(path) as scan:
            frame = scan.frame(4, "laser")
            found[choice] = int((frame.lit.astype(int) - frame.dark > 60).sum())
    assert found["auto"] == found["beside"] > 100
    assert found["darkest"] > 100
    assert found["median"] < 20


@pytest.mark.parametrize(("half", "said"), [(22, "outside the stripe"), (60, "darkest of")])
def test_a_dark_part_before_a_bright_wall(tmp_path: Path, half: int, said: str) -> None:
    """A part of 10 % of the picture or of 25 %, wider or narrower by turns; its stripe stays."""
    rng = np.random.default_rng(3)
    (tmp_path / "on").mkdir()
    u = np.arange(480)
    for k in range(20):
        wall = np.where(np.abs(u - 150) < half * (1 + 0.6 * np.sin(k / 3)), 6.0, 60.0)
        line = 120 * np.exp(-((u - 150 - 2 * np.sin(k / 3)) ** 2) / 2 / 1.5**2)
        seen = (wall + line + rng.normal(0, 1, (60, 480))).round().clip(0, 255).astype(np.uint8)
        Pillow.fromarray(seen).save(tmp_path / "on" / f"s{k}.png")
    path = tmp_path / "a.turnscan"
    assert said in run(tmp_path / "on", "-o", path, "--angles", "step:18")
    with Scan.open(path) as scan:
        signal = Signal(scan.plan.weights, scan.plan.dtype)
        for k in range(20):
            f = scan.frame(k, "laser")
            stripe = signal.detect(f.lit, f.dark, StripeSettings(), f.level, f.noise)
            # The stripe of other pictures, in part of background, may pull by a third of a width.
            np.testing.assert_allclose(stripe.position, 150 + 2 * np.sin(k / 3), atol=0.5)


@pytest.mark.parametrize("colour", ["green", "learn", "-0.5,1,-0.5"])
def test_colour_pictures_keep_their_colours(tmp_path: Path, colour: str) -> None:
    lit = folder(tmp_path / "on", list(range(12)), colour=True)
    run(lit, "-o", tmp_path / "a.turnscan", "--angles", "step:30", "--colour", colour)
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.channels == 3
        weights = np.array(scan.plan.weights)
        assert weights.argmax() == 1, "the laser is green"
        assert weights[1] > 0
        on = picture(4, colour=True)
        bright = on[..., 1].astype(int) - picture(4, lit=False, colour=True)[..., 1] > 40
        np.testing.assert_array_equal(scan.frame(4, "laser").lit[bright], on[bright])


def test_several_lasers(tmp_path: Path) -> None:
    for name in ("left", "right"):
        folder(tmp_path / name, [0, 1, 2])
        folder(tmp_path / f"{name}-off", [0, 1, 2], lit=False)
    run(
        "--lit", f"left={tmp_path}/left", "--lit", f"right={tmp_path}/right",
        "--dark", f"left={tmp_path}/left-off", "--dark", f"right={tmp_path}/right-off",
        "-o", tmp_path / "a.turnscan", "--angles", "step:1", "--keep", "full",
    )  # fmt: skip
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.lasers == ("left", "right")
        assert [(f.laser, f.step) for f in scan.frames()] == [
            (name, k) for name in ("left", "right") for k in range(3)
        ]
        for frame in scan.frames("right"):
            np.testing.assert_array_equal(frame.lit, picture(frame.step))


def test_one_dark_picture_for_all_and_every_other_step(tmp_path: Path) -> None:
    lit = folder(tmp_path / "on", list(range(8)))
    dark = tmp_path / "off.png"
    Pillow.fromarray(picture(0, lit=False)).save(dark)
    run(lit, "--dark", dark, "-o", tmp_path / "a.turnscan", "--angles", "step:2", "--every", "3")
    with Scan.open(tmp_path / "a.turnscan") as scan:
        np.testing.assert_allclose(np.degrees(scan.angles()), [0, 6, 12])
        assert [f.settings["number"] for f in scan.frames()] == [0, 3, 6]
        np.testing.assert_array_equal(scan.background("laser"), picture(0, lit=False))


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("0\n10\n25\n", [0, 10, 25]),
        ("angle_deg\n0\n10\n\n25", [0, 10, 25]),
        ("number,angle_deg\n5,25\n1,0\n3,10\n", [0, 10, 25]),
        ("# mine\n1;0;0.1\n3;10;0.1\n5;25;0.1\n7;30;0.1", [0, 10, 25]),
    ],
)
def test_angles_from_a_list(tmp_path: Path, text: str, degrees: list[float]) -> None:
    lit = folder(tmp_path / "on", [1, 3, 5])
    dark = folder(tmp_path / "off", [1, 3, 5], lit=False)
    (tmp_path / "angles.csv").write_text(text)
    run(lit, "--dark", dark, "-o", tmp_path / "a.turnscan", "--angles", tmp_path / "angles.csv")
    with Scan.open(tmp_path / "a.turnscan") as scan:
        np.testing.assert_allclose(np.degrees(scan.angles()), degrees)
        sigma = scan.frame(0, "laser").angle_sigma
        assert math.isnan(sigma) or math.degrees(sigma) == pytest.approx(0.1)


def _marker_rig() -> Rig:
    """A camera that looks down at the platter at 45°, and four markers on it."""
    side = np.array([[-8.0, 8, 0], [8, 8, 0], [8, -8, 0], [-8, -8, 0]])
    places = [np.array([28 * np.cos(a), 28 * np.sin(a), 0.0]) for a in np.arange(4) * np.pi / 2]
    markers = tuple(Marker("DICT_4X4_50", k, side + p) for k, p in enumerate(places))
    half = math.sqrt(0.5)
    down = np.array([[1.0, 0, 0], [0, -half, -half], [0, half, -half]])
    sheet = LaserSheet("laser", np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 200.0]))
    camera = Camera(480, 360, 750.0, 750.0, 239.5, 179.5)
    return Rig(camera, (sheet,), Pose(down, np.array([0.0, 0.0, 200.0])), markers)


def _marker_picture(rig: Rig, angle: float) -> np.ndarray:
    import cv2

    out = np.full((360, 480), 200, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for marker in rig.markers:
        corners = rig.camera.project(rig.T_camera_table.apply(marker.corners @ rotation_z(angle).T))
        tag = cv2.aruco.generateImageMarker(dictionary, marker.number, 120)
        flat = np.array([[-0.5, -0.5], [119.5, -0.5], [119.5, 119.5], [-0.5, 119.5]], np.float32)
        warp = cv2.getPerspectiveTransform(flat, corners.astype(np.float32))
        drawn = cv2.warpPerspective(tag, warp, (480, 360), flags=cv2.INTER_AREA, borderValue=200)
        out = np.minimum(out, drawn)
    return out


def test_angles_from_markers(tmp_path: Path) -> None:
    rig = _marker_rig()
    (tmp_path / "rig.json").write_text(rig_to_json(rig))
    (tmp_path / "on").mkdir()
    truth = np.radians(np.arange(16) * 22.5 + 2.0 * np.sin(np.arange(16)))
    for k, angle in enumerate(truth):
        shown = _marker_picture(rig, angle) if k != 7 else np.full((360, 480), 200, np.uint8)
        Pillow.fromarray(shown).save(tmp_path / "on" / f"s{k}.png")
    said = run(
        tmp_path / "on", "-o", tmp_path / "a.turnscan", "--angles", "markers",
        "--rig", tmp_path / "rig.json",
    )  # fmt: skip
    assert "from markers" in said
    assert "calibrate.angle-filled" in said
    with Scan.open(tmp_path / "a.turnscan") as scan:
        error = np.degrees(scan.angles() - truth)
        error -= 360 * np.round(error[0] / 360)
        seen = np.arange(16) != 7
        assert np.abs(error[seen]).max() < 0.2
        assert abs(error[7]) < 4
        frame = scan.frame(3, "laser")
        assert math.isnan(frame.commanded)
        assert 0 < math.degrees(frame.angle_sigma) < 0.2


def test_sixteen_bits_and_a_video(tmp_path: Path) -> None:
    import cv2

    (tmp_path / "on").mkdir()
    for k in range(4):
        cv2.imwrite(str(tmp_path / "on" / f"s{k}.tif"), picture(k).astype(np.uint16) * 250)
    run(tmp_path / "on", "-o", tmp_path / "a.turnscan", "--angles", "step:9", "--keep", "full")
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.dtype == "uint16"
        np.testing.assert_array_equal(
            scan.frame(2, "laser").lit, read_picture(tmp_path / "on" / "s2.tif")
        )
    path = tmp_path / "a.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, SIZE[::-1])
    for k in range(5):
        video.write(picture(k, colour=True)[..., ::-1])
    video.release()
    said = run(path, "-o", tmp_path / "v.turnscan", "--angles", "step:9", "--colour", "green")
    assert "scan.video" in said
    with Scan.open(tmp_path / "v.turnscan") as scan:
        assert len(scan) == 5
        assert scan.plan.channels == 3


def test_a_frozen_camera_is_noticed(tmp_path: Path) -> None:
    lit = folder(tmp_path / "on", [0, 1, 2, 3, 4])
    (lit / "step_num3.png").write_bytes((lit / "step_num2.png").read_bytes())
    said = run(lit, "-o", tmp_path / "a.turnscan", "--angles", "step:9")
    assert "scan.same-picture" in said
    assert "step_num3.png" in said


def _text_png(t: Path) -> None:
    (t / "on" / "step_num2.png").write_text("I am text")


def _cut_jpeg(t: Path) -> None:
    Pillow.fromarray(picture(2)).save(t / "on" / "step_num2.jpg")
    (t / "on" / "step_num2.png").unlink()
    data = (t / "on" / "step_num2.jpg").read_bytes()
    (t / "on" / "step_num2.jpg").write_bytes(data[: len(data) * 2 // 3])


def _other_size(t: Path) -> None:
    Pillow.fromarray(picture(2)[:, :-2]).save(t / "on" / "step_num2.png")


def _colour_among_grey(t: Path) -> None:
    Pillow.fromarray(picture(2, colour=True)).save(t / "on" / "step_num2.png")


def _fewer_dark(t: Path) -> None:
    (t / "off" / "step_num2.png").unlink()


def _rig_with_nan(t: Path) -> None:
    (t / "rig.json").write_text((t / "rig.json").read_text().replace("90.0", "NaN", 1))


def _rig_of_another_camera(t: Path) -> None:
    rig_file(t / "rig.json", width=81)


def _write_angles(text: str):
    def change(t: Path) -> None:
        (t / "angles.csv").write_text(text)

    return change


def _no_pictures(t: Path) -> None:
    for path in (t / "on").iterdir():
        path.unlink()


def _no_folder(t: Path) -> None:
    _no_pictures(t)
    (t / "on").rmdir()


BAD = [
    (_no_folder, InputError, "no such file or folder"),
    (_no_pictures, InputError, "no picture in this folder"),
    (_text_png, FormatError, "step_num2.png: not a PNG"),
    (_cut_jpeg, FormatError, "step_num2.jpg: damaged or truncated"),
    (_other_size, InputError, "step_num2.png is 78×60 grey uint8, but the first picture is 80×60"),
    (_colour_among_grey, InputError, "step_num2.png is 80×60 colour uint8"),
    (_fewer_dark, InputError, "5 pictures of laser 'laser' with the laser on, 4 with it off"),
    (_rig_with_nan, FormatError, "NaN"),
    (_rig_of_another_camera, InputError, "rig's camera has 81×60"),
    (_write_angles("0\n1\n2\n"), InputError, "3 angles for 5 pictures"),
    (_write_angles("0\n1\nNaN\n3\n4\n"), FormatError, "line 3: NaN is not an angle"),
    (_write_angles("nan\n1\n2\n3\n4\n"), FormatError, "line 1: nan is not an angle"),
    (_write_angles("0,0\n1,5\n1,6\n3,7\n4,8\n"), FormatError, "line 3: number 1 is given twice"),
    (_write_angles("0,0\n1,5\n2,6\n3,7\n"), InputError, "no angle for step_num4.png"),
    (_write_angles("0\n1\nx\n3\n4\n"), FormatError, "line 3: 'x' is not a number"),
    (_write_angles("1,2,3,4\n"), FormatError, "line 1: 4 values"),
    (_write_angles(""), FormatError, "no angle in it"),
]


@pytest.mark.parametrize(("spoil", "kind", "words"), BAD)
@pytest.mark.parametrize("before", [None, b"an older scan"])
def test_bad_input_is_one_line_and_changes_nothing(
    tmp_path: Path, spoil, kind: type[TurnscanError], words: str, before: bytes | None
) -> None:
    lit = folder(tmp_path / "on", list(range(5)))
    dark = folder(tmp_path / "off", list(range(5)), lit=False)
    rig = rig_file(tmp_path / "rig.json")
    (tmp_path / "angles.csv").write_text("0\n1\n2\n3\n4\n")
    spoil(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    if before is not None:
        (out / "a.turnscan").write_bytes(before)
    with pytest.raises(kind) as caught:
        run(
            lit, "--dark", dark, "-o", out / "a.turnscan",
            "--angles", tmp_path / "angles.csv", "--rig", rig,
        )  # fmt: skip
    assert type(caught.value) is kind
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert os.listdir(out) == ([] if before is None else ["a.turnscan"])
    assert before is None or (out / "a.turnscan").read_bytes() == before


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["--angles", "step:x"], "not a number"),
        (["--angles", "step:nan"], "not an angle"),
        (["--angles", "step:0"], "not a step"),
        (["--angles", "markers"], "needs a rig"),
        (["--angles", "nothing.csv"], "no such file"),
        (["--angles", "step:1", "--lit", "left"], "give PICTURES of one laser, or --lit"),
        (["--angles", "step:1", "--first-step", "3"], "lower numbers"),
    ],
)
def test_bad_options(tmp_path: Path, args: list[str], words: str) -> None:
    lit = folder(tmp_path / "on", list(range(3)))
    with pytest.raises((InputError, ScanError, ExportError)) as caught:
        run(lit, "-o", tmp_path / "a.turnscan", *args)
    assert words in str(caught.value)
    assert not (tmp_path / "a.turnscan").exists()


def test_a_target_that_is_a_folder_or_in_none(tmp_path: Path) -> None:
    lit = folder(tmp_path / "on", list(range(3)))
    with pytest.raises(ExportError, match="no folder"):
        run(lit, "-o", tmp_path / "nowhere" / "a.turnscan", "--angles", "step:1")
    (tmp_path / "a.turnscan").mkdir()
    with pytest.raises(ExportError, match="a folder"):
        run(lit, "-o", tmp_path / "a.turnscan", "--angles", "step:1")


def test_at_the_real_door_it_is_one_line_and_exit_2(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "turnscan", "import", str(tmp_path / "none"), "-o",
         str(tmp_path / "a.turnscan"), "--angles", "step:1"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "no such file or folder" in done.stderr


def test_a_real_scan_of_others(tmp_path: Path, shared_data: Path) -> None:
    """Every eighth picture of the mouse: laser and background learned, few pixels kept."""
    said = run(
        shared_data / "turntable-mouse" / "object", "-o", tmp_path / "m.turnscan",
        "--angles", "step:2.25", "--every", "8",
    )  # fmt: skip
    assert "20 frames, 20 steps" in said
    with Scan.open(tmp_path / "m.turnscan") as scan:
        weights = np.array(scan.plan.weights)
        assert weights.max() > 0
        assert "outside the stripe" in said, "this laser is always on, the part nearly round"
        np.testing.assert_allclose(np.degrees(scan.angles()), 18.0 * np.arange(20))
        assert scan.frame(1, "laser").settings["picture"] == "step_num17.jpg"
    raw = 20 * 640 * 480 * 3
    assert (tmp_path / "m.turnscan").stat().st_size < raw / 5


@pytest.mark.parametrize("keep", ["sparse", "full"])
@pytest.mark.parametrize("level", [0, 255])
def test_pictures_without_a_stripe_are_named(tmp_path: Path, keep: str, level: int) -> None:
    (tmp_path / "on").mkdir()
    for step in range(4):
        plain = np.full(SIZE, level, np.uint8)
        Pillow.fromarray(plain).save(tmp_path / "on" / f"step_num{step}.png")
    args = ("--angles", "step:90", "--keep", keep, "-o", tmp_path / "a.turnscan")
    assert "scan.no-stripe" in run(tmp_path / "on", *args)
    lit = folder(tmp_path / "lit", list(range(4)))
    assert "scan.no-stripe" not in run(lit, *args)


def test_a_threshold_that_nothing_passes_is_refused(tmp_path: Path) -> None:
    lit = folder(tmp_path / "on", list(range(4)))
    args = (lit, "--angles", "step:90", "-o", tmp_path / "a.turnscan", "--threshold")
    for given in ("1e300", "255"):
        with pytest.raises(InputError, match="brightest pixel has 255"):
            run(*args, given)
    assert not (tmp_path / "a.turnscan").exists()
    assert "scan.no-stripe" in run(*args, "254")
