"""Lines, arcs and splines fitted to chains: what is found, and whether its uncertainty is true."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.shapes.outlines import along, arc, chain_of, regular, rounded_polygon, wall
from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.shapes import (
    Arc,
    Line,
    Outline,
    Spline,
    fit_outlines,
    fit_section,
    plane_cut,
)
from turnscan.shapes._section import cross_section


def _kinds(outline: Outline) -> str:
    letters = {Line: "l", Arc: "a", Spline: "s"}
    return "".join(letters[type(p)] for p in outline.pieces)


def _noisy(points: Floats, sigma: float, seed: int) -> Floats:
    return points + np.random.default_rng(seed).normal(0, sigma, points.shape)


@pytest.mark.parametrize("known", [True, False])
def test_a_circle_is_a_circle_and_its_uncertainty_is_true(known: bool) -> None:
    sigma, n, radius = 0.02, 240, 12.0
    z, sizes = [], []
    t = 2 * np.pi * np.arange(n) / n
    clean = 3.0 + radius * np.stack([np.cos(t), np.sin(t)], axis=1)
    for seed in range(40):
        [[o]] = fit_outlines([chain_of(_noisy(clean, sigma, seed), sigma if known else None)])
        [p] = o.pieces
        assert isinstance(p, Arc)
        assert p.full
        assert o.closed
        assert p.sweep > 0
        z.append((p.radius - radius) / p.radius_sigma)
        sizes.append(p.radius_sigma)
        assert np.abs(p.centre - 3.0).max() < 4 * p.centre_sigma.max()
    # The radius of n points is known to σ/√n.
    assert np.allclose(sizes, sigma / np.sqrt(n), rtol=0.25)
    assert np.abs(z).max() < 3.6
    assert 0.75 < float(np.std(z)) < 1.25


def test_points_that_share_vertices_are_not_counted_twice() -> None:
    """Each vertex of a wall has a say in two or three points of a section."""
    sigma, n, radius = 0.03, 200, 20.0
    t = 2 * np.pi * np.arange(n) / n
    clean = radius * np.stack([np.cos(t), np.sin(t)], axis=1)
    z = []
    for seed in range(40):
        mesh = wall(clean, np.array([0.0, 1.0, 2.0]), sigma, seed)
        [p] = fit_section(mesh, plane_cut([0, 0, 1], 0.7)).fitted[0].pieces
        assert isinstance(p, Arc)
        z.append((p.radius - radius) / p.radius_sigma)
    assert 0.7 < float(np.sqrt(np.mean(np.square(z)))) < 1.25


def test_a_coarse_round_wall_has_the_radius_of_its_vertices() -> None:
    """A section through sides of faces lies on chords, 0.2 % within the radius here."""
    t = 2 * np.pi * np.arange(50) / 50
    mesh = wall(10 * np.stack([np.cos(t), np.sin(t)], axis=1), np.array([0.0, 5.0]), None)
    [p] = fit_section(mesh, plane_cut([0, 0, 1], 2.2)).fitted[0].pieces
    assert isinstance(p, Arc)
    assert abs(p.radius - 10.0) < 1e-4
    [chain] = cross_section(mesh, plane_cut([0, 0, 1], 2.2))
    assert np.linalg.norm(chain.points, axis=1).min() < 10 - 0.015


@pytest.mark.parametrize("sigma", [0.002, 0.02])
def test_a_rounded_rectangle_is_four_lines_and_four_tangent_arcs(sigma: float) -> None:
    a, b, r = 20.0, 12.0, 4.0
    corners = np.array([[a, -b], [a, b], [-a, b], [-a, -b]])
    clean = rounded_polygon(corners, r, 0.3)
    z, wide = [], []
    for seed in range(12):
        [[o]] = fit_outlines([chain_of(_noisy(clean, sigma, seed), sigma)])
        assert sorted(_kinds(o)) == list("aaaallll"), _kinds(o)
        assert all(p.joint == "tangent" for p in o.pieces)
        for p, q in zip(o.pieces, (*o.pieces[1:], o.pieces[0]), strict=True):
            assert np.linalg.norm(p.end - q.start) < 1e-6
        arcs = [p for p in o.pieces if isinstance(p, Arc)]
        z += [(p.radius - r) / p.radius_sigma for p in arcs]
        distances = sorted((s.value, s.sigma) for s in o.sizes if s.kind == "distance")
        assert len(distances) == 2
        wide += [(d - w) / u for (d, u), w in zip(distances, (2 * b, 2 * a), strict=True)]
        assert np.abs(np.array([d for d, _ in distances]) - [2 * b, 2 * a]).max() < 4 * sigma
    assert np.abs(z).max() < 5
    assert 0.6 < float(np.sqrt(np.mean(np.square(z)))) < 1.5
    assert 0.5 < float(np.sqrt(np.mean(np.square(wide)))) < 1.5


def test_a_hexagon_has_six_lines_and_true_angles() -> None:
    sigma = 0.01
    z = []
    for seed in range(10):
        mesh = wall(along(regular(6, 20.0), 0.4), np.array([0.0, 0.5, 1.0]), sigma, seed)
        [o] = fit_section(mesh, plane_cut([0, 0, 1], 0.3)).fitted
        assert _kinds(o) == "llllll"
        angles = [s for s in o.sizes if s.kind == "angle"]
        assert len(angles) == 6
        z += [(s.value - np.deg2rad(120)) / s.sigma for s in angles]
        across = [s for s in o.sizes if s.kind == "distance"]
        assert len(across) == 3
        z += [(s.value - 20 * np.sqrt(3)) / s.sigma for s in across]
        # The corner stands where the sides meet, not where the mesh cuts it.
        corner = min(np.linalg.norm(p.start - regular(6, 20.0)[0]) for p in o.pieces)
        assert corner < 5 * sigma
    assert 0.6 < float(np.sqrt(np.mean(np.square(z)))) < 1.4


def test_a_polygon_of_a_cad_file_stays_one() -> None:
    """Its corners lie on a circle, and so, on chords of it, does all else."""
    [[o]] = fit_outlines([chain_of(regular(6, 20.0))])
    assert _kinds(o) == "llllll"


def _bust(n: int) -> Floats:
    t = np.linspace(0, 1, n)
    r = 20 + 6 * np.sin(8.2 * t) + 3 * np.sin(19.5 * t + 1) + 1.5 * np.sin(33 * t)
    return np.stack([r, 100 * t], axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_a_freeform_section_is_a_spline_without_invented_arcs(seed: int) -> None:
    [[o]] = fit_outlines([chain_of(_noisy(_bust(700), 0.02, seed), 0.02, closed=False)])
    assert "a" not in _kinds(o)
    # Where an S turns over, a short line may be all that the noise tells.
    assert sum(p.rest.count for p in o.pieces if isinstance(p, Spline)) > 0.9 * 700
    off = np.concatenate([np.abs(p.distances(_bust(700))) for p in o.pieces]).reshape(
        len(o.pieces), -1
    )
    # What is left is noise that the spline follows, far below that of a point.
    rms = float(np.sqrt(np.mean(off.min(axis=0) ** 2)))
    assert 0.001 < rms < 0.012
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    ellipse = np.stack([30 * np.cos(t), 20 * np.sin(t)], axis=1)
    [[o]] = fit_outlines([chain_of(_noisy(ellipse, 0.01, seed), 0.01)])
    assert set(_kinds(o)) == {"s"}, _kinds(o)
    assert o.closed
    assert np.linalg.norm(o.pieces[0].start - o.pieces[-1].end) < 1e-9


def test_a_corner_whose_points_scatter_more_than_the_rest_is_known_worse() -> None:
    corners = np.array([[-30, -20], [30, -20], [30, 20], [-30, 20]], dtype=float)
    points = rounded_polygon(corners, 8.0, 0.5)
    rough = (points > [22.0, 12.0]).all(axis=1)
    off, known = list[float](), list[tuple[float, float]]()
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(0, 0.03, points.shape)
        made = points + np.where(rough[:, None], 4.0, 1.0) * noise
        [[o]] = fit_outlines([chain_of(made, 0.03)], tolerance=0.3)
        arcs = {bool((p.centre > 0).all()): p for p in o.pieces if isinstance(p, Arc)}
        off.append((arcs[True].radius - 8.0) / arcs[True].radius_sigma)
        known.append((arcs[True].radius_sigma, arcs[False].radius_sigma))
    assert 0.4 < float(np.sqrt(np.mean(np.square(off)))) < 1.5
    worse, usual = np.median(known, axis=0)
    assert 1.4 < worse / usual < 6.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("waves", "height"), [(9, 0.9), (12, 0.6), (14, 0.35)])
def test_a_wavy_section_is_splines_however_rough_its_points(
    seed: int, waves: int, height: float
) -> None:
    """Each stretch of a wave is as well a line or an arc, as far as its own few points tell."""
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    r = 28 + height * np.sin(waves * t + seed) + 2 * np.cos(2 * t)
    wavy = np.stack([1.1 * r * np.cos(t), r * np.sin(t)], axis=1)
    [[o]] = fit_outlines([chain_of(_noisy(wavy, 0.08, seed), 0.08)])
    assert set(_kinds(o)) == {"s"}, _kinds(o)
    off = np.min([np.abs(p.distances(wavy)) for p in o.pieces], axis=0)
    assert 0.005 < float(np.sqrt(np.mean(off**2))) < 0.06


def test_a_spike_pulls_no_line() -> None:
    clean = along(np.array([[0, 0], [30, 0], [30, 20], [0, 20.0]]), 0.4)
    noisy = _noisy(clean, 0.01, 1)
    noisy[30] += [0.0, -1.5]
    [[o]] = fit_outlines([chain_of(noisy, 0.01)])
    assert abs(o.box[1, 0] - o.box[0, 0] - 30) < 0.02
    lines = [p for p in o.pieces if isinstance(p, Line) and not p.link and p.length > 10]
    assert 4 <= len(lines) <= 5


def test_the_tolerance_decides_what_is_said() -> None:
    t = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    wavy = (10 + 0.05 * np.cos(9 * t))[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)
    [[coarse]] = fit_outlines([chain_of(wavy)], 0.3)
    [p] = coarse.pieces
    assert isinstance(p, Arc)
    assert 0.045 < p.rest.worst < 0.055
    [[fine]] = fit_outlines([chain_of(wavy)], 0.01)
    assert len(fine.pieces) > 1 or isinstance(fine.pieces[0], Spline)
    assert max(p.rest.worst for p in fine.pieces) < 0.02
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="tolerance"):
            fit_outlines([chain_of(wavy)], bad)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    count=st.integers(3, 7),
    size=st.floats(12.0, 40.0),
    turn=st.floats(0, 6.0),
    share=st.floats(0.15, 0.55),
    sigma=st.sampled_from([0.003, 0.01]),
    seed=st.integers(0, 1000),
)
def test_random_rounded_polygons_are_lines_and_arcs(
    count: int, size: float, turn: float, share: float, sigma: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(turn + 2 * np.pi * (np.arange(count) + 0.3 * rng.random(count)) / count)
    corners = size * np.stack([np.cos(t), np.sin(t)], axis=1)
    radius = share * size * np.cos(np.pi / count) * 0.8
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    u, v = corners - before, after - corners
    sides = np.linalg.norm(u, axis=1)
    turns = np.arccos(np.einsum("ij,ij->i", u, v) / (sides * np.roll(sides, -1)))
    reach = np.tan(turns / 2)
    radius = min(radius, 0.8 * float((sides / (reach + np.roll(reach, 1))).min()))
    clean = rounded_polygon(corners, radius, 0.2)
    [[o]] = fit_outlines([chain_of(_noisy(clean, sigma, seed), sigma)])
    pieces = o.pieces
    for p, q in zip(pieces, (*pieces[1:], pieces[0]), strict=True):
        assert np.linalg.norm(p.end - q.start) < 1e-6, "closed"
    # Nothing leads away from the points, and no point is left out.
    curve = o.sampled(0.001)
    from scipy.spatial import cKDTree

    dense = along(clean, 0.02)
    assert cKDTree(dense).query(curve)[0].max() < 8 * sigma + 0.02
    off = np.min([np.abs(p.distances(clean)) for p in pieces], axis=0)
    assert off.max() < 6 * sigma
    arcs = [p for p in pieces if isinstance(p, Arc)]
    lines = [p for p in pieces if isinstance(p, Line)]
    assert len(arcs) == len(lines) == count, _kinds(o)
    # A line that was not found tangent, of some hundred, leaves an arc freer than its sigma says.
    z = [(p.radius - radius) / p.radius_sigma for p in arcs]
    assert np.abs(z).max() < 6.5


def test_an_arc_and_lines_of_an_open_chain_keep_their_ends() -> None:
    p = np.concatenate([
        along(np.array([[0.0, 0.0], [20.0, 0.0]]), 0.2)[:100],
        arc(np.array([20.0, 5.0]), 5.0, -np.pi / 2, np.pi, 0.2),
    ])  # fmt: skip
    [[o]] = fit_outlines([chain_of(_noisy(p, 0.005, 3), 0.005, closed=False)])
    assert _kinds(o) == "la"
    assert not o.closed
    assert o.pieces[1].joint == "tangent"
    assert np.linalg.norm(o.pieces[0].start - p[0]) < 0.03
    assert np.linalg.norm(o.pieces[1].end - p[-1]) < 0.03
    assert isinstance(last := o.pieces[1], Arc)
    assert abs(np.rad2deg(last.sweep) - 180) < 1.0


def test_a_piece_that_is_badly_known_spoils_no_other_outline() -> None:
    """Three points that were seen at grazing incidence beside a good outline."""
    whole = _noisy(along(regular(6, 20.0), 0.5), 0.02, 1)
    sliver = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]])
    [[alone]] = fit_outlines([chain_of(whole, 0.02)])
    [beside], none = fit_outlines([chain_of(whole, 0.02), chain_of(sliver, 0.5, closed=False)])
    assert not none
    assert beside.tolerance == alone.tolerance < 0.15
    assert _kinds(beside) == "llllll"


def test_an_open_outline_knows_where_its_ends_are_to_one_step() -> None:
    """Where the measuring stopped the part may go on to where the next point would have been."""
    step = 0.5
    flat = np.column_stack([step * np.arange(80), np.zeros(80)])
    [[o]] = fit_outlines([chain_of(_noisy(flat, 0.01, 3), 0.01, closed=False)])
    assert o.box_sigma[:, 0] == pytest.approx(step / np.sqrt(3), rel=0.05)
    assert o.box_sigma[:, 1].max() < 0.02
    [[whole]] = fit_outlines([chain_of(_noisy(along(regular(4, 20.0), step), 0.01, 3), 0.01)])
    assert whole.box_sigma.max() < 0.03


@pytest.mark.parametrize("count", [4, 7, 12])
def test_a_speck_inside_its_noise_is_no_circle_and_encloses_nothing(count: int) -> None:
    """What closes round two lines, or a circle of unknown radius, is drawn as it was measured."""
    ring = regular(count, 1.0)
    for size in (0.05, 0.1, 0.2):
        for seed in range(3):
            [row] = fit_outlines([chain_of(_noisy(size * ring, 0.1, seed), 0.1)])
            for o in row:
                assert len(o.pieces) > 2, _kinds(o)
                assert all(p.radius_sigma <= p.radius / 2 for p in o.pieces if isinstance(p, Arc))
                assert np.ptp(o.box, axis=0).min() > 0.1
    [row] = fit_outlines([chain_of(0.05 * ring, 0.1)])
    assert not row
    [known] = fit_outlines([chain_of(_noisy(regular(24, 1.0), 0.1, 1), 0.1)])
    assert _kinds(known[0]) == "a"


def test_fillets_of_few_points_count_that_their_ends_are_not_sure() -> None:
    """Three to five points on an arc: with one more or less its radius is another."""
    sigma, radius, z, known = 0.01, 0.6, [], []
    clean = rounded_polygon(regular(4, 20.0), radius, 0.2)
    for seed in range(12):
        [[o]] = fit_outlines([chain_of(_noisy(clean, sigma, seed), sigma)])
        arcs = [p for p in o.pieces if isinstance(p, Arc)]
        z += [(p.radius - radius) / p.radius_sigma for p in arcs]
        known += [p.radius_sigma for p in arcs]
    assert len(z) >= 46
    assert np.abs(z).max() < 4.0
    assert 0.7 < float(np.std(z)) < 1.3
    assert 0.012 < float(np.mean(known)) < 0.03


def test_an_arc_whose_bow_is_lost_in_its_radius_is_a_line() -> None:
    """Its curvature was dropped where the equations were solved: R17720 ± 19 of a straight wall."""
    dice = np.random.default_rng(0)
    z = np.linspace(0, 36, 28)
    bow = 0.012 * (1 - (z / 18 - 1) ** 2)
    points = np.column_stack([18 + bow + dice.normal(0, 1e-3, len(z)), z])
    (outline,) = fit_outlines([chain_of(points, 1e-3, closed=False)], 0.02)[0]
    assert [type(p).__name__ for p in outline.pieces] == ["Line"]
