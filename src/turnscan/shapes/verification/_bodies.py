"""Artefacts to print: closed triangles of a ball bar and of a step block, mm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.mesh import Mesh

_FINE = 0.02
"""mm: how far flat triangles may lie from a ball."""
_ROD = 0.3
"""Radius of the rod over that of a ball."""
_SEAT, _STAND, _RISE = 0.6, 1.3, 0.3
"""Of the stand, over the radius of a ball: inner and outer radius, height."""


def ball_bar_body(diameter: float, distance: float) -> Mesh:
    """Two balls above each other on a rod, from z = 0 on; one closed surface.

    The rod ends in the balls, so that a calliper reaches both poles. Raises InputError where the
    balls would touch or a size is none.
    """
    r = diameter / 2
    if not (5 <= diameter <= 200 and diameter * 1.2 <= distance <= 1000):
        raise InputError(
            f"a ball bar of {diameter:g} mm balls, {distance:g} mm apart",
            hint="take balls of 5 to 200 mm, their centres at least 1.2 diameters apart",
        )
    neck, count = float(np.arcsin(_ROD)), _count(r)
    first = np.linspace(-np.pi / 2, np.pi / 2 - neck, count)
    last = -first[::-1]
    balls = [
        np.column_stack([r * np.cos(turn), z + r * np.sin(turn)])
        for turn, z in ((first, r), (last, r + distance))
    ]
    return _revolved(np.concatenate(balls), 2 * count)


def stand_body(diameter: float) -> Mesh:
    """A ring on z = 0 in which a ball sits, its centre `seat_height` above the table."""
    r = diameter / 2
    profile = np.array([(_SEAT, 0.0), (_STAND, 0.0), (_STAND, _RISE), (_SEAT, _RISE)]) * r
    return _ring(profile, 2 * _count(r))


def seat_height(diameter: float) -> float:
    """mm: how high the centre of a ball lies that sits in its stand."""
    return (_RISE + float(np.sqrt(1 - _SEAT**2))) * diameter / 2


def _count(radius: float) -> int:
    return int(np.ceil(np.pi / np.arccos(1 - _FINE / radius)))


def step_block_body(
    heights: Sequence[float], width: float = 20.0, tall: float = 60.0, back: float = 15.0
) -> Mesh:
    """A staircase stood on its end: each level a face of ``width`` × ``tall`` mm that looks along
    +x, at x = 0 and the ``heights``, side by side along y; one closed surface.

    Raises InputError where the heights do not ascend.
    """
    x = np.array([0.0, *heights])
    if not (np.diff(x) >= 0.5).all() or x[-1] > 500 or not 1 <= len(heights) <= 10:
        raise InputError(
            f"levels {', '.join(f'{h:g}' for h in heights)} mm above the first",
            hint="give 1 to 10 ascending heights, at least 0.5 mm apart",
        )
    vertices, caps = list[tuple[float, float]](), list[list[int]]()
    # The outline seen from above, counter-clockwise: out along the back, home along the steps.
    k = len(x)
    vertices += [(-back, width * j) for j in range(k + 1)]
    top = dict[tuple[int, int], int]()
    for j in range(k):
        for side in (0, 1):
            top[j, side] = len(vertices)
            vertices.append((float(x[j]), width * (j + side)))
    front = [top[j, side] for j in range(k) for side in (0, 1)]
    walls = [*front, *range(k, -1, -1)]
    for j in range(k):
        # A column of the caps, as a fan from its far back corner; the step below lies on its side.
        below = [top[j - 1, 1]] if j else []
        caps.append([j + 1, j, *below, top[j, 0], top[j, 1]])
    flat = np.array(vertices)
    n = len(flat)
    v = np.vstack([np.column_stack([flat, np.full(n, z)]) for z in (0.0, tall)])
    fans = [(c[0], c[i], c[i + 1]) for c in caps for i in range(1, len(c) - 1)]
    faces = [(a + n, b + n, c + n) for a, b, c in fans] + [(a, c, b) for a, b, c in fans]
    for a, b in zip(walls, [*walls[1:], walls[0]], strict=True):
        faces += [(a, b, b + n), (a, b + n, a + n)]
    return Mesh(v - (0.0, width * k / 2, 0.0), np.array(faces))


def _revolved(profile: Floats, count: int) -> Mesh:
    """A profile (n, 2) of r and z, from the axis up to the axis, revolved in ``count`` steps."""
    inner = profile[1:-1]
    rows = len(inner)
    v = np.vstack([_rings(inner, count), [(0, 0, profile[0, 1]), (0, 0, profile[-1, 1])]])
    k = np.arange(count)
    after = (k + 1) % count
    low, high = np.full(count, rows * count), np.full(count, rows * count + 1)
    end = (rows - 1) * count
    ends = [np.stack([low, after, k], 1), np.stack([high, end + k, end + after], 1)]
    return Mesh(v, np.concatenate([_bands(rows, count, rows - 1), *ends]))


def _ring(profile: Floats, count: int) -> Mesh:
    """A closed profile (n, 2) of r and z, counter-clockwise, free of the axis, revolved."""
    return Mesh(_rings(profile, count), _bands(len(profile), count, len(profile)))


def _rings(profile: Floats, count: int) -> Floats:
    turn = np.arange(count) * (2 * np.pi / count)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    flat = (profile[:, None, :1] * circle).reshape(-1, 2)
    return np.column_stack([flat, np.repeat(profile[:, 1], count)])


def _bands(rows: int, count: int, bands: int) -> np.ndarray:
    """Two triangles per cell of (rows, count) vertices, between each row and the next."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(bands), np.arange(count), indexing="ij"))
    up = (i + 1) % rows
    a, b = i * count + j, i * count + (j + 1) % count
    c, d = up * count + j, up * count + (j + 1) % count
    return np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
