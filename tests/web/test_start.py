"""The start page: scans renamed, copied, binned and seen small, and files that others put there."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.web.running import Browser, Message, Running, small_scan
from turnscan.app._gallery import Gallery
from turnscan.app._library import Library
from turnscan.app._routes import PassingFile
from turnscan.errors import InputError
from turnscan.scan import Scan

COMPILING = 300.0
"""Seconds that opening may take: on a new machine the kernels are compiled first."""


def names(message: Message) -> list[str]:
    return [entry["name"] for entry in message["scans"]]


def only(message: Message) -> Any:
    (entry,) = message["scans"]
    return entry


def pixels(http: httpx.Client, scan: str) -> np.ndarray:
    import cv2

    answer = http.get(f"/api/scans/{scan}/thumbnail.png")
    assert answer.status_code == 200, answer.text
    return cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_scan_that_is_open_is_renamed_copied_binned_and_restored(
    server: Running, folder: Path
) -> None:
    with Browser(server) as browser, server.http(browser.cookie) as http:
        entry = only(browser.hello)
        scan = entry["scan"]
        assert entry["findings"] is None
        stripe = pixels(http, scan)
        browser.open(scan)
        seen = browser.until("scans", lambda m: only(m)["findings"] is not None, COMPILING)
        assert only(seen)["content"] == entry["content"]
        surface = pixels(http, scan)
        assert surface.shape == (240, 320, 4)
        assert 0.1 < (surface[..., 3] > 0).mean() < 0.9, "the part on a transparent ground"
        assert stripe.shape != surface.shape

        assert "already exists" in browser.ask("rename", scan=scan, name="ball")["text"]
        assert browser.ask("list_holes", scan=scan)["kind"] == "holes", "it is open still"
        assert browser.ask("rename", scan=scan, name="a/b")["kind"] == "done"
        assert browser.once("closed")["scan"] == scan
        browser.until("scans", lambda m: names(m) == ["a_b"])
        refused = browser.ask("rename", scan=scan, name="a_b")
        assert "already exists" in refused["text"]
        assert browser.ask("duplicate", scan=scan, name="second")["kind"] == "done"
        both = browser.until("scans", lambda m: len(m["scans"]) == 2)
        assert names(both) == ["a_b", "second"]
        assert both["scans"][0]["findings"] == both["scans"][1]["findings"]
        assert both["scans"][1]["findings"] is not None
        np.testing.assert_array_equal(pixels(http, both["scans"][1]["scan"]), surface)

        assert browser.ask("to_bin", scan=scan)["kind"] == "done"
        binned = browser.until("scans", lambda m: names(m) == ["second"] and m["binned"] != [])
        assert [b["name"] for b in binned["binned"]] == ["a_b"]
        assert http.get(f"/api/scans/{scan}/thumbnail.png").status_code == 204, "it was here"
        assert http.get("/api/scans/another/thumbnail.png").status_code == 404
        (folder / "a_b.turnscan").write_bytes((folder / "second.turnscan").read_bytes())
        back = browser.ask("restore", binned=binned["binned"][0]["binned"])
        assert back["kind"] == "done"
        last = browser.until("scans", lambda m: len(m["scans"]) == 3 and not m["binned"])
        assert names(last) == ["a_b 2", "a_b", "second"]
        np.testing.assert_array_equal(pixels(http, last["scans"][0]["scan"]), surface)
        again = browser.ask("restore", binned=binned["binned"][0]["binned"])
        assert "no longer in the bin" in again["text"]


def test_a_download_of_an_open_scan_has_its_edits(
    server: Running, folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with Browser(server) as browser, server.http(browser.cookie) as http:
        scan = only(browser.hello)["scan"]
        browser.open(scan)
        assert browser.ask("measure", scan=scan, what="area")["kind"] == "measures"
        answer = http.get(f"/api/scans/{scan}/file")
        assert "ball.turnscan" in answer.headers["content-disposition"]
        path = tmp_path_factory.mktemp("downloaded") / "ball.turnscan"
        path.write_bytes(answer.content)
        with Scan.open(path) as copy, Scan.open(folder / "ball.turnscan") as held:
            assert len(copy.edits()) == len(held.edits()) == 1
        assert http.get("/api/scans/none-such/file").status_code == 404
        assert not list(Path(server.workshop.downloads.place().parent).iterdir())

        # Edits are copied to another scan, those that are wanted.
        (folder / "other.turnscan").write_bytes(path.read_bytes())
        both = browser.until("scans", lambda m: len(m["scans"]) == 2)
        other = both["scans"][names(both).index("other")]["scan"]
        done = browser.ask("copy_edits", scan=scan, edits=[1], to=other)
        assert (done["kind"], done["findings"]) == ("done", []), done
        with Scan.open(folder / "other.turnscan") as copy:
            assert len(copy.edits()) == 2
        missing = browser.ask("copy_edits", scan=scan, edits=[1, 77], to=other)
        assert "no edit 77" in missing["text"]
        assert browser.ask("copy_edits", scan=scan, edits=[1], to=scan)["kind"] == "refused"
        with Scan.open(folder / "other.turnscan") as copy:
            assert len(copy.edits()) == 2


def test_files_that_others_put_into_the_folder_are_listed_and_junk_can_go(
    server: Running, folder: Path
) -> None:
    with Browser(server) as browser, server.http(browser.cookie) as http:
        (folder / "junk.turnscan").write_bytes(b"not a scan")
        told = browser.until("scans", lambda m: len(m["scans"]) == 2)
        junk = told["scans"][names(told).index("junk")]
        assert junk["content"] == ""
        assert http.get(f"/api/scans/{junk['scan']}/thumbnail.png").status_code == 404
        assert browser.ask("to_bin", scan=junk["scan"])["kind"] == "done"
        assert not (folder / "junk.turnscan").exists()
        gallery = folder / ".turnscan-app" / "gallery"
        gallery.mkdir(exist_ok=True)
        for of in ("ball", "gone"):  # of a scan that is there, and of one that somebody deleted
            (gallery / f"{of}.turnscan.json").write_text("{}")
        assert browser.ask("empty_bin")["kind"] == "done"
        assert browser.until("scans", lambda m: not m["binned"])["binned"] == []
        assert [p.name for p in gallery.iterdir()] == ["ball.turnscan.json"]
        assert [p.name for p in folder.glob("**/*.turnscan") if p.is_file()] == ["ball.turnscan"]


def test_a_scan_that_is_written_stays_where_it_is(server: Running, folder: Path) -> None:
    with Browser(server) as browser, Scan.resume(folder / "ball.turnscan"):
        scan = only(browser.hello)["scan"]
        for request in ({"kind": "to_bin"}, {"kind": "rename", "name": "other"}):
            refused = browser.ask(**request, scan=scan)
            assert "is being written" in refused["text"], refused
    assert (folder / "ball.turnscan").exists()
    assert list(folder.glob(".turnscan-app/bin/*")) == []


def test_another_scan_of_the_same_name_has_its_own_picture(tmp_path: Path) -> None:
    library = Library(tmp_path)
    gallery, path = Gallery(library), small_scan(tmp_path / "cup.turnscan", steps=2)
    gallery.keep(path, b"seen", [])
    content = library.glance(path).content
    assert gallery.thumbnail(path) == b"seen"
    assert gallery.counts(path, content) is not None
    gallery.discard(path)
    small_scan(path, "sim:sphere?seed=6", steps=2)
    assert library.glance(path).content != content
    assert gallery.thumbnail(path).startswith(b"\x89PNG")


def test_an_edit_that_waited_while_its_scan_was_closed_says_so(server: Running) -> None:
    with Browser(server) as browser:
        scan = only(browser.hello)["scan"]
        browser.open(scan)
        server.workshop.opened(scan).session.close()
        refused = browser.ask("measure", scan=scan, what="area")
        assert refused["text"] == "this scan was closed meanwhile; nothing was changed"
        assert refused["hint"] == "open it again"


def test_a_download_that_is_broken_off_leaves_no_copy(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.write_bytes(b"x" * 1_000_000)

    async def receive() -> dict[str, str]:
        return {"type": "http.disconnect"}

    async def send(message: object) -> None:
        raise OSError("the browser hung up")

    scope = {"type": "http", "method": "GET", "headers": []}
    with pytest.raises(OSError, match="hung up"):
        asyncio.run(PassingFile(copy)(scope, receive, send))
    assert not copy.exists()


def test_a_name_that_was_taken_meanwhile_is_not_written_over(folder: Path) -> None:
    library = Library(folder)
    path = folder / "late.turnscan"

    async def body() -> AsyncIterator[bytes]:
        yield b"new"
        path.write_bytes(b"somebody else's")

    with pytest.raises(InputError, match=r"^late\.turnscan: already exists"):
        asyncio.run(library.receive(path, body(), 3))
    assert path.read_bytes() == b"somebody else's"
    path.unlink()

    async def again() -> AsyncIterator[bytes]:
        yield b"new"

    asyncio.run(library.receive(path, again(), 3))
    assert path.read_bytes() == b"new"
    assert not [p for p in folder.iterdir() if p.name.startswith(".") and p.is_file()]
