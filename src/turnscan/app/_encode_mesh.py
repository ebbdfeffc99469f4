"""Meshes and their patches as arrays for the browser."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from turnscan import edit
from turnscan.app import _protocol as p
from turnscan.app._envelope import Array
from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Mesh, Provenance


def mesh_arrays(body: edit.Body) -> dict[str, Array]:
    """Everything there is a number for, the dead too."""
    mesh = body.mesh
    return {
        **_surface(mesh.vertices, mesh.faces, body.measured, mesh.provenance),
        "alive": body.alive.astype(np.uint8),
    }


def patch_parts(patches: Sequence[edit.Patch]) -> tuple[list[p.Part], dict[str, Array]]:
    """Patches as parts of a message, and their arrays."""
    parts: list[p.Part] = []
    arrays: dict[str, Array] = {}
    if any(isinstance(patch, edit.Replace) for patch in patches):
        return [p.Replace()], {}
    for k, patch in enumerate(patches):
        own: dict[str, Array] = {}
        match patch:
            case edit.Alive():
                parts.append(p.Alive(value=patch.value))
                own = {"faces": patch.faces.astype("<u4")}
            case edit.Verts():
                parts.append(p.Verts())
                own = {"ids": patch.ids.astype("<u4"), "positions": _single(patch.positions)}
            case edit.Append():
                parts.append(p.Append())
                own = _surface(patch.vertices, patch.faces, patch.measured, patch.provenance)
            case edit.Truncate():
                parts.append(p.Truncate(vertices=patch.vertices, faces=patch.faces))
        arrays |= {f"{k}.{name}": array for name, array in own.items()}
    return parts, arrays


def preview_arrays(
    before: edit.Body, after: edit.Body, patches: Sequence[edit.Patch]
) -> dict[str, Array]:
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
        "positions": _single(after.mesh.vertices[used]),
        "faces": faces,
        "dead": np.flatnonzero(gone).astype("<u4"),
    }


def coarse_arrays(body: edit.Body, faces: int) -> dict[str, Array]:
    """A surface of about so many faces, for moving it about: vertices of a cell become one."""
    living = body.mesh.faces[body.alive]
    if len(living) <= faces:
        used, numbers = _numbered(body.mesh, body.alive)
        return {"positions": _single(body.mesh.vertices[used]), "faces": numbers}
    corners = body.mesh.vertices[living]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(cross, axis=1).sum() / 2.0)
    side = math.sqrt(2.0 * area / max(faces, 100))  # two faces in each cell of the surface
    low = corners.min(axis=(0, 1))
    cell = np.floor((body.mesh.vertices - low) / max(side, 1e-9)).astype(np.int64)
    cell = np.clip(cell, 0, 2**20)
    _, which = np.unique((cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2], return_inverse=True)
    count = np.bincount(which)
    sums = [np.bincount(which, body.mesh.vertices[:, k]) for k in range(3)]
    merged = which[living]
    apart = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    return {
        "positions": _single(np.stack(sums, axis=-1) / count[:, None]),
        "faces": merged[apart].astype("<u4"),
    }


def figures(body: edit.Body) -> p.Figures:
    """What the living surface is like."""
    from turnscan.app import _figure_kernels as kernels

    mesh = body.mesh
    faces, corners, area, volume, low, high, closed = kernels.figures(
        mesh.vertices, mesh.faces, body.alive
    )
    return p.Figures(
        vertices=corners,
        faces=faces,
        bounds=(_vector(low), _vector(high)) if faces else None,
        closed=closed,
        area=area,
        volume=volume if closed else None,
    )


def _surface(
    vertices: Floats, faces: Ints, measured: Bools, provenance: Provenance | None
) -> dict[str, Array]:
    v = len(vertices)
    none = np.full(v, -1, "<i4")
    q = provenance
    return {
        "positions": _single(vertices),
        "faces": faces.astype("<u4"),
        "measured": measured.astype(np.uint8),
        "sigma": np.full(v, np.nan, "<f4") if q is None else _single(q.sigma),
        "laser": none if q is None else q.laser.astype("<i4"),
        "step": none if q is None else q.step.astype("<i4"),
        "line": none if q is None else q.line.astype("<i4"),
    }


def _numbered(mesh: Mesh, keep: Bools) -> tuple[Ints, Array]:
    """Vertices that the faces kept use, and those faces in numbers of these."""
    faces = mesh.faces[keep]
    used, index = np.unique(faces, return_inverse=True)
    return used.astype(np.int32), index.reshape(-1, 3).astype("<u4")


def _single(values: Floats) -> Array:
    return values.astype("<f4")


def _vector(point: Floats) -> p.Vector:
    return float(point[0]), float(point[1]), float(point[2])
