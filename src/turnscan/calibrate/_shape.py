"""How far the uncertainty of a rig bends what it measures, beyond where it stands and its size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._sweeps import Sweep
from turnscan.rig import Rig

_ACROSS, _TURNS = 5, 6
"""Places along each side of the part of the picture that saw the part, and turns of the table."""
_STEP = 1e-3
"""Of a standard uncertainty: for slopes."""


def shape_doubt(rig: Rig, sweeps: Sequence[Sweep]) -> float:
    """mm rms by which the rig's uncertainty puts points beside their places, but for what moves,
    turns or enlarges all of them together; 0 without an uncertainty.

    The points are spread over the volume in which the sweeps saw something, as seen by their
    lasers: what a body leaves open bends another part that stands there.
    """
    if rig.covariance is None:
        return 0.0
    at = places_of(rig, sweeps)
    if not len(at):
        return 0.0
    values, directions = np.linalg.eigh(rig.covariance)
    common = moves_of(at)
    own, _ = np.linalg.qr(common)
    off = 0.0
    for value, direction in zip(values, directions.T, strict=True):
        if value <= 0.0:
            continue
        step = _STEP * np.sqrt(value) * direction
        ends = [places_of(rig.perturbed(s * step), sweeps) for s in (1.0, -1.0)]
        moved = (ends[0] - ends[1]).ravel() / (2 * _STEP)
        left = moved - own @ (own.T @ moved)
        off += float(left @ left) / len(at)
    return float(np.sqrt(off))


def places_of(rig: Rig, sweeps: Sequence[Sweep]) -> Floats:
    """(n, 3) mm in the object's frame: places spread over what each sweep saw."""
    out = []
    for sweep in sweeps:
        if not len(sweep.pixels):
            continue
        (u0, v0), (u1, v1) = sweep.pixels.min(axis=0), sweep.pixels.max(axis=0)
        grid = np.stack(
            np.meshgrid(np.linspace(u0, u1, _ACROSS), np.linspace(v0, v1, _ACROSS)), axis=-1
        ).reshape(-1, 2)
        X = rig.T_camera_table.inverse().apply(
            rig.sheet(sweep.laser).intersect(rig.camera.rays(grid))
        )
        turns, shifts = rig.turning(np.arange(_TURNS) * 2 * np.pi / _TURNS)
        at = X - np.broadcast_to(shifts, (_TURNS, 3))[:, None]
        out.append(np.einsum("kji,knj->kni", turns, at).reshape(-1, 3))
    return np.concatenate(out) if out else np.zeros((0, 3))


def moves_of(at: Floats) -> Floats:
    """(3n, 7): shifts, turns and enlargement of points (n, 3) together."""
    middle = at - at.mean(axis=0)
    shifts = [np.broadcast_to(axis, at.shape).ravel() for axis in np.eye(3)]
    turns = [np.cross(axis, middle).ravel() for axis in np.eye(3)]
    return np.stack([*shifts, *turns, middle.ravel()], axis=1)
