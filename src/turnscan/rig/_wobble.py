"""The axis's own motion: how it tilts and shifts in the room while the table turns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen

_AROUND = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
_LEAST = 1e-12
"""rad: a turn by less has no direction."""


@dataclass(frozen=True)
class Wobble:
    """How the axis of a table moves once in a turn, in so far as that bends shapes.

    At the true table angle a the table has turned by Rz(a), then by the small rotation vector
    θ = Rz(−a)·(tilt_x, tilt_y), and shifted by Rz(−a)·(shift_x, shift_y) and by
    rise_cos·cos a + rise_sin·sin a along its axis, all in the table frame at rest.

    These are all motions of first order and once per turn that no other parameter has. What stands
    still belongs to ``T_camera_table``; what goes round with the table tilts and shifts the part as
    a whole; a turn about the axis is an error of the angle. What goes round against the table, and
    what goes up and down, is left.
    """

    tilt: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,) rad: θ at angle 0."""
    shift: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,) mm: the shift across the axis at angle 0, at the height of the table frame's origin."""
    rise: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,) mm: cosine and sine part of the shift along the axis."""

    NAMES: ClassVar[tuple[str, ...]] = tuple(
        f"table.wobble_{name}"
        for name in ("tilt_x", "tilt_y", "shift_x", "shift_y", "rise_cos", "rise_sin")
    )
    """Its parameters among those of a rig, in the order of `values`."""

    def __post_init__(self) -> None:
        for name in ("tilt", "shift", "rise"):
            object.__setattr__(self, name, frozen(getattr(self, name), (2,), f"Wobble.{name}"))

    @classmethod
    def of(cls, values: npt.ArrayLike) -> Wobble:
        """From the values (6,) of `NAMES`."""
        v = frozen(values, (6,), "values")
        return cls(v[:2], v[2:4], v[4:])

    @property
    def values(self) -> Floats:
        """(6,) rad and mm, in the order of `NAMES`."""
        return np.concatenate([self.tilt, self.shift, self.rise])

    def lifted(self, height: float) -> Wobble:
        """The same motion as seen from an origin that is ``height`` mm farther up the axis."""
        x, y = self.tilt
        return Wobble(self.tilt, self.shift + height * np.array([y, -x]), self.rise)

    def motion(self, angle: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Rotations (..., 3, 3) and shifts (..., 3) mm that follow the turn by true angles (...)
        rad."""
        turns, shifts = self.slopes(angle)
        v = self.values
        return _rotations(v @ turns), v @ shifts

    @staticmethod
    def slopes(angle: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Rotation vectors and shifts, (..., 6, 3) each, at true angles (...) rad for one unit of
        each of the parameters `NAMES`."""
        a = np.asarray(angle, dtype=np.float64)
        c, s = np.cos(a), np.sin(a)
        turns, shifts = np.zeros((*a.shape, 6, 3)), np.zeros((*a.shape, 6, 3))
        for out, first in ((turns, 0), (shifts, 2)):
            out[..., first, 0] = out[..., first + 1, 1] = c
            out[..., first, 1], out[..., first + 1, 0] = -s, s
        shifts[..., 4, 2], shifts[..., 5, 2] = c, s
        return turns, shifts

    def reach(self, radius: float) -> float:
        """mm by which a place of the platter ``radius`` mm from the axis is off in a turn, at most;
        what a part as a whole is off, tilted or shifted, is not left aside."""
        turns, shifts = (self.values @ s for s in self.slopes(_AROUND))
        rim = radius * np.stack([np.cos(_AROUND), np.sin(_AROUND), 0.0 * _AROUND], axis=1)
        off = np.cross(turns[:, None], rim[None]) + shifts[:, None]
        return float(np.linalg.norm(off, axis=2).max())


def _rotations(vectors: Floats) -> Floats:
    """Rotations (..., 3, 3) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    cross = np.zeros((*vectors.shape, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -z, y, -x
    cross[..., 1, 0], cross[..., 2, 0], cross[..., 2, 1] = z, -y, x
    unit = cross / np.maximum(angle, _LEAST)
    turned: Floats = np.eye(3) + np.sin(angle) * unit + (1.0 - np.cos(angle)) * unit @ unit
    return turned
