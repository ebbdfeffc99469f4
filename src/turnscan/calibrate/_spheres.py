"""A sphere that was scanned: where it is, and which points lie on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._surfaces import Sphere, Sweep
from turnscan.errors import Degenerate
from turnscan.rig import Rig

_ROUNDS = 20
_OFF = 3.0
"""Times the usual distance: a point farther off lies on something else."""
_LEAST = 0.3
"""Of the points of the scan: fewer on the sphere, and something else was scanned."""
_ALIKE, _SURE = 0.2, 3.0
"""Of the radius, and of what is uncertain of it: one that differs by more is of something else."""


def find_sphere(
    sweeps: Sequence[Sweep], rig: Rig, known: tuple[float, float], doubt: float = 0.0
) -> Sphere:
    """The sphere that most of the points lie on; ``known`` is its radius with its uncertainty.

    ``doubt`` mm is how far the rig may put a point beside its place: so far a radius may be off.

    Raises Degenerate where there is none of about that size.
    """
    at = [s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps]
    points = np.concatenate(at)
    keep = np.ones(len(points), dtype=bool)
    centre, radius = points.mean(axis=0), known[0]
    for _ in range(_ROUNDS):
        centre, radius = _fitted(points[keep])
        off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        usual = float(np.median(off))
        inside = off < max(_OFF * 1.4826 * usual, 1e-6)
        if (inside == keep).all():
            break
        keep = inside
    alike = max(_ALIKE * known[0], _SURE * float(np.hypot(known[1], doubt)))
    if keep.mean() < _LEAST or abs(radius - known[0]) > alike:
        raise Degenerate(
            f"the points lie on no sphere of {2 * known[0]:g} mm: one of {2 * radius:.1f} mm takes "
            f"{keep.mean():.0%} of them",
            hint="scan the sphere alone, and give its diameter",
        )
    cuts = np.cumsum([len(a) for a in at])[:-1]
    which = tuple(np.flatnonzero(part) for part in np.split(keep, cuts))
    return Sphere(centre, radius, which, known)


def _fitted(points: Floats) -> tuple[Floats, float]:
    """Centre and radius by |P|² = 2 c·P + (r² - c²), linear in c and r² - c²."""
    middle = points.mean(axis=0)
    P = points - middle
    design = np.concatenate([2 * P, np.ones((len(P), 1))], axis=1)
    solved = np.linalg.lstsq(design, (P**2).sum(axis=1), rcond=None)[0]
    centre = solved[:3]
    return centre + middle, float(np.sqrt(max(solved[3] + centre @ centre, 0.0)))


def sphere_noise(sphere: Sphere, at: list[Floats], noise: list[Floats]) -> tuple[Floats, ...]:
    """Per sweep: what noise (n, 3) makes of the distances of its points from the sphere, mm."""
    out = []
    for where, moved, which in zip(at, noise, sphere.points, strict=True):
        arm = where[which] - sphere.centre
        unit = arm / np.linalg.norm(arm, axis=1)[:, None]
        out.append(np.einsum("mi,mi->m", unit, moved[which]))
    return tuple(out)


def again(sphere: Sphere, sweeps: Sequence[Sweep], rig: Rig) -> Sphere:
    """The same sphere, with the points that lie on it now."""
    known = sphere.known or (sphere.radius, sphere.radius)
    found = find_sphere(sweeps, rig, known)
    return replace(found, known=sphere.known)
