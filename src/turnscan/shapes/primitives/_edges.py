"""Edges of a part: where neighbouring shapes meet, sharp, rounded or chamfered.

The surface beside an edge is judged by the signed distances u, v of each point to the two shapes.
With c the cosine between their outward normals, a point of the plane across the edge is
p = a n₁ + b n₂ with a = (u − c v)/(1 − c²), b = (v − c u)/(1 − c²), and
|p|² = (u² + v² − 2 c u v)/(1 − c²). A convex sharp edge is max(u, v) = 0; a fillet of radius r is
the circle about u = v = −r between its points of contact; a chamfer cuts both sides at the same
length from the edge. A concave edge is the same with both signs turned. A form is taken where it is
wider than what a stripe bends beside any edge, and better than sharp by five standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh, measured_vertices
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._shapes import KINDS, Shape, ShapeSet

Index = npt.NDArray[np.int64]
EdgeForm = Literal["sharp", "fillet", "chamfer"]

_FAR = 12
"""Rings of vertices without a shape across which two shapes may meet in a fillet or chamfer."""
BENT = 3
"""Rings beside an edge where stripes are bent: what is narrower is no fillet, but the optics."""
_LEAST = 12
"""Vertices beside an edge that its form is judged by."""
MEET = float(np.radians(12.0))
"""Shapes whose normals differ by less where they meet have no edge: one runs into the other."""
_MOSTLY = 0.5
"""Share of the vertices beside an edge that must find the place where the shapes meet."""
_ROUNDS = 8
_SETTLED = 1e-9
"""mm."""
_BETTER = 25.0
"""How much less the sum of squares must be than that of a sharp edge, in variances."""
_BOUND = 6.0
"""Standard deviations beyond which a point has no more say."""
_TRIALS = 65
_DOUBT = 4.0
"""Of the sum of squares, in variances: sizes that cost no more may be true: two sigma."""


@dataclass(frozen=True)
class Edge:
    """Where two shapes meet."""

    first: int
    second: int
    """Index of the shapes, the lower first."""
    form: EdgeForm
    convex: bool
    """Whether the material is inside of both, as at the corner of a block."""
    angle: float
    """Radians between the outward normals where they meet, mean."""
    size: float
    """mm: radius of a fillet, leg of a chamfer along each shape; 0 for a sharp edge."""
    sigma: float
    """mm: its standard uncertainty; for a sharp edge the largest radius that it may have."""
    points: int
    """Measured vertices that the form was judged by."""
    blend: int | None = None
    """Index of the shape that is the fillet, where it is one of its own."""


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Which vertices lie beside which edge."""

    start: Index
    near: npt.NDArray[np.int32]
    """Neighbours, near[start[i]:start[i + 1]]."""
    label: Index
    """(v,) the shape of each vertex; beside an edge also of those that were too far off."""
    pair: Index
    """(v,) index into ``pairs`` of the nearest edge, −1 where there is none."""
    ring: Index
    """(v,) how many vertices from it."""
    pairs: tuple[tuple[int, int], ...]


def normals_and_distances(s: Shape, X: Floats) -> tuple[Floats, Floats]:
    """Signed distances (n,) mm of points (n, 3), positive outside of the material, and the shape's
    outward normals (n, 3) there."""
    d, n = surface.distances(KINDS.index(s.kind), s.numbers, np.ascontiguousarray(X))
    return (-d, -n) if s.hollow else (d, n)


def neighbourhood(mesh: Mesh, found: ShapeSet, rings: int = _FAR) -> Neighbourhood:
    """The vertices within some rings of where shapes meet, or nearly do."""
    start, near = region.neighbours(mesh.faces, len(mesh.vertices))
    known = measured_vertices(mesh)
    label, _ = region.spread(found.label.astype(np.int64), known, start, near, rings)
    tail = np.repeat(np.arange(len(label)), np.diff(start))
    a, b = label[tail], label[near]
    cross = (a >= 0) & (b >= 0) & (a != b)
    many = max(len(found.shapes), 1)
    keys = np.minimum(a, b)[cross] * many + np.maximum(a, b)[cross]
    names, number = np.unique(keys, return_inverse=True)
    pair = np.full(len(label), -1, dtype=np.int64)
    pair[tail[cross]] = number
    pair, ring = region.spread(pair, known, start, near, rings + BENT)
    pairs = tuple((int(k // many), int(k % many)) for k in names)
    return Neighbourhood(start, near, label, pair, ring, pairs)


def find_edges(mesh: Mesh, found: ShapeSet) -> tuple[Edge, ...]:
    """The edges between neighbouring shapes of a mesh, each with its form.

    Radii of fillets and legs of chamfers carry the standard uncertainty that their points give. A
    cylinder or torus that two shapes run into is their fillet, too. An edge whose rounding is
    narrower than three vertices on either side is sharp as far as is known; its ``sigma`` is
    then the radius that it may have.
    """
    where = neighbourhood(mesh, found)
    out = list[Edge]()
    smooth = list[tuple[int, int]]()
    for k, (i, j) in enumerate(where.pairs):
        own = np.isin(where.label, (i, j))
        member = np.flatnonzero((where.pair == k) & own)
        if len(member) < _LEAST:
            continue
        edge = _edge(mesh, found, where, member, i, j)
        if edge is None:
            smooth.append((i, j))
        else:
            out.append(edge)
    return (*out, *_blends(mesh, found, smooth))


def _blends(mesh: Mesh, found: ShapeSet, smooth: list[tuple[int, int]]) -> list[Edge]:
    """Fillets that are shapes of their own: cylinders and tori that two shapes run into."""
    out = list[Edge]()
    for k, s in enumerate(found.shapes):
        ends = sorted(i + j - k for i, j in smooth if k in (i, j))
        if s.kind not in ("cylinder", "torus") or len(ends) != 2:
            continue
        size = s.radius if s.kind == "cylinder" else s.second
        first, second = ends
        if any(0 < found.shapes[e].radius <= size for e in ends):
            continue
        X = mesh.vertices[found.label == k]
        # Touching both sides, it has nothing but its radius left to fit.
        (u, n1), (v, n2) = (normals_and_distances(found.shapes[e], X) for e in ends)
        if s.hollow:
            u, v = -u, -v
        c = np.clip(np.einsum("ij,ij->i", n1, n2), -1.0, 1.0)
        angle = float(np.median(np.arccos(c)))
        _, r, sigma, _ = _best(partial(fillet_distance, u, v, c), 2 * size, max(s.rms, 1e-9))
        out.append(Edge(first, second, "fillet", not s.hollow, angle, r, sigma, s.count, k))
    return out


def meeting(one: Shape, other: Shape, start: Floats) -> tuple[Floats, Bools, Floats]:
    """The points (n, 3) mm on two shapes nearest to where the search starts (n, 3).

    Newton's method. Returns them, which were found, and the angles (n,) between the outward normals
    there, radians: shapes that touch, and do not cut each other, meet at less than `MEET`.
    """
    x = start.copy()
    for _ in range(_ROUNDS):
        u, n1 = normals_and_distances(one, x)
        v, n2 = normals_and_distances(other, x)
        c = np.clip(np.einsum("ij,ij->i", n1, n2), -1.0, 1.0)
        square = np.maximum(1 - c * c, 1e-6)
        x = x - ((u - c * v) / square)[:, None] * n1 - ((v - c * u) / square)[:, None] * n2
    angle = np.arccos(c)
    good = np.abs(u) + np.abs(v) < _SETTLED * max(1.0, float(np.abs(x).max(initial=0.0)))
    return x, good & (angle > MEET) & (angle < np.pi - MEET), angle


def _edge(
    mesh: Mesh, found: ShapeSet, where: Neighbourhood, member: Index, i: int, j: int
) -> Edge | None:
    """The edge of two shapes, from the vertices beside it; None where they run into each other."""
    X = mesh.vertices[member]
    one, other = found.shapes[i], found.shapes[j]
    u, n1 = normals_and_distances(one, X)
    v, n2 = normals_and_distances(other, X)
    cosine = np.clip(np.einsum("ij,ij->i", n1, n2), -1.0, 1.0)
    beside = member[where.ring[member] == 0]
    _, met, angles = meeting(one, other, mesh.vertices[beside])
    if met.mean() < _MOSTLY:
        return None
    angle = float(np.median(angles[met]))
    inside = np.where(where.label[member] == i, v, u)  # off the other shape
    convex = bool(np.median(inside) < 0)
    if not convex:
        u, v = -u, -v
    scale = max(one.rms, other.rms, 1e-9)
    spacing = _spacing(mesh, where, member)
    edge = _form(u, v, cosine, scale, BENT * spacing, angle)
    if edge.form != "sharp" and not _is_told(mesh, member, (u, v, cosine), scale, edge):
        edge = _Form("sharp", 0.0, edge.size)
    return Edge(i, j, edge.form, convex, angle, edge.size, edge.sigma, len(member))


def _is_told(
    mesh: Mesh, member: Index, sides: tuple[Floats, Floats, Floats], scale: float, edge: _Form
) -> bool:
    """Whether the vertices beside an edge that would lie elsewhere if it were sharp, as far as they
    state to know it, say that it is not.

    What the surface does between two profiles nobody knows, and it moves all vertices there alike:
    many of them are no surer than one.
    """
    if mesh.provenance is None:
        return True
    u, v, cosine = sides
    off = np.maximum(u, v)
    form = fillet_distance if edge.form == "fillet" else chamfer_distance
    tell = np.abs(form(u, v, cosine, edge.size) - off) > scale
    stated = np.fmax(mesh.provenance.sigma[member], scale)
    return bool(tell.any() and np.mean((off[tell] / stated[tell]) ** 2) > 1.0)


def _spacing(mesh: Mesh, where: Neighbourhood, member: Index) -> float:
    """mm across an edge from one ring of vertices to the next."""
    beside = member[where.ring[member] == 0]
    out = list[float]()
    for i in beside[:: max(1, len(beside) // 200)]:
        near = where.near[where.start[i] : where.start[i + 1]]
        far = near[where.label[near] != where.label[i]]
        out += np.linalg.norm(mesh.vertices[far] - mesh.vertices[i], axis=1).tolist()
    return float(np.median(out)) if out else 0.0


@dataclass(frozen=True)
class _Form:
    form: EdgeForm
    size: float
    sigma: float


def _form(
    u: Floats, v: Floats, cosine: Floats, scale: float, resolved: float, angle: float
) -> _Form:
    """The form of a convex edge of which points know their distances from both shapes."""
    half = np.tan(angle / 2)
    longest = float(np.quantile(np.hypot(u, v), 0.9))
    sharp = _cost(np.maximum(u, v), scale)
    fillet = _best(partial(fillet_distance, u, v, cosine), longest / half, scale)
    legs = _best(partial(chamfer_distance, u, v, cosine), longest, scale)
    radius_limit = resolved / half
    best, size, sigma, form, limit = min(
        (*fillet[:3], "fillet", radius_limit), (*legs[:3], "chamfer", resolved)
    )
    if sharp - best > _BETTER and size - 2 * sigma > limit:
        return _Form("fillet" if form == "fillet" else "chamfer", size, sigma)
    return _Form("sharp", 0.0, min(radius_limit, fillet[3]))


def fillet_distance(u: Floats, v: Floats, cosine: Floats, radius: float) -> Floats:
    """(n,) mm from a convex edge of this radius, of points with distances u, v from its sides."""
    a, b = u + radius, v + radius
    square = np.maximum(1 - cosine**2, 1e-9)
    across = np.sqrt(np.maximum(a * a + b * b - 2 * cosine * a * b, 0.0) / square)
    between = (a > cosine * b) & (b > cosine * a)
    return np.where(between, across - radius, np.maximum(u, v))


def chamfer_distance(u: Floats, v: Floats, cosine: Floats, leg: float) -> Floats:
    """(n,) mm from a convex edge that is cut off, ``leg`` mm along each side."""
    unit = np.sqrt(2 + 2 * cosine)
    depth = leg * np.sqrt(np.maximum(1 - cosine, 0.0) / 2)  # of the edge over the cut
    return np.maximum(np.maximum(u, v), (u + v) / unit + depth)


def _cost(d: Floats, scale: float) -> float:
    return float(np.minimum((d / scale) ** 2, _BOUND**2).sum())


def _best(
    of: Callable[[float], Floats], longest: float, scale: float
) -> tuple[float, float, float, float]:
    """Where the truncated sum of squares is least: it, the size, its sigma, and the largest size
    that costs hardly more."""
    from scipy.optimize import minimize_scalar

    trials = np.linspace(0.0, max(longest, 1e-9), _TRIALS)
    costs = [_cost(of(float(t)), scale) for t in trials]
    k = int(np.argmin(costs))
    low, high = trials[max(k - 1, 0)], trials[min(k + 1, _TRIALS - 1)]
    done = minimize_scalar(
        lambda t: _cost(of(float(t)), scale), bounds=(low, high), method="bounded"
    )
    size, cost = float(done.x), float(done.fun)
    bearable = np.flatnonzero(np.array(costs) <= cost + _DOUBT)
    most = float(trials[min(int(bearable.max(initial=k)) + 1, _TRIALS - 1)])
    step = max(1e-3 * longest, 1e-6)
    slope = (of(size + step) - of(max(size - step, 0.0))) / (step + min(step, size))
    d = of(size)
    counted = (np.abs(d) <= _BOUND * scale) & (slope != 0)
    strength = float((slope[counted] ** 2).sum())
    if not strength > 0:
        return cost, size, float("inf"), most
    unit = max(1.0, float(np.mean((d[counted] / scale) ** 2)))
    return cost, size, scale * float(np.sqrt(unit / strength)), most
