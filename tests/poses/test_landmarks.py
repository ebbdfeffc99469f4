"""Poses from places that people picked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.poses import from_landmarks, rigid
from turnscan.rig import Pose, rotation_from_vector

CORNERS = np.array([[0.0, 0, 0], [50, 0, 0], [0, 40, 0], [10, 10, 30]])
number = st.floats(-3.0, 3.0)


@given(turn=st.tuples(number, number, number), shift=st.tuples(number, number, number))
def test_a_motion_is_found_again(turn, shift):
    T = Pose(rotation_from_vector(turn), 20.0 * np.array(shift))
    found = rigid(T.apply(CORNERS), CORNERS)
    assert np.allclose(found.rotation, T.rotation, atol=1e-9)
    assert np.allclose(found.translation, T.translation, atol=1e-7)


def picked(*poses, points=CORNERS):
    names = "abc"[: len(poses)]
    back = dict(zip(names, poses, strict=True))
    return list(names), {
        f"p{k}": {n: T.inverse().apply(x) for n, T in back.items()} for k, x in enumerate(points)
    }


def test_a_chain_of_poses_that_share_points_pair_by_pair():
    poses = [
        Pose(),
        *(Pose(rotation_from_vector([k, 0.3, 0]), np.array([k, 2.0, 3.0])) for k in (1, 2)),
    ]
    names, known = picked(*poses, points=np.concatenate([CORNERS, CORNERS + 7.0]))
    for k, seen in enumerate(known.values()):
        del seen["c" if k < 4 else "a"]  # c is known to b alone
    found = from_landmarks(names, known)
    for f, T in zip(found, poses, strict=True):
        assert np.allclose(f.rotation, T.rotation)
        assert np.allclose(f.translation, T.translation)


def test_bad_picks_are_one_clear_line():
    names, known = picked(Pose(), Pose())
    few = {k: known[k] for k in ("p0", "p1")}
    with pytest.raises(
        InputError, match=r"^b: 2 points known .* at least 3 are needed → pick more"
    ):
        from_landmarks(names, few)
    line = picked(Pose(), Pose(), points=np.outer([0.0, 1, 2, 3], [10.0, 5, 1]))
    with pytest.raises(InputError, match=r"^b: the 4 point pairs lie on one line"):
        from_landmarks(*line)
    with pytest.raises(InputError, match=r"^c: no such pose among a, b"):
        from_landmarks(names, {**known, "q": {"c": np.zeros(3)}})
    known["p3"]["b"] = known["p3"]["b"] + [0, 0, 60.0]
    with pytest.raises(InputError, match=r"^b: point p3 lies \d+\.\d mm from its position"):
        from_landmarks(names, known)
