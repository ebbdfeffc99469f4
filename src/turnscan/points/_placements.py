"""Where range scans belong: several poses, or the scans of another scanner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import FormatError, LimitExceeded
from turnscan.points._grid import RangeGrid
from turnscan.rig import Pose

_MAX_PLACEMENTS = 10_000


def placed(grid: RangeGrid, pose: Pose, name: str) -> RangeGrid:
    """The grid moved to where it belongs, under another name.

    Its table turned about an axis of its own, so that angles mean nothing in the new frame: they
    are all zero, as in the scans of other scanners.
    """
    return replace(
        grid,
        laser=name,
        angles=np.zeros(len(grid.angles)),
        points=pose.apply(grid.points),
        eyes=None if grid.eyes is None else pose.apply(grid.eyes),
        light_doubt=None
        if grid.light_doubt is None
        else pose.turn(grid.light_doubt).astype(np.float32),
    )


def placements_from_conf(text: str, source: str = "conf", *, scale: float = 1.0) -> dict[str, Pose]:
    """Where each scan belongs, from lines ``bmesh NAME tx ty tz qx qy qz qw``: name → T_world_scan.

    The file stores the inverse rotation: p_world = R(q)⁻¹ p_scan + t. ``scale`` turns the unit of t
    into mm. Raises FormatError naming the line.
    """
    placed: dict[str, Pose] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0] != "bmesh":
            continue
        where = f"{source}, line {number}"
        if len(placed) >= _MAX_PLACEMENTS:
            raise LimitExceeded(f"{where}: more than {_MAX_PLACEMENTS} scans")
        try:
            t = np.array([float(w) for w in words[2:5]])
            q = np.array([float(w) for w in words[5:]])
        except ValueError as e:
            raise FormatError(f"{where}: {e}") from None
        length = float(np.linalg.norm(q)) if q.shape == (4,) else 0.0
        if not (np.isfinite(t).all() and 0.5 < length < 2.0):
            raise FormatError(
                f"{where}: expected 'bmesh NAME tx ty tz qx qy qz qw' with a unit quaternion",
                hint="correct or remove that line",
            )
        if words[1] in placed:
            raise FormatError(f"{where}: {words[1]} is given twice", hint="keep one of the lines")
        placed[words[1]] = Pose(_from_quaternion(q / length).T, t * scale)
    if not placed:
        raise FormatError(
            f"{source}: no line 'bmesh NAME tx ty tz qx qy qz qw'",
            hint="give the .conf file that came with the range scans",
        )
    return placed


def _from_quaternion(q: Floats) -> Floats:
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
