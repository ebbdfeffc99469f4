"""Bad input at the door: one clear line, the exit code of the error, and every file as it was."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from turnscan.cli import main, turnscan
from turnscan.rig import Camera, LaserSheet, Pose, Rig, rig_to_json, rotation_about

OLD = b"what stood here before"


def _frame(width: int = 160, dtype: type = np.uint8) -> np.ndarray:
    image = np.full((120, width), 8, dtype)
    image[20:100, 80:83] = 200 * (256 if dtype == np.uint16 else 1)
    return image


def _pictures(folder: Path, suffix: str = ".png") -> Path:
    folder.mkdir()
    for k in range(4):
        cv2.imwrite(str(folder / f"p{k}{suffix}"), _frame())
    return folder


def _blank(folder: Path) -> Path:
    """Pictures of the boards' size that show nothing."""
    folder.mkdir()
    for k in range(4):
        cv2.imwrite(str(folder / f"p{k}.png"), np.full((300, 400), 120, np.uint8))
    return folder


def _rig_text() -> str:
    table = Pose(rotation_about([1, 0, 0], np.pi / 2), [0, 40, 400])
    sheet = LaserSheet("laser", [1, 0, 0.5], [0, 0, 400])
    return rig_to_json(Rig(Camera(160, 120, 300, 300, 80, 60), (sheet,), table))


def _scan(folder: Path) -> Path:
    (folder / "good.json").write_text(_rig_text())
    path = folder / "whole.turnscan"
    words = [
        "import", _pictures(folder / "good"), "--dark", _dark(folder), "--angles", "step:90",
        "--rig", folder / "good.json", "-o", path,
    ]  # fmt: skip
    done = CliRunner().invoke(turnscan, [str(w) for w in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return path


def _dark(folder: Path) -> Path:
    (folder / "dark").mkdir()
    for k in range(4):
        cv2.imwrite(str(folder / "dark" / f"p{k}.png"), np.full((120, 160), 8, np.uint8))
    return folder / "dark"


def _as_typed(*args: object) -> tuple[int, str]:
    """Exit code and what stands on stderr, of a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "turnscan", *map(str, args)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stderr


Case = Callable[[Path], list[object]]


def _import(make: Callable[[Path], Path]) -> Case:
    def case(tmp: Path) -> list[object]:
        return ["import", make(tmp), "--angles", "step:90", "-o", tmp / "old.turnscan"]

    return case


def _empty(tmp: Path) -> Path:
    (tmp / "empty").mkdir()
    return tmp / "empty"


def _sizes(tmp: Path) -> Path:
    folder = _pictures(tmp / "sizes")
    cv2.imwrite(str(folder / "p2.png"), _frame(width=170))
    return folder


def _mixed_depth(tmp: Path) -> Path:
    folder = _pictures(tmp / "depth", suffix=".tiff")
    cv2.imwrite(str(folder / "p1.tiff"), _frame(dtype=np.uint16))
    return folder


def _truncated(tmp: Path) -> Path:
    folder = _pictures(tmp / "cut", suffix=".jpg")
    whole = (folder / "p1.jpg").read_bytes()
    (folder / "p1.jpg").write_bytes(whole[: len(whole) // 2])
    return folder


def _text(tmp: Path) -> Path:
    folder = _pictures(tmp / "text")
    (folder / "p3.png").write_text("this is not a picture")
    return folder


def _calibrate(boards: Callable[[Path], Path], lasers: Callable[[Path], Path]) -> Case:
    def case(tmp: Path) -> list[object]:
        return [
            "calibrate", "--camera", boards(tmp), "--board", "chessboard:8x6:10",
            "--laser", lasers(tmp), "--table", _blank(tmp / "table"),
            "--markers", "DICT_4X4_50:30", "-o", tmp / "old.json",
        ]  # fmt: skip

    return case


def _board_views(tmp: Path, count: int = 12) -> Path:
    """Tilted chessboards, 9 × 7 squares of 10 mm, seen by a plain camera."""
    folder = tmp / "boards"
    folder.mkdir()
    print_ = np.kron(np.indices((7, 9)).sum(0) % 2, np.ones((40, 40))) * 255.0
    flat = np.pad(print_, 40, constant_values=255).astype(np.uint8)
    K = np.array([[500.0, 0, 200], [0, 500, 150], [0, 0, 1]])
    rng = np.random.default_rng(5)
    for k in range(count):
        R = rotation_about(rng.normal(size=3) * (1, 1, 0.2), 0.5)
        plane = np.array([[0.25, 0, -55.0], [0, 0.25, -45.0], [0, 0, 1]])
        pose = np.column_stack([R[:, 0], R[:, 1], [0, 0, 190.0 + 10 * (k % 3)]])
        H = K @ pose @ plane
        view = cv2.warpPerspective(flat, H, (400, 300), flags=cv2.INTER_AREA, borderValue=120)
        cv2.imwrite(str(folder / f"b{k}.png"), cv2.GaussianBlur(view, (3, 3), 0))
    return folder


def _few_boards(tmp: Path) -> Path:
    return _board_views(tmp, count=2)


def _nan_rig(tmp: Path) -> list[object]:
    body = json.loads(_rig_text())
    body["camera"]["fx"] = float("nan")
    (tmp / "nan.json").write_text(json.dumps(body))
    return [
        "import", _pictures(tmp / "pictures"), "--angles", "step:90", "--rig", tmp / "nan.json",
        "-o", tmp / "old.turnscan",
    ]  # fmt: skip


def _half_scan(tmp: Path) -> list[object]:
    whole = _scan(tmp).read_bytes()
    (tmp / "half.turnscan").write_bytes(whole[: len(whole) // 2])
    return ["reconstruct", tmp / "half.turnscan", "-o", tmp / "old.dxf"]


def _unwritable(tmp: Path) -> list[object]:
    return ["reconstruct", _scan(tmp), "-o", tmp / "nowhere" / "part.dxf"]


OF_ITS_OWN = {"missing folder", "NaN in a rig", "a scan file cut in half"}
"""One case of each kind is typed in a new process, with what only that could print; a process
takes a second to import what it needs, so the others are given to the same `main` here."""
CASES: dict[str, tuple[Case, int, str]] = {
    "missing folder": (_import(lambda tmp: tmp / "no-such-folder"), 2, "no-such-folder"),
    "empty folder": (_import(_empty), 2, "empty"),
    "pictures of different sizes": (_import(_sizes), 2, "p2.png"),
    "one 16-bit TIFF among 8-bit ones": (_import(_mixed_depth), 2, "p1.tiff"),
    "truncated JPEG": (_import(_truncated), 2, "p1.jpg"),
    "text called .png": (_import(_text), 2, "p3.png"),
    "boards never found": (_calibrate(lambda t: _blank(t / "b"), _board_views), 2, "contrast"),
    "too few boards": (_calibrate(_few_boards, lambda t: _blank(t / "l")), 2, "contrast"),
    "a laser never seen": (_calibrate(_board_views, lambda t: t / "boards"), 2, "contrast"),
    "NaN in a rig": (_nan_rig, 2, "NaN"),
    "a scan file cut in half": (_half_scan, 5, "half.turnscan"),
    "a DXF path that cannot be written": (_unwritable, 5, "nowhere"),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_clear_line_and_changes_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    make, code, text = CASES[name]
    args = make(tmp_path)
    old = {tmp_path / f"old{suffix}": OLD for suffix in (".turnscan", ".json", ".dxf")}
    for path, content in old.items():
        path.write_bytes(content)
    before = sorted(tmp_path.rglob("*"))
    if name in OF_ITS_OWN:
        ended, said = _as_typed(*args)
    else:
        monkeypatch.setattr(sys, "argv", ["turnscan", *map(str, args)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        ended, said = int(stop.value.code or 0), capfd.readouterr().err
    complaints = [line for line in said.splitlines() if line.startswith("turnscan: ")]
    assert ended == code, said
    assert len(complaints) == 1, said
    assert text in complaints[0]
    assert " → " in complaints[0], "what to do next"
    assert "Traceback" not in said
    assert sorted(tmp_path.rglob("*")) == before
    assert all(path.read_bytes() == content for path, content in old.items())
