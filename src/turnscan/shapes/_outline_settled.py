"""An outline whose lines and circles are adjusted, where they meet, and how well that is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes._outline_bodies import Body, Tangency, meeting, touching
from turnscan.shapes._outline_curves import Joint
from turnscan.shapes._outline_noise import Noise
from turnscan.shapes._section import Chain

_REACH = 3.0
"""Neighbours are extended to where they cross no further than so many times the gap between."""


@dataclass(frozen=True, eq=False)
class Settled:
    """An outline whose lines and circles are adjusted."""

    chain: Chain
    closed: bool
    bodies: list[Body]
    ties: list[Tangency]
    scale: Floats
    noise: Noise
    tolerance: float

    def data(self, k: int, end: bool) -> Floats:
        """(2,) mm: the point of the chain at which body ``k`` ends, or begins."""
        return np.asarray(self.chain.points[self.bodies[k].ways[1 if end else 0]])

    def before(self, k: int) -> int | None:
        """The body before body ``k``."""
        if k:
            return k - 1
        return len(self.bodies) - 1 if self.closed and len(self.bodies) > 1 else None


@dataclass(frozen=True, eq=False)
class Meet:
    """Where a body begins and the one before it ends; two places where they do not meet."""

    end: Floats
    start: Floats
    joint: Joint


def corner(s: Settled, k: int) -> Meet:
    """Where body ``k`` begins, and the one before it ends; neither is a spline."""
    b, begins = s.bodies[k], s.data(k, end=False)
    j = s.before(k)
    if j is None:
        at = b.nearest(begins)
        return Meet(at, at, "end")
    a, ends = s.bodies[j], s.data(j, end=True)
    for t in s.ties:
        if {t.first, t.second} == {j, k} and (len(s.bodies) > 2 or t.first == j):
            at = touching(s.bodies, t)
            return Meet(at, at, "tangent")
    middle = (ends + begins) / 2
    gap = float(np.linalg.norm(begins - ends))
    crossing = meeting(a, b, middle)
    reach = _REACH * gap + 4 * s.tolerance
    if crossing is not None and float(np.linalg.norm(crossing - middle)) <= reach:
        return Meet(crossing, crossing, "corner")
    end, start = a.nearest(ends), b.nearest(begins)
    if gap <= 1e-9:
        end, start = a.nearest(middle), b.nearest(middle)
    if float(np.linalg.norm(end - start)) <= 2 * s.tolerance and "line" in (a.kind, b.kind):
        # A line gives way, a circle cannot.
        at = (end + start) / 2 if a.kind == b.kind else (end if b.kind == "line" else start)
        return Meet(at, at, "corner")
    return Meet(end, start, "corner")


def derived(s: Settled, value: Callable[[], float], of: list[int]) -> float:
    """Standard uncertainty of a figure that follows from the parameters of the bodies ``of``."""
    about = value()
    total = np.zeros(max(b.moves.shape[1] for b in s.bodies))
    for k in dict.fromkeys(of):
        b = s.bodies[k]
        for i in range(len(b.p)):
            step = max(float(np.linalg.norm(b.moves[i])), 1e-9) * 0.1
            b.p[i] += step
            total = total + (value() - about) / step * b.moves[i]
            b.p[i] -= step
    return float(np.linalg.norm(total))
