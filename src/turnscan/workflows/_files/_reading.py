"""Reading the files that a workflow is given: meshes and rigs."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

from turnscan.drawings import StepPart, read_step
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.rig import Rig, rig_from_json, rig_from_ruler
from turnscan.workflows._options._units import IGES_SUFFIXES, STEP_SUFFIXES, UNITS

_MAX_RIG_BYTES = 16 * 2**20
_START = 1 << 16
_MAX_MESH_BYTES = 4 * 2**30
_MAX_STEP_BYTES = 2**30


def read_bytes(path: Path, limit: int) -> bytes:
    """The bytes of a file of at most ``limit`` bytes.

    Raises InputError where no such file, LimitExceeded where it is larger.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}", hint="check the name")
    size = path.stat().st_size
    if size > limit:
        raise LimitExceeded(f"{path}: {size} bytes; at most {limit} are read")
    return path.read_bytes()


def read_start(path: Path) -> bytes:
    """The first bytes of a file that is there, in which it says where it comes from."""
    with path.open("rb") as file:
        return file.read(_START)


def read_mesh_file(path: str | PathLike[str], unit: str = "mm") -> Mesh:
    """Read a mesh from a file.

    Parameters
    ----------
    path
        The file; its suffix names the format: .stl .ply .obj .3mf .glb .dxf .xyz .step.
    unit
        Unit of the file: mm, cm, m or inch; the mesh is in mm. A STEP file says its own.

    Returns
    -------
    Mesh
        Its triangles, with what the format says of them.

    Raises
    ------
    InputError
        Where no such file, its format is unknown, or it is damaged.

    >>> import turnscan as ts
    >>> part = ts.reconstruct("cup.turnscan")
    >>> remarks = part.save("cup.ply")
    >>> len(ts.read_mesh_file("cup.ply").faces) == len(part.mesh.faces)
    True
    """
    from turnscan.formats import read_mesh

    path = Path(path)
    if path.suffix.lower() in STEP_SUFFIXES:
        return read_step_file(path).mesh
    if path.suffix.lower() in IGES_SUFFIXES:
        raise InputError(f"{path}: IGES is written, not read", hint="export a .step")
    data = read_bytes(path, _MAX_MESH_BYTES)
    try:
        mesh = read_mesh(data, path.suffix)
    except InputError as e:
        raise type(e)(f"{path}: {e.message}", hint=e.hint) from None
    return replace(mesh, vertices=mesh.vertices * UNITS[unit]) if unit != "mm" else mesh


def read_step_file(path: Path) -> StepPart:
    """What a STEP file holds, mm; raises InputError naming the file where that is no surface."""
    data = read_bytes(path, _MAX_STEP_BYTES)
    try:
        part = read_step(data)
    except InputError as e:
        raise type(e)(f"{path}: {e.message}", hint=e.hint) from None
    if not len(part.mesh.faces):
        raise FormatError(f"{path}: the STEP file holds no surface", hint="export a solid")
    return part


def step_findings(part: StepPart, path: Path) -> tuple[Finding, ...]:
    """What a person must know of a STEP file before anything is measured against it."""
    out = []
    if part.lost:
        out.append(
            Finding(
                "step.lost-faces", "warning",
                f"{path.name}: OpenCASCADE makes no triangles of {part.lost} of its faces; they "
                "are missing",
                remedy="export the part again from the program that drew it",
            )
        )  # fmt: skip
    if not part.valid:
        out.append(
            Finding(
                "step.faults", "warning",
                f"{path.name}: OpenCASCADE finds faults in the solid, so its volume and its faces "
                "may be wrong",
                remedy="repair the part in the program that drew it, and export it again",
            )
        )  # fmt: skip
    return tuple(out)


def read_rig_file(path: str | PathLike[str], *, partial: bool = False) -> Rig:
    """Read a rig.

    Parameters
    ----------
    path
        The file, like ``rig.json``; a ``….toml`` holds what a ruler and a protractor say.
    partial
        Whether a rig will do of which not all stages are calibrated yet.

    Returns
    -------
    Rig
        Camera, laser sheets and rotation axis, with their uncertainty where it is known.

    Raises
    ------
    InputError
        Where no such file, or its rig is not complete.
    FormatError
        Naming the key that is wrong.

    >>> import turnscan as ts
    >>> ts.read_rig_file("none.json")
    Traceback (most recent call last):
    turnscan.errors.InputError: none.json: no such file → check the name
    """
    path = Path(path)
    try:
        text = read_bytes(path, _MAX_RIG_BYTES).decode()
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint="give a rig.json") from None
    ruler = path.suffix.lower() == ".toml"
    rig = rig_from_ruler(text, str(path)) if ruler else rig_from_json(text, str(path))
    if not partial:
        require_complete(rig, str(path))
    return rig


def require_complete(rig: Rig, name: str) -> None:
    """Raise InputError naming what is not calibrated yet in a rig that is to be used."""
    if rig.lacking:
        raise InputError(
            f"{name}: {' and '.join(rig.lacking)} of this rig is not calibrated yet",
            hint="calibrate that stage with pictures, starting from this rig",
        )
