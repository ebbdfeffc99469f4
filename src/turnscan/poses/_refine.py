"""All poses at once: point-to-plane least squares over all overlaps, and what it leaves open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.poses._links import ALIKE, Links, link, rows, surface_of
from turnscan.poses._view import View, thin
from turnscan.rig import Pose, nearest_rotation, rotation_from_vector
from turnscan.threads import in_parts

_ROUNDS = 60
_SHRINK = 0.6
"""How much shorter the links get from round to round."""
_STILL = 0.02
"""Usual sigmas that a round may still move a view by, when it is done."""
_TUKEY = 4.0
"""Residuals beyond this many robust sigma say nothing about where a view belongs."""
SLIP = 0.02
"""A motion along which the surface rises by less than this part of it is not determined."""
_RIDGE = (0.1 * SLIP) ** 2


@dataclass(frozen=True)
class Equations:
    """Normal equations of all poses, about the middles of the views."""

    H: Floats
    """(6n, 6n): information, rad⁻² and mm⁻², turn before shift, view after view."""
    g: Floats
    """(6n,)."""
    motion: Floats
    """(6n, 6n): weighted square of the motion itself, whichever way the surface lies."""
    chi2: float
    """Weighted square of the residuals, per link."""
    links: Sequence[Links]
    weights: Sequence[Floats]
    """(k,) mm⁻² of each of their places."""
    middles: Floats
    """(n, 3) mm."""

    @cached_property
    def true(self) -> Floats:
        """(6n, 6n): `H` without the bias that the noise of the normals gives it."""
        true = np.zeros_like(self.H)
        for k, w in zip(self.links, self.weights, strict=True):
            at = _both(k)
            half = _turns(k, k.n_p, self.middles).T @ (_turns(k, k.n_q, self.middles) * w[:, None])
            true[np.ix_(at, at)] += (half + half.T) / 2
        return true


def samples_of(views: Sequence[View], spacing: float, most: int) -> list[Ints]:
    """Numbers of inner points of each view about ``spacing`` mm apart, at most ``most``."""
    out = []
    for v in views:
        some = thin(v, spacing, v.inner)
        if len(some) > most:
            some = some[np.linspace(0, len(some) - 1, most).astype(np.intp)]
        out.append(some)
    return out


Asked = Mapping[tuple[int, int], Ints]
"""For views i and j, by number: which points of view i are looked for on view j."""


def both_ways(samples: Sequence[Ints], fixed: int = 1) -> Asked:
    """Samples of all views on all others, but of the first ``fixed`` among themselves."""
    n = range(len(samples))
    return {(i, j): samples[i] for i in n for j in n if i != j and max(i, j) >= fixed}


def near_ones(views: Sequence[View], poses: Sequence[Pose], asked: Asked, reach: float) -> Asked:
    """Of those that are asked the ones that have a point of the other view within ``reach`` mm."""
    out = {}
    for (i, j), some in asked.items():
        back = poses[j].inverse().apply(poses[i].apply(views[i].points[some]))
        away = views[j].nearest(back, reach)[0]
        out[i, j] = some[np.isfinite(away)]
    return out


def all_links(
    views: Sequence[View], poses: Sequence[Pose], asked: Asked, reach: float
) -> list[Links]:
    """Links between the views, at most ``reach`` mm long."""
    pairs = list(asked)
    if not pairs:
        return []
    found = in_parts(
        lambda k, _: link(views, poses, *pairs[k], asked[pairs[k]], reach)[0],
        len(pairs), len(pairs),
    )  # fmt: skip
    return [k for k in found if len(k.p)]


def equations(links: Sequence[Links], middles: Floats) -> Equations:
    """Weighted least squares of all links, Tukey's weights round their robust scatter."""
    from turnscan.poses import _link_kernels as kernels

    size = 6 * len(middles)
    H, motion = np.zeros((size, size)), np.zeros((size, size))
    g, total, count = np.zeros(size), 0.0, 0.0
    scale, weights = spread(links), list[Floats]()
    for k in links:
        pair = np.stack([middles[k.i], middles[k.j]])
        s = kernels.sums(k.p, k.q, k.normals, k.offsets, k.sigma, (scale, _TUKEY), pair)
        at = _both(k)
        H[np.ix_(at, at)] += s.H
        g[at] += s.g
        a, b = slice(6 * k.i, 6 * k.i + 6), slice(6 * k.j, 6 * k.j + 6)
        motion[a, a] += s.mine
        motion[b, b] += s.others
        total += s.chi2
        count += s.robust
        weights.append(s.weights)
    return Equations(H, g, motion, total / max(count, 1e-9), links, weights, middles)


def _both(k: Links) -> Ints:
    """(12,) where the unknowns of the two views stand."""
    six = np.arange(6, dtype=np.int32)
    return np.concatenate([6 * k.i + six, 6 * k.j + six])


def _turns(k: Links, normals: Floats, middles: Floats) -> Floats:
    """(k, 12): how the offsets along ``normals`` answer to the motions of the two views."""
    mine, others = rows(k.p, normals, middles[k.i]), rows(k.q, normals, middles[k.j])
    return np.concatenate([mine, -others], axis=1)


def middles_of(views: Sequence[View], poses: Sequence[Pose]) -> Floats:
    """(n, 3) mm: the middle of each view, in the common frame."""
    return np.stack([p.apply(v.middle) for p, v in zip(poses, views, strict=True)])


def spread(links: Sequence[Links]) -> float:
    """Robust scatter of the offsets of all links in sigma, at least 1."""
    r = np.concatenate([np.zeros(0), *(np.abs(k.offsets / k.sigma) for k in links)])
    return max(1.0, 1.4826 * float(np.median(r))) if len(r) else 1.0


def refine(
    views: Sequence[View],
    poses: Sequence[Pose],
    asked: Asked,
    reach: tuple[float, float],
    held: Floats | None = None,
    fixed: int = 1,
    rounds: int = _ROUNDS,
    still: float = 0.0,
) -> list[Pose]:
    """Poses that bring all views together best, from ``poses`` on; the first ``fixed`` stay.

    Links are ``reach[0]`` mm long at first and ``reach[1]`` at last. ``held`` (m, 6n) are motions
    of all poses that are not made. It is done when a round moves no view by ``still`` mm, or by
    `_STILL`.
    """
    now = list(poses)
    limit = reach[0]
    for _ in range(rounds):
        links = all_links(views, now, asked, limit)
        if not links:
            break
        middles = middles_of(views, now)
        e = equations(links, middles)
        step = _solve(e, held, fixed)
        for i in range(fixed, len(now)):
            now[i] = _moved(now[i], step[6 * i : 6 * i + 6], middles[i])
        weight = np.trace(e.motion[3:6, 3:6]) + 1e-300
        largest = np.sqrt(max(float(step @ e.motion @ step) / weight, 0.0))
        usual = float(np.median(np.concatenate([k.sigma for k in links])))
        if limit <= reach[1] and largest < max(still, _STILL * usual):
            break
        limit = max(reach[1], _SHRINK * limit)
    return now


def approach(
    mine: View,
    other: View,
    start: Pose,
    samples: Ints,
    reach: tuple[float, float],
    rounds: int,
    still: float,
) -> Pose:
    """`refine` of one view alone, from ``start`` in the frame of another one, which stays.

    Samples of it are looked for on the other one, not the other way round; compiled as a whole.
    """
    from turnscan.poses import _approach_kernels as kernels

    course = kernels.Course(
        rounds, *reach, _SHRINK, still, _STILL, _TUKEY, _RIDGE, ALIKE, other.spacing
    )
    there = surface_of(mine, start), surface_of(other, Pose())
    return Pose(*kernels.approach(*there, other.cubes, samples, mine.middle, course))


def _solve(e: Equations, held: Floats | None, fixed: int) -> Floats:
    """The step of all poses; the first ``fixed`` stay, as do motions that nothing determines."""
    size = len(e.g)
    step = np.zeros(size)
    free = slice(6 * fixed, size)
    H = e.H[free, free] + _RIDGE * e.motion[free, free]
    H += 1e-12 * max(1.0, float(np.diag(H).max(initial=0.0))) * np.eye(len(H))
    g = e.g[free]
    if held is not None and len(held):
        # Motions are square to the held ones in the metric of the motion itself.
        C = held[:, free] @ e.motion[free, free]
        basis = np.linalg.svd(C)[2][np.linalg.matrix_rank(C) :].T
        step[free] = basis @ np.linalg.solve(basis.T @ H @ basis, basis.T @ g)
    else:
        step[free] = np.linalg.solve(H, g)
    return step


def _moved(pose: Pose, step: Floats, middle: Floats) -> Pose:
    R = rotation_from_vector(step[:3])
    turned = nearest_rotation(R @ pose.rotation)  # stays one after many rounds
    return Pose(turned, R @ (pose.translation - middle) + middle + step[3:])
