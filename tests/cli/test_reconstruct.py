"""turnscan reconstruct and turnscan measure, as a person uses them."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.analytic import cylinder, full_turn, make_rig, scan_shape
from tests.points.range_scans import cyberware
from turnscan.cli import turnscan
from turnscan.errors import ExportError, InputError
from turnscan.formats import read_dxf_content, read_mesh
from turnscan.rig import rig_to_json
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.surface.holes import explain, holes

STEPS = 24


def run(*words, fails=None):
    result = CliRunner().invoke(turnscan, [str(w) for w in words])
    if fails is None:
        assert result.exit_code == 0, result.output + repr(result.exception)
    return result


@pytest.fixture(scope="module")
def only_scan(tmp_path_factory):
    path = tmp_path_factory.mktemp("scan") / "can.turnscan"
    rig = make_rig(elevation=0.1, lift=20.0)
    u, noise = np.arange(320), np.random.default_rng(0)
    with Scan.create(path, ScanPlan(320, 240, "uint8", 1, ("L0",), STEPS, 12.0), rig) as scan:
        for k, s in enumerate(scan_shape(rig, cylinder(25, 0, 40), full_turn(STEPS))):
            at = np.nan_to_num(s.position, nan=-1e3)[:, None]
            lit = (
                10
                + 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)
                + 0.4 * noise.normal(size=(240, 320))
            )
            lit = np.rint(lit).astype(np.uint8)
            dark = np.full((240, 320), 10, np.uint8)
            scan.add(Frame(k, "L0", lit, dark, commanded=float(full_turn(STEPS)[k])))
    return path


@pytest.fixture
def scan_path(only_scan, tmp_path_factory):
    """A copy of its own, for a scan file keeps the settings of its last reconstruction."""
    return shutil.copy(only_scan, tmp_path_factory.mktemp("own") / only_scan.name)


def test_a_scan_becomes_files_that_agree(scan_path, tmp_path):
    out = [tmp_path / f"can.{s}" for s in ("ply", "stl", "dxf")]
    report = tmp_path / "report.json"
    words = [w for p in out for w in ("-o", p)]
    result = run(
        "reconstruct", scan_path, *words, "--close", "--report", report,
        "--dxf-form", "3dface", "--dxf-form", "profiles",
    )  # fmt: skip
    volumes = [read_mesh(p.read_bytes(), p.suffix).volume for p in out]
    polygon = STEPS / 2 * 25**2 * np.sin(2 * np.pi / STEPS) * 40
    assert volumes[0] == pytest.approx(polygon, rel=0.02)
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-5)
    assert volumes[2] == pytest.approx(volumes[0], rel=1e-6)
    assert b"POLYLINE" in out[2].read_bytes()
    body = json.loads(report.read_text())
    assert body["closed"] is True
    assert body["volume_mm3"] == pytest.approx(volumes[0], rel=1e-9)
    assert 0 < body["volume_sigma_mm3"] < 0.1 * volumes[0], "what is beyond the rim may bulge"
    lost = np.pi * 25**2 * 40 - polygon
    assert body["volume_measured_sigma_mm3"] == pytest.approx(lost, rel=0.3), (
        "what chords leave out"
    )
    assert body["lasers"][0]["profiles"] == STEPS
    assert f" ± {body['volume_sigma_mm3']:.3g} mm³" in result.stdout
    assert "surface.caps" in result.stderr
    measured = json.loads(run("measure", out[0], "--cylinder", "--json").stdout)
    assert measured["closed"] is True
    for key in (k for k in body if k.startswith("volume")):
        assert measured[key] == pytest.approx(body[key], rel=1e-12), "the same from both"


def test_profiles_are_spaced_points_denoised_and_faces_thinned(scan_path, tmp_path):
    ply, report = tmp_path / "can.ply", tmp_path / "can.json"

    def made(*words):
        result = run("reconstruct", scan_path, "-o", ply, "--report", report, *words)
        return read_mesh(ply.read_bytes(), ".ply"), json.loads(report.read_text()), result

    plain, _, _ = made()
    between, told, _ = made("--spacing-between", "5deg")
    assert told["lasers"][0]["profiles"] == 3 * STEPS
    assert told["parameters"]["between"] == {"size": pytest.approx(np.deg2rad(5)), "unit": "rad"}
    assert 2.8 < len(between.faces) / len(plain.faces) < 3.1
    _, told, _ = made("--spacing-between", "13.2mm")
    assert told["lasers"][0]["profiles"] == 12
    calm, _, _ = made("--denoise", 2, "--outliers", 8)
    assert len(calm.vertices) == len(plain.vertices)
    off = np.linalg.norm(calm.vertices - plain.vertices, axis=1)
    # Two sigma along the sheet, which meets the can all but squarely.
    assert 0 < off.max() <= 2.02 * plain.provenance.sigma.max()
    limit = float(np.quantile(plain.provenance.sigma, 0.9))
    sure, told, _ = made("--largest-sigma", limit)
    assert told["parameters"]["largest_sigma"] == limit
    assert sure.provenance.sigma.max() <= limit
    assert 0 < len(sure.vertices) < 0.91 * len(plain.vertices)
    done = ts.reconstruct(scan_path, largest_sigma=limit)
    assert done.points["sigma"].max() <= limit, "neither are they among its points"
    lost = done.reconstruction.lost
    mesh = done.reconstruction.opened or done.mesh
    by_that = explain(mesh, holes(mesh), (), lost=lost)
    assert "removed" in {h.cause for h in by_that}, "known from what was left out alone"
    named = {h.loop.tobytes(): h.cause for h in done.holes}
    assert all(named[h.loop.tobytes()] == "removed" for h in by_that if h.cause is not None)
    every = ts.reconstruct(scan_path, largest_sigma=None).points["sigma"]
    assert 0 < (every > limit).sum() == len(every) - len(done.points)
    few, _, result = made("--close", "--decimate", "0.02mm")
    whole, _, _ = made("--close")
    assert few.volume == pytest.approx(whole.volume, rel=1e-3)
    assert len(few.faces) < 0.5 * len(whole.faces)
    assert f"{len(few.faces)} of {len(whole.faces)} faces are left" in result.stderr


def test_a_refinement_that_the_steps_do_not_allow_is_declined(scan_path, tmp_path):
    """24 steps carry the can's wall 6.5 mm further; only who asked for it is told."""
    ply, report = tmp_path / "can.ply", tmp_path / "can.json"

    def made(refine):
        result = run("reconstruct", scan_path, "-o", ply, "--report", report, "--refine", refine)
        parameters = json.loads(report.read_text())["parameters"]
        return read_mesh(ply.read_bytes(), ".ply").vertices, parameters, result.stderr

    plain, _, _ = made("none")
    asked, parameters, said = made("spacetime")
    assert parameters["stripes"]["refine"] == "spacetime"
    assert "points.not-refined" in said
    assert "times as many steps" in said
    auto, _, said = made("auto")
    assert "refined" not in said
    assert np.array_equal(plain, asked)
    assert np.array_equal(plain, auto)


@pytest.mark.parametrize("asked", ["5", "0deg", "-1mm", "nanmm", "5rad"])
def test_a_spacing_that_is_none_is_refused(scan_path, tmp_path, asked):
    out = tmp_path / "can.ply"
    result = run("reconstruct", scan_path, "-o", out, "--spacing-between", asked, fails=2)
    assert "--spacing-between" in str(result.exception) + result.output
    assert not out.exists()


def test_a_cylinder_is_measured(scan_path, tmp_path):
    part = tmp_path / "can.ply"
    run("reconstruct", scan_path, "-o", part, "--z-min", 5, "--z-max", 35, "--radius", 40)
    got = json.loads(run("measure", part, "--cylinder", "--json").stdout)
    assert got["cylinder"]["radius_mm"] == pytest.approx(25.0, abs=0.02)
    assert abs(got["cylinder"]["axis"][2]) > 0.99999
    assert got["volume_mm3"] is None
    assert got["bounds_mm"][0][2] >= 5
    text = run("measure", part, "--cylinder", "--planes", "--sphere").stdout
    (radius,) = re.findall(r"cylinder: radius ([0-9.]+)", text)
    assert float(radius) == pytest.approx(25.0, abs=0.02)
    assert "not closed" in text


def test_html_report(scan_path, tmp_path):
    run("reconstruct", scan_path, "-o", tmp_path / "a.stl", "--report", tmp_path / "r.html")
    html = (tmp_path / "r.html").read_text()
    assert html.count("data:image/png;base64,") == 5
    assert (
        "Standard uncertainty of the points as measured, mm, and the holes by their causes" in html
    )
    assert "http://" not in html
    assert "https://" not in html


def test_the_report_tells_the_holes_the_coverage_and_what_was_filled(scan_path, tmp_path):
    words = ["-o", tmp_path / "a.stl", "--z-min", 2, "--z-max", 35]
    result = run("reconstruct", scan_path, *words, "--close", "--report", tmp_path / "r.json")
    body = json.loads((tmp_path / "r.json").read_text())
    top, foot = sorted(body["holes"], key=lambda h: -h["centre_mm"][2])
    # Both ends of the can were cut off by the heights that were asked for.
    assert [top["cause"], foot["cause"]] == ["outside", "outside"]
    assert [top["filled"], foot["filled"]] == ["plane", "floor"]
    for hole in (top, foot):
        assert hole["size_mm"] == pytest.approx(50, abs=0.5)
        assert hole["perimeter_mm"] == pytest.approx(2 * np.pi * 25, rel=0.02)
        assert hole["area_mm2"] == pytest.approx(np.pi * 25**2, rel=0.03)
    maps = body["maps"]
    lasers, sigma = np.array(maps["lasers"]), np.array(maps["sigma_mm"], dtype=float)
    assert lasers.shape == sigma.shape
    assert lasers.shape == (len(maps["height_mm"]) - 1, len(maps["angle_deg"]) - 1)
    assert (lasers == 1).mean() > 0.9
    assert (np.isfinite(sigma) == (lasers > 0)).all()
    wall = 2 * np.pi * 25 * 32.5
    assert body["surface"]["measured_mm2"] == pytest.approx(wall, rel=0.05)
    assert body["surface"]["missing_mm2"] == pytest.approx(2 * np.pi * 25**2, rel=0.03)
    assert body["surface"]["after_not_measured_faces"] > 0
    assert "holes: 2 (2 outside the picture or the working volume)" in result.stdout
    run("reconstruct", scan_path, *words, "--close", "--report", tmp_path / "r.html")
    html = (tmp_path / "r.html").read_text()
    assert html.count("data:image/png;base64,") == 7
    assert html.count("outside the picture or the working volume</td>") == 2
    assert "after, from 34°; pink: not measured" in html


def test_an_empty_result_writes_nothing_and_exits_1(scan_path, tmp_path):
    out = tmp_path / "part.dxf"
    out.write_text("mine")
    result = run("reconstruct", scan_path, "-o", out, "--threshold", 240, fails=1)
    assert result.exit_code == 1
    assert out.read_text() == "mine"
    assert "points.none" in result.stderr


def test_one_profile_of_each_laser_forms_no_face_and_says_so(tmp_path):
    """With so many points in each that the table's errors are asked of them."""
    path, out = tmp_path / "can.turnscan", tmp_path / "can.ply"
    rig, u, angles = make_rig(elevation=0.1, lift=20.0, lasers=(0.4, -0.4)), np.arange(320), (0, 3)
    with Scan.create(path, ScanPlan(320, 240, "uint8", 1, ("L0", "L1"), 2, 12.0), rig) as scan:
        for name in ("L0", "L1"):
            for k, s in enumerate(scan_shape(rig, cylinder(25, 0, 80), np.array(angles), name)):
                at = np.nan_to_num(s.position, nan=-1e3)[:, None]
                lit = np.rint(10 + 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)).astype(np.uint8)
                dark = np.full((240, 320), 10, np.uint8)
                scan.add(Frame(k, name, lit, dark, commanded=float(angles[k])))
    for every in (2, 3, 100):
        result = run("reconstruct", path, "-o", out, "--every", every, fails=1)
        assert result.exit_code == 1, result.exception
        assert "points in 1 profiles" in result.stdout
        assert "no face could be formed" in result.stderr
        assert not out.exists()


def test_options_of_formats_that_are_not_written_are_refused(scan_path, tmp_path):
    out = tmp_path / "a.stl"
    for words, says in (
        (("--float32",), "no effect on a.stl → leave it out, or write a .ply as well"),
        (("--obj-texture",), "or write a .obj as well"),
        (("--dxf-version", "R12"), "or write a .dxf as well"),
        (("--dxf-form", "polyface", "--ascii"), "or write a .dxf as well"),
    ):
        error = run("reconstruct", scan_path, "-o", out, *words, fails=2).exception
        assert isinstance(error, InputError)
        assert says in str(error)
        assert not out.exists()
    run("reconstruct", scan_path, "-o", out, "-o", tmp_path / "a.ply", "--ascii", "--float32")
    assert out.read_bytes().startswith(b"solid")


def test_bad_options_are_one_named_error(scan_path, tmp_path):
    def refused(kind, says, *words):
        result = run("reconstruct", *words, fails=2)
        assert isinstance(result.exception, kind), result.exception
        assert says in str(result.exception)
        assert list(tmp_path.iterdir()) == kept

    rig = tmp_path / "rig.json"
    rig.write_text(rig_to_json(make_rig(lasers=(0.3, -0.3), size=(64, 48))))
    kept = [rig]
    a = tmp_path / "a.ply"
    refused(InputError, "no such scan file", tmp_path / "none.turnscan", "-o", a)
    refused(InputError, "'.iges' are not known", scan_path, "-o", tmp_path / "a.iges")
    refused(InputError, ".xyz, .step", scan_path, "-o", tmp_path / "a.dwg")
    refused(ExportError, "no folder", scan_path, "-o", tmp_path / "no" / "a.ply")
    refused(InputError, "pictures of 320 × 240", scan_path, "-o", a, "--rig", rig)
    refused(InputError, "no height", scan_path, "-o", a, "--z-min", 9, "--z-max", 3)
    refused(InputError, "ends .html or .json", scan_path, "-o", a, "--report", tmp_path / "r.txt")
    assert run("measure", tmp_path / "none.ply", fails=2).exception.exit_code == 2


def test_range_scans_of_another_scanner(tmp_path):
    (tmp_path / "a.ply").write_bytes(cyberware())
    conf = tmp_path / "all.conf"
    conf.write_text("bmesh a.ply 0 0 0 0 0 0 1\n")
    out = tmp_path / "a.stl"
    result = run("reconstruct", conf, "-o", out, "--island", 0, "--unit", "mm", fails=1)
    assert "points.range-scans" in result.stderr
    conf.write_text("bmesh ../a.ply 0 0 0 0 0 0 1\n")
    result = run("reconstruct", conf, "-o", out, fails=2)
    assert "not a plain file name" in str(result.exception)
    conf.write_text("bmesh none.ply 0 0 0 0 0 0 1\n")
    assert "no such file" in str(run("reconstruct", conf, "-o", out, fails=2).exception)


def test_options_without_a_meaning_are_refused_and_not_recorded(scan_path, tmp_path):
    (tmp_path / "a.ply").write_bytes(cyberware())
    conf = tmp_path / "all.conf"
    conf.write_text("bmesh a.ply 0 0 0 0 0 0 1\n")
    out = tmp_path / "out.stl"
    words = ("--radius", 5, "--strategy", "window", "--rig", tmp_path / "rig.json")
    said = str(run("reconstruct", conf, "-o", out, *words, fails=2).exception)
    assert "--rig, --strategy, --radius" in said
    assert not out.exists()
    said = str(run("reconstruct", scan_path, "-o", out, "--unit", "m", fails=2).exception)
    assert "--unit" in said
    report = tmp_path / "r.json"
    run("reconstruct", conf, "-o", out, "--island", 0, "--report", report, fails=1)
    used = json.loads(report.read_text())["parameters"]
    assert used["island"] == 0
    assert not {"stripes", "spacing_by", "every", "shortest"} & set(used)


def test_a_range_scan_is_not_written_over(tmp_path):
    ply = tmp_path / "a.ply"
    ply.write_bytes(cyberware())
    conf = tmp_path / "all.conf"
    conf.write_text("bmesh a.ply 0 0 0 0 0 0 1\n")
    assert "is an input" in str(run("reconstruct", conf, "-o", ply, fails=2).exception)
    assert ply.read_bytes() == cyberware()


def test_any_spacing_leaves_the_mesh_whole(tmp_path):
    """A gap that lies elsewhere in each profile must not shear the surface beyond it."""
    path = tmp_path / "gap.turnscan"
    rig = make_rig(elevation=0.1, lift=20.0)
    u = np.arange(320)
    dark = np.full((240, 320), 10, np.uint8)
    with Scan.create(path, ScanPlan(320, 240, "uint8", 1, ("L0",), STEPS, 12.0), rig) as scan:
        for k, s in enumerate(scan_shape(rig, cylinder(25, 0, 40), full_turn(STEPS))):
            at = np.nan_to_num(s.position, nan=-1e3)[:, None]
            lit = np.rint(10 + 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)).astype(np.uint8)
            high = 100 + 5 * abs(k % 8 - 4)
            lit[high : high + 10] = 10
            scan.add(Frame(k, "L0", lit, dark, commanded=float(full_turn(STEPS)[k])))
    area = {}
    for by in ("measured", "height", "arc"):
        words = () if by == "measured" else ("--spacing", 0.2, "--spacing-by", by)
        out, dxf = tmp_path / f"{by}.ply", tmp_path / f"{by}.dxf"
        run("reconstruct", path, "-o", out, "-o", dxf, "--dxf-form", "profiles", *words)
        mesh = read_mesh(out.read_bytes(), ".ply")
        a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
        area[by] = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    # A chord over the noise of the points is a little shorter than the way over all of them.
    assert area["arc"] == pytest.approx(area["measured"], rel=4e-3)
    assert area["height"] == pytest.approx(area["measured"], rel=4e-3)
    assert area["arc"] < 2 * np.pi * 25 * 40
    runs = read_dxf_content((tmp_path / "arc.dxf").read_bytes()).runs
    steps = np.concatenate([np.linalg.norm(np.diff(r, axis=0), axis=1) for r in runs])
    assert np.median(steps) == pytest.approx(0.2, abs=0.01)
