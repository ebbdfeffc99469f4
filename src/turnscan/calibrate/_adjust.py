"""Least-squares adjustment of many views that share a few parameters.

Every view has parameters of its own (the pose of a board, the angle of the table) that no other
view sees, so its part of the normal equations is eliminated as soon as it is built (the Schur
complement); what remains is a small dense system in the shared parameters, whose inverse is their
joint covariance. Levenberg-Marquardt damping, Huber weights after a linear start, and one scale per
kind of observation estimated from its own redundancy (variance components), so that corners,
stripes and markers are weighted by what they are worth. ALGORITHMS: Triggs et al., Bundle
adjustment — a modern synthesis (2000); Förstner & Wrobel, Photogrammetric computer vision (2016),
§4.2 and §4.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import Degenerate, DidNotConverge

_HUBER = 2.5
_ROUNDS = 60
_SCALE_ROUNDS = 4
_SETTLED = 1e-8  # relative change of the cost
_SINGULAR = 1e-12
_LEAST_SCALE = 1e-6  # px


@dataclass(frozen=True)
class Block:
    """What one view adds: residuals of one kind and their derivatives."""

    view: int
    """Which view's own parameters `own` refers to; -1 for none."""
    kind: str
    """Observations of one kind share one scale; kinds that begin with "prior" keep scale 1."""
    residual: Floats
    """(m,) observed minus predicted, px."""
    common: Floats
    """(m, p) derivative of the prediction by the shared parameters."""
    own: Floats
    """(m, q) derivative of the prediction by the view's own parameters."""


State = TypeVar("State")


class Network(Protocol[State]):
    """What can be adjusted: observations that depend on a state."""

    def blocks(self, state: State) -> list[Block]:
        """Residuals and derivatives at ``state``, always in the same order."""
        ...

    def moved(self, state: State, common: Floats, own: Sequence[Floats]) -> State:
        """``state`` after a small step of the shared and of every view's own parameters."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p shared parameters."""
        ...

    @property
    def own_sizes(self) -> tuple[int, ...]:
        """Number of own parameters of every view."""
        ...


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


@dataclass(frozen=True)
class _System:
    """Normal equations with the views' own parameters eliminated."""

    reduced: Floats
    right: Floats
    inverses: list[Floats]
    own_right: list[Floats]
    cross: list[Floats]
    cost: float


def adjust(
    network: Network[State],
    state: State,
    free: Bools,
    *,
    robust: bool = True,
    near: Fit[State] | None = None,
) -> Fit[State]:
    """Adjust ``state``; shared parameters where ``free`` (p,) is False keep their value.

    ``near`` is a fit of nearly the same problem: its scales are taken to start with.

    Raises Degenerate, naming the parameters, when the views leave a direction undetermined, and
    DidNotConverge when the steps do not settle.
    """
    blocks = network.blocks(state)
    scales = dict.fromkeys((b.kind for b in blocks), 1.0)
    if near is None:
        state, blocks = _minimise(network, state, free, scales, huber=None)
    else:
        scales |= {k: v for k, v in near.scales.items() if k in scales}
    for _ in range(_SCALE_ROUNDS):
        before = dict(scales)
        system = _build(network, blocks, free, scales, _HUBER if robust else None, 0.0)
        scales, _ = _scales(network, blocks, system, free, scales, robust)
        state, blocks = _minimise(network, state, free, scales, _HUBER if robust else None)
        if all(abs(scales[k] / before[k] - 1) < 0.02 for k in scales):
            break
    return _finish(network, state, blocks, free, scales, robust)


def _weight(block: Block, scales: dict[str, float], huber: float | None) -> Floats:
    scale = scales[block.kind]
    if huber is None or block.kind.startswith("prior"):
        return np.full(block.residual.shape, 1 / scale**2)
    off = np.abs(block.residual) / (huber * scale)
    weight: Floats = 1 / (scale**2 * np.maximum(off, 1.0))
    return weight


def _cost(blocks: list[Block], scales: dict[str, float], huber: float | None) -> float:
    total = 0.0
    for b in blocks:
        off = np.abs(b.residual) / scales[b.kind]
        if huber is not None and not b.kind.startswith("prior"):
            far = np.maximum(off, huber)
            off = np.where(off > huber, np.sqrt(2 * huber * far - huber**2), off)
        total += float(off @ off)
    return total


def _build(
    network: Network[State],
    blocks: list[Block],
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
    damping: float,
) -> _System:
    p = int(np.count_nonzero(free))
    sizes = network.own_sizes
    H = np.zeros((p, p))
    g = np.zeros(p)
    own_H = [np.zeros((q, q)) for q in sizes]
    own_g = [np.zeros(q) for q in sizes]
    cross = [np.zeros((q, p)) for q in sizes]
    for b in blocks:
        w = _weight(b, scales, huber)
        A = b.common[:, free]
        Aw = A * w[:, None]
        H += Aw.T @ A
        g += Aw.T @ b.residual
        if b.view >= 0 and sizes[b.view]:
            Bw = b.own * w[:, None]
            own_H[b.view] += Bw.T @ b.own
            own_g[b.view] += Bw.T @ b.residual
            cross[b.view] += Bw.T @ A
    H[np.diag_indices(p)] *= 1 + damping
    inverses = []
    for i, N in enumerate(own_H):
        N[np.diag_indices(len(N))] *= 1 + damping
        inverse = _inverse(N, lambda k, i=i: f"own parameter {k} of view {i}")
        inverses.append(inverse)
        H -= cross[i].T @ inverse @ cross[i]
        g -= cross[i].T @ inverse @ own_g[i]
    return _System(H, g, inverses, own_g, cross, _cost(blocks, scales, huber))


def _inverse(N: Floats, name: object) -> Floats:
    """Inverse of a symmetric positive matrix, scaled to a unit diagonal first."""
    if not len(N):
        return N
    d = np.sqrt(np.maximum(np.diag(N), 0.0))
    flat = np.flatnonzero(d <= 0)
    if len(flat):
        raise Degenerate(f"nothing observed depends on {_call(name, int(flat[0]))}")
    values, vectors = np.linalg.eigh(N / np.outer(d, d))
    if values[0] < _SINGULAR:
        worst = np.argsort(-np.abs(vectors[:, 0]))[:3]
        names = ", ".join(_call(name, int(k)) for k in worst)
        raise Degenerate(
            f"the views cannot tell these apart: {names}",
            hint="add views that differ more in tilt, distance and place",
        )
    scaled: Floats = (vectors / values) @ vectors.T / np.outer(d, d)
    return scaled


def _call(name: object, index: int) -> str:
    return str(name(index)) if callable(name) else str(name)


def _free_name(network: Network[State], free: Bools) -> object:
    names = [n for n, f in zip(network.names, free, strict=True) if f]
    return lambda k: names[k]


def _step(network: Network[State], system: _System, free: Bools) -> tuple[Floats, list[Floats]]:
    common = np.zeros(len(free))
    moved = _inverse(system.reduced, _free_name(network, free)) @ system.right
    common[free] = moved
    own = [
        inv @ (g - c @ moved)
        for inv, g, c in zip(system.inverses, system.own_right, system.cross, strict=True)
    ]
    return common, own


def _minimise(
    network: Network[State],
    state: State,
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
) -> tuple[State, list[Block]]:
    damping = 1e-4
    blocks = network.blocks(state)
    for _ in range(_ROUNDS):
        system = _build(network, blocks, free, scales, huber, damping)
        common, own = _step(network, system, free)
        tried = network.moved(state, common, own)
        try_blocks = network.blocks(tried)
        cost = _cost(try_blocks, scales, huber)
        if np.isfinite(cost) and cost <= system.cost * (1 + 1e-12):
            gain = system.cost - cost
            state, blocks = tried, try_blocks
            damping = max(damping * 0.1, 1e-12)
            if gain <= _SETTLED * system.cost + 1e-18:
                return state, blocks
        else:
            damping *= 30
            if damping > 1e10:
                # No step in any direction gains: this is the minimum to rounding.
                return state, blocks
    raise DidNotConverge(
        f"the adjustment did not settle in {_ROUNDS} rounds",
        hint="look at the worst views in the report and leave them out",
    )


def _shares(
    network: Network[State],
    blocks: list[Block],
    system: _System,
    free: Bools,
    scales: dict[str, float],
    robust: bool,
) -> tuple[Floats, list[float]]:
    """Inverse of the reduced system, and how many parameters every block pays for."""
    C = _inverse(system.reduced, _free_name(network, free))
    paid = []
    for b in blocks:
        w = _weight(b, scales, _HUBER if robust else None)
        A = b.common[:, free]
        if b.view >= 0 and network.own_sizes[b.view]:
            inv = system.inverses[b.view]
            A = A - b.own @ (inv @ system.cross[b.view])
            own = np.einsum("mi,ij,mj->m", b.own, inv, b.own)
        else:
            own = np.zeros(len(w))
        paid.append(float(w @ (np.einsum("mi,ij,mj->m", A, C, A) + own)))
    return C, paid


def _scales(
    network: Network[State],
    blocks: list[Block],
    system: _System,
    free: Bools,
    scales: dict[str, float],
    robust: bool,
) -> tuple[dict[str, float], dict[str, float]]:
    """Scale of every kind from its own weighted residuals and redundancy."""
    _, paid = _shares(network, blocks, system, free, scales, robust)
    out, dof = dict(scales), {}
    for kind in scales:
        squares = count = 0.0
        for b, k in zip(blocks, paid, strict=True):
            if b.kind == kind:
                w = _weight(b, scales, _HUBER if robust else None)
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
    robust: bool,
) -> Fit[State]:
    huber = _HUBER if robust else None
    system = _build(network, blocks, free, scales, huber, 0.0)
    C, _ = _shares(network, blocks, system, free, scales, robust)
    _, dof = _scales(network, blocks, system, free, scales, robust)
    squares = sum(float(_weight(b, scales, huber) @ b.residual**2) for b in blocks)
    variance = squares / max(sum(dof.values()), 1.0)
    factor = _view_factor(network, blocks, system, C, free, scales, huber)
    widen = variance * factor**2
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = C * widen
    own, noise = [], []
    for inv, c in zip(system.inverses, system.cross, strict=True):
        lever = inv @ c
        own.append((inv + lever @ C @ lever.T) * widen)
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


def _view_factor(
    network: Network[State],
    blocks: list[Block],
    system: _System,
    C: Floats,
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
) -> float:
    """How much more the views' pulls on the shared parameters scatter than noise would make them.

    Residuals within one view have causes in common (a bent board, blur, a stripe with structure),
    and then 300 stripe pixels are not 300 measurements. The scatter of the sum of each view's pull
    (the "sandwich" estimate of Liang & Zeger, 1986), relative to what independent residuals give,
    shows it; the median over the parameters is taken, and never less than 1.
    """
    p = len(C)
    pulls: dict[int, Floats] = {}
    for b in blocks:
        if b.kind.startswith("prior") or b.view < 0:
            continue
        w = _weight(b, scales, huber)
        A = b.common[:, free]
        if network.own_sizes[b.view]:
            A = A - b.own @ (system.inverses[b.view] @ system.cross[b.view])
        pulls[b.view] = pulls.get(b.view, np.zeros(p)) + A.T @ (w * b.residual)
    n = len(pulls)
    if n < p + 5:
        return 1.0
    G = np.array(list(pulls.values()))
    meat = np.diag(C @ (G.T @ G) @ C) * n / (n - p)
    ratio = float(np.sqrt(np.median(meat / np.diag(C))))
    return max(ratio, 1.0)
