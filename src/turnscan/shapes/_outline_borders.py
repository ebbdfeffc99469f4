"""At which point a piece of an outline ends is not sure: what that leaves unknown of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes._outline_bodies import Body, Index, Tangency, solved, weighed, weights
from turnscan.shapes._outline_noise import Noise
from turnscan.shapes._section import Chain

_MOST = 3
"""Points by which a border is moved, either way."""


def count_borders(
    chain: Chain,
    bodies: list[Body],
    ties: list[Tangency],
    scale: Floats,
    noise: Noise,
    closed: bool,
) -> None:
    """Add to the ``moves`` of adjusted bodies what their borders leave unknown.

    Each border is moved by a few points either way and all bodies are adjusted again, to first
    order (Woodbury's identity); what that does to them counts by how likely it is, exp(−Δχ²/2):
    the mean over models (Hoeting et al. 1999). At a sharp corner no other border is likely.
    """
    found = weighed(chain, bodies, scale)
    inverse = solved(bodies, ties, found)
    pairs = [*pairwise(range(len(bodies)))]
    if closed and len(bodies) > 1:
        pairs.append((len(bodies) - 1, 0))
    columns = list[Floats]()
    for pair in pairs:
        trials = [
            _moved(chain, bodies, found.starts, inverse, scale, m)
            for m in _ways(chain, bodies, *pair)
        ]
        costs = [cost / noise.shared for _, cost in trials]
        odds = np.exp(-0.5 * np.clip(costs, 0.0, 1e3))
        shares = odds / (1.0 + odds.sum())
        columns += [np.sqrt(share) * by for share, (by, _) in zip(shares, trials, strict=True)]
    if not columns:
        return
    more = np.stack(columns, axis=1)
    for b, at in zip(bodies, found.starts, strict=False):
        if len(b.p):
            b.moves = np.hstack([b.moves, more[at : at + len(b.p)]])


Way = tuple[tuple[int, float, Index], ...]
"""Numbers of bodies, whether points leave (−1) or join (+1) them, and which."""


def _ways(chain: Chain, bodies: list[Body], first: int, second: int) -> Iterator[Way]:
    """Up to `_MOST` points of either body that go to the other; each keeps what it needs."""
    a, b = bodies[first], bodies[second]
    for source, target, own, other in (
        (first, second, a.rows[::-1], b.rows[:1]), (second, first, b.rows, a.rows[-1:])
    ):  # fmt: skip
        shared = (chain.points[own] == chain.points[other]).all(axis=1)
        own = own[~shared]
        spare = len(own) - len(bodies[source].p) - 1
        for count in range(1, 1 + min(_MOST, spare)):
            yield (source, -1.0, own[:count]), (target, 1.0, own[:count])


def _moved(
    chain: Chain, bodies: list[Body], starts: Index, inverse: Floats, scale: Floats, way: Way
) -> tuple[Floats, float]:
    """What moving a border does to all parameters, and how much χ² grows."""
    total = len(inverse)
    sides, signs = [np.zeros((total, 0))], list[float]()
    pull, cost = np.zeros(total), 0.0
    for number, sign, rows in way:
        b = replace(bodies[number], rows=rows)
        if not len(b.p):
            continue
        r, J, w = weights(chain, b, scale)
        k = slice(int(starts[number]), int(starts[number]) + len(b.p))
        side = np.zeros((total, len(rows)))
        side[k] = J.T * np.sqrt(w)
        sides.append(side)
        signs += [sign] * len(rows)
        pull[k] -= sign * (J.T * w) @ r
        cost += sign * float((w * r**2).sum())
    U = np.hstack(sides)
    PU = inverse @ U
    small = np.diag(signs) + U.T @ PU
    by = inverse @ pull
    by -= PU @ np.linalg.lstsq(small, U.T @ by, rcond=1e-9)[0]
    return by, cost - float(pull @ by)
