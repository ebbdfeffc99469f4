"""Cameras by address; a driver that breaks breaks only itself (RELIABILITY D10, D11)."""

from __future__ import annotations

from pathlib import Path

import pytest

from turnscan.devices import Camera, camera_schemes, find_cameras, open_camera
from turnscan.errors import DeviceDisconnected, DeviceError, DeviceNotFound, InputError
from turnscan.testing import check_camera

BROKEN = {
    "at_import": "raise RuntimeError('no such library')",
    "at_exit": "raise SystemExit(3)",
    "at_open": "def Camera(address): raise KeyError(address)",
    "at_use": """
class Camera:
    closed = 0
    def __init__(self, address): pass
    def configure(self, seconds, gain): return 1 / 0
    def grab(self, timeout): raise ValueError("odd")
    def close(self):
        Camera.closed += 1
        raise OSError("already unplugged")
    @staticmethod
    def find(): raise IndexError("nothing here")
""",
    "odd_answer": """
class Camera:
    def __init__(self, address): pass
    def configure(self, seconds, gain): return seconds
    def grab(self, timeout): return None
""",
}


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Installed packages, each with a driver that is broken in its own way."""
    for name, source in BROKEN.items():
        (tmp_path / f"turnscan_{name}.py").write_text(source)
        info = tmp_path / f"turnscan_{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: turnscan-{name}\nVersion: 1\n"
        )
        scheme = name.replace("_", "")
        (info / "entry_points.txt").write_text(
            f"[turnscan.cameras]\n{scheme} = turnscan_{name}:Camera\n"
            + ("uvc = turnscan_at_import:Camera\n" if name == "at_import" else "")
        )
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.mark.usefixtures("broken")
def test_a_broken_driver_breaks_only_itself() -> None:
    for scheme, words in {
        "atimport": "RuntimeError: no such library",
        "atexit": "SystemExit: 3",
        "atopen": "KeyError: 'atopen:x'",
    }.items():
        with (
            pytest.raises(DeviceError, match=f"{scheme}:x: its driver failed: {words}"),
            open_camera(f"{scheme}:x"),
        ):
            pass
    with open_camera("atuse:x") as camera:
        with pytest.raises(DeviceError, match="ZeroDivisionError"):
            camera.configure(0.1, 1.0)
        with pytest.raises(DeviceError, match="ValueError: odd"):
            camera.grab(1.0)
    import turnscan_at_use  # type: ignore[import-not-found]

    assert turnscan_at_use.Camera.closed == 1
    with open_camera("sim:cup?rig=ciclop") as camera:
        assert isinstance(camera, Camera)


@pytest.mark.usefixtures("broken")
def test_an_answer_of_the_wrong_kind_is_the_drivers_failure() -> None:
    with (
        pytest.raises(DeviceError, match="its driver failed: TypeError"),
        open_camera("oddanswer:") as camera,
    ):
        camera.configure(0.1, 1.0)


@pytest.mark.usefixtures("broken")
def test_our_own_kinds_cannot_be_taken_over() -> None:
    with pytest.raises(DeviceNotFound, match="uvc:97"), open_camera("uvc:97"):
        pass


@pytest.mark.usefixtures("broken")
def test_looking_for_cameras_names_what_could_not_be_looked_for() -> None:
    addresses, findings = find_cameras()
    assert all(":" in a for a in addresses)
    told = {f.where: f.message for f in findings}
    assert "no such library" in told["atimport"]
    assert "IndexError" in told["atuse"]
    assert "uvc" not in told


def test_kinds_of_addresses() -> None:
    assert set(camera_schemes()) >= {
        "aravis", "folder", "genicam", "picamera2", "sim", "uvc", "video",
    }  # fmt: skip
    for address in ("", "cup", "nonsense:1", "/dev/video0"):
        with pytest.raises(InputError, match="not a camera address"), open_camera(address):
            pass


def test_a_closed_camera_says_so() -> None:
    with open_camera("sim:cup?rig=ciclop") as camera:
        pass
    with pytest.raises(DeviceDisconnected, match="closed"):
        camera.grab(1.0)


def test_the_simulated_camera_passes_the_conformance_kit() -> None:
    check_camera("sim:sphere?rig=ciclop&perfect=1", pictures=2)
