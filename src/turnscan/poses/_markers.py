"""Marker spheres: balls of known size that stay with the part from pose to pose."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import DidNotConverge, InputError
from turnscan.poses._landmarks import rigid
from turnscan.poses._view import View, thin
from turnscan.rig import Pose
from turnscan.shapes import fit_sphere

_NEAR = 0.2
"""Radii within which the centres lie that the points of one ball tell of."""
_VOTES = 12
"""Points that must tell of one centre."""
_SIZE = 0.04
"""Part by which a ball's fitted radius may differ from the one given."""
_ROUND = 0.02
"""Least spread of the points' directions in any direction: less is a ridge, not a ball."""
_SIGMAS = 1.5
"""rms of a ball's points about it, in sigma."""
_MOST = 16
"""Balls looked at in one pose."""
_SAME = 0.15
"""Radii by which the distances between balls may differ from pose to pose."""


def marker_spheres(v: View, diameter: float) -> Floats:
    """(m, 3) mm: centres of the balls of that diameter (mm) in a view, in its own frame.

    Each point tells of a centre one radius below it; where many tell of one, a ball is fitted to
    the points round it, and counts when its size is right and it was seen from more than an edge.
    """
    from scipy.spatial import cKDTree

    r = diameter / 2
    some = thin(v, max(r / 6, v.spacing), v.inner)
    if len(some) < _VOTES:
        return np.zeros((0, 3))
    told = v.points[some] - r * v.normals[some]
    tree = cKDTree(told)
    votes = np.asarray(tree.query_ball_point(told, _NEAR * r, return_length=True))
    found: list[Floats] = []
    for k in np.argsort(-votes, kind="stable"):
        if votes[k] < _VOTES or len(found) >= _MOST:
            break
        start = told[tree.query_ball_point(told[k], _NEAR * r)].mean(axis=0)
        if any(np.linalg.norm(start - c) < r for c in found):
            continue
        centre = _fitted(v, start, r)
        if centre is not None and all(np.linalg.norm(centre - c) > r for c in found):
            found.append(centre)
    return np.array(found).reshape(-1, 3)


def _fitted(v: View, start: Floats, r: float) -> Floats | None:
    centre = start
    for band in (0.2, 0.1):
        away = np.linalg.norm(v.points - centre, axis=1)
        on = np.abs(away - r) < band * r + 3 * v.sigma
        on &= np.einsum("ij,ij->i", v.normals, v.points - centre) > 0.7 * away
        out = (v.points[on] - centre) / r
        if on.sum() < _VOTES or np.linalg.eigvalsh(np.cov(out.T))[0] < _ROUND / 2:
            return None
        try:
            ball = fit_sphere(v.points[on], v.sigma[on])
        except (InputError, DidNotConverge):
            return None
        centre = ball.centre
    out = (v.points[on] - centre) / ball.radius
    spread = np.linalg.eigvalsh(np.cov(out.T))
    off = ball.distances(v.points[on]) / v.sigma[on]
    good = abs(ball.radius - r) < _SIZE * r and spread[0] > _ROUND
    good &= float(np.sqrt((off**2).mean())) < _SIGMAS
    return np.asarray(centre) if good else None


def from_markers(names: Sequence[str], balls: Sequence[Floats], diameter: float) -> list[Pose]:
    """Where the poses lie in the frame of the first, from the balls (m, 3) that each one shows.

    A pose is placed where most of its balls meet balls placed before. Raises InputError for a
    pose that shares fewer than three, or whose balls fit in several ways.
    """
    tolerance = _SAME * diameter / 2
    placed = {0: Pose()}
    there = np.asarray(balls[0])
    while len(placed) < len(names):
        left = [i for i in range(len(names)) if i not in placed]
        fits = {i: _constellation(there, balls[i], tolerance) for i in left}
        i = max(left, key=lambda k: fits[k][0])
        count, poses = fits[i]
        if count < 3:
            raise InputError(
                f"{names[i]}: {len(balls[i])} marker spheres seen, and fewer than 3 of them also "
                "in the other poses",
                hint="check their diameter, or use more of them",
            )
        if len(poses) > 1:
            raise InputError(
                f"{names[i]}: its {count} marker spheres fit in several ways",
                hint="place them at unequal distances",
            )
        placed[i] = poses[0]
        seen = poses[0].apply(balls[i])
        new = np.linalg.norm(seen[:, None] - there, axis=2).min(axis=1) > tolerance
        there = np.concatenate([there, seen[new]])
    return [placed[i] for i in range(len(names))]


def _constellation(a: Floats, b: Floats, tolerance: float) -> tuple[int, list[Pose]]:
    """Most balls of b that meet balls of a, and the motions of b, each different, that do it."""
    best, poses = 0, list[Pose]()
    if len(a) < 3 or len(b) < 3:
        return 0, []
    ordered = np.array(list(permutations(range(len(a)), 3)))
    sides = np.linalg.norm(a[ordered] - a[np.roll(ordered, 1, axis=1)], axis=2)
    for three in combinations(range(len(b)), 3):
        mine = b[list(three)]
        wanted = np.linalg.norm(mine - np.roll(mine, 1, axis=0), axis=1)
        for k in np.flatnonzero((np.abs(sides - wanted) < tolerance).all(axis=1)):
            try:
                pose = rigid(a[ordered[k]], mine)
            except InputError:  # three in one line say nothing
                continue
            away = np.linalg.norm(pose.apply(b)[:, None] - a, axis=2)
            met = away.min(axis=1) < tolerance
            count = int(met.sum())
            if count < best:
                continue
            pose = rigid(a[away.argmin(axis=1)[met]], b[met])
            if count > best:
                best, poses = count, []
            apart = [np.linalg.norm(pose.apply(b) - p.apply(b), axis=1).max() for p in poses]
            if all(x > tolerance for x in apart):
                poses.append(pose)
    return best, poses
