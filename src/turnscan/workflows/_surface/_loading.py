"""Loading a surface to measure, from whatever holds one: a mesh file, a scan, a result."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TypeAlias

from turnscan.errors import InputError
from turnscan.formats import read_about
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.scan import Scan
from turnscan.workflows._files._reading import (
    read_mesh_file,
    read_start,
    read_step_file,
    step_findings,
)
from turnscan.workflows._options._units import STEP_SUFFIXES
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._surface._reconstruct import reconstruct
from turnscan.workflows._surface._result import ReconstructResult

Source: TypeAlias = Mesh | ReconstructResult | Scan | str | PathLike[str]
"""What a surface may come from."""


def load(source: Source, unit: str = "mm", progress: Progress = no_progress) -> Loaded:
    """The surface of a mesh file in ``unit``, of a scan as its settings make it, or of a result.

    Raises InputError where there is none, and what `reconstruct` raises.
    """
    if isinstance(source, Mesh):
        return Loaded(source, "the mesh")
    if isinstance(source, str | PathLike) and Path(source).suffix.lower() != ".turnscan":
        path = Path(source)
        if path.suffix.lower() in STEP_SUFFIXES:
            part, about = read_step_file(path), read_about(read_start(path))
            return Loaded(part.mesh, str(path), about, findings=step_findings(part, path))
        return Loaded(read_mesh_file(path, unit), str(path), read_about(read_start(path)))
    if not isinstance(source, ReconstructResult):
        source = reconstruct(source, progress=progress)
    name = str(source.about["source"])
    error = next((f for f in source.findings if f.severity == "error"), None)
    if error is not None:
        raise InputError(f"{name}: {error.message}", hint=error.remedy)
    about = {**source.about, **source.volume()}
    return Loaded(source.mesh, name, about, True, source.findings, source.made_from)
