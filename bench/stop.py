"""STOP in the browser's server: how long until it is answered, from any state, by three ways.

    python -m bench stop            10 times in each state (``--quick``: 3 times)

The server is a process of its own; lasers and table are an emulated GRBL board behind a real serial
port and its guard, so that the answer says what the board confirmed: dark, and the table at rest.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import httpx
from tests.app.e2e.conftest import Server
from tests.app.e2e.cup import write_whole_cup
from tests.web.running import Browser, Message

from turnscan.simulate.controllers import GrblFirmware, Socket

MOST = 0.3
"""s that are allowed."""
LASER = "right"
STEPS, SCALE = 270, 2
"""Of the scan that is worked on: about 100 000 triangles."""


class Remote:
    """A server in another process, as `Browser` wants it."""

    def __init__(self, link: str) -> None:
        home, self._token = link.split("/login#")
        self.base, self.port = home, int(home.rpartition(":")[2])
        own = {"Origin": home, "X-Turnscan": "1"}
        answer = httpx.post(f"{home}/login", json={"token": self._token}, headers=own)
        self.cookie = answer.headers["set-cookie"].split(";")[0]
        self.web = httpx.Client(base_url=home, headers={**own, "Cookie": self.cookie}, timeout=60)


def run(quick: bool = False) -> None:
    """Print the times."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        write_whole_cup(Path(name) / "part.turnscan", STEPS, SCALE)
        port = stack.enter_context(Socket(GrblFirmware({"100": 8.889, "110": 6000, "120": 800})))
        server = Server(Path(name))
        stack.callback(server.end)
        remote = Remote(server.link)
        one = stack.enter_context(Browser(remote, remote.cookie))  # type: ignore[arg-type]
        two = stack.enter_context(Browser(remote, remote.cookie))  # type: ignore[arg-type]
        ways: dict[str, Callable[[], object]] = {
            "own socket": lambda: one.ask("stop"),
            "another browser": lambda: two.ask("stop"),
            "HTTP": lambda: remote.web.post("/api/stop").raise_for_status(),
        }
        print("| state | " + " | ".join(f"{w}: median, most ms" for w in ways) + " |")
        print("|---|" + "---|" * len(ways))
        longest = max(_row(*row, ways, 3 if quick else 10) for row in _states(one, port.path))
    said = "yes" if longest <= MOST else "NO"
    print(f"longest {1e3 * longest:.0f} ms (at most {1e3 * MOST:.0f}): {said}")


def _row(state: str, reach: Any, ways: dict[str, Callable[[], object]], times: int) -> float:
    cells, longest = [], 0.0
    for way in ways.values():
        took = []
        for _ in range(times):
            with reach():
                begun = time.perf_counter()
                way()
                took.append(time.perf_counter() - begun)
        cells.append(f"{1e3 * statistics.median(took):.0f}, {1e3 * max(took):.0f}")
        longest = max(longest, *took)
    print(f"| {state} | {' | '.join(cells)} |", flush=True)
    return longest


def _states(one: Browser, port: str) -> Iterator[tuple[str, Any]]:
    """What is under way while Stop is pressed, and how it is begun and left."""
    board = f"grbl:{port}?lasers={LASER}"
    _done(one.ask("connect", camera="sim:sphere", turntable=board, lasers=board))
    opened = one.open(next(s["scan"] for s in one.hello["scans"]))
    scan, at = opened["scan"], [opened["revision"]]

    @contextmanager
    def idle() -> Iterator[None]:
        yield

    @contextmanager
    def live() -> Iterator[None]:
        _done(one.ask("look", on=True, lit=[LASER], seconds=0.04))
        one.until("frame")
        before = len(one.heard)
        yield
        _told(one, before, lambda m: m["kind"] == "devices" and not m["looking"])

    @contextmanager
    def turning() -> Iterator[None]:
        before = len(one.heard)
        number = one.send("turn", angle_deg=90.0 if at[0] % 2 else 270.0)
        time.sleep(0.3)  # on its way: it takes 2 s
        yield
        _told(one, before, partial(_answers, number))
        at[0] += 1

    @contextmanager
    def repairing() -> Iterator[None]:
        before = len(one.heard)
        numbers = [one.send("list_defects", scan=scan), one.send("list_holes", scan=scan)]
        yield
        for number in numbers:
            _told(one, before, partial(_answers, number))

    @contextmanager
    def measuring() -> Iterator[None]:
        values = {"part": scan, "outputs": [".svg"]}
        name = f"turned {time.monotonic_ns()}"
        job = one.ask("run_verb", verb="revolve", name=name, values=values)
        assert job["kind"] == "started", job
        time.sleep(0.5)  # its threads are at work
        before = len(one.heard)
        yield
        one.ask("cancel", job=job["job"])
        _told(one, before, lambda m: _ended(m, job))

    @contextmanager
    def examined() -> Iterator[None]:
        job = one.ask("doctor", still=False)
        assert job["kind"] == "started", job
        time.sleep(0.3)
        before = len(one.heard)
        yield
        _told(one, before, lambda m: _ended(m, job))

    yield "nothing under way", idle
    yield "live view, laser lit", live
    yield "table turning", turning
    yield "doctor", examined
    yield "holes and defects of 100 000 triangles", repairing
    yield "a turned part is measured", measuring


def _told(one: Browser, before: int, when: Callable[[Message], bool]) -> None:
    """Wait for a message, which may have come since so many had."""
    if not any(map(when, one.heard[before:])):
        while not when(one.receive()):
            pass


def _answers(number: int, message: Message) -> bool:
    return message.get("id") == number


def _ended(message: Message, job: Message) -> bool:
    if message["kind"] != "job" or message["job"] != job["job"]:
        return False
    return bool(message["state"] != "running")


def _done(answer: Message) -> None:
    assert answer["kind"] == "done", answer
