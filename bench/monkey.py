"""A monkey at the browser workshop: random clicks, drags and keys with edits, and what must hold.

    python -m bench monkey            2 000 deeds on a part of about 100 000 triangles
    python -m bench monkey --quick    200 of them
    python -m bench monkey 7 8        the same with other seeds, one after the other
    python -m bench monkey --write    puts what came of it into docs/explain/editing.md

Nothing may fail in the page, every edit that the server confirmed is in the scan file, the page
shows what the server has, and undoing everything leads back to the first surface to the bit.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from tests.app.e2e.conftest import CHROMIUM, FLAGS, Server, until
from tests.app.e2e.cup import write_whole_cup
from tests.app.e2e.monkey import Monkey, Wire, back_to_the_start, digest_of, edits_in, settle

from bench._commit import commit
from bench._page import DOCS, write

DEEDS, QUICK = 2000, 200
STEPS, SCALE = 270, 2
PAGE = DOCS / "explain" / "editing.md"
PARTS = None
SEED = "1"
OPENS = 1800.0
"""s within which the part is open: on a busy machine, with everything to be compiled first."""


def run(quick: bool = False, parts: tuple[str, ...] = (), into_pages: bool = False) -> None:
    """Print what the monkey did and what it broke."""
    from playwright.sync_api import sync_playwright

    lines: list[str] = []
    for seed in parts or (SEED,):
        with tempfile.TemporaryDirectory() as name, sync_playwright() as p:
            path = write_whole_cup(Path(name) / "part.turnscan", STEPS, SCALE)
            server = Server(Path(name))
            browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            try:
                lines += _play(browser, server, path, QUICK if quick else DEEDS, int(seed))
            finally:
                browser.close()
                server.end()
    if into_pages:
        write(PAGE, "monkey", ["```text", *lines, "```", "", f"Measured at {commit()}."])


def _play(browser: object, server: Server, path: Path, deeds: int, seed: int) -> list[str]:
    """What came of it, in lines that were printed."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})  # type: ignore[attr-defined]
    broken: list[str] = []
    monkey = Monkey(page, seed)

    def hear(text: str) -> None:
        broken.append(text)
        print(f"  page: {text}\n    after {'; '.join(monkey.deeds[-20:])}", flush=True)

    page.on("pageerror", lambda e: hear(f"{e} {e.stack or ''}"))
    page.on("console", lambda m: hear(m.text) if m.type == "error" else None)
    wire = Wire(page)
    page.goto(server.link)
    page.wait_for_url(lambda url: "login" not in url)
    page.get_by_role("button", name="part", exact=True).click()
    until(page, "'turnscan' in window && turnscan.faces > 0", OPENS)
    first = page.evaluate("turnscan.digest")
    faces = page.evaluate("turnscan.faces")
    print(f"  seed {seed}: {faces:,} triangles, digest {first}", flush=True)
    begun = time.monotonic()
    for k in range(deeds):
        monkey.act()
        if k % 20 == 19:
            settle(page, wire)
            shown, has = page.evaluate("turnscan.digest"), digest_of(page)
            if shown != has:
                hear(f"shows {shown}, the server has {has}")
                page.reload()
                until(page, "'turnscan' in window && turnscan.faces > 0", OPENS)
        if k % 100 == 99:
            made = sum(wire.made.values())
            spent = time.monotonic() - begun
            print(f"  {k + 1} deeds, {made} edits, {spent:.0f} s", flush=True)
    settle(page, wire)
    kept = edits_in(path)
    back_to_the_start(page, wire)
    last = page.evaluate("turnscan.digest")
    made = sum(wire.made.values())
    lines = [
        f"{deeds} deeds: {made} edits confirmed, {kept} in the file, {wire.unheard} unheard",
        f"refused: {dict(wire.refused)}; internal errors: {wire.refused['mistake']}",
        f"errors in the page, and surfaces shown that the server has not: {len(broken)}",
        f"no confirmed edit is lost: {_yes(made <= kept <= made + wire.unheard)}",
        f"undone to the first surface, to the bit: {_yes(last == first)} ({last})",
    ]
    for line in lines:
        print(f"  {line}")
    return [f"seed {seed}: {faces:,} triangles, digest {first}", *lines]


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "NO"
