"""A solid that a profile sweeps about its axis, by OpenCASCADE."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._parts import parts_of, volume_of
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.errors import ExportError
from turnscan.shapes import Arc, Outline, Piece, Spline

_ON = 1e-6
"""mm: places no further apart are one."""


def revolved_solid(outlines: Sequence[Outline], point: Floats, basis: Floats) -> tuple[Solid, int]:
    """The solid of a profile (r, z) about an axis through ``point`` (3,) mm, ``basis`` (3, 3) rows
    across and along it; and how many straight lines close the profile that nobody measured.

    Each outline runs with the material on its left. An open end goes on to the nearest beginning of
    the next outline, the last to the axis at its own height.

    Raises InputError where OpenCASCADE is not installed, ExportError where the profile does not
    close to a sound solid.
    """
    check_opencascade()
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeRevol
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt
    from OCP.ShapeFix import ShapeFix_Solid
    from OCP.TopoDS import TopoDS

    if not outlines:
        raise _unsound("nothing of it was fitted")
    loop, added = _closed(outlines)
    wire = BRepBuilderAPI_MakeWire()
    for first, last, piece in loop:
        wire.Add(_edge(first, last, piece, point, basis))
        if not wire.IsDone():
            raise _unsound("its pieces do not meet")
    face = BRepBuilderAPI_MakeFace(wire.Wire(), True)
    if not face.IsDone():
        raise _unsound("it crosses itself")
    axis = gp_Ax1(gp_Pnt(*map(float, point)), gp_Dir(*map(float, basis[2])))
    made = BRepPrimAPI_MakeRevol(face.Face(), axis)
    solids = parts_of(made.Shape(), "solid") if made.IsDone() else []
    if len(solids) != 1:
        raise _unsound("it makes no solid")
    fix = ShapeFix_Solid(TopoDS.Solid(solids[0]))
    fix.Perform()
    (solid,) = parts_of(fix.Solid(), "solid")
    volume = volume_of(solid)
    if not BRepCheck_Analyzer(solid).IsValid() or not volume > 0:
        raise _unsound("OpenCASCADE finds faults in its solid")
    return Solid(solid, volume, len(parts_of(solid, "face"))), added


def _unsound(why: str) -> ExportError:
    return ExportError(
        f"the profile cannot be revolved to a solid: {why}",
        hint="measure more of the wall, or write the profile as .dxf",
    )


Step = tuple[Floats, Floats, Piece | None]
"""From, to, and the piece between; None for a straight line that was not measured."""


def _closed(outlines: Sequence[Outline]) -> tuple[list[Step], int]:
    """The profile as one loop, closed where it is open; how many lines were added."""
    ring = [o for o in outlines if o.closed]
    if ring:
        if len(outlines) > 1:
            raise _unsound("it is a closed ring and more")
        return _steps(ring[0], None), 0
    order = _in_order(outlines)
    out = list[Step]()
    for outline in order:
        out += _steps(outline, out[-1][1] if out else None)
    low, high = out[-1][1], out[0][0]
    foot, top = np.array([0.0, low[1]]), np.array([0.0, high[1]])
    way = [low, foot, top, high]
    links = [(a, b, None) for a, b in pairwise(way) if float(np.linalg.norm(b - a)) > _ON]
    along = float(abs(low[1] - high[1])) > _ON
    return [*out, *links], sum(s[2] is None for s in (*out, *links)) - along


def _in_order(outlines: Sequence[Outline]) -> list[Outline]:
    """The longest first, and to both sides of it those whose ends are nearest."""
    waiting = sorted(outlines, key=lambda o: -sum(p.length for p in o.pieces))
    order = [waiting.pop(0)]
    while waiting:
        tail, head = order[-1].pieces[-1].end, order[0].pieces[0].start
        behind = [float(np.linalg.norm(o.pieces[0].start - tail)) for o in waiting]
        before = [float(np.linalg.norm(o.pieces[-1].end - head)) for o in waiting]
        if min(behind) <= min(before):
            order.append(waiting.pop(int(np.argmin(behind))))
        else:
            order.insert(0, waiting.pop(int(np.argmin(before))))
    return order


def _steps(outline: Outline, begin: Floats | None) -> list[Step]:
    """The pieces of an outline, each beginning where the one before ends."""
    out = list[Step]()
    first = outline.pieces[0].start
    if begin is not None and float(np.linalg.norm(first - begin)) > _ON:
        out.append((begin, first, None))
    at = first
    pieces = [half for p in outline.pieces for half in _halved(p)]
    for k, piece in enumerate(pieces):
        last = outline.closed and k == len(pieces) - 1
        end = first if last else piece.end
        if float(np.linalg.norm(end - at)) > _ON or isinstance(piece, Arc):
            out.append((at, end, piece))
        at = end
    return out


def _halved(piece: Piece) -> list[Piece]:
    """A full circle as two arcs, for an edge needs two ends."""
    if not (isinstance(piece, Arc) and piece.full):
        return [piece]
    half = piece.sweep / 2
    return [replace(piece, sweep=half), replace(piece, begin=piece.begin + half, sweep=half)]


def _edge(first: Floats, last: Floats, piece: Piece | None, point: Floats, basis: Floats) -> Any:
    """An edge in the half-plane of the axis and the first direction across it."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.GC import GC_MakeArcOfCircle
    from OCP.gp import gp_Pnt

    def placed(p: Floats) -> Any:
        return gp_Pnt(*map(float, point + p[0] * basis[0] + p[1] * basis[2]))

    if isinstance(piece, Arc):
        half = piece.begin + piece.sweep / 2
        middle = piece.centre + piece.radius * np.array([np.cos(half), np.sin(half)])
        arc = GC_MakeArcOfCircle(placed(first), placed(middle), placed(last))
        if arc.IsDone():
            return BRepBuilderAPI_MakeEdge(arc.Value()).Edge()
    if isinstance(piece, Spline):
        return _spline(first, last, piece, placed)
    return BRepBuilderAPI_MakeEdge(placed(first), placed(last)).Edge()


def _spline(first: Floats, last: Floats, piece: Spline, placed: Any) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_int
    from OCP.Geom import Geom_BSplineCurve

    control = piece.control.copy()
    control[0], control[-1] = first, last
    knots, times = np.unique(piece.knots, return_counts=True)
    poles = Array1_gp_Pnt(1, len(control))
    for k, p in enumerate(control):
        poles.SetValue(k + 1, placed(p))
    at, many = Array1_double(1, len(knots)), Array1_int(1, len(knots))
    for k, (t, n) in enumerate(zip(knots, times, strict=True)):
        at.SetValue(k + 1, float(t))
        many.SetValue(k + 1, int(n))
    return BRepBuilderAPI_MakeEdge(Geom_BSplineCurve(poles, at, many, 3)).Edge()
