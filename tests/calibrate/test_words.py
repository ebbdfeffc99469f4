"""Parameters of a rig in words that people read."""

from __future__ import annotations

import re

import pytest

from tests.calibrate.bodies import eccentric, two_lasers
from turnscan.calibrate._words import amount_in_words, parameter_in_words


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
