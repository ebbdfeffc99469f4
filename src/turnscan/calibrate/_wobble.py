"""Whether the axis of a table moves as it turns: asked of the pictures, and kept where they say so.

docs/explain/calibration.md has the motion, docs/decisions/0046-wobble.md why it is asked so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools
from turnscan.calibrate._adjust import HUBER, Fit, adjust
from turnscan.calibrate._normal import build, cost_of, step
from turnscan.calibrate._observations import RigNetwork
from turnscan.calibrate._procedure import Stages
from turnscan.calibrate._state import State
from turnscan.rig import Wobble

HOPELESS = 0.5
"""Part of the standard deviations that a parameter needs to be kept, by a linear step: no fit is
needed to see that it is not."""
_FEWEST, _WIDEST = 8, np.radians(100.0)
"""Pictures of the table that tell a motion once per turn from one that stands still or goes round
with the table, and the largest gap between their angles."""


def with_wobble(
    fit: Fit[State], network: RigNetwork, stages: Stages, free: Bools
) -> tuple[Fit[State], RigNetwork]:
    """The fit with the axis's own motion where the pictures of the table ask for it, and its
    network; both as they were where they do not.

    All six parameters are kept, or none: those that the pictures say little of, as what goes along
    the line of sight to a board without a stripe, then have an uncertainty that says so. Wald's
    statistic, with the covariance as it is widened for what a picture's errors have in common, is
    what they lower χ² by; Bayes' information criterion asks for 6·ln n of n observations.
    """
    if "table" not in stages.given or not _seen_all_round(fit.state):
        return fit, network
    rig = replace(fit.state.rig, wobble=Wobble())
    wide = replace(network, wobble=True, prior=stages.prior(rig))
    state = replace(fit.state, rig=rig)
    was = dict(zip(network.names, free, strict=True))
    every = np.array([was.get(name, True) for name in wide.names])
    count = float(np.log(sum(len(b.residual) for b in fit.blocks)))
    at = wide.names.index(Wobble.NAMES[0])
    own = slice(at, at + len(Wobble.NAMES))
    near = replace(fit, state=state, blocks=tuple(wide.blocks(state)))
    if _gain(wide, near, every) < HOPELESS**2 * len(Wobble.NAMES) * count:
        return fit, network
    most = adjust(wide, state, every, near=near)
    assert most.state.rig.wobble is not None
    values = most.state.rig.wobble.values
    gain = float(values @ np.linalg.solve(most.covariance[own, own], values))
    return (most, wide) if gain > len(values) * count else (fit, network)


def _gain(network: RigNetwork, fit: Fit[State], free: Bools) -> float:
    """About how much one linear step lowers n·ln χ² of n observations.

    The noise is that which is left after it, as errors that the step explains are in the scales and
    in the common errors of the fit before.
    """
    system = build(network, list(fit.blocks), free, fit.scales, HUBER, 0.0)
    after = network.blocks(network.moved(fit.state, *step(network, system, free)))
    count = sum(len(b.residual) for b in after)
    left = cost_of(after, fit.scales, HUBER)
    return count * float(np.log(cost_of(list(fit.blocks), fit.scales, HUBER) / left))


def _seen_all_round(state: State) -> bool:
    """Whether there are enough pictures of the table, all round."""
    if state.layout is None or len(state.angles) < _FEWEST:
        return False
    around = np.sort(np.mod(state.angles, 2 * np.pi))
    gaps = np.diff(around, append=around[0] + 2 * np.pi)
    return bool(gaps.max() <= _WIDEST)
