"""Widths of a scatter of residuals, and how well they are known; independent of the geometry."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs

DISCARD = 0.003
"""Share of the points that may be left out of a range, as VDI/VDE 2634-2 allows."""
SHELL = 0.95
"""Share of the points in the thinnest shell."""
_TAIL = 20
"""Points of a tail by which its steepness is judged, at least."""

NEAR_LINES = 8
"""Lines over which the same error may lie, less so the farther apart: JPEG has blocks of 8."""

_ROUNDS = 3
"""Of finding the noise, and what of the residuals is more than that."""

_BY_CHANCE = 1.645
"""Standard deviations that a normal value exceeds in one case of twenty."""

_FAR, _NODES = 9.0, 1801
"""Standard deviations beyond which nothing lies, and nodes of an integral up to there."""


def kept(residual: Floats) -> np.ndarray:
    """(n,) True for the points that count: all but the 0.3 % furthest off, rounded down."""
    n = len(residual)
    out = np.ones(n, dtype=np.bool_)
    drop = int(DISCARD * n)
    if drop:
        out[np.argpartition(np.abs(residual), n - drop)[n - drop :]] = False
    return out


def trimmed_range(residual: Floats) -> float:
    """mm: largest minus smallest of residuals (n,) mm, without the 0.3 % furthest off."""
    return float(np.ptp(residual[kept(residual)]))


def range_sigma(residual: Floats) -> float:
    """mm: standard uncertainty of `trimmed_range` of residuals (n,) mm, from their own tails.

    The tails are taken as exponential with the mean excess β of the outermost points. By Rényi's
    representation of order statistics the j-th largest of a tail then scatters with variance
    β² ψ₁(j); both ends lie behind half of the discarded points each. (A. Rényi, Acta Math. Acad.
    Sci. Hung. 4 (1953) 191.)
    """
    from scipy.special import polygamma

    away = np.sort(np.abs(residual))[::-1]
    drop = int(DISCARD * len(away))
    m = min(max(2 * drop, _TAIL), len(away) - 1)
    steep = float(np.mean(away[:m] - away[m]))
    return steep * float(np.sqrt(2.0 * polygamma(1, drop / 2 + 1)))


def shell(residual: Floats, share: float = SHELL) -> float:
    """mm: width of the thinnest interval that holds ``share`` of the residuals (n,) mm."""
    r = np.sort(residual)
    count = min(max(int(np.ceil(share * len(r))), 2), len(r))
    return float((r[count - 1 :] - r[: len(r) - count + 1]).min())


def shell_sigma(residual: Floats) -> float:
    """mm: standard uncertainty of `shell` from the number of points.

    The share within a fixed shell is binomial; how the width grows with the share is measured
    between 93 and 97 %.
    """
    slope = (shell(residual, SHELL + 0.02) - shell(residual, SHELL - 0.02)) / 0.04
    return float(np.sqrt(SHELL * (1 - SHELL) / len(residual))) * slope


def clumping(residual: Floats, cell: np.ndarray, free: int, taken: float = 0.0) -> float:
    """How many times more the means of cells scatter than independent points would make them.

    ``cell`` (n,) numbers the place of each residual; ``free`` is the number of fitted parameters,
    ``taken`` what else was fitted to them (`own_residual`). At least 1. Speckle, stripe errors that
    neighbours share and form errors all make it larger, and with it the variance of whatever is
    fitted.
    """
    count = np.bincount(cell)
    used = count >= 5
    if used.sum() < free + 5:
        return 1.0
    mean = np.bincount(cell, residual)[used] / count[used]
    spread = float(np.mean(residual**2))
    if spread <= 0:
        return 1.0
    left = max(int(used.sum()) - free - taken, 1.0)
    return max(1.0, float((count[used] * mean**2).sum()) / (spread * left))


def own_residual(
    residual: Floats, bends: Floats, cell: np.ndarray, free: int
) -> tuple[Floats, float]:
    """(n,) mm: residuals without what the calibration has bent; and their `clumping`.

    ``bends`` (m, n) mm is what one standard deviation of each of m independent directions of the
    calibration does to the residuals of a fit with ``free`` parameters. What a wrong rig bends
    lies in the residuals of neighbours and of lines alike, and is counted by what the calibration
    does not know already; counted as the points' own scatter, too, it would be counted twice. The
    amplitude of each direction is what the residuals make most likely, which before them is a
    normal value about 0 of standard deviation 1 (ridge regression, A. E. Hoerl and R. W. Kennard,
    1970), so that less is taken off than the calibration leaves open.
    """
    own, shared, taken = residual, clumping(residual, cell, free), 0.0
    if not bends.size or not residual.any():
        return own, shared
    shared, product, pull = 1.0, bends @ bends.T, bends @ residual
    for _ in range(_ROUNDS):
        noise = shared * float(own @ own) / max(len(own) - free - taken, 1.0)
        doubt = np.linalg.inv(np.eye(len(bends)) + product / noise)
        own = residual - (doubt @ pull / noise) @ bends
        taken = len(bends) - float(np.trace(doubt))
        shared = clumping(own, cell, free, taken)
    return own, shared


def line_covariance(J: Floats, residual: Floats, lines: Longs) -> Floats | None:
    """(p, p): covariance of fitted parameters, where the residuals of a line of the picture, and of
    lines near it, are the same in all profiles; None where no more is seen of that than chance
    makes in 19 of 20 fits whose points share nothing.

    ``J`` (n, p) is the slope of each residual (n,) by the parameters. What the pixels of a line,
    its rounding, compression or filter do to the stripe of a round part on the axis is repeated at
    each step and does not average out over them. So the moves of each line are added up with their
    signs over all profiles, and with those of lines up to `NEAR_LINES` away with a weight that
    falls off (J. C. Driscoll and A. C. Kraay, Consistent covariance matrix estimation with
    spatially dependent panel data, 1998, with the lines for the periods of time). The fit takes
    some of what so many pieces of lines do into its parameters, and the residuals lack it. Such a
    sum over a few pieces is large by chance, too, and the larger for what it is given back.
    """
    seen, place = np.unique(lines, return_inverse=True)
    back = np.asarray(np.linalg.pinv(J), dtype=np.float64)
    sums = [np.bincount(place, b * residual, len(seen)) for b in back]
    moves = np.array(sums, dtype=np.float64)
    near = np.maximum(1.0 - np.abs(seen[:, None] - seen) / NEAR_LINES, 0.0)
    total: Floats = moves @ near @ moves.T
    if not _repeats(total, _by_line(J, back, residual, place), near):
        return None
    pieces = len(seen) / NEAR_LINES
    share: Floats = total * (pieces / max(pieces - len(back), 1.0))
    return share


def _by_line(J: Floats, back: Floats, residual: Floats, place: Longs) -> tuple[Floats, Floats]:
    """(m, p, p) each, of m lines: the covariance that a line's points (n,) give parameters if they
    share nothing, and its part of the fit, ``back`` times ``J``."""

    def added(left: Floats, right: Floats) -> Floats:
        pairs = (left[:, None] * right).reshape(-1, len(place))
        each = np.array([np.bincount(place, pair) for pair in pairs])
        return np.ascontiguousarray(each.T).reshape(-1, len(left), len(right))

    share = len(J) / (len(J) - J.shape[1])
    return added(back, share * residual**2 * back), added(back, J.T)


def _repeats(total: Floats, by_line: tuple[Floats, Floats], near: Floats) -> bool:
    """Whether moves (p, p) of lines, added up with the weights ``near`` (m, m), are more than
    points make that share nothing: by expectation and standard deviation of their trace.

    Of residuals r = (I − J B) ε with independent ε, the moves of lines i and j have the covariance
    δᵢⱼ Sᵢ − Sᵢ Aⱼᵀ − Aᵢ Sⱼ + Aᵢ S Aⱼᵀ, Sᵢ and Aᵢ as `_by_line` gives them, S the sum of Sᵢ. For
    the standard deviation what the fit takes is left out.
    """
    alone, fit = by_line
    whole = alone.sum(axis=0)
    values, ways = np.linalg.eigh(whole)
    if not values[0] > 0:
        return False
    unit = (ways / np.sqrt(values)).T  # parameters of unit variance that go together in nothing
    around = np.einsum("ij,jab->iab", near, fit)
    taken = np.einsum("iab,icb->ac", alone, around)
    free = whole - taken - taken.T + np.einsum("iab,bc,idc->ad", fit, whole, around)
    S = unit @ alone @ unit.T
    spread = np.sqrt(2.0 * np.sum(near**2 * np.einsum("iab,jab->ij", S, S)))
    seen, chance = (float(np.trace(unit @ C @ unit.T)) for C in (total, free))
    return seen > chance + _BY_CHANCE * float(spread)


def with_lines(by_cells: Floats, alone: Floats, by_lines: Floats) -> Floats:
    """(p, p): covariance of parameters by what neighbours on the part share, and what lines do.

    ``by_cells`` and ``by_lines`` each hold ``alone``, what points that share nothing would give; it
    counts once. (A. C. Cameron, J. B. Gelbach and D. L. Miller, Robust inference with multiway
    clustering, 2011, without what would make it smaller.)
    """
    values, ways = np.linalg.eigh(by_lines - alone)
    more: Floats = by_cells + (ways * np.maximum(values, 0.0)) @ ways.T
    return more


def noise_range(scatter: Floats) -> tuple[float, float]:
    """mm: expectation and standard deviation of the range of independent normal values about 0.

    ``scatter`` (n,) are their standard deviations. The largest has the distribution ∏ Φ(x/sᵢ),
    which is integrated; the smallest is its mirror image, and independent of it but for few values
    (H. A. David and H. N. Nagaraja, Order Statistics, 2003, section 2.1).
    """
    from scipy.special import log_ndtr

    unit = float(scatter.max(initial=0.0))
    if not unit > 0:
        return 0.0, 0.0
    sizes, times = np.unique(scatter / unit, return_counts=True)
    x = np.linspace(-_FAR, _FAR, _NODES)
    share = np.exp(times @ log_ndtr(x / sizes[:, None]))  # that the largest lies below x
    top = _FAR - float(np.trapezoid(share, x))
    square = _FAR**2 - 2 * float(np.trapezoid(x * share, x))
    return 2 * top * unit, float(np.sqrt(2 * max(square - top**2, 0.0))) * unit
