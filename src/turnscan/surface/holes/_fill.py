"""Fill: holes → faces that were not measured, continued from what lies round them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.mesh._fair import Order, fair
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._normals import roughness, smoothed_normals
from turnscan.mesh._parts import measured
from turnscan.mesh._topology import opposite_half_edges
from turnscan.progress import Progress, no_progress
from turnscan.surface.holes._holes import Hole, holes, vector_area

FillHow = Literal["auto", "flat", "membrane", "tangent", "curvature"]
"""flat: triangles between the vertices of the border alone. membrane: the least area that
spans the border, flat where that is. tangent: goes on in the border's tangent planes. curvature:
goes on with the border's curvature, too. auto: membrane in a hole that an edge runs round, tangent
in others (`fill`)."""
_STEEPEST = float(np.radians(60.0))
_STEEP = np.cos(_STEEPEST)
"""A border is an edge where the surface stands steeper than this on the hole's best plane."""

_NOISY = 3.0
"""Times the roughness of the surface below which a change of a filling's curvature is noise."""
_LONGEST = 400
"""Corners of a loop that are spanned in one go: the time grows with their third power."""
_ORDERS: Final[dict[FillHow, Order]] = {"auto": 2, "membrane": 1, "tangent": 2, "curvature": 3}
"""How each way is faired (`fair`)."""
_MOST = 20_000
"""New corners in one hole at most; a larger one is filled more coarsely."""


@dataclass(frozen=True)
class Patch:
    """Faces for one hole."""

    loop: Ints
    """(m,) vertex numbers round the hole, in the winding of the patch."""
    points: Floats
    """(k, 3) mm: corners that are new."""
    faces: Ints
    """(t, 3) below m: places in the loop; from m on: new points."""
    order: Order | None = None
    """How the new points are faired (`fair`); None leaves them where they are."""


def fill(
    mesh: Mesh,
    which: Sequence[Hole] | Sequence[int] | None = None,
    how: FillHow = "auto",
    progress: Progress = no_progress,
) -> Mesh:
    """Fill holes of a mesh: all, or those given as values or as places in ``holes(mesh)``.

    Each border is spanned by the triangles that bend least (Liepa, Filling holes in meshes,
    2003), refined to the density of the surroundings and faired (`fair`). ``flat`` adds no
    vertices and lies as near to one plane as the border does; ``membrane`` is spanned by the
    triangles of least area. ``auto`` takes a membrane where along more than half of the border the
    surface stands steeper than 60° on the hole's best plane: there it ends in an edge, and what
    lies beyond does not go on in its tangent planes. A plate that leaves its border at an angle β
    rises a/2 tan β over a hole of radius a, at 60° nearly as far as the hole reaches; a ball of
    which so much is gone lacks a quarter. All others go on in their
    tangent planes, as a ball does of which less is gone. No vertex that is there moves. New
    faces are not ``measured``, new vertices have provenance −1, and where the mesh is coloured,
    the mean colour of their border. ``progress`` hears of each hole.

    Raises InputError for a hole that is not one of this mesh.
    """
    return with_patches(mesh, patches(mesh, _chosen(mesh, which), how, progress))


def ways(mesh: Mesh, loops: Sequence[Ints], hows: Sequence[FillHow]) -> list[FillHow]:
    """How each of the borders of a mesh is filled: what was asked for, or what ``auto`` takes."""
    if "auto" not in hows:
        return list(hows)
    normals = smoothed_normals(mesh)
    edges = (
        how == "auto" and _is_edge(mesh.vertices[k], normals[k])
        for k, how in zip(loops, hows, strict=True)
    )
    own: list[FillHow] = ["membrane" if edge else "tangent" for edge in edges]
    return [o if how == "auto" else how for o, how in zip(own, hows, strict=True)]


def _is_edge(corners: Floats, normals: Floats) -> bool:
    """Whether a border (m, 3) is an edge along more than half of it; the surface's normals there.

    The patch runs against the border, so its normal is that of the border turned over.
    """
    over = -vector_area(corners)
    after, before = np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0)
    length = np.linalg.norm(after - corners, axis=1) + np.linalg.norm(corners - before, axis=1)
    steep = normals @ over < _STEEP * np.linalg.norm(over)
    return bool(length[steep].sum() > 0.5 * length.sum())


def _chosen(mesh: Mesh, which: Sequence[Hole] | Sequence[int] | None) -> list[Ints]:
    known = holes(mesh) if which is None or not all(isinstance(w, Hole) for w in which) else []
    out = []
    for w in range(len(known)) if which is None else which:
        if isinstance(w, Hole):
            out.append(w.loop)
        elif 0 <= w < len(known):
            out.append(known[w].loop)
        else:
            raise InputError(f"hole {w}: the mesh has {len(known)}", hint="list them with holes()")
    return out


def patches(
    mesh: Mesh,
    loops: Sequence[Ints],
    how: FillHow | Sequence[FillHow],
    progress: Progress = no_progress,
) -> list[Patch]:
    """A patch for each border of a mesh (its winding that of the faces it bounds); not yet faired.

    ``how`` is that of all, or of each.
    Raises InputError where a loop is no border of this mesh.
    """
    corners = mesh.faces.ravel()
    lonely = np.flatnonzero(opposite_half_edges(mesh.faces) < 0)
    side = np.full(len(mesh.vertices), -1, dtype=np.int64)
    side[corners[lonely]] = lonely
    far = corners[lonely // 3 * 3 + (lonely + 2) % 3]
    beyond = np.full(len(mesh.vertices), -1, dtype=np.int32)
    beyond[corners[lonely]] = far
    after = np.full(len(mesh.vertices), -1, dtype=np.int32)
    after[corners[lonely]] = corners[lonely // 3 * 3 + (lonely + 1) % 3]
    scale = side_lengths(mesh)
    taken = ways(mesh, loops, [how] * len(loops) if isinstance(how, str) else how)
    chords = _Chords(mesh, loops)
    out = []
    for number, loop in enumerate(loops):
        progress(number / len(loops))
        if len(loop) < 3 or (after[loop] != np.roll(loop, -1)).any():
            raise InputError(
                f"hole {number}: its {len(loop)} vertices are not a boundary of this mesh",
                hint="take the holes of the mesh that is to be filled",
            )
        # The patch lies on the other side of the border: it runs against the faces' winding.
        ring = loop[::-1].copy()
        outer = mesh.vertices[beyond[np.roll(ring, -1)]]
        out.append(
            _patch(
                ring,
                mesh.vertices[ring],
                outer,
                scale[ring],
                chords.of(number)[::-1, ::-1],
                taken[number],
            )
        )
    return out


def _patch(
    ring: Ints, points: Floats, outer: Floats, scale: Floats, used: Bools, how: FillHow
) -> Patch:
    from turnscan.surface.holes import _loop_kernels
    from turnscan.surface.holes import _patch_kernels as kernels

    m = len(ring)
    used = np.ascontiguousarray(used)
    if how == "flat":
        faces = _loop_kernels.clip_ears(flattened(points), used)
        sound = bool(not used[faces[:, [0, 1, 2]], faces[:, [1, 2, 0]]].any())
    else:
        faces, sound = _spanned(points, outer, used, bent=how != "membrane")
    if not sound:
        # Every chord there is belongs to two faces already: a corner in the middle needs none.
        around = np.arange(m, dtype=np.int32)
        faces = np.stack([around, np.roll(around, -1), np.full(m, m, np.int32)], axis=1)
        return Patch(ring, points.mean(axis=0)[None], faces)
    if how == "flat":
        kernels.relax(points, faces, _beyond_sides(faces), len(faces), m, used)
        return Patch(ring, np.empty((0, 3)), faces)
    return refined(ring, points, faces, scale, used, how)


def refined(
    ring: Ints, points: Floats, faces: Ints, scale: Floats, used: Bools, how: FillHow
) -> Patch:
    """A patch over the vertices of its border, made as dense as the border's ``scale`` (m,) mm."""
    from turnscan.surface.holes import _patch_kernels as kernels

    area = _area(points, faces)
    limit = int(min(_MOST, 6 * area / max(float(scale.min()), 1e-9) ** 2 + 8))
    scale = np.maximum(scale, np.sqrt(2 * area / _MOST))
    all_points, faces = kernels.refine(points, faces, _beyond_sides(faces), scale, used, limit)
    return Patch(ring, all_points[len(ring) :], faces, _ORDERS[how])


def _beyond_sides(faces: Ints) -> Ints:
    """(t, 3) the triangle across each side, −1: none; every side has at most two."""
    a, b = faces.astype(np.int64), np.roll(faces, -1, axis=1).astype(np.int64)
    key = (np.minimum(a, b) * (faces.max() + 1) + np.maximum(a, b)).ravel()
    order = np.argsort(key, kind="stable")
    one, other = order[:-1], order[1:]
    alike = key[one] == key[other]
    out = np.full(faces.size, -1, dtype=np.int32)
    out[one[alike]], out[other[alike]] = other[alike] // 3, one[alike] // 3
    return out.reshape(faces.shape)


def _area(points: Floats, faces: Ints) -> float:
    return float(np.linalg.norm(_normals(points[faces]), axis=1).sum() / 2)


def _spanned(points: Floats, outer: Floats, used: Bools, *, bent: bool) -> tuple[Ints, bool]:
    """Triangles (m − 2, 3) of a loop; a long one is spanned coarsely, then between its corners.

    False where chords that are ``used`` leave none; the triangles say nothing then.
    """
    from turnscan.surface.holes import _patch_kernels as kernels

    m = len(points)
    if m <= _LONGEST:
        faces, sound = kernels.span(points, outer, used, bent)
        return faces, bool(sound)
    cuts = _cuts(used)
    if len(cuts) < 3:
        return np.zeros((0, 3), dtype=np.int32), False
    some = np.ix_(cuts, cuts)
    coarse, sound = _spanned(points[cuts], outer[cuts], used[some], bent=bent)
    if not sound:
        return coarse, False
    ends = np.append(cuts[1:], cuts[0] + m)
    inside = {(int(a), int(b)): int(c) for t in coarse for a, b, c in _turned(t)}
    parts = [cuts[coarse]]
    for i, (begin, end) in enumerate(zip(cuts, ends, strict=True)):
        chain = np.arange(begin, end + 1, dtype=np.int32) % m
        if len(chain) < 3:
            continue
        far = cuts[inside[i, (i + 1) % len(cuts)]]
        beyond = np.concatenate([outer[chain[:-1]], points[far][None]])
        faces, good = _spanned(points[chain], beyond, used[np.ix_(chain, chain)], bent=bent)
        if not good:
            return faces, False
        parts.append(chain[faces])
    return np.concatenate(parts), True


def _cuts(used: Bools) -> Ints:
    """Some vertices of a loop with chords ``used`` (m, m), which join none to the next of them."""
    m = len(used)
    cuts = np.linspace(0, m, _LONGEST // 2, endpoint=False).astype(np.int32)
    while (joined := used[cuts, np.roll(cuts, -1)]).any():
        cuts = cuts[~np.roll(joined, 1)]
    return cuts


def _turned(t: Ints) -> list[tuple[int, int, int]]:
    a, b, c = (int(x) for x in t)
    return [(a, b, c), (b, c, a), (c, a, b)]


class _Chords:
    """Which vertices of a loop a side of the mesh joins already."""

    def __init__(self, mesh: Mesh, loops: Sequence[Ints]) -> None:
        self._loops = loops
        which = np.full(len(mesh.vertices), -1, dtype=np.int32)
        place = np.zeros(len(mesh.vertices), dtype=np.int32)
        for number, loop in enumerate(loops):
            which[loop], place[loop] = number, np.arange(len(loop))
        a = mesh.faces[:, [0, 1, 2]].ravel()
        b = mesh.faces[:, [1, 2, 0]].ravel()
        inside = (which[a] >= 0) & (which[a] == which[b])
        order = np.argsort(which[a[inside]], kind="stable")
        self._a, self._b = place[a[inside]][order], place[b[inside]][order]
        self._start = np.searchsorted(which[a[inside]][order], np.arange(len(loops) + 1))

    def of(self, number: int) -> Bools:
        """(m, m) True where vertices of the loop are joined by a side, also one of the border."""
        m = len(self._loops[number])
        used = np.zeros((m, m), dtype=np.bool_)
        part = slice(self._start[number], self._start[number + 1])
        used[self._a[part], self._b[part]] = True
        used[self._b[part], self._a[part]] = True
        around = np.arange(m)
        used[around, (around + 1) % m] = used[(around + 1) % m, around] = False
        return used


def with_patches(mesh: Mesh, done: Sequence[Patch]) -> Mesh:
    """The mesh with patches sewn in, their new vertices faired."""
    count = len(mesh.vertices)
    points, faces = [mesh.vertices], [mesh.faces]
    for patch in done:
        numbers = np.arange(count, count + len(patch.points), dtype=np.int32)
        faces.append(np.concatenate([patch.loop, numbers])[patch.faces])
        points.append(patch.points)
        count += len(patch.points)
    vertices, sewn = np.concatenate(points), np.concatenate(faces)
    more = np.array([len(p.points) for p in done], dtype=np.int64)
    old = len(mesh.vertices)
    size = np.concatenate([np.ones(old), np.repeat([_across(mesh, p) for p in done], more)])
    order = np.concatenate([np.zeros(old), np.repeat([float(p.order or 0) for p in done], more)])
    plain = np.minimum(order, 2)  # curvature is a correction to the plate
    for k in sorted({min(p.order, 2) for p in done if p.order is not None}):
        vertices = fair(vertices, sewn, np.asarray(plain == k), k, size)
    if (order == 3).any():
        curved = fair(vertices, sewn, np.asarray(order == 3), 3, size)
        vertices = vertices + _bounded(curved - vertices, mesh, done)
    return replace(
        mesh,
        vertices=vertices,
        faces=sewn,
        provenance=unmeasured(mesh.provenance, int(more.sum())),
        colour=_coloured(mesh, done),
        measured=np.concatenate(
            [measured(mesh), np.zeros(len(sewn) - len(mesh.faces), dtype=np.bool_)]
        ),
    )


def _bounded(change: Floats, mesh: Mesh, done: Sequence[Patch]) -> Floats:
    """(v, 3) mm by which curvature moves the plates of patches, no further than is its due.

    Over a hole of radius a whose border leaves its best plane at an angle β, a ball rises
    a tan(β/2), and the plate in its tangent planes a/2 tan β: a β³/8 more, to the first order.
    Twice that much the curvature may take back, or add; what moves further follows noise, and so
    does what is less than three times the roughness of the surface. Where an edge runs round the
    hole it has nothing to say.
    """
    out = np.zeros_like(change)
    start, normals, least = (
        len(mesh.vertices),
        smoothed_normals(mesh),
        _NOISY * roughness(mesh, about_middle=True),
    )
    for patch in done:
        new = slice(start, start + len(patch.points))
        start = new.stop
        if patch.order != 3 or not len(patch.points):
            continue
        ring = patch.loop[::-1]
        over = -vector_area(mesh.vertices[ring])
        cosine = normals[ring] @ over / max(float(np.linalg.norm(over)), 1e-300)
        beta = float(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2)))
        if beta >= _STEEPEST:
            continue
        most = _across(mesh, patch) * abs(np.tan(beta) / 2 - np.tan(beta / 2))
        far = float(np.linalg.norm(change[new], axis=1).max())
        known = max(0.0, 1.0 - (least / max(far, 1e-300)) ** 2)
        out[new] = change[new] * known * min(1.0, most / max(far, 1e-300))
    return out


def _across(mesh: Mesh, patch: Patch) -> float:
    """mm: how wide a hole is, the diameter of a circle of its perimeter."""
    corners = mesh.vertices[patch.loop]
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return max(float(sides.sum()) / np.pi, 1e-9)


def _coloured(mesh: Mesh, done: Sequence[Patch]) -> npt.NDArray[np.uint8] | None:
    if mesh.colour is None:
        return None
    rows = [
        np.repeat(np.rint(mesh.colour[p.loop].mean(axis=0))[None], len(p.points), axis=0)
        for p in done
    ]
    return np.concatenate([mesh.colour, *(r.astype(np.uint8) for r in rows)])


def unmeasured(p: Provenance | None, more: int) -> Provenance | None:
    """Provenance with ``more`` vertices added that were not measured."""
    if p is None:
        return None
    none = np.full(more, -1, dtype=np.int32)
    return Provenance(
        np.concatenate([p.sigma, np.full(more, np.nan)]),
        np.concatenate([p.laser, none]),
        np.concatenate([p.step, none]),
        np.concatenate([p.line, none]),
        p.lasers,
    )


def side_lengths(mesh: Mesh) -> Floats:
    """(v,) mm: the mean length of the sides about each vertex."""
    a = mesh.faces[:, [0, 1, 2]].ravel()
    b = mesh.faces[:, [1, 2, 0]].ravel()
    length = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)
    total = np.bincount(a, length, len(mesh.vertices)) + np.bincount(b, length, len(mesh.vertices))
    count = np.bincount(a, minlength=len(total)) + np.bincount(b, minlength=len(total))
    return np.asarray(total / np.maximum(count, 1))


def _normals(triangles: Floats) -> Floats:
    """(f, 3) normals as long as twice the area."""
    twice: Floats = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return twice


def flattened(loop: Floats) -> Floats:
    """A loop (m, 3) in the plane it encloses most area in, (m, 2)."""
    centred = loop - loop.mean(axis=0)
    normal = vector_area(loop)
    size = float(np.linalg.norm(normal))
    normal = normal / size if size > 0 else np.array([0.0, 0.0, 1.0])
    lead = np.eye(3)[int(np.argmin(np.abs(normal)))]
    e1 = np.cross(normal, lead)
    e1 /= np.linalg.norm(e1)
    return np.stack([centred @ e1, centred @ np.cross(normal, e1)], axis=-1)
