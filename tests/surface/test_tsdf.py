"""The volumetric merge at the borders of surfaces: what is kept, sewn together, and left open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.surface.grids import sheet_faces
from turnscan.mesh import Mesh, Provenance, boundary_loops
from turnscan.mesh._soundness import crossings
from turnscan.surface.fusion import RangeSurface, fuse
from turnscan.surface.fusion import _variance_kernels as kernels

VOXEL = 0.5
RAMP = 1.25


def sheet(begin: float, end: float, ray: tuple[float, float, float], name: str) -> RangeSurface:
    """A level rectangle at z = 0.1, 10 mm wide, seen along ``ray`` from above."""
    x, y = np.linspace(begin, end, round((end - begin) / VOXEL) + 1), np.arange(0, 10.1, VOXEL)
    points = np.stack(np.meshgrid(x, y, [0.1], indexing="ij"), axis=-1).reshape(-1, 3)
    faces = sheet_faces(len(x), len(y))
    some = np.zeros(len(points), np.int32)
    p = Provenance(np.full(len(points), 0.02), some, some, some, (name,))
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return RangeSurface(
        Mesh(points, faces, p),
        points + 500.0 * np.array(ray) / np.linalg.norm(ray),
        up,
    )


def reached(mesh: Mesh) -> tuple[float, float]:
    """mm: from where to where a mesh lies in x."""
    return float(mesh.vertices[:, 0].min()), float(mesh.vertices[:, 0].max())


@pytest.mark.parametrize("slant", [0.0, 2.0, -2.0])
def test_a_surface_to_be_sewn_is_kept_up_to_its_border_at_any_angle(slant: float) -> None:
    low, high = reached(fuse([sheet(0.0, 12.0, (slant, 0.0, 1.0), "one")], VOXEL, RAMP, seam=1))
    # A cube needs all its corners: up to a voxel is lost, and what the slack of a face adds.
    assert 0.0 - VOXEL <= low <= VOXEL
    assert 12.0 - VOXEL <= high <= 12.0 + VOXEL


def test_a_narrow_gap_between_surfaces_is_sewn_and_marked() -> None:
    parts = [sheet(0.0, 8.0, (1.0, 0.0, 1.0), "one"), sheet(10.0, 18.0, (-1.0, 0.0, 1.0), "two")]
    apart, sewn = fuse(parts, VOXEL, RAMP), fuse(parts, VOXEL, RAMP, seam=3)
    assert len(boundary_loops(apart)) == 2
    assert apart.measured is None
    assert len(boundary_loops(sewn)) == 1
    assert sewn.measured is not None
    assert sewn.provenance is not None
    x = sewn.triangles[..., 0]
    made = ~sewn.measured
    assert made[(x.min(axis=1) > 8.0 + VOXEL) & (x.max(axis=1) < 10.0 - VOXEL)].all()
    assert not made[(x.max(axis=1) < 8.0 - VOXEL) | (x.min(axis=1) > 10.0 + VOXEL)].any()
    assert sewn.area_of(made) == pytest.approx(20.0, rel=0.6), "the gap and a voxel on each hand"
    assert np.abs(sewn.vertices[:, 2] - 0.1).max() < VOXEL / 3, "level as what it joins"
    nowhere = sewn.provenance.laser < 0
    assert nowhere.any()
    assert np.isnan(sewn.provenance.sigma[nowhere]).all()
    assert reached(sewn) == pytest.approx((0.0, 18.0), abs=VOXEL), (
        "nothing hangs over the outer border"
    )


def test_a_wide_gap_stays_open() -> None:
    parts = [sheet(0.0, 8.0, (0.0, 0.0, 1.0), "one"), sheet(13.0, 18.0, (0.0, 0.0, 1.0), "two")]
    left = fuse(parts, VOXEL, RAMP, seam=3)
    assert len(boundary_loops(left)) == 2
    assert left.area_of() == pytest.approx(fuse(parts, VOXEL, RAMP).area_of(), rel=0.05)


def test_surfaces_one_far_behind_the_other_are_not_joined() -> None:
    low, high = sheet(0.0, 8.0, (0.0, 0.0, 1.0), "low"), sheet(8.5, 16.0, (0.0, 0.0, 1.0), "high")
    up = np.array([0.0, 0.0, 6.0])
    high = RangeSurface(
        Mesh(high.mesh.vertices + up, high.mesh.faces, high.mesh.provenance),
        high.eyes + up,
        high.normals,
    )
    assert len(boundary_loops(fuse([low, high], VOXEL, RAMP, seam=3))) == 2


def extruded(profile: np.ndarray, out: np.ndarray, sigma: float = 0.02) -> RangeSurface:
    """What is x, z = ``profile`` (m, 2) from 0 to 10 mm in y, of m profiles; seen from ``out``."""
    y = np.arange(0, 10.1, VOXEL)
    faces = sheet_faces(len(profile), len(y))
    points = np.insert(np.repeat(profile, len(y), axis=0), 1, np.tile(y, len(profile)), axis=1)
    ways = np.repeat(np.insert(out, 1, 0.0, axis=1), len(y), axis=0)
    step = np.repeat(np.arange(len(profile), dtype=np.int32), len(y))
    line = np.tile(np.arange(len(y), dtype=np.int32), len(profile))
    p = Provenance(np.full(len(points), sigma), np.zeros_like(step), step, line, ("one",))
    return RangeSurface(Mesh(points, faces, p), points + 500.0 * ways, ways)


def test_a_round_part_in_coarse_steps_is_not_cut_short_by_its_chords() -> None:
    step = 0.25
    lost = 10.0 * (1 - np.cos(step / 2)) * 2 / 3
    phi = np.arange(-1.0, 1.0 + step / 2, step)
    out = np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    x = fuse([extruded(10.0 * out, out)], VOXEL, RAMP).vertices
    off = np.hypot(x[:, 0], x[:, 2]) - 10.0
    assert abs(off.mean()) < 0.15 * lost
    assert np.abs(off).max() < lost


@pytest.mark.parametrize("turn", [10.0, 30.0, 50.0])
@pytest.mark.parametrize("at", [0.0, 0.3, 0.5])
def test_nothing_bulges_beside_an_edge(turn: float, at: float) -> None:
    """A roof whose ridge lies anywhere in a step of 1 mm, its normals smooth over it."""
    slope = np.tan(np.deg2rad(turn / 2))
    x = np.arange(-8.0, 8.5) + at
    steep = np.clip(-x / 4.0, -1.0, 1.0) * np.deg2rad(turn / 2)
    roof = extruded(
        np.stack([x, -slope * np.abs(x)], axis=-1),
        np.stack([-np.sin(steep), np.cos(steep)], axis=-1),
        1e-3,
    )
    assert np.abs(roof.bend).max() < 1e-9
    done = fuse([roof], VOXEL, RAMP).vertices
    off = (done[:, 2] + slope * np.abs(done[:, 0])) * np.cos(np.deg2rad(turn / 2))
    aside = np.abs(done[:, 0])
    inner = aside < 6.5
    assert np.abs(off[inner & (aside > 3.0)]).max() < 2e-3
    assert off[inner].max() < 2e-3, "nowhere over the roof"


@pytest.mark.parametrize(("apart", "averaged"), [(0.05, True), (0.2, False)])
def test_two_surfaces_meet_where_the_squares_in_sigmas_are_least(
    apart: float, averaged: bool
) -> None:
    """The surer one has the say of the ratio of the variances; beyond three sigma all of it."""
    low, high = 0.1, 0.1 + apart
    parts = []
    for height, sigma in ((low, 0.02), (high, 0.04)):
        part = sheet(0.0, 12.0, (0.0, 0.0, 1.0), f"at {height}")
        points = part.mesh.vertices + (0.0, 0.0, height - 0.1)
        assert part.mesh.provenance is not None
        known = replace(part.mesh.provenance, sigma=np.full(len(points), sigma))
        parts.append(replace(part, mesh=replace(part.mesh, vertices=points, provenance=known)))
    inside = fuse(parts, VOXEL, RAMP).vertices
    inside = inside[(np.abs(inside[:, 0] - 6.0) < 3.0) & (np.abs(inside[:, 1] - 5.0) < 2.0)]
    assert len(inside) > 50
    weights = np.array([1 / 0.02**2, 1 / 0.04**2])
    best = float(weights @ (low, high) / weights.sum()) if averaged else low
    assert inside[:, 2] == pytest.approx(best, abs=0.01)


def test_two_surfaces_share_what_goes_beyond_noise() -> None:
    """Noise of two averages out, an edge or a chord that both are doubted for does not."""
    parts = []
    for name in ("one", "two"):
        part = sheet(0.0, 12.0, (0.0, 0.0, 1.0), name)
        assert part.mesh.provenance is not None
        doubted = part.mesh.vertices[:, 0] > 8.0
        known = replace(part.mesh.provenance, sigma=np.where(doubted, 0.1, 0.02))
        parts.append(replace(part, mesh=replace(part.mesh, provenance=known)))

    def usual(surfaces: list[RangeSurface], low: float, high: float) -> float:
        done = fuse(surfaces, VOXEL, RAMP)
        assert done.provenance is not None
        x = done.vertices[:, 0]
        return float(np.median(done.provenance.sigma[(x > low) & (x < high)]))

    plain = usual(parts, 2.0, 6.0) / usual(parts[:1], 2.0, 6.0)
    doubtful = usual(parts, 9.0, 11.0) / usual(parts[:1], 9.0, 11.0)
    assert plain == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert doubtful > 0.9


@pytest.mark.parametrize("worse", [5.0, 30.0, 100.0])
def test_what_is_known_far_worse_than_usual_says_so_when_it_is_merged(worse: float) -> None:
    """No point counts for less than a tenth of sigma's inverse, but each keeps its own sigma."""
    part = sheet(0.0, 24.0, (0.0, 0.0, 1.0), "one")
    assert part.mesh.provenance is not None
    doubted = part.mesh.vertices[:, 0] > 18.0
    known = replace(part.mesh.provenance, sigma=np.where(doubted, worse * 0.02, 0.02))
    done = fuse([replace(part, mesh=replace(part.mesh, provenance=known))], VOXEL, RAMP)
    assert done.provenance is not None
    x, sigma = done.vertices[:, 0], done.provenance.sigma
    plain, bad = (np.median(sigma[(x > a) & (x < b)]) for a, b in ((4, 16), (20, 23)))
    assert plain <= 0.02
    assert bad == pytest.approx(worse * 0.02, rel=0.1)


@pytest.mark.parametrize("height", [0.0, -0.1, -0.104])
def test_a_surface_that_passes_by_the_corners_of_voxels_has_no_needles(height: float) -> None:
    """Marching cubes puts up to six vertices next to each other there."""
    flat = sheet(0.0, 12.0, (0.3, 0.2, 1.0), "one")
    tilt = np.array([0.0, 0.0, height - 0.1])
    X = flat.mesh.vertices + tilt + 0.02 * flat.mesh.vertices[:, :1] * np.array([0.0, 0.0, 1.0])
    made = fuse([replace(flat, mesh=replace(flat.mesh, vertices=X))], VOXEL, RAMP)
    ends = made.vertices[made.faces]
    sides = np.linalg.norm(ends - np.roll(ends, -1, axis=1), axis=2)
    short = sides < 0.15 * VOXEL
    assert short.mean() < 0.01, "but where a border or a fold needs one"
    assert sum(len(k) for k in boundary_loops(made)) < 120, "it hangs together"
    assert made.area_of() > 0.8 * 120.0, "a voxel is lost at the border"
    off = made.vertices[:, 2] - height - 0.02 * made.vertices[:, 0]
    assert np.abs(off).max() < 0.02 * VOXEL + 1e-6
    assert not len(crossings(made))
    assert made.provenance is not None
    assert (made.provenance.sigma > 0).all()


@given(
    sigma=st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3),
    share=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).filter(lambda k: sum(k) <= 1.0),
    noise=st.floats(0.01, 2.0),
)
def test_of_a_place_between_points_noise_alone_averages_out(sigma, share, noise) -> None:
    X = np.eye(3)
    steps, most = np.arange(3, dtype=np.int32), np.full(3, noise)
    known = kernels.Vertices(X, np.array(sigma), steps, most, np.zeros(3), 0.0)
    face = np.arange(3, dtype=np.int32)
    random, own, single, gap = kernels.variances(face, *share, known, 0.5)
    w = np.array([1.0 - sum(share), *share])
    part = np.minimum(sigma, noise)
    common = w @ np.sqrt(np.maximum(np.square(sigma) - part**2, 0.0))
    assert random == pytest.approx((w**2) @ part**2, abs=1e-12)
    assert own == pytest.approx(random + common**2, abs=1e-9)
    assert single == pytest.approx((w**2) @ np.square(sigma), abs=1e-12)
    assert single - 1e-9 <= own <= (w @ np.array(sigma)) ** 2 + 1e-9, "errors that are all alike"
    assert 0.0 <= gap <= 0.25 + 1e-12
    # On one profile two of them: what their noise has alike does not average out.
    for alike in (0.5, 1.0):
        one = known._replace(alike=alike, step=np.array([0, 0, 1], np.int32))
        more = kernels.variances(face, *share, one, 0.5)[0] - random
        assert more == pytest.approx(alike * 2 * w[0] * w[1] * part[0] * part[1], abs=1e-12)


@pytest.mark.parametrize("turned", [0.0, 40.0])
@pytest.mark.parametrize("tilt", [0.0, 30.0, 55.0])
@pytest.mark.parametrize("count", [1, 2])
def test_a_merge_of_surfaces_that_lie_anyhow_errs_as_it_says(turned, tilt, count) -> None:
    """Points 1 mm apart from profile to profile and 0.4 mm along them, noise of 0.03 mm."""
    about = Rotation.from_euler("yz", [tilt, turned], degrees=True)
    up = about.apply([0.0, 0.0, 1.0])
    parts = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        step, line = np.meshgrid(np.arange(24), np.arange(60), indexing="ij")
        flat = np.stack([step * 1.0, line * 0.4, 0.2 + 0 * step], axis=-1).reshape(-1, 3)
        X = about.apply(flat) + rng.normal(0, 0.03, (len(flat), 1)) * up
        each = np.zeros(len(X), np.int32)
        p = Provenance(
            np.full(len(X), 0.03), each, step.ravel().astype(np.int32),
            line.ravel().astype(np.int32), (f"L{seed}",),
        )  # fmt: skip
        mesh = Mesh(X, sheet_faces(24, 60), p)
        parts.append(RangeSurface(mesh, X + 500.0 * up, np.tile(up, (len(X), 1))))
    made = fuse(parts, 0.63, 1.6)
    border = np.unique(np.concatenate(boundary_loops(made)))
    inner = np.setdiff1d(np.arange(len(made.vertices)), border)
    assert len(inner) > 800
    assert made.provenance is not None
    off, sigma = made.vertices[inner] @ up - 0.2, made.provenance.sigma[inner]
    # A thousand errors know their rms to 2 %. What bends by noise alone counts for a tenth.
    assert 0.87 < np.sqrt(np.mean((off / sigma) ** 2)) < 1.05
    assert sigma.min() > 0.03 / 2 / np.sqrt(2 * count), "the mean of four, and half-way of two"
