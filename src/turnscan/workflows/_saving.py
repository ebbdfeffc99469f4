"""Saving results: meshes in the formats of their files' suffixes, read back and compared first."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from turnscan.errors import ExportError, InputError
from turnscan.findings import Finding
from turnscan.formats import ExportOptions, Profiles, audit, export, texture_files
from turnscan.mesh import Mesh, PointCloud
from turnscan.workflows._files import check_writable, write_atomically

_NAME = re.compile(r"\S+")


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
        beside = _textures(path, what, options)
        chosen = replace(options, material=path.stem) if beside else options
        data, found = audited(what, path.suffix, chosen, profiles, str(path))
        for finding in found:
            where = ", ".join(filter(None, [path.name, finding.where]))
            remarks.append(
                Finding(finding.code, finding.severity, finding.message, where, finding.remedy)
            )
        ready[path] = data
        ready |= beside
    for path, data in ready.items():
        write_atomically(path, data)
    return remarks


def _textures(
    path: Path, what: Mesh | PointCloud | Profiles, options: ExportOptions
) -> dict[Path, bytes]:
    """The material and the texture beside an OBJ of a coloured mesh, where they are asked for."""
    if not (options.texture and path.suffix.lower() == ".obj"):
        return {}
    if not isinstance(what, Mesh) or what.colour is None or not len(what.faces):
        return {}
    if not _NAME.fullmatch(path.stem):
        raise InputError(
            f"{path}: an OBJ cannot name a texture with a blank in its name",
            hint="choose a name of letters, digits, - and _",
        )
    files = {
        path.with_name(f"{path.stem}{end}"): d for end, d in texture_files(what, path.stem).items()
    }
    for file in files:
        check_writable(file)
    return files


def audited(
    what: Mesh | PointCloud | Profiles,
    suffix: str,
    options: ExportOptions,
    profiles: Profiles | None = None,
    name: str = "the file",
) -> tuple[bytes, list[Finding]]:
    """A result as the bytes of a file, read back and compared, and what the comparison remarks.

    Raises InputError for a format that is unknown or cannot hold it, ExportError naming the file
    where it does not read back the same.
    """
    data = export(what, suffix, options=options, profiles=profiles)
    found = audit(data, what, suffix, options=options, profiles=profiles)
    for finding in found:
        if finding.severity == "error":
            raise ExportError(f"{name}: {finding.message}", hint=finding.remedy)
    return data, list(found)
