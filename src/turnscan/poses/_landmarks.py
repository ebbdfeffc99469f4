"""Places known by name in several poses (picked by hand, or marker spheres) → poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.rig import Pose, nearest_rotation

Landmarks = Mapping[str, Mapping[str, Floats]]
"""Name of a place → name of a pose → (3,) mm in that pose's own frame."""
_LEAST = 3
_FLAT = 0.02
"""Extent of the points across their line, in parts of their extent along it, that is needed."""
_OFF = 0.1
"""How far a place may lie from its partner, in parts of the extent of all."""


def rigid(a: Floats, b: Floats) -> Pose:
    """The motion that takes points b (n, 3) nearest to points a (n, 3) (Umeyama 1991, no scale).

    Raises InputError for fewer than three points, or points on one line.
    """
    if len(a) < _LEAST:
        raise InputError(f"{len(a)} point pairs, at least {_LEAST} are needed")
    x, y = a - a.mean(axis=0), b - b.mean(axis=0)
    for points in (x, y):
        extent = np.linalg.svd(points, compute_uv=False)
        if extent[1] <= _FLAT * extent[0]:
            raise InputError(
                f"the {len(a)} point pairs lie on one line, so the rotation about it is "
                f"undetermined",
                hint="pick points far apart that span a triangle",
            )
    R = nearest_rotation(x.T @ y)
    return Pose(R, a.mean(axis=0) - R @ b.mean(axis=0))


def from_landmarks(names: Sequence[str], known: Landmarks) -> list[Pose]:
    """Where the poses ``names`` lie in the frame of the first, from places seen in several.

    The pose that shares most places with those placed before comes next.

    Raises InputError for a name that is no pose, for a pose that shares fewer than three places
    with the others or places on one line, and for a place that lies far from where the others
    put it.
    """
    strange = sorted({p for seen in known.values() for p in seen} - set(names))
    if strange:
        raise InputError(
            f"{strange[0]}: no such pose among {', '.join(names)}", hint="name them as their files"
        )
    placed = {names[0]: Pose()}
    while len(placed) < len(names):
        there = {
            place: np.mean([placed[p].apply(x) for p, x in seen.items() if p in placed], axis=0)
            for place, seen in known.items()
            if any(p in placed for p in seen)
        }
        shared = {n: [k for k in there if n in known[k]] for n in names if n not in placed}
        name = max(shared, key=lambda n: len(shared[n]))
        placed[name] = _placed(name, {k: (there[k], known[k][name]) for k in shared[name]})
    return [placed[n] for n in names]


def _placed(name: str, pairs: Mapping[str, tuple[Floats, Floats]]) -> Pose:
    if len(pairs) < _LEAST:
        raise InputError(
            f"{name}: {len(pairs)} points known in it and in the other poses, at least {_LEAST} "
            "are needed",
            hint="pick more, far apart",
        )
    a, b = (np.stack([p[k] for p in pairs.values()]) for k in (0, 1))
    try:
        pose = rigid(a, b)
    except InputError as e:
        raise InputError(f"{name}: {e.message}", hint=e.hint) from None
    off = np.linalg.norm(a - pose.apply(b), axis=1)
    worst = int(off.argmax())
    if off[worst] > _OFF * np.linalg.norm(np.ptp(a, axis=0)):
        raise InputError(
            f"{name}: point {list(pairs)[worst]} lies {off[worst]:.1f} mm from its position in "
            "the other poses",
            hint="pick it again, or leave it out",
        )
    return pose
