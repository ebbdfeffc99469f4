"""Where a view could belong in another one: pairs of oriented points vote for placements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.poses._view import View, thin
from turnscan.rig import Pose, nearest_rotation

if TYPE_CHECKING:
    from turnscan.poses._kernels import Samples, Table

_MOST = 700
"""Samples of a view at most; their pairs grow with the square."""
_ASKED = 120
"""Samples of the other view whose pairs vote."""
_BEST = 3
"""Placements kept of each of them."""
_REACH = 0.7
"""Pairs are at most this part of the view's size apart: overlaps are smaller than the part."""
_ALIKE = np.deg2rad(18.0)
"""Rotations nearer than this are one placement …"""
_NEAR = 3.0
"""… where they lie fewer sample spacings apart."""


@dataclass(frozen=True)
class Sampled:
    """A view's samples, and the table of their pairs."""

    points: Floats
    """(m, 3) mm."""
    normals: Floats
    """(m, 3)."""
    step: float
    """mm: spacing of the samples, and bin of the distances of pairs."""
    far: float
    """mm: pairs are nearer than this."""

    @cached_property
    def frames(self) -> Floats:
        """(m, 3, 3): turns each normal to x."""
        from turnscan.poses import _kernels as kernels

        return kernels.frames(self.normals)

    @property
    def samples(self) -> Samples:
        """What the kernels take of it."""
        from turnscan.poses import _kernels as kernels

        return kernels.Samples(self.points, self.normals, self.frames)

    @cached_property
    def table(self) -> Table:
        """Its pairs, sorted by bin."""
        from turnscan.poses import _kernels as kernels

        key, first, turn = kernels.pairs(self.samples, self.step, 2 * self.step, self.far)
        bins = (int(self.far / self.step) + 1) * kernels.ANGLES**3
        order = np.argsort(key, kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=bins))])
        return kernels.Table(starts, first[order], turn[order], len(self.points))


def sampled(v: View, step: float, size: float) -> Sampled:
    """Samples of a view ``step`` mm apart, at most `_MOST`; ``size`` mm is that of the views."""
    some = thin(v, step, v.inner)
    if len(some) > _MOST:
        some = some[np.linspace(0, len(some) - 1, _MOST).astype(np.intp)]
    return Sampled(v.points[some], v.normals[some], step, _REACH * size)


def placements(model: Sampled, other: Sampled, most: int) -> list[tuple[Pose, float]]:
    """Where ``other`` could belong in the frame of ``model``: at most ``most``, with their votes.

    Point pair features (Drost et al., Model Globally, Match Locally, CVPR 2010): a pair of oriented
    points is known by its distance and three angles; every pair of ``other`` votes for the turns
    about the normal of those points of ``model`` that have such a pair. Placements that agree are
    averaged and their votes added. The same samples give the same placements in the same order.
    """
    from turnscan.poses import _kernels as kernels

    asked = np.linspace(0, len(other.points) - 1, min(_ASKED, len(other.points))).astype(np.intp)
    reach = (model.step, 2 * model.step, model.far)
    m, turns, votes = kernels.vote(other.samples, np.unique(asked), model.table, reach, _BEST)
    i = np.repeat(np.unique(asked), _BEST)
    m, turns, votes = m.ravel(), turns.ravel(), votes.ravel()
    cos, sin, zero, one = np.cos(turns), np.sin(turns), np.zeros(len(turns)), np.ones(len(turns))
    about = np.stack([one, zero, zero, zero, cos, -sin, zero, sin, cos], -1).reshape(-1, 3, 3)
    R = np.einsum("nji,njk,nkl->nil", model.frames[m], about, other.frames[i])
    t = model.points[m] - np.einsum("nij,nj->ni", R, other.points[i])
    return _clusters(R, t, votes, other.points.mean(axis=0), model.step, most)


def _clusters(
    R: Floats, t: Floats, votes: Floats, middle: Floats, step: float, most: int
) -> list[tuple[Pose, float]]:
    """Placements that agree, joined round the strongest, the strongest first."""
    from scipy.spatial.distance import cdist

    order = np.argsort(-votes, kind="stable")
    R, t, votes = R[order], t[order], votes[order]
    at = t + R @ middle  # compared at the view's middle: a small turn moves its origin far
    flat = R.reshape(-1, 9)
    near = flat @ flat.T > 1 + 2 * np.cos(_ALIKE)
    near &= cdist(at, at) < _NEAR * step
    free, groups, sums = votes > 0, list[Ints](), list[float]()
    for k in range(len(R)):
        if free[k]:
            alike = np.flatnonzero(near[k] & free).astype(np.int32)
            free[alike] = False
            groups.append(alike)
            sums.append(float(votes[alike].sum()))
    strongest = np.argsort(-np.array(sums), kind="stable")[:most]
    return [(_mean(R[g], at[g], votes[g], middle), sums[k]) for k in strongest for g in [groups[k]]]


def _mean(R: Floats, at: Floats, votes: Floats, middle: Floats) -> Pose:
    """One placement for those that agree (n, 3, 3), which bring the middle to ``at`` (n, 3)."""
    mean = nearest_rotation(np.einsum("n,nij->ij", votes, R))
    return Pose(mean, np.average(at, axis=0, weights=votes) - mean @ middle)
