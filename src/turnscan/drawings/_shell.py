"""A shell of trimmed faces by OpenCASCADE, analytic and B-spline ones; a solid where it closes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._parts import volume_of
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.drawings._step import faults_in_file
from turnscan.shapes.patches import (
    Border,
    Borders,
    Charts,
    FlatPatch,
    Patch,
    ShapePatch,
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

    def faults(self) -> frozenset[int]:
        """Charts whose face has faults when it is written as STEP and read back."""
        return frozenset(self.charts[k] for k in faults_in_file(self.solid()))

    def solid(self) -> Solid:
        """The part, to be written."""
        splines = "B-spline solid" if self.solids else "B-spline shell"
        volume = volume_of(self.whole) if self.solids else np.nan
        return Solid(self.whole, volume, len(self.charts), self.solids, splines)


def shell_of(charts: Charts, borders: Borders) -> Shell:
    """The faces of charts that have a surface, trimmed by their borders.

    Raises InputError where OpenCASCADE is not installed.
    """
    check_opencascade()
    from OCP.BRep import BRep_Builder
    from OCP.BRepCheck import BRepCheck_Analyzer

    builder = BRep_Builder()
    vertices = _vertices(builder, borders)
    edges = [_edge(builder, e, vertices) for e in borders.edges]
    made = dict[int, Any]()
    patches = list(charts.patches)
    for k in charts.facets:
        patches[k] = _facet(borders, k)
    for k, (patch, loops) in enumerate(zip(patches, borders.loops, strict=True)):
        if patch is not None:
            made[k] = _face(builder, patch, loops, borders, edges)
    bad = frozenset(
        k
        for k, f in made.items()
        if _gap(charts.patches[k], borders.loops[k], borders) > _WIDE * charts.tolerance
        or not BRepCheck_Analyzer(f).IsValid()
    )
    kept = [k for k in made if k not in bad]
    uses = np.zeros(len(edges), dtype=int)
    for k in kept:
        for loop in borders.loops[k]:
            np.add.at(uses, [e for e, _ in loop], 1)
    if kept and bool((uses[uses > 0] == 2).all()):
        return _closed(builder, kept, made, borders, bad)
    return Shell(tuple(kept), _sewn(builder, [made[k] for k in kept]), 0, bad)


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
    return Shell(tuple(order), whole, len(solids), bad)


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


def _facet(borders: Borders, chart: int) -> FlatPatch | None:
    """The plane of a chart that is one triangle."""
    [loop] = borders.loops[chart]
    ends = (borders.edges[k].first if forward else borders.edges[k].last for k, forward in loop)
    return flat_patch(borders.nodes[list(ends)])


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

    if not isinstance(patch, ShapePatch) or patch.shape.kind == "plane":
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
    if isinstance(patch, FlatPatch):
        return _plane(patch), False
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
    at, many = np.unique(knots, return_counts=True)
    return _array("double", at.tolist()), _array("int", many.tolist())


def _array(kind: str, values: Sequence[Any]) -> Any:
    from OCP import collections

    out = getattr(collections, f"Array1_{kind}")(1, len(values))
    for k, value in enumerate(values):
        out.SetValue(k + 1, value)
    return out
