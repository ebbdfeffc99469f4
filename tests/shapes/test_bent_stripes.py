"""Stripes that an edge bends beside a face: they belong to nobody, and their doubt is counted."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance, submesh
from turnscan.shapes.primitives import find_shapes
from turnscan.shapes.primitives._find import _Fit, _kept, sigma_of
from turnscan.shapes.primitives._ground import prepared
from turnscan.shapes.primitives._judged import bent
from turnscan.shapes.primitives._region import Region
from turnscan.shapes.primitives._surface_kernels import CYLINDER, PLANE

ROWS, SIGMA = 60, 0.02


def _stripes(height: Floats, sigma: Floats, seed: int = 0) -> Mesh:
    """A sheet of stripes (s,), each at its ``height`` over z = 0 and with its ``sigma``, mm."""
    s = len(height)
    y, x = np.meshgrid(0.4 * np.arange(ROWS), 0.5 * np.arange(s))
    noise = np.random.default_rng(seed).normal(0, SIGMA, (s, ROWS))
    vertices = np.stack([x, y, height[:, None] + noise], axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(s - 1), np.arange(ROWS - 1), indexing="ij"))
    a = i * ROWS + j
    b = a + ROWS
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    step = np.repeat(np.arange(s, dtype=np.int32), ROWS)
    row = np.tile(np.arange(ROWS, dtype=np.int32), s)
    known = Provenance(np.repeat(sigma, ROWS), np.zeros_like(step), step, row, ("laser",))
    return Mesh(vertices, faces.astype(np.int32), known)


def _plane(at: Floats, normal: Floats) -> Floats:
    n = np.asarray(normal, dtype=np.float64)
    return np.concatenate([at, n / np.linalg.norm(n), np.zeros(4)])


def _beside_a_wall() -> tuple[Mesh, int]:
    """Stripes of a floor, then five that rise and are known badly; the number of the first."""
    height, sigma = np.zeros(36), np.full(36, SIGMA)
    height[31:] = 0.30 * np.arange(1, 6)
    sigma[31:] = 10 * SIGMA
    return _stripes(height, sigma), 31


def test_a_band_of_bent_stripes_gives_back_what_it_took_of_a_face() -> None:
    mesh, first = _beside_a_wall()
    g = prepared(mesh, sigma_of(mesh), None)
    floor = np.arange(0, (first - 2) * ROWS)
    band = np.arange((first - 2) * ROWS, len(mesh.vertices))
    rising = _plane(np.array([0.5 * (first - 1), 0.0, 0.0]), np.array([-0.6, 0.0, 1.0]))
    regions = [
        Region(PLANE, _plane(np.zeros(3), np.array([0.0, 0, 1])), 1.0, floor),
        Region(PLANE, rising, 1.0, band),
    ]
    assert bent(g, band)
    kept, label = _kept(g, regions)
    assert kept == regions[:1]
    assert (label[: first * ROWS] == 0).mean() > 0.99
    assert (label[first * ROWS :] == 0).mean() < 0.01, "too far off the floor, whatever their sigma"


def test_the_doubt_of_bent_stripes_does_not_vanish_with_their_many_points() -> None:
    """Four stripes stand off as a whole, each by as much as its sigma says."""
    sigma, ratios = np.full(16, SIGMA), []
    sigma[6:10] = 3 * SIGMA
    for seed in range(40):
        off = np.where(sigma > SIGMA, np.random.default_rng(1000 + seed).normal(0, sigma), 0.0)
        [plane] = find_shapes(_stripes(off, sigma, seed)).shapes
        ratios.append(plane.point[2] / np.sqrt(plane.covariance[4, 4]))
    assert 0.75 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.3


@pytest.mark.parametrize(("worse", "sure"), [((1, 1), True), ((10, 3), False)])
def test_a_plane_of_four_stripes_that_may_lean_any_way_is_none(
    worse: tuple[int, int], sure: bool
) -> None:
    """Such as the tip of a tooth: the outer two of its stripes are bent, the inner two a little."""
    sigma = np.full(16, SIGMA)
    sigma[[6, 7, 8, 9]] *= np.array([worse[0], worse[1], worse[1], worse[0]])
    mesh = _stripes(np.zeros(16), sigma)
    tip = np.zeros(len(mesh.vertices), dtype=np.bool_)
    tip[6 * ROWS : 10 * ROWS] = True
    up = _plane(np.zeros(3), np.array([0.0, 0, 1]))
    found = _Fit(
        prepared(mesh, sigma_of(mesh), None), Region(PLANE, up, 1.0, np.flatnonzero(tip)), tip, tip
    )
    leans = float(np.sqrt(np.linalg.eigvalsh(found.covariance[:2, :2])[-1]))
    assert (leans < 0.01) if sure else (0.1 < leans < 0.15)
    assert found.sure() == sure


def _bowed(wave: float, sigma: Floats) -> Mesh:
    """A quarter of a cylinder of 16 mm, a stripe each 1.3 mm along it, with points at 0.4 mm; each
    stripe has waves of ``wave`` mm, of 8 mm length and a phase of its own."""
    s = len(sigma)
    flat = _stripes(np.zeros(s), sigma)
    rng = np.random.default_rng(3)
    turn = np.repeat(np.linspace(-np.pi / 4, np.pi / 4, s), ROWS)
    phase = np.repeat(rng.uniform(0, 2 * np.pi, s), ROWS)
    z = flat.vertices[:, 1]
    r = 16.0 + flat.vertices[:, 2] + wave * np.sin(2 * np.pi * z / 8.0 + phase)
    around = np.stack([r * np.sin(turn), z, r * np.cos(turn)], axis=-1)
    return Mesh(around, flat.faces, flat.provenance)


def test_waves_along_far_stripes_are_no_noise_of_a_cylinder() -> None:
    sigma = np.full(20, 5 * SIGMA)
    [plain] = find_shapes(_bowed(0.0, sigma)).shapes
    assert plain.kind == "cylinder"
    assert abs(plain.radius - 16.0) < 4 * plain.radius_sigma
    assert find_shapes(_bowed(0.15, sigma)).shapes == (), "a cell of space averages the waves out"


def test_a_band_of_edges_is_no_curved_shape_where_it_is_known_badly() -> None:
    """Five points wide across all stripes: a fillet, or an edge that the light rounded off."""
    row = np.tile(np.arange(ROWS), 60)
    axis = np.concatenate([[0.0, 0, 0], [0, 1.0, 0], [16.0, 0, 0, 0]])
    band = (row >= 20) & (row < 25)
    owns = [np.flatnonzero(some) for some in (row < 20, band, row >= 25)]
    mesh = _bowed(0.0, np.full(60, SIGMA))
    for worse, many in ((1.0, 3), (3.0, 2)):
        g = prepared(mesh, np.where(band, 5 * worse * SIGMA, 5 * SIGMA), None)
        kept, _ = _kept(g, [Region(CYLINDER, axis, 1.0, own) for own in owns])
        assert len(kept) == many


def _bore(doubtful: int, more: float = 0.0) -> tuple[Mesh, int]:
    """A bore whose near quarter is known well; of each ten stripes of the far one, so many are
    doubtful. It stands ``more`` mm further out. The number of its first vertex."""
    near = _bowed(0.0, np.full(40, 5 * SIGMA))
    worse = np.where(np.arange(40) % 10 < doubtful, 60 * SIGMA, 5 * SIGMA)
    far = _bowed(0.0, worse)
    turned = far.vertices * (-1.0, 1.0, -1.0)
    turned[:, 2] -= more
    both = Mesh(
        np.concatenate([near.vertices, turned]),
        np.concatenate([near.faces, far.faces + len(near.vertices)]),
        Provenance(*(
            np.concatenate([getattr(m.provenance, name) for m in (near, far)])
            for name in ("sigma", "laser", "step", "line")
        ), ("laser",)),
    )  # fmt: skip
    return both, len(near.vertices)


def test_the_far_side_of_a_bore_that_is_seen_badly_belongs_to_it_all_the_same() -> None:
    mesh, first = _bore(doubtful=4)
    alone = submesh(mesh, mesh.faces.min(axis=1) >= first)
    assert find_shapes(alone).shapes == (), "too many of its points are doubtful"
    found = find_shapes(mesh)
    [both] = found.shapes
    assert (found.label[first:] == 0).mean() > 0.95
    assert abs(both.radius - 16.0) < 4 * both.radius_sigma


@pytest.mark.parametrize(("doubtful", "more"), [(6, 0.0), (4, 3.0)])
def test_what_is_doubtful_mostly_or_lies_elsewhere_belongs_to_no_bore(
    doubtful: int, more: float
) -> None:
    mesh, first = _bore(doubtful, more)
    found = find_shapes(mesh)
    assert len(found.shapes) == 1
    assert (found.label[first:] >= 0).mean() < 0.05
