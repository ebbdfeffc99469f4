"""The rooms behind the doors, as a browser meets them."""

from __future__ import annotations

import contextlib
import shutil
import socket
import threading
import time
import weakref
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.web.running import PATIENCE, Browser, Message, Running, serving
from turnscan.app import Library, Workshop, _workshop
from turnscan.app._envelope import unpack
from turnscan.app._hub import Client, Hub
from turnscan.app._jobs import Job, remarks
from turnscan.app._open_scan import OpenScan
from turnscan.app._step_pictures import StepPictures
from turnscan.drawings import read_step
from turnscan.edit import Action, Change, Document
from turnscan.findings import Finding
from turnscan.formats import read_mesh, write_ply
from turnscan.mesh import Mesh
from turnscan.progress import Cancelled, Progress
from turnscan.remedy import Option, Remedy
from turnscan.scan import Scan
from turnscan.workflows import edits, options_of, reconstruct


def _another_branch(
    one: Browser, scan: str, history: Message, arrays: dict[str, Any], edit: dict[str, Any]
) -> None:
    """An edit after going back begins a branch, and the first can be taken again."""
    first = history["history"][0]["edit"]
    assert one.ask("go_to", scan=scan, edit=0)["kind"] == "done"
    state = next(m for m in reversed(one.heard) if m["kind"] == "patch")
    again = one.ask("edit", arrays, scan=scan, base_revision=state["revision"], edit=edit)
    assert again["kind"] == "done"
    history = next(m for m in reversed(one.heard) if m["kind"] == "history")
    (branch,) = history["branches"]
    assert (branch["after"], [e["edit"] for e in branch["edits"]]) == (0, [first])
    assert one.ask("name_edit", scan=scan, edit=first, name="with a gap")["kind"] == "done"
    refused = one.ask("name_edit", scan=scan, edit=77, name="nobody")
    assert "no edit 77" in refused["text"]
    assert one.ask("go_to", scan=scan, edit=first)["kind"] == "done"
    history = next(m for m in reversed(one.heard) if m["kind"] == "history")
    assert [(e["edit"], e["title"]) for e in history["history"]] == [(first, "with a gap")]


def _pictures_come(one: Browser, http: Any, scan: str) -> None:
    """Every step of history and branches gets a picture of its surface, drawn once."""

    def drawn(m: Message) -> bool:
        rows = [*m["history"], *(e for b in m["branches"] for e in b["edits"])]
        return all(e["picture"] for e in rows) and bool(m["scanned_picture"])

    last = next(m for m in reversed(one.heard) if m["kind"] == "history")
    told = last if drawn(last) else one.until("history", drawn)
    names = {e["picture"] for e in told["history"]} | {told["scanned_picture"]}
    for name in names:
        answer = http.get(f"/api/scans/{scan}/steps/{name}.png")
        assert answer.content.startswith(b"\x89PNG")
    assert http.get(f"/api/scans/{scan}/steps/{'0' * 16}.png").status_code == 404


def test_edits_reach_everybody_and_are_in_the_file(folder: Path) -> None:
    with (
        serving(folder) as server,
        Browser(server) as one,
        Browser(server) as two,
        server.http(one.cookie) as http,
    ):
        scan = one.hello["scans"][0]["scan"]
        state = one.open(scan)
        mesh, arrays = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        assert mesh["revision"] == 0
        faces = len(arrays["faces"])
        assert state["figures"]["faces"] == faces > 500
        chosen = np.arange(10, 60, dtype="<u4")
        edit = {"kind": "delete"}
        shown = one.ask(
            "edit", {"faces": chosen}, scan=scan, base_revision=0, edit=edit, preview=True
        )
        assert shown["kind"] == "preview"
        np.testing.assert_array_equal(shown["arrays"]["dead"], chosen)
        mask = np.zeros(faces, np.uint8)
        mask[chosen] = 1
        bits = {"face_bits": np.packbits(mask, bitorder="little")}
        same = one.ask("edit", bits, scan=scan, base_revision=0, edit=edit, preview=True)
        np.testing.assert_array_equal(same["arrays"]["dead"], chosen)
        beyond = {"face_bits": np.full(faces // 8 + 2, 255, np.uint8)}
        refused = one.ask("edit", beyond, scan=scan, base_revision=0, edit=edit, preview=True)
        assert "faces that do not exist" in refused["text"]
        assert (
            one.ask("edit", {"faces": chosen}, scan=scan, base_revision=0, edit=edit)["kind"]
            == "done"
        )
        for browser in (one, two):
            patch = browser.once("patch")
            assert patch["revision"] == 1
            assert patch["parts"] == [{"kind": "alive", "value": False}]
            np.testing.assert_array_equal(patch["arrays"]["0.faces"], chosen)
        with Scan.open(folder / "ball.turnscan") as file:
            assert len(file.edits()) == 1
        stale = one.ask("edit", {"faces": chosen}, scan=scan, base_revision=0, edit=edit)
        assert (stale["kind"], stale["code"]) == ("refused", "stale")
        nothing = {"kind": "despike", "beyond": 1000.0}
        empty = one.ask("edit", scan=scan, base_revision=1, edit=nothing)
        assert empty["kind"] == "refused"
        assert empty["code"] != "stale"
        with Scan.open(folder / "ball.turnscan") as file:
            assert len(file.edits()) == 1
        assert one.ask("undo", scan=scan)["kind"] == "done"
        assert one.ask("undo", scan=scan)["kind"] == "refused"
        assert one.ask("redo", scan=scan)["kind"] == "done"
        _, arrays = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        assert arrays["alive"].sum() == faces - 50
        history = next(m for m in reversed(one.heard) if m["kind"] == "history")
        assert [e["name"] for e in history["history"]] == ["delete"]
        assert history["cursor"] == 1
        assert (
            one.ask("switch", scan=scan, edit=history["history"][0]["edit"], on=False)["kind"]
            == "done"
        )
        _, arrays = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        assert arrays["alive"].all()
        _another_branch(one, scan, history, {"faces": chosen[:9]}, edit)
        _pictures_come(one, http, scan)
        switch = {"scan": scan, "edit": history["history"][0]["edit"], "on": True}
        assert one.ask("switch", **switch)["kind"] == "done"
        _, touched = unpack(http.get(f"/api/scans/{scan}/edits").content)
        assert set(touched["touch"]) == {0, 3}
        rim = np.unique(arrays["faces"].reshape(-1, 3)[chosen])
        assert not touched["touch"][rim].tolist().count(0)
        assert one.ask("switch", **{**switch, "on": False})["kind"] == "done"
        with serving(folder) as second, Browser(second) as other:
            other.send("open", scan=other.hello["scans"][0]["scan"])
            failed = other.until("job", lambda m: m["state"] == "failed")
            assert failed["text"] == "ball.turnscan: another process is writing it"
    with serving(folder) as again, Browser(again) as late:
        state = late.open(late.hello["scans"][0]["scan"])
        assert state["figures"]["faces"] == faces
        assert [e["on"] for e in state["history"]] == [False]


def test_settings_are_an_edit_that_every_door_replays(folder: Path) -> None:
    with (
        serving(folder) as server,
        Browser(server) as one,
        Browser(server) as two,
        server.http(one.cookie) as http,
    ):
        scan = one.hello["scans"][0]["scan"]
        state = one.open(scan)
        assert state["settings"]["options"]["every"] == 1
        every = state["fields"]["every"]
        assert (every["type"], every["minimum"], every["default"]) == ("integer", 1, 1)
        revision = 0

        def edit(value: dict[str, object], faces: dict[str, np.ndarray] | None = None) -> None:
            nonlocal revision
            done = one.ask("edit", faces, scan=scan, base_revision=revision, edit=value)
            assert done["kind"] == "done", done
            revision += 1

        def surface() -> tuple[int, bytes]:
            _, arrays = unpack(http.get(f"/api/scans/{scan}/mesh").content)
            alive = arrays["faces"][arrays["alive"] > 0]
            return len(alive), arrays["positions"][alive].tobytes()

        def latest() -> dict[str, Any]:
            told = next(m for m in reversed(one.heard) if m["kind"] == "settings")
            return dict(told["settings"])

        edit({"kind": "profile_off", "laser": state["grids"][0]["laser"], "steps": [3, 3]})
        edit({"kind": "delete"}, {"faces": np.arange(10, 60, dtype="<u4")})
        before = surface()
        edit({"kind": "settings", "options": {"every": 2, "edge": 2}, "name": "default"})
        for browser in (one, two):
            told = browser.once("settings")
            assert told["settings"]["options"]["edge"] == 2
            history = browser.once("history", lambda m: len(m["history"]) == 3)
            assert history["history"][-1]["text"] == "settings: every 2, edge 2"
        assert surface()[0] < 0.7 * before[0]
        coarse = surface()
        again = {"kind": "settings", "options": {"every": 2, "edge": 2}}
        refused = one.ask("edit", scan=scan, base_revision=revision, edit=again)
        assert refused["text"] == "these settings are in use"
        none = {"kind": "settings", "options": {"threshold": 240.0}}
        refused = one.ask("edit", scan=scan, base_revision=revision, edit=none)
        assert refused["text"].startswith("no stripe above the threshold")
        assert refused["options"] == [{"name": "threshold", "value": None}]
        wrong = {"kind": "settings", "options": {"fill": "flat"}}
        refused = one.ask("edit", scan=scan, base_revision=revision, edit=wrong)
        assert "no effect without close" in refused["text"]
        own = {"every": 2, "edge": 2}
        edit({"kind": "keep_set", "name": "fine", "options": own})
        assert surface() == coarse, "a note changes no surface"
        edit({"kind": "rename_set", "name": "fine", "to": "coarse"})
        assert [s["name"] for s in latest()["sets"]] == ["coarse"]
        for wrong, says in (
            ({"kind": "keep_set", "name": "default", "options": own}, "not the name of a set"),
            ({"kind": "keep_set", "name": "coarse", "options": own}, "holds these settings"),
            ({"kind": "keep_set", "name": "odd", "options": {"threshold": -1}}, "threshold"),
            ({"kind": "rename_set", "name": "fine", "to": "finer"}, "no set of settings 'fine'"),
            ({"kind": "rename_set", "name": "coarse", "to": "coarse"}, "there is a set 'coarse'"),
            ({"kind": "delete_set", "name": "fine"}, "no set of settings 'fine'"),
        ):
            refused = one.ask("edit", scan=scan, base_revision=revision, edit=wrong)
            assert says in refused["text"]
        edit({"kind": "delete_set", "name": "coarse"})
        assert latest()["sets"] == []
        for _ in range(4):
            assert one.ask("undo", scan=scan)["kind"] == "done"
        assert latest()["options"]["every"] == 1
        assert surface() == before, "undo makes the surface of before to the bit"
        for _ in range(3):
            assert one.ask("redo", scan=scan)["kind"] == "done"
        assert [s["name"] for s in latest()["sets"]] == ["coarse"]
        assert surface() == coarse
    path = folder / "ball.turnscan"
    part = reconstruct(path)
    assert part.options.every == part.options.edge == 2
    assert len(part.mesh.faces) == coarse[0]
    assert options_of(path, "coarse") == part.options
    assert len(edits(path).lines()) == 6
    with serving(folder) as again_served, Browser(again_served) as late:
        opened = late.open(late.hello["scans"][0]["scan"])
        assert opened["figures"]["faces"] == coarse[0]
        assert opened["settings"]["options"] == asdict(part.options)
        assert [s["name"] for s in opened["settings"]["sets"]] == ["coarse"]


def test_settings_are_tried_while_edits_go_on_and_bad_ones_are_refused(server: Running) -> None:
    with Browser(server) as one:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)

        def attempt(options: dict[str, Any], step: int | None = None) -> Message:
            return one.ask("try_settings", scan=scan, options=options, grid=0, step=step)

        same = attempt({}, 3)
        assert same["kind"] == "settings_tried"
        assert (same["steps"][0], len(same["steps"])) == (3, 4)
        arrays = same["arrays"]
        np.testing.assert_array_equal(arrays["old.0"], arrays["new.0"])
        np.testing.assert_array_equal(arrays["old.faces"], arrays["new.faces"])
        low = attempt({"z_max": 12.0}, 3)["arrays"]
        assert np.nanmax(low["new.positions"][:, 2]) <= 12 < np.nanmax(low["old.positions"][:, 2])
        assert np.nanmax(np.abs(low["new.distance"])) < 0.05
        assert same["findings"] == []
        for empty, field, says in (
            ({"threshold": 240.0, "edge": 2}, "threshold", "no stripe above the threshold"),
            ({"radius": 0.01}, "radius", "inside the working volume in 24 pictures"),
            ({"every": 24}, "every", "1 profile is left, and a surface needs two"),
            ({"spacing_between": "400deg"}, "spacing_between", "1 profile is left"),
            ({"outliers": 1e-6}, "outliers", "no point is left of the stripes in 24 pictures"),
            ({"largest_sigma": 1e-6}, "largest_sigma", "no point is left of the stripes"),
            ({"merge": "tsdf", "voxel": 1000.0}, "voxel", "form no surface"),
        ):
            none = attempt(empty)
            assert (none["kind"], len(none["arrays"]["new.faces"])) == ("settings_tried", 0), none
            said = none["findings"][0]
            assert (said["severity"], says in said["text"]) == ("error", True), said
            assert said["options"][0]["name"] == field
            wanted = {"kind": "settings", "options": empty}
            refused = one.ask("edit", scan=scan, base_revision=0, edit=wanted)
            assert (refused["kind"], refused["options"][0]["name"]) == ("refused", field), refused
        for wrong, field, says in (
            ({"threshold": -1}, "threshold", "threshold"),
            ({"spacing": 0}, "spacing", "spacing"),
            ({"spacing": 1e-6}, "spacing", "points a profile"),
            ({"spacing_between": "0.0001deg"}, "spacing_between", "profiles, at most"),
            ({"merge": "tsdf", "voxel": 1e-6}, "voxel", "voxels of"),
            ({"radius": 5, "z_min": 9.0, "z_max": 3.0}, "z_min", "no height between"),
            ({"every": 2.5}, "every", "every"),
            ({"nonsense": 1}, None, "no option"),
        ):
            refused = attempt(wrong)
            assert (refused["kind"], says in refused["text"]) == ("refused", True), refused
            named = refused["options"][0]["name"] if refused["options"] else None
            assert named == field, refused
        numbers = [one.send("try_settings", scan=scan, options={"edge": k}, grid=0) for k in (2, 3)]
        edit = {"kind": "settings", "options": {"every": 2}}
        assert one.ask("edit", scan=scan, base_revision=0, edit=edit)["kind"] == "done"
        assert one.ask("undo", scan=scan)["kind"] == "done"
        assert attempt({"edge": 2})["kind"] == "settings_tried"
        while not (first := [m for m in one.heard if m.get("id") == numbers[0]]):
            one.receive()
        assert first[0].get("code", "cancelled") == "cancelled", "or it was over before the next"
        both = one.ask("compare_settings", scan=scan, first={}, second={"z_max": 12.0})
        assert both["kind"] == "settings_compared"
        assert both["won"] < 0.1 * both["lost"] < 0.1 * both["areas"][0]


def test_from_a_vertex_to_its_profile_and_its_picture(server: Running) -> None:
    with Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        begin = one.open(scan)
        grids = begin["grids"]
        _, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        vertex = len(mesh["positions"]) // 2
        step, line = int(mesh["step"][vertex]), int(mesh["line"][vertex])
        _, grid = unpack(http.get(f"/api/scans/{scan}/grid/{grids[0]['grid']}?step={step}").content)
        np.testing.assert_allclose(grid["points"][0, line], mesh["positions"][vertex], atol=1e-3)
        head, profile = unpack(http.get(f"/api/scans/{scan}/profile/0/{step}").content)
        picked = int(profile["chosen"][line])
        assert picked >= 0
        # On a ball a thick sheet shifts the stripe's centre; the grid takes that off.
        assert abs(profile["candidates"][line, picked] - profile["position"][line]) < 0.1
        away = profile["candidate_points"][line, picked] - mesh["positions"][vertex]
        assert np.linalg.norm(away) < 0.1, away
        picture = http.get(f"/api/scans/{scan}/picture/0/{step}.png")
        assert picture.headers["content-type"] == "image/png"
        import cv2

        pixels = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_UNCHANGED)
        assert pixels.shape[:2] == (head["height"], head["width"])
        column = round(float(profile["position"][line]))
        assert pixels[line, column] > pixels[line].mean() + 20
        coarse, some = unpack(http.get(f"/api/scans/{scan}/mesh?faces=300").content)
        assert coarse["epoch"] == begin["epoch"]
        assert 100 < len(some["faces"]) < 600
        for wrong in ("grid/7", "grid/0?step=999", "profile/0/999", "picture/0/999.png"):
            assert http.get(f"/api/scans/{scan}/{wrong}").status_code == 400
        assert http.get("/api/scans/nothing/mesh").status_code == 404


def test_opening_can_be_cancelled_and_lets_the_file_go(folder: Path) -> None:
    path, hub, pictures = folder / "ball.turnscan", Hub(), StepPictures(folder)
    job = Job(hub, "open", "Opening ball", "ball")
    job.cancel()
    with pytest.raises(Cancelled):
        OpenScan("ball", path, hub, job, pictures)
    OpenScan("ball", path, hub, Job(hub, "open", "Opening ball", "ball"), pictures).close()
    pictures.close()


def test_a_long_edit_is_a_job_and_cancelled_it_has_not_happened(
    server: Running, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go, gone_on, after = threading.Event(), threading.Event(), Document.after

    def slow(document: Document, action: Action, progress: Progress) -> tuple[Document, Change]:
        progress(0.25)
        assert go.wait(PATIENCE)
        progress(0.5)
        gone_on.set()
        return after(document, action, progress)

    with Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        before = http.get(f"/api/scans/{scan}/mesh").content
        monkeypatch.setattr(Document, "after", slow)
        asked = {"scan": scan, "base_revision": 0, "edit": {"kind": "delete"}}
        chosen = {"faces": np.arange(10, 60, dtype="<u4")}

        def begun() -> tuple[int, str]:
            go.clear()
            number = one.send("edit", chosen, **asked)
            job = one.until("job", lambda m: m["what"] == "edit")
            assert (job["state"], job["scan"]) == ("running", scan)
            assert job["title"] == "delete 50 triangles"
            assert (job["done"], job["total"]) == (250, 1000)
            return number, job["job"]

        number, job = begun()
        assert one.ask("cancel", job=job)["kind"] == "done"
        go.set()
        assert one.until("job", lambda m: m["job"] == job)["state"] == "cancelled"
        refused = one.until("refused", lambda m: m["id"] == number)
        assert refused["code"] == "cancelled"
        assert not gone_on.is_set()  # it ended where it was told next
        assert not any(m["kind"] == "patch" for m in one.heard)
        # Pictures of steps that were drawn meanwhile are sent with the history as it was.
        assert all(m["cursor"] == 0 for m in one.heard if m["kind"] == "history")
        assert http.get(f"/api/scans/{scan}/mesh").content == before
        with Scan.open(folder / "ball.turnscan") as file:
            assert file.edits() == ()

        number, job = begun()  # the next one is not cancelled, and happens
        go.set()
        assert one.until("patch")["revision"] == 1
        assert one.until("job", lambda m: m["job"] == job)["state"] == "done"
        assert one.until("done", lambda m: m["id"] == number)
        assert one.ask("cancel", job=job)["kind"] == "done"
        with Scan.open(folder / "ball.turnscan") as file:
            assert len(file.edits()) == 1


def test_what_is_stored_can_no_longer_be_cancelled() -> None:
    job = Job(Hub(), "edit", "Editing", "ball")
    job.commit()
    job.cancel()
    job.check()
    late = Job(Hub(), "edit", "Editing", "ball")
    late.cancel()
    with pytest.raises(Cancelled):
        late.commit()


def test_a_profile_that_is_switched_off_is_gone_everywhere(server: Running) -> None:
    with Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        state = one.open(scan)
        laser = state["grids"][0]["laser"]
        off = {"kind": "profile_off", "laser": laser, "steps": [3, 5]}
        shown = one.ask("edit", scan=scan, base_revision=0, edit=off, preview=True)
        assert shown["figures"]["faces"] < state["figures"]["faces"]
        _, grid = unpack(http.get(f"/api/scans/{scan}/grid/0").content)
        assert {3, 4, 5} <= set(grid["steps"].tolist())  # a preview changes nothing
        assert one.ask("edit", scan=scan, base_revision=0, edit=off)["kind"] == "done"
        patch = one.once("patch")
        assert patch["parts"] == [{"kind": "replace"}]
        assert patch["epoch"] == state["epoch"] + 1
        assert patch["figures"]["faces"] == shown["figures"]["faces"]
        one.once("grid")
        _, grid = unpack(http.get(f"/api/scans/{scan}/grid/0").content)
        assert not {3, 4, 5} & set(grid["steps"].tolist())
        found = one.ask("list_holes", scan=scan)["holes"]
        assert "deleted" in {hole["cause"] for hole in found}
        assert one.ask("undo", scan=scan)["kind"] == "done"
        _, grid = unpack(http.get(f"/api/scans/{scan}/grid/0").content)
        assert {3, 4, 5} <= set(grid["steps"].tolist())
        head, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        assert head["epoch"] == state["epoch"] + 2
        assert mesh["alive"].sum() == state["figures"]["faces"]


def test_holes_and_defects_have_causes_and_places(server: Running) -> None:
    with Browser(server) as one:
        scan = one.hello["scans"][0]["scan"]
        bounds = np.array(one.open(scan)["figures"]["bounds"])
        holes = one.ask("list_holes", scan=scan)
        assert holes["kind"] == "holes"
        assert holes["holes"]
        sizes = [h["size"] for h in holes["holes"]]
        assert sizes == sorted(sizes, reverse=True)
        for h in holes["holes"]:
            loop = holes["arrays"][f"loop_{h['hole']}"]
            assert len(loop) >= 3
            assert (np.array(h["centre"]) > bounds[0] - 1).all()
            assert h["cause_text"]
        assert any(h["cause"] not in (None, "unknown") for h in holes["holes"])
        defects = one.ask("list_defects", scan=scan)["defects"]
        placed = [d for d in defects if d["place"] is not None]
        assert len(placed) == len(sizes)
        edit = {"kind": "fill", "holes": None, "how": "flat", "largest": None}
        assert one.ask("edit", scan=scan, base_revision=0, edit=edit)["kind"] == "done"
        assert one.ask("list_holes", scan=scan)["holes"] == []
        assert one.once("patch")["figures"]["closed"]


def test_the_map_of_quality_is_that_of_the_reports(folder: Path) -> None:
    from turnscan.workflows._surface._quality_map import sigmas

    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        head, found = unpack(http.get(f"/api/scans/{scan}/quality").content)
        _, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
    assert head["revision"] == 0
    opened = reconstruct(folder / "ball.turnscan").mesh
    assert opened.provenance is not None
    expected = sigmas(opened)
    assert found["sigma"].shape == expected.shape
    assert found["sigma"] == pytest.approx(expected, rel=1e-3, nan_ok=True)
    known = np.isfinite(found["sigma"])
    assert found["sigma"][known].std() < mesh["sigma"][known].std()


def test_holes_that_somebody_deletes_are_called_so(folder: Path) -> None:
    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        as_scanned = one.ask("list_holes", scan=scan)["holes"]
        assert "deleted" not in {h["cause"] for h in as_scanned}
        _, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        middle = mesh["positions"][mesh["faces"]].mean(axis=1)
        waist = np.abs(middle[:, 2] - np.median(middle[:, 2])) < 4.0
        near = waist & (np.hypot(middle[:, 1], 0) < 4.0) & (middle[:, 0] > 0)
        faces = np.flatnonzero(near).astype("<u4")
        assert len(faces) > 10
        told = one.ask(
            "edit", {"faces": faces}, scan=scan, base_revision=0, edit={"kind": "delete"}
        )
        assert told["kind"] == "done"
        found = one.ask("list_holes", scan=scan)["holes"]
        assert len(found) == len(as_scanned) + 1
        ours = [h["cause_text"] for h in found if h["cause"] == "deleted"]
        assert ours == ["deleted by hand"]


def test_measurements_are_kept_with_the_scan(folder: Path) -> None:
    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        _, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        corners = mesh["positions"]
        a, b = corners[0].tolist(), corners[-1].tolist()
        told = one.ask("measure", scan=scan, what="distance", places=[a, b])
        assert told["kind"] == "measures"
        apart = float(np.linalg.norm(corners[0] - corners[-1]))
        assert told["measures"][0]["value"] == pytest.approx(apart, abs=0.01)
        faces = np.arange(len(mesh["faces"]), dtype="<u4")
        told = one.ask("measure", {"faces": faces}, scan=scan, what="diameter")
        ball = told["measures"][1]
        assert 0 < ball["uncertainty"] < 0.1
        radius = np.linalg.norm(corners - np.array(ball["places"][0], np.float32), axis=1)
        assert ball["value"] == pytest.approx(2 * radius.mean(), rel=0.01)
        refused = one.ask("measure", scan=scan, what="volume")
        assert refused["text"] == "the surface is open, so it has no volume"
        refused = one.ask("measure", scan=scan, what="distance", places=[a])
        assert refused["text"] == "distance: 1 of 2 points"
        name, size = told["measures"][1]["measure"], told["measures"][1]["value"]
        for nominal, verdict in ((size, "pass"), (size + 1.0, "fail"), (size + 0.5, "undecided")):
            limits = {"nominal": nominal, "lower": -0.5, "upper": 0.5}
            told = one.ask("specify", scan=scan, measure=name, name="ball", **limits)
            assert (told["measures"][1]["name"], told["measures"][1]["verdict"]) == (
                "ball",
                verdict,
            )
        refused = one.ask("specify", scan=scan, measure=name, nominal=size, lower=-0.1)
        assert "both limits" in refused["text"]
        assert one.ask("measure_again", scan=scan)["measures"] == told["measures"]
        left = one.ask("forget_measure", scan=scan, measure=told["measures"][0]["measure"])
        assert [m["what"] for m in left["measures"]] == ["diameter"]
        assert one.ask("forget_measure", scan=scan, measure="edit-99")["kind"] == "refused"
    with serving(folder) as again, Browser(again) as late:
        state = late.open(late.hello["scans"][0]["scan"])
        scan, revision = state["scan"], state["revision"]
        # What the calibration adds is worked out when it is asked for, and the verdict with it.
        open_yet = {"complete": False, "shared": None, "verdict": None}
        assert state["measures"] == [
            {**m, **open_yet, "uncertainty": 2 * m["noise"]} for m in left["measures"]
        ]
        assert late.ask("measure_again", scan=scan)["measures"] == left["measures"]
        gone = {"kind": "cut", "normal": [0, 0, 1], "distance": float(corners[:, 2].mean())}
        late.ask("edit", scan=scan, base_revision=revision, edit=gone)
        cut = late.once("measures", lambda m: m["measures"][0]["outdated"])["measures"][0]
        assert cut["outdated"]
        assert cut["verdict"] is None
        anew = late.ask("measure_again", scan=scan)["measures"][0]
        assert not anew["outdated"]


def test_the_deviation_from_a_reference_is_of_every_vertex(folder: Path) -> None:
    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        _, mesh = unpack(http.get(f"/api/scans/{scan}/mesh").content)
        v = mesh["positions"].astype(np.float64)
        moved = Mesh(v + [0.0, 0.0, 0.05], mesh["faces"].astype(np.int32))
        (folder / "moved.ply").write_bytes(write_ply(moved))
        files = one.ask("list_files")["files"]
        reference = next(f["file"] for f in files if f["name"] == "moved.ply")
        shown = one.ask("show_deviation", scan=scan, reference=reference)
        assert shown["kind"] == "deviation", shown
        distance = shown["arrays"]["distance"]
        known = distance[np.isfinite(distance)]
        assert len(distance) == len(v)
        assert len(known) == shown["vertices"] > 0.9 * len(v)
        assert np.abs(known).max() == pytest.approx(shown["worst"], abs=1e-6)
        assert shown["worst"] <= 0.0501
        assert np.sqrt(np.mean(known**2)) == pytest.approx(shown["rms"], rel=1e-4)
        refused = one.ask("show_deviation", scan=scan, reference="nothing")
        assert refused["kind"] == "refused"


def test_an_export_is_a_job_and_reads_back(server: Running) -> None:
    with Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        state = one.open(scan)
        started = http.post(f"/api/scans/{scan}/exports", json={"format": "dxf"})
        assert started.status_code == 202
        job = started.json()["job"]
        done = one.once("job", lambda m: m["job"] == job and m["state"] == "done")
        file = http.get(f"/api/downloads/{done['download']}")
        assert 'filename="ball.dxf"' in file.headers["content-disposition"]
        mesh = read_mesh(file.content, ".dxf")
        assert len(mesh.faces) == state["figures"]["faces"]
        started = http.post(f"/api/scans/{scan}/exports", json={"format": "step"}).json()["job"]
        done = one.once("job", lambda m: m["job"] == started and m["state"] == "done")
        solid = http.get(f"/api/downloads/{done['download']}").content
        assert "sphere" in [shape.kind for shape in read_step(solid, 0.1).shapes]
        assert http.post(f"/api/scans/{scan}/exports", json={"format": "exe"}).status_code == 400


def test_an_export_carries_the_same_provenance_as_the_command_line_writes(folder: Path) -> None:
    """Rig, parameters, and edits in words and by their hash; not source and version alone."""

    def remarks_of(data: bytes) -> list[str]:
        head = data[: data.index(b"end_header")].decode()
        return [line for line in head.splitlines() if line.startswith("comment")]

    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        faces = np.arange(10, 60, dtype="<u4")
        told = one.ask(
            "edit", {"faces": faces}, scan=scan, base_revision=0, edit={"kind": "delete"}
        )
        assert told["kind"] == "done"
        started = http.post(f"/api/scans/{scan}/exports", json={"format": "ply"}).json()["job"]
        done = one.once("job", lambda m: m["job"] == started and m["state"] == "done")
        exported = http.get(f"/api/downloads/{done['download']}").content
    reconstruct(folder / "ball.turnscan").save(folder / "part.ply")
    ours = remarks_of(exported)
    assert ours == remarks_of((folder / "part.ply").read_bytes())
    whole = " ".join(ours)
    for name in ("software", "source", "rig_sha256", "parameters", "edits", "edits_sha256"):
        assert name in whole


def test_only_the_operator_edits_and_control_can_be_taken(server: Running) -> None:
    with Browser(server) as one, Browser(server) as two:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        refused = two.ask("undo", scan=scan)
        assert (refused["kind"], refused["code"]) == ("refused", "not-operator")
        assert two.ask("take_control")["kind"] == "done"
        told = one.until("control", lambda m: m["operator"] == two.hello["client"])
        assert told["clients"] == 2
        assert one.ask("undo", scan=scan)["code"] == "not-operator"
        assert two.ask("undo", scan=scan)["text"] == "there is nothing to undo"
        assert one.ask("stop")["kind"] == "done"


def test_big_scans_make_room_for_each_other_and_their_memory_is_given_back(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("second", "third"):
        shutil.copy(folder / "ball.turnscan", folder / f"{name}.turnscan")
    with serving(folder) as server, Browser(server) as one:
        names = {s["name"]: s["scan"] for s in one.hello["scans"]}
        begin = one.open(names["ball"])
        faces = begin["figures"]["faces"]
        first = weakref.ref(server.workshop.opened(names["ball"]))
        monkeypatch.setattr(_workshop, "_OPEN_FACES", faces)
        one.open(names["second"])
        assert server.workshop.opened(names["ball"]) is first()
        one.open(names["third"])
        refused = one.ask("undo", scan=names["ball"])
        assert (refused["kind"], refused["code"]) == ("refused", "not-open")
        with server.http(one.cookie) as http:
            shut = http.get(f"/api/scans/{names['ball']}/mesh")
            assert (shut.status_code, shut.json()["code"]) == (400, "not-open")
            assert http.get("/api/scans/nothing/mesh").status_code == 404
        end = time.monotonic() + PATIENCE
        while first() is not None:  # its pictures may still be drawn
            assert time.monotonic() < end, "the document is still held"
            time.sleep(0.05)
        again = one.open(names["ball"])
        assert again["figures"]["faces"] == faces
        assert again["revision"] == begin["revision"]
        assert again["epoch"] != begin["epoch"], "a page would take its old mesh for this one"


def test_who_needs_the_file_waits_for_a_document_that_is_closed_to_make_room(
    tmp_path: Path,
) -> None:
    workshop, go = Workshop(Library(tmp_path)), threading.Event()
    document: Any = SimpleNamespace(
        now=SimpleNamespace(revision=0), close=lambda: go.wait(PATIENCE)
    )
    workshop._leaving["ball"] = document, threading.Event()
    closing = threading.Thread(target=workshop._put_back_leaving, args=("ball",))
    releasing = threading.Thread(target=workshop._release, args=("ball",))
    closing.start()
    releasing.start()
    releasing.join(0.2)
    assert releasing.is_alive(), "the document is still open, and writes"
    go.set()
    releasing.join(PATIENCE)
    assert not releasing.is_alive()
    closing.join(PATIENCE)
    workshop.close()


def test_a_page_that_is_loaded_anew_before_the_old_one_has_gone_is_the_operator(
    server: Running,
) -> None:
    with contextlib.ExitStack() as pages:
        old = pages.enter_context(Browser(server))
        pages.enter_context(Browser(server))  # of somebody else, who has to ask for it
        new = pages.enter_context(Browser(server, old.cookie))
        assert new.hello["operator"] == old.hello["client"]
        old.__exit__()
        new.until("control", lambda m: m["operator"] == new.hello["client"])
        new.__exit__()
        with Browser(server) as third:
            third.until("control", lambda m: m["operator"] == third.hello["client"])


def test_a_page_that_was_there_before_is_not_made_the_operator(server: Running) -> None:
    with Browser(server) as one:
        scan = one.hello["scans"][0]["scan"]
        with Browser(server, one.cookie) as before:
            one.open(scan)
            one.__exit__()
            before.until("control", lambda m: m["operator"] is None)


def test_a_page_that_is_lost_is_not_made_the_operator() -> None:
    hub = Hub()
    old, new, dropped = (Client(remote=False, browser="one") for _ in range(3))
    for client in (old, new, dropped):
        assert hub.join(client)
    dropped.drop()
    hub.leave(old)
    assert hub.operator is new
    new.drop()
    hub.take(dropped)
    hub.leave(dropped)
    assert hub.operator is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"solid nothing\n", "not a scan file"),
        (b"SQLite format 3\0" + bytes(84), "not a scan file"),
        (None, "damaged"),
    ],
)
def test_an_upload_that_is_no_scan_is_refused_and_leaves_nothing(
    server: Running, folder: Path, scan_bytes: bytes, content: bytes | None, said: str
) -> None:
    body = scan_bytes[: len(scan_bytes) // 2] if content is None else content
    with server.http() as http:
        answer = http.post("/api/scans?name=other", content=body)
    assert answer.status_code in (400, 409), answer.text
    assert "other.turnscan" in answer.json()["text"]
    assert str(folder) not in answer.text
    assert [p.name for p in folder.iterdir()] == ["ball.turnscan"]


def test_an_upload_that_is_cut_off_leaves_nothing(server: Running, folder: Path) -> None:
    cookie = server.login()
    head = (
        f"POST /api/scans?name=part HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Origin: {server.base}\r\nX-Turnscan: 1\r\nCookie: {cookie}\r\n"
        "Content-Length: 100000\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port)) as link:
        link.sendall(head.encode() + bytes(50000))
        until = time.monotonic() + PATIENCE
        while len(list(folder.iterdir())) < 2 and time.monotonic() < until:
            time.sleep(0.01)
        assert len(list(folder.iterdir())) == 2
    while len(list(folder.iterdir())) > 1 and time.monotonic() < until:
        time.sleep(0.01)
    assert [p.name for p in folder.iterdir()] == ["ball.turnscan"]


def test_an_upload_is_listed_and_opens(server: Running, scan_bytes: bytes) -> None:
    with Browser(server) as one, server.http(one.cookie) as http:
        added = http.post("/api/scans?name=../other.turnscan", content=scan_bytes)
        assert added.status_code == 201
        listed = one.until("scans", lambda m: len(m["scans"]) == 2)
        names = {e["name"] for e in listed["scans"]}
        assert names == {"ball", "_other"}
        assert one.open(added.json()["scan"])["figures"]["faces"] > 500
        again = http.post("/api/scans?name=_other", content=scan_bytes)
        assert "already exists" in again.json()["text"]


def test_a_scan_with_the_simulated_bench(server: Running, folder: Path) -> None:
    device = "sim:sphere?seed=3&speckle=no"
    with Browser(server) as one:
        assert one.ask("scan", plan={"name": "x"})["text"] == "no devices are connected"
        found = one.ask("find_devices")
        assert any(d["address"].startswith("sim:") for d in found["devices"])
        bad = one.ask(
            "connect", camera="sim:no-such", turntable="sim:no-such", lasers="sim:no-such"
        )
        assert bad["kind"] == "refused"
        connected = one.ask("connect", camera=device, turntable=device, lasers=device)
        assert connected["kind"] == "done", connected
        told = next(m for m in reversed(one.heard) if m["kind"] == "devices")
        laser = told["lasers"][0]
        assert laser["lit"] is False
        assert told["rig"]
        assert one.ask("look", on=True, lit=[laser["name"]], seconds=0.04)["kind"] == "done"
        seen = one.until("frame", lambda m: m["number"] >= 2)
        assert bytes(seen["arrays"]["jpeg"][:2]) == b"\xff\xd8"
        assert np.isfinite(seen["arrays"]["stripe"]).sum() > 20
        assert one.ask("look", on=False)["kind"] == "done"
        assert one.ask("turn", angle_deg=90.0)["kind"] == "done"
        one.once("devices", lambda m: m["angle_deg"] == pytest.approx(90.0))
        plan = {"name": "new", "steps": 8, "lasers": [laser["name"]]}
        assert one.ask("scan", plan=plan)["kind"] == "started"
        assert one.ask("scan", plan={"name": "other"})["text"].startswith("a scan is running")
        one.once("scanning", lambda m: m["state"] == "complete")
        done = one.once("job", lambda m: m["state"] == "done")
        assert done["text"] == "new: 8 frames taken; whole"
        grown = [m for m in one.heard if m["kind"] == "points"]
        assert {m["step"] for m in grown} == set(range(8))
        points = np.concatenate([m["arrays"]["points"] for m in grown])
        with Scan.open(folder / "new.turnscan") as scan:
            assert scan.complete
        radius = np.linalg.norm(points - points.mean(axis=0), axis=1)
        assert radius.std() < 0.2 * radius.mean()
        assert any(m["kind"] == "frame" and m["step"] is not None for m in one.heard)


def test_a_scan_pauses_goes_on_and_is_aborted(server: Running) -> None:
    device = "sim:sphere?seed=3&speckle=no"
    with Browser(server) as one:
        one.ask("connect", camera=device, turntable=device, lasers=device)
        assert one.ask("pause")["text"] == "no scan is running"
        one.ask("scan", plan={"name": "long", "steps": 300})
        one.once("scanning", lambda m: m["done"] >= 2)
        assert one.ask("pause")["kind"] == "done"
        one.once("scanning", lambda m: m["state"] == "paused")
        assert one.ask("go_on")["kind"] == "done"
        one.until("scanning", lambda m: m["state"] == "running")
        assert one.ask("stop")["kind"] == "done"
        one.once("scanning", lambda m: m["state"] == "aborted")
        done = one.once("job", lambda m: m["state"] == "done")
        assert done["text"].endswith("missing frames can be taken later")
        told = next(m for m in reversed(one.heard) if m["kind"] == "devices")
        assert all(laser["lit"] is False for laser in told["lasers"])


def test_an_interrupted_scan_is_listed_and_taken_to_its_end(server: Running, folder: Path) -> None:
    device = "sim:sphere?seed=3&speckle=no"
    with Browser(server) as one:
        one.ask("connect", camera=device, turntable=device, lasers=device)
        plan = {"name": "broken", "steps": 6, "texture": 0.5, "texture_every": 3}
        one.ask("scan", plan=plan)
        one.once("scanning", lambda m: m["done"] >= 2)
        one.ask("abort")
        one.once("scanning", lambda m: m["state"] == "aborted")
        listed = one.until("scans", lambda m: any(s["missing"] for s in m["scans"]))
        entry = next(s for s in listed["scans"] if s["name"] == "broken")
        assert 1 <= entry["missing"] <= 4
        assert next(s for s in listed["scans"] if s["name"] == "ball")["missing"] == 0
        one.open(entry["scan"])  # a document that is open does not stand in the way
        job = one.ask("resume", scan=entry["scan"])["job"]
        done = one.once("job", lambda m: m["job"] == job and m["state"] in ("done", "failed"))
        assert done["text"] == f"broken: {entry['missing']} frames taken; whole"
        told = [m for m in one.heard if m["kind"] == "scanning"][-1]
        assert (told["state"], told["done"], told["total"]) == (
            "complete", entry["missing"], entry["missing"],
        )  # fmt: skip
        listed = one.once("scans", lambda m: all(not s["missing"] for s in m["scans"][-2:]))
        with Scan.open(folder / "broken.turnscan") as scan:
            assert scan.complete
            assert [scan.has_texture(k) for k in range(6)] == [True, False, False] * 2
            scan.texture(3)
        again = one.ask("resume", scan=entry["scan"])["job"]
        done = one.once("job", lambda m: m["job"] == again and m["state"] in ("done", "failed"))
        assert done["text"] == "broken: 0 frames taken; whole"
        ball = next(s["scan"] for s in listed["scans"] if s["name"] == "ball")
        failed = one.ask("resume", scan=ball)["job"]
        why = one.once("job", lambda m: m["job"] == failed and m["state"] == "failed")
        assert "cannot be resumed" in why["text"]


def test_the_doctor_is_a_job_with_findings(server: Running) -> None:
    device = "sim:sphere?seed=3&speckle=no"
    with Browser(server) as one:
        one.ask("connect", camera=device, turntable=device, lasers=device)
        assert one.ask("doctor", still=True)["kind"] == "started"
        done = one.once("job", lambda m: m["state"] != "running")
        assert done["state"] == "done"
        verdict, step = done["text"].splitlines()
        worst = {f["severity"] for f in done["findings"]} - {"note"}
        assert (verdict == "verdict: ready for a scan") == (not worst)
        assert worst or step == "next step: scan the part"


def test_a_remark_names_settings_and_no_flags() -> None:
    told = remarks(
        [
            Finding("a", "note", "points went", "", Remedy("keep them with ", Option("edge", 0))),
            Finding("b", "warning", "a hole", "", "scan again"),
        ],
        str,
    )
    assert [r.remedy for r in told] == ["keep them with “edge 0”", "scan again"]
