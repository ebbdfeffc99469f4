"""Verbs with files, as a browser calls them: sent, run as a job, found in the folder."""

from __future__ import annotations

import io
import json
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from PIL import Image as Pillow

from tests.web.running import Browser, Message, serving
from tests.web.uploads import box, zipped
from turnscan.app._envelope import unpack
from turnscan.formats import export, read_mesh
from turnscan.scan import Scan
from turnscan.workflows import VERBS, Incoming

SIZE = (40, 60)


def picture(k: int) -> bytes:
    """One of a series in which a stripe moves."""
    u = np.arange(SIZE[1])
    noise = np.random.default_rng(k).normal(0, 0.8, SIZE)
    seen = 30 + 150 * np.exp(-((u - 12 - 6 * k) ** 2) / 4) + noise
    out = io.BytesIO()
    Pillow.fromarray(seen.clip(0, 255).astype(np.uint8)).save(out, "png")
    return out.getvalue()


def range_scan(shift: float) -> bytes:
    """A part of a hilly ground, as another scanner writes it, in metres."""
    x, y = np.meshgrid(np.arange(40) + shift, np.arange(30), indexing="ij")
    z = 3 * np.sin(x / 5) * np.cos(y / 4) + 0.05 * x
    points = np.stack([x, y, z], -1).reshape(-1, 3) / 1000
    head = ["ply", "format ascii 1.0", "obj_info num_cols 30", "obj_info num_rows 40"]
    head += [f"element vertex {len(points)}", *(f"property float {c}" for c in "xyz")]
    head += [f"element range_grid {len(points)}", "property list uchar int vertex_indices"]
    rows = [" ".join(f"{v:.7f}" for v in p) for p in points]
    rows += [f"1 {k}" for k in range(len(points))]
    return "\n".join([*head, "end_header", *rows, ""]).encode()


class Desk:
    """A browser at a server: sends files and runs verbs."""

    def __init__(self, browser: Browser, http: httpx.Client) -> None:
        self.browser, self.http = browser, http

    def send(self, name: str, data: bytes, into: str = "") -> httpx.Response:
        return self.http.post("/api/files", params={"name": name, "into": into}, content=data)

    def sent(self, name: str, data: bytes) -> list[str]:
        answer = self.send(name, data)
        assert answer.status_code == 201, answer.text
        files: list[str] = answer.json()["files"]
        return files

    def ask(self, verb: str, name: str = "result", **values: Any) -> Message:
        """The answer to a request, or how its job ended."""
        answer = self.browser.ask("run_verb", verb=verb, name=name, values=values)
        if answer["kind"] == "refused":
            return answer
        assert answer["kind"] == "started", answer
        job = answer["job"]

        def ended(message: Message) -> bool:
            return message["job"] == job and message["state"] != "running"

        before = (m for m in self.browser.heard if m["kind"] == "job" and ended(m))
        return next(before, None) or self.browser.until("job", ended)

    def done(self, verb: str, name: str = "result", **values: Any) -> Message:
        ended = self.ask(verb, name, **values)
        assert ended.get("state") == "done", ended.get("text", ended)
        return ended

    def content(self, file: Message) -> bytes:
        answer = self.http.get(f"/api/files/{file['file']}")
        assert answer.status_code == 200
        assert file["name"] in answer.headers["content-disposition"]
        return answer.content


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("library")


@pytest.fixture(scope="module")
def desk(place: Path) -> Iterator[Desk]:
    with (
        serving(place) as server,
        Browser(server) as browser,
        server.http(browser.cookie) as http,
    ):
        yield Desk(browser, http)


def names(files: list[Message]) -> set[str]:
    return {f["name"] for f in files}


def test_every_verb_comes_with_its_schema(desk: Desk) -> None:
    told = desk.browser.ask("list_verbs")["verbs"]
    assert [v["verb"] for v in told] == list(VERBS)
    for verb in told:
        assert verb["json_schema"] == VERBS[verb["verb"]].json_schema()


def test_pictures_are_looked_at_before_they_are_imported(desk: Desk, place: Path) -> None:
    kept = [0, 1, 2, 4, 5]  # 3 was never taken, and 4 was stored twice
    files = {f"gaps/s{k}.png": picture(k) for k in kept}
    files["gaps/s5.png"] = files["gaps/s4.png"]
    (pictures,) = desk.sent("gaps.zip", zipped(files))
    before = set(place.iterdir())
    values = {"pictures": [pictures], "laser": "L0", "angles": ""}
    seen = desk.browser.ask("preview_import", values=values, picture=1)
    assert seen["kind"] == "import_preview", seen
    (series,) = seen["series"]
    assert (series["laser"], series["steps"], series["missing"]) == ("L0", kept, [3])
    assert series["pictures"] == [f"s{k}.png" for k in kept]
    assert seen["weights"] is None
    (same,) = (f for f in seen["findings"] if f["code"] == "scan.same-picture")
    assert same["where"] == "s5.png"
    assert (seen["step"], seen["width"], seen["height"]) == (1, SIZE[1], SIZE[0])
    stripe = seen["arrays"]["stripe"]
    assert len(stripe) == SIZE[0]
    np.testing.assert_allclose(stripe, 18.0, atol=0.2)
    other = desk.browser.ask("preview_import", values=values, laser="L0", picture=2)
    np.testing.assert_allclose(other["arrays"]["stripe"], 24.0, atol=0.2)
    beyond = desk.browser.ask("preview_import", values=values, laser="L0", picture=5)
    assert "no picture 5" in beyond["text"]
    none = desk.browser.ask("preview_import", values={"pictures": []})
    assert none["options"][0]["name"] == "pictures"
    assert set(place.iterdir()) == before


def test_a_zip_of_pictures_becomes_a_scan(desk: Desk, place: Path) -> None:
    (pictures,) = desk.sent("turn.zip", zipped({f"turn/s{k}.png": picture(k) for k in range(6)}))
    listed = {f["file"]: f for f in desk.browser.ask("list_files")["files"]}
    entry = listed[pictures]
    assert (entry["kinds"], entry["pictures"], entry["name"]) == (["pictures"], 6, "turn")
    assert entry["takers"] == ["import", "calibrate"]
    missing = desk.ask("import", pictures=[pictures])
    assert missing["options"][0]["name"] == "angles"
    for words in ("60 degrees", "/etc/hostname", "../secret.csv"):
        wrong = desk.ask("import", pictures=[pictures], angles=words)
        assert wrong["state"] == "failed"
        assert wrong["options"][0] == {"name": "angles", "value": words}
        assert wrong["hint"]
    assert not list(place.glob("*.turnscan"))
    done = desk.done("import", "part", pictures=[pictures], angles="step:60", threshold=254.0)
    assert [(f["name"], f["scan"]) for f in done["files"]] == [("part.turnscan", True)]
    assert "6 frames, 6 steps" in done["text"]
    assert str(place) not in json.dumps(done)
    assert "incoming" not in json.dumps(done)
    with Scan.open(place / "part.turnscan") as scan:
        assert len(scan) == 6
    scans = desk.browser.once("scans", lambda m: bool(m["scans"]))["scans"]
    assert [s["scan"] for s in scans] == [done["files"][0]["file"]]
    (finding,) = [f for f in done["findings"] if f["code"] == "scan.no-stripe"]
    assert [o["name"] for o in finding["options"]] == ["dark", "threshold"]
    again = desk.ask("import", "part", pictures=[pictures], angles="step:60")
    assert (again["kind"], again["options"]) == ("refused", [{"name": "name", "value": None}])
    rows = "\n".join(f"{60 * k}" for k in range(6)).encode()
    desk.sent("angles.csv", rows)
    listed_angles = desk.done("import", "other", pictures=[pictures], angles="angles.csv")
    assert "0.00° … 300.00°" in listed_angles["text"]


def test_a_video_without_a_line_says_so_and_no_paths(
    desk: Desk, place: Path, tmp_path: Path
) -> None:
    size = (160, 120)
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 15, size)
    rng = np.random.default_rng(3)
    room = cv2.GaussianBlur(rng.integers(20, 160, (*size[::-1], 3), dtype=np.uint8), (0, 0), 9)
    for k in range(20):
        video.write(np.roll(room, k, 1) + rng.integers(0, 8, room.shape, dtype=np.uint8))
    video.release()
    (sent,) = desk.sent("walk.avi", (tmp_path / "v.avi").read_bytes())
    done = desk.done("import", "walk", pictures=[sent], angles="step:18")
    lossy, none = (f for f in done["findings"] if f["code"] in ("scan.video", "scan.no-stripe"))
    assert lossy["where"] == "walk.avi"
    assert "no line is seen" in none["text"]
    assert str(place) not in json.dumps(done)
    assert "incoming" not in json.dumps(done)


def test_an_empty_file_is_refused_and_not_kept(desk: Desk) -> None:
    refused = desk.send("part.stl", b"")
    assert (refused.status_code, "an empty file" in refused.text) == (400, True)
    assert not [f for f in desk.browser.ask("list_files")["files"] if f["name"] == "part.stl"]


def test_single_pictures_are_one_set_and_folders_are_lasers(desk: Desk) -> None:
    answer = desk.send("s0.png", picture(0)).json()
    for k in range(1, 4):
        answer = desk.send(f"s{k}.png", picture(k), answer["into"]).json()
    assert len(answer["files"]) == 1
    twice = desk.send("s1.png", picture(1), answer["into"])
    assert (twice.status_code, "sent already" in twice.text) == (400, True)
    two = {f"{side}/s{k}.png": picture(k) for side in ("left", "right") for k in range(6)}
    both = desk.sent("two.zip", zipped(two))
    assert len(both) == 2
    done = desk.done("import", "both lasers", pictures=both, angles="step:10")
    assert "6 steps × left, right" in done["text"]


def test_range_scans_become_a_surface_and_poses_are_joined(desk: Desk) -> None:
    conf = "bmesh a.ply 0 0 0 0 0 0 1\nbmesh b.ply 0 0 0 0 0 0 1\n"
    files = {"a.ply": range_scan(0.0), "b.ply": range_scan(8.0), "hills.conf": conf.encode()}
    sent = desk.sent("hills.zip", zipped(files))
    kinds = {f["file"]: f["kinds"] for f in desk.browser.ask("list_files")["files"]}
    assert sorted(kinds[f][0] for f in sent) == ["placement", "range-scan", "range-scan"]
    (placed,) = [f for f in sent if kinds[f] == ["placement"]]
    done = desk.done("range-scans", "hills", source=placed, outputs=[".ply", ".stl"],
                     report=[".json"], decimate="400")  # fmt: skip
    assert names(done["files"]) == {"hills.ply", "hills.stl", "hills-report.json"}
    report = next(f for f in done["files"] if f["name"].endswith(".json"))
    assert json.loads(desk.content(report))["source"] == "hills.conf"
    joined = desk.done("join", "joined", sources=[placed], outputs=[".stl"])
    assert names(joined["files"]) == {"joined.stl"}
    _, overlaps = joined["tables"]
    assert (overlaps["title"], overlaps["head"][2]) == ("Overlaps", "places")
    assert int(overlaps["rows"][0][2]) > 100
    (surface,) = joined["files"]
    answer = desk.http.get(f"/api/files/{surface['file']}/mesh")
    assert answer.status_code == 200
    _, arrays = unpack(answer.content)
    np.testing.assert_array_equal(
        arrays["faces"], read_mesh(desk.content(surface), ".stl").faces.astype(np.uint32)
    )
    table = next(f for f in done["files"] if f["name"].endswith(".json"))
    assert desk.http.get(f"/api/files/{table['file']}/mesh").status_code == 400
    assert desk.http.get("/api/files/nothing/mesh").status_code == 400
    alone = desk.ask("join", "alone", sources=[f for f in sent if f != placed][:1])
    assert "only one pose" in alone["text"]


def test_meshes_are_compared_cut_checked_measured_and_converted(desk: Desk, place: Path) -> None:
    (one,) = desk.sent("one.stl", export(box(10.0), ".stl"))
    (two,) = desk.sent("two.stl", export(box(10.1), ".stl"))
    done = desk.done("compare", "apart", measured=one, reference=two, tolerances=[0.2],
                     figures=[".json"])  # fmt: skip
    assert names(done["files"]) == {"apart-picture.png", "apart-figures.json"}
    figures = json.loads((place / "apart-figures.json").read_text())
    assert figures["max_mm"] == pytest.approx(0.1, abs=1e-5)
    assert "within 0.2 mm: precision 100.00%" in done["text"]
    (agreement,) = done["tables"]
    assert agreement["rows"][0][:2] == ["0.2", "100.00%"]
    cut = desk.done("section", "cut", part=one, plane=["z=5"], outputs=[".dxf", ".svg"])
    assert names(cut["files"]) == {"cut.dxf", "cut.svg"}
    assert b"SECTION" in desk.content(cut["files"][0])
    sound = desk.done("check", "checked", file=one, figures=[".json"])
    assert "sound: closed" in sound["text"]
    assert json.loads((place / "checked-figures.json").read_text())["faces"] == 12
    measured = desk.done("measure", "measured", file=one, planes=True)
    assert "10.000" in measured["text"]
    assert names(desk.done("export", "same", source=one, outputs=[".obj"])["files"]) == {"same.obj"}


def test_a_value_that_cannot_be_is_refused_at_its_field(desk: Desk) -> None:
    (one,) = desk.sent("one.stl", export(box(), ".stl"))
    (table,) = desk.sent("table.csv", b"1\n")
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("compare", {"measured": one}, "reference"),
        ("compare", {"measured": one, "reference": table}, "reference"),
        ("compare", {"measured": one, "reference": "../../etc/passwd"}, "reference"),
        ("compare", {"measured": one, "reference": 7}, "reference"),
        ("compare", {"measured": one, "reference": one, "samples": 1}, "samples"),
        ("compare", {"measured": one, "reference": one, "tolerances": ["x"]}, "tolerances"),
        ("compare", {"measured": one, "reference": one, "picture": [".exe"]}, "picture"),
        ("section", {"part": one, "plane": ["z=5"], "outputs": []}, "outputs"),
        ("section", {"part": one, "plane": ["q=5"]}, "plane"),
        ("section", {"part": one}, "plane"),
        ("join", {"sources": [], "outputs": [".stl"]}, "sources"),
    ]
    for verb, values, option in cases:
        said = desk.ask(verb, f"bad {verb}", **values)
        assert said["kind"] == "refused" or said["state"] == "failed", said
        assert said["options"][0]["name"] == option, said
        assert said["text"]
    extra = desk.ask("check", file=one, path="/etc/passwd")
    assert "has no value 'path'" in extra["text"]
    assert "no such verb" in desk.ask("format-disk")["text"]


def _link(name: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        info = zipfile.ZipInfo(name)
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "/etc/passwd")
    return out.getvalue()


BROKEN = zipped({"a.png": picture(0)})
WRONG = {
    "outside": ("x.zip", zipped({"../../out.png": picture(0), "b.png": b"x"}), "leads out of"),
    "absolute": ("x.zip", zipped({"/tmp/out.png": picture(0)}), "leads out of"),
    "windows": ("x.zip", zipped({"a\\..\\..\\out.png": picture(0)}), "leads out of"),
    "link": ("x.zip", _link("a.png"), "leads out of"),
    "broken": ("x.zip", BROKEN[: len(BROKEN) // 2], "not a sound zip"),
    "flipped": ("x.zip", BROKEN.replace(b"IDAT", b"IDBT"), "not a sound zip"),
    "no zip": ("x.zip", b"hello", "not a sound zip"),
    "empty": ("x.zip", zipped({}), "empty archive"),
    "bomb": ("x.zip", zipped({"a.png": bytes(4 << 20)}), ""),
    "text": ("notes.txt", b"hello", "neither pictures nor"),
    "no suffix": ("notes", b"hello", "suffix"),
    "path": ("../../part.stl", b"solid", "plain file name"),
    "backslash": ("..\\part.stl", b"solid", "plain file name"),
    "scan": ("part.turnscan", b"no scan", "list of scans"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_sent_stays_in_its_place(case: str, desk: Desk, place: Path) -> None:
    name, data, words = WRONG[case]
    before = set(place.parent.rglob("*.png"))
    listed = len(desk.browser.ask("list_files")["files"])
    answer = desk.send(name, data)
    if words:
        assert answer.status_code in (400, 413), answer.text
        assert words in answer.json()["text"]
        assert answer.json()["hint"]
        assert len(desk.browser.ask("list_files")["files"]) == listed
        assert set(place.parent.rglob("*.png")) == before
    else:  # zeros shrink as far as DEFLATE can: no limit is met, and it is no picture
        assert answer.status_code == 201
        failed = desk.ask("import", pictures=answer.json()["files"], angles="step:1")
        assert failed["state"] == "failed"
    assert desk.send("a.stl", b"x", into="nothing").status_code == 400


def test_files_are_found_by_given_names_only(desk: Desk, place: Path) -> None:
    (place.parent / "secret.stl").write_bytes(export(box(), ".stl"))
    (place / "link.stl").symlink_to(place.parent / "secret.stl")
    (place / "mine.stl").write_bytes(export(box(), ".stl"))
    listed = {f["name"]: f["file"] for f in desk.browser.ask("list_files")["files"]}
    assert "mine.stl" in listed
    assert "link.stl" not in listed
    assert desk.http.get(f"/api/files/{listed['mine.stl']}").status_code == 200
    for path in ("mine.stl", "..%2Fsecret.stl", "%2Fetc%2Fpasswd", "abcdefghijkl"):
        assert desk.http.get(f"/api/files/{path}").status_code == 404


def test_what_was_sent_goes_with_the_server_and_with_the_next_one(tmp_path: Path) -> None:
    left = tmp_path / ".turnscan-incoming-dead"
    left.mkdir()
    (left / ".lock").touch()
    other = Incoming(tmp_path)
    assert not left.exists()
    with serving(tmp_path) as server, Browser(server) as browser, server.http() as http:
        Desk(browser, http).sent("one.stl", b"solid")
        assert len(list(tmp_path.glob(".turnscan-incoming-*"))) == 2
    assert list(tmp_path.glob(".turnscan-incoming-*")) == [other.folder]
    other.close()
    assert not any(tmp_path.iterdir())


def test_who_watches_runs_nothing(folder: Path) -> None:
    with serving(folder) as server, Browser(server) as _operator, Browser(server) as other:
        scan = other.hello["scans"][0]["scan"]
        refused = other.ask("run_verb", verb="check", name="x", values={"file": scan})
        assert (refused["kind"], refused["code"]) == ("refused", "not-operator")
