"""Least-squares adjustment of many views that share a few parameters.

Levenberg-Marquardt steps on the normal equations (`_normal`), Huber weights after a linear start,
and one scale per kind of observation estimated from its own redundancy (variance components), so
that corners, stripes and markers are weighted by what they are worth. The inverse of the reduced
equations is the joint covariance of the shared parameters. Triggs et al., Bundle adjustment — a
modern synthesis (2000); Förstner & Wrobel, Photogrammetric computer vision (2016), §4.2 and §4.7.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._normal import (
    Block,
    Network,
    State,
    System,
    build,
    cost_of,
    free_name,
    inverse_of,
    step,
    weight,
)
from turnscan.errors import DidNotConverge

HUBER = 2.5
_ROUNDS = 60
_SCALE_ROUNDS = 4
_SETTLED, _CLOSE, _ROUGH = 1e-8, 1e-5, 1e-3
"""Relative change of the cost: at the end, while the scales still change, and to begin with."""
_LEAST_SCALE = 1e-6  # px
_LEAST_FREEDOM = 1.0  # redundant parameters of the views, below which their scatter says nothing
_LEAST_SHARE = 0.05  # of a parameter's variance: less left of it in the pulls says nothing of it


@dataclass(frozen=True)
class Fit(Generic[State]):
    """The adjusted state and how well it is known."""

    state: State
    blocks: tuple[Block, ...]
    """At the solution."""
    covariance: Floats
    """(p, p) of the shared parameters; zero rows and columns where they were held fixed."""
    own_covariance: tuple[Floats, ...]
    """(q, q) of every view's own parameters."""
    own_noise: tuple[Floats, ...]
    """(q, q) of the same from the noise of that view alone, as if the shared ones were known."""
    scales: dict[str, float]
    """Standard deviation of one observation of every kind, px."""
    degrees_of_freedom: dict[str, float]
    """Redundancy of every kind."""
    chi2: float
    """Weighted sum of squares, which the scales bring near to the redundancy."""
    view_factor: float
    """By how much errors common to a view widen the uncertainty (1: none); it is contained in the
    covariances."""

    def rms(self, kind: str, view: int | None = None) -> float:
        """Root mean square of the residuals of a kind (and of one view), px; NaN if none."""
        parts = [
            b.residual
            for b in self.blocks
            if b.kind == kind and (view is None or b.view == view) and b.residual.size
        ]
        if not parts:
            return float("nan")
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def adjust(
    network: Network[State],
    state: State,
    free: Bools,
    *,
    robust: bool = True,
    near: Fit[State] | None = None,
    told: bool = False,
) -> Fit[State]:
    """Adjust ``state``; shared parameters where ``free`` (p,) is False keep their value.

    ``near`` is a fit of nearly the same problem: its scales are taken to start with. ``told``: the
    noise is as large as the network says, and a state to begin with is all that is wanted.

    Raises Degenerate, naming the parameters, when the views leave a direction undetermined, and
    DidNotConverge when the steps do not settle.
    """
    blocks = network.blocks(state)
    scales = dict.fromkeys((b.kind for b in blocks), 1.0)
    huber = HUBER if robust else None
    if near is None:
        state, blocks = _minimise(network, (state, blocks), free, scales, None, _ROUGH)
    else:
        scales |= {k: v for k, v in near.scales.items() if k in scales}
        state, blocks = _minimise(network, (state, blocks), free, scales, huber, _CLOSE)
    for turn in range(0 if told else _SCALE_ROUNDS):
        before = dict(scales)
        system = build(network, blocks, free, scales, huber, 0.0)
        _, paid = _shares(network, blocks, system, free, scales, huber)
        scales, _ = _scales(blocks, paid, scales, huber)
        settled = all(abs(scales[k] / before[k] - 1) < 0.02 for k in scales)
        until = _SETTLED if settled or turn == _SCALE_ROUNDS - 1 else _CLOSE
        state, blocks = _minimise(network, (state, blocks), free, scales, huber, until)
        if settled:
            break
    return _finish(network, state, blocks, free, scales, huber)


def _minimise(
    network: Network[State],
    begin: tuple[State, list[Block]],
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
    until: float,
) -> tuple[State, list[Block]]:
    """The state of least cost, once a step gains no more than so much of it; `_ROUGH`: one near
    it, as it is only to begin with. Each state comes with its blocks."""
    damping = 1e-4
    state, blocks = begin
    for _ in range(_ROUNDS):
        system = build(network, blocks, free, scales, huber, damping)
        common, own = step(network, system, free)
        tried = network.moved(state, common, own)
        try_blocks = network.blocks(tried)
        cost = cost_of(try_blocks, scales, huber)
        if np.isfinite(cost) and cost <= system.cost * (1 + 1e-12):
            gain = system.cost - cost
            state, blocks = tried, try_blocks
            damping = max(damping * 0.1, 1e-12)
            if gain <= until * system.cost + 1e-18:
                return state, blocks
        else:
            damping *= 30
            if damping > 1e10:
                # No step in any direction gains: this is the minimum to rounding.
                return state, blocks
    if until == _ROUGH:
        return state, blocks
    raise DidNotConverge(
        f"the bundle adjustment did not converge in {_ROUNDS} rounds",
        hint="check the worst views in the report and leave them out",
    )


def one_step(network: Network[State], fit: Fit[State], free: Bools) -> tuple[Floats, Floats]:
    """How far the shared parameters would move from a fit, were those ``free`` that were held in
    it, and their standard uncertainties, (p,) each: by one linear step, without another fit."""
    system = build(network, list(fit.blocks), free, fit.scales, HUBER, 0.0)
    moved, _ = step(network, system, free)
    sigma = np.zeros(len(free))
    C = inverse_of(system.reduced, free_name(network, free))
    sigma[free] = fit.view_factor * np.sqrt(np.diag(C))
    return moved, sigma


def shared_columns(network: Network[State], block: Block, system: System, free: Bools) -> Floats:
    """Derivative of a block by the free shared parameters, its view's own following them."""
    A: Floats = block.common.compress(free, axis=1)
    if not block.own.shape[1]:
        return A
    return A - block.own @ (system.inverses[block.view] @ system.cross[block.view])


def _shares(
    network: Network[State],
    blocks: list[Block],
    system: System,
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
) -> tuple[Floats, list[float]]:
    """Inverse of the reduced system, and how many parameters every block pays for."""
    C = inverse_of(system.reduced, free_name(network, free))
    paid = []
    for b in blocks:
        w = weight(b, scales, huber)
        A = shared_columns(network, b, system, free)
        if b.own.shape[1]:
            inv = system.inverses[b.view]
            own = ((b.own @ inv) * b.own).sum(axis=1)
        else:
            own = np.zeros(len(w))
        paid.append(float(w @ (((A @ C) * A).sum(axis=1) + own)))
    return C, paid


def _scales(
    blocks: list[Block], paid: list[float], scales: dict[str, float], huber: float | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Scale and redundancy of every kind from its own weighted residuals, where every block
    ``paid`` for so many parameters."""
    out, dof = dict(scales), {}
    for kind in scales:
        squares = count = 0.0
        for b, k in zip(blocks, paid, strict=True):
            if b.kind == kind:
                w = weight(b, scales, huber)
                squares += float(w @ b.residual**2)
                count += float(w.sum()) * scales[kind] ** 2 - k
        dof[kind] = count
        if not kind.startswith("prior") and count > 1:
            out[kind] = max(scales[kind] * float(np.sqrt(squares / count)), _LEAST_SCALE)
    return out, dof


def _finish(
    network: Network[State],
    state: State,
    blocks: list[Block],
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
) -> Fit[State]:
    system = build(network, blocks, free, scales, huber, 0.0)
    C, paid = _shares(network, blocks, system, free, scales, huber)
    _, dof = _scales(blocks, paid, scales, huber)
    squares = sum(float(weight(b, scales, huber) @ b.residual**2) for b in blocks)
    variance = squares / max(sum(dof.values()), 1.0)
    factor = _view_factor(network, blocks, system, C, free, scales, huber)
    widen = variance * factor**2
    covariance = np.zeros((len(free), len(free)))
    C = _widened(network, blocks, system, C, free, widen)
    covariance[np.ix_(free, free)] = C
    own, noise = [], []
    for inv, c in zip(system.inverses, system.cross, strict=True):
        lever = inv @ c
        own.append(inv * widen + lever @ C @ lever.T)
        noise.append(inv * variance)
    return Fit(
        state,
        tuple(blocks),
        covariance,
        tuple(own),
        tuple(noise),
        scales,
        dof,
        squares,
        float(factor),
    )


def _widened(
    network: Network[State],
    blocks: list[Block],
    system: System,
    C: Floats,
    free: Bools,
    widen: float,
) -> Floats:
    """Covariance of the shared parameters; what was known before is as good as it was said to be,
    and only what the views say is widened."""
    known = [b.common[:, free] for b in blocks if b.kind.startswith("prior")]
    if not known:
        wider: Floats = C * widen
        return wider
    before = sum((A.T @ A for A in known), np.zeros_like(C))
    return inverse_of((system.reduced - before) / widen + before, free_name(network, free))


def _rows_by_view(block: Block) -> Iterator[tuple[int, npt.NDArray[np.intp] | slice]]:
    """Each view that a block is of, and its rows."""
    if block.views is None:
        yield block.view, slice(None)
        return
    order = np.argsort(block.views, kind="stable")
    cuts = np.flatnonzero(np.diff(block.views[order])) + 1
    for rows in np.split(order, cuts):
        if len(rows):
            yield int(block.views[rows[0]]), rows


def _view_factor(
    network: Network[State],
    blocks: list[Block],
    system: System,
    C: Floats,
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
) -> float:
    """How much more the views' pulls on the shared parameters scatter than noise would make them.

    Residuals within one view have causes in common (a bent board, blur, a stripe with structure),
    and then 300 stripe pixels are not 300 measurements. The scatter of the sum g of each view's
    pull (the "sandwich" estimate C Σ g gᵀ C of Liang & Zeger, 1986) shows it, relative to what
    independent residuals give: where H is a view's own part of the equations, its pull has the
    covariance H − H C H (the leverages of Bell & McCaffrey, 2002). The median over the parameters
    is taken, and never less than 1.

    Few views, or parameters that were known before, leave single parameters without redundancy.
    Then the sum of gᵀ C g is compared with its expectation, all parameters together.
    """
    p = len(C)
    pulls: dict[int, Floats] = {}
    parts: dict[int, Floats] = {}
    prior = False
    for b in blocks:
        if b.kind.startswith("prior") or (b.view < 0 and b.views is None):
            prior = True
            continue
        w = weight(b, scales, huber)
        A = shared_columns(network, b, system, free)
        for view, rows in _rows_by_view(b):
            mine = A[rows].T * w[rows]
            pulls[view] = pulls.get(view, np.zeros(p)) + mine @ b.residual[rows]
            parts[view] = parts.get(view, np.zeros((p, p))) + mine @ A[rows]
    G = np.array(list(pulls.values()))
    levers = [C @ H for H in parts.values()]
    if prior or len(pulls) < p + 5:
        expected = sum(float(np.trace(L) - (L * L.T).sum()) for L in levers)
        if expected < _LEAST_FREEDOM:
            return 1.0
        found = float(np.einsum("ij,jk,ik->", G, C, G))
        return max(float(np.sqrt(found / expected)), 1.0)
    meat = np.diag(C @ (G.T @ G) @ C)
    independent = np.diag(sum((L @ C - L @ L @ C for L in levers), np.zeros((p, p))))
    told = independent > _LEAST_SHARE * np.diag(C)
    if not told.any():
        return 1.0
    return max(float(np.sqrt(np.median(meat[told] / independent[told]))), 1.0)
