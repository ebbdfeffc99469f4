"""Bodies whose mesh is known, and what a sound mesh must show."""

from __future__ import annotations

import numpy as np

from turnscan.mesh import Mesh


def sides(mesh: Mesh):
    """Undirected sides, and how many faces each has; and whether any runs twice one way."""
    a, b = mesh.faces[:, [0, 1, 2]].ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    size = len(mesh.vertices) + 1
    one_way = np.unique(a.astype(np.int64) * size + b, return_counts=True)[1]
    keys = np.minimum(a, b).astype(np.int64) * size + np.maximum(a, b)
    return np.unique(keys, return_counts=True)[1], one_way


def euler(mesh: Mesh) -> int:
    count, _ = sides(mesh)
    return len(mesh.vertices) - len(count) + len(mesh.faces)


def check_sound(mesh: Mesh) -> None:
    """A manifold with a border: one or two faces a side, wound alike, none degenerate."""
    count, one_way = sides(mesh)
    if len(mesh.faces):
        assert count.max() <= 2
        assert one_way.max() == 1, "neighbours are wound alike"
        assert (np.unique(mesh.faces) == np.arange(len(mesh.vertices))).all(), "none unused"
        t = mesh.triangles
        area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
        assert area.min() > 0
    assert len(mesh.provenance.sigma) == len(mesh.vertices)


def cube(cells: int = 20, side: float = 10.0) -> Mesh:
    """A closed cube, its sides cut into squares of two triangles."""
    k = np.arange(cells + 1)
    places, faces = [], []
    for axis in range(3):
        for level in (0, cells):
            a, b = np.meshgrid(k, k, indexing="ij")
            place = np.empty((cells + 1, cells + 1, 3), dtype=np.int64)
            place[..., axis], place[..., (axis + 1) % 3], place[..., (axis + 2) % 3] = level, a, b
            number = sum(map(len, places)) + np.arange(a.size).reshape(a.shape)
            p, q, r, s = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
            two = np.concatenate(
                [np.stack(t, axis=-1).reshape(-1, 3) for t in ((p, q, r), (p, r, s))]
            )
            faces.append(two if level else two[:, ::-1])
            places.append(place.reshape(-1, 3))
    whole, index = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    return Mesh(whole * side / cells, index.ravel()[np.concatenate(faces)])
