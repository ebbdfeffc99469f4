"""B-splines through points of a chain, and when they say it better than lines and arcs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats

_MOST_CONTROLS = 120
_CHANCE, _TWO, _KEPT, _LONG = 6.0, 4.0, 4.0, 0.4
"""Prices: what an arc, or a short line, beside a spline has to earn; what two splines have to; what
a spline has to gain over a line that has this share of the points."""
_SHORTEST = 8
"""Points that a spline is fitted to at the least."""


@dataclass(frozen=True, eq=False)
class SplineFit:
    """A spline through points, before its ends are settled."""

    control: Floats
    knots: Floats
    chi2: float


Span = tuple[str, int, int]
"""``line``, ``arc`` or ``spline``; its first and last point."""


def fit_spline(
    p: Floats,
    scale: Floats,
    controls: int,
    ends: tuple[Floats | None, Floats | None] = (None, None),
    tangents: tuple[Floats | None, Floats | None] = (None, None),
) -> SplineFit:
    """The cubic spline with ``controls`` ≥ 4 control points nearest to points (n, 2) mm.

    ``scale`` (n,) mm are their standard deviations (infinite: has no say); ``ends`` and
    ``tangents`` (unit, forwards) hold its ends where given. Each point's place along the spline is
    its arc length, repaired twice to where the spline comes nearest. chi2 is Σ (distance across the
    spline / scale)².
    """
    from turnscan.shapes import _outline_spline_kernels as kernels

    p = np.ascontiguousarray(p)
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    at = np.minimum(np.r_[0.0, np.cumsum(steps)] / max(float(steps.sum()), 1e-300), 1.0)
    # As many points in each stretch between two knots: a stretch without one has no say.
    inner = np.quantile(at, np.linspace(0.0, 1.0, controls - 2))[1:-1]
    knots = np.r_[np.zeros(4), (inner + np.linspace(0, 1, controls - 2)[1:-1]) / 2, np.ones(4)]
    weight = np.where(np.isfinite(scale), 1.0 / scale, 0.0) ** 2
    chi2 = 0.0
    control = np.zeros((controls, 2))
    for _ in range(3):
        cubic = kernels.cubics(at, knots)
        normal, right = kernels.equations(p, weight, cubic[0], cubic[1], controls)
        control = _solve(normal, right, ends, tangents)
        chi2, at = kernels.settled(p, weight, at, cubic, control)
    return SplineFit(control, knots, chi2)


def local_direction(p: Floats, scale: Floats, at: int) -> tuple[Floats, Floats]:
    """(2,) mm and (2,) unit: place and direction of a smooth curve at its point ``at``.

    A cubic through the points (n, 2) about it, which follow each other.
    """
    along = p[-1] - p[0]
    along = along / max(float(np.linalg.norm(along)), 1e-300)
    across = np.array([-along[1], along[0]])
    to = p - p[at]
    size = max(float(np.abs(to @ along).max()), 1e-300)
    t = to @ along / size
    w = np.where(np.isfinite(scale), 1.0 / scale, 0.0)
    powers = np.stack([np.ones_like(t), t, t * t, t**3], axis=1)
    c = np.linalg.lstsq(powers * w[:, None], to @ across * w, rcond=None)[0]
    d = along + c[1] / size * across
    return p[at] + c[0] * across, np.asarray(d / np.linalg.norm(d))


def _solve(
    normal: Floats,
    right: Floats,
    ends: tuple[Floats | None, Floats | None],
    tangents: tuple[Floats | None, Floats | None],
) -> Floats:
    """Control points (k, 2) from normal equations (k, k), (k, 2), the first and last given or on
    tangents."""
    k = len(normal)
    normal = normal + np.eye(k) * (1e-9 * float(np.trace(normal)) / k)
    fixed = np.zeros((k, 2))
    free = np.ones((k, 2), dtype=np.bool_)
    along: list[tuple[int, Floats]] = []
    for place, inner, sign in ((0, 1, 1.0), (k - 1, k - 2, -1.0)):
        end, tangent = ends[place > 0], tangents[place > 0]
        if end is None:
            continue
        fixed[place] = end
        free[place] = False
        if tangent is not None:
            fixed[inner] = end
            free[inner] = False
            along.append((inner, sign * tangent))
    rest = right - normal @ fixed
    if free.all():
        return np.asarray(np.linalg.solve(normal, right))
    count = int(free.sum())
    basis = np.zeros((2 * k, count + len(along)))
    basis[np.flatnonzero(free.ravel()), np.arange(count)] = 1.0
    for column, (j, t) in enumerate(along):
        basis[2 * j : 2 * j + 2, count + column] = t
    if not basis.shape[1]:
        return fixed
    whole = basis.T @ np.kron(normal, np.eye(2)) @ basis
    found = np.linalg.solve(whole, basis.T @ rest.ravel())
    found[count:] = np.maximum(found[count:], 0.0)
    return np.asarray(fixed + (basis @ found).reshape(k, 2))


def best_controls(p: Floats, scale: Floats, price: float) -> tuple[int, float]:
    """The number of control points of the spline of least chi2 + price·number, and that cost."""
    best, least, worse = 4, np.inf, 0
    most = min(_MOST_CONTROLS, max(int(np.isfinite(scale).sum()) // 3, 4))
    n = 4
    while n <= most:
        cost = fit_spline(p, scale, n).chi2 + price * (n + 1)
        if cost < least:
            best, least, worse = n, cost, 0
        else:
            worse += 1
            if worse >= 3:
                break
        n += max(1, n // 10)
    return best, least


def with_splines(
    spans: list[tuple[Span, float]],
    smooth: list[bool],
    points: Callable[[int, int], tuple[Floats, Floats]],
    price: float,
    period: int = 0,
) -> list[tuple[Span, float]]:
    """Replace neighbours by one spline wherever it costs less, the largest gain first.

    ``spans`` come with their costs; ``smooth`` tells for each whether it goes on from the one
    before without a corner; ``points`` gives the points of a stretch and their scale. Of a closed
    chain of ``period`` ways the last span is before the first, and a span may end beyond
    ``period``.
    """
    spans, smooth = list(spans), list(smooth)
    gains: dict[tuple[int, int], float] = {}
    while len(spans) > 1:
        best, where, cost = 0.0, -1, 0.0
        for k in range(0 if period else 1, len(spans)):
            (a, cost_a), (b, cost_b) = spans[k - 1], spans[k]
            if not smooth[k] or a[0] == b[0] == "line":
                continue
            first, last = a[1], b[2] + (period if k == 0 else 0)
            if (first, last) not in gains:
                gains[first, last] = spline_cost(*points(first, last), price)
            gain = cost_a + cost_b - gains[first, last] + _chance(a, b) * price
            if gain > best:
                best, where, cost = gain, k, gains[first, last]
        if where < 0:
            break
        a, b = spans[where - 1][0], spans[where][0]
        last = b[2] + (period if where == 0 else 0)
        spans[where - 1] = (("spline", a[1], last), cost)
        spans.pop(where)
        smooth.pop(where)
        if where == 0:
            smooth[0] = smooth[0] if len(smooth) > 1 else False
    return spans


def spline_cost(p: Floats, scale: Floats, price: float) -> float:
    """What the best spline through points (n, 2) mm costs; infinite where they are too few."""
    if int(np.isfinite(scale).sum()) < _SHORTEST:
        return np.inf
    return best_controls(p, scale, price)[1]


def _chance(a: Span, b: Span) -> float:
    """Prices in favour of a spline: chance makes an arc of any smooth stretch, but no long line."""
    whole = max(b[2] - b[1] + a[2] - a[1], 1)
    lines = [(x[2] - x[1]) / whole for x in (a, b) if x[0] == "line"]
    if any(share > _LONG for share in lines):
        return -_KEPT
    if "spline" not in (a[0], b[0]):
        return 0.0
    if a[0] == b[0]:
        return _TWO
    other = a if b[0] == "spline" else b
    share = (other[2] - other[1]) / whole
    return _CHANCE if other[0] == "arc" or share < 0.35 else 0.0
