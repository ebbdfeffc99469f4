"""A shell of trimmed faces by OpenCASCADE; a solid where it closes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.drawings._parts import volume_of
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.drawings._step import faults_in_file
from turnscan.shapes.patches import (
    Border,
    Borders,
    Charts,
    ExtrudedPatch,
    FlatPatch,
    Patch,
    ShapePatch,
    TurnedPatch,
    flat_patch,
)

_LEAST = 1e-6
"""mm: the least tolerance of an edge."""
_WIDE = 2.0
"""Of the tolerance: a face further from one of its edges is none."""
_ROOM = 1.2
"""An edge's tolerance over how far it is from its surfaces where that was looked at."""


@dataclass(frozen=True, eq=False)
class Shell:
    """Faces that share their edges."""

    charts: tuple[int, ...]
    """The chart of each face."""
    whole: Any
    """Solids where the faces close, a compound if there are more than one, else TopoDS_Shell."""
    solids: int
    """0 where the faces do not close."""
    bad: frozenset[int]
    """Charts whose face is off its edges, or has faults by OpenCASCADE; ``whole`` lacks them."""
    volume: float = np.nan
    """mm³ of the solids."""

    def faults(self) -> frozenset[int]:
        """Charts whose face has faults when it is written as STEP and read back."""
        return frozenset(self.charts[k] for k in faults_in_file(self.solid()))

    def solid(self) -> Solid:
        """The part, to be written."""
        splines = "B-spline solid" if self.solids else "B-spline shell"
        return Solid(self.whole, self.volume, len(self.charts), self.solids, splines)


class ShellMaker:
    """Makes the faces of charts that have a surface, trimmed by their borders.

    Of faces that it has seen it knows whether they are sound: where some charts are cut finer, the
    others are not made anew to tell.
    """

    def __init__(self) -> None:
        """Raises InputError where OpenCASCADE is not installed."""
        check_opencascade()
        self._sound = dict[tuple[Any, ...], bool]()
        self._seen = set[Border]()
        """Kept, so that no other edge gets the identity of one."""

    def bad(self, charts: Charts, borders: Borders) -> frozenset[int]:
        """The charts whose face is off its edges, or has faults by OpenCASCADE."""
        self._seen.update(borders.edges)
        names = {
            k: (k, *((id(borders.edges[e]), way) for loop in loops for e, way in loop))
            for k, loops in enumerate(borders.loops)
            if loops
        }
        making = _Making(charts, borders)
        fresh = [k for k, name in names.items() if name not in self._sound]
        made = {k: face for k in fresh if (face := making.face(k)) is not None}
        self._sound |= {names[k]: making.is_sound(k, face) for k, face in made.items()}
        return frozenset(k for k, name in names.items() if not self._sound.get(name, True))

    def wrong_places(self, charts: Charts, borders: Borders, chart: int) -> Floats:
        """(n, 3) mm: where the border of a chart is off its surface, or crosses itself on it."""
        patch = charts.patches[chart]
        lines = [
            e.control if e.degree == 1 else e.places()
            for loop in borders.loops[chart]
            for e in (borders.edges[k] for k, _ in loop)
        ]
        if patch is None or not lines:
            return np.zeros((0, 3))
        X = np.concatenate(lines)
        off = X[patch.gaps(X) > _WIDE * charts.tolerance]
        ends = np.concatenate([np.stack([x[:-1], x[1:]], axis=1) for x in lines])
        return np.concatenate([off, _crossings(ends, patch.parameters)])

    def shell(self, charts: Charts, borders: Borders) -> Shell:
        """All sound faces, sharing their edges."""
        making = _Making(charts, borders)
        faces = {k: making.face(k) for k, loops in enumerate(borders.loops) if loops}
        made = {k: face for k, face in faces.items() if face is not None}
        bad = frozenset(k for k, face in made.items() if not making.is_sound(k, face))
        kept = [k for k in made if k not in bad]
        uses = np.zeros(len(borders.edges), dtype=int)
        for k in kept:
            for loop in borders.loops[k]:
                np.add.at(uses, [e for e, _ in loop], 1)
        if kept and bool((uses[uses > 0] == 2).all()):
            return _closed(making.builder, kept, made, borders, bad)
        return Shell(tuple(kept), _sewn(making.builder, [made[k] for k in kept]), 0, bad)


def _crossings(ends: Floats, parameters: Callable[[Floats], Floats]) -> Floats:
    """(n, 3) mm: middles of segments (m, 2, 3) that cross others in the parameters of a surface."""
    from scipy.spatial import cKDTree

    uv = parameters(ends.reshape(-1, 3)).reshape(-1, 2, 2)
    way = uv[:, 1] - uv[:, 0]
    reach = float(np.linalg.norm(way, axis=1).max(initial=0.0))
    i, j = cKDTree(uv.mean(axis=1)).query_pairs(reach, output_type="ndarray").T

    def parts(a: Ints, b: Ints) -> Bools:
        """(n,) whether the ends of segments b lie on both sides of the lines of segments a."""
        to = uv[b] - uv[a, :1]
        side = way[a, None, 0] * to[..., 1] - way[a, None, 1] * to[..., 0]
        return np.asarray(side[:, 0] * side[:, 1] < 0)

    cross = parts(i, j) & parts(j, i)
    return np.asarray(ends[np.unique(np.concatenate([i[cross], j[cross]]))].mean(axis=1))


def _closed(
    builder: Any, kept: Sequence[int], made: Mapping[int, Any], borders: Borders,
    bad: frozenset[int],
) -> Shell:  # fmt: skip
    """Faces that close: a solid for each body that they bound, with its cavities."""
    from OCP.TopoDS import TopoDS_Compound, TopoDS_Solid

    bodies = _bodies(kept, borders)
    shells = [_sewn(builder, [made[k] for k in body]) for body in bodies]
    volumes = [volume_of(shell) for shell in shells]
    outer = [n for n, v in enumerate(volumes) if v > 0]
    within = {n: _holder(shells, volumes, n) for n in range(len(shells)) if n not in outer}
    if not outer or None in within.values():
        return Shell(tuple(kept), _sewn(builder, [made[k] for k in kept]), 0, bad)
    solids, order = [], list[int]()
    for n in outer:
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        for m in (n, *(k for k, holder in within.items() if holder == n)):
            shells[m].Closed(True)
            builder.Add(solid, shells[m])
            order += bodies[m]
        solids.append(solid)
    whole = solids[0]
    if len(solids) > 1:
        whole = TopoDS_Compound()
        builder.MakeCompound(whole)
        for solid in solids:
            builder.Add(whole, solid)
    return Shell(tuple(order), whole, len(solids), bad, sum(volumes))


def _bodies(kept: Sequence[int], borders: Borders) -> list[list[int]]:
    """The charts that hang together by their edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = [(n, e) for n, k in enumerate(kept) for loop in borders.loops[k] for e, _ in loop]
    n, e = np.array(pairs).T
    link = coo_array((np.ones(len(n), np.int8), (n, e)), shape=(len(kept), len(borders.edges)))
    body = connected_components((link @ link.T).tocsr(), directed=False)[1]
    return [[kept[int(n)] for n in np.flatnonzero(body == k)] for k in range(int(body.max()) + 1)]


def _holder(shells: Sequence[Any], volumes: Sequence[float], cavity: int) -> int | None:
    """The smallest body whose box holds that of a cavity."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    boxes = []
    for shell in shells:
        box = Bnd_Box()
        BRepBndLib.Add_s(shell, box)
        boxes.append(box)
    low, high = boxes[cavity].CornerMin(), boxes[cavity].CornerMax()
    holds = [
        n
        for n, v in enumerate(volumes)
        if v > -volumes[cavity] and not boxes[n].IsOut(low) and not boxes[n].IsOut(high)
    ]
    return min(holds, key=lambda n: volumes[n], default=None)


def _sewn(builder: Any, faces: Sequence[Any]) -> Any:
    from OCP.TopoDS import TopoDS_Shell

    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    return shell


def _gap(
    patch: Patch | None, loops: Sequence[Sequence[tuple[int, bool]]], borders: Borders
) -> float:
    """mm: how far a surface is from the edges about it, at most."""
    curves = (borders.edges[k] for loop in loops for k, _ in loop)
    return max((float(patch.gaps(c.places()).max()) for c in curves if patch), default=0.0)


class _Making:
    """Makes faces of charts; those that are made share their edges and vertices."""

    def __init__(self, charts: Charts, borders: Borders) -> None:
        from OCP.BRep import BRep_Builder

        self.charts, self.borders, self.builder = charts, borders, BRep_Builder()
        self.edges, self.vertices = dict[int, Any](), dict[int, Any]()
        self.tolerance = np.full(len(borders.nodes), _LEAST)
        for e in borders.edges:
            for node in (e.first, e.last):
                self.tolerance[node] = max(self.tolerance[node], _ROOM * e.apart)

    def face(self, chart: int) -> Any | None:
        """The face of a chart, its normal outward; None where it has no surface."""
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopLoc import TopLoc_Location
        from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

        patch = self._patch(chart)
        if patch is None:
            return None
        surface, inside_out = _surface(patch)
        place, face, builder = TopLoc_Location(), TopoDS_Face(), self.builder
        builder.MakeFace(face, surface, place, _LEAST)
        for loop in self.borders.loops[chart]:
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for k, forward in loop[::-1] if inside_out else loop:
                border, edge = self.borders.edges[k], self._edge(k)
                flat, apart = _flat(border, patch)
                tolerance = max(_LEAST, _ROOM * max(border.apart, apart))
                builder.UpdateEdge(edge, flat, surface, place, tolerance)
                builder.SameRange(edge, True)
                builder.SameParameter(edge, True)
                way = TopAbs_FORWARD if forward != inside_out else TopAbs_REVERSED
                builder.Add(wire, edge.Oriented(way))
            wire.Closed(True)
            builder.Add(face, wire)
        return face.Reversed() if inside_out else face

    def is_sound(self, chart: int, face: Any) -> bool:
        """Whether a face is near its edges, and OpenCASCADE finds no fault."""
        from OCP.BRepCheck import BRepCheck_Analyzer

        gap = _gap(self.charts.patches[chart], self.borders.loops[chart], self.borders)
        return gap <= _WIDE * self.charts.tolerance and BRepCheck_Analyzer(face).IsValid()

    def _patch(self, chart: int) -> Patch | None:
        """Its surface; of a chart that is one triangle, the plane of that."""
        if chart not in self.charts.facets:
            return self.charts.patches[chart]
        [loop] = self.borders.loops[chart]
        edges = self.borders.edges
        ends = [edges[k].first if forward else edges[k].last for k, forward in loop]
        return flat_patch(self.borders.nodes[ends])

    def _edge(self, number: int) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopoDS import TopoDS_Edge

        if number not in self.edges:
            e = self.borders.edges[number]
            curve = _curve(e.control, e.knots)
            self.edges[number] = edge = TopoDS_Edge()
            self.builder.MakeEdge(edge, curve, max(_LEAST, _ROOM * e.apart))
            self.builder.Add(edge, self._vertex(e.first).Oriented(TopAbs_FORWARD))
            self.builder.Add(edge, self._vertex(e.last).Oriented(TopAbs_REVERSED))
            self.builder.Range(edge, float(e.knots[0]), float(e.knots[-1]))
        return self.edges[number]

    def _vertex(self, node: int) -> Any:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        if node not in self.vertices:
            self.vertices[node] = vertex = TopoDS_Vertex()
            x = gp_Pnt(*self.borders.nodes[node].tolist())
            self.builder.MakeVertex(vertex, x, 2 * float(self.tolerance[node]))
        return self.vertices[node]


def _flat(border: Border, patch: Patch) -> tuple[Any, float]:
    """An edge in the parameters of a surface, and how far the two are apart at most, mm."""
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.gp import gp_Pnt2d
    from scipy.interpolate import BSpline, make_interp_spline

    bent = isinstance(patch, ShapePatch) and patch.shape.kind != "plane"
    if not bent and not isinstance(patch, TurnedPatch):
        uv, knots, degree, apart = (
            patch.parameters(border.control), border.knots, border.degree, 0.0
        )  # fmt: skip
    else:
        space = BSpline(border.knots, border.control, border.degree)
        inner = np.unique(border.knots)
        t = np.unique(np.concatenate([a + (b - a) * np.linspace(0, 1, 5) for a, b in
                                      itertools.pairwise(inner)]))  # fmt: skip
        # A cubic through the corners of a polyline would swing beside them, and cross itself.
        degree = min(3 if border.degree > 1 else 1, len(t) - 1)
        curve = make_interp_spline(t, patch.parameters(space(t)), k=degree)
        uv, knots, apart = curve.c, curve.t, border.apart / 2
    poles = [gp_Pnt2d(float(u), float(v)) for u, v in uv]
    return Geom2d_BSplineCurve(_array("gp_Pnt2d", poles), *_knots(knots), degree), apart


def _surface(patch: Patch) -> tuple[Any, bool]:
    """The surface of OpenCASCADE, and whether its normal points into the material."""
    if isinstance(patch, ShapePatch):
        return _analytic(patch), patch.shape.hollow and patch.shape.kind != "plane"
    if isinstance(patch, FlatPatch):
        return _plane(patch), False
    if isinstance(patch, ExtrudedPatch):
        return _extruded(patch), False
    if isinstance(patch, TurnedPatch):
        return _turned(patch), patch.hollow
    from OCP.collections import Array2_gp_Pnt
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt

    control = patch.control
    poles = Array2_gp_Pnt(1, control.shape[0], 1, control.shape[1])
    for i, row in enumerate(control.tolist()):
        for j, p in enumerate(row):
            poles.SetValue(i + 1, j + 1, gp_Pnt(*p))
    (u, many_u), (v, many_v) = map(_knots, patch.knots)
    return Geom_BSplineSurface(poles, u, v, many_u, many_v, 3, 3), False


def _extruded(patch: ExtrudedPatch) -> Any:
    from OCP.Geom import Geom_SurfaceOfLinearExtrusion
    from OCP.gp import gp_Dir

    way = gp_Dir(*map(float, patch.axes[1]))
    return Geom_SurfaceOfLinearExtrusion(_curve(patch.profile, patch.knots), way)


def _turned(patch: TurnedPatch) -> Any:
    from OCP.Geom import Geom_SurfaceOfRevolution
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt

    axis = gp_Ax1(gp_Pnt(*map(float, patch.origin)), gp_Dir(*map(float, patch.axes[2])))
    return Geom_SurfaceOfRevolution(_curve(patch.profile, patch.knots), axis)


def _curve(control: Floats, knots: Floats) -> Any:
    """A curve in space of these control points (n, 3) mm."""
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt

    poles = [gp_Pnt(*p) for p in control.tolist()]
    degree = len(knots) - len(control) - 1
    return Geom_BSplineCurve(_array("gp_Pnt", poles), *_knots(knots), degree)


def _plane(patch: FlatPatch | ShapePatch) -> Any:
    from OCP.Geom import Geom_Plane

    return Geom_Plane(_place(patch))


def _place(patch: FlatPatch | ShapePatch) -> Any:
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    x, _, z = (gp_Dir(*map(float, row)) for row in patch.axes)
    return gp_Ax3(gp_Pnt(*map(float, patch.origin)), z, x)


def _analytic(patch: ShapePatch) -> Any:
    from OCP import Geom

    place, s = _place(patch), patch.shape
    if s.kind == "plane":
        return _plane(patch)
    if s.kind == "cylinder":
        return Geom.Geom_CylindricalSurface(place, s.radius)
    if s.kind == "sphere":
        return Geom.Geom_SphericalSurface(place, s.radius)
    if s.kind == "torus":
        return Geom.Geom_ToroidalSurface(place, s.radius, s.second)
    return Geom.Geom_ConicalSurface(place, s.second, s.radius)


def _knots(knots: Floats) -> tuple[Any, Any]:
    """Knots as OpenCASCADE takes them: each once, and how often it counts."""
    many = dict[float, int]()
    for t in knots.tolist():
        many[t] = many.get(t, 0) + 1
    return _array("double", [*many]), _array("int", [*many.values()])


def _array(kind: str, values: Sequence[Any]) -> Any:
    from OCP import collections

    out = getattr(collections, f"Array1_{kind}")(1, len(values))
    for k, value in enumerate(values):
        out.SetValue(k + 1, value)
    return out
