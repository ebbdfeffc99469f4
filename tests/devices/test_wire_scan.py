"""A scan through the real drivers, the guard and a pseudo-terminal sees the right pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.devices.boards import DIALECTS, OUTPUTS, firmware
from turnscan.arrays import Image
from turnscan.devices import burning, open_devices
from turnscan.simulate import SimCamera, simulated
from turnscan.simulate.controllers import Firmware, GrblFirmware, Socket, drive

ANGLES = (math.pi,)
"""Half a turn is a whole number of every board's units."""
BENCH = "sim:cup?rig=ciclop&perfect=yes&lasers=2"


def board_of(dialect: str) -> Firmware:
    # 80 steps a degree are exact in GRBL's settings, so the truth has no part of its own.
    return (
        GrblFirmware({"100": 80, "110": 6000, "120": 800})
        if dialect == "grbl"
        else firmware(dialect)
    )


@pytest.fixture(scope="module")
def truth() -> dict[str, Image]:
    """The pictures by laser ("" is dark) without board, guard and wire."""
    bench = simulated(BENCH)
    bench.camera.configure(bench.seconds, 1.0)
    bench.turntable.move_to(ANGLES[0], 1.0)
    pictures = {}
    for name in (*bench.lasers.names, ""):
        bench.lasers.light(frozenset({name} - {""}), 60.0)
        pictures[name] = bench.camera.grab(5.0)
    bench.lasers.off()
    return pictures


@pytest.mark.parametrize("dialect", DIALECTS)
def test_pictures_through_the_wire(dialect: str, truth: dict[str, Image]) -> None:
    bench = simulated(BENCH)
    names = bench.lasers.names
    board = board_of(dialect)
    outputs = [output.partition(":")[0] for output in OUTPUTS[dialect]]
    drive(bench.world, board, dict(zip(outputs, names, strict=True)))
    pictures: list[tuple[float, str, Image]] = []
    with (
        Socket(board, scale=100.0) as socket,
        open_devices(f"{dialect}:{socket.path}?lasers={','.join(names)}") as devices,
    ):
        camera = SimCamera(bench.world)
        camera.configure(bench.seconds, 1.0)
        for angle in ANGLES:
            reached = devices.turntable.move_to(angle, 20.0)
            for name in names:
                with burning(devices.lasers, frozenset({name})):
                    pictures.append((reached, name, camera.grab(5.0)))
            pictures.append((reached, "", camera.grab(5.0)))
    lit = [entry.outputs for entry in board.log if entry.outputs]
    assert lit == [frozenset({o}) for _ in ANGLES for o in outputs]

    for reached, name, picture in pictures:
        assert reached == pytest.approx(ANGLES[0], abs=1e-12)
        assert np.abs(picture.astype(int) - truth[name]).max() <= 2, name
    first_lit, first_dark = pictures[0][2].astype(int), pictures[2][2].astype(int)
    assert (first_lit - first_dark).max() > 30  # there is a stripe, and dark is dark
