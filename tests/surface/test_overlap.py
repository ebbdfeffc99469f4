"""Two lasers' surfaces agree as their sigma says: no worse, and no better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic import sphere
from tests.surface.scans import CENTRE, bracket, scanned
from turnscan.surface.fusion import merge, overlaps, range_surfaces


@pytest.fixture(scope="module", params=["ball", "bracket"])
def part(request):
    shape = sphere(25.0, tuple(CENTRE)) if request.param == "ball" else bracket
    return scanned(shape, 36)


def ratios(grids, factor=1.0):
    said = [replace(g, sigma=factor * g.sigma) for g in grids]
    found = overlaps([s for g in said for s in range_surfaces(g)])
    return np.concatenate([o.ratios for o in found])


def test_of_places_that_two_lasers_measured_as_many_agree_as_sigma_says(part):
    # A chord of this ball lies up to 95 um inside of it, several sigma, and so does that of the
    # bracket's edges.
    found = ratios(part)
    assert len(found) > 500
    # Gauss: 68.3 % and 95.4 %; four sigma of 700 samples is 7 % and 3 %.
    assert 0.62 < (found < 1).mean() < 0.75
    assert 0.925 < (found < 2).mean() < 0.985


def test_a_sigma_half_or_twice_as_large_as_it_is_shows(part):
    assert (ratios(part, 0.5) < 2).mean() < 0.8
    assert (ratios(part, 2.0) < 1).mean() > 0.9


def test_a_surface_beside_another_is_met_but_for_borders_and_edges_compared(part):
    (found,) = overlaps([range_surfaces(g)[0] for g in part])
    assert 0.3 * found.met < len(found.ratios) < found.met
    assert len(found.offsets) == len(found.places) == len(found.ratios)


@pytest.mark.parametrize("part", ["ball"], indirect=True)
def test_two_surfaces_pushed_apart_disagree_by_that(part):
    one, two = part
    away = replace(two, points=two.points + [0.0, 0.0, 0.4])
    (found,) = overlaps([range_surfaces(one)[0], range_surfaces(away)[0]])
    up = found.offsets[np.abs(found.places[:, 2] - found.places[:, 2].max()) < 3.0]
    assert np.median(up) == pytest.approx(-0.4, abs=0.15)
    assert any(f.code == "surface.disagree" for f in merge([one, away])[1])


@pytest.mark.parametrize("steps", [12, 16, 24])
def test_coarse_steps_on_a_round_part_are_no_disagreement(steps):
    """A chord lies 0.9 mm inside the ball in 12 steps, and leans against the normal by 15°."""
    (found,) = overlaps([range_surfaces(g)[0] for g in scanned(sphere(25.0, tuple(CENTRE)), steps)])
    assert len(found.ratios) > 100
    assert found.disagreeing < 0.015
    # What a cubic through four places of a circle is off by half-way.
    due = 3 / 128 * 25.0 * np.radians(360 / steps) ** 4
    assert abs(np.median(found.offsets)) < due + 0.02
