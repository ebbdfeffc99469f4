"""Sharp edges put into a mesh: cut where shapes meet, vertices beside them laid on their shape."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Mesh, Provenance, measured_vertices
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._edges import (
    BENT,
    Edge,
    Index,
    Neighbourhood,
    meeting,
    neighbourhood,
    normals_and_distances,
)
from turnscan.shapes.primitives._shapes import KINDS, ShapeSet

_ROUNDS = 8
_NEAR = 0.2
"""Of the side of a face: a vertex nearer to the edge is moved onto it, else the side is cut."""
_REACH = 3.0
"""Sides of a face that a point may lie from where the shapes meet."""


@dataclass(frozen=True, eq=False)
class Sharpened:
    """A mesh with the true edges of a part."""

    mesh: Mesh
    constructed: Bools
    """(v,) True for the vertices that lie where the shapes say, not where they were measured."""
    on_edge: Bools
    """(v,) True for those on an edge."""
    label: Ints
    """(v,) index of the shape that each lies on, −1 for freeform."""
    left: int
    """Vertices beside edges that stay as measured, for a face would have folded over."""


def sharpened(mesh: Mesh, found: ShapeSet, edges: tuple[Edge, ...]) -> Sharpened:
    """A mesh whose sharp edges lie where neighbouring shapes meet.

    Sides of faces from one shape to the other are cut at the edge; the vertices of the few rings in
    which a stripe is bent by the edge go to the nearest point of their shape; the rest stays as
    measured, fillets and chamfers, too. Constructed vertices count as not measured: their laser,
    step and line are −1, their sigma that of the shapes there.
    """
    where = neighbourhood(mesh, found)
    sharp = {(e.first, e.second) for e in edges if e.form == "sharp"}
    kept = np.array([pair in sharp for pair in where.pairs], dtype=np.bool_)
    work = _Work(mesh, found, where, kept)
    if kept.any():
        work.lay()
        work.pull()
        work.cut()
    return work.done()


class _Work:
    """A mesh on the way: vertices moved, then faces cut."""

    def __init__(self, mesh: Mesh, found: ShapeSet, where: Neighbourhood, kept: Bools) -> None:
        self.mesh, self.found, self.where = mesh, found, where
        self.X = mesh.vertices.copy()
        pair = np.where(where.pair >= 0, where.pair, len(kept))
        near = np.append(kept, False)[pair] & (where.ring >= 0) & (where.ring <= BENT)
        self.near: Bools = near & measured_vertices(mesh)
        ends = np.array([*where.pairs, (-1, -1)], dtype=np.int64)[pair]
        self.label = found.label.astype(np.int64)
        loose = self.near & (self.label < 0)
        self._settle(loose, ends)
        self.other = np.where(self.label == ends[:, 0], ends[:, 1], ends[:, 0])
        self.near &= (self.label >= 0) & (ends == self.label[:, None]).any(axis=1)
        self.moved = np.zeros(len(self.X), dtype=np.bool_)
        self.edge = np.zeros(len(self.X), dtype=np.bool_)
        self.sharp = {pair for pair, k in zip(where.pairs, kept, strict=True) if k}
        self.left = 0
        none = np.zeros(0, dtype=np.int64)
        self.cuts = none, none, np.zeros((0, 3))

    def _settle(self, loose: Bools, ends: Index) -> None:
        """Vertices that were too far off any shape go to the nearer of the two."""
        best = np.full(len(self.X), np.inf)
        for k, s in enumerate(self.found.shapes):
            some = np.flatnonzero(loose & (ends == k).any(axis=1))
            d = np.abs(normals_and_distances(s, self.X[some])[0])
            better = d < best[some]
            best[some[better]] = d[better]
            self.label[some[better]] = k

    def lay(self) -> None:
        """Vertices beside edges go to the nearest point of their shape."""
        goal = self.X.copy()
        for k, s in enumerate(self.found.shapes):
            some = np.flatnonzero(self.near & (self.label == k))
            for _ in range(3):
                d, n = normals_and_distances(s, goal[some])
                goal[some] -= d[:, None] * n
        self._move(self.near, goal)

    def pull(self) -> None:
        """Vertices that hardly miss an edge, and those beyond it, go onto it."""
        a, b = self._crossings()
        p, good = self._meeting(a, b)
        side = np.linalg.norm(self.X[a] - self.X[b], axis=1)
        goal, best = self.X.copy(), np.full(len(self.X), np.inf)
        for end in (a, b):
            off = np.linalg.norm(p - self.X[end], axis=1) / np.maximum(side, 1e-12)
            some = np.flatnonzero(good & (off < _NEAR))
            some = some[np.argsort(-off[some], kind="stable")]  # the nearest is put last
            goal[end[some]], best[end[some]] = p[some], off[some]
        chosen = np.isfinite(best)
        beyond = self._beyond() & ~chosen
        if beyond.any():
            own, other = self.label[beyond], self.other[beyond]
            q, fine = self._onto(self.X[beyond], own, other)
            at = np.flatnonzero(beyond)[fine]
            goal[at] = q[fine]
            chosen[at] = True
        self.edge = self._move(chosen, goal)
        self._return()

    def _return(self) -> None:
        """Vertices that are still beyond an edge, as a face would have folded over, go to the shape
        on that side; else back to where they were measured."""
        astray = np.flatnonzero(self._beyond() & ~self.edge)
        goal = self.X.copy()
        for k, s in enumerate(self.found.shapes):
            some = astray[self.other[astray] == k]
            for _ in range(3):
                d, n = normals_and_distances(s, goal[some])
                goal[some] -= d[:, None] * n
        chosen = np.zeros(len(self.X), dtype=np.bool_)
        chosen[astray] = True
        refused = self.left
        over = self._move(chosen, goal)
        self.label[over], self.other[over] = self.other[over], self.label[over]
        left = chosen & ~over & self.moved
        back = self._move(left, self.mesh.vertices)
        self.moved &= ~back
        self.near &= ~back
        self.left = refused - int(over.sum())  # the rest of them was refused before

    def _beyond(self) -> Bools:
        """Vertices that lie on the far side of the edge that they are beside."""
        out = np.zeros(len(self.X), dtype=np.bool_)
        for i, j in self.sharp:
            for own, other in ((i, j), (j, i)):
                some = np.flatnonzero(self.near & (self.label == own) & (self.other == other))
                if not len(some):
                    continue
                d, _ = normals_and_distances(self.found.shapes[other], self.X[some])
                far = d if np.median(d) < 0 else -d
                out[some[far > 0]] = True
        return out

    def cut(self) -> None:
        """Cut the faces where they cross an edge."""
        a, b = self._crossings()
        p, good = self._meeting(a, b)
        self.cuts = a[good], b[good], p[good]

    def _corners(self, faces: Index) -> Floats:
        """Where the three shapes of a face meet (n, 3), else the middle of the face."""
        out = np.empty((len(faces), 3))
        for k, corners in enumerate(self.mesh.faces[faces]):
            x = middle = self.X[corners].mean(axis=0)
            for _ in range(_ROUNDS):
                told = [
                    normals_and_distances(self.found.shapes[s], x[None])
                    for s in self.label[corners]
                ]
                d, n = (np.concatenate(part) for part in zip(*told, strict=True))
                x = x - np.linalg.pinv(n, rcond=1e-3) @ d
            reach = _REACH * float(np.linalg.norm(np.ptp(self.X[corners], axis=0)))
            out[k] = x if np.linalg.norm(x - middle) < reach else middle
        return out

    def _crossings(self) -> tuple[Index, Index]:
        """Sides of faces between two shapes that meet in a sharp edge, neither end on it."""
        f = self.mesh.faces.astype(np.int64)
        some = (self.near[f] & (self.label[f] >= 0)).sum(axis=1) >= 2
        f = f[some & (np.ptp(self.label[f], axis=1) > 0)]
        sides = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        wide = len(self.X)
        a, b = np.divmod(np.unique(sides[:, 0] * wide + sides[:, 1]), wide)
        la, lb = self.label[a], self.label[b]
        cross = (la >= 0) & (lb >= 0) & (la != lb) & self.near[a] & self.near[b]
        cross &= ~self.edge[a] & ~self.edge[b]
        many = len(self.found.shapes)
        keys = np.array([i * many + j for i, j in sorted(self.sharp)], dtype=np.int64)
        cross &= np.isin(np.minimum(la, lb) * many + np.maximum(la, lb), keys)
        return a[cross], b[cross]

    def _meeting(self, a: Index, b: Index) -> tuple[Floats, Bools]:
        """Where the shapes of both ends meet, nearest to the side between them."""
        la, lb = self.label[a], self.label[b]
        side = np.linalg.norm(self.X[a] - self.X[b], axis=1)
        to_b, to_a = self._distance(a, lb), self._distance(b, la)
        share = to_b / np.maximum(to_a + to_b, 1e-12)
        start = self.X[a] + share[:, None] * (self.X[b] - self.X[a])
        p, good = self._onto(start, la, lb)
        good &= np.linalg.norm(p - start, axis=1) < _REACH * side
        return p, good

    def _distance(self, at: Index, shape: Index) -> Floats:
        out = np.zeros(len(at))
        for k in np.unique(shape):
            some = shape == k
            out[some] = np.abs(normals_and_distances(self.found.shapes[k], self.X[at[some]])[0])
        return out

    def _onto(self, start: Floats, first: Index, second: Index) -> tuple[Floats, Bools]:
        """The nearest points (n, 3) on both shapes of each, and which were found."""
        p, good = start.copy(), np.zeros(len(start), dtype=np.bool_)
        keys = first * len(self.found.shapes) + second
        for key in np.unique(keys):
            some = keys == key
            i, j = divmod(int(key), len(self.found.shapes))
            p[some], good[some], _ = meeting(
                self.found.shapes[i], self.found.shapes[j], start[some]
            )
        return p, good

    def _move(self, chosen: Bools, goal: Floats) -> Bools:
        """Move what is chosen, but for the vertices of faces that would fold over."""
        before = _normals(self.X, self.mesh.faces)
        chosen = chosen.copy()
        wanted = int(chosen.sum())
        for _ in range(_ROUNDS):
            X = np.where(chosen[:, None], goal, self.X)
            after = _normals(X, self.mesh.faces)
            folded = np.einsum("ij,ij->i", before, after) < 0
            some = self.mesh.faces[folded].ravel()
            if not chosen[some].any():
                break
            chosen[some] = False
        self.left += wanted - int(chosen.sum())
        self.X = np.where(chosen[:, None], goal, self.X)
        self.moved |= chosen
        return chosen

    def done(self) -> Sharpened:
        """The mesh with its new vertices and faces."""
        mesh = self.mesh
        a, b, p = self.cuts
        faces, parent, cornered = split_faces(mesh.faces, a, b, len(self.X))
        p = np.concatenate([p, self._corners(cornered)])
        lead = self.mesh.faces[cornered].astype(np.int64)
        a, b = np.concatenate([a, lead[:, 0]]), np.concatenate([b, lead[:, 1]])
        v, extra = len(self.X), len(p)
        constructed = np.concatenate([self.moved, np.ones(extra, dtype=np.bool_)])
        on_edge = np.concatenate([self.edge, np.ones(extra, dtype=np.bool_)])
        origin = np.concatenate([np.arange(v), a])
        X = np.concatenate([self.X, p])
        out = replace(
            mesh,
            vertices=X,
            faces=faces.astype(np.int32),
            provenance=self._provenance(X, origin, constructed, b),
            colour=None if mesh.colour is None else mesh.colour[origin],
            measured=None if mesh.measured is None else mesh.measured[parent],
        )
        return Sharpened(out, constructed, on_edge, self.label[origin], self.left)

    def _provenance(
        self, X: Floats, origin: Index, constructed: Bools, b: Index
    ) -> Provenance | None:
        p = self.mesh.provenance
        if p is None:
            return None
        sigma = p.sigma[origin].copy()
        labels = self.label[origin]
        second = np.concatenate(
            [np.where(self.edge, self.other, labels[: len(self.X)]), self.label[b]]
        )
        for k, s in enumerate(self.found.shapes):
            for which in (labels, second):
                some = np.flatnonzero(constructed & (which == k))
                J = surface.jacobian(KINDS.index(s.kind), s.numbers, np.ascontiguousarray(X[some]))[
                    1
                ]
                own = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", J, s.covariance, J), 0.0))
                sigma[some] = own if which is labels else np.maximum(sigma[some], own)
        gone = np.where(constructed, -1, 0)
        laser, step, line = (np.where(gone, -1, part[origin]) for part in (p.laser, p.step, p.line))
        return Provenance(sigma, laser, step, line, p.lasers)


def _normals(X: Floats, faces: np.ndarray) -> Floats:
    t = X[faces]
    n: Floats = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return n


def split_faces(faces: np.ndarray, a: Index, b: Index, first: int) -> tuple[Index, Index, Index]:
    """Faces (f, 3) with a new vertex, ``first`` and up, on each of the sides (a, b), a < b.

    A face with one new vertex becomes two, with two three; one with three, at a corner of the part,
    six about a vertex in its middle, which are numbered after those of the sides. Returns the
    faces, the index of the face that each was part of, and the faces that have a middle.
    """
    f = faces.astype(np.int64)
    if not len(a):
        return f, np.arange(len(f)), np.zeros(0, dtype=np.int64)
    wide = int(f.max()) + 1
    keys = a * wide + b
    order = np.argsort(keys)
    keys = keys[order]
    new = np.full(f.shape, -1, dtype=np.int64)
    for k in range(3):
        i, j = f[:, k], f[:, (k + 1) % 3]
        want = np.minimum(i, j) * wide + np.maximum(i, j)
        at = np.minimum(np.searchsorted(keys, want), len(keys) - 1)
        hit = keys[at] == want
        new[hit, k] = first + order[at[hit]]
    many = (new >= 0).sum(axis=1)
    out, parent = [f[many == 0]], [np.flatnonzero(many == 0)]
    for count in (1, 2, 3):
        some = np.flatnonzero(many == count)
        if not len(some):
            continue
        # Turned so that a side with a new vertex comes first, and with two the whole side last.
        lead = (
            np.argmax(new[some] >= 0, axis=1) if count == 1 else np.argmin(new[some] >= 0, axis=1)
        )
        turn = (lead + (0 if count == 1 else 1)) % 3
        pick = (turn[:, None] + np.arange(3)) % 3
        c = np.take_along_axis(f[some], pick, axis=1)
        m = np.take_along_axis(new[some], pick, axis=1)
        for corners in _PIECES[count]:
            middle = first + len(a) + np.arange(len(some))
            columns = [*c.T, *m.T, middle]
            out.append(np.column_stack([columns[k] for k in corners]))
            parent.append(some)
    return np.concatenate(out), np.concatenate(parent), np.flatnonzero(many == 3)


_PIECES = {
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    3: ((0, 3, 6), (3, 1, 6), (1, 4, 6), (4, 2, 6), (2, 5, 6), (5, 0, 6)),
}
"""New faces of a face by its new vertices: 0 to 2 are its corners, 3 to 5 the new vertices on the
sides 0–1, 1–2 and 2–0, 6 the one in the middle."""
