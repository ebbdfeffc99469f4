"""A monkey at the workshop: random clicks, drags, keys, numbers, and what must hold after them."""

from __future__ import annotations

import time
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from tests.app.e2e.conftest import until
from turnscan import edit
from turnscan.app._envelope import unpack
from turnscan.json_text import strict_json
from turnscan.scan import Scan

KEYS = (
    "Delete", "Control+Delete", "Control+z", "Control+Shift+z", "Control+y", "Control+a",
    "Control+i", "Escape", "Enter", "n", "e", "x", "f", "Shift+f", "o", "1", "2", "3", "4", "5",
    "6", "7", "[", "]", "+", "-", "h", "y", "z", "m", "d", "t", "c", "g", "q", "u", "PageUp",
    "PageDown", "Shift+PageDown", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight",
    "Shift+ArrowLeft", "Shift+ArrowRight", "Control+k", "?", "Tab", "Alt+3", "Alt+4", " ",
)  # fmt: skip
TOOLS = "vrlpbwagjk"
"""Keys of the tools, those of all rooms."""
ODDS = (0.36, 0.26, 0.24, 0.08, 0.06)
"""Of drags, presses, keys, edits and turns of the wheel."""
NUMBERS = ("", "0", "-1", "0.5", "3", "12", "90", "1e9", "1e-9")
SHUN = (
    "Invite", "Exporting", "Export", "All scans", "turnscan", "Setup", "Scan", "Take control",
    "Save as CSV", "Report as",
)  # fmt: skip
"""Beginnings of the names of what leads out of the part's rooms, or out of the page."""
PRESSABLE = """
(shun) => [...document.querySelectorAll("button, summary, select, input, .list li, [role=tab]")]
  .map((e) => {
    const name = (e.getAttribute("aria-label") ?? e.textContent ?? "").trim();
    const box = e.getBoundingClientRect();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const seen = box.width > 0 && x > 0 && y > 0 && x < innerWidth && y < innerHeight;
    const off = e.disabled || shun.some((one) => name.startsWith(one));
    return { x, y, name, type: e.type ?? e.localName, seen: seen && !off };
  })
  .filter((e) => e.seen)
"""
PLACES = """
() => [...document.querySelectorAll("canvas")].map((e) => e.getBoundingClientRect())
  .filter((b) => b.width > 20 && b.height > 20)
  .map((b) => ({ x: b.x, y: b.y, width: b.width, height: b.height }))
"""

IDLE = "turnscan.connection === 'open' && !turnscan.requests && !turnscan.loading"

STATE = "[turnscan.connection, turnscan.requests, turnscan.loading].join(', ')"


class Wire:
    """What a page asks of its scan, and what the server says to it."""

    def __init__(self, page: Any) -> None:
        self.asked: dict[int, Any] = {}
        """Edits and measurements that have no answer yet, by number."""
        self.made: Counter[str] = Counter()
        """Those that the server confirmed, by kind."""
        self.refused: Counter[str] = Counter()
        self.unheard = 0
        """Those whose answer went down with the connection."""
        page.on("websocket", self._hear)

    def _hear(self, socket: Any) -> None:
        socket.on("framesent", self._sent)
        socket.on("framereceived", self._received)
        socket.on("close", lambda _: self._closed())

    def _closed(self) -> None:
        self.unheard += len(self.asked)
        self.asked.clear()

    def _sent(self, data: str | bytes) -> None:
        message = _header(data)
        if message["kind"] in ("edit", "measure") and not message.get("preview"):
            self.asked[message["id"]] = message.get("edit") or {"kind": message["what"]}

    def _received(self, data: str | bytes) -> None:
        message = _header(data)
        what = self.asked.pop(message["id"], None) if message.get("id") is not None else None
        if what is None:
            return
        if message["kind"] == "refused":
            self.refused[message["code"]] += 1
        else:
            self.made[what["kind"]] += 1


def _header(data: str | bytes) -> dict[str, Any]:
    if isinstance(data, bytes):  # with any number of arrays: a page takes all borders of holes
        data = data[4 : 4 + int.from_bytes(data[:4], "little")].decode()
    message: dict[str, Any] = strict_json(data, "message")
    return message


class Monkey:
    """Random deeds on a page; the same seed draws the same ones."""

    def __init__(self, page: Any, seed: int) -> None:
        self.page, self._rng = page, np.random.default_rng(seed)
        self.deeds: list[str] = []
        self._ways = (self._drag, self._press, self._key, self._edit, self._wheel)

    def act(self) -> None:
        """One deed, whatever the page is doing."""
        self.deeds.append(self._ways[int(self._rng.choice(len(self._ways), p=ODDS))]())

    def _one(self, things: Any) -> Any:
        return things[int(self._rng.integers(len(things)))]

    def _drag(self) -> str:
        places = self.page.evaluate(PLACES)
        if not places:
            return self._key()
        box = self._one(places)
        at = self._rng.uniform(0.05, 0.95, (3, 2)) * (box["width"], box["height"])
        at += (box["x"], box["y"])
        if self._rng.random() < 0.5:
            at[1:] = at[0] + self._rng.normal(0, 25, (2, 2))
        if self._rng.random() < 0.2:
            at[1:] = at[0]
        tool = self._one(TOOLS)
        held = self._one(("", "", "", "Shift", "Control", "Alt"))
        button = self._one(("left", "left", "left", "left", "right", "middle"))
        self.page.keyboard.press(tool)
        if held:
            self.page.keyboard.down(held)
        self.page.mouse.move(*at[0])
        self.page.mouse.down(button=button)
        for place in at[1:]:
            self.page.mouse.move(*place)
        self.page.mouse.up(button=button)
        if held:
            self.page.keyboard.up(held)
        return f"{tool} {held} {button} {np.rint(at).astype(int).tolist()}"

    def _press(self) -> str:
        found = self.page.evaluate(PRESSABLE, list(SHUN))
        if not found:
            return self._key()
        chosen = self._one(found)
        self.page.mouse.click(chosen["x"], chosen["y"])
        done = f"press {chosen['type']} {chosen['name'][:60]!r}"
        if chosen["type"] == "number":
            text = self._one(NUMBERS)
            self.page.keyboard.press("Control+a")
            self.page.keyboard.type(text)
            self.page.keyboard.press(self._one(("Enter", "Tab")))
            done += f" {text!r}"
        return done

    def _key(self) -> str:
        key = self._one(KEYS)
        self.page.keyboard.press(key)
        return f"key {key}"

    def _edit(self) -> str:
        """Delete what a box selects: random deeds alone seldom edit."""
        self.page.keyboard.press("Escape")
        self.page.keyboard.press("Alt+3")
        self.page.keyboard.press("r")
        done = self._drag()
        self.page.keyboard.press("Delete")
        return f"delete after {done}"

    def _wheel(self) -> str:
        self.page.mouse.wheel(0, float(self._rng.normal(0, 300)))
        return "wheel"


def settle(page: Any, wire: Wire, seconds: float = 300.0) -> None:
    """Wait until the page asks for nothing and has heard all answers."""
    end = time.monotonic() + seconds
    quiet = 0
    while quiet < 3:
        assert time.monotonic() < end, f"not answered: {wire.asked}; {page.evaluate(STATE)}"
        page.wait_for_timeout(50)
        idle = page.evaluate(IDLE)
        quiet = quiet + 1 if idle and not wire.asked else 0


def back_to_the_start(page: Any, wire: Wire) -> None:
    """Undo, by the key, until there is nothing to undo."""
    settle(page, wire)
    for _ in range(3):
        page.keyboard.press("Escape")
    page.keyboard.press("Alt+3")
    page.evaluate("document.activeElement?.blur()")
    while (at := page.evaluate("turnscan.cursor")) > 0:
        page.keyboard.press("Control+z")
        until(page, f"turnscan.cursor < {at}", 120)
    settle(page, wire)


def edits_in(path: Path) -> int:
    """How many edits were ever added to a scan file."""
    with Scan.open(path) as scan:
        actions = [edit.action_from_json(entry.text) for entry in scan.edits()]
    return sum(isinstance(action, edit.Add) for action in actions)


def digest_of(page: Any) -> str:
    """What the server has, in the form of ``turnscan.digest``."""
    scan = page.evaluate("location.hash.split('/')[1]")
    answer = page.request.get(f"{page.url.split('#')[0]}api/scans/{scan}/mesh")
    _, arrays = unpack(answer.body())
    crc = 0
    for name in ("positions", "faces", "alive", "measured", "laser", "step", "line"):
        crc = zlib.crc32(arrays[name].tobytes(), crc)
    return f"{len(arrays['positions'])} {len(arrays['faces'])} {crc:x}"
