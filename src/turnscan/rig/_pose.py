"""Rigid motions between frames, named ``T_ab``: ``x_a = T_ab @ x_b``."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen


def rotation_about(axis: npt.ArrayLike, angle: float) -> Floats:
    """Rotation matrix (3, 3) by ``angle`` radians about the direction ``axis`` (Rodrigues).

    Raises ValueError for an axis that has no direction.
    """
    w = frozen(axis, (3,), "axis")
    length = float(np.linalg.norm(w))
    if not 1e-300 < length < np.inf:
        raise ValueError(f"axis: {w} has no direction")
    w = w / length
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    turned: Floats = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return turned


def rotation_from_vector(vector: npt.ArrayLike) -> Floats:
    """Rotation matrix (3, 3) of a rotation vector (direction × angle in radians)."""
    r = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(r))
    return np.eye(3) if angle < 1e-300 else rotation_about(r, angle)


def rotation_z(angle: npt.ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3) by ``angle`` radians (any shape) about z."""
    a = np.asarray(angle, dtype=np.float64)
    R = np.zeros((*a.shape, 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = np.cos(a)
    R[..., 1, 0] = np.sin(a)
    R[..., 0, 1] = -R[..., 1, 0]
    R[..., 2, 2] = 1.0
    return R


def nearest_rotation(matrix: npt.ArrayLike) -> Floats:
    """The rotation (3, 3) nearest to a matrix (3, 3), by the sum of squares (Kabsch, 1976).

    Of a product of many rotations it is the one without their rounding errors; of Σ q pᵀ over
    points p and their places q, both about their means, the one that brings them nearest.
    """
    nearest: Floats = nearest_rotations(np.asarray(matrix, dtype=np.float64)[None])[0]
    return nearest


def nearest_rotations(matrices: Floats) -> Floats:
    """`nearest_rotation` of each of the matrices (n, 3, 3)."""
    u, _, vt = np.linalg.svd(matrices)
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    nearest: Floats = u @ vt
    return nearest


@dataclass(frozen=True)
class Pose:
    """A rigid motion ``T_ab``: coordinates in frame b become coordinates in frame a."""

    rotation: Floats = field(default_factory=lambda: np.eye(3))
    """(3, 3), proper and orthonormal."""
    translation: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) mm: the origin of b, in frame a."""

    def __post_init__(self) -> None:
        R = frozen(self.rotation, (3, 3), "Pose.rotation")
        if not _is_rotation(*R.tolist()):
            raise ValueError("Pose.rotation: not a proper rotation (R Rᵀ ≠ 1 or det < 0)")
        object.__setattr__(self, "rotation", R)
        object.__setattr__(self, "translation", frozen(self.translation, (3,), "Pose.translation"))

    def __matmul__(self, other: Pose) -> Pose:
        """``T_ac = T_ab @ T_bc``."""
        return Pose(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )

    def inverse(self) -> Pose:
        """``T_ba`` of ``T_ab``."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: npt.ArrayLike) -> Floats:
        """Points (..., 3) in frame b → the same points in frame a, mm."""
        moved: Floats = np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation
        return moved

    def turn(self, directions: npt.ArrayLike) -> Floats:
        """Directions (..., 3) in frame b → the same directions in frame a."""
        turned: Floats = np.asarray(directions, dtype=np.float64) @ self.rotation.T
        return turned


def _is_rotation(a: list[float], b: list[float], c: list[float]) -> bool:
    """Whether these rows are unit vectors, at right angles, and of a right-handed frame. In plain
    numbers: of nine of them that is quicker than with arrays."""
    (a1, a2, a3), (b1, b2, b3), (c1, c2, c3) = a, b, c
    aa, bb, cc = (
        a1 * a1 + a2 * a2 + a3 * a3,
        b1 * b1 + b2 * b2 + b3 * b3,
        c1 * c1 + c2 * c2 + c3 * c3,
    )
    ab, ac, bc = (
        a1 * b1 + a2 * b2 + a3 * b3,
        a1 * c1 + a2 * c2 + a3 * c3,
        b1 * c1 + b2 * c2 + b3 * c3,
    )
    off = max(abs(aa - 1), abs(bb - 1), abs(cc - 1), abs(ab), abs(ac), abs(bc))
    hand = a1 * (b2 * c3 - b3 * c2) - a2 * (b1 * c3 - b3 * c1) + a3 * (b1 * c2 - b2 * c1)
    return off <= 1e-6 and hand >= 0
