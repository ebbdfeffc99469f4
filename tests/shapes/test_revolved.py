"""Turned parts: the axis, the wall, and how round it is, known as well as they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.shapes.solids import noisy, prism, turned
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.shapes import Arc, FittedSection, Line, fit_outlines
from turnscan.shapes.revolved import (
    axis_counted,
    cylindricities,
    roundness,
    thread,
    turned_about,
    wall_profile,
)

NOISE = 0.02
SHAFT = [(0.5, 0), (25, 0), (25, 20), (15, 20), (15, 45), (10, 50), (10, 65), (0.5, 65)]
TURN = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
AT = np.array([10.0, -20.0, 30.0])


def _placed(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices @ TURN.T + AT, mesh.faces)


@pytest.mark.parametrize("seed", range(3))
def test_a_shaft_in_any_place_gives_axis_and_wall(seed: int) -> None:
    found = turned_about(_placed(noisy(turned(SHAFT, 0.6, 180), NOISE, seed)))
    axis = found.axis
    sign = np.sign(axis.direction @ TURN[:, 2])
    tilt = float(np.arccos(min(sign * axis.direction @ TURN[:, 2], 1.0)))
    assert tilt < 4 * axis.tilt_sigma < np.radians(0.02)
    away = axis.point - AT
    off = float(np.linalg.norm(away - (away @ TURN[:, 2]) * TURN[:, 2]))
    assert off < 4 * axis.shift_sigma < 0.004
    assert found.share > 0.97
    assert found.sigma == pytest.approx(NOISE, rel=0.2)
    chains = wall_profile(found)[1]
    (outline,) = fit_outlines(chains)[0]
    lines = [p for p in outline.pieces if isinstance(p, Line) and p.rest.count >= 5]
    upright = [p for p in lines if abs(p.end[0] - p.start[0]) < 0.02]
    for line, radius in zip(sorted(upright, key=lambda p: -p.start[0]), (25, 15, 10), strict=True):
        assert (line.start[0] + line.end[0]) / 2 == pytest.approx(radius, abs=5 * line.sigma)
        assert 0 < line.sigma < 0.001
    (cone,) = [p for p in lines if 0.4 < abs((p.end - p.start)[0]) / p.length < 0.9]
    lean = np.degrees(np.arctan2(*np.abs(cone.end - cone.start)))
    assert lean == pytest.approx(45, abs=4 * np.degrees(cone.angle_sigma) + 0.05)
    for c in cylindricities(found, [outline]):
        assert c.value < c.noise + 4 * c.sigma, "noise is no form error"


def test_an_oval_bore_is_out_of_round_by_what_it_is_and_a_boss_beside_the_axis_runs_out() -> None:
    bore = turned([(10.0, 40.0), (10.0, 0.0)], 0.5, 200)
    X = bore.vertices.copy()
    angle = np.arctan2(X[:, 1], X[:, 0])
    X *= np.column_stack([*(2 * [1 + 0.005 * np.cos(2 * angle)]), np.ones(len(X))])
    found = turned_about(_placed(noisy(Mesh(X, bore.faces), 0.005, 1)))
    (r,) = roundness(found, [0.0])
    assert r.hollow
    assert r.least_squares == pytest.approx(0.2 * 0.5, abs=r.noise + 4 * r.sigma)
    assert r.minimum_zone <= r.least_squares
    assert r.radius == pytest.approx(10, abs=0.003)
    both = turned([(25, 0), (25, 40)], 0.8, 200)
    high = both.vertices[:, 2] > 32
    moved = both.vertices + np.where(high[:, None], [0.1, 0.0, 0.0], 0.0)
    found = turned_about(noisy(Mesh(moved, both.faces), 0.005, 2))
    low, top = roundness(found, [-10.0, 16.0])
    assert low.eccentricity < 0.01
    assert top.eccentricity == pytest.approx(0.1, abs=0.03)
    assert top.run_out > top.least_squares + 0.05


def test_a_thread_is_told_by_its_pitch_and_hand_and_noise_has_none() -> None:
    rod = turned([(12, 0), (12, 40)], 0.4, 160)
    angle = np.arctan2(rod.vertices[:, 1], rod.vertices[:, 0])
    wave = 0.03 * np.cos(2 * np.pi * rod.vertices[:, 2] / 2.5 - angle)
    out = rod.vertices * [1, 1, 0] / 12
    found = turned_about(noisy(Mesh(rod.vertices + wave[:, None] * out, rod.faces), 0.01, 1))
    outlines = [o for row in fit_outlines(wall_profile(found)[1]) for o in row]
    (wound,) = thread(found, outlines)
    assert wound.pitch == pytest.approx(2.5, rel=0.02)
    assert wound.amplitude == pytest.approx(0.03, rel=0.15)
    plain = turned_about(noisy(rod, 0.01, 2))
    assert not thread(plain, [o for row in fit_outlines(wall_profile(plain)[1]) for o in row])


def test_a_handle_and_a_keyway_have_no_say() -> None:
    cup = turned([(30, 0), (32, 60)], 0.8, 200)
    angle = np.arctan2(cup.vertices[:, 1], cup.vertices[:, 0])
    far = (np.abs(angle) < 0.15) & (np.abs(cup.vertices[:, 2] - 30) < 20)
    moved = cup.vertices * np.where(far, 1.2, 1.0)[:, None] ** [1, 1, 0]
    found = turned_about(noisy(Mesh(moved, cup.faces), NOISE, 3))
    assert found.share < 0.985
    assert np.hypot(*found.axis.point[:2]) < 5 * found.axis.shift_sigma + 0.002


@pytest.mark.parametrize("part", ["ball", "box"])
def test_what_is_not_turned_is_refused_in_a_line(part: str) -> None:
    t = np.linspace(-1.4, 1.4, 90)
    ball = turned([(20 * np.cos(a), 20 * np.sin(a)) for a in t], 0.6, 120)
    box = prism([(0, 0), (60, 0), (60, 20), (0, 20)], 30, 1.0)
    body, said = (ball, "more than one") if part == "ball" else (box, "not a turned part")
    with pytest.raises(InputError, match=said):
        turned_about(noisy(body, NOISE, 1))


def test_the_wall_is_followed_beside_a_keyway() -> None:
    shaft = turned(SHAFT, 0.6, 180)
    X = shaft.vertices.copy()
    r, angle = np.hypot(X[:, 0], X[:, 1]), np.arctan2(X[:, 1], X[:, 0])
    key = (np.abs(angle) < 0.2) & (np.abs(r - 15) < 0.1)
    X[key] *= [0.75, 0.75, 1.0]
    found = turned_about(noisy(Mesh(X, shaft.faces), NOISE, 4))
    outlines = [o for row in fit_outlines(wall_profile(found)[1]) for o in row]
    upright = [
        p
        for o in outlines
        for p in o.pieces
        if isinstance(p, Line) and p.length > 5 and abs(p.end[0] - p.start[0]) < 0.02
    ]
    radii = sorted((p.start[0] + p.end[0]) / 2 for p in upright)
    assert radii == pytest.approx([10, 15, 25], abs=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_noise_that_neighbours_share_is_no_form_error(seed: int) -> None:
    rod = turned([(20, 0), (20, 40)], 0.5, 240)
    rng = np.random.default_rng(seed)
    X = rod.vertices
    row = np.rint(X[:, 2] * 100).astype(int)
    own = np.empty(len(X))
    for height in np.unique(row):
        some = np.flatnonzero(row == height)
        some = some[np.argsort(np.arctan2(X[some, 1], X[some, 0]))]
        white = rng.normal(0.0, 0.02, len(some))
        own[some] = sum(np.roll(white, k) for k in range(-3, 4)) / np.sqrt(7)
    shared = Mesh(X + own[:, None] * X * [1, 1, 0] / 20, rod.faces)
    found = turned_about(shared)
    for r in roundness(found, list(np.linspace(-15, 15, 7))):
        assert r.least_squares < r.noise + 4 * r.sigma
        assert r.least_squares > r.noise - 4 * r.sigma
    assert not thread(found, [o for w in fit_outlines(wall_profile(found)[1]) for o in w])


@pytest.mark.parametrize("seed", range(3))
def test_sizes_of_a_wall_that_is_seen_in_part_are_known_as_well_as_the_axis(seed: int) -> None:
    whole = noisy(turned([(22, 0), (24, 50)], 1.2, 90), 0.01, seed)
    kept = np.abs(np.arctan2(whole.vertices[:, 1], whole.vertices[:, 0])) < 0.6
    faces = whole.faces[kept[whole.faces].all(axis=1)]
    for part, least in ((Mesh(whole.vertices, faces), 0.02), (whole, 0.0)):
        found = turned_about(part)
        (row,) = fit_outlines(wall_profile(found)[1])
        before = max((p for p in row[0].pieces if isinstance(p, Line)), key=lambda p: p.length)
        after = axis_counted(row[0], found).pieces
        line = max((p for p in after if isinstance(p, Line)), key=lambda p: p.length)
        lean = np.degrees(np.arctan2(*(line.end - line.start)))
        sigma = np.degrees(line.angle_sigma)
        assert least < sigma < 0.1
        assert lean == pytest.approx(np.degrees(np.arctan2(2, 50)), abs=4 * sigma)
        r, z = (line.start + line.end) / 2
        assert r == pytest.approx(22 + 2 * (z - found.z.min()) / 50, abs=5 * line.sigma)
        if part is whole:
            assert line.sigma < 1.2 * before.sigma, "a whole turn does not move with the axis"


def test_a_ring_stays_a_ring_as_round_as_it_is() -> None:
    t = np.linspace(0, 2 * np.pi, 61)
    open_at = turned([(20 + 4 * np.cos(a), 4 * np.sin(a)) for a in t], 0.42, 160)
    last = len(open_at.vertices) - 160
    ring = Mesh(open_at.vertices[:last], open_at.faces % last)
    found = turned_about(noisy(ring, 0.005, 3))
    _, chains = wall_profile(found)
    assert [c.closed for c in chains] == [True]
    (outline,) = fit_outlines(chains)[0]
    assert outline.closed
    (arc,) = outline.pieces
    assert isinstance(arc, Arc)
    assert arc.radius == pytest.approx(4, abs=0.02), "means over a bend do not flatten it"
    beside = found.z.copy()
    beside[np.flatnonzero(found.on)[0]] += 20.0  # of another wall, above the ring
    counted = axis_counted(outline, replace(found, z=beside))
    assert counted.box_sigma.max() < 0.1


def test_too_few_points_have_no_noise_to_compare_with() -> None:
    rod = turned([(20, 0), (20, 40)], 2.0, 240)
    for r in roundness(turned_about(noisy(rod, 0.01, 1)), [-19.9, 0.0]):
        assert np.isnan(r.noise) or r.noise > 0
        assert r.radius == pytest.approx(20, abs=5 * r.radius_sigma)


def test_a_low_wall_between_edges_is_not_better_known_than_it_is() -> None:
    found = turned_about(noisy(turned([(30, 0), (30, 3), (0.5, 3)], 1.5, 200), 0.01, 1))
    foot = float(found.z.min())
    rounds = roundness(found, [foot + 0.2, foot + 1.0, foot + 2.0])
    assert len(rounds) == 3
    for r in rounds:
        assert r.radius == pytest.approx(30, abs=4 * r.radius_sigma)
        assert r.radius_sigma < 0.1


def test_beside_an_edge_no_form_is_shown() -> None:
    """There stripes are bent, and the band about the height reaches over the edge."""
    found = turned_about(noisy(turned(SHAFT, 1.0, 120), NOISE, 1))
    low = float(found.z.min())
    for height, known in ((10.0, True), (19.5, False), (32.0, True), (44.6, False)):
        rounds = roundness(found, [low + height])
        assert [np.isfinite(r.noise) for r in rounds] == [known] * len(rounds)
        assert len(rounds) == 1 or not known
        for r in rounds:
            assert not known or r.least_squares < r.noise + 4 * r.sigma


def test_a_wall_in_coarse_steps_has_its_roundness() -> None:
    """Cells between two stripes are empty: they are no part of the turn that was not seen."""
    for steps in (24, 60):
        found = turned_about(noisy(turned([(25, 0), (25, 60)], 0.8, steps), NOISE, 1))
        (one,) = roundness(found, [0.0])
        assert one.covered == 1.0
        assert one.radius == pytest.approx(25, abs=0.01)


def test_what_moves_all_points_outward_counts_in_the_diameter() -> None:
    mesh = noisy(turned([(25, 0), (25, 60)], 1.0, 120), NOISE, 1)
    out = mesh.vertices * [1, 1, 0] / 25
    plain, unsure = (turned_about(mesh, moves) for moves in ((), (0.01 * out, 0.02 * out)))
    (one,), (other,) = roundness(plain, [0.0]), roundness(unsure, [0.0])
    assert one.radius_sigma < 0.005
    assert other.radius_sigma == pytest.approx(np.hypot(0.01, 0.02), rel=0.05)
    cut, chains = wall_profile(unsure)
    assert cut.turned
    (wall,) = (p for o in fit_outlines(chains)[0] for p in axis_counted(o, unsure).pieces)
    assert isinstance(wall, Line)
    assert wall.sigma == pytest.approx(np.hypot(0.01, 0.02), rel=0.05)


@pytest.mark.parametrize("around", [40, 80])
def test_a_wall_in_coarse_steps_ends_where_it_was_measured(around: int) -> None:
    """The last millimetres bend inward, as a rim does: less than a step of the mesh about the axis,
    several along the wall."""
    turn = np.deg2rad(np.linspace(0, 75, 12))
    rim = np.column_stack([35 - 2 * (1 - np.cos(turn)), 58 + 2 * np.sin(turn)])
    mesh = noisy(turned([(25.0, 0.0), *map(tuple, rim)], 0.35, around), 0.02, around)
    about = turned_about(mesh)
    assert about.spacing > (1.5 if around == 40 else 0.9)
    cut, chains = wall_profile(about)
    (outline,) = fit_outlines(chains)[0]
    section = FittedSection(cut, chains, ((axis_counted(outline, about),),))
    height = float(np.ptp(section.box[:, 1]))
    known = float(section.size_sigma[1])
    assert abs(height - rim[-1, 1]) < 2 * known
    assert 0.1 < known < 0.4
