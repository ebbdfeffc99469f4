"""Space-time refinement: against truth, against the ordinary way, and where it does not apply."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bench.spacetime import Case, Outcome, built, outcome, photographed, rms

from tests.analytic import make_rig
from turnscan import points
from turnscan.detection import Detection, detect_scan
from turnscan.rig import Camera, Pose, Rig, rotation_z
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.stripes import Light, Stripe, StripeFlag, StripeSettings

BARS = Case("modern", "cylinder", 0.45, 24, bars=2.0, waves="rays")
"""The bars of docs/explain/stripes.md: 10 : 1, R = 30 mm, a sheet of 0.15 mm, no lens."""
BLURRED = replace(BARS, step=0.225, steps=30, waves="diffraction")
TOO_FAR = replace(BARS, step=0.9, steps=8)
CREASES = Case("paper", "hexagon", 0.9, 45, rows=24)
TREMBLING = replace(CREASES, tremble=0.03)
PLAIN = Case("paper", "cylinder", 1.2, 16, waves="speckle", rows=48)
EDGES = Case("paper", "shaft", 0.9, 60, rows=12)


def both(case: Case) -> tuple[Outcome, float, float]:
    """What became of the followed centres: rms before and after, mm."""
    done = outcome(case)
    m = done.swept.followed
    assert m.sum() > 100
    return done, rms(done.before[m]), rms(done.after[m])


def honest(done: Outcome) -> float:
    """rms of error over sigma of the refined centres."""
    m = done.swept.refined
    return rms((done.after / done.sigma_after)[m])


def test_bars_of_ten_to_one_no_longer_pull() -> None:
    """At most 20 µm, 81 and more without; and no better than the camera's noise allows."""
    done, before, after = both(BARS)
    assert before > 0.07
    assert 0.003 < after < 0.012
    assert done.swept.followed.mean() > 0.7
    assert 0.7 < honest(done) < 1.2
    # Where an element of the surface is, not what its colour is: no bar is off as a whole.
    error = done.after[done.swept.refined]
    assert abs(float(np.median(error))) < 0.002


def test_bars_through_a_lens_that_blurs() -> None:
    """The blur is told by what it pulls, and put back: 18 µm without, and sigmas half as large."""
    done, before, after = both(BLURRED)
    assert before > 0.07
    assert 0.005 < after < 0.016
    assert 0.7 < honest(done) < 1.4


def test_the_thickness_of_the_sheet_comes_out() -> None:
    """Of the light of single elements: bars, which narrow the stripe, do not matter."""
    true = built(BARS).beams[0].waist / 2
    for case in (BARS, BLURRED):
        assert 1.0 < outcome(case).swept.thickness / true < 1.25  # pixels and lens widen it


def test_creases_are_no_longer_rounded_nor_by_a_table_that_trembles() -> None:
    done, before, after = both(CREASES)
    assert 0.04 < before < 0.06
    assert 0.008 < after < 0.03
    assert 0.7 < honest(done) < 1.3
    m = done.swept.followed
    worst_before, worst_after = (np.quantile(np.abs(e[m]), 0.99) for e in (done.before, done.after))
    assert worst_after < 0.5 * worst_before  # their skew has put the worst back a little before
    shaken, before, after = both(TREMBLING)
    assert 0.008 < after < 0.03
    assert honest(shaken) < 1.5  # the table's own error is not the stripe's


def test_a_plain_surface_in_speckle_is_measured_no_worse() -> None:
    done, before, after = both(PLAIN)
    assert 0.5 * before < after < before
    assert 0.7 < honest(done) < 1.2


def test_centres_at_a_depth_edge_that_are_no_place_of_the_surface_say_so() -> None:
    done, before, after = both(EDGES)
    assert after <= before
    wrong = done.swept.followed & ~done.swept.refined & (np.abs(done.before) > 0.3)
    assert wrong.sum() > 20
    claimed = rms((done.after / done.sigma_after)[wrong])
    assert 0.5 < claimed < 1.5
    # Single stripes say it, too: they are narrow and faint between others.
    assert 0.5 < rms((done.before / done.sigma_before)[wrong]) < 1.5
    # What was not refined keeps its place.
    for old, new, refined in zip(
        done.ordinary, done.swept.stripes, done.swept.refined, strict=True
    ):
        assert np.array_equal(new.position[~refined], old.position[~refined], equal_nan=True)
        assert np.array_equal((new.flags & StripeFlag.REFINED) != 0, refined)


def test_the_width_of_a_stripe_does_not_count_for_a_refined_centre() -> None:
    done, made, angles = outcome(EDGES), built(EDGES), photographed(EDGES).angles
    laser = made.beams[0].name
    flagged = [replace(s, flags=s.flags | np.uint16(StripeFlag.REFINED)) for s in done.ordinary]
    plain, free = (
        points.build_grid(made.rig, laser, some, np.arange(len(angles)), angles)
        for some in (done.ordinary, flagged)
    )
    X, sigma = points.triangulate(
        made.rig, laser, np.stack([s.pixels for s in flagged]), np.stack([s.sigma for s in flagged])
    )
    assert np.allclose(free.sigma, sigma, equal_nan=True)
    expected = points.to_object(made.rig, X, angles[:, None])
    assert np.allclose(free.points, expected, equal_nan=True)
    assert not np.allclose(plain.points, expected, equal_nan=True)
    assert (plain.sigma[plain.found] > 1.5 * sigma[plain.found]).any()


def test_beyond_the_allowed_step_nothing_changes() -> None:
    done = outcome(TOO_FAR)
    assert not done.swept.followed.any()
    assert not done.swept.refined.any()
    assert done.swept.arc > done.swept.most
    assert np.array_equal(done.after, done.before, equal_nan=True)
    assert np.array_equal(done.sigma_after, done.sigma_before, equal_nan=True)
    (said,) = points.swept_findings("right", done.swept, asked=True)
    assert (said.code, said.severity) == ("points.not-refined", "warning")
    assert "0.47 mm" in said.message
    assert points.swept_findings("right", done.swept, asked=False) == []


def test_near_the_axis_it_says_another_reason() -> None:
    done = outcome(replace(TOO_FAR, steps=8))
    slow = replace(done.swept, arc=0.01)
    (said,) = points.swept_findings("right", slow, asked=True)
    assert "near the axis" in said.message


LENS = np.array([-0.2, 0.05, 1e-3, -1e-3, 0.0])


@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
def test_paths_are_those_of_points_on_the_turning_table(orientation) -> None:
    rig = make_rig(elevation=0.35, lift=20.0)
    rig = replace(rig, camera=replace(rig.camera, distortion=LENS))
    if orientation == "horizontal":
        rig = _on_its_side(rig)
    paths = points.paths_of(rig, "L0", orientation)
    u, v = 160, 136
    X = rig.sheet("L0").intersect(rig.camera.rays((float(u), float(v))))
    at = rig.T_camera_table.inverse().apply(X)
    for turn in (-0.15, -0.02, 0.05, 0.18):
        moved = rig.T_camera_table.apply(rotation_z(turn) @ at)
        gone = rig.camera.project(moved) - (u, v)
        node = paths[v // 8, u // 8] if orientation == "vertical" else paths[u // 8, v // 8]
        along, across, away = node @ turn ** np.arange(1, 4)
        expected = gone[::-1] if orientation == "vertical" else gone
        assert np.allclose((along, across), expected, atol=0.02)
        assert away == pytest.approx(float(rig.sheet("L0").distance(moved)), abs=0.01)


def _on_its_side(rig: Rig) -> Rig:
    """The same with its camera a quarter turn about its optical axis."""
    c = rig.camera
    roll = Pose(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    sheets = [
        replace(s, normal=roll.turn(s.normal), centre=roll.apply(s.centre)) for s in rig.sheets
    ]
    camera = Camera(c.height, c.width, c.fy, c.fx, c.cy, c.width - 1 - c.cx)
    return Rig(camera, tuple(sheets), roll @ rig.T_camera_table)


def test_a_whole_turn_has_no_ends() -> None:
    """A round part on the axis looks the same at every angle: one picture does for all."""
    case = replace(PLAIN, step=1.8, steps=1, waves="diffraction", rows=12)
    seen, made = photographed(case), built(case)
    stripe, light = _first(case)
    laser, turn = made.beams[0].name, np.arange(200) * np.deg2rad(1.8)
    whole = points.refine(made.rig, laser, [stripe] * 200, turn, lambda _: light)
    assert whole.followed.all()
    half = points.refine(made.rig, laser, [stripe] * 100, turn[:100], lambda _: light)
    assert half.followed[10:-10].all()
    assert not half.followed[[0, -1]].any()
    # One frame is missing: elements are not followed across the gap.
    holed = points.refine(
        made.rig, laser, [stripe] * 99, np.delete(turn[:100], 50), lambda _: light
    )
    assert not holed.followed[49:51].any()
    assert holed.followed[10:40].all()
    assert len(seen.lit) == 1


def _first(case: Case) -> tuple[Stripe, Light]:
    from turnscan.stripes import Signal

    seen, signal, look = photographed(case), Signal(None), StripeSettings()
    pair = (seen.lit[0], seen.dark[0], look)
    return signal.detect(*pair), signal.light(*pair)


def test_a_piece_of_light_is_sharp_and_dark_outside() -> None:
    lit = np.full((6, 10), 30, np.uint8)
    lit[3, 5] = 130
    light = Light(lit, np.full((6, 10), 10, np.uint8), 20.0, 1.0, 0.0)
    piece = light.piece((2, -2), (6, 11))
    assert piece.sum() == pytest.approx(100.0)
    assert piece[1, 7] == pytest.approx(100 * (1 + 1 / 12))
    assert piece[1, 6] == piece[1, 8] < 0
    assert not piece[4:].any()
    assert light.piece((50, 0), (2, 3)).shape == (2, 3)


def test_a_scan_file_is_refined_as_asked(tmp_path) -> None:
    seen, made = photographed(CREASES), built(CREASES)
    laser, camera, body = made.beams[0].name, made.rig.camera, made.scene.bodies[0]
    steps = len(seen.angles)
    plan = ScanPlan(camera.width, camera.height, "uint8", 1, (laser,), steps, 12.0)
    volume = points.Volume(60.0, -100.0)
    with Scan.create(tmp_path / "hexagon.turnscan", plan, made.rig) as scan:
        for k, angle in enumerate(seen.angles):
            scan.add(Frame(k, laser, seen.lit[k], seen.dark[k], commanded=float(angle)))
        (plain,) = detect_scan(scan, made.rig, StripeSettings(), volume)
        (fine,) = detect_scan(scan, made.rig, StripeSettings(refine="spacetime"), volume)
    assert [f.code for f in plain.findings] == []
    assert [f.code for f in fine.findings] == ["points.refined"]
    assert fine.stripes.steps == plain.stripes.steps

    def error(sight: Detection) -> float:
        s = sight.stripes
        grid = points.build_grid(made.rig, laser, s.stripes, s.steps, s.angles)
        at = body.T_table_part.inverse().apply(grid.points[10:-10][grid.found[10:-10]])
        assert body.part.distance is not None
        return rms(body.part.distance(at))

    assert error(plain) < 0.055
    assert error(fine) < 0.03
