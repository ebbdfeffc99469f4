"""Export: a surface in other formats, decimated where that is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.formats import ExportOptions
from turnscan.mesh import Mesh, soundness
from turnscan.progress import Progress, no_progress
from turnscan.surface import decimation as thinning
from turnscan.surface import mesh_findings
from turnscan.surface.clean import settled
from turnscan.workflows._options._reconstruct import decimation
from turnscan.workflows._options._units import check_suffixes
from turnscan.workflows._surface._loading import Source, load
from turnscan.workflows._surface._saving import save


@dataclass(frozen=True, eq=False)
class Exported:
    """What was written."""

    mesh: Mesh
    """The surface as it is in the files."""
    findings: tuple[Finding, ...]
    """Of the reconstruction and of decimating, and what is not sound about the surface."""
    remarks: tuple[Finding, ...]
    """Of reading the files back."""


def export(
    source: Source,
    *paths: str | PathLike[str],
    formats: ExportOptions | None = None,
    decimate: str | None = None,
    progress: Progress = no_progress,
) -> Exported:
    """Write a surface in formats that the suffixes of the files name, each read back and compared.

    Parameters
    ----------
    source
        A mesh, a mesh file in mm, the result of `reconstruct`, or a scan, which is reconstructed
        with its own settings.
    paths
        Files to write: .dxf .stl .ply .obj .3mf .glb .xyz, and .step (or .stp): a solid or
        shell of the part's shapes and of B-splines.
    formats
        Choices about the formats; None takes the usual ones.
    decimate
        Thin the mesh out: a tolerance like ``0.05mm``, or a number of faces like ``100000``.
    progress
        Told how far the work is; it may cancel.

    Returns
    -------
    Exported
        The surface as it was written, and remarks.

    Raises
    ------
    InputError
        Where a format is unknown, profiles are asked for, which only `reconstruct` has, or STEP
        without OpenCASCADE.
    ExportError
        Where a file cannot be written or does not read back the same.

    >>> import turnscan as ts
    >>> done = ts.export("cup.turnscan", "cup.stl", decimate="500")
    >>> len(done.mesh.faces) <= 500
    True
    """
    chosen = formats or ExportOptions()
    if "profiles" in chosen.dxf_forms:
        raise InputError("a mesh file holds no profiles", hint="reconstruct the scan with them")
    files = list(map(Path, paths))
    most = 0.3 if check_suffixes(files) else 0.7
    loaded = load(source, progress=progress.subrange(0, most))
    findings = list(loaded.findings)
    mesh = loaded.mesh
    if decimate is not None:
        fewer, dense = decimation(decimate), mesh
        told = progress.subrange(most, most + 0.3, "decimating")
        mesh = thinning.decimate(dense, tolerance=fewer.tolerance, faces=fewer.faces, progress=told)
        findings += thinning.decimation_findings(
            dense, mesh, tolerance=fewer.tolerance, faces=fewer.faces
        )
    read, loaded = loaded, loaded.with_mesh(settled(mesh))
    if len(mesh.faces) and not (read.reconstructed and mesh is read.mesh):
        # What was said of a scan's surface was said of it as it was before.
        before = soundness(read.mesh) if read.reconstructed else []
        findings = [f for f in findings if f not in before and f.code != "surface.open"]
        findings += mesh_findings(loaded.mesh, 0, 0, closed=True)
    about = loaded.about if loaded.reconstructed else {"source": Path(loaded.name).name}
    told = progress.subrange(most + 0.3, 1)
    remarks = save(
        dict.fromkeys(files, loaded.mesh),
        replace(chosen, about=about),
        progress=told,
        made_from=loaded.source,
    )
    return Exported(loaded.mesh, tuple(findings), tuple(remarks))
