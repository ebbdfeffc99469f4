"""Sections of scans with few steps: what steps cut off is no face, and what is stated is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.shapes.outlines import chain_of, regular, seen_from_the_axis, wall
from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes import Arc, Line, Outline, fit_outlines, fit_section, plane_cut
from turnscan.surface.decimation import decimate
from turnscan.workflows._solids._sections import section_in_words

SIGMA = 0.02
STEPS = (20, 24, 30, 36, 48, 60)
PHASES = np.arange(6) / 6
HEXAGON = regular(6, 40 / np.sqrt(3), 0.0)
BOX = regular(4, 20 * np.sqrt(2), np.pi / 4)
PLATE = np.array([[25.0, -10], [25, 10], [-25, 10], [-25, -10]])
PARTS = {"hexagon": (HEXAGON, (40.0,)), "box": (BOX, (40.0,)), "plate": (PLATE, (50.0, 20.0))}
DEEP = np.arange(5) * 0.5


def _section(corners: Floats, steps: int, phase: float, sigma: float = SIGMA) -> Outline:
    outline = seen_from_the_axis(corners, steps, phase)
    mesh = wall(outline, DEEP, sigma, seed=int(100 * phase))
    [o] = fit_section(mesh, plane_cut([0, 0, 1], 0.7)).fitted
    return o


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("part", PARTS)
def test_every_stated_size_is_right_within_its_uncertainty(part: str, steps: int) -> None:
    corners, true = PARTS[part]
    angle = np.deg2rad(120.0 if part == "hexagon" else 90.0)
    ratios = []
    for phase in PHASES:
        o = _section(corners, steps, phase)
        for s in o.sizes:
            right = true if s.kind == "distance" else (angle,)
            ratios.append(min(abs(s.value - t) for t in right) / (2 * s.sigma))
        width = np.ptp(corners, axis=0)
        u = np.hypot(*o.box_sigma)
        ratios += list(np.abs(np.ptp(o.box, axis=0) - width) / (2 * u))
    assert max(ratios) < 1.4
    assert np.mean(np.array(ratios) < 1.0) > 0.9, "twice the standard uncertainty holds 95 %"


@pytest.mark.parametrize("part", PARTS)
def test_faces_of_enough_stripes_have_their_sizes(part: str) -> None:
    corners, _ = PARTS[part]
    for phase in PHASES:
        sizes = _section(corners, 60, phase).sizes
        assert sum(s.kind == "distance" for s in sizes) == len(corners) // 2


def test_a_chord_between_two_stripes_carries_no_size() -> None:
    """With 20 steps a stripe lies in the middle of each side of a box; the corners are cut off."""
    o = _section(BOX, 20, 0.0)
    chords = [p for p in o.pieces if isinstance(p, Line) and p.rest.count == 3 and p.length < 10]
    assert len(chords) == 4
    assert all(np.isnan(p.length_sigma) for p in o.pieces if isinstance(p, Line))
    assert sorted(round(s.value) for s in o.sizes) == [40, 40]


def test_what_steps_cut_off_is_in_the_uncertainty_of_the_whole_width() -> None:
    corners = regular(6, 40 / np.sqrt(3), 0.0)
    o = _section(corners, 18, 0.5)
    short = 2 * 40 / np.sqrt(3) - np.ptp(o.box, axis=0)[0]
    assert short > 0.5, "chords"
    assert 0.8 * short < 2 * np.hypot(*o.box_sigma[:, 0]) < 3 * short


def test_sides_of_a_drawn_box_are_its_own() -> None:
    """A mesh without sigma was not sampled by stripes: two vertices are all that a side has."""
    drawn = wall(BOX, np.array([0.0, 5.0]), None)
    [o] = fit_section(drawn, plane_cut([0, 0, 1], 2.0)).fitted
    assert [round(s.value, 6) for s in o.sizes if s.kind == "distance"] == [40.0, 40.0]


def test_two_points_of_a_line_of_their_own_are_too_few() -> None:
    points = np.array([[0.0, 0], [30, 0], [30, 10], [0, 10]])
    [[o]] = fit_outlines([chain_of(points, 0.01)])
    assert not o.sizes


def _decimated(corners: Floats, steps: int, phase: float) -> Mesh:
    outline, heights = seen_from_the_axis(corners, steps, phase), np.arange(21) * 0.5
    mesh = wall(outline, heights, SIGMA, seed=int(100 * phase))
    assert mesh.provenance is not None
    step = np.tile(np.arange(steps, dtype=np.int32), len(heights))
    return decimate(replace(mesh, provenance=replace(mesh.provenance, step=step)), tolerance=0.1)


@pytest.mark.parametrize("part", PARTS)
def test_faces_of_a_decimated_scan_keep_right_sizes(part: str) -> None:
    corners, true = PARTS[part]
    ratios, widths = [], 0
    for phase in PHASES:
        [o] = fit_section(_decimated(corners, 60, phase), plane_cut([0, 0, 1], 4.7)).fitted
        found = [s for s in o.sizes if s.kind == "distance"]
        widths += len(found)
        ratios += [min(abs(s.value - t) for t in true) / (2 * s.sigma) for s in found]
    assert widths > 0.7 * len(PHASES) * len(corners) // 2
    assert np.mean(np.array(ratios) < 1.0) > 0.9


def _rounded_box(half: float, radius: float) -> Floats:
    """A square box with arcs of 40 points at its vertices."""
    turn = np.linspace(0, np.pi / 2, 40)
    arc = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1) + half - radius
    return np.vstack([arc @ np.linalg.matrix_power([[0, 1], [-1, 0]], k) for k in range(4)])


@pytest.mark.parametrize("steps", [120, 200])
def test_arcs_of_a_decimated_scan_keep_their_radii(steps: int) -> None:
    """Its points lie on chords of the arcs, which is no noise that a spline could explain."""
    for phase in PHASES[::2]:
        mesh = _decimated(_rounded_box(20.0, 15.0), steps, phase)
        [o] = fit_section(mesh, plane_cut([0, 0, 1], 4.7)).fitted
        arcs = [p for p in o.pieces if isinstance(p, Arc) and p.radius_sigma < 0.1 * p.radius]
        assert len(arcs) == 4, "without the chords: none of most, and one spline"
        assert all(abs(a.radius - 15.0) < 3 * a.radius_sigma for a in arcs)


@pytest.mark.parametrize("steps", [18, 24])
def test_what_coarse_steps_cut_off_has_no_size_when_decimated(steps: int) -> None:
    section = fit_section(_decimated(BOX, steps, 0.5), plane_cut([0, 0, 1], 4.7))
    [o] = section.fitted
    assert o.chords >= 3
    assert all(abs(s.value - 40) < 1 for s in o.sizes if s.kind == "distance")
    assert section_in_words(section)[-1].strip() == (
        f"{o.chords} lines rest on fewer than three measured places: no sizes"
    )


@pytest.mark.parametrize("corners", [BOX, HEXAGON])
def test_sides_that_the_plane_meets_at_two_points_are_a_drawings_own(corners: Floats) -> None:
    drawn = wall(corners, np.array([0.0, 2.0, 5.0]), None)
    [o] = fit_section(drawn, plane_cut([0, 0, 1], 2.0)).fitted
    sizes = [round(s.value, 6) for s in o.sizes if s.kind == "distance"]
    assert sizes == [40.0] * (len(corners) // 2)
    assert np.hypot(*o.box_sigma).max() < 1e-6
    assert not o.chords


def test_a_drawn_hexagonal_prism_is_no_circle() -> None:
    [o] = fit_section(wall(HEXAGON, np.array([0.0, 5.0]), None), plane_cut([0, 0, 1], 2.0)).fitted
    assert [type(p) for p in o.pieces] == [Line] * 6
    twelve = wall(regular(12, 20.0), np.array([0.0, 5.0]), None)
    [o] = fit_section(twelve, plane_cut([0, 0, 1], 2.0)).fitted
    assert isinstance(o.pieces[0], Arc)
    assert o.pieces[0].full


@pytest.mark.parametrize("decimated", [False, True])
def test_noise_bends_no_side_and_a_known_radius_is_kept(decimated: bool) -> None:
    """An arc whose curvature is within the noise of none is a line; of 10 mm each is an arc."""
    false, true = 0, list[float]()
    for k, phase in enumerate(PHASES):
        for corners in (PLATE, HEXAGON, _rounded_box(20.0, 10.0)):
            mesh = _coarse(corners, 60 if len(corners) > 6 else 36, phase + 0.06, decimated, k)
            [o] = fit_section(mesh, plane_cut([0, 0, 1], 4.7)).fitted
            arcs = [p for p in o.pieces if isinstance(p, Arc)]
            assert all(a.radius_sigma <= 0.25 * a.radius for a in arcs)
            round_ = [abs(a.radius - 10.0) / a.radius_sigma for a in arcs if len(corners) > 6]
            true += [z for z in round_ if z < 4]
            false += len(arcs) - sum(z < 4 for z in round_)
    assert false <= 3, "nine and ten, where two standard deviations were enough"
    assert len(true) >= 18
    assert np.mean(np.array(true) < 2) > 0.9


def _coarse(corners: Floats, steps: int, phase: float, decimated: bool, seed: int) -> Mesh:
    """The wall of a part with noise of 0.1 mm."""
    outline, heights = seen_from_the_axis(corners, steps, phase), np.arange(21) * 0.5
    mesh = wall(outline, heights, 0.1, seed=1000 + seed)
    if not decimated:
        return mesh
    assert mesh.provenance is not None
    step = np.tile(np.arange(steps, dtype=np.int32), len(heights))
    return decimate(replace(mesh, provenance=replace(mesh.provenance, step=step)), tolerance=0.2)
