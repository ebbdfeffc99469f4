"""The analytic surfaces of the faces of a STEP file, as shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.shapes.primitives import Kind, Shape

_SAME = 1e-6
"""Of a shape's size, and radians: surfaces that differ by less are one."""


def shape_of(face: Any, triangles: Floats) -> Shape | None:
    """The surface of a face with its triangles (n, 3, 3) mm, which wind outward; None if freeform.

    What nothing was measured for is zero: the covariance, the count and the misfit.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType as Type

    on = BRepAdaptor_Surface(face)
    kind: Kind
    match on.GetType():
        case Type.GeomAbs_Plane:
            kind, what, radius, second = "plane", on.Plane(), 0.0, 0.0
        case Type.GeomAbs_Cylinder:
            kind, what, second = "cylinder", on.Cylinder(), 0.0
            radius = what.Radius()
        case Type.GeomAbs_Sphere:
            kind, what, second = "sphere", on.Sphere(), 0.0
            radius = what.Radius()
        case Type.GeomAbs_Cone:
            kind, what = "cone", on.Cone()
            radius, second = what.RefRadius(), what.SemiAngle()
        case Type.GeomAbs_Torus:
            kind, what = "torus", on.Torus()
            radius, second = what.MajorRadius(), what.MinorRadius()
        case _:
            return None
    place = what.Position()
    at, along = place.Location(), place.Direction()
    axis = np.array([along.X(), along.Y(), along.Z()])
    twice = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    if kind == "plane" and float(twice.sum(axis=0) @ axis) < 0:
        axis = -axis
    middles = triangles.mean(axis=1)
    t = (triangles.reshape(-1, 3) - [at.X(), at.Y(), at.Z()]) @ axis
    shape = Shape(
        kind, np.array([at.X(), at.Y(), at.Z()]), axis, float(radius), float(second), False,
        np.zeros((7, 7)), 0, float(np.linalg.norm(twice, axis=1).sum() / 2), 0.0,
        0.0 if kind in ("plane", "sphere") else float(np.ptp(t)),
    )  # fmt: skip
    if kind == "plane":
        return replace(shape, point=np.asarray(middles.mean(axis=0) - _off(shape, middles) * axis))
    step = 1e-3 * np.sqrt(np.linalg.norm(twice, axis=1, keepdims=True))
    out = middles + step * twice / np.maximum(np.linalg.norm(twice, axis=1, keepdims=True), 1e-300)
    rise = shape.distances(out) - shape.distances(middles)
    return replace(shape, hollow=bool(rise @ np.linalg.norm(twice, axis=1) < 0))


def _off(plane: Shape, points: Floats) -> float:
    return float(plane.distances(points.mean(axis=0)[None])[0])


def merged(surfaces: Sequence[Shape | None]) -> tuple[tuple[Shape, ...], Ints]:
    """The different surfaces, the largest first, and (n,) which of them each is; −1 for None."""
    groups: list[list[int]] = []
    axes = np.zeros((len(surfaces), 3))
    for k, s in enumerate(surfaces):
        if s is None:
            continue
        alike = np.arange(len(groups))
        if s.kind != "sphere":
            alike = np.flatnonzero(np.abs(axes[: len(groups)] @ s.axis) > 1 - _SAME)
        same = next((groups[g] for g in alike if _same(surfaces[groups[g][0]], s)), None)
        if same is None:
            axes[len(groups)] = s.axis
            groups.append([k])
        else:
            same.append(k)
    whole = []
    for group in groups:
        parts = [s for k in group if (s := surfaces[k]) is not None]
        largest = max(parts, key=lambda s: s.area)
        area = sum(s.area for s in parts)
        whole.append((replace(largest, area=area), group))
    whole.sort(key=lambda one: -one[0].area)
    label = np.full(len(surfaces), -1, dtype=np.int32)
    for number, (_, group) in enumerate(whole):
        label[group] = number
    return tuple(s for s, _ in whole), label


def _same(a: Shape | None, b: Shape) -> bool:
    if a is None or a.kind != b.kind or a.hollow != b.hollow:
        return False
    size = max(a.radius, b.radius, float(np.sqrt(max(a.area, b.area))))
    if abs(a.radius - b.radius) > _SAME * size and a.kind != "cone":
        return False
    dot = float(a.axis @ b.axis)
    away = b.point - a.point
    if a.kind == "sphere":
        return float(np.linalg.norm(away)) < _SAME * size
    if a.kind == "plane":
        return dot > 1 - _SAME**2 / 2 - 1e-12 and abs(float(away @ a.axis)) < _SAME * size
    if abs(dot) < 1 - _SAME**2 / 2 - 1e-12:
        return False
    beside = away - (away @ a.axis) * a.axis
    if float(np.linalg.norm(beside)) > _SAME * size:
        return False
    turned = np.sign(dot)
    if a.kind == "cone":
        there = a.radius + float(away @ a.axis) * np.tan(a.second)
        same = abs(a.second - turned * b.second) < _SAME
        return bool(same and abs(there - b.radius) < _SAME * size)
    if a.kind == "torus":
        level = abs(float(away @ a.axis)) < _SAME * size
        return level and abs(a.second - b.second) < _SAME * size
    return True
