"""Bodies of known form in a scan, wherever they stand: how far points are from them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, cross, frozen
from turnscan.calibrate._part import Part
from turnscan.rig import Pose, nearest_rotation, rotation_from_vector

Index = npt.NDArray[np.intp]
Known = tuple[float, float]
"""A size and its standard uncertainty, mm or rad."""

_TURN, _SHIFT = slice(0, 3), slice(3, 6)


def _some(*axes: int) -> Floats:
    return np.eye(6)[:, list(axes)]


@dataclass(frozen=True)
class Balls:
    """Balls in a row along z, the first at the origin: a sphere is one of them, a ball bar two.

    Sizes: their radii, then the distances of the others from the first.
    """

    count: int = 1

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return "sphere" if self.count == 1 else "bar"

    @property
    def size_names(self) -> tuple[str, ...]:
        """Of its k sizes."""
        if self.count == 1:
            return ("radius",)
        radii = tuple(f"radius{k + 1}" for k in range(self.count))
        return (*radii, "distance") if self.count == 2 else (
            *radii, *(f"distance{k}" for k in range(1, self.count)))  # fmt: skip

    @property
    def moves(self) -> Floats:
        """(6, m): the turns about its axes and the shifts along them that change where it is."""
        return _some(3, 4, 5) if self.count == 1 else _some(0, 1, 3, 4, 5)

    def nearest(self, points: Floats, sizes: Floats) -> tuple[Floats, Floats, Floats]:
        """Of points (n, 3) mm in its frame: distance (n,) mm, the direction (n, 3) in which that
        grows, and its derivative (n, k) by the sizes."""
        n = self.count
        along = np.concatenate([[0.0], sizes[n:]])
        arm = points[:, None, :] - along[:, None] * np.array([0.0, 0.0, 1.0])
        length = np.maximum(np.linalg.norm(arm, axis=2), 1e-12)
        away = length - sizes[:n]
        which = np.argmin(np.abs(away), axis=1)
        rows = np.arange(len(points))
        unit = arm[rows, which] / length[rows, which, None]
        by = np.zeros((len(points), 2 * n - 1))
        by[rows, which] = -1.0
        far = which > 0
        by[rows[far], n + which[far] - 1] = -unit[far, 2]
        return away[rows, which], unit, by


@dataclass(frozen=True)
class Round:
    """A cylinder about z, or a cone whose radius grows along z: sizes are the radius at the origin
    and, of a cone, its half angle."""

    conical: bool = False

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return "cone" if self.conical else "cylinder"

    @property
    def size_names(self) -> tuple[str, ...]:
        """Of its k sizes; those that are angles end in ``angle``."""
        return ("radius", "half_angle") if self.conical else ("radius",)

    @property
    def moves(self) -> Floats:
        """As of `Balls`; a cone is moved along its axis by another radius at the origin."""
        return _some(0, 1, 3, 4)

    def nearest(self, points: Floats, sizes: Floats) -> tuple[Floats, Floats, Floats]:
        """As of `Balls`."""
        r = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-12)
        angle = float(sizes[1]) if self.conical else 0.0
        c, s = np.cos(angle), np.sin(angle)
        off = r - sizes[0]
        distance = c * off - s * points[:, 2]
        unit = np.stack([c * points[:, 0] / r, c * points[:, 1] / r, np.full(len(r), -s)], axis=1)
        by = [np.full(len(r), -c)]
        if self.conical:
            by.append(-s * off - c * points[:, 2])
        return distance, unit, np.stack(by, axis=1)


Form = Balls | Round | Part
"""A surface by a formula in a frame of its own, with sizes that may be free.

One residual serves all of them, the distance of a measured point."""


@dataclass(frozen=True)
class Body:
    """A form that stands somewhere in the scan, with what is known of its sizes."""

    form: Form
    pose: Pose
    """Its frame → the object's frame."""
    sizes: Floats
    """(k,)"""
    known: tuple[Known | None, ...]
    """(k,); None for a size that is free."""
    points: tuple[Index, ...] = ()
    """Per sweep: which of its points lie on it."""

    def __post_init__(self) -> None:
        k = len(self.form.size_names)
        object.__setattr__(self, "sizes", frozen(self.sizes, (k,), "Body.sizes"))

    @property
    def names(self) -> tuple[str, ...]:
        """Of its parameters: where it is, then its sizes."""
        places = (f"{self.form.name}.place{j + 1}" for j in range(self.form.moves.shape[1]))
        return (*places, *(f"{self.form.name}.{n}" for n in self.form.size_names))

    def distance(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Of points (n, 3) of the object's frame: distance (n,), its direction (n, 3), and its
        derivative (n, q) by the parameters of `names`."""
        local = self.pose.inverse().apply(points)
        away, unit, by_sizes = self.form.nearest(local, self.sizes)
        by_motion = np.concatenate([-cross(local, unit), -unit], axis=1)
        by = np.concatenate([by_motion @ self.form.moves, by_sizes], axis=1)
        return away, self.pose.turn(unit), by

    def moved(self, delta: Floats) -> Body:
        """After a small step of its parameters."""
        m = self.form.moves.shape[1]
        motion = self.form.moves @ delta[:m]
        turned = self.pose.rotation @ rotation_from_vector(motion[_TURN])
        shifted = self.pose.translation + self.pose.turn(motion[_SHIFT])
        pose = Pose(nearest_rotation(turned), shifted)
        return replace(self, pose=pose, sizes=self.sizes + delta[m:])
