"""The turntable's true motion: what a stepper, its gears and its bearing make of a command."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from turnscan.rig import Pose, Wobble, rotation_about, rotation_z
from turnscan.simulate._random import seed64


@dataclass(frozen=True)
class Motion:
    """Where the table really is when an angle is commanded.

    Angles in radians. The default is a perfect table. Raises ValueError, naming the field, where a
    value cannot be.
    """

    motor_step: float = math.radians(1.8)
    """Full step of the motor at the table."""
    microsteps: int = 0
    """Positions per full step that the table can hold; 0: any angle."""
    harmonics: tuple[tuple[int, float, float], ...] = ()
    """(order per turn, amplitude, phase) of the repeatable angle error; order 200 is the full step
    of a 1.8° motor."""
    backlash: float = 0.0
    """Angle lost when the direction of motion changes."""
    jitter: float = 0.0
    """rms of the error that does not repeat."""
    wobble: float = 0.0
    """Tilt of the table's plane that turns with the table: the part stands tilted, and is measured
    so; no shape is bent."""
    runout: float = 0.0
    """mm: circle that the middle of the table runs through in a turn, once round with it. The part
    turns about an axis so far beside it, and is measured there; no shape is bent."""
    axis_tilt: float = 0.0
    """Tilt of the axis that goes round against the table, as in a bearing that is not round:
    about the table's x at angle 0. It bends shapes, as do the next two (`turnscan.rig.Wobble`)."""
    axis_shift: float = 0.0
    """mm: shift of the axis that goes round against the table, along its x at angle 0."""
    axial: float = 0.0
    """mm by which the table rises at angle 0, and falls half a turn later."""
    clockwise: bool = False
    """The table turns the other way than commanded."""
    missed: Mapping[int, float] = field(default_factory=dict)
    """Angles lost for good before the move of that number, by number of the move."""

    def __post_init__(self) -> None:
        for name in ("axis_tilt", "axis_shift", "axial"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"Motion.{name}: {getattr(self, name)}, expected a number")
        for name in ("motor_step", "backlash", "jitter", "runout"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"Motion.{name}: {getattr(self, name)}, expected 0 or more")
        if self.microsteps < 0:
            raise ValueError(f"Motion.microsteps: {self.microsteps}, expected 0 or more")

    def angle(self, commanded: float, moves: int = 0, forward: bool = True, seed: int = 0) -> float:
        """True angle after the ``moves``-th move, which ended at ``commanded``, rad."""
        at = commanded - sum(lost for move, lost in self.missed.items() if move <= moves)
        if not forward:
            at += self.backlash
        if self.microsteps:
            grid = self.motor_step / self.microsteps
            at = round(at / grid) * grid
        at += sum(a * math.sin(order * at + phase) for order, a, phase in self.harmonics)
        if self.jitter:
            place = round(commanded * 1e9)
            at += self.jitter * float(np.random.default_rng(int(seed64(seed, place, 7))).normal())
        return -at if self.clockwise else at

    def pose(self, angle: float) -> Pose:
        """``T_table_object``: the object's frame at a true ``angle`` → the table at rest."""
        R = rotation_z(angle)
        if self.wobble:
            R = R @ rotation_about((1.0, 0.0, 0.0), self.wobble)
        shift = self.runout * np.array([math.cos(angle), math.sin(angle), 0.0])
        return self._axis(angle) @ Pose(R, shift)

    def _axis(self, angle: float) -> Pose:
        """What the axis itself does at a true angle."""
        if not (self.axis_tilt or self.axis_shift or self.axial):
            return Pose()
        tilt, shift, rise = ((x, 0.0) for x in (self.axis_tilt, self.axis_shift, self.axial))
        return Pose(*Wobble(np.array(tilt), np.array(shift), np.array(rise)).motion(angle))
