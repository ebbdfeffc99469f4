"""A simulated scan with two lines, speckle and noise, from pictures to a closed surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bench import _hole_truth as truth
from bench.causes import Missing
from bench.surface_truth import (
    Run,
    agreement,
    covered,
    hole_table,
    places,
    precision,
    reconstructed,
    score,
    visible,
)

from turnscan.mesh import is_closed
from turnscan.simulate import SimulationSpec

STEPS, RADIUS = 32, 20.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder: Path = tmp_path_factory.mktemp("scans")
    return reconstructed(SimulationSpec("sphere", "paper", lasers=2, steps=STEPS, seed=1), folder)


def test_what_could_be_seen_was_measured_and_nothing_else(run: Run) -> None:
    usual = float(np.median(np.concatenate([g.sigma[g.found] for g in run.both.grids])))
    # Chords of the steps lie this far below the ball.
    sagitta = RADIUS * (1 - np.cos(np.pi / STEPS))
    some = places(run.made)
    seen = visible(run, some, truth.GRAZING[0])
    near = 3 * usual + sagitta
    assert 0.2 < near < 0.6
    # Down to the floor of the working volume, below which the stripe goes on uncounted.
    assert some.middle[seen, 2].min() < 2.1
    assert covered(run.both.mesh, some, seen, near) > 0.99
    # A tolerance below the noise must fail, or the measure is blind.
    assert covered(run.both.mesh, some, seen, 0.1 * usual) < 0.5
    assert precision(run, run.both.mesh, near) > 0.995


def test_two_lasers_agree_as_their_sigma_says(run: Run) -> None:
    ratios = agreement(run.both)
    assert len(ratios) > 1000
    # 95 % of Gaussian differences lie within two sigma; with half of it 68 %, with twice 99.99 %.
    assert 0.9 < (ratios < 2).mean() < 0.99


def test_the_closed_surface_is_watertight_and_as_large_as_the_part(run: Run) -> None:
    mesh = run.closed.mesh
    assert is_closed(mesh)
    true = truth.made_mesh(run.made).volume
    # Chords of 32 steps lose 0.64 % of a round part; the foot of 2 mm, carried straight down, adds.
    assert mesh.volume == pytest.approx(true, rel=0.02)


def test_both_ends_are_holes_with_the_right_cause(run: Run) -> None:
    table = hole_table(run, run.both, 2)
    right, known = score(table)
    assert known >= 1
    assert right == known
    assert {h.cause for h in run.both.holes} <= {"laser", "camera", "outside", "removed"}


def test_the_missing_area_bears_the_right_cause(run: Run) -> None:
    holes = run.both.holes
    missing = Missing.of(run.made, STEPS, run.both.opened or run.both.mesh, holes)
    told = missing.share(holes)
    assert told.missing > 100.0
    assert told.right > 0.95 * told.missing
    # Names that say something else must count as wrong, or the measure is blind.
    assert missing.share([replace(h, cause="dark") for h in holes]).right == 0.0
    # A second name that says something else is counted, makes nothing right, and is said so.
    both = missing.share([replace(h, also="dark") for h in holes])
    assert both.two == pytest.approx(both.missing)
    assert (both.either, both.second) == (both.right, 0.0)
    # Nor is one that comes second where it is all that is right, and it alone.
    last = missing.share([replace(h, cause="dark", also=h.cause) for h in holes])
    assert last.right == 0.0
    assert last.either == last.second == pytest.approx(both.right)


def test_the_light_of_points_that_were_taken_away_is_kept_for_the_causes(run: Run) -> None:
    for sought in run.both.sought:
        assert sought.light is not None
        known = ~np.isnan(sought.light)
        assert known[sought.grid.found].all()
        assert (known & ~sought.grid.found).any()
        assert sought.taken is not None
        assert (~np.isnan(sought.taken[..., 0]))[sought.grid.found].all()
