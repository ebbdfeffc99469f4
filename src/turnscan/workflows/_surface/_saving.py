"""Saving results: meshes in the formats of their files' suffixes, read back and compared first."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from turnscan.errors import ExportError, InputError
from turnscan.findings import Finding
from turnscan.formats import ExportOptions as ExportOptions  # the doors name it, too
from turnscan.formats import Profiles, audit, export, texture_files
from turnscan.mesh import Mesh, PointCloud
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Source
from turnscan.workflows._files._writing import check_writable, write_atomically
from turnscan.workflows._options._units import STEP_SUFFIXES, check_suffixes, is_step
from turnscan.workflows._solids._loaded import Loaded

_NAME = re.compile(r"\S+")


def save(
    results: Mapping[Path, Mesh | PointCloud | Profiles],
    options: ExportOptions | None = None,
    profiles: Profiles | None = None,
    progress: Progress = no_progress,
    *,
    made_from: Source | None = None,
) -> list[Finding]:
    """Write results to files, each read back and compared first; none unless all are sound.

    Parameters
    ----------
    results
        What to write, by the file, whose suffix names the format. A mesh in .step (or .stp) is a
        solid or shell of the shapes that are found on it and of B-splines.
    options
        Choices about the formats; None takes the usual ones.
    profiles
        Profiles for a DXF that has them beside the mesh.
    progress
        Told how far the files are; it may cancel.
    made_from
        What the meshes were made from, as far as it is known: the uncertainty of a solid's volume
        hangs on it.

    Returns
    -------
    list of Finding
        What the comparisons remark, with the file's name as the place.

    Raises
    ------
    InputError
        Where a format is unknown or cannot hold a result, and for STEP where OpenCASCADE is not
        installed.
    ExportError
        Where a file does not read back the same or cannot be written.

    >>> from pathlib import Path
    >>> import turnscan as ts
    >>> ts.save({Path("cup.ply"): ts.reconstruct("cup.turnscan").mesh})
    []
    """
    options = options or ExportOptions()
    check_suffixes(list(results))
    ready: dict[Path, bytes] = {}
    remarks: list[Finding] = []
    made: dict[tuple[int, str], tuple[bytes, list[Finding]]] = {}
    for k, (path, what) in enumerate(results.items()):
        check_writable(path)
        told = progress.subrange(k / len(results), (k + 1) / len(results))
        beside = _textures(path, what, options)
        chosen = replace(options, material=path.stem) if beside else options
        # A solid takes long to make: a .step and a .stp of one name hold the same.
        name = (id(what), path.stem if is_step(path) else str(path))
        if name not in made:
            made[name] = _audited(what, path.suffix, chosen, profiles, str(path), told, made_from)
        data, found = made[name]
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


def _audited(
    what: Mesh | PointCloud | Profiles,
    suffix: str,
    options: ExportOptions,
    profiles: Profiles | None = None,
    name: str = "the file",
    progress: Progress = no_progress,
    made_from: Source | None = None,
) -> tuple[bytes, list[Finding]]:
    """A result as the bytes of a file, read back and compared, and what the comparison remarks.

    Raises InputError for a format that is unknown or cannot hold it, ExportError naming the file
    where it does not read back the same.
    """
    if suffix.lower() in STEP_SUFFIXES:
        return _as_step(what, options, name, progress, made_from)
    data = export(what, suffix, options=options, profiles=profiles)
    found = audit(data, what, suffix, options=options, profiles=profiles)
    for finding in found:
        if finding.severity == "error":
            raise ExportError(f"{name}: {finding.message}", hint=finding.remedy)
    return data, list(found)


def _as_step(
    what: Mesh | PointCloud | Profiles,
    options: ExportOptions,
    name: str,
    progress: Progress,
    made_from: Source | None,
) -> tuple[bytes, list[Finding]]:
    # Both take what only those wait for who want a solid.
    from turnscan.drawings import check_opencascade
    from turnscan.shapes.primitives import find_shapes
    from turnscan.shapes.swept import find_swept
    from turnscan.workflows._solids._shapes_step import step_of

    check_opencascade()
    if not isinstance(what, Mesh) or not len(what.faces):
        raise InputError(f"{name}: STEP holds a solid or a shell", hint="give a mesh with faces")
    progress(0.0, "looking for shapes")
    surface = Loaded(what, name, options.about, source=made_from)
    found = find_shapes(what, moves=surface.moves)
    swept = partial(find_swept, what, found, surface.moves)
    file = step_of(surface, found, swept, progress.subrange(0.4, 1.0))
    return file.data, list(file.findings)
