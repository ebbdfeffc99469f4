"""What no careful person asks for: versions that do not exist, names that are none, files that go
while they are used, two browsers at once, answers that are lost. Each gets one sentence."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.web.running import Browser, Message, Running, serving
from turnscan.app._envelope import unpack
from turnscan.app._jobs import Job
from turnscan.errors import ScanError
from turnscan.scan import Scan

DELETE = {"kind": "delete"}
OWN = {"every": 1, "edge": 2}


@pytest.fixture(autouse=True)
def no_mistake(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Nothing that is asked here is an internal error, nor a trace in the log."""
    yield
    said = [r for r in caplog.records if r.name.startswith("turnscan") and r.levelno >= 40]
    assert not said, caplog.text
    assert logging.getLogger("turnscan.app").isEnabledFor(logging.ERROR)


@pytest.fixture
def one(server: Running) -> Iterator[Browser]:
    with Browser(server) as browser:
        yield browser


def opened(browser: Browser, name: str = "ball") -> str:
    """A scan of the folder, open."""
    scan = next(e["scan"] for e in browser.hello["scans"] if e["name"] == name)
    browser.open(scan)
    return str(scan)


def delete(browser: Browser, scan: str, first: int, revision: int | None = None) -> Message:
    """Delete twenty faces of the surface as it is."""
    if revision is None:
        revision = browser.ask("open", scan=scan)["revision"]
    faces = {"faces": np.arange(first, first + 20, dtype="<u4")}
    return browser.ask("edit", faces, scan=scan, base_revision=revision, edit=DELETE)


def refused(message: Message, *words: str) -> None:
    """In one sentence that has these words."""
    assert message["kind"] == "refused", message
    for word in words:
        assert word in message["text"], message
    assert len(message["text"]) < 300
    assert "Error" not in message["text"]
    assert "Input should" not in message["text"]


def wait(browser: Browser, number: int) -> Message:
    """The answer to a request that was sent before."""
    while not (found := [m for m in browser.heard if m.get("id") == number]):
        browser.receive()
    return found[0]


def test_versions_that_do_not_exist_and_those_where_one_is(one: Browser, folder: Path) -> None:
    scan = opened(one)
    for nowhere in (1, 99, 2**53 - 1):
        refused(one.ask("go_to", scan=scan, edit=nowhere), f"has an edit {nowhere}")
        refused(one.ask("switch", scan=scan, edit=nowhere, on=False), f"no edit {nowhere}")
        refused(one.ask("name_edit", scan=scan, edit=nowhere, name="x"), f"no edit {nowhere}")
    refused(one.ask("go_to", scan=scan, edit=-1), "edit: must be at least 0")
    assert delete(one, scan, 10)["kind"] == "done"
    # To go where one is changes nothing: another browser's edit of this revision is made.
    for idle in (
        {"kind": "go_to", "edit": 1},
        {"kind": "switch", "edit": 1, "on": True},
        {"kind": "name_edit", "edit": 1, "name": ""},
    ):
        assert one.ask(**idle, scan=scan)["kind"] == "done"
    assert delete(one, scan, 40, revision=1)["kind"] == "done"
    with Scan.open(folder / "ball.turnscan") as file:
        assert len(file.edits()) == 2


def test_the_history_moves_while_settings_are_tried(one: Browser) -> None:
    scan = opened(one)
    assert delete(one, scan, 10)["kind"] == "done"
    wanted = {"scan": scan, "grid": 0}
    first = one.send("try_settings", **wanted, options={"threshold": 31.0})
    moved = one.send("go_to", scan=scan, edit=0)
    second = one.send("try_settings", **wanted, options={"edge": 3})
    assert wait(one, moved)["kind"] == "done"
    assert wait(one, second)["kind"] == "settings_tried"
    assert wait(one, first).get("code", "cancelled") == "cancelled"


def test_the_newest_trial_counts_though_its_thread_came_first(
    one: Browser, server: Running
) -> None:
    scan = opened(one)
    newer = Job(server.workshop.hub, "edit", "newer", scan)
    server.workshop._trials[one.hello["client"]] = (10**6, newer)
    said = one.ask("try_settings", scan=scan, options={}, grid=0)
    assert (said["code"], newer.cancelled) == ("cancelled", False)


def test_names_of_sets_and_edits(one: Browser, folder: Path) -> None:
    scan = opened(one)
    revision = 0
    before = set(folder.parent.glob("**/elsewhere*"))  # of other tests

    def keep(name: Any, **other: Any) -> Message:
        nonlocal revision
        edit = {"kind": "keep_set", "name": name, "options": OWN, **other}
        said = one.ask("edit", scan=scan, base_revision=revision, edit=edit)
        revision += said["kind"] == "done"
        return said

    refused(keep(""), "name may not be empty")
    refused(keep("x" * 10_000), "name has more than 80 characters")
    refused(keep("half \ud83d"), "name has half a character")
    for bad in ("   ", "a\0b", "a\tb", "a\nb", "\u202eabc"):
        refused(keep(bad), "not a name of a set")
    refused(keep("own"), "not the name of a set of one's own")
    for good in ("../../elsewhere", "😀", "x" * 80):
        assert keep(good)["kind"] == "done"
    refused(keep(" 😀 "), "'😀' holds these settings already")
    assert keep(" 😀 ", options={"every": 2})["kind"] == "done"
    told = [m for m in one.heard if m["kind"] == "settings"][-1]["settings"]["sets"]
    assert sorted(s["name"] for s in told) == sorted(("../../elsewhere", "😀", "x" * 80))
    twice = {"kind": "rename_set", "name": "😀", "to": " ../../elsewhere"}
    said = one.ask("edit", scan=scan, base_revision=revision, edit=twice)
    refused(said, "there is a set '../../elsewhere' already")
    refused(one.ask("name_edit", scan=scan, edit=1, name="x" * 81), "more than 80 characters")
    refused(one.ask("name_edit", scan=scan, edit=1, name="half \ud83d"), "half a character")
    refused(one.ask("duplicate", scan=scan, name="half \ud83d"), "half a character")
    refused(one.ask("name_edit", scan=scan, edit=1, name="a\0b"), "no name of an edit")
    assert one.ask("undo", scan=scan)["kind"] == "done", "the connection has lasted"
    assert set(folder.parent.glob("**/elsewhere*")) == before


@pytest.fixture
def three(folder: Path, scan_bytes: bytes) -> None:
    for name in ("other", "third"):
        (folder / f"{name}.turnscan").write_bytes(scan_bytes)


def test_edits_are_copied_to_scans_that_are_open_written_or_gone(
    three: None, one: Browser, server: Running, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan, other, third = (opened(one), *(_named(one, n) for n in ("other", "third")))
    assert delete(one, scan, 10)["kind"] == "done"
    wanted = {"scan": scan, "edits": [1]}
    with Browser(server) as two:
        two.open(other)
        assert one.ask("copy_edits", **wanted, to=other)["kind"] == "done"
        assert two.once("closed")["scan"] == other
        assert len(two.open(other)["history"]) == 1
    with Scan.resume(folder / "third.turnscan"):
        refused(one.ask("copy_edits", **wanted, to=third), "another process is writing it")
    refused(one.ask("copy_edits", scan=scan, edits=[1, 9], to=third), "no edit 9")

    def forbidden(*_: Any) -> None:
        raise ScanError("third.turnscan: read-only")

    with monkeypatch.context() as patch:
        patch.setattr(Scan, "append_edit", forbidden)
        refused(one.ask("copy_edits", **wanted, to=third), "read-only")
    (folder / "third.turnscan").rename(folder / "elsewhere")
    refused(one.ask("copy_edits", **wanted, to=third), "no such scan")
    (folder / "elsewhere").rename(folder / "third.turnscan")
    with Scan.open(folder / "third.turnscan") as file:
        assert file.edits() == ()
    # Whether the copy or the bin comes first, both say what became of it.
    copied = one.send("copy_edits", **wanted, to=third)
    binned = one.send("to_bin", scan=third)
    copy, gone = wait(one, copied), wait(one, binned)
    if copy["kind"] == "refused":
        refused(copy, "no such scan")
    if gone["kind"] == "refused":
        refused(gone, "is being written")


def _named(browser: Browser, name: str) -> str:
    return str(next(e["scan"] for e in browser.hello["scans"] if e["name"] == name))


def test_names_and_the_bin_are_asked_for_at_once(one: Browser, folder: Path) -> None:
    scan = opened(one)

    def together(*asked: dict[str, Any]) -> list[Message]:
        numbers = [one.send(**request) for request in asked]
        return [wait(one, number) for number in numbers]

    said = together(*({"kind": "rename", "scan": scan, "name": f"new {k}"} for k in range(3)))
    assert [m["kind"] for m in said] == ["done"] * 3
    said = together(*({"kind": "duplicate", "scan": scan, "name": "copy"} for _ in range(3)))
    assert sorted(m["kind"] for m in said) == ["done", "refused", "refused"]
    for m in said:
        if m["kind"] == "refused":
            refused(m, "copy.turnscan: already exists")
    said = together(*({"kind": "to_bin", "scan": scan} for _ in range(3)))
    assert sorted(m["kind"] for m in said) == ["done", "refused", "refused"]
    for m in said:
        if m["kind"] == "refused":
            refused(m, "no such scan")
    binned = one.once("scans", lambda m: m["binned"] != [])["binned"][0]["binned"]
    said = together(*({"kind": "restore", "binned": binned} for _ in range(3)))
    assert sorted(m["kind"] for m in said) == ["done", "refused", "refused"]
    for m in said:
        if m["kind"] == "refused":
            refused(m, "no longer in the bin")
    assert len(list(folder.glob("*.turnscan"))) == 2


@pytest.mark.parametrize("away", ["rename", "to_bin"])
def test_a_scan_leaves_while_it_is_looked_at(one: Browser, away: str) -> None:
    for kind, keys in (
        ("try_settings", {"options": {"threshold": 33.0}, "grid": 0}),
        ("compare_settings", {"first": {}, "second": {"threshold": 33.0}}),
        ("list_holes", {}),
        ("find_shapes", {}),
        ("measure_again", {}),
    ):
        (scan,) = one.server.workshop.library.paths()
        one.open(scan)
        looking = one.send(kind, scan=scan, **keys)
        name = {"name": f"{kind} now"} if away == "rename" else {}
        assert one.ask(away, scan=scan, **name)["kind"] == "done"
        said = wait(one, looking)
        if said["kind"] == "refused":
            refused(said, "closed meanwhile" if "closed" in said["text"] else "is not open")
        if away == "to_bin":
            (entry,) = one.server.workshop.start.gallery.binned()
            assert one.ask("restore", binned=entry.binned)["kind"] == "done"


def test_two_browsers_step_through_the_history_at_once(server: Running, folder: Path) -> None:
    with Browser(server) as one, Browser(server) as two, server.http(one.cookie) as http:
        scan = opened(one)
        for k in range(4):
            assert delete(one, scan, 100 * k)["kind"] == "done"
        answers: list[Message] = []

        def step(browser: Browser, *asked: dict[str, Any]) -> None:
            for request in asked * 4:
                browser.ask("take_control")
                answers.append(browser.ask(**request, scan=scan))

        back = ({"kind": "undo"}, {"kind": "redo"})
        leap = ({"kind": "go_to", "edit": 2}, {"kind": "go_to", "edit": 0})
        both = [threading.Thread(target=step, args=a) for a in ((one, *back), (two, *leap))]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()
        assert len(answers) == 16
        for said in answers:
            if said["kind"] != "done":
                assert said["code"] == "not-operator" or "nothing to" in said["text"], said
        one.ask("take_control")
        assert one.ask("go_to", scan=scan, edit=4)["kind"] == "done"
        _, arrays = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        assert (arrays["alive"] == 0).sum() == 80
        assert len(one.ask("open", scan=scan)["history"]) == 4, "no edit is lost"


def test_an_edit_whose_answer_is_lost_is_made_once(server: Running, folder: Path) -> None:
    faces = {"faces": np.arange(10, 30, dtype="<u4")}
    with Browser(server) as one:
        scan = opened(one)
        one.send("edit", faces, scan=scan, base_revision=0, edit=DELETE)
        one.socket.socket.shutdown(socket.SHUT_RDWR)  # nobody will read the answer
    with Browser(server) as two:
        two.ask("take_control")
        again = two.ask("edit", faces, scan=scan, base_revision=0, edit=DELETE)
        # Where its browser had left before its turn came, it was not made.
        assert again["kind"] == "done" or again["code"] == "stale"
        assert two.open(scan)["revision"] == 1
        with Scan.open(folder / "ball.turnscan") as file:
            assert len(file.edits()) == 1


def test_an_edit_that_cannot_be_stored_has_not_happened(
    one: Browser, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = opened(one)

    def forbidden(*_: Any) -> None:
        raise ScanError("ball.turnscan: read-only, nothing was written")

    with monkeypatch.context() as patch:
        patch.setattr(Scan, "append_edit", forbidden)
        refused(delete(one, scan, 10), "read-only")
        refused(one.ask("measure", scan=scan, what="area"), "read-only")
    assert one.ask("open", scan=scan)["revision"] == 0
    assert delete(one, scan, 10, revision=0)["kind"] == "done"
    with Scan.open(folder / "ball.turnscan") as file:
        assert len(file.edits()) == 1


def test_uploads_go_on_with_what_they_are_not(
    server: Running, folder: Path, scan_bytes: bytes
) -> None:
    total, half = len(scan_bytes), len(scan_bytes) // 2

    with Browser(server) as one, server.http(one.cookie) as http:

        def begin(size: int) -> str:
            return str(http.post("/api/uploads", params={"bytes": size}).json()["upload"])

        def add(upload: str, at: int, piece: bytes) -> Any:
            return http.post("/api/uploads", params={"upload": upload, "at": at}, content=piece)

        def keep(upload: str, name: str = "sent") -> Any:
            return http.post("/api/scans", params={"name": name, "upload": upload})

        upload = begin(total)
        add(upload, 0, scan_bytes[:half])
        more = add(upload, half, scan_bytes[half:] + b"of another file")
        assert f"more than the {total} bytes" in more.json()["text"]
        assert http.get(f"/api/uploads/{upload}").json()["received"] == half, (
            "the piece is not kept"
        )
        assert add(upload, half, scan_bytes[half:]).json()["received"] == total
        assert keep(upload).status_code == 201
        assert (folder / "sent.turnscan").read_bytes() == scan_bytes
        upload = begin(total)
        add(upload, 0, b"another".ljust(total))
        assert "not a scan file" in keep(upload, "another").json()["text"]
        assert not (folder / "another.turnscan").exists()
        assert "no size" in http.post("/api/uploads").json()["text"]
        # Somebody has cleared the folder.
        cleared = begin(total)
        for path in folder.rglob(f".{cleared}"):
            path.unlink()
        for answer in (
            add(cleared, 0, b"x"),
            keep(cleared, "late"),
            http.get(f"/api/uploads/{cleared}"),
        ):
            assert (answer.json()["text"], answer.json()["hint"]) == (
                "no such upload", "send the file again",
            )  # fmt: skip
        late = begin(total)
    with serving(folder) as again, Browser(again) as two, again.http(two.cookie) as http:
        answer = http.post("/api/uploads", params={"upload": late, "at": 0}, content=b"x")
        assert (answer.status_code, answer.json()["text"]) == (400, "no such upload")
