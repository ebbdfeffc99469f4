"""Shapes as STEP: an analytic solid where they close, else the triangles, said why."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings import Solid, StepPart, check_opencascade, read_step, solid_of, write_step
from turnscan.errors import ExportError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, is_closed, measured_vertices
from turnscan.remedy import Option, Remedy
from turnscan.shapes import deviation, volume_sigma
from turnscan.shapes.primitives import Shape, ShapeSet, filled_planes
from turnscan.workflows._units import IGES_SUFFIXES, STEP_SUFFIXES

_ALIKE = 0.01
"""Share of the volume that a solid may differ from the mesh by: a mesh cuts its edges."""
_SURE = 3.0
_EXACT = 1e-6
_COVER = 0.8
"""Share of the measured surface that must lie on shapes for a solid of them."""
_FACETS = 0.1
"""Of the shapes' tolerance: how far facets may be off the faces that deviations refer to."""


@dataclass(frozen=True, eq=False)
class StepFile:
    """A STEP file of a part, read back."""

    data: bytes
    solid: bool
    """Whether it holds an analytic solid; else the triangles."""
    finding: Finding
    """What it holds, or why no solid."""
    made: Solid | None
    """The solid, where there is one."""
    figures: dict[str, Any]
    """Faces, volumes, and how far the measured points lie off it, by name with the unit."""


def is_step(path: Path) -> bool:
    """Whether a file's name is that of a STEP file."""
    return path.suffix.lower() in STEP_SUFFIXES


def is_iges(path: Path) -> bool:
    """Whether a file's name is that of an IGES file."""
    return path.suffix.lower() in IGES_SUFFIXES


def check_step(paths: Iterable[Path]) -> None:
    """Raise InputError, before work is spent, where a solid is wanted and none can be made."""
    if any(is_step(path) or is_iges(path) for path in paths):
        check_opencascade()


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


def step_of(mesh: Mesh, found: ShapeSet, name: str, about: Mapping[str, object]) -> StepFile:
    """A part as STEP AP242: the solid that its shapes close to, or its triangles where they do not.

    Raises InputError where OpenCASCADE is not installed, ExportError where the file does not read
    back the same.
    """
    check_opencascade()
    title = Path(name).stem or "part"
    surfaces, added = _surfaces(mesh, found)
    solid = solid_of(mesh, surfaces) if found.coverage >= _COVER else None
    why = _against(mesh, found, solid)
    if solid is None or why:
        return _triangles(mesh, title, about, why)
    data = write_step(solid, title, about)
    part = read_step(data, _FACETS * found.tolerance)
    if part.solids != 1 or not part.valid or abs(part.volume / solid.volume - 1) > _EXACT:
        raise ExportError(
            f"the STEP reads back as {part.solids} solids of {part.volume:.3f} mm³, "
            f"{'valid' if part.valid else 'not valid'}, expected one of {solid.volume:.3f} mm³",
            hint="write the mesh as .ply",
        )
    figures = _figures(mesh, found, solid, part, added)
    closing = f", {added} of them planes of fillings, not measured" if added else ""
    return StepFile(
        data, True,
        Finding(
            "shapes.solid", "note",
            f"a valid solid of {solid.faces} faces{closing}: {solid.volume:.1f} mm³; measured "
            f"points lie {figures['deviation_rms_mm']:.4f} mm (rms) off it, 95 % of them within "
            f"{figures['deviation_p95_mm']:.4f} mm",
        ),
        solid,
        figures,
    )  # fmt: skip


def _against(mesh: Mesh, found: ShapeSet, solid: Solid | None) -> str:
    """Why there is no solid, or not this one; nothing where it is the part's."""
    if found.coverage < _COVER:
        return f"only {found.coverage:.0%} of the measured surface lies on shapes"
    if solid is None:
        return "the shapes do not close to a solid"
    if is_closed(mesh):
        sigma = float(np.nan_to_num(volume_sigma(mesh).total))
        if abs(solid.volume - mesh.volume) > max(_SURE * sigma, _ALIKE * mesh.volume):
            return (
                f"their solid has {solid.volume:.0f} mm³, the mesh {mesh.volume:.0f} ± "
                f"{sigma:.0f} mm³"
            )
    return ""


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
    return StepFile(data, False, finding, None, {"solid": False, "triangles": len(mesh.faces)})


def _figures(
    mesh: Mesh, found: ShapeSet, solid: Solid, part: StepPart, added: int
) -> dict[str, Any]:
    d = deviation(mesh.vertices[measured_vertices(mesh)], part.mesh)
    return {
        "solid": True,
        "faces": solid.faces,
        "faces_not_measured": added,
        "volume_mm3": solid.volume,
        "mesh_volume_mm3": mesh.volume if is_closed(mesh) else None,
        "coverage": found.coverage,
        "deviation_mean_mm": d.mean,
        "deviation_rms_mm": d.rms,
        "deviation_p95_mm": d.quantile(0.95),
        "deviation_max_mm": d.quantile(1.0),
    }


def _surfaces(mesh: Mesh, found: ShapeSet) -> tuple[list[tuple[Shape, Floats]], int]:
    """The shapes with the points on them, and the planes of what was filled; how many of those."""
    out = [(s, mesh.vertices[found.label == k]) for k, s in enumerate(found.shapes)]
    added = 0
    for plane, X in filled_planes(mesh, found.tolerance):
        if any(_on(s, X, found.tolerance) for s in found.shapes):
            continue
        out.append((plane, X))
        added += 1
    return out, added


def _on(s: Shape, X: Floats, tolerance: float) -> bool:
    return float(np.quantile(np.abs(s.distances(X)), 0.9)) <= 2 * tolerance
