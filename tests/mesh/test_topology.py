"""How faces hang together: each side and the one that runs the other way."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import numpy.typing as npt
import pytest

from turnscan.arrays import Bools, Ints
from turnscan.mesh import opposite_half_edges
from turnscan.mesh._topology import hanging_together


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


def test_what_hangs_by_a_vertex_goes_until_nothing_does() -> None:
    """As if after each round all of the rest were looked at."""
    rng = np.random.default_rng(5)
    rounds = 0
    for _ in range(200):
        faces = _strip(12, 6)[rng.random(120) < rng.uniform(0.3, 0.95)]
        kept, left = np.arange(len(faces)), faces
        for _ in range(100):
            gone = _all_but_the_largest_fans(left)
            if not gone.any():
                break
            rounds += 1
            kept, left = kept[~gone], left[~gone]
        expected = np.zeros(len(faces), dtype=bool)
        expected[kept] = True
        np.testing.assert_array_equal(hanging_together(faces), expected)
    assert rounds > 220, "for some, more than one round is needed"


def _strip(columns: int, rows: int) -> Ints:
    """(2 · (columns − 2) · rows, 3) faces of a sheet."""
    a = np.add.outer(np.arange(rows) * columns, np.arange(columns - 2)).ravel()
    b, c, d = a + 1, a + columns, a + columns + 1
    return np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.int32)


def _all_but_the_largest_fans(faces: Ints) -> Bools:
    """(f,)."""
    gone = np.zeros(len(faces), dtype=bool)
    for v in np.unique(faces):
        about = np.flatnonzero((faces == v).any(axis=1))
        fans: list[list[int]] = []
        for f in about:
            meets = [fan for fan in fans if any(_share_a_side(faces[f], faces[g]) for g in fan)]
            joined = [int(f), *(g for fan in meets for g in fan)]
            fans = [fan for fan in fans if fan not in meets] + [joined]
        fans.sort(key=lambda fan: (-len(fan), min(fan)))
        for fan in fans[1:]:
            gone[fan] = True
    return gone


def _share_a_side(one: Ints, other: Ints) -> bool:
    return len(np.intersect1d(one, other)) == 2
