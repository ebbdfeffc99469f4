"""Balls in a survey: found by their size, cut free of what holds them, and fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.errors import InputError
from turnscan.shapes._fit import fit_sphere
from turnscan.shapes._forms import Sphere
from turnscan.shapes.verification._statistics import (
    kept,
    line_covariance,
    own_residual,
    with_lines,
)
from turnscan.shapes.verification._survey import Index, Survey

_SEEDS = 160
"""Places from which the search for a ball begins."""
_LOOK = 20_000
"""Points that a search looks at, at most."""
_SHELL = 0.06
"""Of the radius: points nearer to the surface than this belong to the ball, good or bad."""
_SIZE = 0.1
"""Relative: a ball of a more different size is another one."""
_GRAZING = np.radians(65.0)
"""Angle between the normal and the view above which points do not count."""
_HOLDER = np.radians(8.0)
"""Points that near to what holds the ball, seen from its centre, do not count."""
_FEWEST = 200
_CELLS = 64
_LEAST_SEEN = 0.2
"""Share of the ball's surface that must be seen."""
_ROUND = 0.08
"""Least mean square of the points in any direction, over the radius²: 1/3 for a whole ball, 0.17
for a cap of a fifth, under 0.03 for the band in which a ball touches a tube."""


@dataclass(frozen=True)
class Ball:
    """A ball as it was measured: the unconstrained least-squares sphere of its points."""

    index: Index
    """(n,) points of the survey that count; the sphere goes through all but 0.3 % of them."""
    sphere: Sphere
    """Its covariance holds the points' noise, by `clumping` what neighbours share, and by
    `line_covariance` what a line of the picture repeats in all profiles; of all of them what the
    calibration has not bent (`own_residual`), for that is counted by `ball_moves`."""
    residual: Floats
    """(n,) mm: distance of each point from the sphere, positive outside."""
    left_out: float
    """Share of the ball's points that do not count: at a grazing angle, or near its holder."""
    clumping: float


def find_balls(survey: Survey, diameters: Sequence[float]) -> list[Ball]:
    """The balls of these diameters, mm, in their order; of about equal ones the lowest in z first.

    Raises InputError where one is not there: its size off by more than 10 %, fewer than 200 points,
    or less than a fifth of its surface seen.
    """
    X = survey.points
    free = np.ones(len(X), dtype=np.bool_)
    found = list[tuple[Floats, float]]()
    for number, diameter in enumerate(diameters, start=1):
        at = _sought(X[free], diameter / 2)
        if at is None:
            raise InputError(
                f"ball {number} of {diameter:g} mm was not found among {len(X)} points",
                hint="is this the artefact, alone on the table, and this its file?",
            )
        found.append(at)
        free &= np.linalg.norm(X - at[0], axis=1) > 1.1 * at[1]
    order = list(range(len(found)))
    if max(diameters) < (1 + 2 * _SIZE) * min(diameters):
        order.sort(key=lambda k: float(found[k][0][2]))
    return [ball_at(survey, *found[k]) for k in order]


def ball_at(survey: Survey, centre: Floats, radius: float) -> Ball:
    """The ball that lies about there, fitted to all of its points that count.

    Its points are those within 6 % of the radius from its surface, without those that were seen at
    more than 65° from the normal, where a scanner's edge effect begins, and without those within
    8° of what holds the ball. Raises InputError for fewer than 200 points.
    """
    X = survey.points
    for _ in range(3):
        away = np.linalg.norm(X - centre, axis=1)
        on = np.flatnonzero(np.abs(away - radius) < _SHELL * radius)
        good = on[_counts(survey, on, away, centre, radius)]
        if len(good) < _FEWEST:
            raise InputError(
                f"a ball of {2 * radius:.3f} mm has {len(good)} points that count, expected "
                f"{_FEWEST}",
                hint="scan it in smaller steps, free of its holder",
            )
        first = fit_sphere(X[good])
        centre, radius = first.centre, first.radius
    inner = kept(np.linalg.norm(X[good] - centre, axis=1) - radius)
    fit = fit_sphere(X[good[inner]])
    out = X[good] - fit.centre
    residual = fit.distances(X[good])
    bends = _moves(survey, fit.centre, good)[1]
    own, shared = own_residual(residual, bends, _cell(out), 4)
    lines = None if survey.lines is None else survey.lines[good[inner]]
    covariance = _scattered(out[inner], own[inner], shared, lines)
    sphere = Sphere(fit.centre, fit.radius, fit.rms, covariance, fit.count)
    return Ball(good, sphere, residual, 1.0 - len(good) / max(len(on), 1), shared)


def _scattered(out: Floats, residual: Floats, shared: float, lines: Longs | None) -> Floats:
    """(4, 4) mm²: covariance of the sphere through points (n, 3) from its centre, not weighted.

    From each point's own residual (n,), for those that are seen at an angle, or far away, scatter
    more than others (H. White, A heteroskedasticity-consistent covariance matrix, 1980); ``shared``
    times as much for what neighbours share, and with what lines (n,) are seen to repeat.
    """
    J = np.column_stack([-out / np.linalg.norm(out, axis=1)[:, None], -np.ones(len(out))])
    back = np.linalg.pinv(J)
    share = len(out) / (len(out) - J.shape[1])
    alone: Floats = share * (back * residual**2) @ back.T
    by_lines = None if lines is None else line_covariance(J, residual, lines)
    return shared * alone if by_lines is None else with_lines(shared * alone, alone, by_lines)


def ball_moves(survey: Survey, ball: Ball, some: Index) -> tuple[Floats, Floats]:
    """How the calibration moves a ball: (m, 4) mm centre and radius, (m, k) mm its residuals.

    For one standard deviation of each of the m directions of the calibration, by the points
    ``some`` (k,) of the survey.
    """
    return _moves(survey, ball.sphere.centre, some)


def _moves(survey: Survey, centre: Floats, some: Index) -> tuple[Floats, Floats]:
    """As `ball_moves`, of the ball through ``some`` about a ``centre`` (3,) mm."""
    out = survey.points[some] - centre
    out = out / np.linalg.norm(out, axis=1)[:, None]
    J = np.column_stack([-out, -np.ones(len(out))])
    pushed = survey.pushed(some, out)
    p = -pushed @ np.linalg.pinv(J).T
    return p, pushed + p @ J.T


def _counts(survey: Survey, on: Index, away: Floats, centre: Floats, radius: float) -> np.ndarray:
    """(k,) True for the points ``on`` the ball that neither graze nor lie beside its holder."""
    from scipy.spatial import cKDTree

    X = survey.points
    normal = (X[on] - centre) / np.maximum(away[on], 1e-9)[:, None]
    good = np.ones(len(on), dtype=np.bool_)
    if survey.eyes is not None:
        view = survey.eyes[on] - X[on]
        steep = np.einsum("ki,ki->k", normal, view) / np.linalg.norm(view, axis=1)
        good &= steep > np.cos(_GRAZING)
    beside = (away > (1 + _SHELL) * radius) & (away < 1.5 * radius)
    beside |= (away > 0.5 * radius) & (away < (1 - _SHELL) * radius)
    holder = np.flatnonzero(beside)[:: max(int(beside.sum()) // _LOOK, 1)]
    if len(holder) < 5:
        return good
    ways = (X[holder] - centre) / away[holder][:, None]
    tree = cKDTree(ways)
    crowd = np.asarray(tree.query(ways, k=5)[0])[:, -1] < 2 * np.sin(_HOLDER / 2)
    if crowd.any():
        near = cKDTree(ways[crowd]).query(normal, distance_upper_bound=2 * np.sin(_HOLDER / 2))[0]
        good &= np.isinf(near)
    return good


def _sought(X: Floats, radius: float) -> tuple[Floats, float] | None:
    """Centre and radius of the ball of about that radius that most points lie on, or None."""
    from scipy.spatial import cKDTree

    look = X[:: max(len(X) // _LOOK, 1)]
    if len(look) < _FEWEST:
        return None
    tree = cKDTree(look)
    best, most = None, 0
    for seed in look[:: max(len(look) // _SEEDS, 1)]:
        near = look[tree.query_ball_point(seed, 0.7 * radius)]
        near = near[:: max(len(near) // 200, 1)]
        at = _algebraic(near, radius)
        if at is None:
            continue
        count = int(_inliers(look, *at).sum())
        if count > most:
            best, most = at, count
    for _ in range(5):
        if best is None:
            return None
        best = _algebraic(look[_inliers(look, *best)], radius)
    if best is None:
        return None
    out = look[_inliers(look, *best)] - best[0]
    if len(out) < 10:
        return None
    seen = len(np.unique(_cell(out))) / _CELLS
    flat = float(np.linalg.eigvalsh(out.T @ out / len(out))[0]) / best[1] ** 2
    return best if seen >= _LEAST_SEEN and flat >= _ROUND else None


def _inliers(X: Floats, centre: Floats, radius: float) -> np.ndarray:
    return np.asarray(np.abs(np.linalg.norm(X - centre, axis=1) - radius) < 0.02 * radius)


def _algebraic(X: Floats, radius: float) -> tuple[Floats, float] | None:
    """The algebraic sphere of points, None where its radius is not about ``radius``."""
    if len(X) < 10:
        return None
    middle = X.mean(axis=0)
    d = X - middle
    A = np.column_stack([2 * d, np.ones(len(d))])
    s = np.linalg.lstsq(A, (d * d).sum(axis=1), rcond=1e-10)[0]
    r = float(np.sqrt(max(s[3] + s[:3] @ s[:3], 0.0)))
    return (middle + s[:3], r) if abs(r - radius) < _SIZE * radius else None


def _cell(out: Floats) -> Index:
    """(n,) number of the cell of equal area, of 64, in which each direction (n, 3) lies."""
    way = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
    band = np.clip(((way[:, 2] + 1) * 4).astype(np.intp), 0, 7)
    turn = np.arctan2(way[:, 1], way[:, 0]) / (2 * np.pi) % 1.0
    cell: Index = band * 8 + np.minimum((turn * 8).astype(np.intp), 7)
    return cell
