"""The triangles of a scene."""

from __future__ import annotations

import numpy as np

from turnscan.simulate import Body, _cut, part
from turnscan.simulate._scene import triangles


def test_every_triangle_lies_in_the_ball_of_its_cluster() -> None:
    """A ball too small would make pieces of the stripe vanish."""
    tri = triangles([Body(part("hexagon"))])
    order, balls = tri.clusters
    assert np.array_equal(np.sort(order), np.arange(len(tri.faces)))
    ball = balls[np.arange(len(order)) // _cut.CLUSTER]
    corners = tri.vertices[tri.faces[order]]
    away = np.linalg.norm(corners - ball[:, None, :3], axis=2).max(axis=1)
    assert (away <= ball[:, 3] + 1e-9).all()
