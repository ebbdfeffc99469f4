"""Islands: loose pieces, small beside the part, are removed; a long one is reported."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import components, submesh
from turnscan.points import RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.surface._grid_mesh import TearLimits, mesh_grid

_ISLAND = 0.01
"""Part of the largest piece below which a piece is an island …"""
_TORN = 0.25
"""… and the part of that which is enough for one that hung on a large surface before a merge."""
_LONG = 0.2
"""Part of the largest piece's length from which on an island is named …"""
_SOME = 50
"""… that has so many faces: fewer are a wisp of strays."""


def drop_islands(
    mesh: Mesh,
    smallest: int | None = None,
    grids: Sequence[RangeGrid] = (),
    tears: TearLimits | None = None,
) -> tuple[Mesh, int, int]:
    """The mesh without pieces of fewer than ``smallest`` faces; how many pieces and faces went.

    None takes 1 % of the faces of the largest piece: glints and remains of the platter are less.
    A quarter of that is enough for a piece most of whose vertices were measured on a large surface
    of one of the ``grids``, torn by ``tears``: it hung there on the part, and a merge cut it off.
    """
    if (smallest is not None and smallest <= 1) or not len(mesh.faces):
        return mesh, 0, 0
    label, small = _pieces(mesh, smallest, grids, tears)
    keep = ~small[label]
    if keep.all():
        return mesh, 0, 0
    return submesh(mesh, keep), int(small.sum()), int((~keep).sum())


def long_islands(
    mesh: Mesh,
    smallest: int | None = None,
    grids: Sequence[RangeGrid] = (),
    tears: TearLimits | None = None,
) -> list[Finding]:
    """A warning for each piece that `drop_islands` takes from the mesh although it is long.

    Glints and remains are short; what is a fifth as long as the largest piece may be a thin part
    of the object, such as a tail, that hangs on nothing that was seen.
    """
    out: list[Finding] = []
    if not len(mesh.faces):
        return out
    label, small = _pieces(mesh, smallest, grids, tears)
    size = np.bincount(label)
    limit = _LONG * _extent(mesh, label == int(size.argmax()))[0]
    for piece in np.flatnonzero(small & (size >= _SOME)):
        length, sides, middle = _extent(mesh, label == piece)
        if length < limit:
            continue
        box = " × ".join(f"{side:.0f}" for side in sides)
        text = (
            f"a loose piece of {size[piece]} faces was removed as an island: {box} mm, "
            "perhaps a thin part of the object"
        )
        where = "({:.0f}, {:.0f}, {:.0f}) mm".format(*middle)
        remedy = Remedy("keep it with ", Option("island", int(size[piece])))
        out.append(Finding("surface.island-long", "warning", text, where, remedy))
    return out


def _pieces(
    mesh: Mesh, smallest: int | None, grids: Sequence[RangeGrid], tears: TearLimits | None
) -> tuple[Ints, Bools]:
    """(f,) the piece of each face, and (p,) True for pieces that are too small to be kept."""
    label = components(mesh)
    size: npt.NDArray[np.intp] = np.bincount(label)
    least = int(_ISLAND * size.max()) if smallest is None else smallest
    small = np.asarray(size < least, dtype=np.bool_)
    asked = small & (size >= _TORN * least)
    if smallest is None and asked.any():
        on = _on_large(mesh, grids, tears)[mesh.faces].sum(axis=1)
        most = np.bincount(label, weights=on) > 1.5 * size
        small &= ~(asked & most)
    return label, small


def _on_large(mesh: Mesh, grids: Sequence[RangeGrid], tears: TearLimits | None) -> Bools:
    """(v,) True where the point that a vertex comes from was on a large surface of its grid."""
    out = np.zeros(len(mesh.vertices), dtype=np.bool_)
    p = mesh.provenance
    for grid in grids if p is not None else ():
        whole = mesh_grid(grid, tears)
        if p is None or grid.laser not in p.lasers or whole.provenance is None:
            continue
        label = components(whole)
        size = np.bincount(label)
        large = np.unique(whole.faces[size[label] >= _ISLAND * size.max(initial=0)])
        mine = np.flatnonzero(p.laser == p.lasers.index(grid.laser))
        asked = np.stack([p.step[mine], p.line[mine]], axis=1).astype(np.int64)
        known = np.stack([whole.provenance.step[large], whole.provenance.line[large]], axis=1)
        wide = int(max(asked.max(initial=0), known.max(initial=0))) + 1
        out[mine] |= np.isin(asked @ (wide, 1), known.astype(np.int64) @ (wide, 1))
    return out


def _extent(mesh: Mesh, chosen: Bools) -> tuple[float, Floats, Floats]:
    """Length of the diagonal, sides (3,) and middle (3,) of the box about these faces, mm."""
    at = mesh.vertices[mesh.faces[chosen]].reshape(-1, 3)
    low, high = at.min(axis=0), at.max(axis=0)
    return float(np.linalg.norm(high - low)), high - low, (low + high) / 2
