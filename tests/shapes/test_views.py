"""Silhouettes and the unrolled surface of parts that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from tests.shapes.outlines import along, regular, wall
from turnscan.drawings import write_section_dxf, write_section_json, write_section_svg
from turnscan.errors import InputError
from turnscan.mesh import Mesh, Provenance
from turnscan.shapes import Arc, Spline, fit_section
from turnscan.shapes.views import silhouette_cut, unrolled_cut
from turnscan.simulate import part


def _torus(ring: float = 20.0, tube: float = 6.0) -> Mesh:
    n, m = 96, 48
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    r = ring + tube * np.cos(v)
    points = np.stack([r * np.cos(u), r * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(points, faces.astype(np.int32))


def test_a_torus_has_two_rings_from_above_and_a_slot_from_beside() -> None:
    above = fit_section(_torus(), silhouette_cut([0, 0, 1]))
    circles = sorted(p.radius for o in above.fitted for p in o.pieces if isinstance(p, Arc))
    # Chords of a circle of 96 lie up to 0.05 % inside of it.
    assert np.allclose(circles, [14.0, 26.0], rtol=6e-4)
    beside = fit_section(_torus(), silhouette_cut([1, 0, 0]))
    assert np.allclose(np.ptp(beside.box, axis=0), [52.0, 12.0], rtol=1e-3)


@given(seed=st.integers(0, 2**16), direction=st.tuples(*[st.floats(-1, 1)] * 3))
@settings(max_examples=20, deadline=None)
def test_the_silhouette_of_a_convex_body_is_the_hull_of_its_vertices(
    seed: int, direction: tuple[float, float, float]
) -> None:
    if np.linalg.norm(direction) < 0.1:
        return
    points = np.random.default_rng(seed).normal(0, 10, (14, 3))
    hull = ConvexHull(points)
    t = points[hull.simplices]
    out = np.einsum("ij,ij->i", np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), t.mean(axis=1))
    away = out - np.einsum("ij,j->i", np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]),
                           points.mean(axis=0))  # fmt: skip
    faces = np.where((away > 0)[:, None], hull.simplices, hull.simplices[:, ::-1])
    cut = silhouette_cut(direction)
    [chain] = fit_section(Mesh(points, faces.astype(np.int32)), cut).chains
    flat = ConvexHull(points @ np.stack([cut.right, cut.up], axis=1))
    x, y = chain.points.T
    area = float(np.roll(x, 1) @ y - x @ np.roll(y, 1)) / 2
    # Material lies on the left; Clipper rounds to 1e-8 of the whole or so.
    assert area == pytest.approx(flat.volume, rel=1e-5)


def test_a_silhouette_says_that_the_outermost_points_stand_out() -> None:
    sigma, true = 0.02, 20.0
    body = wall(along(regular(6, true, 0.0), 0.5), np.linspace(0, 20, 41), sigma)
    section = fit_section(body, silhouette_cut([1, 0, 0]))
    off = float(np.ptp(section.box, axis=0)[0]) - true * np.sqrt(3)
    # The outermost of some 1600 points each side, so outside the true size, and told as doubt.
    assert 0 < off < 4 * section.size_sigma[0]
    assert sigma < section.size_sigma[0] < 4 * sigma
    with pytest.raises(InputError, match="no faces that are seen from there"):
        fit_section(wall(regular(6, true), np.array([0.0, 9.0]), None), silhouette_cut([0, 0, 1]))


def _lobes(sigma: float, depth: float = 2.0) -> Mesh:
    t = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    r = 20 + depth * np.cos(3 * t)
    return wall(np.stack([r * np.cos(t), r * np.sin(t)], axis=1), np.linspace(5, 35, 31), sigma)


def test_lines_of_equal_radius_stand_where_the_radius_is() -> None:
    section = fit_section(_lobes(0.005), unrolled_cut())
    relief = section.relief
    assert relief is not None
    assert np.allclose(relief.box[:, 1], (5, 35))
    assert set(relief.levels) <= {18.5, 19.0, 19.5, 20.0, 20.5, 21.0, 21.5}
    assert len(set(relief.levels)) >= 5
    for chain, level in zip(section.chains, relief.levels, strict=True):
        phi = chain.points[:, 0] / relief.radius
        assert np.abs(20 + 2 * np.cos(3 * phi) - level).max() < 0.05
        assert chain.length > 29
    phi = (np.arange(relief.r.shape[1]) + 0.5) / relief.r.shape[1] * 2 * np.pi - np.pi
    inside = relief.r[3:-3]
    assert np.isfinite(inside).all()
    assert np.abs(inside - (20 + 2 * np.cos(3 * phi))).max() < 0.06


def test_noise_has_no_lines_of_equal_radius_and_what_has_no_outside_is_refused() -> None:
    section = fit_section(_lobes(0.05, depth=0.0), unrolled_cut())
    assert section.relief is not None
    assert not section.chains
    inward = _lobes(0.0)
    with pytest.raises(InputError, match="looks away from the z axis"):
        fit_section(Mesh(inward.vertices, inward.faces[:, ::-1].copy()), unrolled_cut())
    with pytest.raises(InputError, match="no faces"):
        fit_section(Mesh(np.eye(3), np.zeros((0, 3), np.int32)), unrolled_cut())


def test_a_noisy_head_from_the_side_has_no_arc() -> None:
    true = part("head").mesh
    n = len(true.vertices)
    none = np.zeros(n, np.int32)
    noise = np.random.default_rng(1).normal(0, 0.03, (n, 3))
    known = Provenance(np.full(n, 0.03), none, none, none, ("laser",))
    head = fit_section(Mesh(true.vertices + noise, true.faces, known), silhouette_cut([0, 1, 0]))
    outline = max(head.fitted, key=lambda o: float(np.ptp(o.box)))
    assert not any(isinstance(p, Arc) for p in outline.pieces)
    assert sum(p.length for p in outline.pieces if isinstance(p, Spline)) > 200
    assert max(p.rest.rms for p in outline.pieces) < 0.06


def test_views_are_drawn_beside_sections() -> None:
    import io
    import json

    import ezdxf

    body = _lobes(0.005)
    both = [fit_section(body, c) for c in (silhouette_cut([0, 0, 1]), unrolled_cut())]
    for version in ("R12", "R2010"):
        document = ezdxf.read(io.StringIO(write_section_dxf(both, version, {}).decode()))
        assert not document.audit().errors
        kind = "POLYLINE" if version == "R12" else "LWPOLYLINE"
        lines = document.modelspace().query(kind)
        heights = {float(np.ravel(e.dxf.get("elevation", 0.0))[-1]) for e in lines}
        assert {0.0, 19.0, 21.0} <= heights
    assert b"data:image/png" in write_section_svg(both, "part", {})
    report = json.loads(write_section_json(both, {}))["sections"]
    assert [s["view"] for s in report] == ["silhouette", "unrolled"]
    assert len(report[1]["relief"]["r_mm"][0]) == 480


@pytest.mark.parametrize("shift", [0.0, 60.0])
def test_large_flat_faces_are_unrolled_as_flat(shift: float) -> None:
    a, x = np.linspace(0, 2 * np.pi, 4, endpoint=False) + np.pi / 4, np.array([shift, 0.0])
    square = 20 * np.sqrt(2) * np.stack([np.cos(a), np.sin(a)], axis=1) + x
    section = fit_section(wall(square, np.array([0.0, 30.0]), None), unrolled_cut())
    assert section.relief is not None
    r = section.relief.r[section.relief.r.shape[0] // 2]
    phi = (np.arange(len(r)) + 0.5) / len(r) * 2 * np.pi - np.pi
    if not shift:
        assert np.abs(r - 20 / np.maximum(np.abs(np.cos(phi)), np.abs(np.sin(phi)))).max() < 0.014
        assert section.relief.levels.tolist() == np.repeat(np.arange(21.0, 28.0), 8).tolist()
        assert all(np.ptp(c.points[:, 1]) > 29.9 for c in section.chains)
        return
    # Lines of five points each, and yet all there.
    assert section.relief.levels.tolist() == np.repeat(np.arange(45.0, 81.0, 5.0), 2).tolist()
    assert all(np.ptp(c.points[:, 1]) > 29.9 for c in section.chains)
    beside = np.abs(phi) > np.arctan2(20, 40) + 0.01
    assert np.isnan(r[beside]).all()
    facing = np.abs(phi) < 0.2
    assert np.abs(r - 80 / np.cos(phi))[facing].max() < 0.014


def test_a_vertex_on_the_seam_may_have_either_zero() -> None:
    body = _lobes(0.0)
    flipped = body.vertices.copy()
    seam = (np.abs(flipped[:, 1]) < 1e-9) & (flipped[:, 0] < 0)
    flipped[seam, 1] = -0.0
    assert seam.sum() == 31
    section = fit_section(Mesh(flipped, body.faces), unrolled_cut())
    assert section.relief is not None
    phi = (np.arange(480) + 0.5) / 480 * 2 * np.pi - np.pi
    assert np.abs(section.relief.r[5] - (20 + 2 * np.cos(3 * phi))).max() < 0.06


@pytest.mark.parametrize("direction", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0, 0, -1), (3, -4, 5)])
def test_a_silhouette_is_seen_from_where_it_was_asked(direction: tuple[float, ...]) -> None:
    cut = silhouette_cut(direction)
    n = np.array(direction) / np.linalg.norm(direction)
    assert np.allclose(np.cross(cut.right, cut.up), n)
    assert cut.name == f"silhouette from {n[0]:.6g}, {n[1]:.6g}, {n[2]:.6g}"
    with pytest.raises(InputError):
        silhouette_cut([1e200, 1e308, 1.7e308])
