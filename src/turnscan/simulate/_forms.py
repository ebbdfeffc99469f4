"""Free forms of the simulator: the cup's section, a head with a nose, a bust."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.simulate import _solids as solids


def cup_profile(wall: float) -> Floats:
    """Half section (n, 2) of a cup 84 mm tall with a wall of ``wall`` mm and a rounded rim."""
    z = np.linspace(8.0, 84.0 - wall / 2, 110)
    s = (z - 8.0) / 76.0
    outer = 27.0 + 12.0 * s**0.75 - 1.5 * np.sin(np.pi * s)
    # The inside lies `wall` from the outside, measured square to it.
    slope = np.gradient(outer, z)
    lean = np.hypot(1.0, slope)
    inner = np.column_stack([outer - wall / lean, z + wall * slope / lean])
    top = np.array([outer[-1], z[-1]]), inner[-1]
    middle, half = (top[0] + top[1]) / 2, (top[0] - top[1]) / 2
    turn = np.linspace(0, np.pi, 25)[1:-1, None]
    rim = middle + half * np.cos(turn) + half[::-1] * (-1, 1) * np.sin(turn)
    foot = [(0.0, 2.0), (20.0, 2.0), (21.0, 0.0), (23.5, 0.0), (24.5, 3.0)]
    inside = inner[inner[:, 1] > 10.0][::-1]
    floor = [(inside[-1, 0] - 4.0, 7.0), (0.0, 6.5)]
    return np.concatenate([foot, np.column_stack([outer, z]), rim, inside, floor])


def handle_path() -> Floats:
    """Centre line (n, 3) of a cup's handle, its ends within the wall."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 120)
    x = 32.6 + 24.0 * np.cos(turn) ** 0.8
    z = 44.0 + 23.0 * np.sin(turn)
    x += 3.4 * (z - 21.0) / 46.0
    return np.column_stack([x, 0 * x, z])


def _bump(
    z: Floats,
    turn: Floats,
    at: tuple[float, float],
    size: tuple[float, float],
    rise: float,
    steep: int = 1,
) -> Floats:
    """A smooth hill of ``rise`` mm at (height mm, azimuth rad), of rms ``size`` in the same.

    ``steep`` 2 gives it a flat top and sides twice as steep.
    """
    away = np.angle(np.exp(1j * (turn - at[1])))
    along, across = ((z - at[0]) / size[0]) ** 2, (away / size[1]) ** (2 * steep)
    hill: Floats = rise * np.exp(-0.5 * (along + across))
    return hill


def _spline(z: Floats, knots: Sequence[tuple[float, float]]) -> Floats:
    from scipy.interpolate import PchipInterpolator

    heights, values = np.array(knots).T
    return np.asarray(PchipInterpolator(heights, values)(z))


def _ellipse(a: Floats, b: Floats, turn: Floats) -> Floats:
    return np.asarray(a * b / np.hypot(b * np.cos(turn), a * np.sin(turn)))


def _mesh(radius: Callable[[Floats, Floats], Floats], top: float) -> Mesh:
    # Rows crowd towards the crown, where the surface turns over.
    t = np.linspace(0, 1, 361)
    return solids.radial(radius, top * np.sin(t * np.pi / 2) ** 0.9, 540)


def head(steep: int = 1) -> Mesh:
    """Mannequin's head; the face looks along +x.

    The nose's sides lean by up to 60°, or 73° where it is twice as ``steep`` (2).
    """
    depth = [(0, 27), (14, 24), (28, 25), (36, 37), (60, 43), (80, 45), (96, 36), (104, 22)]
    width = [(0, 27), (14, 23), (28, 24), (36, 27), (60, 34), (80, 36), (96, 29), (104, 17)]

    def radius(z: Floats, turn: Floats) -> Floats:
        r = _ellipse(
            _spline(z, [*depth, (107.5, 8), (108, 4)]),
            _spline(z, [*width, (107.5, 6), (108, 3)]),
            turn,
        )
        hills: list[tuple[tuple[float, float], tuple[float, float], float]] = [
            ((55, 0.0), (7.0, 0.10), 11.0),  # nose
            ((64, 0.0), (7.0, 0.07), 4.0),  # its bridge
            ((49, 0.0), (2.5, 0.16), 5.0),  # its wings
            ((41, 0.0), (2.2, 0.22), 3.5),  # upper lip
            ((37, 0.0), (2.0, 0.18), 2.5),  # lower lip
            ((30, 0.0), (5.0, 0.30), 5.0),  # chin
            ((66, 0.42), (4.0, 0.18), -4.5),  # eye sockets
            ((66, -0.42), (4.0, 0.18), -4.5),
            ((66, 0.42), (2.6, 0.11), 2.8),  # eyes
            ((66, -0.42), (2.6, 0.11), 2.8),
            ((74, 0.40), (2.4, 0.24), 2.4),  # brows
            ((74, -0.40), (2.4, 0.24), 2.4),
            ((58, np.pi / 2), (7.0, 0.10), 6.0),  # ears
            ((58, -np.pi / 2), (7.0, 0.10), 6.0),
        ]
        nose, *others = hills
        r = r + _bump(z, turn, *nose, steep)
        for hill in others:
            r = r + _bump(z, turn, *hill)
        return r

    return _mesh(radius, 108.0)


def bust() -> Mesh:
    """Bearded bust on a plinth; the face looks along +x."""
    depth: list[tuple[float, float]] = [
        (0, 24),
        (10, 24),
        (14, 20),
        (22, 24),
        (40, 26),
        (50, 19),
        (58, 20),
    ]
    depth += [(66, 27), (84, 31), (100, 31), (112, 24), (118, 13), (119.6, 6), (120, 3)]
    width: list[tuple[float, float]] = [
        (0, 24),
        (10, 24),
        (14, 26),
        (22, 44),
        (38, 46),
        (50, 20),
        (58, 19),
    ]
    width += [(66, 22), (84, 26), (100, 27), (112, 21), (118, 11), (119.6, 5), (120, 2.5)]

    def radius(z: Floats, turn: Floats) -> Floats:
        r = _ellipse(_spline(z, depth), _spline(z, width), turn)
        hills: list[tuple[tuple[float, float], tuple[float, float], float]] = [
            ((86, 0.0), (6.0, 0.13), 8.0),  # nose
            ((66, 0.0), (8.0, 0.50), 7.0),  # beard
            ((78, 0.0), (2.0, 0.40), 3.0),  # moustache
            ((94, 0.42), (3.4, 0.20), -3.5),  # eyes
            ((94, -0.42), (3.4, 0.20), -3.5),
            ((100, 0.0), (2.5, 0.60), 2.5),  # brow
            ((90, np.pi / 2), (6.0, 0.12), 4.0),  # ears
            ((90, -np.pi / 2), (6.0, 0.12), 4.0),
        ]
        for at, size, rise in hills:
            r = r + _bump(z, turn, at, size, rise)
        curls = 0.9 * np.sin(9 * turn + 0.5 * z) * np.sin(0.55 * z + 3 * turn)
        hair = 1 / (1 + np.exp(-(np.abs(np.angle(np.exp(1j * turn))) - 0.9) / 0.12))
        return np.asarray(r + curls * hair / (1 + np.exp(-(z - 76) / 2.0)))

    return _mesh(radius, 120.0)
