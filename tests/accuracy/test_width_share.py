"""What the width of a stripe tells of the surface, on rendered pictures of a part with a V-groove.

Its faces pass close by the axis, where no turn moves them: a third of its points in 24 steps have
no profile beside them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bench import _hole_truth as truth
from bench.surface_truth import scanned

from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.points import RangeGrid, normal_sigma
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import SimulationSpec


@pytest.fixture(scope="module")
def groove(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[RangeGrid], list[Floats]]:
    """The grids of a scan in 24 steps, and how far the points of each lie off the part, mm."""
    folder: Path = tmp_path_factory.mktemp("v-groove")
    made, path = scanned(SimulationSpec("v-groove", "paper", lasers=2, steps=24), folder)
    with Scan.open(path) as scan:
        grids = to_grids(tuple(detect_scan(scan, made.rig, Settings().stripes)), Settings()).grids
    part = truth.made_mesh(made)
    return grids, [deviation(g.points[g.found], part).distance for g in grids]


def test_points_without_a_profile_beside_state_what_they_err(groove):
    """Without the width, what leads along the surface counts in full."""
    known, unknown = [], []
    for grid, off in zip(*groove, strict=True):
        found, bare = grid.found, replace(grid, width_share=None)
        state, along = normal_sigma(bare)[found], grid.sigma[found]
        alone = (state == along) & (grid.noise[found] > 0.97 * along)
        unknown.append(off[alone] / along[alone])
        known.append(off[alone] / normal_sigma(grid)[found][alone])
    told, untold = np.concatenate(known), np.concatenate(unknown)
    assert len(told) > 800
    before, now = (float(np.sqrt((z**2).mean())) for z in (untold, told))
    assert 0.85 < now < 1.05, "it allows for the other surface, and for a tenth"
    assert before < now - 0.04
    assert (np.abs(told) > 3.0).mean() < 0.005


def test_it_tells_what_chords_tell_where_they_do(groove):
    """On what is even, chords and width are two measurements of the same; the width allows for a
    surface that is turned to the other side, and for a tenth more."""
    for grid in groove[0]:
        found = grid.found & (grid.noise > 0.97 * grid.sigma)
        share = normal_sigma(replace(grid, width_share=None))[found] / grid.sigma[found]
        told = grid.width_share[found]
        asked = ~np.isnan(told) & (share < 0.97)
        assert asked.sum() > 300
        less = told[asked] < share[asked] - 0.1
        assert less.mean() < 0.03
        assert np.median(told[asked] - share[asked]) < 0.1
