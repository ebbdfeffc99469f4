"""A solid from shapes, by OpenCASCADE: every surface extended, all of them intersected at once.

The faces, each reaching a little beyond what was measured on its surface, cut space into cells; the
cells whose inside is the inside of the mesh make the part, and their common faces are taken out.
Edges are where surfaces meet, not where the mesh has its vertices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._document import Colour, tessellated
from turnscan.drawings._facets import Facets, facets_of
from turnscan.drawings._iges import iges_of, reads_as
from turnscan.drawings._parts import parts_of, volume_of
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import Shape

ANALYTIC = "analytic solid"
_BEYOND, _FAR = 0.1, 1.0
"""Of the part's size: how far each face goes on beyond what was measured on it. A face that is
mostly hidden may end far from there; but faces that cross the whole part make many cells."""
_SLIVER = 1e-3
"""Of the box about the part: cells of less volume are left out where they are in doubt."""
_TRIES = 400
_PROBES = 15
"""Points of a cell that are looked for in the mesh."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Solids of OpenCASCADE, or a shell that does not close, and what it is."""

    shape: Any
    """TopoDS_Shape, mm."""
    volume: float
    """mm³; NaN for a shell."""
    faces: int
    solids: int = 1
    """How many there are; 0 for a shell."""
    kind: str = ANALYTIC
    """What the header of a file calls it."""
    colours: Mapping[int, Colour] = field(default_factory=dict)
    """Of its faces, by their number from 0."""
    rest: Mesh | None = None
    """Where no face could be made: triangles, which STEP can hold and IGES cannot."""

    @property
    def closed(self) -> bool:
        """Whether it is solid."""
        return self.solids > 0

    @property
    def whole(self) -> Any:
        """The shape and the rest, for a file that can hold triangles."""
        if self.rest is None:
            return self.shape
        from OCP.BRep import BRep_Builder
        from OCP.TopoDS import TopoDS_Compound

        both = TopoDS_Compound()
        BRep_Builder().MakeCompound(both)
        BRep_Builder().Add(both, self.shape)
        BRep_Builder().Add(both, tessellated(self.rest))
        return both

    def facets(self, deflection: float) -> Facets:
        """Its faces as triangles within ``deflection`` mm of them, without the rest."""
        return facets_of(self.shape, deflection)

    def iges(self, name: str) -> bytes:
        """Its faces as IGES, mm, in their colours; ``name`` is that of the product.

        Raises ExportError where OpenCASCADE refuses.
        """
        return iges_of(self.shape, name, self.colours)

    def is_in_iges(self, path: str) -> bool:
        """Whether the IGES file at a path holds it, as OpenCASCADE reads it."""
        return reads_as(path, self.shape, self.solids)


def check_opencascade() -> None:
    """Raise InputError, naming the extra, where OpenCASCADE's bindings are not installed."""
    try:
        import OCP  # noqa: F401
    except ImportError:
        raise InputError(
            "STEP needs OpenCASCADE, which is not installed",
            hint="pip install 'turnscan[cad]'",
        ) from None


def solid_of(
    mesh: Mesh, surfaces: Sequence[tuple[Shape, Floats]], far: bool = False
) -> Solid | None:
    """The solid that surfaces bound, each given with the points (n, 3) mm measured on it.

    Each goes on beyond these a little, or ``far``, across the whole part. None where they do not
    close. Raises InputError where OpenCASCADE is not installed.
    """
    check_opencascade()
    margin = (_FAR if far else _BEYOND) * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    cells = _cells([_face(s, X, margin) for s, X in surfaces])
    inside = [_is_inside(c, mesh) for c in cells]
    kept = [c for c, is_in in zip(cells, inside, strict=True) if is_in]
    if not kept or None in inside:
        return None
    whole = _united(kept)
    if whole is None:
        return None
    return Solid(whole, volume_of(whole), len(parts_of(whole, "face")))


def _axes(s: Shape) -> Any:
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    return gp_Ax3(gp_Pnt(*map(float, s.point)), gp_Dir(*map(float, s.axis)))


def _face(s: Shape, X: Floats, margin: float) -> Any:
    """A bounded face that covers the points on a shape and goes on by a margin."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.Geom import Geom_ToroidalSurface
    from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Sphere

    place = _axes(s)
    turn = 2 * np.pi
    t = (X - s.point) @ s.axis
    if s.kind == "plane":
        x, y = ((X - s.point) @ _vector(d) for d in (place.XDirection(), place.YDirection()))
        return BRepBuilderAPI_MakeFace(
            gp_Pln(place), float(x.min()) - margin, float(x.max()) + margin,
            float(y.min()) - margin, float(y.max()) + margin,
        ).Face()  # fmt: skip
    low, high = float(t.min()) - margin, float(t.max()) + margin
    if s.kind == "cylinder":
        return BRepBuilderAPI_MakeFace(gp_Cylinder(place, s.radius), 0, turn, low, high).Face()
    if s.kind == "sphere":
        return BRepBuilderAPI_MakeFace(gp_Sphere(place, s.radius)).Face()
    if s.kind == "torus":
        surface = Geom_ToroidalSurface(place, s.radius, s.second)
        return BRepBuilderAPI_MakeFace(surface, 1e-6).Face()
    apex = -s.radius / np.tan(s.second)
    if s.second > 0:
        low = max(low, apex + 1e-6)
    else:
        high = min(high, apex - 1e-6)
    along = np.cos(s.second)
    return BRepBuilderAPI_MakeFace(
        gp_Cone(place, s.second, s.radius), 0, turn, low / along, high / along
    ).Face()


def _vector(direction: Any) -> Floats:
    return np.array([direction.X(), direction.Y(), direction.Z()])


def _listed(shapes: Sequence[Any]) -> Any:
    from OCP.collections import List_TopoDS_Shape

    out = List_TopoDS_Shape()
    for shape in shapes:
        out.Append(shape)
    return out


def _cells(faces: Sequence[Any]) -> list[Any]:
    from OCP.BOPAlgo import BOPAlgo_MakerVolume

    maker = BOPAlgo_MakerVolume()
    maker.SetArguments(_listed(faces))
    maker.SetIntersect(True)
    maker.Perform()
    return [] if maker.HasErrors() else parts_of(maker.Shape(), "solid")


def _is_inside(cell: Any, mesh: Mesh) -> bool | None:
    """Whether most points of a cell are inside the mesh (generalised winding number).

    None where no point was found of one that matters: a thin one fills little of the box about it.
    """
    import igl
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_IN

    box = Bnd_Box()
    BRepBndLib.Add_s(cell, box)
    low, high = (np.array([p.X(), p.Y(), p.Z()]) for p in (box.CornerMin(), box.CornerMax()))
    judge = BRepClass3d_SolidClassifier(cell)
    dice = np.random.default_rng(0)
    inside = []
    for x in dice.uniform(low, high, (_TRIES, 3)):
        judge.Perform(gp_Pnt(*map(float, x)), 1e-7)
        if judge.State() == TopAbs_IN:
            inside.append(x)
            if len(inside) == _PROBES:
                break
    if not inside:
        box_of_part = float(np.prod(np.ptp(mesh.vertices, axis=0)))
        return False if volume_of(cell) < _SLIVER * box_of_part else None
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), np.array(inside))
    return bool(np.mean(winding) > 0.5)


def _united(cells: Sequence[Any]) -> Any | None:
    """One valid solid of the cells, faces of one surface made one; None where there is none."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    whole = cells[0]
    if len(cells) > 1:
        fuse = BRepAlgoAPI_Fuse()
        fuse.SetArguments(_listed(cells[:1]))
        fuse.SetTools(_listed(cells[1:]))
        fuse.Build()
        if not fuse.IsDone():
            return None
        whole = fuse.Shape()
    simple = ShapeUpgrade_UnifySameDomain(whole, True, True, True)
    simple.Build()
    whole = simple.Shape()
    solids = parts_of(whole, "solid")
    if len(solids) != 1 or not BRepCheck_Analyzer(whole).IsValid():
        return None
    return solids[0]
