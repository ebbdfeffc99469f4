"""Motions of a view that its overlaps do not determine: a cup may turn about its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, frozen
from turnscan.poses._refine import SLIP, Equations
from turnscan.rig import Pose

_FLAT = 0.3
"""mm of turning, in a motion of 1 mm, below which the motion is a shift."""


@dataclass(frozen=True)
class UndeterminedMotion:
    """A motion of one view, in the common frame, along which its surface slides on itself."""

    view: int
    middle: Floats
    """(3,) mm: the view's middle, which ``turn`` is about."""
    turn: Floats
    """(3,) radians, for a motion of 1 mm on the average of the overlap."""
    shift: Floats
    """(3,) mm, with it."""
    slip: float
    """How much the surface rises, in parts of the motion."""
    lever: float
    """mm: rms distance of the overlap from the middle."""

    def __post_init__(self) -> None:
        for name in ("middle", "turn", "shift"):
            object.__setattr__(
                self, name, frozen(getattr(self, name), (3,), f"UndeterminedMotion.{name}")
            )

    def __str__(self) -> str:
        """In words, for findings."""
        size = float(np.linalg.norm(self.turn))
        if size * self.lever < _FLAT:
            return f"shifting along {_words(self.shift)}"
        foot = self.middle + np.cross(self.turn, self.shift) / size**2
        return (
            f"turning about the axis along {_words(self.turn)} through "
            f"({', '.join(f'{x:.1f}' for x in foot)}) mm"
        )


def _words(direction: Floats) -> str:
    d = direction / np.linalg.norm(direction)
    d = d * np.sign(d[np.argmax(np.abs(d))]) + 0.0
    return f"({', '.join(f'{x:.2f}' for x in d)})"


def covariance(e: Equations, held: Floats | None = None, fixed: int = 1) -> Floats:
    """(6n, 6n) covariance of all poses, zero for the ``fixed`` first, without the ``held`` motions.

    From the information that the noise of the normals does not feign. A motion that nothing
    determines has the variance that its slip of a tenth of `SLIP` would give.
    """
    size = len(e.g)
    free = slice(6 * fixed, size)
    M = e.motion[free, free] + 1e-9 * np.eye(size - 6 * fixed)
    basis = np.eye(len(M))
    if held is not None and len(held):
        C = held[:, free] @ M
        basis = np.linalg.svd(C)[2][np.linalg.matrix_rank(C) :].T
    root = np.linalg.cholesky(basis.T @ M @ basis)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ basis.T @ e.true[free, free] @ basis @ inverse.T)
    back = basis @ inverse.T @ vectors
    out = np.zeros((size, size))
    out[free, free] = (back / np.maximum(values, (0.1 * SLIP) ** 2)) @ back.T
    return out


def freedoms(e: Equations, middles: Floats, fixed: int = 1) -> list[UndeterminedMotion]:
    """What each view can do without a surface rising by more than `SLIP` of the motion.

    The other views may follow, but for the ``fixed`` first. Judged by information whose two
    factors, the normals of either view, have independent noise: with one view's normals alone,
    noise would seem to hold everything (Gelfand & Guibas, Shape Segmentation Using Local Slippage
    Analysis, 2004).
    """
    C = covariance(e, fixed=fixed)
    out = []
    for i in range(fixed, len(middles)):
        at = slice(6 * i, 6 * i + 6)
        M = e.motion[at, at] + 1e-9 * np.eye(6)
        weight = max(float(e.motion[6 * i + 3, 6 * i + 3]), 1e-9)
        root = np.linalg.cholesky(M)
        inverse = np.linalg.inv(root)
        values, vectors = np.linalg.eigh(inverse @ np.linalg.inv(C[at, at]) @ inverse.T)
        for value, v in zip(values, (inverse.T @ vectors).T, strict=True):
            slip = float(np.sqrt(max(value, 0.0)))
            if slip < SLIP:
                v = v * np.sqrt(weight)
                lever = float(np.sqrt(np.trace(M[:3, :3]) / (2 * weight)))
                out.append(UndeterminedMotion(i, middles[i], v[:3], v[3:], slip, lever))
    return out


def shifting(found: Sequence[UndeterminedMotion], i: int) -> bool:
    """True where the freedoms of view i, together, hold a shift.

    No part is the same all along a line: where a view may be shifted, its overlap says too little.
    """
    turns = np.array([f.turn * f.lever for f in found if f.view == i])
    if not len(turns):
        return False
    return len(turns) > 3 or bool(np.linalg.svd(turns, compute_uv=False)[-1] < _FLAT)


def held_motions(found: Sequence[UndeterminedMotion], count: int) -> Floats:
    """(m, 6n) the freedoms as motions of all poses."""
    out = np.zeros((len(found), 6 * count))
    for row, f in zip(out, found, strict=True):
        row[6 * f.view : 6 * f.view + 6] = [*f.turn, *f.shift]
    return out


def explains(
    found: Sequence[UndeterminedMotion], i: int, a: Pose, b: Pose, points: Floats
) -> Floats:
    """(n,) mm: how far ``points`` of view i lie apart in poses a and b, freedoms of it aside."""
    span = np.array([[*f.turn, *f.shift] for f in found if f.view == i]).reshape(-1, 6)
    middle = next((f.middle for f in found if f.view == i), np.zeros(3))
    delta = b @ a.inverse()  # in the common frame
    there = Pose(np.eye(3), -middle) @ delta @ Pose(np.eye(3), middle)
    if len(span):
        twist = _log(there)
        along = span.T @ np.linalg.lstsq(span.T, twist, rcond=None)[0]
        there = there @ _exp(along).inverse()
    X = a.apply(points) - middle
    apart: Floats = np.linalg.norm(there.apply(X) - X, axis=1)
    return apart


def _log(pose: Pose) -> Floats:
    """(6,) turn and shift whose screw is the pose."""
    from scipy.spatial.transform import Rotation

    w = Rotation.from_matrix(pose.rotation).as_rotvec()
    return np.concatenate([w, np.linalg.solve(_left(w), pose.translation)])


def _exp(twist: Floats) -> Pose:
    from turnscan.rig import rotation_from_vector

    return Pose(rotation_from_vector(twist[:3]), _left(twist[:3]) @ twist[3:])


def _left(w: Floats) -> Floats:
    """(3, 3) the left Jacobian of SO(3)."""
    angle = float(np.linalg.norm(w))
    x = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    if angle < 1e-9:
        return np.asarray(np.eye(3) + x / 2)
    one, two = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + one * x + two * x @ x)
