"""The browser workshop: how long a person waits, in headless Chromium with software drawing.

    python -m bench app          about 200 000 triangles
    python -m bench.app --full   and about a million

Times are seen in the page: from the key stroke to the picture that shows what it did.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.app.e2e.conftest import CHROMIUM, FLAGS, Server, until
from tests.app.e2e.cup import write_whole_cup

SIZES = {"200 000": (540, 2), "1 000 000": (1330, 4)}
"""Steps, and how many times 320 × 240 the pictures are."""
WATCH = """
(key) => new Promise((done, fail) => {
  const [faces, pictures, begun] = [turnscan.faces, turnscan.pictures, performance.now()];
  const look = () => {
    const took = performance.now() - begun;
    if (turnscan.faces !== faces && turnscan.pictures > pictures) done(took);
    else if (took > 60000) fail(new Error("nothing happened within a minute"));
    else requestAnimationFrame(look);
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


def run(sizes: tuple[str, ...] = ("200 000",)) -> None:
    """Print the figures."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as name, sync_playwright() as p:
        folder = Path(name)
        for size in sizes:
            write_whole_cup(folder / f"{size}.turnscan", *SIZES[size])
        server = Server(folder)
        browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(server.link)
            page.wait_for_url(lambda url: "login" not in url)
            until(page, "'turnscan' in window && turnscan.connection === 'open'")
            for size in sizes:
                _measure(page, server.address, size)
        finally:
            browser.close()
            server.end()


def _measure(page: Any, home: str, size: str) -> None:
    page.goto(home)
    begun = time.perf_counter()
    page.get_by_role("button", name=size, exact=True).click()
    until(page, "turnscan.faces > 0 && turnscan.fullMs > 0", 300)
    cold = time.perf_counter() - begun
    address = page.url
    page.goto("about:blank")
    begun = time.perf_counter()
    page.goto(address)
    until(page, "'turnscan' in window && turnscan.faces > 0 && turnscan.fullMs > 0", 60)
    warm = time.perf_counter() - begun
    print(f"{page.evaluate('turnscan.faces'):,} triangles, {page.evaluate('turnscan.gpu')}")
    print(f"  open a file that nobody has open: {cold:.1f} s (stripes, points and mesh included)")
    print(f"  first picture of an open one: {warm:.2f} s")
    print(f"  one full picture: {page.evaluate('turnscan.fullMs'):.0f} ms")
    print(f"  turning: {page.evaluate(TURN):.0f} pictures a second")
    page.wait_for_timeout(500)
    deleted, undone = [], []
    page.keyboard.press("r")
    box = page.locator(".surface-host").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for _ in range(3):
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
    print(f"  delete {selected:,} selected: {_all(deleted)}; undo: {_all(undone)}")


def _all(ms: list[float]) -> str:
    return ", ".join(f"{x:.0f}" for x in ms) + " ms"


if __name__ == "__main__":
    run(tuple(SIZES) if "--full" in sys.argv else ("200 000",))
