"""How range surfaces bend from profile to profile, beside edges and in noise."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.surface.grids import sheet_faces
from turnscan.mesh import Mesh, Provenance
from turnscan.surface.fusion import RangeSurface

LINES = 21


def wall(profile: np.ndarray, sigma: float, off: np.ndarray | float = 0.0) -> RangeSurface:
    """Profiles at (x, y) = ``profile`` (m, 2), lines 0.3 mm apart in height, seen from outside.

    ``off`` (m, lines) mm is how far each point lies outside.
    """
    radius = np.linalg.norm(profile, axis=1)
    out = np.repeat(np.insert(profile / radius[:, None], 2, 0.0, axis=1), LINES, axis=0)
    z = np.tile(0.3 * np.arange(LINES), len(profile))
    points = np.column_stack([np.repeat(profile, LINES, axis=0), z])
    points = points + out * np.broadcast_to(off, (len(profile), LINES)).reshape(-1, 1)
    step, line = (
        k.ravel().astype(np.int32)
        for k in np.meshgrid(np.arange(len(profile)), np.arange(LINES), indexing="ij")
    )
    p = Provenance(np.full(len(z), sigma), np.zeros_like(step), step, line, ("one",))
    return RangeSurface(
        Mesh(points, sheet_faces(len(profile), LINES), p), points + 500.0 * out, out
    )


@given(
    radius=st.floats(3.0, 200.0),
    hollow=st.booleans(),
    ways=st.lists(st.floats(0.5, 1.5), min_size=6, max_size=20),
)
def test_a_circle_bends_by_its_radius_however_its_profiles_are_apart(radius, hollow, ways) -> None:
    phi = np.cumsum(ways) * 0.05
    rim = radius * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    if hollow:  # seen from its middle, which then lies outside
        rim = (rim - 2.0 * radius * np.array([np.cos(phi.mean()), np.sin(phi.mean())]))[::-1]
    surface = wall(rim, 1e-6)
    bend = surface.bend.reshape(-1, LINES)[1:-1]
    np.testing.assert_allclose(np.abs(bend), 1.0 / radius, rtol=0.05)
    assert (np.sign(bend) == (-1.0 if hollow else 1.0)).all()


@given(sides=st.integers(3, 8), each=st.integers(6, 12), start=st.floats(0.05, 0.95))
def test_faces_between_edges_are_flat(sides, each, start) -> None:
    """A prism, its profiles in equal angles, so that they are apart unlike on its faces."""
    half = np.pi / sides
    phi = 2.0 * half * (np.arange(sides * each) + start) / each
    r = 20.0 / np.cos((phi + half) % (2.0 * half) - half)
    prism = wall(r[:, None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1), 1e-6)
    assert np.abs(prism.bend).max() < 1e-6


def test_noise_of_single_points_makes_no_bend() -> None:
    """A cylinder of 20 mm, 3 degrees a step: its chords lie 7 µm deep, its noise is 90 µm."""
    phi = np.deg2rad(3.0) * np.arange(60)
    rim = 20.0 * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    noise = np.random.default_rng(3).normal(0.0, 0.09, (len(phi), LINES))
    bulge = wall(rim, 0.09, noise).bend * (20.0 * np.deg2rad(3.0)) ** 2 / 8.0
    assert np.std(bulge) < 0.15 * 0.09, "of the noise"
    assert abs(np.mean(bulge) - 0.0069) < 0.003


def turned_part(z: np.ndarray, r: np.ndarray, sigma: float, seed: int = 0) -> RangeSurface:
    """Of revolution: the radius (lines,) mm, 40 profiles all but round, seen level from outside."""
    phi = np.deg2rad(6.0) * np.arange(40)
    rim = 100.0 * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    noise = np.random.default_rng(seed).normal(0.0, sigma, (len(phi), LINES))
    return wall(rim, sigma, np.asarray(r) - 100.0 + noise)


def test_a_step_between_two_lines_is_doubted_where_it_is_and_nowhere_else() -> None:
    """One of 3 mm: between two rays 0.3 mm apart the surface may go up to 0.3 mm off the chord."""
    z = 0.3 * np.arange(LINES)
    part = turned_part(z, np.where(z > 2.95, 53.0, 50.0), 0.05)
    doubt = part.between_lines.reshape(-1, LINES)
    at = int(np.argmax(z > 2.95))
    np.testing.assert_allclose(doubt[:, at - 1 : at + 1], 0.4 * 0.3, rtol=0.05)
    elsewhere = np.delete(doubt, [at - 1, at], axis=1)
    assert (elsewhere > 0).mean() < 0.03, "noise alone makes some"


@given(slope=st.floats(-3.0, 3.0), sigma=st.floats(0.01, 0.1), seed=st.integers(0, 99))
def test_nothing_is_doubted_between_the_lines_of_cones(
    slope: float, sigma: float, seed: int
) -> None:
    z = 0.3 * np.arange(LINES)
    doubt = turned_part(z, 50.0 + slope * z, sigma, seed).between_lines
    assert (doubt > 0).mean() < 0.06, "noise alone makes some"


def test_balls_have_none_but_at_their_poles() -> None:
    z = 0.3 * np.arange(LINES)
    ball = turned_part(z, 40.0 + np.sqrt(30.0**2 - (z - 3.0) ** 2), 0.03)
    assert (ball.between_lines > 0).mean() < 0.06
