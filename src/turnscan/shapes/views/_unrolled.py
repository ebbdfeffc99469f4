"""The surface about the rotation axis, unrolled: its radius over angle and height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError
from turnscan.mesh import Caster, Mesh, Provenance
from turnscan.shapes._section import Chain, crossed, plane_cut
from turnscan.shapes.views._split import split

_WIDEST = np.pi / 2
"""Radians: faces that span more hold the axis, and have no place."""
_COLUMNS = 480
_MOST_LEVELS = 14
_NOISES = 6.0
"""Standard deviations of the points that two levels are apart at the least."""
_FLAT_BAND, _FLAT_SHARE = 3.0, 0.1
"""A level is left out where this share of the surface lies within so many standard deviations of
it: there the noise would be drawn, not the part."""
_FEWEST, _SHORT = 8, 0.05
"""Points of a line, and share of the drawing's diagonal, below both of which it is a speck: on a
mesh of few and large faces a line of two points may run across all of the part."""
_SMOOTH, _MOST_OFF = 3.0, 3.0
"""Cells of the grid: over which the slope is taken, and by which noise may shift a line."""
_STEPS = (1.0, 2.0, 5.0)


@dataclass(frozen=True, eq=False)
class Relief:
    """The radius over the unrolled surface."""

    radius: float
    """mm: median radius; a place at the angle φ stands at x = radius · φ, φ from −π to π."""
    r: Floats
    """(h, w) mm: radius, NaN where there is no surface; the first row is the lowest."""
    box: Floats
    """(2, 2) mm: where the grid begins and ends in the drawing."""
    noise: float
    """mm: median standard deviation of the points; NaN where not known."""
    step: float
    """mm between two levels; 0 where there is none."""
    levels: Floats
    """(n,) mm: the radius on each chain of the drawing."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "r", frozen(self.r, (None, None), "Relief.r", nan=True))
        put(self, "box", frozen(self.box, (2, 2), "Relief.box"))
        put(self, "levels", frozen(self.levels, (None,), "Relief.levels"))


def unrolled(mesh: Mesh) -> tuple[list[Chain], Relief]:
    """Lines of equal radius about the z axis in a drawing of radius · φ over z, and the relief.

    Only faces that look away from the axis count, so of a cup the outside; where the surface lies
    over itself, the grid has the outermost. Levels are round numbers no nearer to each other than
    the noise allows. Raises InputError for a mesh without faces, and where nothing looks outward.
    """
    if not len(mesh.faces):
        raise InputError("the mesh has no faces to unroll", hint="give a surface, not points")
    flat, radius = _flat(mesh)
    r = flat.vertices[:, 2]
    noise = float("nan")
    if flat.provenance is not None and np.isfinite(flat.provenance.sigma).any():
        noise = float(np.nanmedian(flat.provenance.sigma))
    half = np.pi * radius
    low, high = float(flat.vertices[:, 1].min()), float(flat.vertices[:, 1].max())
    box = np.array([[-half, low], [half, high]])
    grid = _grid(flat, box, float(r.max()))
    step, levels = _levels(flat, noise)
    sure = _Sure(grid, box, noise)
    least = _SHORT * float(np.hypot(*(box[1] - box[0])))
    chains, at = list[Chain](), list[float]()
    for level in levels:
        cut = plane_cut([0.0, 0.0, 1.0], float(level), "level")
        some = [
            c
            for c in crossed(flat, cut)
            if (len(c.points) >= _FEWEST or c.length >= least) and sure(c)
        ]
        chains += some
        at += [float(level)] * len(some)
    return chains, Relief(radius, grid, box, noise, step if at else 0.0, np.array(at))


class _Sure:
    """Whether the slope of the surface says where a line of equal radius runs, or the noise."""

    def __init__(self, grid: Floats, box: Floats, noise: float) -> None:
        from scipy.ndimage import gaussian_filter

        known = np.isfinite(grid)
        weight = np.maximum(gaussian_filter(known.astype(float), _SMOOTH), 1e-9)
        smooth = gaussian_filter(np.where(known, grid, 0.0), _SMOOTH) / weight
        self._cell = (box[1] - box[0]) / grid.shape[::-1]
        along_z, along_phi = np.gradient(smooth, self._cell[1], self._cell[0])
        self._slope, self._low = np.hypot(along_z, along_phi), box[0]
        self._noise = noise if np.isfinite(noise) else 0.0

    def __call__(self, chain: Chain) -> bool:
        rows, columns = self._slope.shape
        at = ((chain.points - self._low) / self._cell).astype(int)
        slope = self._slope[np.clip(at[:, 1], 0, rows - 1), np.mod(at[:, 0], columns)]
        return bool(self._noise <= _MOST_OFF * self._cell[0] * float(np.median(slope)))


def _flat(mesh: Mesh) -> tuple[Mesh, float]:
    """The part of the surface that looks outward, its vertices at (radius · φ, z, r); the radius.

    A face across the seam stands on its right side; vertices are those of the faces, once more for
    faces across the seam.
    """
    t = mesh.triangles
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, :2]
    some = np.flatnonzero(((t[:, :, :2] * normal[:, None]).sum(axis=2) > 0).any(axis=1))
    if not len(some):
        raise _no_outside()
    fine = split(mesh.vertices, mesh.faces[some].astype(np.int64))
    x, y = fine.points[:, :2].T
    r, phi = np.hypot(x, y), np.arctan2(y, x)
    spread = phi[fine.faces]
    over = (np.ptp(spread, axis=1) > np.pi)[:, None] & (spread < 0)
    spread = np.where(over, spread + 2 * np.pi, spread)
    middle = fine.points[fine.faces, :2].mean(axis=1)
    out = (middle * normal[some][fine.face]).sum(axis=1) > 0
    keep = out & (np.ptp(spread, axis=1) < _WIDEST)
    if not keep.any():
        raise _no_outside()
    radius = float(np.median(r[np.unique(fine.faces[keep])]))
    used, faces = np.unique(fine.faces[keep] + np.where(over[keep], len(r), 0), return_inverse=True)
    at, of = used % len(r), fine.of[used % len(r)]
    turned = phi[at] + np.where(used >= len(r), 2 * np.pi, 0.0)
    points = np.column_stack([radius * turned, fine.points[at, 2], r[at]])
    known = mesh.provenance
    origin = None if known is None else Provenance(
        known.sigma[of], known.laser[of], known.step[of], known.line[of], known.lasers
    )  # fmt: skip
    measured = None if mesh.measured is None else mesh.measured[some[fine.face[keep]]]
    return Mesh(points, faces.reshape(-1, 3).astype(np.int32), origin, None, measured), radius


def _no_outside() -> InputError:
    return InputError("nothing of the part looks away from the z axis, about which it is unrolled",
                      hint="move the part onto the axis")  # fmt: skip


def _levels(flat: Mesh, noise: float) -> tuple[float, Floats]:
    """How far levels are apart, and which there are."""
    r = flat.vertices[:, 2]
    low, high = np.percentile(r, [0.5, 99.5])
    known = noise if np.isfinite(noise) else 0.0
    least = max((high - low) / _MOST_LEVELS, _NOISES * known)
    if not high - low > max(_NOISES * known, 1e-6 * high):
        return 0.0, np.zeros(0)
    unit = 10.0 ** np.floor(np.log10(least))
    step = float(next(k for k in (*_STEPS, 10.0) if k * unit >= least * (1 - 1e-9)) * unit)
    band = max(_FLAT_BAND * known, 1e-3 * step)
    every = step * np.arange(np.ceil((low + band) / step), np.floor((high - band) / step) + 1)
    kept = [level for level in every if not _mostly(np.abs(r - level) < band)]
    return step, np.array(kept)


def _mostly(on: Bools) -> bool:
    return bool(on.mean() > _FLAT_SHARE)


def _grid(flat: Mesh, box: Floats, top: float) -> Floats:
    """(h, w) mm: radius at the middles of cells of the same width and height."""
    width, height = box[1] - box[0]
    rows = int(np.clip(np.round(_COLUMNS * height / width), 2, 2 * _COLUMNS))
    x = box[0, 0] + (np.arange(_COLUMNS) + 0.5) / _COLUMNS * width
    y = box[0, 1] + (np.arange(rows) + 0.5) / rows * height
    X, Y = np.meshgrid(x, y)
    # Faces across the seam stand on the right; the left edge looks them up there.
    r = np.full((rows, _COLUMNS), np.nan)
    caster = Caster(flat.vertices, flat.faces)
    for shift in (0.0, width):
        at = np.stack([X.ravel() + shift, Y.ravel(), np.full(X.size, top + 1.0)], axis=1)
        hit = caster.first_hits_between(at, np.broadcast_to([0.0, 0.0, -1.0], at.shape))
        found = _over(flat, hit, at).reshape(r.shape)
        r = np.fmax(r, found)
    return r


def _over(flat: Mesh, hit: Ints, at: Floats) -> Floats:
    """(n,) the height of the face that each ray met, over its place; NaN for none."""
    t = flat.triangles[np.maximum(hit, 0)]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    up = np.where(np.abs(normal[:, 2]) > 0, normal[:, 2], 1.0)
    z = t[:, 0, 2] - ((at - t[:, 0])[:, :2] * normal[:, :2]).sum(axis=1) / up
    low, high = t[:, :, 2].min(axis=1), t[:, :, 2].max(axis=1)
    return np.where(hit >= 0, np.clip(z, low, high), np.nan)
