"""Folders and videos as cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from turnscan.devices import open_camera
from turnscan.errors import DeviceDisconnected, DeviceGarbled, FormatError, InputError
from turnscan.testing import check_camera


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in (1, 2, 10):
        Pillow.fromarray(np.full((6, 8), k, np.uint8)).save(tmp_path / f"step{k}.png")
    return tmp_path


@pytest.fixture
def video(tmp_path: Path) -> Path:
    import cv2

    path = tmp_path / "turn.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (64, 48))
    for k in range(5):
        writer.write(np.full((48, 64, 3), 40 * k, np.uint8))
    writer.release()
    return path


def test_pictures_come_in_natural_order_and_then_end(folder: Path) -> None:
    with open_camera(f"folder:{folder}") as camera:
        assert [int(camera.grab(1.0)[0, 0]) for _ in range(3)] == [1, 2, 10]
        with pytest.raises(DeviceDisconnected, match="all its 3 pictures"):
            camera.grab(1.0)


def test_a_pattern_and_a_loop(folder: Path) -> None:
    with open_camera(f"folder:{folder}/step1*.png?loop=1") as camera:
        assert [int(camera.grab(1.0)[0, 0]) for _ in range(4)] == [1, 10, 1, 10]


def test_nothing_can_be_set(folder: Path) -> None:
    with open_camera(f"folder:{folder}") as camera:
        assert np.isnan(camera.configure(0.01, 1.0)).all()


def test_a_damaged_picture_is_named(folder: Path) -> None:
    (folder / "step2.png").write_bytes((folder / "step2.png").read_bytes()[:40])
    with open_camera(f"folder:{folder}") as camera:
        camera.grab(1.0)
        with pytest.raises(DeviceGarbled, match=r"step2\.png"):
            camera.grab(1.0)
        assert camera.grab(1.0)[0, 0] == 10


def test_no_pictures_no_video(tmp_path: Path) -> None:
    for address in (f"folder:{tmp_path}", f"folder:{tmp_path}/no", f"video:{tmp_path}/no.avi"):
        with pytest.raises(InputError), open_camera(address):
            pass
    (tmp_path / "no.avi").write_bytes(b"nothing")
    with pytest.raises(FormatError), open_camera(f"video:{tmp_path}/no.avi"):
        pass


def test_frames_of_a_video_come_in_order(video: Path) -> None:
    with open_camera(f"video:{video}") as camera:
        means = [float(camera.grab(1.0).mean()) for _ in range(5)]
        assert means == pytest.approx([0, 40, 80, 120, 160], abs=2)
        with pytest.raises(DeviceDisconnected, match="all its 5 pictures"):
            camera.grab(1.0)
    with open_camera(f"video:{video}?loop=1") as camera:
        assert float([camera.grab(1.0) for _ in range(7)][6].mean()) == pytest.approx(40, abs=2)


def test_they_pass_the_conformance_kit(folder: Path, video: Path) -> None:
    check_camera(f"folder:{folder}?loop=1")
    check_camera(f"video:{video}?loop=1")
