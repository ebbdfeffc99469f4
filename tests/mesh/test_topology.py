"""How faces hang together: each side and the one that runs the other way."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import numpy.typing as npt
import pytest

from turnscan.mesh import opposite_half_edges


def plainly(faces: npt.NDArray[np.int32]) -> list[int]:
    """The same by a dictionary: the one side b–a for a side a–b of which there is but one."""
    sides = [(int(t[i]), int(t[(i + 1) % 3])) for t in faces for i in range(3)]
    where = defaultdict(list)
    for number, side in enumerate(sides):
        where[side].append(number)
    return [where[b, a][0] if len(where[a, b]) == 1 == len(where[b, a]) else -1 for a, b in sides]


@pytest.mark.parametrize("vertices", [2, 3, 5, 12, 60])
def test_twins_of_any_faces_are_those_that_a_dictionary_finds(vertices: int) -> None:
    # Few vertices: sides of three and more faces, wound unlike, faces twice, corners that coincide.
    rng = np.random.default_rng(vertices)
    some = 0
    for count in (0, 1, 2, 7, 40, 200):
        faces = rng.integers(0, vertices, (count, 3)).astype(np.int32)
        found = opposite_half_edges(faces)
        assert found.tolist() == plainly(faces)
        some += int((found >= 0).sum())
    assert some


def test_many_faces_about_one_vertex_are_no_trouble() -> None:
    # By the list of all sides at the middle it would take 10¹¹ looks.
    rim = np.arange(1, 300_001, dtype=np.int32)
    faces = np.stack([np.zeros_like(rim), rim, np.roll(rim, -1)], axis=1)
    twin = opposite_half_edges(faces)
    assert (twin[1::3] == -1).all()
    assert (twin[2::3] == np.roll(3 * np.arange(len(rim)), -1)).all()
