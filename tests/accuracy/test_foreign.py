"""A shape that no rule was made with: what its points claim, and what merging makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bench.foreign import SHAPES, Errors, Row, drawn, put_together, row, together, turned
from manifold3d import Manifold

from turnscan.formats import write_stl
from turnscan.mesh import Mesh, is_closed
from turnscan.simulate import SimulationSpec

STEPS = 40


def test_points_and_merged_surface_keep_their_word(tmp_path: Path) -> None:
    path = drawn("put-together", 101, tmp_path)
    found = row(SimulationSpec(str(path), "paper", lasers=2, steps=STEPS), "one", tmp_path)
    assert len(found.single.off) > 2000
    for errors in (found.single, found.merged):
        assert errors.beyond < 0.01
        assert errors.invented == 0
        # Neither too sure of itself nor so wide that it says nothing.
        assert 0.6 < errors.ratio < 1.3
    assert found.complete > 0.85


@pytest.mark.parametrize(
    ("height", "rig"), [(3.3, "paper"), (4.5, "paper"), (9.0, "paper"), (3.3, "modern")]
)
def test_low_parts_know_how_far_their_points_scatter(
    tmp_path: Path, height: float, rig: str
) -> None:
    """Of 3 to 20 lines to a profile none has enough to tell its scatter, and speckle makes six
    times the noise that the photons explain."""
    steps = 12 if rig == "modern" else STEPS
    found = scanned_solid(Manifold.cylinder(height, 18.0, 18.0, 6), rig, tmp_path, steps)
    assert len(found.single.off) > 4 * steps
    for errors in (found.single, found.merged):
        assert errors.invented == 0
        assert 0.5 < errors.ratio < 1.3
        assert errors.beyond < 0.02


@pytest.mark.parametrize("radius", [1.0, 1.5, 2.0])
def test_pins_thinner_than_the_light_say_how_badly_they_are_known(
    tmp_path: Path, radius: float
) -> None:
    """All sides of them lie within the light, 0.6 mm rms: their points lie 0.1 to 0.3 mm too deep,
    and no curve about the axis is long enough to tell."""
    found = scanned_solid(Manifold.cylinder(40.0, radius, radius, 60), "paper", tmp_path)
    assert found.single.off.mean() > 0.1
    for errors in (found.single, found.merged):
        assert errors.invented == 0
        assert 0.4 < errors.ratio < 1.2
        assert errors.beyond < 0.01


def test_a_turned_part_says_where_it_steps_between_two_lines(tmp_path: Path) -> None:
    part = sum(
        (Manifold.cylinder(6.3, 19.5, 19.5, 120).translate((0, 0, z)) for z in (9.9, 31.2)),
        Manifold.cylinder(45.0, 17.0, 17.0, 120),
    )
    found = scanned_solid(part, "paper", tmp_path)
    assert found.complete > 0.95
    for errors in (found.single, found.merged):
        assert errors.invented == 0
        assert 0.6 < errors.ratio < 1.1
        assert errors.beyond < 0.01


@pytest.mark.parametrize(("seed", "rig", "steps"), [(101, "paper", 24), (104, "paper", 60)])
def test_collars_grooves_and_threads_are_no_scatter(
    tmp_path: Path, seed: int, rig: str, steps: int
) -> None:
    """Sigma was four to seven times what they were off."""
    path = drawn("turned", seed, tmp_path)
    found = row(SimulationSpec(str(path), rig, lasers=2, steps=steps), "one", tmp_path)
    assert found.complete > 0.95
    for errors in (found.single, found.merged):
        assert errors.invented == 0
        assert 0.6 < errors.ratio < 1.2
        assert errors.beyond < 0.012


def scanned_solid(solid: Manifold, rig: str, folder: Path, steps: int = STEPS) -> Row:
    """A solid on the table, scanned with two lines, held against itself."""
    made = solid.to_mesh()
    path = folder / "solid.stl"
    mesh = Mesh(np.array(made.vert_properties[:, :3], np.float64), np.array(made.tri_verts))
    path.write_bytes(write_stl(mesh))
    return row(SimulationSpec(str(path), rig, lasers=2, steps=steps), "solid", folder)


@pytest.mark.parametrize(
    ("name", "seed"), [(n, seed) for n, seed in SHAPES if n in ("put-together", "turned")]
)
def test_random_parts_are_closed_and_fit_on_the_table(name: str, seed: int) -> None:
    part = {"put-together": put_together, "turned": turned}[name](np.random.default_rng(seed))
    assert is_closed(part)
    assert np.hypot(*part.vertices[:, :2].T).max() < 45
    assert np.ptp(part.vertices[:, 2]) < 75


def test_errors_count_what_lies_beyond() -> None:
    one = Errors(np.array([0.1, 0.4, 2.0]), np.full(3, 0.1), np.full(3, 1.0))
    assert one.beyond == pytest.approx(2 / 3)
    assert one.invented == 1
    assert one.ratio == pytest.approx(np.sqrt((1 + 16 + 400) / 3))
    assert len(together([one, one]).off) == 6
