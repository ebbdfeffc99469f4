"""A measured surface brought onto a reference: where it belongs there, and in how many ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.poses._align import Alignment, align
from turnscan.poses._match import placements
from turnscan.poses._place import Desk
from turnscan.poses._view import EDGE, View, averaged
from turnscan.rig import Pose

_TRIED = 24
"""Placements that are looked at."""
_COARSE = 12
"""Rounds of refinement of each."""
_KEPT = 6
"""Placements that are refined to the end, at most: those of a symmetric part nearly are equal, …"""
_CLOSE = 2.0
"""… where their rough misfit is less than this many times the least."""
_ALLOWED = 1 / 400
"""Of the size: how far a part may be off its reference while its place is looked for."""
_SAME = 0.5
"""Placements whose points lie fewer sample spacings apart are one."""
_LEAST = 0.5
"""Part of the samples that must lie on the reference."""
_FACING = 0.7
"""Cosine between normals of one place."""
_ALIKE = 1.05
"""Placements whose misfit is less than this many times the best one's could be meant as well."""
_SIGMA = 1e-5
"""Of the size: sigma of a reference, which is drawn and not measured."""


@dataclass(frozen=True)
class Onto:
    """Where a surface belongs on its reference."""

    alignment: Alignment
    """The reference first, which stays; then the surface."""
    rms: float
    """mm: misfit of the surface's samples that lie on the reference."""
    rivals: int
    """Other placements that fit as well: those of a symmetric part."""

    @property
    def pose(self) -> Pose:
        """Frame of the surface → frame of the reference."""
        return self.alignment.poses[1]


def plain_view(
    name: str, points: Floats, normals: Floats, spacing: float, sigma: Floats | None = None
) -> View:
    """A surface that no camera is known of: points (n, 3) mm with unit normals (n, 3).

    ``spacing`` mm is the usual distance between points; ``sigma`` (n,) mm, None for a drawn one.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    some = np.full(len(points), _SIGMA * size) if sigma is None else sigma
    mean, length = averaged(points, normals, 2 * spacing)
    inner: Bools = length > EDGE
    return View(name, points, mean, some, points, inner, spacing)


def onto(reference: View, other: View) -> Onto:
    """Bring a surface onto its reference by shape: globally first, then weighted by sigma.

    Pairs of oriented points vote for placements; the best of them are refined with point-to-plane
    links (`align`), whose robust scatter keeps what is missing on one of the two from pulling.
    Raises InputError where the surface belongs nowhere.
    """
    rough = [_allowing(v, reference.size) for v in (reference, other)]
    desk = Desk(rough)
    limit = _SAME * desk.step
    points = other.points[desk.few[1]]
    tried: list[tuple[float, Pose]] = []
    for start, _ in placements(desk.pairs[0], desk.pairs[1], _TRIED):
        pose = desk.refined(1, 0, start, _COARSE)
        share, off = _misfit(rough[0], rough[1], pose, desk.few[1], desk.step)
        same = any(_apart(pose, p, points) < limit for _, p in tried)
        if share >= _LEAST and not same:
            tried.append((off / share, pose))
    tried.sort(key=lambda one: one[0])
    if not tried:
        raise InputError(
            f"{other.name}: no place on {reference.name} where half of it lies on the surface",
            hint="check that it is the same part, and the units of both files",
        )
    near = [pose for off, pose in tried[:_KEPT] if off <= _CLOSE * tried[0][0]]
    done = [onto_from(reference, other, pose) for pose in near]
    done.sort(key=_worth)
    equal = [one for one in done[1:] if _worth(one) < _ALIKE * _worth(done[0])]
    equal = [one for one in equal if _apart(one.pose, done[0].pose, points) > limit]
    return replace(done[0], rivals=len(equal))


def _worth(one: Onto) -> float:
    """mm: the misfit, the larger the less of the surface lies on the reference."""
    shared = one.alignment.fits[1].shared
    return one.rms / shared if shared > 0 else float("inf")


def onto_from(reference: View, other: View, start: Pose) -> Onto:
    """Bring a surface onto its reference from where it nearly is."""
    found = align([reference, other], [Pose(), start])
    rms = next((m.rms for m in found.meetings), float("inf"))
    return Onto(found, rms, 0)


def _allowing(v: View, size: float) -> View:
    return replace(v, sigma=np.maximum(v.sigma, _ALLOWED * size))


def _misfit(
    reference: View, other: View, pose: Pose, samples: Ints, reach: float
) -> tuple[float, float]:
    """Part of the samples that has the reference within ``reach`` mm facing the same way, and the
    rms of those, mm."""
    there, normals = pose.apply(other.points[samples]), pose.turn(other.normals[samples])
    away, at = reference.nearest(there, reach)
    met = np.isfinite(away)
    met[met] = np.einsum("ij,ij->i", reference.normals[at[met]], normals[met]) > _FACING
    if not met.any():
        return 0.0, np.inf
    off = np.einsum("ij,ij->i", reference.normals[at[met]], there[met] - reference.points[at[met]])
    return float(met.mean()), float(np.sqrt(np.mean(np.square(off))))


def _apart(a: Pose, b: Pose, points: Floats) -> float:
    return float(np.sqrt(((a.apply(points) - b.apply(points)) ** 2).sum(axis=1).mean()))


def onto_all(reference: View, others: Sequence[View]) -> Alignment:
    """Where several surfaces lie on a reference, and on each other where they overlap.

    The reference counts as far as the surfaces agree with it: its sigma is the scatter of the worst
    of them. The alignment is that of the surfaces alone, in the frame of the reference.
    """
    starts = [onto(reference, v) for v in others]
    scatter = max(one.rms for one in starts)
    drawn = replace(reference, sigma=np.maximum(reference.sigma, scatter))
    found = align([drawn, *others], [Pose(), *(one.pose for one in starts)])
    kept = [m for m in found.meetings if reference.name not in (m.first, m.second)]
    return Alignment(
        found.names[1:], found.poses[1:], found.middles[1:], found.covariance[1:],
        tuple(replace(f, view=f.view - 1) for f in found.freedoms if f.view), tuple(kept),
        found.fits[1:],
    )  # fmt: skip
