"""GenICam through harvesters, against the simulator producer in the genicam wheel."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from tests.needs import needs
from turnscan.devices import find_cameras, open_camera
from turnscan.errors import DeviceNotFound, DeviceTimeout, InputError
from turnscan.testing import check_camera


@pytest.fixture
def viky() -> str:
    """The producer: three cameras that see a bouncing ball, without exposure or trigger."""
    needs("GenICam")
    spec = importlib.util.find_spec("genicam")
    assert spec is not None
    assert spec.origin is not None
    return str(Path(spec.origin).parent / "viky.cti")


def test_it_passes_the_conformance_kit(viky: str) -> None:
    check_camera(f"genicam:?cti={viky}")


def test_a_camera_by_serial_number_and_format(viky: str) -> None:
    with open_camera(f"genicam:1?cti={viky}&format=Mono8") as camera:
        assert all(math.isnan(x) for x in camera.configure(0.01, 1.0))
        first, second = camera.grab(5.0), camera.grab(5.0)
        assert first.shape == (400, 400)
        assert first.dtype == np.uint8
        assert not np.array_equal(first, second), "the ball moves"


def test_cameras_of_the_environment_are_found(viky: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(Path(viky).parent))
    addresses, _ = find_cameras()
    assert {"genicam:0", "genicam:1", "genicam:2"} <= set(addresses)
    with open_camera("genicam:2") as camera:
        assert camera.grab(5.0).shape == (400, 400, 3)


def test_what_is_not_there(viky: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("GENICAM_GENTL64_PATH", raising=False)
    with pytest.raises(DeviceNotFound, match="no GenTL producer"), open_camera("genicam:"):
        pass
    for address, words in (
        (f"genicam:?cti={tmp_path}/no.cti", "no such producer"),
        (f"genicam:77?cti={viky}", "no such camera"),
    ):
        with pytest.raises(DeviceNotFound, match=words), open_camera(address):
            pass
    with pytest.raises(InputError, match="no option"), open_camera("genicam:?exposure=1"):
        pass


def test_time_runs_out_and_the_next_picture_comes(viky: str) -> None:
    with open_camera(f"genicam:?cti={viky}") as camera:
        with pytest.raises(DeviceTimeout, match=r"within 0\.01 s"):
            camera.grab(0.01)
        assert camera.grab(5.0).any()
