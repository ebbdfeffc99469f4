"""The browser workshop: how long a person waits, in headless Chromium with software drawing.

    python -m bench app          about 200 000 triangles
    python -m bench app full     and about a million; also python -m bench.app --full
    python -m bench app --write  puts the figures into docs/explain/editing.md

Times are seen in the page: from the key stroke to the picture that shows what it did. Memory is
what the server and its children hold (the system's resident sets): with one scan open, after three
were opened, and after all of them were closed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.app.e2e.conftest import CHROMIUM, FLAGS, Server, until
from tests.app.e2e.cup import write_whole_cup

from bench._page import DOCS, cells, figures, measured, replaced, write

SIZES = {"200 000": (540, 2), "1 000 000": (1330, 4)}
"""Steps, and how many times 320 × 240 the pictures are."""
PARTS = ("full",)
PAGE = DOCS / "explain" / "editing.md"
HEAD = (
    "| triangles | open: preview, whole, s | again, s | one picture, ms | orbit, pictures/s "
    "| delete, ms | undo, ms | server: one scan, three, closed, most, MB | measured |"
)
ROUNDS = 5
OPENS = 600.0
WATCH = """
(key) => new Promise((done, fail) => {
  const [faces, pictures, begun] = [turnscan.faces, turnscan.pictures, performance.now()];
  const look = () => {
    const took = performance.now() - begun;
    if (turnscan.faces !== faces && turnscan.pictures > pictures) done(took);
    else if (took > 60000) {
      const said = [...document.querySelectorAll("[role=log] *, .chip")].map((e) => e.textContent);
      fail(new Error(`nothing happened within a minute: ${said.join(" | ")}`));
    } else requestAnimationFrame(look);
  };
  const ctrlKey = key === "z";
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key, ctrlKey, bubbles: true }));
  look();
})
"""
TURN = """
() => new Promise((done) => {
  const glass = document.querySelector(".glass-canvas");
  const box = glass.getBoundingClientRect();
  const at = (x, type) => glass.dispatchEvent(new PointerEvent(type, {
    clientX: box.left + x, clientY: box.top + 300, button: 2, buttons: 2, pointerId: 1 }));
  glass.setPointerCapture = () => {};
  at(200, "pointerdown");
  const begun = performance.now();
  const first = turnscan.pictures;
  let x = 200;
  const move = () => {
    at(x++, "pointermove");
    if (performance.now() - begun < 2000) return requestAnimationFrame(move);
    at(x, "pointerup");
    done(1000 * (turnscan.pictures - first) / (performance.now() - begun));
  };
  move();
})
"""


def run(quick: bool = False, parts: tuple[str, ...] = (), into_pages: bool = False) -> None:
    """Print the figures; ``parts`` may ask for the ``full`` size too."""
    from playwright.sync_api import sync_playwright

    rows = []
    asked = tuple(SIZES) if "full" in parts and not quick else tuple(SIZES)[:1]
    for size in asked:
        with tempfile.TemporaryDirectory() as name, sync_playwright() as p:
            folder = Path(name)
            first = write_whole_cup(folder / f"{size}.turnscan", *SIZES[size])
            for k in (2, 3):
                shutil.copy(first, folder / f"{size} {k}.turnscan")
            server = Server(folder)
            browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            try:
                page = browser.new_page(viewport={"width": 1280, "height": 800})
                page.goto(server.link)
                page.wait_for_url(lambda url: "login" not in url)
                until(page, "'turnscan' in window && turnscan.connection === 'open'")
                rows.append(_measure(page, server, size))
            finally:
                browser.close()
                server.end()
    if into_pages:
        table = [
            HEAD,
            "|" + "---|" * (HEAD.count("|") - 1),
            *measured(rows, f"{os.cpu_count()} cores"),
        ]
        old = figures(PAGE, "app")
        order = sorted((cells(row)[0] for row in (*old[2:], *rows)), key=_number)
        write(PAGE, "app", replaced(old, table, 1, order))


def _measure(page: Any, server: Server, size: str) -> str:
    """A row of the table, which is printed as it comes about."""
    shown, cold = _opened(page, server.address, size)
    print(f"{page.evaluate('turnscan.faces'):,} triangles, {page.evaluate('turnscan.gpu')}")
    print(f"  open a file that nobody has open: {shown:.1f} s to a preview, whole in {cold:.1f} s")
    one = _held(server.process.pid)
    address = page.url
    page.goto("about:blank")
    begun = time.perf_counter()
    page.goto(address)
    until(page, "'turnscan' in window && turnscan.faces > 0 && turnscan.fullMs > 0", 60)
    warm = time.perf_counter() - begun
    print(f"  first picture of an open one: {warm:.2f} s")
    until(page, "!turnscan.loading")
    whole, turned = page.evaluate("turnscan.fullMs"), page.evaluate(TURN)
    print(f"  one full picture: {whole:.0f} ms; turning: {turned:.0f} pictures a second")
    page.wait_for_timeout(500)
    selected, deleted, undone = _edited(page)
    print(f"  delete {selected:,} selected: {_all(deleted)}; undo: {_all(undone)}")
    faces = page.evaluate("turnscan.faces")
    held = [one, *_three(page, server, size)]
    print(f"  server, MB: one scan {held[0]:.0f}, three {held[1]:.0f}, closed {held[2]:.0f}; "
          f"most at any time {held[3]:.0f}")  # fmt: skip
    return (
        f"| {f'{faces:,}'.replace(',', ' ')} | {shown:.1f}, {cold:.1f} | {warm:.2f} | {whole:.0f} "
        f"| {turned:.0f} | {_all(deleted)} | {_all(undone)} "
        f"| {', '.join(f'{x:.0f}' for x in held)} |"
    )


def _opened(page: Any, home: str, name: str) -> tuple[float, float]:
    """s from a click in the list of scans to the first picture of it, be it of a few profiles, and
    to that of all of it."""
    page.goto(home)
    begun = time.perf_counter()
    page.get_by_role("button", name=name, exact=True).click()
    until(page, "turnscan.drawnFaces > 0", OPENS)
    first = time.perf_counter() - begun
    until(page, "!turnscan.loading && turnscan.faces > 0", OPENS)
    until(page, "turnscan.drawnFaces === turnscan.faces", OPENS)
    return first, time.perf_counter() - begun


def _edited(page: Any) -> tuple[int, list[float], list[float]]:
    """Faces selected by a box, and ms that their deletion and its undoing took, a few times."""
    deleted, undone, selected = [], [], 0
    page.keyboard.press("r")
    box = page.locator(".surface-host").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for _ in range(ROUNDS):
        page.mouse.move(x - 60, y - 40)
        page.mouse.down()
        page.mouse.move(x + 60, y + 40, steps=4)
        page.mouse.up()
        until(page, "turnscan.selected > 0")
        selected = page.evaluate("turnscan.selected")
        deleted.append(page.evaluate(WATCH, "Delete"))
        page.wait_for_timeout(300)
        undone.append(page.evaluate(WATCH, "z"))
        page.wait_for_timeout(300)
    return selected, deleted, undone


def _three(page: Any, server: Server, size: str) -> tuple[float, float, float]:
    """MB that the server holds with two more scans open, with all closed, and at most."""
    for k in (2, 3):
        _opened(page, server.address, f"{size} {k}")
    three = _held(server.process.pid)
    page.goto(server.address)
    for name in (size, f"{size} 2", f"{size} 3"):
        _closed(page, name)
    page.wait_for_timeout(1000)
    return three, _held(server.process.pid), _held(server.process.pid, "VmHWM")


def _closed(page: Any, name: str) -> None:
    """Put a scan into the bin: it is open no more."""
    page.get_by_role("button", name=f"Delete {name}: into the bin").click()
    page.get_by_role("button", name=name, exact=True).wait_for(state="detached", timeout=60_000)


def _held(pid: int, what: str = "VmRSS") -> float:
    """MB of a process and its children."""
    processes = [
        dict(line.split(":", 1) for line in path.read_text().splitlines() if ":" in line)
        for path in Path("/proc").glob("[0-9]*/status")
    ]
    mine, grown = {str(pid)}, 0
    while len(mine) > grown:
        grown = len(mine)
        mine |= {q["Pid"].strip() for q in processes if q["PPid"].strip() in mine}
    return sum(int(q[what].split()[0]) / 1e3 for q in processes if q["Pid"].strip() in mine)


def _number(text: str) -> int:
    return int("".join(filter(str.isdigit, text)) or 0)


def _all(ms: list[float]) -> str:
    return ", ".join(f"{x:.0f}" for x in ms)


if __name__ == "__main__":
    run(parts=("full",) if "--full" in sys.argv else (), into_pages="--write" in sys.argv)
