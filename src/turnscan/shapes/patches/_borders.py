"""The edges between charts: space curves on both surfaces, shared by the faces on both sides."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Mesh, opposite_half_edges
from turnscan.shapes.patches._charts import Charts
from turnscan.shapes.patches._patch import Patch

_ROUNDS = 12
"""Steps in which a point goes to the middle of its feet on both surfaces."""
_VERTICES = 4
"""Sides of the mesh for each span of an edge: what is narrower is the mesh's zigzag."""
_CHECKED = 5
"""Places for each span of an edge where its distance from the surfaces is looked at."""


@dataclass(frozen=True, eq=False)
class Border:
    """An edge: a clamped B-spline from one node to another."""

    first: int
    last: int
    """Index of the nodes at its ends."""
    knots: Floats
    control: Floats
    """(n, 3) mm."""
    degree: int
    apart: float
    """mm: how far it is at most from the surfaces of its faces."""

    def places(self) -> Floats:
        """(n, 3) mm: points along it, some for each span."""
        from scipy.interpolate import BSpline

        t = np.linspace(self.knots[0], self.knots[-1], _CHECKED * len(self.control))
        return np.asarray(BSpline(self.knots, self.control, self.degree)(t))


@dataclass(frozen=True, eq=False)
class Borders:
    """All edges of some charts, and how they go round each."""

    nodes: Floats
    """(n, 3) mm: where edges end, or ended the time before."""
    edges: tuple[Border, ...]
    loops: tuple[tuple[tuple[tuple[int, bool], ...], ...], ...]
    """For each chart its loops, the surface on their left: edges, and whether they run forwards."""


class Bordering:
    """Traces the edges between charts of a mesh, time and again while some charts are cut finer:
    an edge between charts that stayed is the same object as the time before."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.nodes = list[Floats]()
        self.places = dict[tuple[int, tuple[int, ...]], int]()
        """The node of a vertex with these charts about it."""
        self.edges = dict[tuple[int, ...], Border]()
        """The edge from a side of the mesh on, from node to node, between two charts; and whether
        it follows every side."""

    def borders(self, charts: Charts, faithful: frozenset[int] = frozenset()) -> Borders:
        """The edges of charts, each of which keeps its surface for as long as it has its number.

        Those of the charts ``faithful`` follow every side of the mesh, which cannot cross others,
        where a smooth curve might.
        """
        return _Tracing(self, charts, faithful).borders()


class _Tracing:
    def __init__(self, before: Bordering, charts: Charts, faithful: frozenset[int]) -> None:
        self.before, self.mesh = before, before.mesh
        self.charts, self.faithful = charts, faithful
        self.twin = opposite_half_edges(self.mesh.faces)
        side = np.arange(len(self.twin))
        self.chart = np.repeat(charts.label, 3)
        other = np.where(self.twin >= 0, self.chart[self.twin], -1)
        self.other = other
        self.rim: Bools = other != self.chart
        self.after = side - side % 3 + (side + 1) % 3
        self.start = self.mesh.faces.reshape(-1)
        self.name = np.where(self.twin >= 0, np.minimum(side, self.twin), side)
        self.node: dict[int, int] = {}
        self.edges = list[Border]()
        self.known: dict[int, int] = {}

    def borders(self) -> Borders:
        loops = self._loops()
        ends = self._ends(loops)
        self._set_nodes(ends)
        out: list[list[tuple[tuple[int, bool], ...]]] = [[] for _ in self.charts.patches]
        for loop in loops:
            c = int(self.chart[loop[0]])
            cuts = np.flatnonzero(ends[self.start[loop]])
            loop = np.roll(loop, -int(cuts[0]))
            cuts = np.r_[cuts - cuts[0], len(loop)]
            chains = [loop[a:b] for a, b in itertools.pairwise(cuts)]
            out[c].append(tuple(self._edge(chain) for chain in chains))
        loops_of = tuple(tuple(some) for some in out)
        nodes = np.array(self.before.nodes).reshape(-1, 3)
        return Borders(nodes, tuple(self.edges), loops_of)

    def _loops(self) -> list[Ints]:
        """The sides of the mesh round each chart, one loop after the other."""
        rim = np.flatnonzero(self.rim)
        step = self.after[rim]
        while not (done := self.rim[step]).all():
            step = np.where(done, step, self.after[self.twin[step]])
        follows = dict(zip(rim.tolist(), step.tolist(), strict=True))
        out = []
        while follows:
            first, at = follows.popitem()
            loop = [first]
            while at != first:
                loop.append(at)
                at = follows.pop(at)
            out.append(np.array(loop, dtype=np.int32))
        return out

    def _ends(self, loops: Sequence[Ints]) -> Bools:
        """(v,) True where edges end: where other than two sides meet, at facets, and twice on each
        loop."""
        own = self.rim & ((self.twin < 0) | (np.arange(len(self.twin)) < self.twin))
        sides = np.flatnonzero(own)
        meet = np.bincount(
            np.concatenate([self.start[sides], self.start[self.after[sides]]]),
            minlength=len(self.mesh.vertices),
        )
        ends = (meet > 0) & (meet != 2)
        ends[self.mesh.faces[np.isin(self.charts.label, list(self.charts.facets))]] = True
        for loop in loops:
            at = np.flatnonzero(ends[self.start[loop]])
            if not len(at):
                at = np.array([int(np.argmin(self.start[loop]))])
                ends[self.start[loop[at]]] = True
            if len(at) == 1:
                ends[self.start[loop[(at[0] + len(loop) // 2) % len(loop)]]] = True
        return np.asarray(ends)

    def _set_nodes(self, ends: Bools) -> None:
        """Put the vertices where edges end onto all surfaces about them."""
        start, label = _meeting(self.mesh, self.charts.label)
        fresh, on = list[int](), dict[int, list[int]]()
        first = len(self.before.nodes)
        for v in np.flatnonzero(ends).tolist():
            about = tuple(sorted({*label[start[v] : start[v + 1]].tolist()}))
            node = self.before.places.setdefault((v, about), first + len(fresh))
            self.node[v] = node
            if node == first + len(fresh):
                for chart in about:
                    on.setdefault(chart, []).append(len(fresh))
                fresh.append(v)
        feet = [
            (p, np.array(n, np.int32)) for c, n in on.items() if (p := self._patch(c)) is not None
        ]
        self.before.nodes += list(_between(self.mesh.vertices[fresh], feet))

    def _edge(self, chain: Ints) -> tuple[int, bool]:
        """The edge along a chain of sides, and whether it runs the same way."""
        key = int(self.name[chain].min())
        if key in self.known:
            return self.known[key], False
        self.known[key] = len(self.edges)
        charts = {int(self.chart[chain[0]]), int(self.other[chain[0]])}
        plain = bool(charts & self.faithful)
        first, last = (
            self.node[int(v)] for v in (self.start[chain[0]], self.start[self.after[chain[-1]]])
        )
        name = (int(chain[0]), first, last, min(charts), max(charts), plain)
        edge = self.before.edges.get(name)
        if edge is None:
            X = self.mesh.vertices[np.r_[self.start[chain], self.start[self.after[chain[-1]]]]]
            patches = [p for c in charts if (p := self._patch(c)) is not None]
            ends = (self.before.nodes[first], self.before.nodes[last])
            edge = _curve(X, ends, first, last, patches, plain)
            self.before.edges[name] = edge
        self.edges.append(edge)
        return self.known[key], True

    def _patch(self, chart: int) -> Patch | None:
        return None if chart < 0 else self.charts.patches[chart]


def _meeting(mesh: Mesh, label: Ints) -> tuple[Ints, Ints]:
    """The charts of the faces about each vertex: where they begin, and all in a row."""
    corner = mesh.faces.reshape(-1)
    order = np.argsort(corner, kind="stable")
    start = np.searchsorted(corner[order], np.arange(len(mesh.vertices) + 1))
    return start.astype(np.int64), np.repeat(label, 3)[order]


def _settled(X: Floats, patches: Sequence[Patch]) -> Floats:
    """Points (n, 3) mm moved onto all surfaces, or to the middle between them."""
    return _between(X, [(p, np.arange(len(X), dtype=np.int32)) for p in patches])


def _between(X: Floats, patches: Sequence[tuple[Patch, Ints]]) -> Floats:
    """Points (n, 3) mm moved onto all of their surfaces, or to the middle between them; each
    surface is given with the points that it is one of."""
    many = np.zeros(len(X))
    for _, own in patches:
        many[own] += 1
    for _ in range(_ROUNDS if patches else 0):
        feet = np.zeros(X.shape)
        for patch, own in patches:
            off, normal = patch.offsets(X[own])
            feet[own] += off[:, None] * normal
        X = X - feet / np.maximum(many, 1)[:, None]
    return X


def _curve(
    X: Floats, ends: tuple[Floats, Floats], first: int, last: int, patches: Sequence[Patch],
    plain: bool,
) -> Border:  # fmt: skip
    """The edge along a chain of vertices (n, 3) mm."""
    from scipy.interpolate import BSpline, make_interp_spline

    if len(X) == 2:
        control = np.array(ends)
        length = max(float(np.linalg.norm(control[1] - control[0])), 1e-6)
        return _known(Border(first, last, np.array([0, 0, length, length]), control, 1, 0), patches)
    X = _settled(X, patches)
    X[0], X[-1] = ends
    if not plain:
        X = _smooth(X, patches)
    steps = np.linalg.norm(np.diff(X, axis=0), axis=1)
    keep = np.r_[True, steps > 1e-6]
    keep[-1] = True
    X = X[keep]
    t = np.r_[0.0, np.cumsum(np.maximum(np.linalg.norm(np.diff(X, axis=0), axis=1), 1e-6))]
    degree = 1 if plain else min(3, len(X) - 1)
    curve: BSpline = make_interp_spline(t, X, k=degree)
    edge = Border(first, last, np.asarray(curve.t), np.asarray(curve.c), degree, 0.0)
    return _known(edge, patches)


def _known(edge: Border, patches: Sequence[Patch]) -> Border:
    """An edge with how far it is from its surfaces."""
    if not patches:
        return edge
    places = edge.places()
    return replace(edge, apart=max(float(p.gaps(places).max()) for p in patches))


def _smooth(X: Floats, patches: Sequence[Patch]) -> Floats:
    """Points along a chain without its zigzag, back on the surfaces; the ends stay."""
    from scipy.interpolate import BSpline

    n = len(X)
    spans = n // _VERTICES
    if n < 4 or spans < 1:
        return X
    t = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(X, axis=0), axis=1))]
    inner = np.quantile(t, np.linspace(0, 1, spans + 1))[1:-1]
    knots = np.r_[[0.0] * 4, inner, [t[-1]] * 4]
    design = BSpline.design_matrix(np.minimum(t, t[-1]), knots, 3).toarray()
    rest = X - design[:, :1] * X[0] - design[:, -1:] * X[-1]
    free = np.linalg.lstsq(design[1:-1, 1:-1], rest[1:-1], rcond=None)[0]
    curve = BSpline(knots, np.vstack([X[0], free, X[-1]]), 3)
    out = curve(np.linspace(0, t[-1], 2 * spans + 2))
    out[1:-1] = _settled(out[1:-1], patches)
    return np.asarray(out)
