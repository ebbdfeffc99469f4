"""Saving results: meshes in the formats of their files' suffixes, read back and compared first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from turnscan.errors import ExportError
from turnscan.findings import Finding
from turnscan.formats import ExportOptions, Profiles, audit, export
from turnscan.mesh import Mesh, PointCloud
from turnscan.workflows._files import check_writable, write_atomically


def save(
    results: Mapping[Path, Mesh | PointCloud | Profiles],
    options: ExportOptions | None = None,
    profiles: Profiles | None = None,
) -> list[Finding]:
    """Write results to files, each read back and compared first; none unless all are sound.

    Parameters
    ----------
    results
        What to write, by the file, whose suffix names the format.
    options
        Choices about the formats; None takes the usual ones.
    profiles
        Profiles for a DXF that has them beside the mesh.

    Returns
    -------
    list of Finding
        What the comparisons remark, with the file's name as the place.

    Raises
    ------
    InputError
        Where a format is unknown or cannot hold a result.
    ExportError
        Where a file does not read back the same or cannot be written.

    >>> from pathlib import Path
    >>> import turnscan as ts
    >>> ts.save({Path("cup.ply"): ts.reconstruct("cup.turnscan").mesh})
    []
    """
    options = options or ExportOptions()
    ready: dict[Path, bytes] = {}
    remarks: list[Finding] = []
    for path, what in results.items():
        check_writable(path)
        data = export(what, path.suffix, options=options, profiles=profiles)
        for finding in audit(data, what, path.suffix, options=options, profiles=profiles):
            if finding.severity == "error":
                raise ExportError(f"{path}: {finding.message}", hint=finding.remedy)
            where = ", ".join(filter(None, [path.name, finding.where]))
            remarks.append(
                Finding(finding.code, finding.severity, finding.message, where, finding.remedy)
            )
        ready[path] = data
    for path, data in ready.items():
        write_atomically(path, data)
    return remarks
