"""Normal equations of many views that share a few parameters.

Every view has parameters of its own (the pose of a board, the angle of the table) that no other
view sees, so its part of the normal equations is eliminated as soon as it is built (the Schur
complement); what remains is a small dense system in the shared parameters. Triggs et al., Bundle
adjustment — a modern synthesis (2000).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.calibrate._words import parameter_in_words
from turnscan.errors import Degenerate

_SINGULAR = 1e-12

State = TypeVar("State")


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
    """(m, q) derivative of the prediction by the view's own parameters; (m, 0) where it has none
    or these do not matter here."""
    views: Ints | None = None
    """(m,) which view each row is of, where they are of several without parameters of their own;
    `view` is -1 then."""


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

    def own_words(self, view: int) -> str:
        """What a view's own parameters are, and of which picture, in words."""
        ...


@dataclass(frozen=True)
class System:
    """Normal equations with the views' own parameters eliminated."""

    reduced: Floats
    right: Floats
    inverses: list[Floats]
    own_right: list[Floats]
    cross: list[Floats]
    cost: float


def weight(block: Block, scales: dict[str, float], huber: float | None) -> Floats:
    """(m,) weight of every residual of a block; ``huber`` scales bound the pull of one."""
    scale = scales[block.kind]
    if huber is None or block.kind.startswith("prior"):
        return np.full(block.residual.shape, 1 / scale**2)
    off = np.abs(block.residual) / (huber * scale)
    weight: Floats = 1 / (scale**2 * np.maximum(off, 1.0))
    return weight


def cost_of(blocks: list[Block], scales: dict[str, float], huber: float | None) -> float:
    """Sum of the squared residuals in scales, linear beyond ``huber``."""
    total = 0.0
    for kind, some in _by_kind(blocks).items():
        off = np.abs(np.concatenate([b.residual for b in some])) / scales[kind]
        if huber is not None and not kind.startswith("prior"):
            far = np.maximum(off, huber)
            off = np.where(off > huber, np.sqrt(2 * huber * far - huber**2), off)
        total += float(off @ off)
    return total


def _by_kind(blocks: list[Block]) -> dict[str, list[Block]]:
    out: dict[str, list[Block]] = {}
    for b in blocks:
        out.setdefault(b.kind, []).append(b)
    return out


def build(
    network: Network[State],
    blocks: list[Block],
    free: Bools,
    scales: dict[str, float],
    huber: float | None,
    damping: float,
) -> System:
    """The equations at the blocks' state; ``damping`` raises their diagonals by that part."""
    p = int(np.count_nonzero(free))
    sizes = network.own_sizes
    H = np.zeros((p, p))
    g = np.zeros(p)
    own_H = [np.zeros((q, q)) for q in sizes]
    own_g = [np.zeros(q) for q in sizes]
    cross = [np.zeros((q, p)) for q in sizes]
    # All blocks of a kind at once: each is small, and there are hundreds.
    for some in _by_kind(blocks).values():
        whole = some[0] if len(some) == 1 else _joined(some)
        w = weight(whole, scales, huber)
        A = whole.common.compress(free, axis=1)
        Aw = A * w[:, None]
        H += Aw.T @ A
        g += Aw.T @ whole.residual
        at = 0
        for b in some:
            rows = slice(at, at + len(b.residual))
            at = rows.stop
            if b.own.shape[1]:
                Bw = b.own.T * w[rows]
                own_H[b.view] += Bw @ b.own
                own_g[b.view] += Bw @ b.residual
                cross[b.view] += b.own.T @ Aw[rows]
    H[np.diag_indices(p)] *= 1 + damping
    inverses = _inverses(own_H, damping, network.own_words)
    for inverse, c, own in zip(inverses, cross, own_g, strict=True):
        if len(own):
            lever = inverse @ c
            H -= c.T @ lever
            g -= own @ lever
    return System(H, g, inverses, own_g, cross, cost_of(blocks, scales, huber))


def _joined(some: list[Block]) -> Block:
    """Blocks of one kind as one, of no view."""
    return Block(
        -1,
        some[0].kind,
        np.concatenate([b.residual for b in some]),
        np.concatenate([b.common for b in some]),
        np.zeros((0, 0)),
    )


def _inverses(own: list[Floats], damping: float, words: Callable[[int], str]) -> list[Floats]:
    """Inverse of every view's own matrix; those of one size at once, as each is small. ``words``
    say what the parameters of a view are."""
    out = list(own)
    for size in sorted({len(N) for N in own} - {0}):
        which = [i for i, N in enumerate(own) if len(N) == size]
        stack = np.stack([own[i] for i in which])
        stack[:, np.arange(size), np.arange(size)] *= 1 + damping

        def name(n: int, k: int, which: list[int] = which) -> str:
            return words(which[n])

        for i, inverse in zip(which, _inverted(stack, name), strict=True):
            out[i] = inverse
    return out


def inverse_of(N: Floats, name: Callable[[int], str]) -> Floats:
    """Inverse of a symmetric positive matrix, scaled to a unit diagonal first."""
    if not len(N):
        return N
    inverse: Floats = _inverted(N[None], lambda _, k: name(k))[0]
    return inverse


def _inverted(stack: Floats, name: Callable[[int, int], str]) -> Floats:
    """Inverses of (n, q, q); Degenerate by the name of matrix and parameter where there is none."""
    d = np.sqrt(np.maximum(np.diagonal(stack, axis1=1, axis2=2), 0.0))
    flat = np.argwhere(d <= 0)
    if len(flat):
        raise Degenerate(
            f"nothing observed depends on this: {name(*(int(x) for x in flat[0]))}",
            hint="add pictures that show it, or leave out the one that does not",
        )
    size = d[:, :, None] * d[:, None, :]
    values, vectors = np.linalg.eigh(stack / size)
    n = int(values[:, 0].argmin())
    if values[n, 0] < _SINGULAR:
        worst = np.argsort(-np.abs(vectors[n, :, 0]))[:3]
        names = "; ".join(dict.fromkeys(name(n, int(k)) for k in worst))
        raise Degenerate(
            f"the views cannot separate these: {names}",
            hint="add views that differ more in tilt, distance and position",
        )
    inverses: Floats = (vectors / values[:, None, :]) @ np.swapaxes(vectors, 1, 2) / size
    return inverses


def free_name(network: Network[State], free: Bools) -> Callable[[int], str]:
    """Gives a free parameter in words by its place among these."""
    names = [n for n, f in zip(network.names, free, strict=True) if f]
    return lambda k: parameter_in_words(names[k])


def step(network: Network[State], system: System, free: Bools) -> tuple[Floats, list[Floats]]:
    """The step of the shared parameters, 0 where not free, and of every view's own."""
    common = np.zeros(len(free))
    moved = inverse_of(system.reduced, free_name(network, free)) @ system.right
    common[free] = moved
    own = [
        inv @ (g - c @ moved)
        for inv, g, c in zip(system.inverses, system.own_right, system.cross, strict=True)
    ]
    return common, own
