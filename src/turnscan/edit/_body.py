"""Body: a mesh whose faces keep their numbers while it is edited; Patch: one change of it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.mesh import Mesh, Provenance, submesh


@dataclass(frozen=True, eq=False)
class Body:
    """The surface under edit. Faces are only ever added at the end, or marked dead.

    So a face has one number as long as no `Replace` comes, whatever is done and undone around it.
    """

    mesh: Mesh
    """Every face and vertex there is a number for, the dead ones too."""
    alive: Bools
    """(f,) False for a face that was deleted."""
    key: str
    """Names the numbering: bodies with one key give every number to the same face. It holds
    through deletes and moves and changes with what is added, so it is the same again after undo."""

    def __post_init__(self) -> None:
        alive = frozen(self.alive, (len(self.mesh.faces),), "Body.alive", np.bool_)
        object.__setattr__(self, "alive", alive)

    @classmethod
    def of(cls, mesh: Mesh) -> Body:
        """A body that nothing was done to yet; its key is the hash of vertices and faces."""
        key = _hash("", mesh.vertices, mesh.faces)
        return cls(mesh, np.ones(len(mesh.faces), dtype=np.bool_), key)

    @property
    def measured(self) -> Bools:
        """(f,) False for a face that closes a gap and was not measured."""
        return _measured(self.mesh)

    def digest(self) -> str:
        """SHA-256 over everything, to tell whether two bodies are the same to the bit."""
        m, p = self.mesh, self.mesh.provenance
        whole: list[npt.NDArray[Any]] = [m.vertices, m.faces, self.alive, self.measured]
        if p is not None:
            whole += [p.sigma, p.laser, p.step, p.line]
        return _hash(self.key, *whole)


@dataclass(frozen=True, eq=False)
class Compact:
    """Living faces of a body as a mesh of their own, and the numbers things have in the body."""

    mesh: Mesh
    vertex_ids: Ints
    """(v,) number in the body of each vertex."""
    face_ids: Ints
    """(f,) number in the body of each face."""

    @classmethod
    def of(cls, body: Body, part: Bools | None = None) -> Compact:
        """Living faces in their order, and the vertices they use in theirs.

        ``part`` (f,) takes the faces where it is True alone; None takes all.
        """
        chosen = body.alive if part is None else body.alive & part
        used = np.zeros(len(body.mesh.vertices), dtype=np.bool_)
        used[body.mesh.faces[chosen]] = True
        return cls(
            submesh(body.mesh, chosen),
            np.flatnonzero(used).astype(np.int32),
            np.flatnonzero(chosen).astype(np.int32),
        )


@dataclass(frozen=True, eq=False)
class Alive:
    """Delete faces, or bring them back."""

    faces: Ints
    """(n,) numbers."""
    value: bool

    def on(self, body: Body) -> Body:
        """The body with these faces dead or alive."""
        alive = body.alive.copy()
        alive[self.faces] = self.value
        return replace(body, alive=alive)

    def inverse(self, body: Body) -> Alive:
        """What takes this back again, where it is about to be done to ``body``."""
        return Alive(self.faces[body.alive[self.faces] != self.value], not self.value)


@dataclass(frozen=True, eq=False)
class Verts:
    """Move vertices."""

    ids: Ints
    """(n,) numbers."""
    positions: Floats
    """(n, 3) mm."""
    sigma: Floats | None = None
    """(n,) mm, NaN where not known; None leaves it as it is."""

    def on(self, body: Body) -> Body:
        """The body with these vertices there."""
        mesh = body.mesh
        vertices = mesh.vertices.copy()
        vertices[self.ids] = self.positions
        p = mesh.provenance
        if self.sigma is not None and p is not None:
            sigma = p.sigma.copy()
            sigma[self.ids] = self.sigma
            p = replace(p, sigma=sigma)
        return replace(body, mesh=replace(mesh, vertices=vertices, provenance=p))

    def inverse(self, body: Body) -> Verts:
        """What takes this back again, where it is about to be done to ``body``."""
        p = body.mesh.provenance
        sigma = None if self.sigma is None or p is None else p.sigma[self.ids]
        return Verts(self.ids, body.mesh.vertices[self.ids], sigma)


@dataclass(frozen=True, eq=False)
class Append:
    """Add vertices and faces at the end; faces may use old and new vertices."""

    vertices: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3) numbers of vertices in the body."""
    measured: Bools
    """(f,) False for faces that close a gap."""
    provenance: Provenance | None
    """Of the new vertices, with the body's lasers; None where the body has none."""

    def on(self, body: Body) -> Body:
        """The body with more."""
        m, p = body.mesh, body.mesh.provenance
        if p is not None and self.provenance is not None:
            q = self.provenance
            p = Provenance(
                np.concatenate([p.sigma, q.sigma]),
                np.concatenate([p.laser, q.laser]),
                np.concatenate([p.step, q.step]),
                np.concatenate([p.line, q.line]),
                p.lasers,
            )
        return Body(
            Mesh(
                np.concatenate([m.vertices, self.vertices]),
                np.concatenate([m.faces, self.faces]),
                p,
                None,
                np.concatenate([body.measured, self.measured]),
            ),
            np.concatenate([body.alive, np.ones(len(self.faces), dtype=np.bool_)]),
            _hash(body.key, self.vertices, self.faces),
        )

    def inverse(self, body: Body) -> Truncate:
        """What takes this back again, where it is about to be done to ``body``."""
        return Truncate(len(body.mesh.vertices), len(body.mesh.faces), body.key)


@dataclass(frozen=True, eq=False)
class Truncate:
    """Take away what was added at the end, all of it alive and where it was; undo makes these."""

    vertices: int
    """Number of vertices that are left."""
    faces: int
    """Number of faces that are left."""
    key: str
    """The body's key before they were added."""

    def on(self, body: Body) -> Body:
        """The body without what was added."""
        m = body.mesh
        mesh = Mesh(
            m.vertices[: self.vertices],
            m.faces[: self.faces],
            _cut(m.provenance, slice(self.vertices)),
            None,
            body.measured[: self.faces],
        )
        return Body(mesh, body.alive[: self.faces], self.key)

    def inverse(self, body: Body) -> Append:
        """What takes this back again, where it is about to be done to ``body``."""
        m = body.mesh
        return Append(
            m.vertices[self.vertices :],
            m.faces[self.faces :],
            body.measured[self.faces :],
            _cut(m.provenance, slice(self.vertices, None)),
        )


@dataclass(frozen=True, eq=False)
class Replace:
    """Another body in this one's place, with numbers of its own."""

    body: Body

    def on(self, body: Body) -> Body:
        """The other body."""
        return self.body

    def inverse(self, body: Body) -> Replace:
        """What takes this back again, where it is about to be done to ``body``."""
        return Replace(body)


Patch = Alive | Verts | Append | Truncate | Replace
"""One change of a body. ``patch.on(body)`` does it, ``patch.inverse(body)`` undoes it exactly."""

_MOSTLY = 0.5
"""A change of more than this part of all faces is sent as a new body."""


def difference(body: Body, before: Compact, after: Mesh) -> tuple[Patch, ...]:
    """How to get from the living part ``before`` of a body to ``after``, as patches of the body.

    Where ``after`` begins with the vertices and faces of ``before``, in their order, their numbers
    stay: moved vertices move, faces with other corners die and come again at the end, what comes
    after is added. Otherwise it is a `Replace`.
    """
    v, f = len(before.mesh.vertices), len(before.mesh.faces)
    p, q = before.mesh.provenance, after.provenance
    alike = len(after.vertices) >= v and len(after.faces) >= f and (p is None) == (q is None)
    if alike and p is not None and q is not None:
        alike = p.lasers == q.lasers and all(
            np.array_equal(getattr(p, name), getattr(q, name)[:v])
            for name in ("laser", "step", "line")
        )
    if not alike or before.mesh.colour is not None or after.colour is not None:
        return (Replace(Body.of(after)),)
    changed = (after.faces[:f] != before.mesh.faces).any(axis=1)
    changed |= _measured(after)[:f] != _measured(before.mesh)
    if changed.sum() > _MOSTLY * f:
        return (Replace(Body.of(after)),)
    patches: list[Patch] = []
    moved = (after.vertices[:v] != before.mesh.vertices).any(axis=1)
    sigma = None
    if p is not None and q is not None:
        renewed = ~((p.sigma == q.sigma[:v]) | (np.isnan(p.sigma) & np.isnan(q.sigma[:v])))
        if renewed.any():
            moved |= renewed
            sigma = q.sigma[:v][moved]
    if moved.any():
        patches.append(Verts(before.vertex_ids[moved], after.vertices[:v][moved], sigma))
    if changed.any():
        patches.append(Alive(before.face_ids[changed], False))
    rows = np.concatenate([np.flatnonzero(changed), np.arange(f, len(after.faces))])
    if len(rows) or len(after.vertices) > v:
        start, more = len(body.mesh.vertices), len(after.vertices) - v
        number = np.concatenate([before.vertex_ids, np.arange(start, start + more, dtype=np.int32)])
        patches.append(
            Append(
                after.vertices[v:],
                number[after.faces[rows]].astype(np.int32).reshape(-1, 3),
                _measured(after)[rows],
                _cut(q, slice(v, None)),
            )
        )
    return tuple(patches)


def _cut(p: Provenance | None, part: slice) -> Provenance | None:
    if p is None:
        return None
    return Provenance(p.sigma[part], p.laser[part], p.step[part], p.line[part], p.lasers)


def _measured(mesh: Mesh) -> Bools:
    return np.ones(len(mesh.faces), dtype=np.bool_) if mesh.measured is None else mesh.measured


def _hash(start: str, *arrays: npt.NDArray[Any]) -> str:
    total = hashlib.sha256(start.encode())
    for array in arrays:
        total.update(np.ascontiguousarray(array).data)
    return total.hexdigest()
