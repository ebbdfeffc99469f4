"""Shapes as STEP: a solid of them where they close, else with B-splines between, said why."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.drawings import (
    ANALYTIC,
    Facets,
    Solid,
    StepPart,
    check_opencascade,
    read_step,
    solid_of,
    write_step,
)
from turnscan.errors import ExportError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, is_closed, measured_vertices, submesh
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.shapes import volume_sigma
from turnscan.shapes.patches import Charts, ExtrudedPatch, ShapePatch, SplinePatch, TurnedPatch
from turnscan.shapes.primitives import Shape, ShapeSet, filled_planes, normals_and_distances
from turnscan.shapes.swept import Swept
from turnscan.workflows._solids._face_deviations import (
    FaceDeviations,
    face_deviations,
    nearest_faces,
)
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._solids._shapes_shell import shell_under
from turnscan.workflows._solids._shapes_table import finite
from turnscan.workflows._solids._solid_volume import SolidVolume, solid_volume

_ALIKE = 0.01
"""Share of the volume that a solid may differ from the mesh by: a mesh cuts its edges."""
_SURE = 3.0
_EXACT = 1e-6
_MOST_FAR = 24
"""Surfaces that are let go across the whole part; the cells between them grow with their cube."""
_COVER = 0.8
"""Share of the measured surface that must lie on shapes for a solid of them."""
_LARGE = 0.01
"""Share of the surface from which a filling is a face that was not seen, and no gap at an edge."""
_LOST = 0.05
"""Share of the measured points, and of those on shapes, that may lie off the solid of shapes: it
lacks what it has no shape for, such as pockets and fillets, and no volume of a mesh that is open or
largely filled says so."""
_SETTLED = 1e-3
"""Share of the volume that may change where edges lie within a tolerance of their faces: every
reader places them again."""
_FACETS = 0.1
"""Of the shapes' tolerance: how far facets may be off the faces that deviations refer to."""
_ALONG, _OPPOSITE = 0.9, -0.95
"""Cosines between normals of fillings and of shapes."""


@dataclass(frozen=True, eq=False)
class StepFile:
    """A STEP file of a part, read back."""

    data: bytes
    findings: tuple[Finding, ...]
    """What it holds, and why no more than that."""
    made: Solid | None
    """The solid or shell, where there is one; else the file holds the triangles."""
    figures: dict[str, Any]
    """Faces, volumes, and how far the measured points lie off it, by name with the unit."""
    deviations: FaceDeviations | None = None
    """How measured points lie to its faces."""
    volume: SolidVolume | None = None
    """Of a solid, with its uncertainty."""

    @property
    def solid(self) -> bool:
        """Whether it holds a solid."""
        return self.made is not None and self.made.closed


def iges_of(solid: Solid, name: str) -> bytes:
    """A solid as IGES, read back.

    Raises ExportError where the file does not read back the same.
    """
    data = solid.iges(name)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / "part.igs"
            path.write_bytes(data)
            same = solid.is_in_iges(str(path))
    except OSError as e:
        raise ExportError(
            f"the IGES could not be read back: no temporary file: {e.strerror or e}",
            hint="write a .step, or make room in the folder of temporary files",
        ) from None
    if not same:
        raise ExportError("the IGES does not read back the same", hint="write a .step")
    return data


def step_of(
    surface: Loaded,
    found: ShapeSet,
    swept: Callable[[], Sequence[Swept]],
    progress: Progress = no_progress,
) -> StepFile:
    """A part as STEP AP242, each face in the colour of its deviation.

    It is the solid that the shapes close to. Where they do not, it is made of their parts that were
    measured and of B-splines fitted to the rest, a shell if the mesh is open; triangles stand where
    no surface is within the tolerance. ``swept`` finds the swept pieces of the rest, where they are
    needed. The part has the name of the surface.

    Raises InputError where OpenCASCADE is not installed, ExportError where the file does not read
    back the same; Cancelled where it is no longer wanted.
    """
    check_opencascade()
    progress(0.0, "closing the shapes to a solid")
    mesh = surface.mesh
    title, about = _title(surface), surface.about
    made, why = _analytic(mesh, found)
    if made is None:
        rest = progress.subrange(0.2, 1.0)
        return _of_patches(surface, found, swept(), why, rest)
    sigma = _sigma(mesh, measured_vertices(mesh))
    off = face_deviations(made.distance, made.face, made.facets, made.solid.faces, sigma=sigma)
    file = _written(off, found, made.solid, title, about)
    closing = f", {made.added} of them planes of fillings, not measured" if made.added else ""
    volume = solid_volume(made.solid.volume, surface, found, made.facets)
    return _told(mesh, found, file, closing, {"faces_not_measured": made.added}, volume)


@dataclass(frozen=True, eq=False)
class _Analytic:
    """A solid of shapes and of planes of fillings, with how measured points lie to it."""

    solid: Solid
    added: int
    """Planes of fillings among its surfaces."""
    facets: Facets
    distance: Floats
    """(n,) mm of the measured vertices."""
    face: Ints
    """(n,) the triangle of ``facets`` that is nearest."""


def _analytic(mesh: Mesh, found: ShapeSet) -> tuple[_Analytic | None, str]:
    """The solid that shapes close to, else with as few planes of fillings as close it; or why not.

    Small fillings lie along edges that were not seen: where large ones close the part they would
    cut its edges off. A face that is mostly hidden goes on further than the others, where that is
    asked of few enough.
    """
    if found.coverage < _COVER:
        return None, f"only {found.coverage:.0%} of the measured surface lies on shapes"
    shapes, fillings = _surfaces(mesh, found)
    large = sum(plane.area >= _LARGE * mesh.area_of() for plane, _ in fillings)
    known, why = measured_vertices(mesh), ""
    for added, far in itertools.product(sorted({0, large, len(fillings)}), (False, True)):
        if far and len(shapes) + added > _MOST_FAR:
            continue
        solid = solid_of(mesh, [*shapes, *fillings[:added]], far)
        why = _against(mesh, solid)
        if solid is None or why:
            continue
        facets = solid.facets(_FACETS * found.tolerance)
        distance, face = nearest_faces(mesh.vertices[known], facets)
        off_it = np.abs(distance) > 2 * found.tolerance
        lost, of_shapes = off_it.mean(), off_it[found.label[known] >= 0].mean()
        if max(lost, of_shapes) <= _LOST:
            return _Analytic(solid, added, facets, distance, face), ""
        what = "points on shapes" if of_shapes > _LOST else "measured points"
        why = f"their solid lacks {of_shapes if of_shapes > _LOST else lost:.0%} of the {what}"
    return None, why


def _of_patches(
    surface: Loaded, found: ShapeSet, swept: Sequence[Swept], why: str, progress: Progress
) -> StepFile:
    mesh, title, about = surface.mesh, _title(surface), surface.about
    shell, charts = shell_under(mesh, found, swept, progress.subrange(0.0, 0.7))
    progress(0.7, "writing the faces and reading them back")
    if not shell.charts:
        return _triangles(mesh, title, about, f"{why}, and no B-spline is within the tolerance")
    left = ~np.isin(charts.label, shell.charts)
    solid = shell.solid()
    if solid.closed and (wrong := _other_volume(mesh, solid)):
        return _triangles(mesh, title, about, f"{why}, and of the solid with B-splines {wrong}")
    if left.any():
        solid = replace(solid, rest=submesh(mesh, left))
    distance, chart, vertex = charts.distances(mesh)
    face = np.full(len(charts.patches), -1, dtype=np.int32)
    face[list(shell.charts)] = np.arange(solid.faces)
    on = face[chart] >= 0
    alone = [n for n, k in enumerate(shell.charts) if k in charts.facets]
    facets = _on_faces(mesh, charts, face)
    sigma = _sigma(mesh, vertex[on])
    off = face_deviations(distance[on], face[chart[on]], facets, solid.faces, alone, sigma)
    try:
        made = _written(off, found, solid, title, about)
    except ExportError as e:
        return _triangles(mesh, title, about, f"{why}, and {e.message}")
    splines = sum(isinstance(charts.patches[k], SplinePatch) for k in shell.charts)
    flat = f", {len(alone)} triangles of the mesh where no surface fits" if alone else ""
    many = sum(isinstance(charts.patches[k], ExtrudedPatch | TurnedPatch) for k in shell.charts)
    drawn = f", {many} of them swept" if many else ""
    pieces = f"{drawn}, {splines} of them B-splines{flat}: {why}"
    more = {
        "faces_swept": many,
        "faces_bspline": splines,
        "faces_triangles": len(alone),
        "triangles": int(left.sum()),
    }
    known = solid_volume(solid.volume, surface, found, facets) if solid.closed else None
    told = _told(mesh, found, made, pieces, more, known)
    if not left.any():
        return told
    text = f"no surface is within the tolerance on {left.sum()} triangles: they stand as they are"
    remedy = Remedy("allow for more with ", Option("tolerance"))
    rest = Finding("shapes.triangles", "warning", text, remedy=remedy)
    return replace(told, findings=(*told.findings, rest))


def _title(surface: Loaded) -> str:
    return Path(surface.name).stem or "part"


def _sigma(mesh: Mesh, vertices: Bools | Longs) -> Floats | None:
    return None if mesh.provenance is None else mesh.provenance.sigma[vertices]


def _on_faces(mesh: Mesh, charts: Charts, face: Ints) -> Facets:
    """The triangles of a mesh moved onto faces, by the number of the face (charts,); −1 without
    one."""
    number, X = face[charts.label], mesh.vertices.copy()
    for k in np.flatnonzero(face >= 0):
        if (patch := charts.patches[k]) is not None:
            corners = np.unique(mesh.faces[charts.label == k])
            off, normal = patch.offsets(X[corners])
            X[corners] -= off[:, None] * normal
    own = submesh(replace(mesh, vertices=X), number >= 0)
    chart = np.flatnonzero(face >= 0)[np.argsort(face[face >= 0])]
    surfaces = [p.shape if isinstance(p := charts.patches[k], ShapePatch) else None for k in chart]
    return Facets(own, number[number >= 0], surfaces, range(len(chart)), 0)


def _written(
    off: FaceDeviations, found: ShapeSet, solid: Solid, title: str, about: Mapping[str, object]
) -> StepFile:
    """The file of a solid or shell in the colours of its faces, read back."""
    solid = replace(solid, colours=off.colours)
    data = write_step(solid, title, {**about, "face_colours": str(off)})
    part = StepPart.of(data)
    exact = _EXACT if solid.kind == ANALYTIC else _SETTLED
    same = part.solids == solid.solids and part.valid
    if solid.closed:
        same &= abs(part.volume / solid.volume - 1) <= exact
    if not same:
        wanted = f"{solid.solids} of {solid.volume:.3f} mm³" if solid.closed else "a shell"
        raise ExportError(
            f"the STEP reads back as {part.solids} solids of {part.volume:.3f} mm³, "
            f"{'valid' if part.valid else 'not valid'}, expected {wanted}",
            hint="write the mesh as .ply",
        )
    return StepFile(data, (), solid, {}, off)


def _told(
    mesh: Mesh, found: ShapeSet, made: StepFile, pieces: str, more: Mapping[str, object],
    known: SolidVolume | None,
) -> StepFile:  # fmt: skip
    """A file with what there is to say of it; ``known`` is the volume of a solid."""
    solid, off = made.made, made.deviations
    assert solid is not None
    assert off is not None
    figures = {
        "solid": solid.closed,
        "solids": solid.solids,
        "faces": solid.faces,
        **more,
        "volume_mm3": finite(solid.volume),
        **({} if known is None else known.figures()),
        "mesh_volume_mm3": mesh.volume if is_closed(mesh) else None,
        "coverage": found.coverage,
        "deviation_mean_mm": finite(float(np.mean(off.distance)) if len(off.distance) else np.nan),
        "deviation_rms_mm": finite(off.rms),
        "deviation_over_sigma_rms": finite(off.rms_over_sigma),
        "deviation_p95_mm": finite(off.quantile(0.95)),
        "deviation_max_mm": finite(off.quantile(1.0)),
        "colour_width_mm": off.width,
        "face_deviations": off.figures(),
    }
    where = "open where triangles stand"
    if solid.rest is None:
        inward = "for a body of the mesh faces inward and lies within no other"
        where = inward if is_closed(mesh) else "open as the mesh is"
    solids = "a valid solid" if solid.solids == 1 else f"{solid.solids} valid solids"
    what = f"{solids if solid.closed else f'a valid shell, {where},'} of"
    volume = "" if known is None else f": {known}"
    times = off.rms_over_sigma
    over = f", {times:.2f} of their own uncertainties (rms)" if np.isfinite(times) else ""
    text = (
        f"{what} {solid.faces} faces{pieces}{volume}; measured points lie {off.rms:.4f} mm (rms) "
        f"off it{over}, 95 % of them within {off.quantile(0.95):.4f} mm"
    )
    code = "shapes.solid" if solid.closed else "shapes.shell"
    return replace(made, findings=(Finding(code, "note", text),), figures=figures, volume=known)


def _against(mesh: Mesh, solid: Solid | None) -> str:
    """Why there is no solid, or not this one; nothing where it is the part's."""
    if solid is None:
        return "the shapes do not close to a solid"
    wrong = _other_volume(mesh, solid)
    return f"of their solid {wrong}" if wrong else ""


def _other_volume(mesh: Mesh, solid: Solid) -> str:
    """How the volume of a solid contradicts the mesh; nothing where it does not, or the mesh is
    open and tells none."""
    if not is_closed(mesh):
        return ""
    sigma = float(np.nan_to_num(volume_sigma(mesh).total))
    if abs(solid.volume - mesh.volume) <= max(_SURE * sigma, _ALIKE * abs(mesh.volume)):
        return ""
    return f"the volume is {solid.volume:.0f} mm³, of the mesh {mesh.volume:.0f} ± {sigma:.0f} mm³"


def _triangles(mesh: Mesh, title: str, about: Mapping[str, object], why: str) -> StepFile:
    data = write_step(mesh, title, about)
    back = read_step(data, 1.0).mesh
    if len(back.faces) != len(mesh.faces):
        raise ExportError(
            f"the STEP reads back with {len(back.faces)} faces, expected {len(mesh.faces)}",
            hint="write the mesh as .ply",
        )
    remedy = Remedy("close the mesh in the reconstruction, or give a larger ", Option("tolerance"))
    text = f"the STEP holds the triangles, not analytic faces: {why}"
    finding = Finding("shapes.triangles", "warning", text, remedy=remedy)
    return StepFile(data, (finding,), None, {"solid": False, "triangles": len(mesh.faces)})


Surface = tuple[Shape, Floats]
"""A shape, and the points (n, 3) mm on it."""


def _surfaces(mesh: Mesh, found: ShapeSet) -> tuple[list[Surface], list[Surface]]:
    """The shapes, and the planes of what was filled, the largest first."""
    out = [(s, mesh.vertices[found.label == k]) for k, s in enumerate(found.shapes)]
    filled = sorted(filled_planes(mesh, found.tolerance), key=lambda one: -one[0].area)
    added = list[Surface]()
    for plane, X in filled:
        there = (*found.shapes, *(p for p, _ in added))
        if any(_on(s, plane, X, found.tolerance) for s in there):
            continue
        if not any(_faces(p, Y, plane, X, found) for p, Y in added):
            added.append((plane, X))
    return out, added


def _faces(a: Shape, A: Floats, b: Shape, B: Floats, found: ShapeSet) -> bool:
    """Whether two fillings look at each other across a gap within the noise: there the part goes
    on, and the smaller is no face of it."""
    away = b.point - a.point
    gap = float(away @ a.axis)
    beside = float(np.linalg.norm(away - gap * a.axis))
    reach = max(float(np.linalg.norm(X - s.point, axis=1).max()) for s, X in ((a, A), (b, B)))
    opposite = float(a.axis @ b.axis) < _OPPOSITE
    return opposite and 0 < gap < 2 * found.tolerance and beside < reach


def _on(s: Shape, plane: Shape, X: Floats, tolerance: float) -> bool:
    """Whether a filling is a part of a shape: it lies in it. The rim of a lid lies on the wall
    as well, and the border of a face that ends in gaps on that face."""
    normal, off = normals_and_distances(s, X)[::-1]
    near = float(np.quantile(np.abs(off), 0.9)) <= 2 * tolerance
    return near and abs(float(np.median(normal @ plane.axis))) > _ALONG
