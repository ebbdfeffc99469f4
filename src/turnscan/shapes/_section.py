"""A plane, or a half-plane from the axis, through a mesh: the polylines that are measured."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.shapes._stripe_numbers import Stripes, stripes_of

_ON_PLANE = 1e-9
"""Of the size of the mesh: vertices no further than this lie on the plane."""
_STEEP = 0.2
"""Noise of a surface that the plane grazes is not magnified beyond the inverse of this."""


class CutMisses(InputError):
    """A cut meets nothing of the part; others may."""


@dataclass(frozen=True)
class Cut:
    """Where to cut, and how the section is drawn: a point p of the part stands at (p·right, p·up)
    of the drawing. The viewer looks against right × up."""

    name: str
    """What people call it: ``z = 20 mm``."""
    right: Floats
    """(3,) unit vector: the drawing's x in the frame of the part."""
    up: Floats
    """(3,) unit, square to ``right``: the drawing's y."""
    distance: float
    """mm from the origin along right × up."""
    half: bool = False
    """Only what has p·right ≥ 0: one side of the axis."""
    turned: bool = False
    """The profile of a turned part, alike at all angles: what stands at x has the diameter 2x."""
    view: Literal["section", "silhouette", "unrolled"] = "section"
    """Whether the plane cuts the part, shows its outline as the viewer sees it, or whether x is the
    angle about the z axis."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "right", frozen(self.right, (3,), "Cut.right"))
        put(self, "up", frozen(self.up, (3,), "Cut.up"))

    @property
    def normal(self) -> Floats:
        """(3,) unit vector: towards the viewer."""
        normal: Floats = np.cross(self.right, self.up)
        return normal

    def in_part(self, points: npt.ArrayLike) -> Floats:
        """(n, 3) mm in the frame of the part, of points (n, 2) mm of the drawing."""
        at = np.asarray(points, dtype=np.float64)
        placed: Floats = np.outer(at[:, 0], self.right) + np.outer(at[:, 1], self.up)
        return placed + self.distance * self.normal


def plane_cut(normal: npt.ArrayLike, distance: float, name: str = "") -> Cut:
    """The plane n·x = ``distance`` mm; ``normal`` (3,) is scaled to a unit, the distance with it.

    The drawing's y is the part's z as far as the plane allows it, else the part's y. A plane
    y = c is seen from −y, so that x goes to the right, others from where their normal points to.
    Raises InputError for a normal that is none.
    """
    n = np.asarray(normal, dtype=np.float64).reshape(-1)
    length = math.hypot(*n.tolist()) if n.shape == (3,) else 0.0
    if not (0 < length < math.inf and np.isfinite(distance)):
        raise InputError(f"a plane with the normal {n.tolist()}", hint="give three finite numbers")
    n, d = n / length, float(distance) / length
    text = name or f"{n[0]:.6g}x + {n[1]:.6g}y + {n[2]:.6g}z = {d:.6g} mm"
    if n[1] > 1.0 - 1e-12:
        n, d = -n, -d
    lead = np.array([0.0, 1.0, 0.0]) if abs(n[2]) > 1.0 - 1e-12 else np.array([0.0, 0.0, 1.0])
    up = lead - (lead @ n) * n
    up /= np.linalg.norm(up)
    return Cut(text, np.cross(up, n) + 0.0, up + 0.0, d)


def half_plane_cut(angle: float, name: str = "") -> Cut:
    """The half-plane from the rotation axis (z) at ``angle`` radians, counter-clockwise from x.

    The drawing's x is the distance from the axis, its y the part's z.
    """
    right = np.array([np.cos(angle), np.sin(angle), 0.0])
    text = name or f"half-plane at {np.rad2deg(angle):.6g}°"
    return Cut(text, right, np.array([0.0, 0.0, 1.0]), 0.0, half=True)


def silhouette_cut(direction: npt.ArrayLike, name: str = "") -> Cut:
    """The outline of the part for a viewer far away in ``direction`` (3,), drawn as `plane_cut`.

    Raises InputError for a direction that is none.
    """
    flat = plane_cut(direction, 0.0, "silhouette")
    # A plane across y is drawn from -y whichever way its normal points; a viewer is on one side.
    seen = flat.normal @ np.asarray(direction, dtype=np.float64).reshape(3) > 0
    flat = flat if seen else replace(flat, right=-flat.right + 0.0)
    n = flat.normal + 0.0
    text = name or f"silhouette from {n[0]:.6g}, {n[1]:.6g}, {n[2]:.6g}"
    return replace(flat, name=text, view="silhouette")


def unrolled_cut() -> Cut:
    """The surface unrolled about the z axis: x is the angle times the median radius, y is z."""
    return Cut("unrolled about z", np.array([1.0, 0, 0]), np.array([0.0, 0, 1]), 0.0,
               view="unrolled")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Chain:
    """One polyline of a section; material lies on its left where the mesh says what is inside."""

    points: Floats
    """(m, 2) mm in the drawing; the last point is not the first again."""
    closed: bool
    filled: Bools
    """(m,) for a closed chain, else (m − 1,): True where the way from a point to the next lies on a
    face that nobody measured."""
    sigma: Floats
    """(m,) mm: standard uncertainty across the polyline; NaN where not known."""
    spans: Floats
    """(m, 2) mm in the drawing, from the first to the second vertex between which each point lies.
    """
    ends: Ints
    """(m, 2) the vertices of the mesh between which each point lies."""
    shares: Floats
    """(m, 2) what each of them has to say in the point; their sum is 1."""
    stripes: Stripes | None = None
    """Of all vertices of the mesh, where it knows them."""
    together: float = 1.0
    """So many times the variance have means over points that independent vertices would give them
    (`held_together`)."""

    def __post_init__(self) -> None:
        m = len(self.points)
        put = object.__setattr__
        put(self, "points", frozen(self.points, (m, 2), "Chain.points"))
        ways = m if self.closed else m - 1
        put(self, "filled", frozen(self.filled, (ways,), "Chain.filled", np.bool_))
        put(self, "sigma", frozen(self.sigma, (m,), "Chain.sigma", nan=True))
        put(self, "spans", frozen(self.spans, (m, 2), "Chain.spans"))
        put(self, "ends", frozen(self.ends, (m, 2), "Chain.ends", np.int32))
        put(self, "shares", frozen(self.shares, (m, 2), "Chain.shares"))

    @cached_property
    def bulge(self) -> Floats:
        """(m,) mm²: the point lies on a chord between two vertices. ρ from a centre of curvature,
        it would be √(ρ² + bulge) from there on the curve on which the vertices are."""
        across: Floats = self.shares.prod(axis=1) * (self.spans**2).sum(axis=1)
        return across

    @cached_property
    def normals(self) -> Floats:
        """(m, 2) unit vectors over a few points, to the right of the chain: away from material."""
        p = self.points
        ahead = np.roll(p, -1, axis=0) - np.roll(p, 1, axis=0)
        if not self.closed:
            ahead[0], ahead[-1] = p[1] - p[0], p[-1] - p[-2]
        smooth = ahead.copy()
        smooth[1:-1] += ahead[:-2] + ahead[2:]
        smooth /= np.maximum(np.linalg.norm(smooth, axis=1), 1e-12)[:, None]
        return np.column_stack([smooth[:, 1], -smooth[:, 0]])

    @property
    def measured(self) -> Bools:
        """(m,) False for points neither side of which was measured."""
        before = np.roll(self.filled, 1) if self.closed else np.r_[True, self.filled]
        after = self.filled if self.closed else np.r_[self.filled, True]
        return ~(before & after)

    @property
    def length(self) -> float:
        """mm along the polyline."""
        return float(self.steps.sum())

    @property
    def steps(self) -> Floats:
        """mm from each point to the next: (m,) where closed, else (m − 1,)."""
        p = np.vstack([self.points, self.points[:1]]) if self.closed else self.points
        ways: Floats = np.linalg.norm(np.diff(p, axis=0), axis=1)
        return ways

    def part(self, index: npt.NDArray[np.intp], closed: bool = False) -> Chain:
        """The points ``index`` in this order as a chain of their own, its ways all measured."""
        ways = np.zeros(len(index) - (not closed), dtype=np.bool_)
        rows = (self.sigma[index], self.spans[index], self.ends[index], self.shares[index])
        return Chain(self.points[index], closed, ways, *rows, self.stripes, self.together)

    def runs(self, filled: bool) -> list[npt.NDArray[np.intp]]:
        """Indices of points along each stretch of ways that are (not) ``filled``.

        A closed chain that is all of one kind gives one run that comes back to its first point.
        """
        m = len(self.points)
        like = self.filled if filled else ~self.filled
        if self.closed and like.all():
            return [np.r_[np.arange(m), 0]]
        start = int(np.argmin(like)) if self.closed else 0
        found: list[npt.NDArray[np.intp]] = []
        now: list[int] = []
        for k in range(start, start + len(like)):
            if like[k % len(like)]:
                now = now or [k % m]
                now.append((k + 1) % m)
            elif now:
                found.append(np.array(now))
                now = []
        return [*found, np.array(now)] if now else found


def cross_section(mesh: Mesh, cut: Cut) -> list[Chain]:
    """The polylines in which a cut meets a mesh, the longest first.

    Each point lies where the plane crosses a side of a face. Faces that lie in the plane give their
    border. Raises InputError for a mesh without faces and `CutMisses` for a cut that misses it,
    saying where the part is.
    """
    if not len(mesh.faces):
        raise InputError(
            "the mesh has no faces to cut", hint="give a surface, not a cloud of points"
        )
    chains = crossed(mesh, cut)
    if not chains:
        raise CutMisses(f"section {cut.name} misses the part: {_where(mesh, cut)}",
                        hint="move it so that it cuts the part")  # fmt: skip
    return chains


def crossed(mesh: Mesh, cut: Cut) -> list[Chain]:
    """As `cross_section`, and none where the cut misses the mesh."""
    segments = segments_of(mesh, cut)
    chains = [c for walk in _walks(segments.nodes) if (c := _chain(walk, segments)) is not None]
    stripes = stripes_of(mesh) if chains else None
    chains = [replace(c, stripes=stripes) for c in chains]
    return sorted(chains, key=lambda c: -c.length)


def _where(mesh: Mesh, cut: Cut) -> str:
    used = mesh.vertices[np.unique(mesh.faces)]
    height = used @ cut.normal
    if cut.half and height.min() < cut.distance < height.max():
        return f"it reaches {float((used @ cut.right).max()):.3f} mm from the axis on that side"
    low, high = float(height.min()), float(height.max())
    if low < cut.distance < high:
        return "it lies in a gap of the surface, where nothing was measured"
    if float(np.abs(cut.normal).max()) > 1.0 - 1e-12:
        axis = int(np.argmax(np.abs(cut.normal)))
        low, high = sorted((float(used[:, axis].min()), float(used[:, axis].max())))
        return f"the part reaches from {'xyz'[axis]} = {low:.3f} to {high:.3f} mm"
    return f"along the normal the part reaches from {low:.3f} to {high:.3f} mm"


@dataclass(frozen=True, eq=False)
class Segments:
    """What the faces have of the section, each from one node to another."""

    nodes: npt.NDArray[np.int64]
    """(s, 2) from, to: material on the left."""
    filled: Bools
    """(s,)"""
    points: Floats
    """(k, 2) mm, of the nodes."""
    sigma: Floats
    spans: Floats
    ends: Ints
    shares: Floats


def segments_of(mesh: Mesh, cut: Cut) -> Segments:
    n = cut.normal
    height = mesh.vertices @ n - cut.distance
    height[np.abs(height) <= _ON_PLANE * float(np.ptp(mesh.vertices, axis=0).max())] = 0.0
    for above in (height >= 0, height > 0):
        count = above[mesh.faces].sum(axis=1)
        faces = np.flatnonzero((count == 1) | (count == 2))
        if len(faces):
            break
    corners, up = mesh.faces[faces].astype(np.int64), above[mesh.faces[faces]]
    if not len(faces):
        return Segments(
            np.zeros((0, 2), np.int64), np.zeros(0, np.bool_), np.zeros((0, 2)), np.zeros(0),
            np.zeros((0, 2)), np.zeros((0, 2), np.int32), np.zeros((0, 2)),
        )  # fmt: skip
    lone = np.argmax(up == (count[faces] == 1)[:, None], axis=1)
    rows = np.arange(len(faces))
    tip, left, right = (corners[rows, (lone + k) % 3] for k in range(3))
    pairs = np.stack([np.stack([tip, left], axis=1), np.stack([tip, right], axis=1)], axis=1)
    keys = pairs.min(axis=2) * len(mesh.vertices) + pairs.max(axis=2)
    unique, number = np.unique(keys, return_inverse=True)
    first, second = unique // len(mesh.vertices), unique % len(mesh.vertices)
    h1, h2 = height[first], height[second]
    share = h1 / np.where(h1 == h2, 1.0, h1 - h2)
    start, end = mesh.vertices[first], mesh.vertices[second]
    at = start + share[:, None] * (end - start)
    basis = np.stack([cut.right, cut.up], axis=1)
    t = mesh.triangles[faces]
    out = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    nodes = number.reshape(-1, 2)
    ahead = np.einsum("ij,ij->i", at[nodes[:, 1]] - at[nodes[:, 0]], np.cross(n, out))
    nodes = np.where((ahead < 0)[:, None], nodes[:, ::-1], nodes)
    shares = np.stack([1.0 - share, share], axis=1)
    steep = np.bincount(nodes.ravel(), np.repeat(np.hypot(*(out @ basis).T), 2), len(unique))
    tilt = steep / np.maximum(np.bincount(nodes.ravel(), minlength=len(unique)), 1)
    sigma = np.full(len(unique), np.nan)
    ends = np.stack([first, second], axis=1)
    if mesh.provenance is not None:
        each = np.where(shares > 0, shares * mesh.provenance.sigma[ends], 0.0)
        sigma = np.hypot(*each.T) / np.maximum(tilt, _STEEP)
    filled = np.zeros(len(faces), np.bool_) if mesh.measured is None else ~mesh.measured[faces]
    made = Segments(
        nodes, filled, at @ basis, sigma, (end - start) @ basis, ends.astype(np.int32), shares
    )  # fmt: skip
    return _clipped(made) if cut.half else made


def _clipped(s: Segments) -> Segments:
    """Only what lies at x ≥ 0, with new nodes where a segment crosses the axis."""
    x = s.points[:, 0]
    inside = x[s.nodes] >= 0
    whole, partly = inside.all(axis=1), inside.any(axis=1) & ~inside.all(axis=1)
    nodes = s.nodes[partly]
    a, b = nodes.T
    share = x[a] / (x[a] - x[b])
    new = s.points[a] + share[:, None] * (s.points[b] - s.points[a])
    new[:, 0] = 0.0
    near = np.where(share < 0.5, a, b)
    fresh = len(x) + np.arange(len(nodes))
    cut = np.where(inside[partly], nodes, fresh[:, None])
    rows = {
        name: np.concatenate([getattr(s, name), getattr(s, name)[near]])
        for name in ("sigma", "spans", "ends", "shares")
    }
    return replace(
        s, nodes=np.concatenate([s.nodes[whole], cut]), points=np.concatenate([s.points, new]),
        filled=np.concatenate([s.filled[whole], s.filled[partly]]), **rows,
    )  # fmt: skip


def _walks(nodes: npt.NDArray[np.int64]) -> Iterator[list[tuple[int, bool]]]:
    """Segments that follow each other: their numbers, and whether each is walked forwards."""
    about: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(nodes.tolist()):
        about.setdefault(a, []).append(k)
        about.setdefault(b, []).append(k)
    ends = [node for node, met in about.items() if len(met) % 2]
    taken = np.zeros(len(nodes), dtype=np.bool_)
    pairs = nodes.tolist()
    for here in [*ends, *about]:
        while True:
            walk: list[tuple[int, bool]] = []
            node = here
            while (k := _next(about[node], taken, pairs, node)) >= 0:
                taken[k] = True
                forwards = pairs[k][0] == node
                walk.append((k, forwards))
                node = pairs[k][1] if forwards else pairs[k][0]
                if node == here:
                    break
            if not walk:
                break
            yield walk


def _next(met: list[int], taken: Bools, pairs: list[list[int]], node: int) -> int:
    """A segment at a node that is left, one that begins there if there is; −1 for none."""
    free = [k for k in met if not taken[k]]
    return next((k for k in free if pairs[k][0] == node), free[0] if free else -1)


def _chain(walk: list[tuple[int, bool]], s: Segments) -> Chain | None:
    if sum(forwards for _, forwards in walk) * 2 < len(walk):
        walk = [(k, not forwards) for k, forwards in reversed(walk)]
    row = [int(s.nodes[k][0 if forwards else 1]) for k, forwards in walk]
    k, forwards = walk[-1]
    last = int(s.nodes[k][1 if forwards else 0])
    closed = last == row[0]
    index = np.array(row if closed else [*row, last])
    filled = s.filled[[k for k, _ in walk]]
    p = s.points[index]
    size = max(float(np.ptp(p, axis=0).max()), 1e-300)
    # Vertices on the plane are met once from each of the sides that end there.
    step = np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1)
    keep = step > 1e-7 * size
    if not closed:
        keep[-1] = True
    index = index[keep]
    ways = filled[keep] if closed else filled[keep[:-1]]
    if len(index) < (3 if closed else 2):
        return None
    return Chain(s.points[index], closed, ways, s.sigma[index], s.spans[index], s.ends[index],
                 s.shares[index])  # fmt: skip
