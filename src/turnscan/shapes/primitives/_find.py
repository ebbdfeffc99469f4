"""The shapes of a mesh: regions grown, merged, continued, settled, fitted together, related."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._budget import Budget
from turnscan.shapes.primitives._ground import Ground, Index, measured_part, prepared, sigma_of
from turnscan.shapes.primitives._judged import LEAST, WAVY, bent, close, poor, waves, wide
from turnscan.shapes.primitives._region import Region, refit
from turnscan.shapes.primitives._regions import continued, grow_regions, merged
from turnscan.shapes.primitives._relations import adopt
from turnscan.shapes.primitives._shapes import KINDS, Shape, ShapeSet
from turnscan.shapes.primitives._surface_kernels import CYLINDER, FREE, PLANE, SPHERE

_MOST_POINTS = 40_000
_STEPS = 30
_EDGE, _KEEP = 2, 0.4
"""Rings of vertices at the end of a region that do not count, for stripes are bent beside edges,
and the share of it that must be left without them, else they stay."""
_BEVEL = 0.1
"""The same share of a plane on a merged mesh that is known badly: bevels have none."""
_RIM, _LEFT = 3, 0.2
"""The same once more, and at open borders, too, where a region would else miss its surface by more
than noise: beside the walls of a keyway, and where its floor goes into their shadow."""
_ALONG = float(np.cos(np.radians(15.0)))
"""Between normals of surfaces that run into each other without an edge."""
_SURE = 0.1
"""A radius whose standard uncertainty is more of it than this is none, nor is a plane that may lean
by so many radians: the tip of a tooth that two bent stripes and two others show."""


def find_shapes(
    mesh: Mesh,
    *,
    tolerance: float | None = None,
    smallest: float = 0.003,
    most: int = 100,
    relations: bool = True,
    moves: Iterable[Floats] = (),
) -> ShapeSet:
    """Planes, spheres, cylinders, cones and tori that the measured part of a mesh lies on.

    Regions grow from the flattest places; a region of freeform surface is told from a shape by the
    pattern of its misfit (`_judged`). Regions of one surface are joined, vertices between two
    shapes go to the nearer one, and each shape is fitted to its vertices (orthogonal distances,
    truncated at four standard deviations) without two rings at its edges. Vertices that nobody
    measured do not count and belong to no shape.

    ``tolerance`` mm is how far a vertex may lie off its shape; None takes three standard deviations
    of its noise, at least 1/10000 of the size. ``smallest`` is the least area of a shape as a part
    of the measured surface, ``most`` their number. ``relations`` False leaves each shape as it was
    measured. ``moves`` are (v, 3) mm each: how all vertices move with one standard deviation of
    each common cause (`calibration_moves`).

    Uncertainties: from each point's sigma, or its scatter where that is larger; more where
    neighbours are off together; and from ``moves``.

    Raises InputError for a mesh without measured faces.
    """
    part, back = measured_part(mesh)
    ground = prepared(part, sigma_of(part), tolerance)
    total = float(ground.area.sum())
    found = merged(ground, grow_regions(ground, smallest * total, most))
    found = continued(ground, found, smallest * total)
    found, label = _kept(ground, found)
    fields = [np.asarray(m)[back] for m in moves]
    return _finished(ground, found, label, fields, relations, back, len(mesh.vertices))


def _kept(g: Ground, found: list[Region]) -> tuple[list[Region], Index]:
    """Regions that are shapes as far as their own vertices say, and the label of each vertex.

    What is refused gives its vertices back, and the others share them out anew: a band of bent
    stripes beside the wall of a keyway would else have taken some of its floor.
    """
    while True:
        label = _settled(g, found)
        owns = [np.flatnonzero(label == k) for k in range(len(found))]
        good = [
            int(g.firm[own].sum()) >= LEAST[r.kind]
            and wide(g, own)
            and not bent(g, own)
            and _broad(g, r, own)
            for r, own in zip(found, owns, strict=True)
        ]
        if all(good):
            return found, label
        found = [r for r, keep in zip(found, good, strict=True) if keep]


def _broad(g: Ground, r: Region, own: Index) -> bool:
    """Whether a region that is known badly is more than a band of its own edges: the edge of a part
    that the light rounds off lies on a cone. One that is known well may be a fillet. A plane may be
    narrow, but where a merge averages it rounds edges off to bevels that are all edge."""
    if not poor(g, own) or (r.kind == PLANE and g.together == 1.0):
        return True
    member = np.zeros(len(g.vertices), dtype=np.bool_)
    member[own] = True
    core = region.eroded(member, g.start, g.near, np.zeros_like(g.border), _EDGE)
    return int(core.sum()) >= (_BEVEL if r.kind == PLANE else _KEEP) * len(own)


def _true(g: Ground, fit: _Fit) -> bool:
    """Whether a shape knows what it says, and misses its points by nothing but noise."""
    kind = fit.region.kind
    if not (fit.sure() and close(g, kind, fit.q, fit.used)):
        return False
    return kind == PLANE or waves(g, kind, fit.q, fit.used) <= WAVY


def _settled(g: Ground, found: list[Region]) -> Index:
    """The label of each vertex after regions shared out what lies between them."""
    label = np.full(len(g.vertices), -1, dtype=np.int64)
    off = np.ones(len(g.vertices))
    for k, r in enumerate(found):
        label[r.member] = k
        d = surface.distances(r.kind, r.q, g.vertices[r.member])[0]
        off[r.member] = np.abs(d) / g.limit[r.member]
    if not found:
        return label
    kinds = np.array([r.kind for r in found])
    q = np.array([r.q for r in found])
    side = np.array([r.side for r in found])
    reach = np.array([float(np.median(g.limit[r.member])) for r in found])
    return region.settled(label, off, region.Surfaces(kinds, q, side, reach), g.neighbourhood, 6)


def _cores(g: Ground, found: list[Region], label: Index, k: int) -> Iterator[Bools]:
    """A region (v,) without its edges, where enough of it is left: first with a narrow rim, last
    only away from where it ends in an edge. A fillet has none beside the walls that it runs into,
    and without its ends it may be too little of a round to know its radius."""
    own = np.asarray(label == k, dtype=np.bool_)
    core = region.eroded(own, g.start, g.near, g.border, _EDGE)
    yield core if core.sum() >= _KEEP * own.sum() else own
    core = region.eroded(own & ~g.border, g.start, g.near, np.zeros_like(g.border), _RIM)
    if core.sum() >= _LEFT * own.sum():
        yield core
    tangent = _tangent(g, found, label, k)
    if tangent.any():
        core = own & region.eroded(own | tangent, g.start, g.near, g.border, _EDGE)
        if core.sum() >= _KEEP * own.sum():
            yield core


def _tangent(g: Ground, found: list[Region], label: Index, k: int) -> Bools:
    """(v,) vertices of other regions whose surface looks there as that of region k does."""
    r, out = found[k], np.zeros(len(label), dtype=np.bool_)
    for j, other in enumerate(found):
        there = np.flatnonzero(label == j)
        if j == k or not len(there):
            continue
        X = g.vertices[there]
        one, two = (surface.distances(s.kind, s.q, X)[1] * s.side for s in (r, other))
        out[there] = np.einsum("ij,ij->i", one, two) > _ALONG
    return out


class _Fit:
    """A shape with its points, and what is known of its parameters."""

    def __init__(self, g: Ground, r: Region, own: Bools, core: Bools) -> None:
        self.region, self.own = r, own
        self.used = np.flatnonzero(core)
        if len(self.used) > _MOST_POINTS:
            self.used = self.used[:: len(self.used) // _MOST_POINTS + 1]
        q, _ = refit(g, r.kind, r.q, self.used, _MOST_POINTS, _STEPS)
        self.q = surface.slid(r.kind, q, g.vertices, self.used)
        if r.kind == PLANE and r.side < 0:
            self.q[3:6] *= -1
            r.side = 1.0
        self.free = np.flatnonzero(FREE[r.kind])
        points, scale = g.vertices[self.used], g.scale[self.used]
        d, J = surface.jacobian(r.kind, self.q, points)
        kept = np.abs(d) <= 4.0 * np.maximum(scale, 0.0)
        self.used = self.used[kept]
        self.budget = Budget(g, self.used, d[kept], J[kept][:, self.free])
        self.covariance = np.zeros((7, 7))
        self.covariance[np.ix_(self.free, self.free)] = self.budget.covariance

    def sure(self) -> bool:
        """Whether a curved shape knows its radius, and a plane where it looks."""
        C = self.covariance
        if not np.isfinite(C).all():
            return False
        if self.region.kind == PLANE:
            return bool(np.linalg.eigvalsh(C[:2, :2])[-1] < _SURE**2)
        return bool(np.sqrt(C[5, 5]) < _SURE * max(self.q[6], 1e-9) + 1e-9)

    def answer(self, field: Floats, g: Ground) -> Floats:
        """(7,) what the parameters do when all points move by ``field`` (v, 3)."""
        n = surface.distances(self.region.kind, self.q, g.vertices[self.used])[1]
        along = np.einsum("ij,ij->i", n, field[self.used])
        out = np.zeros(7)
        out[self.free] = self.budget.answer(along)
        return out


def _finished(
    g: Ground,
    found: list[Region],
    label: Index,
    fields: list[Floats],
    relations: bool,
    back: Index,
    count: int,
) -> ShapeSet:
    fits, owns = list[_Fit](), list[Bools]()
    for k, r in enumerate(found):
        on = np.asarray(label == k, dtype=np.bool_)
        for core in _cores(g, found, label, k):
            fit = _Fit(g, r, on, core)
            if _true(g, fit):
                fits.append(fit)
                owns.append(on)
                break
    order = sorted(range(len(fits)), key=lambda k: -float(g.area[owns[k]].sum()))
    fits = [fits[k] for k in order]
    covariance = _block([f.covariance for f in fits])
    for field in fields:
        answer = np.concatenate([np.zeros(0), *(f.answer(field, g) for f in fits)])
        covariance += np.outer(answer, answer)
    q = np.array([f.q for f in fits]).reshape(-1, 10)
    measured, own = _shapes(g, fits, q, covariance), covariance
    kinds = [f.region.kind for f in fits]
    adopted = None
    if relations and fits:
        adopted = adopt(kinds, [f.region.side for f in fits], q, covariance)
        q, covariance = adopted.q, adopted.covariance
    labels, residual = np.full(count, -1, dtype=np.int32), np.full(count, np.nan)
    used = np.zeros(count, dtype=np.bool_)
    for k, f in enumerate(fits):
        labels[back[f.own]] = k
        d = surface.distances(f.region.kind, q[k], g.vertices[f.own])[0]
        residual[back[f.own]] = d * (1.0 if f.region.kind == PLANE else f.region.side)
        used[back[f.used]] = True
    covered = float(g.area[np.logical_or.reduce([f.own for f in fits])].sum()) if fits else 0.0
    return ShapeSet(
        _shapes(g, fits, q, covariance),
        measured,
        () if adopted is None else tuple(adopted.relations),
        covariance,
        own,
        labels,
        residual,
        used,
        float(np.median(g.limit)),
        covered / float(g.area.sum()),
    )


def _block(parts: list[Floats]) -> Floats:
    out = np.zeros((7 * len(parts), 7 * len(parts)))
    for k, part in enumerate(parts):
        out[7 * k : 7 * k + 7, 7 * k : 7 * k + 7] = part
    return out


def _shapes(g: Ground, fits: list[_Fit], q: Floats, covariance: Floats) -> tuple[Shape, ...]:
    out = []
    for k, f in enumerate(fits):
        kind, one = f.region.kind, q[k]
        X = g.vertices[f.own]
        along = (X - one[:3]) @ one[3:6]
        d = surface.distances(kind, one, g.vertices[f.used])[0]
        C = covariance[7 * k : 7 * k + 7, 7 * k : 7 * k + 7]
        axis = one[3:6]
        out.append(
            Shape(
                KINDS[kind],
                one[:3],
                axis,
                0.0 if kind == PLANE else float(one[6]),
                float(one[7]) if kind > CYLINDER else 0.0,
                bool(f.region.side < 0),
                C,
                len(f.used),
                float(g.area[f.own].sum()),
                float(np.sqrt(np.mean(d**2))),
                0.0 if kind in (PLANE, SPHERE) else float(np.ptp(along)),
            )
        )
    return tuple(out)
