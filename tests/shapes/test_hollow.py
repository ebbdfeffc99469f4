"""What fillings over bores may hide, beside what is known of other fillings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic import make_rig
from tests.shapes.solids import turned
from turnscan import shapes
from turnscan.mesh import Mesh, Provenance, is_closed
from turnscan.points import RangeGrid
from turnscan.rig import Pose, rotation_from_vector
from turnscan.surface.holes import fill

LOW, HIGH = 5.0, 30.0
"""mm: where the part ends."""


def disc(bore: float, seen: float, wide: float = 20.0) -> Mesh:
    """A disc with a blind bore, of whose wall ``seen`` mm were measured, closed there."""
    outside = [(0.3, LOW), (wide, LOW), (wide, HIGH), (bore, HIGH)]
    mesh = turned([*outside, (bore, HIGH - seen)] if seen else outside, 0.7, 90)
    v = len(mesh.vertices)
    none = np.zeros(v, np.int32)
    known = Provenance(np.full(v, 0.01), none, np.arange(v, dtype=np.int32), none, ("L0",))
    closed = fill(replace(mesh, provenance=known), how="flat")
    assert is_closed(closed)
    return closed


def source(elevation: float) -> shapes.Source:
    """A turn of which nothing but the table's angles counts."""
    rig = make_rig(elevation=elevation, lift=20.0)
    angles = np.arange(60) * 2 * np.pi / 60
    empty = np.full((60, rig.camera.height), np.nan)
    points = np.full((*empty.shape, 3), np.nan)
    flags = np.ones(empty.shape, np.uint16)
    grid = RangeGrid("L0", np.arange(60, dtype=np.int32), angles, points, empty, empty, flags, True)
    return shapes.Source((grid,), rig)


def test_a_bore_whose_end_nobody_saw_may_be_as_deep_as_the_part() -> None:
    part, high = disc(6.0, 1.5), source(0.9)
    said = shapes.volume_sigma(part, high)
    depth = HIGH - 1.5 - LOW
    assert 0.7 < said.hollow / (np.pi * 6.0**2 * depth / 3**0.5) <= 1.02
    assert said.total == pytest.approx(np.hypot(said.measured, np.hypot(said.filled, said.hollow)))
    assert shapes.volume_sigma(part).hollow == 0.0, "a file of a mesh does not tell what was seen"


def test_so_it_is_in_another_pose() -> None:
    part, high = disc(6.0, 1.5), source(0.9)
    pose = Pose(rotation_from_vector([0.7, -0.4, 1.9]), np.array([5.0, -30.0, 12.0]))
    assert high.rig is not None
    view = shapes.View(high.grids[0], high.rig, "a L0", pose)
    tipped = replace(part, vertices=pose.apply(part.vertices))
    said = shapes.volume_sigma(tipped, shapes.Source(placed=(view,)))
    assert said.hollow == pytest.approx(shapes.volume_sigma(part, high).hollow, rel=0.02)


@pytest.mark.parametrize(
    ("part", "elevation"),
    [
        (disc(6.0, 0.0), 0.9),
        (disc(6.0, 1.5), 0.0),
        (disc(17.0, 1.5), 0.9),
    ],
    ids=["a gap in a plane", "what was out of sight", "the lid of a vessel"],
)
def test_other_fillings_hide_none(part: Mesh, elevation: float) -> None:
    assert shapes.volume_sigma(part, source(elevation)).hollow == 0.0
