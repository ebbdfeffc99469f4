"""Several grids → one mesh, and what is taken away from it: double cover and islands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.findings import Finding
from turnscan.points import Along, RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.surface._grid_mesh import Tears, mesh_grid, submesh, thin
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._zip import trimmed, zip_up

_ISLAND = 0.01
"""Part of the largest piece below which a piece is an island."""
_LONG = 0.2
"""Part of the largest piece's length from which on an island is named …"""
_SOME = 50
"""… that has so many faces: fewer are a wisp of strays."""


def paste(
    grids: Iterable[RangeGrid],
    tears: Tears | None = None,
    along: Along | None = None,
    *,
    keep_double: bool = False,
) -> Mesh:
    """Mesh every grid and join them as one mesh with the provenance of each vertex.

    What was measured twice is kept once: grids come in their order, what the sheet met beyond the
    rotation axis comes last, and faces that lie on a surface already there are left out
    (`trimmed`). The pieces that are left are joined across narrow gaps (`zip_up`); measurements of
    two lasers are not averaged. ``along`` chooses the points along each profile. ``keep_double``
    keeps all, side by side.
    """
    fronts, backs = [], []
    for grid in grids:
        behind = np.zeros(grid.flags.shape, bool) if grid.behind is None else grid.behind
        fronts.append(_part(grid, ~behind, tears, along))
        if behind.any():
            backs.append(_part(grid, behind, tears, along))
    parts = [m for m in fronts + backs if len(m.faces)]
    if not parts:
        return fronts[0] if fronts else Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    if keep_double or len(parts) == 1:
        return join(parts)
    mesh = join(trimmed(parts))
    piece = np.zeros(len(mesh.vertices), dtype=np.int32)
    piece[mesh.faces] = components(mesh)[:, None]
    return zip_up(mesh, piece)


def _part(grid: RangeGrid, keep: Bools, tears: Tears | None, along: Along | None) -> Mesh:
    points = np.where(keep[..., None], grid.points, np.nan)
    return mesh_grid(thin(replace(grid, points=points), along, tears), tears)


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one, side by side; the provenance of each vertex stays with it."""
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    some = any(m.measured is not None for m in meshes)
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + k for m, k in zip(meshes, starts, strict=False)]),
        joined_provenance(meshes),
        np.concatenate([m.colour for m in meshes if m.colour is not None])
        if all(m.colour is not None for m in meshes)
        else None,
        np.concatenate([measured(m) for m in meshes]) if some else None,
    )


def measured(mesh: Mesh) -> Bools:
    """(f,) True for the faces that were measured."""
    return np.ones(len(mesh.faces), bool) if mesh.measured is None else mesh.measured


def measured_vertices(mesh: Mesh) -> Bools:
    """(v,) True for the vertices that were measured: part of a measured face, and not added.

    Files without provenance mark faces alone. There the platter's plane under a part that was
    closed, whose faces count as measured, is recognised as what lies exactly level below all else.
    """
    own = np.zeros(len(mesh.vertices), dtype=np.bool_)
    if not len(mesh.faces):
        own[:] = True  # points alone
    real = measured(mesh)
    if mesh.provenance is None and not real.all():
        real = real & ~(mesh.triangles[..., 2] == mesh.vertices[:, 2].min()).all(axis=1)
    own[mesh.faces[real]] = True
    return own if mesh.provenance is None else own & (mesh.provenance.laser >= 0)


def joined_provenance(meshes: Sequence[Mesh]) -> Provenance | None:
    """Provenance of the vertices of several meshes in a row; None where one has none."""
    known = [m.provenance for m in meshes if m.provenance is not None]
    if len(known) < len(meshes):
        return None
    lasers = tuple(dict.fromkeys(n for p in known for n in p.lasers))
    index = []
    for p in known:
        table = np.array([*(lasers.index(n) for n in p.lasers), -1], dtype=np.int32)
        index.append(table[p.laser])
    return Provenance(
        np.concatenate([p.sigma for p in known]),
        np.concatenate(index),
        np.concatenate([p.step for p in known]),
        np.concatenate([p.line for p in known]),
        lasers,
    )


def components(mesh: Mesh) -> Ints:
    """(f,) the number of the connected piece that each face belongs to, from 0."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    v = len(mesh.vertices)
    a = mesh.faces[:, [0, 1]].ravel()
    b = mesh.faces[:, [1, 2]].ravel()
    graph = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(v, v))
    _, label = connected_components(graph, directed=False)
    return np.unique(label[mesh.faces[:, 0]], return_inverse=True)[1].astype(np.int32)


def drop_islands(mesh: Mesh, smallest: int | None = None) -> tuple[Mesh, int, int]:
    """The mesh without pieces of fewer than ``smallest`` faces; how many pieces and faces went.

    None takes 1 % of the faces of the largest piece: glints and remains of the platter are less.
    """
    if (smallest is not None and smallest <= 1) or not len(mesh.faces):
        return mesh, 0, 0
    label, small = _pieces(mesh, smallest)
    keep = ~small[label]
    if keep.all():
        return mesh, 0, 0
    return submesh(mesh, keep), int(small.sum()), int((~keep).sum())


def _pieces(mesh: Mesh, smallest: int | None) -> tuple[Ints, Bools]:
    """(f,) the piece of each face, and (p,) True for pieces that are too small to be kept."""
    label = components(mesh)
    size: npt.NDArray[np.intp] = np.bincount(label)
    least = int(_ISLAND * size.max()) if smallest is None else smallest
    return label, np.asarray(size < least, dtype=np.bool_)


def long_islands(mesh: Mesh, smallest: int | None = None) -> list[Finding]:
    """A warning for each piece that `drop_islands` takes from the mesh although it is long.

    Glints and remains are short; what is a fifth as long as the largest piece may be a thin part
    of the object, such as a tail, that hangs on nothing that was seen.
    """
    out: list[Finding] = []
    if not len(mesh.faces):
        return out
    label, small = _pieces(mesh, smallest)
    size = np.bincount(label)
    limit = _LONG * _extent(mesh, label == int(size.argmax()))[0]
    for piece in np.flatnonzero(small & (size >= _SOME)):
        length, sides, middle = _extent(mesh, label == piece)
        if length < limit:
            continue
        box = " × ".join(f"{side:.0f}" for side in sides)
        text = (
            f"a loose piece of {size[piece]} faces was taken away as an island: {box} mm, "
            "perhaps a thin part of the object"
        )
        where = "({:.0f}, {:.0f}, {:.0f}) mm".format(*middle)
        remedy = Remedy("keep it with ", Option("island", int(size[piece])))
        out.append(Finding("surface.island-long", "warning", text, where, remedy))
    return out


def _extent(mesh: Mesh, chosen: Bools) -> tuple[float, Floats, Floats]:
    """Length of the diagonal, sides (3,) and middle (3,) of the box about these faces, mm."""
    at = mesh.vertices[mesh.faces[chosen]].reshape(-1, 3)
    low, high = at.min(axis=0), at.max(axis=0)
    return float(np.linalg.norm(high - low)), high - low, (low + high) / 2
