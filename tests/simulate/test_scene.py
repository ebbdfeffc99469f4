"""The triangles of a scene."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.simulate import Body, SimulationSpec, _cut, bench, part
from turnscan.simulate._render import sheet_numbers
from turnscan.simulate._scene import triangles


def test_every_triangle_lies_in_the_boxes_of_its_cluster() -> None:
    """A box too small would make pieces of the stripe vanish."""
    tri = triangles([Body(part("hexagon"))])
    corners, normals, boxes = tri.clusters
    assert np.array_equal(sorted(corners.tolist()), sorted(tri.vertices[tri.faces].tolist()))
    box = boxes[np.arange(len(corners)) // _cut.CLUSTER]
    assert (corners >= box[:, None, 0:3]).all()
    assert (corners <= box[:, None, 3:6]).all()
    assert (normals >= box[:, 6:9]).all()
    assert (normals <= box[:, 9:12]).all()


@pytest.mark.parametrize("bow", [0.0, 2e-4])
def test_what_the_boxes_leave_out_would_give_no_polygon(bow: float) -> None:
    """The stripe is the same where every triangle is looked at."""
    made = bench(SimulationSpec("hexagon", lasers=1))
    beam, line = made.beams[0], made.rig.sheet(made.beams[0].name)
    sheet = (*sheet_numbers(line)[:12], bow, -bow, bow)
    shape = (beam.waist, beam.waist_distance, beam.rayleigh, 2.2, *beam.aim.tolist())
    corners, normals, boxes = triangles(made.scene.bodies).clusters
    everywhere = np.tile([-1e4] * 3 + [1e4] * 3 + [-1.0] * 3 + [1.0] * 3, (len(boxes), 1))
    for angle in (0.0, 0.7, 2.1):
        T = made.rig.T_camera_table @ made.motion.pose(angle)
        light = (T.rotation, T.translation, tuple(beam.apex.tolist()), sheet, shape)
        some = _cut.sheet_polygons(corners, normals, boxes, *light)
        every = _cut.sheet_polygons(corners, normals, everywhere, *light)
        assert len(every[1]) > 50
        for few, all_ in zip(some, every, strict=True):
            assert np.array_equal(few, all_)
