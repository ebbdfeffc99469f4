"""``turnscan join``: two poses in scan files → one surface, or one clear line."""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.poses.scenes import STANDS, grid, write_scan
from tests.texture.painted import paint
from turnscan.cli import turnscan
from turnscan.errors import InputError
from turnscan.formats import read_mesh
from turnscan.mesh import join as as_one
from turnscan.scan import Scan
from turnscan.surface.fusion import range_surfaces
from turnscan.texture import NEUTRAL
from turnscan.workflows import ReconstructOptions
from turnscan.workflows._files._kept_options import keep_options

NAMES = {"up": "knob", "down": "knob lying"}
PICKS = np.array([[26.0, 12, 20], [-20, 14, 40], [0, -16, 5], [14, 8, 55]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two poses, and points that a person picked in both to a millimetre."""
    there = tmp_path_factory.mktemp("poses")
    rng = np.random.default_rng(0)
    rows = ["point,pose,x,y,z"]
    for seed, (file, name) in enumerate(NAMES.items()):
        write_scan(there / f"{file}.turnscan", name, seed)
        surface = as_one([s.mesh for s in range_surfaces(grid(name, seed))])
        paint(there / f"{file}.turnscan", surface, partial(shade, name), 10, 1.25**seed)
        for k, x in enumerate(STANDS[name].apply(PICKS) + rng.normal(0, 0.6, PICKS.shape)):
            rows.append(f"p{k},{file}," + ",".join(f"{v:.2f}" for v in x))
    with Scan.resume(there / "up.turnscan") as up:
        keep_options(up, ReconstructOptions(edge=2))
    (there / "picks.csv").write_text("\n".join(rows))
    return there


def shade(name, points):
    """Grey levels: the part darkens from its foot upwards, however it stands."""
    return 190.0 - 2.5 * STANDS[name].inverse().apply(points)[:, 2]


def join(folder, *words):
    return CliRunner().invoke(
        turnscan, ["join", *(str(folder / w) if "." in w and w[0] != "-" else w for w in words)]
    )


def test_two_scan_files_become_one_surface_of_the_whole_part(folder):
    done = join(
        folder, "up.turnscan", "down.turnscan", "--points", "picks.csv", "-o", "part.stl",
        "-o", "part.ply", "--report", "part.json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    told = json.loads((folder / "part.json").read_text())
    assert told["source"] == "up.turnscan + down.turnscan"
    assert set(told["rig_sha256"]) == {"up", "down"}
    assert told["settings"] == {"joined": {}, "poses": {"up": {"edge": 2}, "down": {}}}
    assert "with the settings of its scan: edge 2" in done.stderr
    (overlap,) = told["overlaps"]
    assert (overlap["first"], overlap["second"]) == ("up", "down")
    assert 0.02 < overlap["rms"] < 0.25
    assert told["poses"][1]["free"] == []
    assert 0 < told["poses"][1]["sigma_shift_mm"] < 0.05
    mesh = read_mesh((folder / "part.stl").read_bytes(), ".stl")
    low, high = mesh.bounds
    # The foot is only in the lying pose, and the platter in neither.
    # Single vertices at an open border stand off by up to half a voxel of 1.22 mm.
    assert low[2] == pytest.approx(0.0, abs=0.61)
    assert (mesh.vertices[:, 2] < -0.3).sum() <= 3
    assert high[2] == pytest.approx(55.0, abs=0.3)
    foot = mesh.vertices[np.abs(mesh.vertices[:, 2]) < 0.3]
    assert len(foot) > 50
    assert np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).max() < 35.0
    # The pictures of the second pose are a quarter brighter: levelled, and blended without a seam.
    part = read_mesh((folder / "part.ply").read_bytes(), ".ply")
    seen = (part.colour != NEUTRAL).any(axis=1)
    assert seen.mean() > 0.9
    ratio = part.colour[seen, 0] / shade("knob", part.vertices[seen])
    assert np.median(ratio) == pytest.approx(np.sqrt(1.25), abs=0.06), "between both exposures"
    assert np.quantile(np.abs(ratio / np.median(ratio) - 1), 0.9) < 0.05


def test_a_largest_sigma_that_a_pose_keeps_holds_for_the_joined_surface(folder, tmp_path):
    files = [Path(shutil.copy(folder / f"{name}.turnscan", tmp_path)) for name in NAMES]
    usual = ts.join(files, points=folder / "picks.csv")
    # A surface is known better than its points, and poses find each other by these.
    limit = float(np.quantile(usual.points["sigma"], 0.8))
    with Scan.resume(files[1]) as down:
        keep_options(down, ReconstructOptions(largest_sigma=limit))
    kept = ts.join(files, points=folder / "picks.csv")
    assert kept.mesh.provenance.sigma.max() <= limit
    assert kept.options.largest_sigma == limit
    assert {h.cause for h in kept.holes} == {None, "removed"}
    assert {h.cause for h in usual.holes} == {None}
    assert 0.5 < len(kept.mesh.vertices) / len(usual.mesh.vertices) < 0.85
    assert kept.points["sigma"].max() <= limit < usual.points["sigma"].max()


BAD = {
    "one": (["up.turnscan"], "only one pose; at least two are needed → give two or more"),
    "twice": (["up.turnscan", "up.turnscan"], "up.turnscan: given twice"),
    "copy": (["up.turnscan", "copy.turnscan"], "up and copy: the same scan is given twice"),
    "conf": (["up.turnscan", "x.conf"], "x.conf: a .conf must be the only source"),
    "few": (["up.turnscan", "down.turnscan", "--points", "few.csv"], "down: 2 points known"),
    "line": (["up.turnscan", "down.turnscan", "--points", "line.json"], "lie on one line"),
    "word": (["up.turnscan", "down.turnscan", "--points", "word.csv"], "word.csv, line 1: ['1'"),
    "wrong": (
        ["up.turnscan", "down.turnscan", "--points", "wrong.json"],
        "lies on the other poses, at least 10% must",
    ),
    "balls": (["up.turnscan", "down.turnscan", "--markers", "18"], "marker spheres seen"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_line_and_nothing_is_written(folder, case):
    shutil.copy(folder / "up.turnscan", folder / "copy.turnscan")
    rows = (folder / "picks.csv").read_text().splitlines()
    (folder / "few.csv").write_text("\n".join(r for r in rows if r[:2] in ("p0", "p1")))
    line = {f"p{k}": {n: [k * 10.0, 0, 0] for n in NAMES} for k in range(4)}
    (folder / "line.json").write_text(json.dumps(line))
    (folder / "word.csv").write_text("p0,up,1,2,x")
    off = {f"p{k}": {"up": x.tolist(), "down": (x + 200).tolist()} for k, x in enumerate(PICKS)}
    (folder / "wrong.json").write_text(json.dumps(off))
    words, text = BAD[case]
    done = join(folder, *words, "-o", "bad.stl")
    assert isinstance(done.exception, InputError)
    assert text in str(done.exception)
    assert "\n" not in str(done.exception)
    assert not (folder / "bad.stl").exists()
