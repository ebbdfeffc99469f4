"""Poses brought onto a drawn part."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from tests.poses import scenes
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.poses import check, onto_all
from turnscan.rig import Pose
from turnscan.workflows._surface._aligning import reference_view

DRAWN = Pose(np.eye(3), np.array([5.0, -3.0, 11.0]))
"""Frame of the table → frame of the drawing."""


def _drawing(shape, low, high, cell: float = 1.0) -> Mesh:
    """The surface of a body given by its distance function, in the drawing's frame."""
    n = np.ceil((np.array(high) - low) / cell).astype(int) + 1
    k, j, i = (a.ravel() for a in np.indices(n[::-1]))
    X = np.array(low) + cell * np.stack([i, j, k], axis=-1)
    v, f = igl.marching_cubes(shape(X), X, *map(int, n), 0.0)[:2]
    mesh = Mesh(DRAWN.apply(v), f)
    return mesh if mesh.volume > 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])


@pytest.fixture(scope="module")
def drawn():
    mesh = _drawing(scenes.knob, (-30, -24, -4), (34, 28, 60))
    return reference_view(mesh, "drawing")


def test_poses_come_onto_the_drawing_and_nothing_of_it_stays(drawn) -> None:
    names = ("knob", "knob lying")
    views = [scenes.seen(n, scenes.grid(n, k + 1)) for k, n in enumerate(names)]
    found = onto_all(drawn, views)
    assert found.names == tuple(v.name for v in views)
    for name, pose, v in zip(names, found.poses, views, strict=True):
        truth = DRAWN @ scenes.STANDS[name].inverse()
        off = np.linalg.norm(pose.apply(v.points) - truth.apply(v.points), axis=1)
        assert off.max() < 0.1  # a chord of the drawing's facets is 10 µm, a point's noise 60
        assert off.max() > 0
    (meeting,) = found.meetings
    assert "drawing" not in (meeting.first, meeting.second)
    assert meeting.points > 500


def test_another_part_is_refused(drawn) -> None:
    cup = scenes.seen("cup", scenes.grid("cup", 1))
    with pytest.raises(InputError, match="cup"):
        check(onto_all(drawn, [cup]))
