"""The conformance kit fails for every broken promise, and passes the page's example."""

from __future__ import annotations

import math
import re
import threading
import time
import types
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
import pytest

from turnscan.arrays import Image
from turnscan.devices import Camera
from turnscan.errors import DeviceDisconnected, DeviceGarbled, DeviceRefused, DeviceTimeout
from turnscan.testing import check_camera

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-camera.md"


class Good:
    """A camera that keeps every promise; the tests break one at a time."""

    def __init__(self) -> None:
        self.seconds, self.open, self.count = 0.01, True, 0

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        if not (0.0 < seconds < 10.0 and 0.0 < gain < math.inf):
            raise DeviceRefused(f"{seconds} {gain}")
        self.seconds = round(seconds, 4)
        return self.seconds, gain

    def grab(self, timeout: float) -> Image:
        if not self.open:
            raise DeviceDisconnected("closed")
        if timeout < self.seconds:
            time.sleep(timeout)
            raise DeviceTimeout("too slow")
        time.sleep(self.seconds)
        self.count += 1
        image = np.full((6, 8), self.count, np.uint8)
        image.flags.writeable = False
        return image

    def close(self) -> None:
        self.open = False


def opener(kind: type[Good], closes: bool = True) -> Callable[[], AbstractContextManager[Camera]]:
    @contextmanager
    def opened() -> Iterator[Camera]:
        camera = kind()
        try:
            yield camera
        finally:
            if closes:
                camera.close()

    return opened


def test_a_good_camera_passes() -> None:
    check_camera(opener(Good))


def broken(**methods: Any) -> type[Good]:
    return type("Broken", (Good,), methods)


def changed(how: Callable[[Image], Image]) -> type[Good]:
    return broken(grab=lambda self, timeout: how(Good.grab(self, timeout)))


def locked(image: Image) -> Image:
    image.flags.writeable = False
    return image


def growing(self: Good, timeout: float) -> Image:
    image = Good.grab(self, timeout)
    return image if self.count < 3 else locked(np.zeros((7, 8), np.uint8))


def reused(self: Good, timeout: float) -> Image:
    Good.grab(self, timeout)
    if not hasattr(self, "buffer"):
        self.buffer = np.zeros((6, 8), np.uint8)  # type: ignore[attr-defined]
    self.buffer[:] = self.count
    view = self.buffer.view()
    view.flags.writeable = False
    return view


def at_once(self: Good, timeout: float) -> Image:
    self.seconds = min(self.seconds, 0.0)
    return Good.grab(self, timeout)


def deaf(self: Good, timeout: float) -> Image:
    if timeout < 1e-3:
        time.sleep(3.5)
    return Good.grab(self, timeout)


BROKEN: dict[str, tuple[type[Good], str]] = {
    "clips": (
        broken(configure=lambda self, seconds, gain: (max(seconds, 0.01) + 0 * gain, 1.0)),
        "instead of raising DeviceRefused",
    ),
    "says nothing": (broken(configure=lambda self, seconds, gain: (None, gain)), "not a float"),
    "drifts": (
        broken(configure=lambda self, seconds, gain: (seconds * 0.9, gain)),
        "it now says",
    ),
    "list": (changed(lambda image: image.tolist()), "not an array"),
    "floats": (changed(lambda image: locked(image.astype(float))), "a picture of float64"),
    "alpha": (changed(lambda image: locked(np.dstack([image] * 4))), "of shape"),
    "empty": (changed(lambda image: image[:0]), "of shape"),
    "strided": (changed(lambda image: image[:, ::2]), "not C-contiguous"),
    "writeable": (changed(lambda image: image.copy()), "can be written to"),
    "growing": (broken(grab=growing), "and then of"),
    "reused buffer": (broken(grab=reused), "changed when later ones came"),
    "buffered": (broken(grab=at_once), "it began before it was asked for"),
    "deaf": (broken(grab=deaf), "a time-out of 0.1 ms took"),
    "undead": (broken(close=lambda self: None), "a closed camera gave a picture"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_promise_is_named(what: str) -> None:
    kind, words = BROKEN[what]
    with pytest.raises(AssertionError, match=re.escape(words)):
        check_camera(opener(kind))


def test_a_camera_left_open_by_an_error_is_named() -> None:
    class Leaky:
        def __init__(self) -> None:
            self.camera = Good()

        def __enter__(self) -> Good:
            return self.camera

        def __exit__(self, kind: object, error: object, trace: object) -> None:
            if kind is None:
                self.camera.close()

    with pytest.raises(AssertionError, match="a closed camera gave a picture"):
        check_camera(Leaky)


@pytest.fixture
def webshot() -> Iterator[str]:
    """The camera of the page: a small web service."""
    rng = np.random.default_rng(1)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = urlsplit(self.path)
            time.sleep(float(parse_qs(asked.query)["seconds"][0]))
            good, png = cv2.imencode(".png", rng.integers(0, 255, (24, 32)).astype(np.uint8))
            assert good
            self.send_response(200)
            self.end_headers()
            self.wfile.write(png.tobytes())

        def log_message(self, *_: object) -> None:
            pass

        def handle(self) -> None:
            try:
                super().handle()
            except OSError:
                self.close_connection = True

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield f"webshot:127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_example_of_the_page(webshot: str, tmp_path: Path, monkeypatch: Any) -> None:
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(), re.S)
    sources = [text for language, text in blocks if language == "python"]
    entry = next(text for language, text in blocks if language == "toml")
    assert sources[0].count("\n") <= 47
    code = [line for line in sources[0].splitlines() if line.strip()]
    assert len(code) <= 40, f"{len(code)} lines"
    (tmp_path / "turnscan_webshot.py").write_text(sources[0])
    info = tmp_path / "turnscan_webshot-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: turnscan-webshot\nVersion: 1\n")
    header = entry.splitlines()[0].replace("project.entry-points.", "").replace('"', "")
    (info / "entry_points.txt").write_text(
        "\n".join([header, *(line.replace('"', "") for line in entry.splitlines()[1:])]) + "\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    check = sources[1].replace("webshot:192.168.0.7:8000", webshot)
    namespace = types.ModuleType("check").__dict__
    exec(check, namespace)
    namespace["test_my_camera"]()


def test_the_examples_errors(webshot: str, tmp_path: Path, monkeypatch: Any) -> None:
    source = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)[0]
    namespace = types.ModuleType("webshot").__dict__
    exec(source, namespace)
    camera = namespace["WebshotCamera"](webshot)
    camera.configure(1.0, 1.0)
    with pytest.raises(DeviceTimeout):
        camera.grab(0.05)
    with pytest.raises(DeviceDisconnected):
        namespace["WebshotCamera"]("webshot:127.0.0.1:9").grab(1.0)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: None)
    camera.configure(0.001, 1.0)
    with pytest.raises(DeviceGarbled, match="no picture"):
        camera.grab(5.0)
