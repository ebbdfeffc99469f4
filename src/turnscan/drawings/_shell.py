"""A shell of trimmed faces by OpenCASCADE, analytic and B-spline ones; a solid where it closes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._parts import volume_of
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.shapes.patches import Border, Borders, Charts, Patch, ShapePatch, SplinePatch

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
    """TopoDS_Solid where the faces close, else TopoDS_Shell."""
    closed: bool
    bad: frozenset[int]
    """Charts whose face is off its edges, or has faults by OpenCASCADE; ``whole`` lacks them."""

    def solid(self) -> Solid:
        """The part, to be written."""
        splines = "B-spline solid" if self.closed else "B-spline shell"
        volume = volume_of(self.whole) if self.closed else np.nan
        return Solid(self.whole, volume, len(self.charts), self.closed, splines)


def shell_of(charts: Charts, borders: Borders) -> Shell:
    """The faces of charts that have a surface, trimmed by their borders.

    Raises InputError where OpenCASCADE is not installed.
    """
    check_opencascade()
    from OCP.BRep import BRep_Builder
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

    builder = BRep_Builder()
    vertices = _vertices(builder, borders)
    edges = [_edge(builder, e, vertices) for e in borders.edges]
    made = dict[int, Any]()
    for k, (patch, loops) in enumerate(zip(charts.patches, borders.loops, strict=True)):
        if patch is not None:
            made[k] = _face(builder, patch, loops, borders, edges)
    bad = frozenset(
        k
        for k, f in made.items()
        if _gap(charts.patches[k], borders.loops[k], borders) > _WIDE * charts.tolerance
        or not BRepCheck_Analyzer(f).IsValid()
    )
    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    kept = [k for k in made if k not in bad]
    for k in kept:
        builder.Add(shell, made[k])
    uses = np.zeros(len(edges), dtype=int)
    for k in kept:
        for loop in borders.loops[k]:
            np.add.at(uses, [e for e, _ in loop], 1)
    closed = bool(kept) and bool((uses[uses > 0] == 2).all())
    whole: Any = shell
    if closed:
        shell.Closed(True)
        whole = TopoDS_Solid()
        builder.MakeSolid(whole)
        builder.Add(whole, shell)
    return Shell(tuple(kept), whole, closed, bad)


def _gap(
    patch: Patch | None, loops: Sequence[Sequence[tuple[int, bool]]], borders: Borders
) -> float:
    """mm: how far a surface is from the edges about it, at most."""
    curves = (borders.edges[k] for loop in loops for k, _ in loop)
    return max((float(patch.gaps(c.places()).max()) for c in curves if patch), default=0.0)


def _vertices(builder: Any, borders: Borders) -> list[Any]:
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS_Vertex

    tolerance = np.full(len(borders.nodes), _LEAST)
    for e in borders.edges:
        for node in (e.first, e.last):
            tolerance[node] = max(tolerance[node], _ROOM * e.apart)
    out = []
    for x, t in zip(borders.nodes, tolerance, strict=True):
        vertex = TopoDS_Vertex()
        builder.MakeVertex(vertex, gp_Pnt(*map(float, x)), 2 * float(t))
        out.append(vertex)
    return out


def _edge(builder: Any, e: Border, vertices: Sequence[Any]) -> Any:
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
    from OCP.TopoDS import TopoDS_Edge

    poles = [gp_Pnt(*map(float, p)) for p in e.control]
    curve = Geom_BSplineCurve(_array("gp_Pnt", poles), *_knots(e.knots), e.degree)
    edge = TopoDS_Edge()
    builder.MakeEdge(edge, curve, max(_LEAST, _ROOM * e.apart))
    builder.Add(edge, vertices[e.first].Oriented(TopAbs_FORWARD))
    builder.Add(edge, vertices[e.last].Oriented(TopAbs_REVERSED))
    builder.Range(edge, float(e.knots[0]), float(e.knots[-1]))
    return edge


def _face(
    builder: Any, patch: Patch, loops: Sequence[Sequence[tuple[int, bool]]], borders: Borders,
    edges: Sequence[Any],
) -> Any:  # fmt: skip
    """A face, its normal outward."""
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

    surface, inside_out = _surface(patch)
    place, face = TopLoc_Location(), TopoDS_Face()
    builder.MakeFace(face, surface, place, _LEAST)
    for loop in loops:
        wire = TopoDS_Wire()
        builder.MakeWire(wire)
        for k, forward in loop[::-1] if inside_out else loop:
            border = borders.edges[k]
            flat, apart = _flat(border, patch)
            tolerance = max(_LEAST, _ROOM * max(border.apart, apart))
            builder.UpdateEdge(edges[k], flat, surface, place, tolerance)
            builder.SameRange(edges[k], True)
            builder.SameParameter(edges[k], True)
            way = TopAbs_FORWARD if forward != inside_out else TopAbs_REVERSED
            builder.Add(wire, edges[k].Oriented(way))
        wire.Closed(True)
        builder.Add(face, wire)
    return face.Reversed() if inside_out else face


def _flat(border: Border, patch: Patch) -> tuple[Any, float]:
    """An edge in the parameters of a surface, and how far the two are apart at most, mm."""
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.gp import gp_Pnt2d
    from scipy.interpolate import BSpline, make_interp_spline

    if isinstance(patch, SplinePatch) or patch.shape.kind == "plane":
        uv, knots, degree, apart = (
            patch.parameters(border.control), border.knots, border.degree, 0.0
        )  # fmt: skip
    else:
        space = BSpline(border.knots, border.control, border.degree)
        inner = np.unique(border.knots)
        t = np.unique(np.concatenate([a + (b - a) * np.linspace(0, 1, 5) for a, b in
                                      itertools.pairwise(inner)]))  # fmt: skip
        degree = min(3, len(t) - 1)
        curve = make_interp_spline(t, patch.parameters(space(t)), k=degree)
        uv, knots, apart = curve.c, curve.t, border.apart / 2
    poles = [gp_Pnt2d(float(u), float(v)) for u, v in uv]
    return Geom2d_BSplineCurve(_array("gp_Pnt2d", poles), *_knots(knots), degree), apart


def _surface(patch: Patch) -> tuple[Any, bool]:
    """The surface of OpenCASCADE, and whether its normal points into the material."""
    if isinstance(patch, ShapePatch):
        return _analytic(patch), patch.shape.hollow and patch.shape.kind != "plane"
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


def _analytic(patch: ShapePatch) -> Any:
    from OCP import Geom
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    x, _, z = (gp_Dir(*map(float, row)) for row in patch.axes)
    place, s = gp_Ax3(gp_Pnt(*map(float, patch.origin)), z, x), patch.shape
    if s.kind == "plane":
        return Geom.Geom_Plane(place)
    if s.kind == "cylinder":
        return Geom.Geom_CylindricalSurface(place, s.radius)
    if s.kind == "sphere":
        return Geom.Geom_SphericalSurface(place, s.radius)
    if s.kind == "torus":
        return Geom.Geom_ToroidalSurface(place, s.radius, s.second)
    return Geom.Geom_ConicalSurface(place, s.second, s.radius)


def _knots(knots: Floats) -> tuple[Any, Any]:
    """Knots as OpenCASCADE takes them: each once, and how often it counts."""
    at, many = np.unique(knots, return_counts=True)
    return _array("double", at.tolist()), _array("int", many.tolist())


def _array(kind: str, values: Sequence[Any]) -> Any:
    from OCP import collections

    out = getattr(collections, f"Array1_{kind}")(1, len(values))
    for k, value in enumerate(values):
        out.SetValue(k + 1, value)
    return out
