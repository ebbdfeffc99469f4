"""Parameters of a rig in words that people read."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.bodies import eccentric, two_lasers
from tests.calibrate.world import World, true_layout, true_rig
from turnscan.calibrate._normal import build, inverse_of
from turnscan.calibrate._observations import BEND, BOARD, RigNetwork
from turnscan.calibrate._state import State
from turnscan.calibrate._words import (
    amount_in_words,
    parameter_in_words,
    uncertainty_in_words,
    value_in_words,
)
from turnscan.errors import Degenerate


def test_every_parameter_of_a_rig_has_words_of_its_own() -> None:
    names = [*two_lasers().parameter_names, *eccentric().names, "scale", "sphere.radius"]
    worded = [parameter_in_words(name) for name in names]
    assert len(set(worded)) == len(names)
    assert not [text for text in worded if re.search(r"[_.]", text)]


@pytest.mark.parametrize(
    ("name", "said", "amount"),
    [
        ("right.offset", "laser right: shift of the sheet", "+0.0200 ± 0.0100 mm"),
        ("camera.fx", "camera: focal length across the picture", "+0.0200 ± 0.0100 px"),
        ("camera.k1", "camera: distortion k1", "+0.0200 ± 0.0100"),
        ("table.turn_x", "rotation axis: turn about the direction right", "+1.1459 ± 0.5730°"),
        ("motion.sin1", "table: wave 1 per turn, sine part", "+1.1459 ± 0.5730°"),
        ("right.bow_aa", "laser right: bow of the sheet along the stripe", "+0.02 ± 0.01 1/mm"),
        ("cone.half_angle", "cone: half angle", "+1.1459 ± 0.5730°"),
    ],
)
def test_a_value_has_its_unit(name: str, said: str, amount: str) -> None:
    assert parameter_in_words(name) == said
    assert amount_in_words(name, 0.02, 0.01) == amount


def test_each_parameter_of_a_calibration_has_its_unit_once() -> None:
    """What a report of a calibration says and what one of a refinement says is one unit."""
    names = [*two_lasers().parameter_names, *true_layout().names, *BEND]
    for name in names:
        unit = amount_in_words(name, 1.0, 1.0).partition("± ")[2].lstrip("0123456789.")
        assert uncertainty_in_words(name, 1.0).endswith(unit)
        assert value_in_words(name, 1.0).lstrip("0123456789.") == unit
    assert value_in_words("marker5.angle", 0.5) == "28.6479°"
    assert value_in_words("platter.slope_x", 0.002) == "0.002"
    assert value_in_words("board.bend_xy", 1e-5) == "1e-05 1/mm"


def test_what_the_views_leave_open_is_said_in_words() -> None:
    """Two columns that are one, and one that is nothing."""
    N = np.array([[2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    names = ("camera.fx", "table.shift_z", "laser.offset")
    with pytest.raises(Degenerate, match="focal length across the picture; rotation axis: shift"):
        inverse_of(N, lambda k: parameter_in_words(names[k]))
    with pytest.raises(Degenerate, match="nothing observed depends on this: laser laser: shift"):
        inverse_of(np.diag([1.0, 1.0, 0.0]), lambda k: parameter_in_words(names[k]))


def test_a_picture_that_fixes_nothing_of_its_own_is_named() -> None:
    """A board that no corner was found of has no pose, and the message says which."""
    w = World(true_rig(), np.random.default_rng(1), 0.1)
    view = w.board_view(w.board_poses(1)[0], name="c7.png")
    network = RigNetwork((view,), ((),), (w.rider_view(true_layout(), 0.0),), ())
    assert network.own_words(0) == "the pose of the board in c7.png"
    assert network.own_words(1) == "the angle of the table in picture 1"
    blind = replace(network, boards=(replace(view, corners=view.corners[:0], ids=view.ids[:0]),))
    state = State(replace(w.rig, sheets=()), None, (w.board_poses(1)[0],), np.zeros(0))
    alone = replace(blind, table=())
    free = np.zeros(len(alone.names), dtype=bool)
    with pytest.raises(Degenerate, match=r"depends on this: the pose of the board in c7\.png"):
        build(alone, alone.blocks(state), free, {BOARD: 1.0}, None, 0.0)
