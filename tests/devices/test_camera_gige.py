"""GigE Vision through Aravis, over real packets on loopback."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.needs import needs
from turnscan.arrays import Image
from turnscan.devices import Steady, _aravis, find_cameras, open_camera
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
)
from turnscan.simulate import GigeServer, simulated
from turnscan.testing import check_camera

SIZE = "width=64&height=48"


class Counting:
    """Pictures with noise, their number in the first pixel."""

    def __init__(self) -> None:
        self.rng = np.random.default_rng(1)
        self.asked: list[tuple[float, float]] = []

    def __call__(self, seconds: float, gain: float) -> Image:
        self.asked.append((seconds, gain))
        image = self.rng.integers(20, 60, (48, 64)).astype(np.uint8)
        image[0, 0] = len(self.asked) % 256
        return image


@pytest.fixture
def pictures(aravis: None) -> Iterator[Counting]:
    """A camera that is served while the test runs."""
    counting = Counting()
    with GigeServer(counting) as server:
        yield counting
        assert server.error is None


def test_it_passes_the_conformance_kit(pictures: Counting) -> None:
    check_camera(f"aravis:Aravis-Fake-TS01?{SIZE}")
    assert pictures.asked[0] == (0.005, 1.0)


def test_every_picture_was_taken_after_it_was_asked_for(pictures: Counting) -> None:
    with open_camera(f"aravis:TS01?{SIZE}") as camera:
        camera.configure(0.001, 1.0)
        for _ in range(20):
            before = len(pictures.asked)
            assert camera.grab(5.0)[0, 0] == before + 1


def test_a_picture_of_which_nothing_comes_is_triggered_once_more(
    pictures: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a network loses the trigger; what was waited for before is never handed on."""
    monkeypatch.setattr(_aravis, "_LOST", 2.0)  # a busy machine takes longer than 0.3 s for one
    with open_camera(f"aravis:TS01?{SIZE}") as camera:
        camera.configure(0.001, 1.0)
        driver: Any = camera._there  # type: ignore[attr-defined]
        trigger, lost = driver._camera.software_trigger, [True, False, False]
        driver._camera = Lossy(driver._camera, lambda: lost.pop(0) or trigger())
        assert camera.grab(30.0)[0, 0] == 1
        assert camera.grab(30.0)[0, 0] == 2
        assert lost == []
        monkeypatch.setattr(_aravis, "_LOST", 0.3)
        begun = time.monotonic()
        lost += [True] * 100
        with pytest.raises(DeviceTimeout, match=r"no picture within 1\.5 s"):
            camera.grab(1.5)
        assert 1.5 <= time.monotonic() - begun < 6.0
        assert 3 <= 100 - len(lost) <= 6, "each 0.3 s, until the time is over"


def test_a_buffer_that_is_given_back_empty_is_no_picture(pictures: Counting) -> None:
    """Where the acquisition was begun once more, buffers may come back as they were handed out."""
    with open_camera(f"aravis:TS01?{SIZE}") as camera:
        camera.configure(0.001, 1.0)
        driver: Any = camera._there  # type: ignore[attr-defined]
        driver._stream = Hasty(driver._stream, _aravis.aravis_library(), 3)
        before = camera.grab(30.0)[0, 0]
        assert driver._stream.empty == 0
        assert camera.grab(30.0)[0, 0] == before + 1
        driver._stream.empty = 10**9
        begun = time.monotonic()
        with pytest.raises(DeviceTimeout, match=r"no picture within 0\.5 s"):
            camera.grab(0.5)
        assert time.monotonic() - begun < 5.0
        driver._stream.empty = 0


class Hasty:
    """A stream of Aravis that gives back so many ``empty`` buffers before what comes."""

    def __init__(self, stream: Any, aravis: Any, empty: int) -> None:
        self._stream, self._aravis, self.empty = stream, aravis, empty

    def timeout_pop_buffer(self, wait: int) -> Any:
        if self.empty:
            self.empty -= 1
            return self._aravis.Buffer.new_allocate(64)
        return self._stream.timeout_pop_buffer(wait)

    def push_buffer(self, buffer: Any) -> None:
        if buffer.get_status() != self._aravis.BufferStatus.CLEARED:
            self._stream.push_buffer(buffer)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class Lossy:
    """A camera of Aravis whose triggers go another way."""

    def __init__(self, camera: Any, trigger: Callable[[], object]) -> None:
        self._camera, self.software_trigger = camera, trigger

    def __getattr__(self, name: str) -> Any:
        return getattr(self._camera, name)


def test_settings_are_read_back_and_refused(pictures: Counting) -> None:
    with open_camera(f"aravis:?{SIZE}") as camera:
        assert camera.configure(0.0123, 1.0) == (pytest.approx(0.0123), 1.0)
        with pytest.raises(DeviceRefused, match="it can do 1e-05 s to 10 s"):
            camera.configure(11.0, 1.0)
        with pytest.raises(DeviceRefused, match="has no unit"):
            camera.configure(0.01, 2.0)


@pytest.mark.parametrize("form", ["Mono16", "RGB8", "BayerRG8"])
def test_other_pixel_formats(aravis: None, form: str) -> None:
    colour = np.zeros((48, 64, 3), np.uint8) + np.array([200, 100, 50], np.uint8)
    sent: Image = np.full((48, 64), 51_400, np.uint16) if form == "Mono16" else colour
    with GigeServer(lambda *_: sent), open_camera(f"aravis:?{SIZE}&format={form}") as camera:
        assert np.array_equal(camera.grab(5.0), sent)


def test_simulated_stripes_come_through_the_wire_to_the_bit(aravis: None) -> None:
    bench = simulated("sim:sphere?rig=ciclop&perfect=1&lasers=1")
    bench.camera.configure(bench.seconds, 1.0)
    rendered: list[Image] = []
    asked: list[float] = []
    for angle, lit in ((0.0, True), (0.4, False)):
        bench.turntable.move_to(angle, 1.0)
        bench.lasers.light(frozenset(bench.lasers.names if lit else ()), 60.0)
        rendered.append(bench.camera.grab(1.0))
    bench.lasers.off()

    def seen(seconds: float, gain: float) -> Image:
        asked.append(seconds)
        return rendered[len(asked) - 1]

    height, width = rendered[0].shape
    address = f"aravis:?format=Mono16&width={width}&height={height}"
    with GigeServer(seen) as server, open_camera(address) as camera:
        camera.configure(bench.seconds, 1.0)
        lit_picture, dark_picture = camera.grab(20.0), camera.grab(20.0)
        assert server.error is None
    assert asked == pytest.approx([bench.seconds] * 2, abs=1e-6)
    assert np.array_equal(lit_picture, rendered[0])
    assert np.array_equal(dark_picture, rendered[1])
    assert lit_picture.max() > 10_000 > dark_picture.max()


def test_lost_packets_are_noticed_and_never_handed_on(aravis: None) -> None:
    counting = Counting()
    with (
        GigeServer(counting, loss=0.02),
        open_camera("aravis:?width=640&height=480") as camera,
    ):
        camera.configure(0.001, 1.0)
        bad = 0
        for _ in range(12):
            try:
                camera.grab(2.0)
            except (DeviceGarbled, DeviceTimeout):
                bad += 1
        assert bad >= 6, "220 packets a picture, 2 % lost: nearly none is whole"
    with GigeServer(counting, loss=0.02), open_camera(f"aravis:?{SIZE}") as camera:
        # 3 packets a picture: 1 in 12 is bad, and is taken again.
        steady = Steady(camera)
        steady.configure(0.001, 1.0)
        came = 0
        for _ in range(60):
            with contextlib.suppress(DeviceGarbled):  # on a busy machine packets come too late
                assert steady.grab(2.0)[0, 0] == len(counting.asked) % 256
                came += 1
        assert came >= 50
        assert steady.counts["incomplete"] + steady.counts["dropped"] >= 1


def test_larger_packets_and_pictures_taken_again_bear_what_the_network_loses(aravis: None) -> None:
    """2 % of the packets: of 220 a picture one is lost nearly always, of 38 every other time."""
    counting = Counting()
    with (
        GigeServer(counting, loss=0.02),
        open_camera("aravis:?width=640&height=480&packet=8192") as camera,
    ):
        steady = Steady(camera)
        steady.configure(0.001, 1.0)
        came = 0
        for _ in range(12):
            with contextlib.suppress(DeviceError):
                came += steady.grab(2.0)[0, 0] == len(counting.asked) % 256
        assert came >= 8
        report = re.search(r"retaken: \d+ × (incomplete|dropped).* → (.+)", steady.retaken)
        assert report is not None
        assert ("packet=8192" in report[2]) == (report[1] == "incomplete")


@contextlib.contextmanager
def fake_camera(name: str) -> Iterator[subprocess.Popen[bytes]]:
    """Aravis' own fake, in a process of its own, once it is found."""
    needs("fake GigE camera")
    process = subprocess.Popen(["arv-fake-gv-camera-0.8", "-i", "127.0.0.1", "-s", name])
    try:
        deadline = time.monotonic() + 60.0
        while not any(name in a for a in find_cameras()[0]) and time.monotonic() < deadline:
            time.sleep(0.1)
        yield process
    finally:
        process.kill()
        process.wait(10.0)


def test_a_triggered_camera_may_be_quick(aravis: None) -> None:
    """The fake is back at once, whatever the exposure: the trigger vouches for it."""
    with fake_camera("QUICK"), open_camera(f"aravis:QUICK?{SIZE}") as camera:
        steady = Steady(camera)
        steady.configure(0.02, 1.0)
        for _ in range(3):
            steady.grab(5.0)
        assert steady.counts["stale"] == 0
        assert steady.retaken == ""


def test_a_camera_that_dies_is_named_and_not_waited_for_again(aravis: None) -> None:
    with fake_camera("DIES") as process, open_camera(f"aravis:DIES?{SIZE}") as camera:
        camera.grab(5.0)
        process.kill()
        process.wait(10.0)
        begun = time.monotonic()
        with pytest.raises((DeviceDisconnected, DeviceTimeout)):
            camera.grab(1.0)
        with pytest.raises(DeviceError):
            camera.grab(10.0)
        with pytest.raises(DeviceDisconnected):
            camera.grab(10.0)
        assert time.monotonic() - begun < 20.0  # of 21 s that were offered
        begun = time.monotonic()
        with pytest.raises(DeviceDisconnected, match="disconnected"):
            camera.grab(10.0)
        assert time.monotonic() - begun < 5.0


def test_what_is_not_there_is_named(aravis: None) -> None:
    with pytest.raises(DeviceNotFound, match="no such camera"), open_camera("aravis:nobody"):
        pass
    with (
        GigeServer(Counting()),
        pytest.raises(DeviceRefused, match="no format 'Mono7'"),
        open_camera(f"aravis:?{SIZE}&format=Mono7"),
    ):
        pass
    with pytest.raises(DeviceRefused, match="no camera can be served"):
        GigeServer(Counting(), address="203.0.113.5")


def test_a_camera_in_use_is_refused(aravis: None) -> None:
    script = (
        "import sys\nfrom turnscan.devices import open_camera\n"
        f"with open_camera('aravis:?{SIZE}') as c:\n"
        "    c.grab(10.0); print('has it', flush=True); sys.stdin.read(1)\n"
    )
    with GigeServer(Counting()):
        other = subprocess.Popen(
            [sys.executable, "-c", script],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert other.stdout is not None
            assert other.stdout.readline() == "has it\n"
            with (
                pytest.raises(DeviceRefused, match="in use by another program"),
                open_camera(f"aravis:?{SIZE}"),
            ):
                pass
        finally:
            other.communicate("x", timeout=10.0)
