"""The surface of an open scan as plain arrays: whole, coarse, as patches, and as a preview."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from turnscan import edit
from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.mesh import Mesh, Provenance
from turnscan.workflows._surface._loading import load

_FACES_AT_ONCE = 100_000
"""Faces that are looked at at once, which bounds the memory."""
Arrays = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class SurfacePatch:
    """One part of a change of the surface, with its arrays by name.

    ``alive``: ``faces`` (k,) die or come back, as ``value`` says. ``verts``: vertices ``ids`` (k,)
    move to ``positions`` (k, 3). ``append``: vertices and faces come to the end, as
    `surface_arrays` names them. ``truncate``: only so many of each are left. ``replace``: another
    surface altogether.
    """

    kind: Literal["alive", "verts", "append", "truncate", "replace"]
    arrays: Arrays
    value: bool = True
    vertices: int = 0
    faces: int = 0


def surface_arrays(body: edit.Body) -> Arrays:
    """Everything there is a number for, the dead too.

    ``positions`` (v, 3) mm, ``faces`` (f, 3), ``alive`` (f,), and of each vertex whether it was
    ``measured``, its ``sigma`` (mm, NaN where unknown), ``laser``, ``step`` and ``line`` (-1).
    """
    mesh = body.mesh
    return {
        **_surface(mesh.vertices, mesh.faces, body.measured, mesh.provenance),
        "alive": body.alive,
    }


def mesh_file_arrays(path: Path) -> tuple[tuple[str, ...], Arrays]:
    """The surface in a mesh file (mm), and the lasers that its points name.

    Arrays as `surface_arrays` has them, and ``colour`` (v, 3) where the file holds colours. Raises
    InputError, FormatError where there is no surface in it.
    """
    loaded = load(path)
    mesh = loaded.mesh
    if not len(mesh.faces):
        raise InputError(f"{loaded.name}: no faces", hint="choose a mesh file")
    arrays = surface_arrays(edit.Body.of(mesh))
    if mesh.colour is not None:
        arrays["colour"] = mesh.colour
    return () if mesh.provenance is None else tuple(mesh.provenance.lasers), arrays


def surface_patches(patches: Sequence[edit.Patch]) -> list[SurfacePatch]:
    """Patches in the order they are done; one that replaces all stands for all."""
    if any(isinstance(patch, edit.Replace) for patch in patches):
        return [SurfacePatch("replace", {})]
    return [_patch(patch) for patch in patches]


def _patch(patch: edit.Patch) -> SurfacePatch:
    match patch:
        case edit.Alive():
            return SurfacePatch("alive", {"faces": patch.faces}, value=patch.value)
        case edit.Verts():
            return SurfacePatch("verts", {"ids": patch.ids, "positions": patch.positions})
        case edit.Append():
            new = _surface(patch.vertices, patch.faces, patch.measured, patch.provenance)
            return SurfacePatch("append", new)
        case edit.Truncate():
            return SurfacePatch("truncate", {}, vertices=patch.vertices, faces=patch.faces)
        case edit.Replace():
            return SurfacePatch("replace", {})


def preview_arrays(before: edit.Body, after: edit.Body, patches: Sequence[edit.Patch]) -> Arrays:
    """What an edit would add, and which faces it would take away or move."""
    old = before.alive
    if any(isinstance(patch, edit.Replace) for patch in patches):
        new, gone = after.alive, old
    else:
        moved = np.zeros(len(after.mesh.vertices), dtype=np.bool_)
        for patch in patches:
            if isinstance(patch, edit.Verts):
                moved[patch.ids] = True
        here = np.zeros(len(after.alive), dtype=np.bool_)
        here[: len(old)] = old[: len(here)]
        touched: Bools = np.asarray(moved[after.mesh.faces].any(axis=1))
        new = after.alive & (touched | ~here)
        gone = old.copy()
        gone[: len(after.alive)] &= ~after.alive[: len(old)] | touched[: len(old)]
    used, faces = _numbered(after.mesh, new)
    return {
        "positions": after.mesh.vertices[used],
        "faces": faces,
        "dead": np.flatnonzero(gone),
    }


def coarse_arrays(body: edit.Body, faces: int) -> Arrays:
    """A surface of about so many faces, for moving it about: vertices of a cell become one."""
    living = body.mesh.faces[body.alive]
    if len(living) <= faces:
        used, numbers = _numbered(body.mesh, body.alive)
        return {"positions": body.mesh.vertices[used], "faces": numbers}
    area = sum(
        _area(body.mesh.vertices, living[k : k + _FACES_AT_ONCE])
        for k in range(0, len(living), _FACES_AT_ONCE)
    )
    side = math.sqrt(2.0 * area / max(faces, 100))  # two faces in each cell of the surface
    low = np.min([body.mesh.vertices[living[:, k]].min(axis=0) for k in range(3)], axis=0)
    cell = np.floor((body.mesh.vertices - low) / max(side, 1e-9)).astype(np.int64)
    cell = np.clip(cell, 0, 2**20)
    _, which = np.unique((cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2], return_inverse=True)
    count = np.bincount(which)
    sums = [np.bincount(which, body.mesh.vertices[:, k]) for k in range(3)]
    merged = which[living]
    apart = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    return {"positions": np.stack(sums, axis=-1) / count[:, None], "faces": merged[apart]}


def _area(vertices: Floats, faces: Ints) -> float:
    """mm² of some faces."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def _surface(
    vertices: Floats, faces: Ints, measured: Bools, provenance: Provenance | None
) -> Arrays:
    q, none = provenance, np.full(len(vertices), -1)
    return {
        "positions": vertices,
        "faces": faces,
        "measured": measured,
        "sigma": np.full(len(vertices), np.nan) if q is None else q.sigma,
        "laser": none if q is None else q.laser,
        "step": none if q is None else q.step,
        "line": none if q is None else q.line,
    }


def _numbered(mesh: Mesh, keep: Bools) -> tuple[Ints, Ints]:
    """Vertices that the faces kept use, and those faces in numbers of these."""
    faces = mesh.faces[keep]
    used, index = np.unique(faces, return_inverse=True)
    return used.astype(np.int32), index.reshape(-1, 3).astype(np.int32)
