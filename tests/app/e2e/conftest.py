"""A server, a browser and pages of it, for tests that do what a person does."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import sync_playwright

from tests.app.e2e.cup import write_cup
from tests.needs import BROWSERS, needs
from tests.once import once

CHROMIUM = next(filter(None, map(shutil.which, BROWSERS)), None)
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",
]
"""WebGL by the processor; the page around it is not put together by that emulated graphics card
too, which took half of the processor time of all these tests."""
DEADLINE = 60.0
"""Seconds for anything that a person would wait for."""
OPENING = 300.0
"""Seconds to open a scan: on a new machine the kernels are compiled first."""


def until(page: Any, expression: str, seconds: float = DEADLINE) -> Any:
    """Wait for the page to say yes; the content security policy forbids it to wait by itself."""
    end, rest = time.monotonic() + seconds, 0.03
    while not (said := page.evaluate(expression)):
        assert time.monotonic() < end, f"not within {seconds} s: {expression}"
        time.sleep(rest)
        rest = min(1.2 * rest, 0.25)  # each question costs three processes some milliseconds
    return said


def steady(page: Any, expression: str) -> Any:
    """What the page says once it says it twice: a place moves until the layout has settled."""
    before = until(page, expression)
    end = time.monotonic() + DEADLINE
    while True:
        time.sleep(0.3)
        said = page.evaluate(expression)
        if said and said == before:
            return said
        assert time.monotonic() < end, f"does not settle: {expression}"
        before = said


PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23
"""Linux: linux/prctl.h, linux/capability.h."""


def no_priority() -> None:
    """What this process starts from now on gets no priority over others.

    Where root runs the tests Chromium puts the threads that draw before all other processes
    (nice -8), and boards and guards, which other tests ask for an answer in real time, wait.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)  # refused where not root


@pytest.fixture(scope="package")  # its event loop must not run on under other tests
def browser() -> Iterator[Any]:
    needs("chromium")
    no_priority()
    with sync_playwright() as p:
        chromium = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def cup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = once(tmp_path_factory, "cup", lambda folder: write_cup(folder / "cup.turnscan"))
    return made / "cup.turnscan"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scans")


class Forker:
    """`tests.app.e2e.forked`: starts servers that have loaded turnscan already."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._many = 0
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.app.e2e.forked"], cwd=Path(__file__).parents[3],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def start(self, *argv: str) -> Forked:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._many += 1
        said = self._folder / f"said-{self._many}"
        said.touch()
        print(json.dumps({"argv": argv, "said": str(said)}), file=self._process.stdin, flush=True)
        return Forked(int(self._process.stdout.readline()), said)

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(30)
        self._process.stdout.close()


class Forked:
    """A process that is a child of another; as `subprocess.Popen` where it has the same names."""

    stdout = None

    def __init__(self, pid: int, said: Path) -> None:
        self._pid, self._said = pid, said

    def readline(self) -> str:
        """The first line that it prints; what there is of it where it has ended."""
        end = time.monotonic() + DEADLINE
        while "\n" not in (text := self._said.read_text()):
            if self._gone() or time.monotonic() > end:
                break
            time.sleep(0.05)
        return text.partition("\n")[0]

    def send_signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not self._gone():
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(["turnscan"], seconds)
            time.sleep(0.02)

    def _gone(self) -> bool:
        try:
            os.kill(self._pid, 0)
        except ProcessLookupError:
            return True
        return False


@pytest.fixture(scope="package")
def forker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forker]:
    made = Forker(tmp_path_factory.mktemp("servers"))
    yield made
    made.close()


class Server:
    """``turnscan app`` as a process of its own, and the cookie of one browser."""

    process: Any

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._start()

    def _start(self) -> None:
        command = [sys.executable, "-m", "turnscan", *self._words()]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._greeted(self.process.stdout.readline())

    def _words(self) -> tuple[str, ...]:
        return ("app", str(self._folder), "--no-browser")

    def _greeted(self, link: str) -> None:
        if not link.startswith("turnscan: http://127.0.0.1:"):
            self.end()
            pytest.fail(f"the server did not start: {link!r}")
        self.link = link.split()[-1]
        self.address = self.link.split("/login")[0] + "/"
        self.cookies: Any = None

    def power_cut(self) -> None:
        """Die without a word, and start anew."""
        self.process.kill()
        self._ended()
        self._start()

    def _ended(self) -> None:
        self.process.wait(30)
        if self.process.stdout:
            self.process.stdout.close()

    def end(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self._ended()


class ForkedServer(Server):
    """The same, by a process that has loaded turnscan (commands: tests/web/test_ending.py)."""

    def __init__(self, folder: Path, forker: Forker) -> None:
        self._forker = forker
        super().__init__(folder)

    def _start(self) -> None:
        self.process = self._forker.start(*self._words())
        self._greeted(self.process.readline())


@pytest.fixture(scope="module")
def server(folder: Path, forker: Forker) -> Iterator[Server]:
    started = ForkedServer(folder, forker)
    yield started
    started.end()


def _said(message: Any) -> str:
    """What a page complained of in its console, and where."""
    return f"{message.text} {message.location.get('url', '')}"


@pytest.fixture
def new_page(browser: Any, server: Server) -> Iterator[Callable[..., Any]]:
    """Make pages of the app; afterwards none may have complained in its console."""
    complaints: list[str] = []
    contexts: list[Any] = []

    def make(place: str = "", *, width: int = 1280, height: int = 800, script: str = "") -> Any:
        context = browser.new_context(
            viewport={"width": width, "height": height},
            storage_state=server.cookies,
            color_scheme="dark",
        )
        contexts.append(context)
        context.set_default_timeout(DEADLINE * 1000)
        page = context.new_page()
        if script:
            page.add_init_script(script)
        page.on("pageerror", lambda e: complaints.append(str(e)))
        page.on("console", lambda m: complaints.append(_said(m)) if m.type == "error" else None)
        if server.cookies is None:
            page.goto(server.link)
            page.wait_for_url(lambda url: "login" not in url)
            until(page, "'turnscan' in window && turnscan.connection === 'open'")
            server.cookies = context.storage_state()
            if not place:  # where the link has led to
                return page
        page.goto(server.address + place)
        until(page, "'turnscan' in window && turnscan.connection === 'open'")
        return page

    yield make
    for context in contexts:
        context.close()
    assert not complaints


@pytest.fixture
def picture() -> Callable[[Any, str], None]:
    """Write a picture for the docs, where TURNSCAN_PICTURES names the folder."""
    folder = os.environ.get("TURNSCAN_PICTURES")

    def write(page: Any, name: str) -> None:
        if folder:
            page.wait_for_timeout(800)
            page.screenshot(path=f"{folder}/app-{name}.png")

    return write


@pytest.fixture
def open_cup(new_page: Callable[..., Any], folder: Path, cup: Path) -> Callable[..., Any]:
    """Open a copy of the cup of this test's own in the Edit room."""
    name = f"cup-{sum(1 for _ in folder.iterdir()) + 1}"

    def make(prepare: Callable[[Path], None] | None = None, **options: Any) -> Any:
        target = folder / f"{name}.turnscan"
        if not target.exists():
            shutil.copy(cup, target)
            if prepare is not None:
                prepare(target)
        page = new_page(**options)
        page.get_by_role("button", name=name, exact=True).click()
        until(page, "turnscan.faces > 0", OPENING)
        return page

    return make
