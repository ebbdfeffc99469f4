"""The axis that a surface is turned about, whatever its profile.

A first guess is the line that all normals meet best: their linear complex (Pottmann and Wallner,
Computational Line Geometry, 2001, §7.1). From there the profile is a mean over small cells of the
half-plane (r, z), and the axis moves until points of a cell deviate from its mean alike all round:
least squares with a mean of its own for each cell (Frisch and Waugh, Econometrica 1, 1933, 387).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Longs, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh, vertex_normals
from turnscan.shapes.primitives._ground import measured_part, prepared, sigma_of
from turnscan.shapes.primitives._surface_kernels import frame
from turnscan.shapes.verification._statistics import clumping

_COARSE, _FINE = 12.0, 3.0
"""Cells of the profile begin as this part of the size, and end as so many steps of the mesh."""
_ROUNDS = 40
_SECTORS, _PART = 36, 0.5
"""Of the turn; and the share of the angles at which most of the wall is seen that a place on it
must be seen at."""
_FAINT = 1e-9
"""Weight of points that do not count, so that a cell that holds no others has a mean, too."""
_SHARP, _ENOUGH = 0.5, 12
"""Steps of the mesh: side of the places whose mean normal tells walls apart; points they need."""
_LEAST = 3
"""Points of a cell that count."""
_WAYS = 12
"""Directions of the normal into which the cells of one place are divided."""
_FAR = 4.0
"""Robust standard deviations beyond which a point is not on the surface: a handle, a keyway."""
_OPEN = 0.04
"""Of the best known movement of the axis: one that moves the surface by less is not determined."""
_ROUND = 0.8
"""Share of the points that must be on the surface."""
_FORM = 0.015
"""Of half the diagonal: points on the surface may be off it by no more (rms), however coarse the
mesh, unless noise explains it."""
_STEPS = 5.0
"""Steps of the mesh that half of the points may be off a surface of revolution, at most."""


@dataclass(frozen=True)
class Axis:
    """The axis of a surface of revolution."""

    point: Floats
    """(3,) mm: the point of it beside the middle of the surface."""
    direction: Floats
    """(3,) unit vector; the component that is largest is positive."""
    covariance: Floats
    """(4, 4) of tilt along e1 and e2 (radians) and shift along e1 and e2 (mm), at ``point``; e1, e2
    as `frame` gives them."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "point", frozen(self.point, (3,), "Axis.point"))
        put(self, "direction", frozen(self.direction, (3,), "Axis.direction"))
        put(self, "covariance", frozen(self.covariance, (4, 4), "Axis.covariance"))

    @property
    def tilt_sigma(self) -> float:
        """Standard uncertainty of its direction, radians (the worse of two tilts)."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def shift_sigma(self) -> float:
        """Standard uncertainty of its place beside ``point``, mm (the worse direction)."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[2:, 2:])[-1]))

    @property
    def basis(self) -> Floats:
        """(3, 3) rows: two directions across, and the axis; what turns the part's frame."""
        return np.stack([*frame(self.direction), self.direction])


@dataclass(frozen=True, eq=False)
class Turned:
    """The measured points of a part in the frame of its axis."""

    axis: Axis
    mesh: Mesh
    """The measured faces alone, the axis as z through the origin."""
    r: Floats
    """(v,) mm from the axis."""
    angle: Floats
    """(v,) radians about it."""
    z: Floats
    """(v,) mm along it."""
    normal: Floats
    """(v, 2) unit, outward in the half-plane: along r and z."""
    off: Floats
    """(v,) mm that each stands off the mean profile beside it, outside positive."""
    on: Bools
    """(v,) whether it is on the surface of revolution; else a handle, a keyway, an edge."""
    spacing: float
    """mm between neighbours."""
    sigma: float
    """mm: one standard deviation of the points on the surface about the mean profile."""
    moves: tuple[Floats, ...] = ()
    """(v, 2) mm each, along r and z: how the points move with one standard deviation of each
    common cause, such as the calibration."""

    @property
    def share(self) -> float:
        """Of the points, how many are on the surface of revolution."""
        return float(self.on.mean())


def turned_about(mesh: Mesh, moves: Iterable[Floats] = ()) -> Turned:
    """The best axis of a turned part, and its measured points about it.

    ``moves`` (v, 3) mm each are how all vertices move with one standard deviation of each common
    cause (`calibration_moves`). The uncertainty holds the scatter of the points, more where
    neighbours are off together, as out of round they are, and ``moves``.

    Raises InputError for a mesh without measured faces, and for a part that no axis, or more than
    one, fits: a sphere, a plate, a prism.
    """
    part, back = measured_part(mesh)
    ground = prepared(part, sigma_of(part), None, swept=True)
    fit = _Fit(part.vertices, ground.normals, ground.scale, ground.area)
    for h in _sizes(ground.size, ground.spacing):
        fit.settle(h)
    fit.check(ground.spacing)
    covariance = fit.covariance(ground.spacing)
    fields = [np.asarray(field)[back] for field in moves]
    for field in fields:
        answer = fit.answer(field)
        covariance = covariance + np.outer(answer, answer)
    axis = Axis(fit.point, fit.direction, covariance)
    moved = (part.vertices - axis.point) @ axis.basis.T
    own = Mesh(moved, part.faces, part.provenance)
    sigma = float(np.sqrt(np.mean(fit.e[fit.on] ** 2)))
    angle = np.arctan2(moved[:, 1], moved[:, 0])
    normal = _sharp_normals(own, fit, angle, _SHARP * ground.spacing)
    turn = [f @ axis.basis.T for f in fields]
    c, s = np.cos(angle), np.sin(angle)
    flat = tuple(np.column_stack([f[:, 0] * c + f[:, 1] * s, f[:, 2]]) for f in turn)
    return Turned(
        axis, own, fit.r, angle, fit.z, normal, fit.e, fit.on, ground.spacing, sigma, flat
    )


def _sharp_normals(mesh: Mesh, fit: _Fit, angle: Floats, h: float) -> Floats:
    """(v, 2) normals in the half-plane: means of those of the faces over places of ``h`` mm at all
    angles, which turn at an edge at once; smooth ones where a place has few points."""
    n = np.nan_to_num(vertex_normals(mesh))
    flat = np.column_stack([n[:, 0] * np.cos(angle) + n[:, 1] * np.sin(angle), n[:, 2]])
    at = np.column_stack([np.floor(fit.r / h), np.floor((fit.z - fit.z.min()) / h)]).astype(int)
    place = np.unique(at, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
    many = np.bincount(place)[place] >= _ENOUGH
    mean = _unit(_mean(flat, place, fit.on.astype(np.float64)))
    return np.where((many & (np.linalg.norm(mean, axis=1) > 0.5))[:, None], mean, fit.normal)


def _sizes(size: float, spacing: float) -> list[float]:
    """mm: sides of the profile's cells, coarse to fine, for an axis that is not yet known."""
    h, last = size / _COARSE, _FINE * spacing
    out = []
    while h > 1.5 * last:
        out.append(h)
        h /= 2
    return [*out, last]


class _Fit:
    """The adjustment of the axis; everything about it as it stands now."""

    def __init__(self, X: Floats, normals: Floats, scale: Floats, area: Floats) -> None:
        self.X, self.n, self.known = X, normals, 1.0 / scale**2
        self.point, self.direction = _first(X, normals, area)
        self.lever = float(np.linalg.norm(np.ptp(X, axis=0))) / 2
        self._look(self.lever)

    def settle(self, h: float) -> None:
        """Move the axis until it stays, with cells of ``h`` mm."""
        for _ in range(_ROUNDS):
            self._look(h)
            J, w = self.J, self.weight
            N = (J * w[:, None]).T @ J
            step = -np.linalg.lstsq(N, J.T @ (w * self.e), rcond=1e-12)[0]
            far = float(np.abs(step * [1, 1, 1 / self.lever, 1 / self.lever]).max())
            step *= min(1.0, 0.2 / max(far, 1e-300))
            e1, e2 = frame(self.direction)
            self.point = self.point + step[2] * e1 + step[3] * e2
            self.direction = self.direction + step[0] * e1 + step[1] * e2
            self.direction /= np.linalg.norm(self.direction)
            if far < 1e-9:
                break
        if self.direction[int(np.argmax(np.abs(self.direction)))] < 0:
            self.direction = -self.direction
        away = float((self.X.mean(axis=0) - self.point) @ self.direction)
        self.point = self.point + away * self.direction
        self._look(h)

    def _look(self, h: float) -> None:
        """Cells of the profile about the axis, deviations from them, and how the axis changes these
        (J: tilt along e1 and e2, shift along e1 and e2)."""
        e1, e2 = frame(self.direction)
        p = self.X - self.point
        x, y, self.z = p @ e1, p @ e2, p @ self.direction
        self.r = np.hypot(x, y)
        r = np.maximum(self.r, 1e-12)
        c, s = x / r, y / r
        radial = np.einsum("ij,ij->i", self.n, c[:, None] * e1 + s[:, None] * e2)
        m = np.column_stack([radial, self.n @ self.direction])
        m /= np.maximum(np.linalg.norm(m, axis=1), 1e-12)[:, None]
        cell = _cells(self.r, self.z, m, h)
        self.cell, self.normal = cell, _unit(_mean(m, cell, np.ones(len(m))))
        mr, mz = self.normal.T
        J = np.column_stack(
            [-mr * self.z * c + mz * x, -mr * self.z * s + mz * y, -mr * c, -mr * s]
        )
        lone = (np.bincount(cell)[cell] < _LEAST) | _one_sided(cell, np.arctan2(y, x))
        self.weight = self.known
        for _ in range(2):  # what is not on the surface does not count
            some = np.maximum(self.weight, _FAINT * self.known)
            self.e = _demeaned((mr * self.r + mz * self.z)[:, None], cell, some)[:, 0]
            wide = 1.4826 * float(np.median(np.abs(self.e)))
            self.on = np.asarray((np.abs(self.e) <= _FAR * max(wide, 1e-9)) & ~lone)
            self.weight = np.where(self.on, self.known, 0.0)
        self.J = _demeaned(J, cell, self.weight)

    def check(self, spacing: float) -> None:
        """Raise InputError where this is no axis, or not the only one."""
        w = np.where(self.on, 1.0, 0.0)
        J = self.J * [1 / self.lever, 1 / self.lever, 1, 1]
        if not w.any():
            w = np.ones(len(w))
        size = np.sqrt(np.maximum(np.linalg.eigvalsh((J * w[:, None]).T @ J / w.sum()), 0.0))
        if size[0] < _OPEN * size[-1]:
            raise InputError(
                "the part has no axis that its surface determines: it looks alike about more than "
                "one, as a sphere or a plate does",
                hint="measure more of it, or find its shapes instead",
            )
        typical = float(np.median(np.abs(self.e)))
        share = float(self.on.mean())
        noise = 1.0 / float(np.sqrt(np.median(self.known)))
        rms = float(np.sqrt(np.mean(self.e[self.on] ** 2))) if self.on.any() else 0.0
        shaped = rms > max(_FORM * self.lever, _FAR * noise)
        if share < _ROUND or typical > _STEPS * spacing or shaped:
            raise InputError(
                f"not a turned part: {share:.0%} of its points lie on one surface of revolution, "
                f"half of all within {typical:.3g} mm",
                hint="find its shapes instead",
            )

    def covariance(self, spacing: float) -> Floats:
        """(4, 4) from the scatter of the points and what neighbours share of it."""
        on = np.flatnonzero(self.on)
        w, J = self.weight[on], self.J[on]
        self.inverse = np.linalg.inv((J * w[:, None]).T @ J)
        free = len(np.unique(self.cell[on])) + 4
        unit = max(1.0, float((w * self.e[on] ** 2).sum()) / max(len(on) - free, 1))
        side = 3.0 * spacing
        at = np.floor((self.X[on] - self.X.min(axis=0)) / side).astype(np.int64)
        place = np.unique(at, axis=0, return_inverse=True)[1].reshape(-1)
        unit *= clumping(self.e[on] * np.sqrt(w), place, 4)
        return np.asarray(self.inverse * unit)

    def answer(self, field: Floats) -> Floats:
        """(4,) what the axis does when all points move by ``field`` (v, 3) mm."""
        e1, e2 = frame(self.direction)
        p = self.X - self.point
        r = np.maximum(self.r, 1e-12)
        out = (p @ e1 / r)[:, None] * e1 + (p @ e2 / r)[:, None] * e2
        mr, mz = self.normal.T
        along = mr * np.einsum("ij,ij->i", out, field) + mz * (field @ self.direction)
        along = _demeaned(along[:, None], self.cell, self.weight)[:, 0]
        return np.asarray(-self.inverse @ (self.J.T @ (self.weight * along)))


def _first(X: Floats, n: Floats, area: Floats) -> tuple[Floats, Floats]:
    """A point and the direction of the line that the normals meet best."""
    middle = X.mean(axis=0)
    size = max(float(np.linalg.norm(np.ptp(X, axis=0))), 1e-12)
    moment = np.cross((X - middle) / size, n)
    rows = np.column_stack([n, moment]) * np.sqrt(area / area.sum())[:, None]
    N = rows.T @ rows
    inverse = np.linalg.pinv(N[:3, :3], rcond=1e-4, hermitian=True)
    S = N[3:, 3:] - N[3:, :3] @ inverse @ N[:3, 3:]
    direction = np.linalg.eigh((S + S.T) / 2)[1][:, 0]
    lever = -inverse @ N[:3, 3:] @ direction  # p × direction of a point p of the axis
    return middle + size * np.cross(direction, lever), direction


def _cells(r: Floats, z: Floats, m: Floats, h: float) -> Longs:
    """(v,) number of the cell of the half-plane, and of the normal's direction, of each point."""
    way = np.floor((np.arctan2(m[:, 1], m[:, 0]) / (2 * np.pi) + 0.5) * _WAYS).astype(np.int64)
    at = np.column_stack([np.floor(r / h), np.floor((z - z.min()) / h)]).astype(np.int64)
    keys = (at[:, 0] * (at[:, 1].max() + 1) + at[:, 1]) * (_WAYS + 1) + way
    return np.unique(keys, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _one_sided(cell: Longs, angle: Floats) -> Bools:
    """(v,) whether a cell is seen at far fewer angles than its points would fill, were they spread
    as those of the other cells are: a handle, the floor of a keyway, the side of a prism."""
    sector = (angle / (2 * np.pi) % 1.0 * _SECTORS).astype(np.int64) % _SECTORS
    pairs = np.unique(cell * _SECTORS + sector)
    seen = np.bincount(pairs // _SECTORS, minlength=int(cell.max()) + 1)
    count = np.bincount(cell)
    filled = seen / (1 - np.exp(-count / _SECTORS))
    usual = float(np.median(filled[cell]))
    return np.asarray((filled < _PART * usual)[cell])


def _mean(values: Floats, cell: Longs, weight: Floats) -> Floats:
    """(v, k) the weighted mean of each value's cell; 0 where nothing has weight."""
    whole = np.bincount(cell, weight)
    sums = np.column_stack([np.bincount(cell, weight * v) for v in values.T])
    return np.asarray((sums / np.where(whole > 0, whole, np.inf)[:, None])[cell])


def _demeaned(values: Floats, cell: Longs, weight: Floats) -> Floats:
    return np.asarray(values - _mean(values, cell, weight))


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=1), 1e-12)[:, None])
