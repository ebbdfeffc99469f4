"""Parts in sizes drawn at random, with the planes and round faces that they have."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.simulate import Part
from turnscan.simulate import _parts as parts
from turnscan.simulate import _solids as solids
from turnscan.simulate import _truth as truth

EDGE = 3.0
"""mm from an edge within which no measure is taken: stripes lie on both sides of it there."""

Inside = Callable[[Floats], Bools]
"""Which places (n, 3) of the part's frame belong to a face."""


@dataclass(frozen=True)
class Sized:
    """A part, and where what can be measured on it is; all in its own frame, mm."""

    part: Part
    flats: Mapping[str, Inside] = field(default_factory=dict)
    """Flat faces, without a strip beside their edges."""
    rounds: Mapping[str, tuple[float, Inside]] = field(default_factory=dict)
    """Diameters of cylinders and spheres, and their faces without the strips beside the edges."""
    turned: tuple[float, float, float] | None = None
    """Diameter of an upright cylinder about z, and between which heights it is free."""
    volume: float = math.nan
    """mm³."""


def drawn(kind: str, rng: np.random.Generator) -> Sized:
    """A part of a kind in `KINDS`."""
    return _MAKERS[kind](rng)


def _sphere(rng: np.random.Generator) -> Sized:
    r = float(rng.uniform(14, 24))

    def free(p: Floats) -> Bools:
        return np.asarray(np.abs(p[:, 2] - r) < 0.8 * r, dtype=np.bool_)

    return Sized(parts.sphere(r), rounds={"sphere": (2 * r, free)}, volume=4 / 3 * math.pi * r**3)


def _side(r: float, low: float, high: float) -> Inside:
    def inside(p: Floats) -> Bools:
        near = np.abs(np.hypot(p[:, 0], p[:, 1]) - r) < 1.5
        return np.asarray(near & (p[:, 2] > low + EDGE) & (p[:, 2] < high - EDGE), dtype=np.bool_)

    return inside


def _cylinder(rng: np.random.Generator) -> Sized:
    r, h = float(rng.uniform(12, 28)), float(rng.uniform(40, 78))
    return Sized(
        parts.cylinder(r, h),
        rounds={"cylinder": (2 * r, _side(r, 0, h))},
        turned=(2 * r, EDGE, h - EDGE),
        volume=math.pi * r**2 * h,
    )


def _hexagon(rng: np.random.Generator) -> Sized:
    flats, h = float(rng.uniform(30, 46)), float(rng.uniform(30, 50))
    half = flats / 2 / math.sqrt(3) - EDGE

    def side(k: int) -> Inside:
        turn = math.pi / 6 + k * math.pi / 3
        n = np.array([math.cos(turn), math.sin(turn)])

        def inside(p: Floats) -> Bools:
            out, along = p[:, :2] @ n - flats / 2, p[:, 0] * -n[1] + p[:, 1] * n[0]
            near = (np.abs(out) < 1.5) & (np.abs(along) < half)
            return np.asarray(near & (p[:, 2] > EDGE) & (p[:, 2] < h - EDGE), dtype=np.bool_)

        return inside

    volume = math.sqrt(3) / 2 * flats**2 * h + math.pi * 12**2 * 15
    return Sized(
        parts.hexagon(flats, h),
        flats={f"side {k + 1}": side(k) for k in range(6)},
        rounds={"boss": (24.0, _side(12.0, h, h + 15))},
        turned=(24.0, h + EDGE, h + 15 - EDGE),
        volume=volume,
    )


def _shaft(rng: np.random.Generator) -> Sized:
    low, middle, high = sorted(rng.uniform(10, 26, 3), reverse=True)
    a, b, c = np.cumsum(rng.uniform(18, 26, 3))
    profile = [(0, 0), (low, 0), (low, a), (middle, a), (middle, b), (high, b), (high, c), (0, c)]
    part = Part("stepped", solids.revolved(profile), truth.revolved(profile))
    volume = math.pi * (low**2 * a + middle**2 * (b - a) + high**2 * (c - b))
    sides = {"low": (low, 0.0, a), "middle": (middle, a, b), "high": (high, b, c)}
    return Sized(
        part,
        rounds={name: (2 * r, _side(r, z0, z1)) for name, (r, z0, z1) in sides.items()},
        turned=(2 * low, EDGE, a - EDGE),
        volume=volume,
    )


def _cup(rng: np.random.Generator) -> Sized:
    return Sized(parts.cup(float(rng.uniform(2.0, 4.0))))


_MAKERS: Mapping[str, Callable[[np.random.Generator], Sized]] = {
    "sphere": _sphere, "cylinder": _cylinder, "hexagon": _hexagon, "shaft": _shaft, "cup": _cup,
}  # fmt: skip
KINDS = tuple(_MAKERS)
