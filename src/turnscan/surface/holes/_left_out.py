"""Holes that somebody asked for: faces deleted by hand, and faces left out as too uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh, vector_areas
from turnscan.mesh._parts import components
from turnscan.surface.holes._holes import Hole, holes

_SAME = 1e-3
"""mm within which two vertices are one: what makes vertices fit for files moves them less."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What was left out of a surface as too uncertain, and what was missing before."""

    faces: Mesh
    missing: tuple[tuple[Floats, float], ...]
    """Borders (m, 3) mm of the whole surface's holes, and what they enclose, mm²."""

    @staticmethod
    def of(whole: Mesh, faces: Mesh) -> LeftOut:
        """Of a whole surface, these faces."""
        missing = tuple((whole.vertices[hole.loop], hole.area) for hole in holes(whole))
        return LeftOut(faces, missing)


def deleted(mesh: Mesh, found: Sequence[Hole], cut: Floats | None) -> list[bool]:
    """For each hole whether most of its border is between places (k, 3) mm."""
    if cut is None or not len(cut):
        return [False] * len(found)
    return [along > 0.5 for along, _ in _alongs(mesh, found, cut)]


def left_out(mesh: Mesh, found: Sequence[Hole], lost: LeftOut | None, islands: Bools) -> Bools:
    """(h,) True for holes that most of their borders and of their areas owe to what was left out.

    A shadow whose rim went stays a shadow where it is the larger part. The border of one of the
    ``islands`` (h,) encloses what is there, so that areas say nothing of it.
    """
    if lost is None or not len(lost.faces.faces) or not found:
        return np.zeros(len(found), dtype=np.bool_)
    alongs = _alongs(mesh, found, lost.faces.vertices)
    piece, area = _pieces(lost.faces)
    meets = np.array([np.bincount(piece[near], minlength=len(area)) for _, near in alongs])
    share = meets / np.maximum(meets.sum(axis=0), 1)
    most = share @ area >= _missing_before(mesh, found, lost, piece, share)
    return np.asarray([along > 0.5 for along, _ in alongs] & (most | islands))


def _missing_before(
    mesh: Mesh, found: Sequence[Hole], lost: LeftOut, piece: Ints, share: Floats
) -> Floats:
    """(h,) mm² that the holes of the whole surface enclose which each hole took in: at its own
    border, or at that of pieces (v,) that were left out, of which it has a ``share`` (h, p)."""
    from scipy.spatial import cKDTree

    border = np.concatenate([h.loop for h in found])
    owner = np.repeat(np.arange(len(found)), [len(h.loop) for h in found])
    kept, gone = cKDTree(mesh.vertices[border]), cKDTree(lost.faces.vertices)
    out = np.zeros(len(found))
    for places, area in lost.missing:
        at = [tree.query(places, distance_upper_bound=_SAME) for tree in (kept, gone)]
        mine, theirs = (np.asarray(near)[off < _SAME] for off, near in at)
        votes = np.bincount(owner[mine], minlength=len(found)) + share[:, piece[theirs]].sum(axis=1)
        out[votes.argmax()] += area * votes.any()
    return out


def _pieces(faces: Mesh) -> tuple[Ints, Floats]:
    """(v,) the piece of each vertex, and (p,) mm² of each piece."""
    label = components(faces)
    piece = np.zeros(len(faces.vertices), dtype=np.int32)
    piece[faces.faces] = label[:, None]
    each = np.linalg.norm(vector_areas(faces.vertices[faces.faces]), axis=1)
    return piece, np.bincount(label, each).astype(np.float64)


def _alongs(mesh: Mesh, found: Sequence[Hole], places: Floats) -> list[tuple[float, Ints]]:
    """For each hole the part of its border that is between places (k, 3) mm, and those on it."""
    from scipy.spatial import cKDTree

    tree, out = cKDTree(places), list[tuple[float, Ints]]()
    for hole in found:
        border = mesh.vertices[hole.loop]
        off, near = tree.query(border, distance_upper_bound=_SAME)
        there = np.asarray(off < _SAME)
        long = np.linalg.norm(np.roll(border, -1, axis=0) - border, axis=1)
        along = float(long[there & np.roll(there, -1)].sum() / max(float(long.sum()), 1e-12))
        out.append((along, np.asarray(near)[there].astype(np.int32)))
    return out
