"""Merging in coarse steps, held against the part: nothing invented, every measured place kept.

A laser's scan of each part is exact but for noise; what a merge adds to that is its own. Before
profiles were kept and gaps were torn, the worst vertex of a mug of 60 steps and two lasers lay
5.97 mm off (simulated pictures, docs/explain/accuracy.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.surface.grids import turned
from tests.surface.known_parts import PARTS, scan, scanned
from tests.surface.scans import bracket
from tests.surface.scans import scanned as two_lasers
from turnscan.mesh import Mesh, Provenance, crossings, longest_sides, measured_vertices
from turnscan.mesh._parts import joined_provenance
from turnscan.points import Along, resample, usual_sigma
from turnscan.shapes import deviation
from turnscan.surface.clean import drop_islands
from turnscan.surface.fusion import RangeSurface, merge, range_surfaces
from turnscan.surface.fusion._carve import carved
from turnscan.surface.fusion._seat import seated
from turnscan.surface.fusion._witness import witnessed

CASES = [
    (part, steps, lasers, how)
    for part, steps in (
        ("handle", 60),
        ("handle", 24),
        ("thin wall", 24),
        ("ridge", 40),
        ("collars", 60),
    )
    for lasers, ways in ((1, ("paste",)), (2, ("grid", "tsdf", "paste")))
    for how in ways
]


@pytest.mark.parametrize(("part", "steps", "lasers", "how"), CASES)
def test_a_merge_invents_nothing(part: str, steps: int, lasers: int, how: str) -> None:
    grids = scanned(part, steps, lasers)
    mesh = drop_islands(merge(grids, how=how)[0])[0]
    shape = PARTS[part]
    off, sigma = np.abs(shape(mesh.vertices)), mesh.provenance.sigma
    off_face = np.abs(shape(mesh.triangles.mean(axis=1)))
    away = np.abs(deviation(np.concatenate([g.points[g.found] for g in grids]), mesh).distance)
    # A voxel is 1 to 2 mm wide here, rounds the edges off by half of that, and ends up to one short
    # of the last profile.
    worst, beyond, face, kept = (
        (1.0, 0.025, 2.1, 0.84) if how == "tsdf" else (0.5, 0.006, 2.0, 0.83)
    )
    assert off.max() < worst
    assert (off > 3 * sigma).mean() < beyond
    assert not (off > 6 * sigma + longest_sides(mesh) / 2).any()
    assert off_face.max() < face, "no face stands in the gap, 6 mm wide"
    assert (away < 0.5).mean() > kept
    # Thin noise in the mean of voxels on flat sides; sigma is no wider than twice what is shown.
    assert 0.5 < np.sqrt(np.mean((off / sigma) ** 2)) < 1.4


def test_what_one_laser_looked_through_is_no_surface_of_the_other() -> None:
    left, right = (range_surfaces(g)[0] for g in scanned("handle", 60, 2))
    x = np.array([[-2.0, 25.0, 28.0], [2.0, 25.0, 28.0], [-2.0, 25.0, 31.0], [2.0, 25.0, 31.0]])
    faces = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    p = left.mesh.provenance
    few = Provenance(
        p.sigma[:4], p.laser[:4], np.array([0, 1, 0, 1]), np.array([7, 7, 9, 9]), ("L0",)
    )
    screen = RangeSurface(Mesh(x, faces, few), left.eyes[:4], left.normals[:4])
    kept, count = carved([screen, right], 0.3)
    assert count >= 2
    assert not len(kept[0].mesh.faces)
    # Nothing is asked of faces that are as good as measured.
    assert carved([screen, right], 5.0)[1] == 0
    # What is left of a surface keeps what is known of its own vertices.
    twice = Mesh(
        np.concatenate([x, x + [0.0, 200.0, 0.0]]),
        np.concatenate([faces, faces + 4]),
        Provenance(*(np.tile(v, 2) for v in (few.sigma, few.laser, few.step, few.line)), ("L0",)),
    )
    two = RangeSurface(
        twice, np.tile(screen.eyes, (2, 1)), np.tile(screen.normals, (2, 1)), np.arange(8) / 8,
        along=np.arange(8) / 4,
    )  # fmt: skip
    (left, _), count = carved([two, right], 0.3)
    assert count == 2
    assert left.random == pytest.approx(np.arange(4, 8) / 8)
    assert left.along == pytest.approx(np.arange(4, 8) / 4)


def test_a_place_that_nobody_measured_bears_no_vertex_out() -> None:
    surfaces = [s for g in scanned("handle", 60, 2) for s in range_surfaces(g)]
    mesh = surfaces[0].mesh
    good, sigma, guessed, loose, afar = witnessed(mesh, surfaces, 1.0, 1.0)
    assert good.all()
    assert not (guessed | afar).any()
    assert not loose.any(), "each stands on its own point"
    # Beside what is left in voxels of a millimetre.
    own, steps = np.hypot(surfaces[0].sigma, 0.008), surfaces[0].between_lines
    about = steps.copy()
    np.maximum.at(about, mesh.faces.ravel(), np.repeat(steps[mesh.faces].max(axis=1), 3))
    assert (sigma >= np.hypot(own, steps) - 1e-9).all()
    assert (sigma <= np.hypot(own, about) + 1e-9).all(), "as it was, but for steps on its faces"
    assert (about == 0).any()
    assert sigma[about == 0] == pytest.approx(own[about == 0])
    between = np.tile([23.0, 0.0, 30.0], (len(mesh.vertices), 1))
    moved = np.where(np.arange(len(mesh.vertices))[:, None] % 50 == 0, between, mesh.vertices)
    good = witnessed(replace(mesh, vertices=moved), surfaces, 1.0, 1.0).confirmed
    assert not good[::50].any()
    assert good[1::50].all()


def test_half_way_over_an_edge_between_profiles_a_vertex_is_guessed() -> None:
    """On a hexagonal column, its edges half a step beyond a profile: 1 mm from what was measured,
    four tenths of a voxel."""
    steps, reach = 60, 20.0
    angles = (np.arange(steps) + 0.5) * 2 * np.pi / steps
    side = reach * np.cos(np.pi / 6) / np.cos(angles % (np.pi / 3) - np.pi / 6)
    grid = turned(angles, np.full(20, 1.0))
    out = grid.points * [1.0, 1.0, 0.0]
    grid = replace(grid, points=grid.points + out * (side - 1.0)[:, None, None])
    (one,) = range_surfaces(grid)
    after = one.neighbours[1]
    half = np.where((after >= 0)[:, None], one.mesh.vertices + one.mesh.vertices[after], np.nan) / 2
    assert not np.isnan(half).any()
    told = witnessed(replace(one.mesh, vertices=half), [one], 2.5, 1.0)
    over_edge = one.ranks % 10 == 9
    assert told.guessed[over_edge].all()
    assert not told.guessed[(one.ranks % 10 > 1) & (one.ranks % 10 < 7)].any(), "a flat side"
    assert not witnessed(one.mesh, [one], 2.5, 1.0).guessed.any(), "each stands on its own point"
    # Where the voxels are a third of a step, nothing was measured on a flat side's chord either.
    flat = (one.ranks % 10 > 1) & (one.ranks % 10 < 7)
    afar = witnessed(replace(one.mesh, vertices=half), [one], 0.6, 1.0)
    assert afar.afar[flat].all()
    assert not told.afar.any()
    way = np.linalg.norm(half - one.mesh.vertices, axis=1)[flat]
    assert afar.sigma[flat] == pytest.approx(way / 4, rel=0.05)


def test_what_was_guessed_beside_a_measured_point_goes_onto_it() -> None:
    one = range_surfaces(scan("ridge", 40, 0))[0]
    mesh, p = one.mesh, one.mesh.provenance
    inner = p.step == 11
    pushed = replace(
        mesh,
        vertices=np.where(inner[:, None], mesh.vertices + [0.0, 0.0, 0.2], mesh.vertices),
        provenance=replace(p, sigma=9.0 + 0 * p.sigma, line=0 * p.line),
    )
    moved, left = seated(pushed, inner, [one], 0.5)
    there = inner & ~left
    assert there.sum() > 0.7 * inner.sum()
    q = moved.provenance
    source = np.argmin(
        np.linalg.norm(moved.vertices[there][:, None] - mesh.vertices[None], axis=2), axis=1
    )
    assert moved.vertices[there] == pytest.approx(mesh.vertices[source], abs=1e-12)
    assert len(np.unique(source)) == len(source), "a point takes one vertex"
    assert q.sigma[there] == pytest.approx(one.sigma[source])
    assert np.array_equal(q.line[there], p.line[source])
    assert np.array_equal(moved.vertices[~there], pushed.vertices[~there]), "others stay"
    assert (q.sigma[~there] == 9.0).all()
    flat = [
        np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (pushed.triangles, moved.triangles)
    ]
    assert (np.einsum("ij,ij->i", *flat) > 0).all(), "no face turns over"
    # Beyond reach, or with none guessed, nothing moves.
    for guessed, reach in ((inner, 1e-3), (np.zeros_like(inner), 0.5)):
        same, still = seated(pushed, guessed, [one], reach)
        assert np.array_equal(same.vertices, pushed.vertices)
        assert np.array_equal(still, guessed)


@pytest.mark.parametrize(("beside", "least", "most"), [(0.1, 0.0, 0.0), (0.3, 0.9, 1.0)])
def test_what_was_guessed_goes_onto_no_point_behind_another_surface(beside, least, most) -> None:
    """A tube round another, and points 0.2 mm outside of the inner one."""
    angles = 2 * np.pi * np.arange(60) / 60
    tube, behind, point = (
        range_surfaces(turned(angles, np.full(30, r)))[0] for r in (15.0, 15 + beside, 15.2)
    )
    count = len(tube.mesh.vertices)
    both = Mesh(
        np.concatenate([tube.mesh.vertices, behind.mesh.vertices]),
        np.concatenate([tube.mesh.faces, behind.mesh.faces + count]),
        joined_provenance([tube.mesh, behind.mesh]),
    )
    guessed = np.random.default_rng(3).random(2 * count) < 0.2
    guessed[count:] = False
    moved, left = seated(both, guessed, [point], 0.5)
    assert not len(crossings(moved))
    gone = (guessed & ~left).sum() / guessed.sum()
    assert least <= gone <= most


def test_what_a_doubtful_point_alone_confirms_from_afar_is_as_doubtful() -> None:
    """A vertex 0.8 mm off a surface of 1 mm sigma may be there, but is no better known."""
    one = range_surfaces(scanned("handle", 60, 2)[0])[0]
    p = one.mesh.provenance
    some = np.arange(len(p.sigma)) % 50 == 0
    unsure = replace(one, mesh=replace(one.mesh, provenance=replace(p, sigma=1.0 + 0 * p.sigma)))
    lifted = one.mesh.vertices + np.where(some, 0.8, 0.0)[:, None] * one.normals
    sure = replace(one.mesh, vertices=lifted, provenance=replace(p, sigma=0.05 + 0 * p.sigma))
    good, sigma, *_ = witnessed(sure, [unsure], 0.1, 2.0)
    inside = some & (np.linalg.norm(one.normals, axis=1) > 0.5)
    assert good.all()
    assert np.median(sigma[inside]) > 0.5
    assert sigma[~some] == pytest.approx(0.05, rel=1e-3)
    beyond = witnessed(sure, [unsure], 0.1, 0.3).confirmed
    assert beyond[inside].mean() < 0.2, "nor from beyond what counts"


def test_what_is_known_badly_beside_a_measured_point_goes_onto_it() -> None:
    """Between a good point and one that is 2 mm off by its own sigma a merge has the mean."""
    one = range_surfaces(scan("ridge", 40, 0))[0]
    p = one.mesh.provenance
    some = np.arange(len(p.sigma)) % 50 == 0
    along = np.where(some[:, None], [0.0, 0.0, 0.2], 0.0)
    vague = replace(p, sigma=np.where(some, 2.0, p.sigma))
    mesh = replace(one.mesh, vertices=one.mesh.vertices + along, provenance=vague)
    told = witnessed(mesh, [one], 0.5, 1.0)
    assert told.loose[some].mean() > 0.8, "the others lie where the surface bends: guessed"
    assert (told.loose | told.guessed)[some].mean() > 0.95
    assert not told.loose[~some].any()
    moved, left = seated(mesh, told.loose, [one], 0.5)
    there = told.loose & ~left
    assert there.sum() > 0.7 * told.loose.sum()
    assert moved.vertices[there] == pytest.approx(one.mesh.vertices[there], abs=1e-12)
    assert moved.provenance.sigma[there] == pytest.approx(p.sigma[there])


def test_where_most_points_are_doubtful_their_doubt_is_not_the_usual_noise() -> None:
    noise = np.full(100, 0.1)
    assert usual_sigma(noise) == pytest.approx(0.1)
    assert usual_sigma(np.concatenate([noise, np.full(80, 1.3)])) == pytest.approx(0.1)
    assert usual_sigma(np.concatenate([noise, np.full(150, 1.3)])) == pytest.approx(0.13)
    assert usual_sigma(np.zeros(0)) == 0.0


@pytest.mark.parametrize("how", ["grid", "tsdf"])
def test_what_points_doubt_beside_their_own_noise_does_not_average_out(how: str) -> None:
    doubt = 0.1
    ring = turned(np.arange(120) * np.deg2rad(3.0), np.full(100, 20.0), sigma=doubt)

    def sigma(noise: float | None) -> float:
        own = None if noise is None else np.full(ring.sigma.shape, noise, np.float32)
        grids = [replace(ring, laser=name, noise=own) for name in ("L0", "L1")]
        return float(np.median(merge(grids, how=how)[0].provenance.sigma))

    assert sigma(None) == pytest.approx(sigma(doubt), rel=1e-6), "what is usual is noise"
    assert sigma(doubt) < 0.8 * doubt
    assert sigma(0.01) > 0.95 * doubt, "all that is known is doubted, and by both alike"


def test_a_vertex_of_a_resampled_surface_knows_the_noise_of_its_own_point() -> None:
    ring = turned(np.arange(60) * np.deg2rad(6.0), np.full(100, 20.0), sigma=0.1)
    noise = np.broadcast_to(np.linspace(0.01, 0.1, 100), ring.sigma.shape)
    ring = replace(ring, noise=noise.astype(np.float32))
    plain, coarse = (range_surfaces(g)[0] for g in (ring, resample(ring, Along(1.7))))
    assert 0 < len(coarse.mesh.vertices) < 0.5 * len(plain.mesh.vertices)
    part = (noise[0] / 0.1) ** 2
    for s in (plain, coarse):
        assert s.random == pytest.approx(part[s.mesh.provenance.line], rel=1e-5)


@pytest.mark.parametrize("steps", [24, 30, 36, 45, 60])
def test_what_a_seam_is_carried_on_from_is_not_measured_beyond_its_border(steps: int) -> None:
    """In 30 and 36 steps vertices where a seam begins, 0.8 and 1.4 mm off, stated 0.1 mm."""
    mesh, _ = merge(two_lasers(bracket, steps), how="tsdf", sewn=True)
    own = measured_vertices(mesh)
    assert mesh.provenance is not None
    off, sigma = np.abs(bracket(mesh.vertices)), mesh.provenance.sigma
    assert 0.01 * len(own) < (~own).sum() < 0.15 * len(own), "something was sewn"
    assert (off[own] / sigma[own]).max() < 5
    assert np.isnan(sigma[~own]).any()
