"""Reading what a person names on the command line."""

from __future__ import annotations

from pathlib import Path

from turnscan.errors import InputError, LimitExceeded
from turnscan.surface import Mesh

_MAX_MESH_BYTES = 4 * 2**30


def read_bytes(path: Path, limit: int) -> bytes:
    """The bytes of a file of at most ``limit`` bytes.

    Raises InputError where there is no such file, LimitExceeded where it is larger.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}", hint="check the name")
    size = path.stat().st_size
    if size > limit:
        raise LimitExceeded(f"{path}: {size} bytes; at most {limit} are read")
    return path.read_bytes()


def read_mesh_file(path: Path) -> Mesh:
    """Read a mesh from a file whose suffix names its form."""
    from turnscan.export import read_mesh

    return read_mesh(read_bytes(path, _MAX_MESH_BYTES), path.suffix)
