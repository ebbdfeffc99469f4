"""Settle: a mesh whose vertices every file format can hold, without faces too thin for that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.mesh._parts import measured, submesh
from turnscan.mesh._soundness import crossings, repeated
from turnscan.mesh._topology import half_edges
from turnscan.surface.holes._self_intersections import repair_self_intersections

_BITS = 21
"""Steps of the lattice to the farthest coordinate, as a power of two: three bits fewer than a
32-bit number holds, so that an STL keeps each vertex, and a text of six decimals nearly so."""
_THIN = 2.0
"""Steps of the lattice below which a face is too thin: rounding would turn it over."""
_NUDGE = 4.0
"""Steps by which a vertex moves away from another one at its place."""
_ROUNDS = 12
_ALONG = 0.2
"""Cosine of the angle by which a face may turn when one of its vertices goes."""


def lattice(mesh: Mesh) -> float:
    """mm between the places that vertices are put to: a power of two, 0.06 µm for parts of 128 mm,
    far below what is measured.
    """
    far = float(np.abs(mesh.vertices).max(initial=0.0))
    return float(2.0 ** (np.ceil(np.log2(max(far, 1e-3))) - _BITS))


def settled(mesh: Mesh) -> Mesh:
    """The mesh as STL, PLY, OBJ, 3MF, DXF and GLB can all carry it: what is sound stays sound.

    All vertices go to the nearest place of a `lattice`. Faces thinner than two of its steps, which
    rounding would turn over or leave without area, are removed: their short edge is collapsed, or
    their long one is flipped, where that leaves the topology as it was. A vertex at the place of
    another one moves four steps inward, so that surfaces that touch do not become one. Where a
    closed surface cuts through itself after that, the place is made anew
    (`repair_self_intersections`). What cannot be repaired stays; `soundness` says where.
    """
    if not len(mesh.faces):
        return mesh
    done = _placed(_without_thin(_placed(mesh)))
    if not _closed(done):
        return done
    pairs = crossings(done)
    if not len(pairs):
        return done
    again = repair_self_intersections(
        done, np.full(len(done.faces), -1, np.int32), np.zeros(0, np.bool_), hold=False
    )
    whole = submesh(again.mesh, np.ones(len(again.mesh.faces), dtype=np.bool_))
    whole = _placed(_without_thin(_placed(whole)))
    return whole if _closed(whole) and len(crossings(whole)) < len(pairs) else done


def _closed(mesh: Mesh) -> bool:
    return bool(len(mesh.faces)) and not len(half_edges(mesh.faces)[0])


def _placed(mesh: Mesh) -> Mesh:
    """The mesh with its vertices on the lattice, no two of them at one place."""
    step = lattice(mesh)
    places = np.round(mesh.vertices / step)
    for _ in range(_ROUNDS):
        # Whole numbers this small are exact in 32 bits.
        twice = repeated(places.astype(np.float32), mesh.faces)
        if not len(twice):
            break
        inward = -np.nan_to_num(vertex_normals(mesh)[twice])
        inward[np.linalg.norm(inward, axis=1) < 0.5] = (0.0, 0.0, 1.0)
        places[twice] = np.round(places[twice] + _NUDGE * inward)
    return replace(mesh, vertices=places * step)


def _without_thin(mesh: Mesh) -> Mesh:
    """The mesh without faces thinner than the lattice allows, as far as that goes."""
    from turnscan.mesh import _soundness_kernels as kernels

    least = _THIN * lattice(mesh)
    for _ in range(_ROUNDS):
        thin = np.flatnonzero(kernels.thinner(mesh.vertices, mesh.faces, least))
        if not len(thin):
            break
        net = _Net(mesh, least)
        if not sum([net.repair(int(f)) for f in thin]):
            break
        mesh = replace(mesh, faces=net.faces, measured=net.real)
        mesh = submesh(mesh, net.faces[:, 0] != net.faces[:, 1])
    return mesh


def _heights(t: Floats) -> Floats:
    """(f,) mm: the least height of triangles (f, 3, 3)."""
    sides = np.roll(t, -1, axis=1) - t
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(twice / np.maximum(longest, 1e-300))


def _turned(t: Floats) -> Floats:
    """(3,) normal of one triangle (3, 3), as long as twice its area."""
    return np.cross(t[1] - t[0], t[2] - t[0])


class _Net:
    """A mesh with the faces about each vertex, for a few repairs among many faces."""

    def __init__(self, mesh: Mesh, least: float) -> None:
        self.points, self.faces = mesh.vertices, mesh.faces.copy()
        self.real = measured(mesh).copy()
        self._least = least
        order = np.argsort(self.faces.ravel(), kind="stable")
        self._order = order // 3
        self._start = np.searchsorted(self.faces.ravel()[order], np.arange(len(self.points) + 1))
        self._about: dict[int, set[int]] = {}

    def repair(self, f: int) -> bool:
        """Take a thin face out of the surface; whether that could be done."""
        corners = self.faces[f]
        if corners[0] == corners[1]:
            return False
        t = self.points[corners]
        length = np.linalg.norm(np.roll(t, -1, axis=0) - t, axis=1)
        short, far = int(np.argmin(length)), int(np.argmax(length))
        a, b = int(corners[short]), int(corners[(short + 1) % 3])
        top = int(corners[(far + 2) % 3])
        ends = int(corners[far]), int(corners[(far + 1) % 3])
        if length[short] < 2 * self._least and (self._collapse(a, b) or self._collapse(b, a)):
            return True
        if self._flip(f, *ends, top):
            return True
        near = sorted(ends, key=lambda v: float(np.linalg.norm(self.points[v] - self.points[top])))
        return any(self._collapse(top, v) for v in near) or self._collapse(a, b)

    def _of(self, v: int) -> set[int]:
        if v not in self._about:
            self._about[v] = set(self._order[self._start[v] : self._start[v + 1]].tolist())
        return self._about[v]

    def _neighbours(self, v: int) -> set[int]:
        return {int(w) for f in self._of(v) for w in self.faces[f]} - {v}

    def _on_border(self, v: int) -> bool:
        return len(self._neighbours(v)) != len(self._of(v))

    def _sound(self, old: Ints, new: Ints) -> bool:
        """Whether a face may become another: not thin unless it was, and not turned over."""
        before, after = self.points[old], self.points[new]
        if _heights(before[None])[0] < self._least:
            return True
        if _heights(after[None])[0] < self._least:
            return False
        n, m = _turned(before), _turned(after)
        return bool(n @ m > _ALONG * np.linalg.norm(n) * np.linalg.norm(m))

    def _collapse(self, gone: int, to: int) -> bool:
        """Move a vertex into another one along an edge, where the topology stays as it was."""
        shared = self._of(gone) & self._of(to)
        thirds = {int(w) for f in shared for w in self.faces[f]} - {gone, to}
        common = self._neighbours(gone) & self._neighbours(to)
        if not 1 <= len(shared) <= 2 or len(thirds) != len(shared) or common != thirds:
            return False
        if len(shared) == 2 and self._on_border(gone):
            return False
        rest = self._of(gone) - shared
        if not rest or any(len(self._of(w)) <= 3 - self._on_border(w) for w in thirds):
            return False
        new = {f: np.where(self.faces[f] == gone, to, self.faces[f]) for f in rest}
        if not all(self._sound(self.faces[f], corners) for f, corners in new.items()):
            return False
        for f in shared:
            for w in self.faces[f]:
                self._of(int(w)).discard(f)
            self.faces[f] = to
        for f, corners in new.items():
            self.faces[f] = corners
            self._of(to).add(f)
        self._about[gone] = set()
        return True

    def _flip(self, f: int, a: int, b: int, top: int) -> bool:
        """Flip the edge a–b of face ``f``, whose third vertex is ``top``."""
        other = (self._of(a) & self._of(b)) - {f}
        if len(other) != 1:
            return False
        g = other.pop()
        across = int(({int(w) for w in self.faces[g]} - {a, b}).pop())
        if across == top or across in self._neighbours(top):
            return False
        normal = _turned(self.points[self.faces[g]])
        first = np.array([a, across, top], dtype=np.int32)
        second = np.array([across, b, top], dtype=np.int32)
        for corners in (first, second):
            t = self.points[corners]
            size = np.linalg.norm(_turned(t)) * np.linalg.norm(normal)
            if _heights(t[None])[0] < self._least or _turned(t) @ normal < _ALONG * size:
                return False
        self.faces[f], self.faces[g] = first, second
        self.real[[f, g]] = self.real[f] and self.real[g]
        self._of(a).discard(g)
        self._of(b).discard(f)
        self._of(across).add(f)
        self._of(top).add(g)
        return True
