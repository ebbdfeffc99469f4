"""Zip: patches that measured one surface, trimmed where they lie on each other, and joined.

After Turk & Levoy 1994 (Zippered polygon meshes from range images), without their clipping: every
vertex stays the measured point that it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import smoothed_normals
from turnscan.mesh._parts import longest_sides, submesh
from turnscan.mesh._soundness import crossings
from turnscan.mesh._topology import faces_about, half_edges, hanging_together

_ALIKE = 0.5
"""Two surfaces are the same one where their normals are within 60°."""
_NOISE = 3.0
"""Sigmas that two measurements of one surface may lie apart, on top of their spacing."""
_NEAR = 24
"""Corners of borders near a side that are tried for a face on it."""

Keys = npt.NDArray[np.int64]


def trimmed(patches: Sequence[Mesh]) -> list[Mesh]:
    """The patches (s) in their order, each without the faces that lie on one before it.

    Two faces lie on each other where a corner of one is over the other, along the normal: nearer
    than the longest side there plus three sigma of both, and with normals within 60°. So the
    borders that are left face each other across a gap. What still cuts through an earlier patch,
    as faces beside an edge of the part may, goes too.
    """
    done = [_Patch.of(patches[0])]
    for mesh in patches[1:]:
        patch = _Patch.of(mesh)
        drop = np.zeros(len(mesh.faces), dtype=np.bool_)
        for known in done:
            drop |= (patch.faces_of(known) >= 0)[mesh.faces].any(axis=1)
            hit = known.faces_of(patch)
            drop[hit[hit >= 0]] = True
        left = _clear(submesh(mesh, ~drop), [p.mesh for p in done])
        if len(left.faces):
            done.append(_Patch.of(left))
    return [p.mesh for p in done]


def zip_up(mesh: Mesh, piece: Ints) -> Mesh:
    """Join pieces (``piece`` (v,) names that of each vertex) by faces between their borders.

    A face stands on a side of a border and has its third corner on another: the smallest first,
    again and again, so that the gap closes from where it is narrowest. A side that leads from one
    piece to another is at most as long as the longest sides of both at its ends; normals are within
    60°; no side has more than two faces, and no new face cuts through another. No vertex moves and
    none is added. What lies further apart stays open.
    """
    zipper = _Zipper.of(mesh, piece)
    if zipper is None:
        return mesh
    while zipper.round():
        pass
    # What found no neighbour in the end hangs by a corner.
    faces = np.concatenate([mesh.faces, zipper.made.astype(np.int32)])
    keep = hanging_together(faces)
    keep[: len(mesh.faces)] = True
    return replace(mesh, faces=faces[keep])


@dataclass(frozen=True)
class _Patch:
    """A mesh, and how far and which way each vertex of it looks."""

    mesh: Mesh
    normals: Floats
    reach: Floats
    """(v,) mm: longest side."""
    noise: Floats
    """(v,) mm: three sigma."""

    @classmethod
    def of(cls, mesh: Mesh) -> _Patch:
        p = mesh.provenance
        noise = np.zeros(len(mesh.vertices)) if p is None else _NOISE * np.nan_to_num(p.sigma)
        return cls(mesh, smoothed_normals(mesh), longest_sides(mesh), noise)

    def faces_of(self, other: _Patch) -> Ints:
        """(v,) the face of the other patch that each vertex of this one lies on; −1 for none."""
        from scipy.spatial import cKDTree

        from turnscan.surface.fusion import _overlap_kernels as kernels

        there = other.mesh
        # A foot is no further from its nearest corner than the face is long and it is high.
        most = 2 * other.reach + other.noise
        far = float(most.max() + self.noise.max())
        tree = cKDTree(there.vertices)
        away, nearest = tree.query(self.mesh.vertices, distance_upper_bound=far)
        some = np.flatnonzero(np.isfinite(away))
        near = np.asarray(nearest, dtype=np.int32)[some]
        start, numbers = faces_about(there.faces, len(there.vertices))
        face, _, off = kernels.feet(
            self.mesh.vertices[some], other.normals[near], near,
            there.vertices, there.faces, start, numbers,
        )  # fmt: skip
        alike = np.einsum("ij,ij->i", self.normals[some], other.normals[near]) > _ALIKE
        with np.errstate(invalid="ignore"):
            close = np.abs(off) <= other.reach[near] + other.noise[near] + self.noise[some]
        found = np.full(len(self.mesh.vertices), -1, dtype=np.int32)
        found[some] = np.where(alike & close, face, -1)
        return found


def _clear(mesh: Mesh, others: Sequence[Mesh]) -> Mesh:
    """The mesh without faces that cut through others."""
    starts = np.cumsum([0, *(len(m.vertices) for m in (*others, mesh))])
    faces = [m.faces + k for m, k in zip((*others, mesh), starts, strict=False)]
    both = Mesh(
        np.concatenate([m.vertices for m in (*others, mesh)]), np.concatenate(faces, dtype=np.int32)
    )
    first = len(both.faces) - len(mesh.faces)
    cut = crossings(both, np.arange(len(both.faces)) >= first)
    between = cut[cut[:, 0] < first]
    keep = np.ones(len(mesh.faces), dtype=np.bool_)
    keep[between[:, 1] - first] = False
    return submesh(mesh, keep)


@dataclass
class _Zipper:
    """What is known about the gap while it closes."""

    vertices: Floats
    normals: Floats
    reach: Floats
    piece: Ints
    near: Ints
    """(n, 3) the faces that may be in the way of new ones."""
    sides: Keys
    """Sides (keys) of faces between corners that take part, as they wind, sorted."""
    border: npt.NDArray[np.int64]
    """(m, 2) sides that have one face only."""
    made: npt.NDArray[np.int64]
    """(k, 3) the faces so far."""
    waiting: npt.NDArray[np.int64]
    """(w, 3) the faces that may be added, in the order of preference."""

    @classmethod
    def of(cls, mesh: Mesh, piece: Ints) -> _Zipper | None:
        """None where no two pieces have borders near each other."""
        from scipy.spatial import cKDTree

        begin, end = half_edges(mesh.faces)
        reach, X = longest_sides(mesh), mesh.vertices
        corners = np.unique(np.concatenate([begin, end]))
        takes_part = np.zeros(len(X), dtype=np.bool_)
        if len(corners) < 2:
            return None
        away, which = cKDTree(X[corners]).query(X[corners], k=min(_NEAR, len(corners)))
        there, own = corners[which], corners[:, None]
        meets = (piece[there] != piece[own]) & (away <= reach[there] + reach[own])
        takes_part[corners[meets.any(axis=1)]] = True
        # The ends of a border's sides come along, so that a face can stand on each of them.
        joined = takes_part[begin] | takes_part[end]
        takes_part[begin[joined]] = takes_part[end[joined]] = True
        if not joined.any():
            return None
        some = np.flatnonzero(takes_part)
        away, which = cKDTree(X[some]).query(X)
        close = np.asarray(away <= 2 * reach[some[which]] + reach)
        near = mesh.faces[close[mesh.faces].any(axis=1)]
        zipper = cls(
            X, smoothed_normals(mesh), reach, piece, near, np.empty(0, np.int64),
            np.stack([begin[joined], end[joined]], axis=1).astype(np.int64),
            np.empty((0, 3), np.int64), np.empty((0, 3), np.int64),
        )  # fmt: skip
        ends = np.concatenate([near[:, [0, 1]], near[:, [1, 2]], near[:, [2, 0]]])
        zipper.sides = np.unique(zipper._key(ends[takes_part[ends].all(axis=1)]))
        zipper._queue(zipper.border)
        return zipper

    def round(self) -> bool:
        """Add the faces that no smaller one competes with; whether there were any to try."""
        self.waiting = self._possible(self.waiting)
        if not len(self.waiting):
            return False
        new = self.waiting[_uncontested(self._sides_of(self.waiting))]
        cut = self._cutting(new)
        refused = self._face_key(new[cut])
        self.waiting = self.waiting[~np.isin(self._face_key(self.waiting), refused)]
        new = new[~cut]
        self.made = np.concatenate([self.made, new])
        added = np.concatenate([new[:, [0, 1]], new[:, [1, 2]], new[:, [2, 0]]])
        self.sides = np.union1d(self.sides, self._key(added))
        free = added[~np.isin(self._key(added[:, ::-1]), self.sides)]
        still = ~np.isin(self._key(self.border[:, ::-1]), self.sides)
        self.border = np.concatenate([self.border[still], free])
        self._queue(free)
        return True

    def _queue(self, ends: npt.NDArray[np.int64]) -> None:
        """Put the faces that may stand on sides (k, 2) of the border among those that wait, the
        one with the shortest way round first."""
        from scipy.spatial import cKDTree

        X = self.vertices
        corners = np.unique(self.border)
        if not len(ends) or len(corners) < 2:
            return
        count = min(_NEAR, len(corners))
        _, which = cKDTree(X[corners]).query(X[ends].mean(axis=1), k=count)
        first, second = np.repeat(ends, count, axis=0).T
        faces = np.stack([second, first, corners[which].ravel()], axis=1)
        faces = np.concatenate([self.waiting, faces[self._may_be(faces)]])
        faces = faces[np.unique(self._face_key(faces), return_index=True)[1]]
        sides = X[faces] - np.roll(X[faces], 1, axis=1)
        self.waiting = faces[np.argsort(np.linalg.norm(sides, axis=2).sum(axis=1), kind="stable")]

    def _possible(self, faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Those of the faces whose corners lie on the border and whose sides no face has yet."""
        on_border = np.zeros(len(self.vertices), dtype=np.bool_)
        on_border[self.border] = True
        faces = faces[on_border[faces].all(axis=1)]
        return faces[~np.isin(self._sides_of(faces), self.sides).any(axis=1)]

    def _may_be(self, faces: npt.NDArray[np.int64]) -> Bools:
        """(c,) True for faces that lead from piece to piece, are short and look the right way."""
        b, a, c = faces.T
        X, piece = self.vertices, self.piece
        good = (a != c) & (b != c) & ((piece[a] != piece[c]) | (piece[b] != piece[c]))
        for end in (a, b):
            away = np.linalg.norm(X[end] - X[c], axis=1)
            good &= away <= self.reach[end] + self.reach[c]
        normal = np.cross(X[a] - X[b], X[c] - X[b])
        size = np.linalg.norm(normal, axis=1)
        for v in (a, b, c):
            good &= np.einsum("ij,ij->i", normal, self.normals[v]) > _ALIKE * size
        return np.asarray(good)

    def _cutting(self, new: npt.NDArray[np.int64]) -> Bools:
        """(n,) True for new faces that cut through another; of two new ones, the larger."""
        old = np.concatenate([self.near, self.made])
        trial = Mesh(self.vertices, np.concatenate([old, new]).astype(np.int32))
        cut = crossings(trial, np.arange(len(trial.faces)) >= len(old))
        out = np.zeros(len(new), dtype=np.bool_)
        out[cut[:, 1] - len(old)] = True
        return out

    def _key(self, ends: npt.NDArray[np.integer]) -> Keys:
        pair: Keys = ends.astype(np.int64)
        return pair[:, 0] * len(self.vertices) + pair[:, 1]

    def _sides_of(self, faces: npt.NDArray[np.int64]) -> Keys:
        """(f, 3)."""
        return np.stack([self._key(faces[:, pair]) for pair in ([0, 1], [1, 2], [2, 0])], axis=1)

    def _face_key(self, faces: npt.NDArray[np.int64]) -> Keys:
        """(f,) the same for a face with any of its corners first."""
        start = faces.argmin(axis=1)[:, None]
        turned = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
        size = len(self.vertices)
        return (turned[:, 0] * size + turned[:, 1]) * size + turned[:, 2]


def _uncontested(sides: Keys) -> Bools:
    """(f,) True for faces (in order of preference) that want none of the sides of an earlier one.

    ``sides`` (f, 3) are keys.
    """
    names, which = np.unique(sides, return_inverse=True)
    rank = np.arange(len(sides))
    first = np.full(len(names), len(sides))
    np.minimum.at(first, which.ravel(), np.repeat(rank, 3))
    return np.asarray((first[which.reshape(-1, 3)] == rank[:, None]).all(axis=1))
