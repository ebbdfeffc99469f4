"""Orientation and run-out of shapes to each other: zones of ISO 1101, as far as noise shows them.

A plane is held between two planes that are parallel or square to a datum, an axis in a cylinder or
between two planes; a surface of revolution runs out about the axis of another. Directions and axes
are those of the shapes as measured, each fitted on its own, never those of relations adopted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.mesh import Mesh
from turnscan.shapes._cells import cell_means, cells_of, full_enough
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._form_errors import FormError, FormKind, well_known
from turnscan.shapes.primitives._shapes import Shape, ShapeSet
from turnscan.shapes.primitives._sizes import LOOK, between_axes, joint, slope_of
from turnscan.shapes.verification._statistics import noise_range

_ANGLE = float(np.radians(1.0))
"""An axis whose direction is less certain than this has no orientation."""
_COAXIAL = 0.2
"""Of the smaller radius: axes further apart than this are not about each other."""
_RINGS, _ROUND = 10, 12
"""Rings that a wall is cut into at the most, and cells that each must have."""
_RING_CELL, _RING_LEAST = 20, 8
"""Points of a cell of a ring, about and at the least."""
_COVERED = 0.75
"""Share of the turn that must be seen."""
_RAYLEIGH = float(np.sqrt(np.pi / 2))
"""Mean length of a plane vector whose coordinates scatter by 1."""
_HALF = float(np.sqrt(2 / np.pi))
"""Mean size of a number that scatters by 1."""
_DRAWN = 400
"""Draws of noise that tell what it makes of the worst of several rings."""


def orientation_errors(mesh: Mesh, found: ShapeSet) -> tuple[FormError, ...]:
    """Roundness of walls, parallelism and perpendicularity of planes and axes, and run-out.

    Each shape is held against the largest before it that is parallel, square or coaxial to within
    3° (20 % of the radius): this is the datum. What is larger is known better, and one datum for
    each says more than all pairs.
    """
    out = list[FormError]()
    known = well_known(mesh, found)
    for k, s in enumerate(found.measured):
        own = np.flatnonzero(known & (found.label == k))
        if s.kind in ("cylinder", "cone"):
            out += _one(_round(mesh.vertices[own], s, k, found.residual[own]))
        taken = set[str]()
        for d in range(k):
            for error in _against(mesh, found, k, d, own, taken):
                taken.add(error.kind)
                out.append(error)
    return tuple(out)


def _one(error: FormError | None) -> list[FormError]:
    return [] if error is None else [error]


def _against(
    mesh: Mesh, found: ShapeSet, k: int, d: int, own: np.ndarray, taken: set[str]
) -> Iterator[FormError]:
    """What shape ``k`` is off by from the datum ``d``, of the kinds that are not taken yet."""
    s, datum = found.measured[k], found.measured[d]
    if "sphere" in (s.kind, datum.kind):
        return
    dot = abs(float(s.axis @ datum.axis))
    aligned = dot > np.cos(LOOK)
    if not aligned and dot > np.sin(LOOK):
        return
    same = (s.kind == "plane") == (datum.kind == "plane")
    kind: FormKind = "parallelism" if aligned == same else "perpendicularity"
    if kind not in taken and max(s.axis_sigma, datum.axis_sigma) < _ANGLE:
        if s.kind == "plane":
            yield from _one(_plane_zone(mesh, found, k, d, own, aligned, kind))
        else:
            yield _axis_zone(found, k, d, aligned, kind)
    walls = ("cylinder", "cone")
    if aligned and s.kind in walls and datum.kind == "cylinder" and "run-out" not in taken:
        away = float(np.linalg.norm(between_axes(s.numbers, datum.numbers)))
        if away < _COAXIAL * min(s.radius, datum.radius):
            yield from _run_out(mesh.vertices[own], found, k, d, found.residual[own])


def _plane_zone(
    mesh: Mesh, found: ShapeSet, k: int, d: int, own: np.ndarray, aligned: bool, kind: FormKind
) -> FormError | None:
    """The width of a plane's surface along the datum's direction, or square to it."""
    s, datum = found.measured[k], found.measured[d]
    X = mesh.vertices[own]
    cells = cells_of(X, found.residual[own], s.area)
    if cells is None:
        return None
    cell = cells.number
    scatter = cell_means(cell, found.residual[own], cells.together)[1]
    way = _zone(s.axis, datum.axis, aligned)
    height = cell_means(cell, X @ way)[0]
    middle = np.column_stack([cell_means(cell, X[:, i])[0] for i in range(3)])
    ends = middle[[int(height.argmin()), int(height.argmax())]]

    def apart(a: Floats, b: Floats) -> Floats:
        foot = ends - np.outer((ends - a[:3]) @ a[3:6], a[3:6])
        return np.array([(foot[1] - foot[0]) @ _zone(a[3:6], b[3:6], aligned)])

    turn = float(np.sqrt(max(_covariance(found, k, d, apart)[0, 0], 0.0)))
    wide, spread = noise_range(scatter)
    return FormError(
        kind, k, float(np.ptp(height)), float(np.hypot(wide, _HALF * turn)),
        float(np.hypot(spread, turn)), len(height), cells.side, d,
    )  # fmt: skip


def _zone(own: Floats, datum: Floats, aligned: bool) -> Floats:
    """(3,) Across the zone of a plane: the datum's direction, or its own normal made square to
    that; the turn about the datum is free then."""
    if aligned:
        return datum
    way = own - (own @ datum) * datum
    return np.asarray(way / np.linalg.norm(way))


def _axis_zone(found: ShapeSet, k: int, d: int, aligned: bool, kind: FormKind) -> FormError:
    """How far an axis leans over the length that was measured of it."""
    s, datum = found.measured[k], found.measured[d]
    across = np.stack(surface.frame(datum.axis)) if aligned else None

    def lean(a: Floats, b: Floats) -> Floats:
        if across is None:
            return np.array([s.length * (a[3:6] @ b[3:6])])
        return np.asarray(s.length * (across @ (a[3:6] - (a[3:6] @ b[3:6]) * b[3:6])))

    C = _covariance(found, k, d, lean)
    value = float(np.linalg.norm(lean(s.numbers, datum.numbers)))
    sigma = float(np.sqrt(max(float(np.linalg.eigvalsh(C)[-1]), 0.0)))
    chance = _RAYLEIGH if aligned else _HALF
    return FormError(kind, k, value, chance * sigma, sigma, 0, s.length, d)


def _covariance(found: ShapeSet, k: int, d: int, of: Callable[[Floats, Floats], Floats]) -> Floats:
    """(m, m) of values (m,) of two shapes as measured."""
    slope = slope_of((found.measured[k].numbers, found.measured[d].numbers), of)
    return np.asarray(slope @ joint(found.own_covariance, k, d) @ slope.T)


@dataclass(frozen=True)
class _Rings:
    """The cells of a wall, in rings about an axis."""

    mean: list[Floats]
    """Of each ring that is seen nearly all round: (c,) mm off, of each cell."""
    angle: list[Floats]
    """(c,) radians of the middles of those cells."""
    scatter: list[Floats]
    """(c,) mm that noise leaves of the means."""
    height: list[float]
    """mm along the axis from its point."""
    side: float
    """mm: mean length of a cell, around."""

    @property
    def every(self) -> int:
        """How many cells there are."""
        return sum(map(len, self.mean))


def _rings(X: Floats, point: Floats, axis: Floats, slope: float, residual: Floats) -> _Rings:
    """Cut a wall (n, 3) about an axis; ``slope`` is how its radius grows along it, which is taken
    off, and ``residual`` (n,) mm tells the noise of its points, and whether neighbours share it."""
    e1, e2 = surface.frame(axis)
    Y = X - point
    z, x, y = Y @ axis, Y @ e1, Y @ e2
    off = (np.hypot(x, y) - slope * z) / np.hypot(1.0, slope)
    turn = np.arctan2(y, x) / (2 * np.pi) % 1.0
    count = int(np.clip(len(X) // (4 * _ROUND * _RING_CELL), 1, _RINGS))
    low, long = float(z.min()), max(float(np.ptp(z)), 1e-12)
    ring = np.minimum(((z - low) / long * count).astype(np.int64), count - 1)
    around = int(np.clip(len(X) // count // _RING_CELL, _ROUND, 90))
    girth = 2 * np.pi * float(np.hypot(x, y).mean())
    cells = cells_of(X, residual, girth * long)
    together = 1.0 if cells is None else cells.together
    out = _Rings([], [], [], [], girth / around)
    for k in range(count):
        on = np.flatnonzero(ring == k)
        keys = (turn[on] * around).astype(np.int64) % around
        cell: Ints = full_enough(keys, _RING_LEAST)
        mean = cell_means(cell, off[on])[0]
        if len(mean) < _COVERED * around:
            continue
        out.mean.append(mean)
        middles = np.unique(keys[cell >= 0]) + 0.5
        out.angle.append(np.asarray(middles * (2 * np.pi / around), dtype=np.float64))
        out.scatter.append(cell_means(cell, residual[on], together)[1])
        out.height.append(low + (k + 0.5) * long / count)
    return out


def _round(X: Floats, s: Shape, k: int, residual: Floats) -> FormError | None:
    """The largest roundness of its rings, each about its least-squares circle (ISO 12181)."""
    rings = _rings(X, s.point, s.axis, _widens(s), residual)
    if not rings.mean:
        return None
    worst = 0.0
    for mean, angle in zip(rings.mean, rings.angle, strict=True):
        A = np.column_stack([np.ones(len(mean)), np.cos(angle), np.sin(angle)])
        worst = max(worst, float(np.ptp(mean - A @ np.linalg.lstsq(A, mean, rcond=None)[0])))
    noise, sigma = _worst_noise(rings.scatter)
    return FormError("roundness", k, worst, noise, sigma, rings.every, rings.side)


def _widens(s: Shape) -> float:
    """How the radius grows along the axis."""
    return float(np.tan(s.second)) if s.kind == "cone" else 0.0


def _worst_noise(scatter: list[Floats]) -> tuple[float, float]:
    """mm: what noise makes of the largest range of several rings, and how that scatters.

    By drawing: there is no closed form for rings of several sizes.
    """
    dice = np.random.default_rng(0)
    ranges = [np.ptp(dice.normal(0.0, s, (_DRAWN, len(s))), axis=1) for s in scatter]
    worst = np.max(ranges, axis=0)
    return float(worst.mean()), float(worst.std())


def _run_out(X: Floats, found: ShapeSet, k: int, d: int, residual: Floats) -> Iterator[FormError]:
    """Circular run-out about the datum's axis, the largest of its rings, and of a cylinder the
    total run-out: of all of it at once."""
    s, datum = found.measured[k], found.measured[d]
    way = 1.0 if float(s.axis @ datum.axis) > 0 else -1.0
    rings = _rings(X, datum.point, datum.axis, way * _widens(s), residual)
    if not rings.mean:
        return
    across = np.stack(surface.frame(datum.axis))
    unsure = 0.0
    for height in rings.height:
        place = datum.point + height * datum.axis

        def away(a: Floats, b: Floats, place: Floats = place) -> Floats:
            one, other = (q[:3] + ((place - q[:3]) @ q[3:6]) * q[3:6] for q in (a, b))
            return np.asarray(across @ (one - other))

        C = _covariance(found, k, d, away)
        unsure = max(unsure, float(np.sqrt(max(float(np.linalg.eigvalsh(C)[-1]), 0.0))))
    worst = max(float(np.ptp(mean)) for mean in rings.mean)
    told = [("run-out", worst, *_worst_noise(rings.scatter))]
    if s.kind == "cylinder":
        whole = float(np.ptp(np.concatenate(rings.mean)))
        told.append(("total run-out", whole, *noise_range(np.concatenate(rings.scatter))))
    for kind, value, noise, sigma in told:
        yield FormError(
            cast(FormKind, kind), k, value, float(np.hypot(noise, 2 * _RAYLEIGH * unsure)),
            float(np.hypot(sigma, 2 * unsure)), rings.every, rings.side, d,
        )  # fmt: skip
