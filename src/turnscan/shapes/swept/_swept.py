"""Surfaces of revolution and extrusions among what no simpler shape describes.

Each connected piece of freeform surface, without the rings beside the shapes around it, is taken
for either. The axis of a revolution is that of `turned_about`. The direction of an extrusion is
first the one that the normals are most square to, and then moves until points that it puts on one
place of the profile lie on one line there: least squares with a line of its own for each place. A
piece is swept where it misses its profile by hardly more than neighbours differ among themselves,
and where the means of small cells show no pattern, as shapes are told from freeform surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.errors import InputError
from turnscan.mesh import Mesh, components, measured, submesh
from turnscan.shapes.primitives import ShapeSet
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives._ground import Ground, prepared, sigma_of
from turnscan.shapes.primitives._surface_kernels import frame
from turnscan.shapes.revolved import turned_about
from turnscan.shapes.verification._statistics import clumping

SweptKind = Literal["surface of revolution", "extrusion"]
_POINTS, _SMALLEST = 500, 0.02
"""Points that a piece must have, and share of the measured surface."""
_RIM = 3
"""Rings of vertices beside shapes and open borders that do not count: stripes are bent there."""
_EXCESS, _PATTERN = 0.22, 0.15
"""Of the limit of three standard deviations: by how much points may miss the profile beyond what
neighbours say is noise, and the means of small cells (rms), as for shapes."""
_CELL, _PLACE = 25, 2.0
"""Points of such a cell, about; and steps of the mesh that a place of a profile is wide."""
_ON = 0.9
"""Share of the points that must lie on it."""
_LONG = 6.0
"""Steps of the mesh that an extrusion reaches, at least."""
_WIDE = float(np.radians(30.0))
"""Angle that the normals must span across the sweep, else the piece is nearly a plane."""
_SQUARE = 0.12
"""How far from square to the direction of an extrusion normals may be at first, rms."""
_MEET = 0.15
"""How far, of the size, normals may pass the axis of a revolution, rms."""
_STEPS = 12
"""Of the search for the direction."""


@dataclass(frozen=True)
class Swept:
    """A piece of surface with one profile all along."""

    kind: SweptKind
    point: Floats
    """(3,) mm: of the axis; of an extrusion the middle of the piece."""
    axis: Floats
    """(3,) unit vector: the axis, or the direction that the profile is drawn along."""
    axis_sigma: float
    """Radians: standard uncertainty of its direction."""
    shift_sigma: float
    """mm: of the place of the axis; 0 of an extrusion, which has none."""
    count: int
    area: float
    """mm² of measured surface, without the rings beside other shapes."""
    rms: float
    """mm: root mean square distance of its points from the profile."""
    length: float
    """mm that it reaches along the axis."""
    vertices: Longs
    """(n,) index of its vertices."""


def find_swept(mesh: Mesh, found: ShapeSet, moves: Sequence[Floats] = ()) -> tuple[Swept, ...]:
    """The freeform pieces of a mesh that are swept, the largest first.

    ``found`` are its shapes, ``moves`` as for them: (v, 3) mm each.
    """
    free = (found.label[mesh.faces] < 0).all(axis=1) & measured(mesh)
    least = _SMALLEST * mesh.area_of(measured(mesh))
    free = _without_rims(mesh, free)
    pieces = np.full(len(free), -1, dtype=np.int64)
    if free.any():
        pieces[free] = components(Mesh(mesh.vertices, mesh.faces[free]))
    out = list[Swept]()
    for k in range(int(pieces.max(initial=-1)) + 1):
        own = pieces == k
        if mesh.area_of(own) < least or own.sum() < _POINTS:
            continue
        one = _of_piece(mesh, own, moves)
        if one is not None:
            out.append(one)
    return tuple(sorted(out, key=lambda s: -s.area))


def _without_rims(mesh: Mesh, free: Bools) -> Bools:
    """(f,) the free faces that are some rings away from all others."""
    inside = np.zeros(len(mesh.vertices), dtype=np.bool_)
    inside[mesh.faces[free]] = True
    inside[mesh.faces[~free]] = False
    start, near = region.neighbours(mesh.faces, len(mesh.vertices))
    many = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    border = np.diff(start) > many
    core = region.eroded(inside & ~border, start, near, np.zeros_like(border), _RIM)
    return np.asarray(free & core[mesh.faces].all(axis=1))


def _of_piece(mesh: Mesh, own: Bools, moves: Sequence[Floats]) -> Swept | None:
    used = np.zeros(len(mesh.vertices), dtype=np.bool_)
    used[mesh.faces[own]] = True
    vertices = np.flatnonzero(used).astype(np.int64)
    piece = submesh(mesh, own)
    ground = prepared(piece, sigma_of(piece), None, swept=True)
    fields = [np.asarray(move)[vertices] for move in moves]
    return _turned(piece, ground, vertices, fields) or _extruded(ground, vertices, fields)


def _turned(piece: Mesh, g: Ground, vertices: Longs, fields: Sequence[Floats]) -> Swept | None:
    """The piece as a surface of revolution."""
    if not _may_turn(g):
        return None
    try:
        t = turned_about(Mesh(piece.vertices, piece.faces, piece.provenance), fields)
    except (InputError, np.linalg.LinAlgError):
        return None
    if t.share < _ON or not _noise_only(g, t.off, t.on):
        return None
    around = np.unique((t.angle[t.on] / (2 * np.pi) % 1.0 * 36).astype(np.int64))
    if len(around) / 36 * 2 * np.pi < _WIDE:
        return None
    return Swept(
        "surface of revolution", t.axis.point, t.axis.direction, t.axis.tilt_sigma,
        t.axis.shift_sigma, int(t.on.sum()), float(g.area.sum()), t.sigma,
        float(np.ptp(t.z)), vertices,
    )  # fmt: skip


def _may_turn(g: Ground) -> bool:
    """Whether one line meets all normals, about: a quick look before the search for the axis."""
    X = (g.vertices - g.vertices.mean(axis=0)) / max(g.size, 1e-12)
    rows = np.column_stack([g.normals, np.cross(X, g.normals)])
    N = rows.T @ rows / len(rows)
    inverse = np.linalg.pinv(N[:3, :3], rcond=1e-4, hermitian=True)
    S = N[3:, 3:] - N[3:, :3] @ inverse @ N[:3, 3:]
    return bool(np.linalg.eigvalsh((S + S.T) / 2)[0] < _MEET**2)


def _noise_only(g: Ground, off: Floats, on: Bools) -> bool:
    """Whether points miss a profile by noise: beyond it neither each by itself nor in cells."""
    seen = np.abs(g.off[on & (g.off != 0.0)])
    noise = 1.4826 * float(np.median(seen)) if len(seen) else 0.0
    limit = float(np.median(g.limit[on]))
    excess = float(np.mean(off[on] ** 2)) - noise**2
    if excess > (_EXCESS * limit) ** 2:
        return False
    side = g.spacing * np.sqrt(_CELL)
    at = np.floor((g.vertices[on] - g.vertices.min(axis=0)) / max(side, 1e-9)).astype(np.int64)
    cell = np.unique(at, axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(cell)
    mean = np.bincount(cell, off[on]) / count
    some = count >= _CELL // 2
    pattern = float(np.mean(mean[some] ** 2 - noise**2 / count[some])) if some.any() else np.inf
    return pattern <= (_PATTERN * limit) ** 2


def _extruded(g: Ground, vertices: Longs, fields: Sequence[Floats]) -> Swept | None:
    """The piece as an extrusion."""
    n = g.normals
    values, axes = np.linalg.eigh(n.T @ n / len(n))
    if values[0] > _SQUARE**2:
        return None
    way = axes[:, 0] * np.sign(axes[int(np.abs(axes[:, 0]).argmax()), 0])
    middle = g.vertices.mean(axis=0)
    X = g.vertices - middle
    fit = _profile(X, n, way, g.spacing)
    for _ in range(_STEPS):
        step = -np.linalg.lstsq(fit.J[fit.on], fit.off[fit.on], rcond=None)[0]
        way = way + step @ np.stack(frame(way))
        way /= np.linalg.norm(way)
        fit = _profile(X, n, way, g.spacing)
        if float(np.abs(step).max()) < 1e-7:
            break
    length = float(np.ptp(X @ way))
    flat = np.sort(np.arctan2(*(np.stack(frame(way)) @ n[fit.on].T)))
    gaps = np.diff(np.append(flat, flat[0] + 2 * np.pi))
    if length < _LONG * g.spacing or 2 * np.pi - float(gaps.max()) < _WIDE:
        return None
    if fit.on.mean() < _ON or not _noise_only(g, fit.off, fit.on):
        return None
    J, off = fit.J[fit.on], fit.off[fit.on]
    inverse = np.linalg.inv(J.T @ J)
    C = inverse * float(np.mean(off**2)) * _shared(g, fit.on, fit.off)
    for field in fields:
        along = np.einsum("ij,ij->i", n, field)[fit.on]
        answer = inverse @ (J.T @ _in_places(along, fit.place[fit.on], fit.rows[fit.on]))
        C = C + np.outer(answer, answer)
    return Swept(
        "extrusion", middle, way, float(np.sqrt(np.linalg.eigvalsh(C)[-1])), 0.0,
        int(fit.on.sum()), float(g.area.sum()), float(np.sqrt(np.mean(off**2))), length, vertices,
    )  # fmt: skip


@dataclass(frozen=True)
class _Profile:
    off: Floats
    """(n,) mm off the line of each point's place."""
    on: Bools
    place: Ints
    rows: Floats
    """(n, 1) where each is along the line of its place."""
    J: Floats
    """(n, 2) how turns of the direction change `off`."""


def _profile(X: Floats, n: Floats, way: Floats, spacing: float) -> _Profile:
    """Points (n, 3) along a direction on their profile, which is a line in each of its places."""
    across = np.stack(frame(way))
    flat, z = X @ across.T, X @ way
    m = n @ across.T
    m = m / np.maximum(np.linalg.norm(m, axis=1), 1e-12)[:, None]
    looks = np.floor((np.arctan2(m[:, 1], m[:, 0]) / (2 * np.pi) + 0.5) * 12).astype(np.int64)
    at = np.floor((flat - flat.min(axis=0)) / (_PLACE * spacing)).astype(np.int64)
    keys = (at[:, 0] * (at[:, 1].max() + 1) + at[:, 1]) * 13 + looks
    place = np.asarray(np.unique(keys, return_inverse=True)[1].ravel(), dtype=np.int32)
    count = np.bincount(place)
    mean = np.column_stack([np.bincount(place, v) for v in m.T])
    own = (mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None])[place]
    rows = (flat[:, 1] * own[:, 0] - flat[:, 0] * own[:, 1])[:, None]
    off = _in_places(np.einsum("ij,ij->i", flat, own), place, rows)
    J = np.column_stack([_in_places(-z * own[:, k], place, rows) for k in range(2)])
    wide = 1.4826 * float(np.median(np.abs(off)))
    on = (np.abs(off) <= 4.0 * max(wide, 1e-9)) & (count[place] >= 6)
    return _Profile(off, np.asarray(on), place, rows, J)


def _in_places(value: Floats, place: Ints, rows: Floats) -> Floats:
    """(n,) values less the line through those of their place, along it."""
    count = np.maximum(np.bincount(place), 1)
    x = rows[:, 0] - (np.bincount(place, rows[:, 0]) / count)[place]
    y = value - (np.bincount(place, value) / count)[place]
    square = np.bincount(place, x * x)
    slope = np.bincount(place, x * y) / np.where(square > 0, square, np.inf)
    return np.asarray(y - slope[place] * x)


def _shared(g: Ground, on: Bools, off: Floats) -> float:
    """How many times more the direction is unsure as neighbours are off together."""
    at = np.floor((g.vertices[on] - g.vertices.min(axis=0)) / (3.0 * g.spacing)).astype(np.int64)
    place = np.unique(at, axis=0, return_inverse=True)[1].ravel()
    return clumping(off[on], place, 2)
