"""A mesh prepared for the search of shapes: its neighbours, and how well each vertex is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.mesh import Mesh, measured_vertices, submesh, vector_areas, vertex_normals
from turnscan.shapes.primitives import _region_kernels as region

Index = npt.NDArray[np.int64]
LIMIT = 3.0
"""Standard deviations that a point may be off its surface."""
_CURVED = (1.2, 1.7)
"""Vertices that scatter so many times as much with the curvature as without it lie close together
on the surface, and so many times as far apart: then the curvature is no noise. Between the two, a
part of it is."""
_LINES, _LONG, _ENOUGH = 2000, (10, 20), 50
"""Lines of vertices that noise is asked of, about; vertices on each, in turn; and how many lines
must go on so far, straight over the mesh."""
_CALMED = 2
"""Means over neighbours, of which each leaves a third of the noise, after which lines go on."""
_BENDS = 3.0
"""Times as much that a longer line stands off where the surface bends; noise that neighbours share
gives up to 2.2."""
_FOLLOWED = 1.3
"""Noise of points over what lines of them stand off their cubics, which follow some of it. Points
of simulated planes, cylinders and tori miss these by 1.1 to 1.5 times as much."""
_ROUGHEST = 1 / 300
"""Of the size of a part: more noise than this, of which no sigma is known, is none."""
_TWICE = 1.2582
"""Deviation of independent noise less the mean of its neighbours, taken twice, over once."""
TURN = float(np.cos(np.radians(25.0)))
"""Between the normal of the surface and the smooth normal of the mesh."""
_AVERAGED, _TOGETHER = 1.4, (4.0, 16.0)
"""Usual sigmas over the noise between neighbours from which points are off together, as they are
where several lasers were merged; and so many at the least then, and at the most."""
_CALM = 0.10
"""Radians that a smooth normal may be uncertain by."""
_DOUBTFUL = 2.5
"""Medians of sigma beyond which a point may be doubtful, its stripe cut or bent by an edge, and how
many times worse than others about it such a point is known."""
_ABOUT, _MIXED = 60, 0.25
"""Vertices about a point that its sigma is compared with, and the share of them that is known so
much better where an edge is the cause: a whole face that is known worse has none."""


@dataclass(frozen=True)
class Ground:
    """A mesh prepared for growing."""

    vertices: Floats
    """(v, 3) mm."""
    normals: Floats
    """(v, 3) smooth, outward."""
    start: Index
    near: npt.NDArray[np.int32]
    """Neighbours, near[start[i]:start[i + 1]]."""
    border: Bools
    """(v,) beside an open border of what was measured."""
    scale: Floats
    """(v,) mm: one standard deviation of each vertex."""
    limit: Floats
    """(v,) mm: how far each may lie off its surface."""
    firm: Bools
    """(v,) False where a point is doubtful; what is said of a region rests on the others."""
    area: Floats
    """(v,) mm² that belongs to each."""
    turn: Floats
    """(v,) how far smooth normals turn to the neighbours, 1 − cos."""
    off: Floats
    """(v,) mm: how far each stands off the mean of its neighbours, scaled to its noise."""
    spacing: float
    """mm between neighbours."""
    stripe: Index | None
    """(v,) number of the stripe that measured each; None where not known."""
    along: Index | None
    """(v,) place of each in the order of stripes and of the lines on them; None as for stripes."""
    stripes: int
    """How many there are."""
    usual: float
    """mm: the median of ``scale``."""
    noise: float
    """mm: of a point, with what neighbours share, as lines of them show it; no more than usual, for
    lines across a coarse turn bend."""

    size: float
    """mm: diagonal of the box around it."""
    together: float
    """Neighbours that are off together, about, as a merge leaves them that averages; 1 for none."""
    blind: bool
    """Whether no sigma tells which points an edge has bent or cut."""

    @property
    def neighbourhood(self) -> region.Neighbourhood:
        """What the kernels of growing take of it."""
        return region.Neighbourhood(self.vertices, self.normals, self.limit, self.start, self.near)


def measured_part(mesh: Mesh) -> tuple[Mesh, Index]:
    """The faces of a mesh that were measured as a mesh, and which vertex (k,) each of its vertices
    was. Raises InputError where there are none."""
    if not len(mesh.faces):
        raise InputError("the mesh has no faces", hint="give a surface, not a cloud of points")
    seen = measured_vertices(mesh)
    whole = np.asarray(seen[mesh.faces].all(axis=1), dtype=np.bool_)
    if not whole.any():
        raise InputError("no face was measured", hint="give a mesh with measured faces")
    inside = np.zeros(len(mesh.vertices), dtype=np.bool_)
    inside[mesh.faces[whole]] = True
    part = mesh if whole.all() and inside.all() else submesh(mesh, whole)
    return part, np.flatnonzero(inside)


def sigma_of(mesh: Mesh) -> Floats | None:
    """(v,) mm, the median where a vertex does not know its own; None where none does."""
    if mesh.provenance is None:
        return None
    sigma = mesh.provenance.sigma
    good = np.isfinite(sigma) & (sigma > 0)
    if not good.any():
        return None
    return np.where(good, sigma, float(np.median(sigma[good])))


def prepared(
    mesh: Mesh, sigma: Floats | None, tolerance: float | None, swept: bool = False
) -> Ground:
    """A mesh ready for growing; ``sigma`` (v,) mm of its points, ``tolerance`` mm if given.

    ``swept`` for a search that averages over places some neighbours wide: what the surface does
    between neighbours counts as noise then, for it moves such means. Without it the axis of a wall
    that is seen in part claims a third of what it is off by.
    """
    X = mesh.vertices
    start, near = region.neighbours(mesh.faces, len(X))
    raw = np.nan_to_num(vertex_normals(mesh))
    tail = np.repeat(np.arange(len(X)), np.diff(start))
    steps = np.linalg.norm(X[tail] - X[near], axis=1)
    spacing = float(np.median(steps)) if len(steps) else 0.0
    rounds = _rounds_for(raw, tail, near)
    normals = region.smoothed(raw, start, near, rounds)
    off, turn = region.scatter(X, normals, start, near)
    size = float(np.linalg.norm(np.ptp(X, axis=0)))
    if sigma is not None or not swept:
        off = _less_curved(off, tail, near)
    lines = (math.nan, math.nan) if swept else _along_lines(X, normals, start, near)
    off, noise, alone = _noise(off, lines, sigma is None and not swept, _ROUGHEST * size)
    noise, alone = max(noise, 1e-5 * size), max(alone, 1e-5 * size)
    scale = np.full(len(X), alone) if sigma is None else np.maximum(sigma, noise)
    floor = max(LIMIT * noise, 1e-4 * size)
    limit = np.full(len(X), tolerance) if tolerance else np.maximum(LIMIT * scale, floor)
    if tolerance:
        scale = np.minimum(scale, tolerance / LIMIT)
    firm = _firm(scale, region.Neighbourhood(X, normals, limit, start, near))
    faces = np.linalg.norm(vector_areas(mesh.triangles), axis=1) / 3
    area = np.bincount(mesh.faces.ravel(), np.repeat(faces, 3), minlength=len(X)).astype(float)
    many = np.bincount(mesh.faces.ravel(), minlength=len(X))
    border = np.diff(start) > many
    stripe, along = _stripe_numbers(mesh), None
    if stripe is not None and mesh.provenance is not None:
        along = np.empty(len(X), dtype=np.int64)
        along[np.lexsort((mesh.provenance.line, stripe))] = np.arange(len(X))
    usual = float(np.median(scale)) if len(scale) else 0.0
    return Ground(
        X, normals, start, near, border, scale, limit, firm, area, turn, off, spacing,
        stripe, along, 0 if stripe is None else len(np.unique(stripe)),
        usual, min(alone, usual), size, _together(scale, noise), sigma is None,
    )  # fmt: skip


def _usual(off: Floats) -> float:
    """mm: the noise of vertices that stand (v,) off the mean of their neighbours."""
    seen = np.abs(off[off != 0.0])
    return 1.4826 * float(np.median(seen)) if len(seen) else 0.0


def _along_lines(
    X: Floats, normals: Floats, start: Index, near: npt.NDArray[np.int32]
) -> tuple[float, float]:
    """mm: the noise that lines of neighbours have about smooth ones, and as much of it as is surely
    noise; NaN where there are too few.

    Neighbours on a line lie closer than those across it where the turn is coarse, so that a cubic
    takes what the surface does; and noise that a few neighbours share is seen, too. What stands off
    far more than a line of half its length may bend as no cubic does.
    """
    seeds = np.arange(0, len(X), max(1, len(X) // _LINES))
    calm, known = region.calmed(X, start, near, _CALMED), list[float]()
    for many in _LONG:
        off = region.off_lines(seeds, many, X, calm, normals, start, near)
        off = off[np.isfinite(off)]
        if len(off) < _ENOUGH:
            return math.nan, math.nan
        known.append(_FOLLOWED * float(np.median(off)))
    short, long = known
    return long, long if long <= _BENDS * short else short


def _noise(
    off: Floats, lines: tuple[float, float], unknown: bool, roughest: float
) -> tuple[Floats, float, float]:
    """What vertices stand off their neighbours (v,) mm, the noise that these differ by, and all of
    it; ``lines`` have so much of it, and surely so much (`_along_lines`).

    What neighbours differ by beyond that is what the surface does between them. Where sigma is
    ``unknown`` each counts as if neighbours shared none of theirs; nowhere more than in the middle:
    what is rougher may be freeform as well, and nothing tells. More than ``roughest`` mm is the
    form of a part then, whose rows lie too far apart to follow it.
    """
    noise = _usual(off)
    most, sure = lines
    if most < noise:
        off, noise = off * (most / noise), most
    alone = noise if math.isnan(sure) else max(noise, sure)
    if unknown and noise > roughest:
        off, noise = off * (roughest / noise), roughest
    if unknown:
        alone = min(alone, roughest)
        middle = alone / 1.4826
        off = np.clip(off * (alone / max(noise, 1e-300)), -middle, middle)
    return off, noise, alone


def _less_curved(off: Floats, tail: Index, near: npt.NDArray[np.int32]) -> Floats:
    """(v,) How vertices stand off the mean of their neighbours, with as much of the curvature taken
    off as these are far apart on the surface."""
    flat = _without_curvature(off, tail, near)
    ratio = _usual(off) / max(_usual(flat), 1e-300)
    share = float(np.clip((ratio - _CURVED[0]) / (_CURVED[1] - _CURVED[0]), 0.0, 1.0))
    return np.asarray(off + share * (flat - off))


def _without_curvature(off: Floats, tail: Index, near: npt.NDArray[np.int32]) -> Floats:
    """(v,) How vertices stand off the mean of their neighbours, less what these do: between the
    profiles of a coarse turn all of a curved surface does. Scaled to one standard deviation of
    independent noise, on a mesh of six neighbours."""
    many = np.bincount(tail, minlength=len(off))
    mean = np.bincount(tail, off[near], minlength=len(off)) / np.maximum(many, 1)
    return np.asarray(np.where(off == 0.0, 0.0, (off - mean) / _TWICE))


def _together(scale: Floats, noise: float) -> float:
    """How many neighbours are off together: these differ by less than each of them is off."""
    share = float(np.median(scale)) / noise if len(scale) else 1.0
    return float(np.clip(share * share, *_TOGETHER)) if share > _AVERAGED else 1.0


def _stripe_numbers(mesh: Mesh) -> Index | None:
    known = mesh.provenance
    if known is None or not (known.step >= 0).any():
        return None
    return known.step.astype(np.int64) * (len(known.lasers) + 1) + known.laser


def _firm(scale: Floats, ground: region.Neighbourhood) -> Bools:
    """(v,) False where a point is known worse than most of the part and than others about it."""
    if not len(scale):
        return np.ones(0, dtype=np.bool_)
    firm = np.asarray(scale <= _DOUBTFUL * float(np.median(scale)), dtype=np.bool_)
    worse = np.flatnonzero(~firm)
    share = region.better_about(worse, scale / _DOUBTFUL, scale, ground, _ABOUT, TURN)
    firm[worse] = share < _MIXED
    return firm


def _rounds_for(raw: Floats, tail: Index, near: npt.NDArray[np.int32]) -> int:
    """Rounds of smoothing after which normals are calm: k rounds average about 3 k² of them."""
    if not len(tail):
        return 0
    dots = np.einsum("ij,ij->i", raw[tail[::7]], raw[near[::7]])
    angle = float(np.median(np.arccos(np.clip(dots, -1, 1))))
    return int(np.clip(np.ceil(angle / _CALM), 1, 8))
