"""Check of a mesh file: is it sound enough to print or machine?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from turnscan.findings import Finding, record
from turnscan.mesh import Mesh, is_closed, soundness
from turnscan.surface.holes import holes
from turnscan.workflows._files._reading import read_mesh_file


@dataclass(frozen=True)
class CheckedMesh:
    """What a mesh file holds, and whether it is sound."""

    path: Path
    size_bytes: int
    """Of the file."""
    vertices: int
    faces: int
    faces_not_measured: int | None
    """None in a format that cannot say so."""
    closed: bool
    volume_mm3: float | None
    """mm³; None for an open surface."""
    findings: tuple[Finding, ...]

    @property
    def summary(self) -> list[str]:
        """What the file holds, in a line."""
        volume = "" if self.volume_mm3 is None else f", volume {self.volume_mm3:.2f} mm³"
        marked = f"{self.faces_not_measured} not measured"
        if self.faces_not_measured is None:
            marked = "STL cannot mark the measured faces"
        return [
            f"{self.path}: {self.size_bytes / 1e6:.1f} MB, {self.vertices} vertices, "
            f"{self.faces} faces ({marked}){volume}"
        ]

    @property
    def verdict(self) -> str:
        """Whether the mesh is sound, in words."""
        return "NOT SOUND" if self.findings else "sound: closed, manifold, no self-intersections"

    def figures(self) -> dict[str, Any]:
        """All of it by name, to go into JSON."""
        body = asdict(self)
        start = {"file": str(body.pop("path")), "bytes": body.pop("size_bytes")}
        return start | body | {"findings": [record(f) for f in self.findings]}


def check_mesh(path: Path) -> CheckedMesh:
    """Say whether the mesh in a file is closed and sound.

    Raises InputError, FormatError where the file cannot be read.
    """
    mesh = read_mesh_file(path)
    closed, borders, found = is_closed(mesh), holes(mesh), soundness(mesh)
    if not closed:
        size = f", the largest {borders[0].size:.2f} mm across" if borders else ""
        text = f"the surface has {len(borders)} boundaries{size}"
        found.append(
            Finding("surface.open", "warning", text, "", "close the mesh before manufacturing")
        )
    return CheckedMesh(
        path=path,
        size_bytes=path.stat().st_size,
        vertices=len(mesh.vertices),
        faces=len(mesh.faces),
        faces_not_measured=_not_measured(path, mesh),
        closed=closed,
        volume_mm3=mesh.volume if closed else None,
        findings=tuple(found),
    )


def _not_measured(path: Path, mesh: Mesh) -> int | None:
    """How many faces were not measured; None in a format that cannot say so."""
    if path.suffix.lower() == ".stl":
        return None
    return 0 if mesh.measured is None else int((~mesh.measured).sum())
