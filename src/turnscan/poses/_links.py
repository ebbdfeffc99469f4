"""Links: places that two views measured both, and the point-to-plane equations they give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.poses._view import View
from turnscan.rig import Pose

if TYPE_CHECKING:
    from turnscan.poses._link_kernels import Surface

ALIKE = float(np.cos(np.deg2rad(35.0)))
"""Cosine between the normals of one place, seen twice."""


@dataclass(frozen=True)
class Links:
    """Points of view ``i`` and their neighbours in view ``j``, in the common frame."""

    i: int
    j: int
    p: Floats
    """(k, 3) mm."""
    q: Floats
    """(k, 3) mm: the nearest point of the other view."""
    n_p: Floats
    """(k, 3) unit."""
    n_q: Floats
    """(k, 3) unit."""
    sigma: Floats
    """(k,) mm, of both together."""

    @cached_property
    def normals(self) -> Floats:
        """(k, 3) unit: the mean of both.

        With it the distance is zero for any two points of one surface of second order
        (Rusinkiewicz, A Symmetric Objective Function for ICP, 2019): a coarse spacing on a round
        part does not bias it, as the distance from one tangent plane would be.
        """
        n = self.n_p + self.n_q
        unit: Floats = n / np.linalg.norm(n, axis=1, keepdims=True)
        return unit

    @cached_property
    def offsets(self) -> Floats:
        """(k,) mm: how far view i lies outside view j, along the normal."""
        off: Floats = np.einsum("kj,kj->k", self.normals, self.p - self.q)
        return off


def link(
    views: Sequence[View], poses: Sequence[Pose], i: int, j: int, samples: Ints, reach: float
) -> tuple[Links, Ints]:
    """Links from ``samples`` of view i to view j, at most ``reach`` mm long, and which samples.

    Neighbours on a border are none: what lies beyond a border has no partner there.
    """
    from turnscan.poses import _link_kernels as kernels

    mine, other = surface_of(views[i], poses[i]), surface_of(views[j], poses[j])
    there = poses[i].apply(mine.points[samples])
    back = (there - other.translation) @ other.rotation
    away, at = views[j].nearest(back, reach)
    limits = ALIKE, max(2 * views[j].spacing, reach / 2) ** 2
    which, *found = kernels.met(mine, other, samples, away, at, limits)
    return Links(i, j, *found), which


def surface_of(v: View, pose: Pose) -> Surface:
    """What the kernels take of a view."""
    from turnscan.poses import _link_kernels as kernels

    return kernels.Surface(v.points, v.normals, v.sigma, v.inner, pose.rotation, pose.translation)


def rows(points: Floats, normals: Floats, middle: Floats) -> Floats:
    """(k, 6): how the offset along the normals answers to a turn about ``middle`` and a shift."""
    x, y, z = (points - middle).T
    a, b, c = normals.T
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a, a, b, c], axis=-1)
