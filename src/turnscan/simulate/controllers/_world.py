"""Lets an emulated board turn the simulated table and light the simulated lasers."""

from __future__ import annotations

import math

from turnscan.simulate._devices import World
from turnscan.simulate.controllers._firmware import Firmware


def drive(world: World, firmware: Firmware, names: dict[str, str]) -> None:
    """From now on the bench is where the board has turned it; outputs are lasers by ``names``."""

    def follow(board: Firmware) -> None:
        angle = 2 * math.pi * board.turns
        if abs(angle - world.commanded) > 1e-12:
            world.forward = angle > world.commanded
            world.moves += 1
            world.commanded = angle
        world.lit = frozenset(names[output] for output in board.lit if output in names)

    firmware.on_change = follow
    follow(firmware)
