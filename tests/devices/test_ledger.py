"""What is noted of a table outlives a look at its port, and no turning of it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.devices.boards import SCALE, firmware
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._registry import board
from turnscan.simulate.controllers import Socket

PATIENT = Deadlines(acknowledge=2.0, move_extra=3.0, connect=8.0, keep_trying=2.0)


@pytest.mark.parametrize("dialect", ["horus", "fabscan"])
@pytest.mark.parametrize("turns", [False, True])
def test_a_look_with_other_steps(
    dialect: str, turns: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with Socket(firmware(dialect), scale=SCALE) as socket:
        address = f"{dialect}:{socket.path}?steps_per_rev=6400"
        first = board(address, deadlines=PATIENT)
        first.move_to(math.radians(45.0), 30.0)
        angle, counting = first.angle, first.counting
        first.close()
        other = board(f"{dialect}:{socket.path}", deadlines=PATIENT)
        if turns:
            other.move_to(other.angle + 0.3, 30.0)
        other.close()
        again = board(address, deadlines=PATIENT)
        if turns:
            assert not again.still(counting)
        else:
            assert again.still(counting)
            assert again.angle == angle
        again.close()
