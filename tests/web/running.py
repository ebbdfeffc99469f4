"""A server on loopback in a thread, and a browser that is none."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from turnscan.acquire import look, run, turn_of
from turnscan.app import Library, Workshop
from turnscan.app._auth import Keys
from turnscan.app._envelope import Array, pack, unpack
from turnscan.app._server import Listening, Server, application, bind
from turnscan.scan import Scan
from turnscan.simulate import simulated

PATIENCE = 300.0
"""s until what does not come has failed; no measure of anything."""

Message = dict[str, Any]


class Running:
    """A server that listens, and the keys to it."""

    def __init__(self, workshop: Workshop, keys: Keys, port: int, app: Any) -> None:
        self.workshop, self.keys, self.port, self.app = workshop, keys, port, app
        self.base = f"http://127.0.0.1:{port}"
        self.cookie_name = f"turnscan-{port}"

    def login(self) -> str:
        """A cookie for one more browser, as its header wants it."""
        token = self.keys.invite()
        with httpx.Client(verify=False) as web:
            answer = web.post(
                f"{self.base}/login",
                json={"token": token},
                headers={"Origin": self.base, "X-Turnscan": "1"},
            )
        assert answer.status_code == 204, answer.text
        return answer.headers["set-cookie"].split(";")[0]

    def http(self, cookie: str | None = None, **headers: str) -> httpx.Client:
        """A browser's requests."""
        own = {"Origin": self.base, "X-Turnscan": "1", "Cookie": cookie or self.login()}
        return httpx.Client(
            base_url=self.base, headers={**own, **headers}, timeout=PATIENCE, verify=False
        )


@contextlib.contextmanager
def serving(folder: Path, remote_lasers: bool = False, **library: Any) -> Iterator[Running]:
    """A server with the scans of a folder."""
    workshop = Workshop(Library(folder, **library), remote_lasers=remote_lasers)
    listener = bind(Listening())
    port = int(listener.getsockname()[1])
    keys = Keys()
    app = application(workshop, keys, port)
    up = threading.Event()
    server = Server(app, up.set)
    thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
    thread.start()
    assert up.wait(PATIENCE)
    try:
        yield Running(workshop, keys, port, app)
    finally:
        server.should_exit = True
        thread.join(30)
        assert not thread.is_alive()


class Browser:
    """One WebSocket: asks, and waits for what it is told."""

    def __init__(self, server: Running, cookie: str | None = None) -> None:
        self.server = server
        self.cookie = cookie or server.login()
        self._stack = contextlib.ExitStack()
        link = connect(
            f"ws://127.0.0.1:{server.port}/ws",
            origin=Origin(server.base),
            additional_headers={"Cookie": self.cookie},
            max_size=None,
        )
        self.socket: ClientConnection = self._stack.enter_context(link)
        self._id = 0
        self.heard: list[Message] = []
        self.hello = self.until("hello")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def send(self, kind: str, arrays: dict[str, Array] | None = None, **keys: Any) -> int:
        """Send a request; its number."""
        self._id += 1
        body = {"kind": kind, "id": self._id, **keys}
        self.socket.send(json.dumps(body) if arrays is None else pack(body, arrays))
        return self._id

    def receive(self, seconds: float = PATIENCE) -> Message:
        """The next message; its arrays are under ``arrays``."""
        data = self.socket.recv(seconds)
        if isinstance(data, bytes):
            header, arrays = unpack(data)
            message = {**header, "arrays": arrays}
        else:
            message = json.loads(data)
            workshop = getattr(self.server, "workshop", None)  # none in a process of its own
            if workshop is not None:
                place = str(workshop.library.folder)
                assert place not in data, "no message says where on this computer the folder is"
        self.heard.append(message)
        if message["kind"] == "frame":
            self.socket.send(json.dumps({"kind": "ack", "number": message["number"]}))
        return message

    def until(
        self, kind: str, when: Callable[[Message], bool] = lambda m: True, seconds: float = PATIENCE
    ) -> Message:
        """The next message of a kind for which ``when`` holds."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            message = self.receive(max(0.1, deadline - time.monotonic()))
            if message["kind"] == kind and when(message):
                return message
        raise AssertionError(f"no {kind}")

    def once(self, kind: str, when: Callable[[Message], bool] = lambda m: True) -> Message:
        """The first message of a kind for which ``when`` holds, heard already or not."""
        before = (m for m in self.heard if m["kind"] == kind and when(m))
        return next(before, None) or self.until(kind, when)

    def ask(self, kind: str, arrays: dict[str, Array] | None = None, **keys: Any) -> Message:
        """The answer to a request."""
        number = self.send(kind, arrays, **keys)
        while True:
            message = self.receive()
            if message.get("id") == number:
                return message

    def open(self, scan: str) -> Message:
        """Open a scan and wait until it is."""
        answer = self.ask("open", scan=scan)
        if answer["kind"] == "opened":
            return answer
        assert answer["kind"] == "started", answer
        while True:
            message = self.receive()
            if message["kind"] == "opened" and message["scan"] == scan:
                return message
            assert message["kind"] != "job" or message["state"] in ("running", "done"), message


def small_scan(path: Path, address: str = "sim:sphere?seed=5", steps: int = 24) -> Path:
    """A scan file of a small turn."""
    devices = simulated(address)
    plan = turn_of(steps, devices.lasers.names[:1], devices.seconds)
    from turnscan.acquire import Hardware

    hardware = Hardware(devices.camera, devices.turntable, devices.lasers)
    first = look(plan, hardware)
    with Scan.create(path, first.scan_plan, devices.world.bench.rig) as scan:
        run(plan, hardware, scan, first=first)
    return path


def raw(port: int, text: bytes, seconds: float = 15.0) -> bytes:
    """What the server says to these bytes, until it hangs up or falls silent."""
    with socket.create_connection(("127.0.0.1", port), timeout=seconds) as link:
        link.sendall(text)
        out = b""
        with contextlib.suppress(TimeoutError, ConnectionError):
            while piece := link.recv(65536):
                out += piece
                if b"\r\n\r\n" in out and b"content-length: 0" in out.lower():
                    break
    return out
