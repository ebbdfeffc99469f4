"""The whole story: frames in a scan file → a part with the right size."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic import box, full_turn, make_rig, scan_shape
from tests.reports import into
from turnscan.detection import detect_scan
from turnscan.edit import DeletePoints, Entry, ProfileOff, Redetect
from turnscan.errors import InputError
from turnscan.mesh import is_closed
from turnscan.pipeline import build, reconstruct
from turnscan.points import Along, Between, Volume, build_grid
from turnscan.scan import Frame, Scan, ScanPlan, rig_for
from turnscan.settings import Settings
from turnscan.stripes import StripeFlag, StripeSettings
from turnscan.surface.holes import ClosingOptions

STEPS = 40
LASERS = (0.45, -0.45)


@pytest.fixture(scope="module")
def rig():
    return make_rig(elevation=0.35, lift=20.0, lasers=LASERS)


@pytest.fixture(scope="module")
def scan_path(rig, tmp_path_factory):
    """A box, two lasers, frames with noise and a bright line on a wall behind, in colour."""
    path = tmp_path_factory.mktemp("scan") / "box.turnscan"
    plan = ScanPlan(320, 240, "uint8", 3, ("L0", "L1"), STEPS, 12.0, weights=(-0.2, 1.0, -0.2))
    rng = np.random.default_rng(0)
    u = np.arange(320)
    angles = full_turn(STEPS)
    with Scan.create(path, plan, rig) as scan:
        for laser in plan.lasers:
            shape = box((25, 18, 20), (3, 2, 20), 0.3)
            for k, stripe in enumerate(scan_shape(rig, shape, angles, laser)):
                if (laser, k) == ("L1", 7):
                    scan.add_missing(k, laser, "the picture is damaged")
                    continue
                at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
                light = 150 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)
                wall = 10.0 if laser == "L0" else 309.0
                light += 200 * np.exp(-0.5 * ((u - wall) / 2.0) ** 2)
                dark = rng.normal(12, 1.2, (240, 320, 3))
                lit = rng.normal(12, 1.2, (240, 320, 3))
                lit[..., 1] += light
                as_u8 = [np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (lit, dark)]
                scan.add(Frame(k, laser, *as_u8, commanded=float(angles[k])))
    return path


def test_the_number_of_threads_changes_nothing(scan_path, rig):
    with Scan.open(scan_path) as scan:
        one, several = (detect_scan(scan, rig, StripeSettings(), jobs=n) for n in (1, 5))
    assert [s.view.laser for s in one] == ["L0", "L1"]
    for a, b in zip(one, several, strict=True):
        assert a.stripes.steps == b.stripes.steps
        for p, q in zip(a.stripes.stripes, b.stripes.stripes, strict=True):
            for name in ("position", "sigma", "amplitude", "width", "flags"):
                assert getattr(p, name).tobytes() == getattr(q, name).tobytes(), name
    assert sum(s.found.sum() for s in one[0].stripes.stripes) > 1000


def test_a_box_comes_out_of_its_pictures(scan_path):
    ticks = []
    with Scan.open(scan_path) as scan:
        done = reconstruct(
            scan, settings=Settings(caps=ClosingOptions()), tick=lambda: ticks.append(1)
        )
        again = reconstruct(scan, settings=Settings(caps=ClosingOptions()))
    assert len(ticks) == 2 * STEPS - 1
    assert done.mesh.vertices.tobytes() == again.mesh.vertices.tobytes(), "threads change nothing"
    assert done.mesh.faces.tobytes() == again.mesh.faces.tobytes()
    assert [g.laser for g in done.grids] == ["L0", "L1"]
    assert len(done.grids[1].steps) == STEPS - 1
    for grid in done.grids:
        away = _off_the_box(grid.points[grid.found])
        assert np.quantile(np.abs(away), 0.95) < 0.25
        sigma = grid.sigma[grid.found]
        assert 0.4 < np.median(np.abs(away)) / (0.6745 * np.median(sigma)) < 1.6
    codes = [f.code for f in done.findings]
    assert "points.missing-frames" in codes
    assert not [f for f in done.findings if f.severity == "error"]


def test_choices_of_the_user_are_obeyed(scan_path, rig):
    low = Settings(volume=Volume(60, 5, 25), every=2, along=Along(2.0))
    with Scan.open(scan_path) as scan:
        done = reconstruct(scan, rig, low)
        assert len(done.grids[0].steps) == STEPS // 2
        z = done.mesh.vertices[:, 2]
        assert z.min() >= 5
        assert z.max() <= 25
        high = done.spaced[0].points[done.spaced[0].found][:, 2]
        whole = np.abs(high / 2 - np.round(high / 2)) < 1e-9
        assert whole.mean() > 0.7, "all but the ends of the profiles lie at common heights"
        assert not is_closed(done.mesh)
        nothing = reconstruct(scan, rig, Settings(stripes=StripeSettings(threshold=250.0)))
    assert [f.code for f in nothing.findings if f.severity == "error"] == [
        "points.none",
        "points.none",
        "surface.none",
    ]


def test_points_by_arc_length_are_meshed_with_the_profiles_that_were_asked_for(scan_path):
    with Scan.open(scan_path) as scan:
        seen = detect_scan(scan, rig_for(scan), StripeSettings(), Volume(60, 5, 25))[:1]
    wide = Between(float(np.deg2rad(18)), "rad")
    done = build(seen, Settings(along=Along(2.0, "arc"), between=wide))
    assert len(done.grids[0].steps) == 20
    # Steps are numbered anew, from 0 to 19; those of the scan run to 39.
    assert done.mesh.provenance.step.max() == 19


def test_a_rig_that_does_not_fit_is_refused(scan_path, tmp_path):
    with Scan.open(scan_path) as scan:
        with pytest.raises(InputError, match="no laser L1"):
            reconstruct(scan, make_rig())
        with pytest.raises(InputError, match="pictures of 320 × 240"):
            reconstruct(scan, make_rig(lasers=LASERS, size=(640, 240)))
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), 1, 12.0)
    with Scan.create(tmp_path / "bare.turnscan", plan) as bare:
        bare.add(Frame(0, "L0", np.zeros((240, 320), np.uint8)))
        with pytest.raises(InputError, match="no rig"):
            reconstruct(bare)
        with pytest.raises(InputError, match="table angle"):
            reconstruct(bare, make_rig())


def _signal_of(stripe, albedo):
    """Light of a stripe per second, (240, 320): strong at the top of the picture, weak below."""
    at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
    return albedo[:, None] * np.exp(-0.5 * ((np.arange(320) - at) / 1.5) ** 2)


def _exposed(light, seconds, rng, channels=1):
    picture = rng.normal(12, 1.2, (240, 320, channels))
    picture[..., 1 % channels] += light * seconds
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8).squeeze()


@pytest.mark.parametrize("channels", [1, 3])
def test_a_bracket_sees_chrome_and_soot(rig, tmp_path, channels):
    rng = np.random.default_rng(3)
    weights = (-0.2, 1.0, -0.2) if channels == 3 else None
    times = (0.002, 0.032)
    albedo = np.geomspace(60_000, 500, 240)
    angles = full_turn(12)
    shape = box((25, 18, 20), (3, 2, 20), 0.3)
    truth = scan_shape(rig, shape, angles, "L0")
    found, errors, clipped = [], [], []
    for k, exposures in enumerate([times[:1], times[1:], times]):
        plan = ScanPlan(
            320, 240, "uint8", channels, ("L0",), 12, 12.0, weights=weights,
            exposures=len(exposures),
        )  # fmt: skip
        with Scan.create(tmp_path / f"{k}.turnscan", plan, rig) as scan:
            for step, stripe in enumerate(truth):
                light = _signal_of(stripe, albedo)
                for i, t in enumerate(exposures):
                    lit = _exposed(light, t, rng, channels)
                    dark = _exposed(0 * light, t, rng, channels)
                    how = {"seconds": t, "gain": 1.0}
                    at = float(angles[step])
                    scan.add(Frame(step, "L0", lit, dark, i, commanded=at, settings=how))
            assert scan.complete
            grid = reconstruct(scan, settings=Settings(clean=None)).grids[0]
        there = build_grid(rig, "L0", truth, np.arange(12), angles)
        assert not grid.found[~there.found].any()
        found.append(float(grid.found[there.found & (there.points[..., 2] > 2.5)].mean()))
        clipped.append(float((grid.flags[grid.found] & StripeFlag.SATURATED != 0).mean()))
        out = np.abs(_off_the_box(grid.points[grid.found]))
        errors.append(float(np.median(out / grid.sigma[grid.found])) / 0.6745)
    short, long, both = found
    assert short < 0.85 < 0.98 < both
    assert clipped[1] > 0.2, "the long exposure clips"
    assert clipped[2] < 0.02
    assert long <= both + 0.01
    assert 0.4 < errors[2] < 1.6


def _off_the_box(points):
    c, s = np.cos(0.3), np.sin(0.3)
    Q = (points - (3, 2, 20)) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return ((np.abs(Q) / (25, 18, 20) - 1) * (25, 18, 20)).max(axis=1)


def test_an_exposure_that_does_not_tell_its_time_is_refused(rig, tmp_path):
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), 1, 12.0, exposures=2)
    picture = np.full((240, 320), 9, np.uint8)
    with Scan.create(tmp_path / "a.turnscan", plan, rig) as scan:
        for k in range(2):
            scan.add(Frame(0, "L0", picture, picture, k, commanded=0.0))
        with pytest.raises(InputError, match="does not tell how long it was"):
            reconstruct(scan)


def test_lasers_lit_together_are_told_apart(rig, scan_path, tmp_path):
    rng = np.random.default_rng(4)
    angles = full_turn(24)
    shape = box((25, 18, 20), (3, 2, 20), 0.3)
    apart = {name: scan_shape(rig, shape, angles, name) for name in ("L0", "L1")}
    plan = ScanPlan(320, 240, "uint8", 1, ("L0+L1",), 24, 12.0)
    with Scan.create(tmp_path / "both.turnscan", plan, rig) as scan:
        for step, pair in enumerate(zip(*apart.values(), strict=True)):
            light = sum(_signal_of(stripe, np.full(240, 150.0)) for stripe in pair)
            lit, dark = _exposed(light, 1.0, rng), _exposed(light, 0.0, rng)
            scan.add(Frame(step, "L0+L1", lit, dark, commanded=float(angles[step])))
        # What a laser shows of the level top beyond the axis looks like a higher part.
        assert "points.together" in [f.code for f in reconstruct(scan).findings]
        done = reconstruct(scan, settings=Settings(volume=Volume(60, 2.5, 40.5)))
    assert [g.laser for g in done.grids] == ["L0", "L1"]
    for grid in done.grids:
        truth = build_grid(rig, grid.laser, apart[grid.laser], np.arange(24), angles)
        want = truth.found & (truth.points[..., 2] > 2.5) & ~truth.behind
        assert grid.found[want].mean() > 0.93, "the rest is where two stripes touch"
        off = _off_the_box(grid.points[grid.found])
        assert np.quantile(np.abs(off), 0.95) < 0.25
        assert 0.4 < np.median(np.abs(off) / grid.sigma[grid.found]) / 0.6745 < 1.6


def test_a_second_pass_is_merged_with_the_first(rig, tmp_path):
    rng = np.random.default_rng(5)
    angles = np.deg2rad(15.0) * np.arange(48)
    shape = box((25, 18, 20), (3, 2, 20), 0.3)
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), 48, 12.0)
    with Scan.create(tmp_path / "two.turnscan", plan, rig) as scan:
        for step, stripe in enumerate(scan_shape(rig, shape, angles, "L0")):
            light = _signal_of(stripe, np.full(240, 150.0))
            lit, dark = _exposed(light, 1.0, rng), _exposed(light, 0.0, rng)
            scan.add(Frame(step, "L0", lit, dark, commanded=float(angles[step])))
        done = reconstruct(scan)
    assert [len(g.steps) for g in done.grids] == [24, 24]
    assert all(g.closed for g in done.grids)
    assert "surface.merge" in [f.code for f in done.findings]
    assert "points.second-turn" not in [f.code for f in done.findings]


def test_frames_asked_again_show_the_same_and_edits_reach_the_grid(scan_path):
    with Scan.open(scan_path) as scan:
        seen = detect_scan(scan, rig_for(scan), StripeSettings())
        plain = build(seen, Settings())
        view = seen[0].view
        step = seen[0].stripes.steps[5]
        first = seen[0].stripes.stripes[5]
        again = view.again(step, Redetect("L0", (0, 0), (0, 0)))
        assert np.allclose(again.position, first.position, atol=1e-9, equal_nan=True)
        found = view.candidates(step)
        gap = np.abs(found.position - first.position[:, None])[first.found]
        assert np.nanmin(gap, axis=1).max() < 1e-9
        deaf = view.again(step, Redetect("L0", (0, 0), (0, 0), threshold=250.0))
        assert not deaf.found.any()
        edits = [
            Entry(1, ProfileOff("L0", (3, 4))),
            Entry(2, Redetect("L0", (8, 9), (0, 1000), threshold=250.0)),
            Entry(3, DeletePoints("L1", 12, tuple(range(100, 110)))),
        ]
        shares = list[float]()
        done = build(seen, Settings(denoise=2.0), edits, into(shares))
        whole = reconstruct(scan, settings=Settings(denoise=2.0), edits=edits)
    assert shares == sorted(shares)
    assert shares[0] == 0
    assert len(set(shares)) > 8  # edits, profiles sought again, grids denoised, merging
    assert shares[-1] == pytest.approx(0.7)
    assert done.mesh.vertices.tobytes() == whole.mesh.vertices.tobytes()
    assert set(plain.grids[0].steps) - set(done.grids[0].steps) == {3, 4}
    assert not done.grids[0].found[np.isin(done.grids[0].steps, (8, 9))].any()
    was, now = (g.found[np.flatnonzero(g.steps == 12)[0]] for g in (plain.grids[1], done.grids[1]))
    assert was[100:110].all()
    assert not now[100:110].any()
    assert done.edits == tuple(edits)
