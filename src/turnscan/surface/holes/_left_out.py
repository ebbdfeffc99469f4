"""Holes that somebody asked for: faces deleted by hand, and faces left out as too uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh, vector_areas
from turnscan.mesh._parts import components
from turnscan.surface.holes._holes import Hole, holes

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_SAME = 1e-3
"""mm within which two vertices are one: what makes vertices fit for files moves them less."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What was left out of a surface as too uncertain, and what was missing before."""

    faces: Mesh
    borders: tuple[Floats, ...]
    """(m, 3) mm each: those of the holes that the whole surface had …"""
    missing: Floats
    """… and the mm² that each of them encloses."""

    @staticmethod
    def of(whole: Mesh, faces: Mesh) -> LeftOut:
        """Of a whole surface, these faces."""
        found = holes(whole)
        borders = tuple(whole.vertices[hole.loop] for hole in found)
        return LeftOut(faces, borders, np.array([hole.area for hole in found]))


def deleted(mesh: Mesh, found: Sequence[Hole], cut: Floats | None) -> Bools:
    """(h,) True for holes most of whose border is between places (k, 3) mm."""
    out = np.zeros(len(found), dtype=np.bool_)
    if cut is not None and len(cut):
        tree = _tree(cut)
        out[:] = [_along(mesh.vertices[hole.loop], tree)[0] > 0.5 for hole in found]
    return out


def left_out(mesh: Mesh, found: Sequence[Hole], lost: LeftOut | None) -> Bools:
    """(h,) True for holes most of whose border is of faces that were left out, of at least the area
    that the whole surface lacked there.

    A shadow whose rim went stays a shadow where it is the larger part; and so does what is about an
    island, where the island is more than what it lost.
    """
    if lost is None or not len(lost.faces.faces) or not found:
        return np.zeros(len(found), dtype=np.bool_)
    tree = _tree(lost.faces.vertices)
    alongs = [_along(mesh.vertices[hole.loop], tree) for hole in found]
    piece, area = _pieces(lost.faces)
    meets = _counts([piece[near] for _, near in alongs], len(area))
    share = meets.multiply(1.0 / np.maximum(np.asarray(meets.sum(axis=0)), 1.0)).tocsr()
    before = _missing_before(mesh, found, lost, tree, piece, share)
    return np.asarray((np.array([k for k, _ in alongs]) > 0.5) & (share @ area >= before))


def _missing_before(
    mesh: Mesh,
    found: Sequence[Hole],
    lost: LeftOut,
    tree: cKDTree[None],
    piece: Ints,
    share: Any,
) -> Floats:
    """(h,) mm² that the holes of the whole surface enclose which each hole took in: at its own
    border, or at that of what was left out, in a ``tree``, in pieces (v,) of which it has a
    ``share`` (h, p)."""
    out = np.zeros(len(found))
    if not lost.borders:
        return out
    owner = np.repeat(np.arange(len(found), dtype=np.int32), [len(h.loop) for h in found])
    border = _tree(mesh.vertices[np.concatenate([h.loop for h in found])])
    own = [owner[_along(places, border)[1]] for places in lost.borders]
    gone = [piece[_along(places, tree)[1]] for places in lost.borders]
    votes = (_counts(own, len(found)) + _counts(gone, share.shape[1]) @ share.T).tocsr()
    taker = np.asarray(votes.argmax(axis=1)).ravel()
    taken = np.asarray(votes.sum(axis=1)).ravel() > 0
    np.add.at(out, taker[taken], lost.missing[taken])
    return out


def _tree(places: Floats) -> cKDTree[None]:
    from scipy.spatial import cKDTree

    return cKDTree(places)


def _counts(lists: Sequence[Ints], many: int) -> Any:
    """(n, many) sparse: how often each list has each number. A hole meets few of many pieces."""
    from scipy.sparse import csr_matrix

    row = np.repeat(np.arange(len(lists)), [len(k) for k in lists])
    column = np.concatenate([*lists, np.zeros(0, dtype=np.int32)])
    return csr_matrix((np.ones(len(row)), (row, column)), shape=(len(lists), many))


def _pieces(faces: Mesh) -> tuple[Ints, Floats]:
    """(v,) the piece of each vertex, and (p,) mm² of each piece."""
    label = components(faces)
    piece = np.zeros(len(faces.vertices), dtype=np.int32)
    piece[faces.faces] = label[:, None]
    each = np.linalg.norm(vector_areas(faces.vertices[faces.faces]), axis=1)
    return piece, np.bincount(label, each).astype(np.float64)


def _along(border: Floats, places: cKDTree[None]) -> tuple[float, Ints]:
    """The part of a border (m, 3) that runs between two places, and the places it meets."""
    off, near = places.query(border, distance_upper_bound=_SAME)
    there = np.asarray(off < _SAME)
    long = np.linalg.norm(np.roll(border, -1, axis=0) - border, axis=1)
    along = float(long[there & np.roll(there, -1)].sum() / max(float(long.sum()), 1e-12))
    return along, np.asarray(near)[there].astype(np.int32)
