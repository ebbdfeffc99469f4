"""Faces split until none of them spans much of the turn about the z axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats

_SPAN = np.deg2rad(2.0)
"""Of an edge: between its ends the radius is taken as linear; that of a chord is within 5e-4."""
_SHORT = 0.01
"""Of the median radius: shorter edges stay, whose angle is large only beside the axis."""
_ROUNDS = 16

Index = npt.NDArray[np.int64]


class Split(NamedTuple):
    """Faces split, and what each part comes from."""

    points: Floats
    """(n, 3) mm."""
    of: Index
    """(n,) the vertex that each is, or that ends its edge."""
    faces: Index
    """(m, 3)."""
    face: Index
    """(m,) the face that each is a part of."""


def split(points: Floats, faces: Index) -> Split:
    """Halve edges that span more than two degrees about z; neighbours keep sharing theirs."""
    done = Split(points, np.arange(len(points)), faces, np.arange(len(faces)))
    short = _SHORT * float(np.median(np.hypot(*points[np.unique(faces), :2].T)))
    for _ in range(_ROUNDS):
        a, b = done.faces, np.roll(done.faces, -1, axis=1)
        wide = _wide(done.points[a][..., :2], done.points[b][..., :2], short)
        if not wide.any():
            break
        done = _halved(done, wide)
    return done


def _wide(a: Floats, b: Floats, short: float) -> Bools:
    turn = np.abs(np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1)))
    return np.asarray((turn > _SPAN) & (np.hypot(*np.moveaxis(b - a, -1, 0)) > short))


def _halved(s: Split, wide: Bools) -> Split:
    """One round; ``wide`` (m, 3): whether the edge from each vertex of a face to its next is."""
    a, b = s.faces, np.roll(s.faces, -1, axis=1)
    low, high = np.minimum(a, b), np.maximum(a, b)
    keys, number = np.unique((low * len(s.points) + high)[wide], return_inverse=True)
    first, last = keys // len(s.points), keys % len(s.points)
    middle = np.full(a.shape, -1)
    middle[wide] = len(s.points) + number.ravel()
    many = wide.sum(axis=1)
    # Each face begins with a wide edge; of two, with the first.
    begin = np.where((many == 2) & wide[:, 0] & wide[:, 2], 2, np.argmax(wide, axis=1))
    order = (begin[:, None] + np.arange(3)) % 3
    v, m = np.take_along_axis(a, order, axis=1), np.take_along_axis(middle, order, axis=1)
    (p, q, r), (x, y, z) = v.T, m.T
    parts = {
        0: [(p, q, r)],
        1: [(p, x, r), (x, q, r)],
        2: [(x, q, y), (p, x, y), (p, y, r)],
        3: [(p, x, z), (x, q, y), (y, r, z), (x, y, z)],
    }
    rows = [(np.flatnonzero(many == k), t) for k, some in parts.items() for t in some]
    return Split(
        np.concatenate([s.points, (s.points[first] + s.points[last]) / 2]),
        np.concatenate([s.of, s.of[first]]),
        np.concatenate([np.stack(t, axis=1)[on] for on, t in rows]),
        np.concatenate([s.face[on] for on, _ in rows]),
    )
