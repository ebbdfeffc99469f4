"""Where to ask why a hole is there: places on the surface that it lacks, as far as is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.surface.holes._fill import patches
from turnscan.surface.holes._holes import Hole, vector_area
from turnscan.surface.holes._spans import spanned, unit, walled

_MARGIN = 2.0
"""Usual sides of faces by which a surface ends before the volume does: a sample, and clean-up."""
_SMALL = 6.0
"""Usual sides of faces up to which a hole's patch has no direction of its own."""
_RINGS = 2
"""Distances beyond an island's border at which what is about it is asked."""
_SPANNED = 0.75
"""Share of a hole's border that must be faced over a smooth arc for one surface to span it."""
_WALLED = 0.1
"""Share of a wide hole's border along which the surface looks into it that makes it a recess: bores
have 0.1 to 0.4, painted places next to nothing; in narrow holes the noise of normals makes that."""
_SAMPLES = 48
"""Places in a hole that are asked, at most."""
_RIM = 100
"""Corners of a rim that tell how the surface goes on, about."""


@dataclass(frozen=True)
class Places:
    """Places on the flat patches that close the holes."""

    at: Floats
    """(m, 3) mm, lifted off the patch."""
    normal: Floats
    """(m, 3) outward."""
    hole: Ints
    """(m,), ascending."""
    face: float
    """mm: usual length of a face, its longest side: what two samples are apart."""
    margin: float
    """mm: what is nearer to a sample may be it, and what is nearer to the end of the volume lies
    beyond what is measured of it."""

    bent: Bools
    """(m,) True where the patch turns off from the surface about it by more than 60°, and where a
    face is thought to turn off at all: its direction is a guess."""
    wide: Bools
    """(h,) True for the holes that are wide enough for their patch to have a direction."""

    reach: Floats
    """(h,) mm: how far each hole reaches, its size."""
    smooth: Bools
    """(h,) True for the holes that a smooth surface may span (`spanned`), and into which no wall
    goes down (`walled`)."""

    island: Bools
    """(h,) True for borders of islands: what they enclose is there, and what is about it lacks."""

    def some(self, which: Ints) -> Places:
        at, normal, bent = self.at[which], self.normal[which], self.bent[which]
        return replace(self, at=at, normal=normal, hole=self.hole[which], bent=bent)

    def part(self, which: slice) -> Places:
        at, normal, bent = self.at[which], self.normal[which], self.bent[which]
        return replace(self, at=at, normal=normal, hole=self.hole[which], bent=bent)


def places_in(mesh: Mesh, found: Sequence[Hole]) -> Places:
    """Places spread evenly over flat patches in the holes, more in a larger hole.

    They are lifted to where the surface about the hole would bulge to, lest its rim stand before
    them, and clear of its noise. The border of an island bounds what is about it, and a patch over
    it would lie on the island: the places are beyond its border.
    """
    sides = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, 1, axis=1), axis=2)
    usual, face = float(np.median(sides[:, 1])), float(np.median(sides.max(axis=1)))
    size = np.array([h.size for h in found])
    width = np.array([4 * h.area / max(h.perimeter, 1e-12) for h in found])
    X, own, hole, total = _spread(mesh, found, usual)
    rims = _Rims.of(mesh, found)
    wide = width >= _SMALL * usual
    n = np.where(wide[hole, None], own, _directions(mesh, found, total, usual, rims)[hole])
    rise, rim = rims.beside(X, n, hole)
    lift = np.clip(0.05 * size, 0.25 * usual, usual)[hole]
    lift += np.clip(rise, 0.0, 0.25 * width[hole])
    at = X + lift[:, None] * n
    island = np.einsum("ij,ij->i", own, rims.normals[rim]) < -0.5
    over = rims.normals[rim[island]]
    beyond = (_MARGIN * usual * (1 + np.arange(len(X)) % _RINGS))[island, None]
    at[island] = mesh.vertices[rim[island]] + beyond * rims.outward[rim[island]]
    at[island] += 0.25 * usual * over
    n[island] = over
    bent = np.einsum("ij,ij->i", n, rims.normals[rim]) < 0.5
    asked = np.maximum(np.bincount(hole, minlength=len(found)), 1)
    inner = np.bincount(hole, island, len(found)) > 0.5 * asked
    smooth = spanned(mesh, found, face, rims.normals) >= _SPANNED
    smooth &= np.bincount(hole, bent, len(found)) <= 0.5 * asked
    deep = [int(k) for k in np.flatnonzero(smooth & wide)]
    smooth[deep] = walled(mesh, [found[k] for k in deep], rims.normals) <= _WALLED
    return Places(at, n, hole, face, _MARGIN * usual, bent, wide, size, smooth, inner)


def flat_lids(mesh: Mesh, found: Sequence[Hole]) -> tuple[Mesh, Ints]:
    """The flat patches that close holes of a mesh, by themselves, and (f,) whose each face is."""
    points, faces, count = [mesh.vertices], [np.zeros((0, 3), np.int32)], len(mesh.vertices)
    made = patches(mesh, [h.loop for h in found], "flat")
    for patch in made:
        more = np.arange(count, count + len(patch.points), dtype=np.int32)
        faces.append(np.concatenate([patch.loop, more])[patch.faces])
        points.append(patch.points)
        count += len(patch.points)
    owner = np.repeat(np.arange(len(found)), [len(p.faces) for p in made])
    return Mesh(np.concatenate(points), np.concatenate(faces)), owner.astype(np.int32)


def _directions(
    mesh: Mesh, found: Sequence[Hole], total: Floats, usual: float, rims: _Rims
) -> Floats:
    """(h, 3) which way the surface looks that each hole lacks, where it is too narrow to say more.

    A border that encloses as much as a patch with a direction of its own, and one that faces one
    way on the whole (its patch's area ``total`` (h,) is less than twice what one sees of it at
    best), says so itself, however slender the hole; else the surface about it does.
    """
    area = np.array([h.area for h in found])
    flat = (area > (_SMALL * usual) ** 2) & (area > 0.5 * total)
    whole = -unit(np.stack([vector_area(mesh.vertices[h.loop]) for h in found]))
    return np.where(flat[:, None], whole, rims.mean)


def _spread(mesh: Mesh, found: Sequence[Hole], usual: float) -> tuple[Floats, Floats, Ints, Floats]:
    """Places (m, 3) on flat patches, the patches' normals (m, 3) there, whose they are (m,), and
    the patches' areas (h,)."""
    lids, owner = flat_lids(mesh, found)
    t = lids.triangles
    cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    total = np.asarray(np.bincount(owner, area, len(found)), dtype=np.float64)
    wanted = np.clip(np.ceil(4 * total / usual**2), 4, _SAMPLES).astype(np.int64)
    # Faces laid end to end, each hole of length `wanted`: a place at every half.
    share = area / np.maximum(total, 1e-30)[owner] * wanted[owner]
    ends = np.cumsum(share)
    at = np.arange(int(wanted.sum())) + 0.5
    face = np.minimum(np.searchsorted(ends, at), len(t) - 1)
    order = np.arange(1, len(at) + 1)
    plastic = 1.3247179572447460
    r1, r2 = np.sqrt((order / plastic) % 1.0), (order / plastic**2) % 1.0
    weights = np.stack([1.0 - r1, r1 * (1.0 - r2), r1 * r2], axis=-1)
    X = np.einsum("ni,nij->nj", weights, t[face])
    normal = cross / np.maximum(2 * area, 1e-30)[:, None]
    return X, normal[face], owner[face], total


@dataclass(frozen=True)
class _Rims:
    """The borders of a mesh, and how its surface goes on beyond them."""

    corners: Floats
    """(v, 3) the mesh's vertices."""
    normals: Floats
    """(v, 3) of the vertices."""
    outward: Floats
    """(v, 3) along the surface and away from it, at the borders."""
    loops: tuple[Ints, ...]
    """Corners of each hole, about `_RIM` of them."""
    mean: Floats
    """(h, 3) normal of the surface about each hole: a small patch's own is chance."""

    @staticmethod
    def of(mesh: Mesh, found: Sequence[Hole]) -> _Rims:
        normals = np.nan_to_num(vertex_normals(mesh))
        along = np.zeros_like(mesh.vertices)
        for h in found:
            corners = mesh.vertices[h.loop]
            along[h.loop] = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
        mean = np.stack([normals[h.loop].mean(axis=0) for h in found])
        loops = tuple(h.loop[:: max(1, len(h.loop) // _RIM)] for h in found)
        outward = unit(np.cross(along, normals))
        return _Rims(mesh.vertices, normals, outward, loops, unit(mean))

    def beside(self, X: Floats, n: Floats, hole: Ints) -> tuple[Floats, Ints]:
        """How far (m,) mm the surface would rise over places on a patch, and the nearest corners.

        A cap rises half as high as the tangent planes of its rim, here weighted by their inverse
        squared distance. Rims that turn down by more than 60° are edges and say nothing.
        """
        rise, rim = np.zeros(len(X)), np.zeros(len(X), dtype=np.int32)
        ends = np.searchsorted(hole, np.arange(len(self.loops) + 1))
        for loop, begin, end in zip(self.loops, ends[:-1], ends[1:], strict=True):
            way = self.corners[loop] - X[begin:end, None]
            tilt = n[begin:end] @ self.normals[loop].T
            near = 1.0 / np.maximum(np.einsum("mli,mli->ml", way, way), 1e-12)
            up = np.einsum("mli,li->ml", way, self.normals[loop]) / np.maximum(tilt, 0.5)
            rise[begin:end] = 0.5 * np.sum(near * up * (tilt > 0.5), axis=1) / near.sum(axis=1)
            rim[begin:end] = loop[near.argmax(axis=1)]
        return rise, rim
