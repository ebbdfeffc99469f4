"""A mesh in charts: pieces that one surface can be laid under, analytic or a B-spline."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.mesh import Mesh, measured_vertices, opposite_half_edges, smoothed_normals
from turnscan.shapes.patches._fit import Sample, fitted_patch
from turnscan.shapes.patches._patch import Patch
from turnscan.shapes.patches._surfaces import ShapePatch, SplinePatch, patch_of_shape
from turnscan.shapes.patches._swept_surfaces import (
    ExtrudedPatch,
    SweptPatch,
    TurnedPatch,
    extruded_patch,
    turned_patch,
)
from turnscan.shapes.primitives import ShapeSet
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives._ground import LIMIT
from turnscan.shapes.swept import Swept

_FEW = 40
"""Faces: smaller pieces go to a neighbour, and charts are not cut into smaller ones."""
_WIDE, _PARTS = 4.0, 20
"""Usual sides of faces from which one is wide, and in how many parts at most its sides are seen."""
_FILLING = 100
"""Faces that a filling must have to be charts of its own; smaller ones belong to what is around."""
_NEAR = 4.0
"""Of the tolerance: so near to a shape a small piece within it goes to it."""
_SPREAD = 8
"""Rings beside a shape, or a swept piece, that are looked at: whether they lie on it, too."""
_OPEN = float(np.cos(np.deg2rad(55.0)))
"""Cosine of how far normals may lean from the middle one of a chart, nearly all of them."""
_NEARLY, _TIP = 0.99, 2.0
"""Share of its vertices that a surface must be within the limit of; and the limits that a vertex
and those about it may stand off it on average, however few they are: the tip of a nose, a lip."""
_ABOUT = 3
"""Neighbours that tell so, at least."""
_SWEPT = 0.5
"""Share of the measured vertices of a freeform chart that may belong to one swept piece, at least,
for its profile to be tried."""
_BEYOND = 2
"""Rings of faces round a chart that its spline is fitted to as well, so neighbours meet."""
_CREASE = float(np.cos(np.deg2rad(20.0)))
"""Cosine between faces that share a side, from which on the surface may be creased there."""
_PASSES = 4
_TRIMS, _REACH, _MOSTLY = 4, 1.2, 0.7
"""How often faces about wrong places of its border are taken from a shape, how far away they are at
first in sides of the mesh, twice as far each time; and the share of its faces that must be left."""


@dataclass(frozen=True, eq=False)
class Charts:
    """A mesh in pieces, each with the surface under it."""

    label: Ints
    """(f,) the chart of each face."""
    patches: tuple[Patch | None, ...]
    """None where no surface is within the tolerance, and where no face is left in a chart."""
    tolerance: float
    """mm, median."""
    facets: frozenset[int] = frozenset()
    """Charts of one face of the mesh, which is its own surface."""

    def distances(self, mesh: Mesh) -> tuple[Floats, Ints, Longs]:
        """(n,) mm that measured vertices lie outside the surface of a face about them, (n,) the
        chart of that face, and (n,) which vertices these are: those without a surface are not."""
        near = np.full(len(mesh.vertices), -1, dtype=np.int32)
        have = np.array([p is not None for p in self.patches])[self.label]
        near[mesh.faces[have]] = self.label[have, None]
        some = np.flatnonzero(measured_vertices(mesh) & (near >= 0)).astype(np.int64)
        off = np.zeros(len(some))
        for k in np.unique(near[some]):
            patch, own = self.patches[k], near[some] == k
            assert patch is not None
            off[own] = patch.offsets(mesh.vertices[some[own]])[0]
        return off, near[some], some


class Charting:
    """Cuts a mesh in charts: shapes where vertices lie on them, swept pieces, else B-splines."""

    def __init__(self, mesh: Mesh, found: ShapeSet, swept: Sequence[Swept] = ()) -> None:
        self.mesh, self.found, self.swept = mesh, found, swept
        self.sweep = _with_rims(mesh, found.label < 0, swept)
        """(v,) the swept piece that each vertex may belong to."""
        twin = opposite_half_edges(mesh.faces).reshape(-1, 3)
        self.beside = np.where(twin >= 0, twin // 3, -1)
        normal = smoothed_normals(mesh)
        self.normal = normal[mesh.faces].sum(axis=1)
        size = np.linalg.norm(self.normal, axis=1, keepdims=True)
        self.normal /= np.maximum(size, 1e-300)
        self.vertex_normal = normal
        self.start, self.near = region.neighbours(mesh.faces, len(mesh.vertices))
        self.middle = mesh.triangles.mean(axis=1)
        self.known = measured_vertices(mesh)
        t = mesh.triangles
        self.side = float(np.median(np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2)))
        """mm: of the faces, usually."""
        usual = found.tolerance / LIMIT
        sigma = np.full(len(mesh.vertices), usual)
        if mesh.provenance is not None:
            told = mesh.provenance.sigma
            sigma = np.where(np.isfinite(told) & (told > 0), told, usual)
        self.sigma = sigma
        self.limit = np.maximum(found.tolerance, 3 * sigma)
        self.trimmed = dict[int, int]()
        """How often a shape, by its identity, has lost faces at its border."""
        self.unswept = np.zeros(len(mesh.faces), dtype=np.bool_)
        """(f,) Faces under which a swept surface made no sound face."""

    def charts(self) -> Charts:
        """The charts of the mesh.

        A freeform piece is cut in two, between the faces furthest apart along it, until a height
        over its middle plane fits 99 % of its measured vertices within the tolerance of the shapes,
        or three of their standard deviations.
        """
        kind = self._kinds()
        self.piece = self._pieces(kind)
        label = np.full(len(self.piece), -1, dtype=np.int32)
        patches = list[Patch | None]()
        for p in range(int(self.piece.max()) + 1):
            whole = np.flatnonzero(self.piece == p).astype(np.int32)
            shape = int(np.bincount(np.maximum(kind[whole], -1) + 1).argmax()) - 1
            for faces, patch in self._cut([whole], shape):
                label[faces] = len(patches)
                patches.append(patch)
        return Charts(label, tuple(patches), self.found.tolerance)

    def finer(
        self, charts: Charts, bad: Iterable[int], places: Mapping[int, Floats] | None = None
    ) -> Charts:
        """The charts, those that failed cut again; all others keep their number.

        A shape loses the faces about the ``places`` (n, 3) mm of its chart where its border is
        wrong. Where that does not help, and for a swept surface, a B-spline takes its place, two
        charts that of a B-spline, and where a chart is too small for that, or has no surface, its
        faces themselves do.
        """
        label, patches, facets = charts.label.copy(), list(charts.patches), set(charts.facets)
        for c in bad:
            faces = np.flatnonzero(charts.label == c).astype(np.int32)
            was, patches[c] = patches[c], None
            parts: list[Ints] = []
            kept = self._kept(was, faces, (places or {}).get(c))
            for some in kept:
                label[some] = len(patches)
                patches.append(was)
            if kept:
                faces = np.setdiff1d(faces, np.concatenate(kept))
            elif isinstance(was, ShapePatch | ExtrudedPatch | TurnedPatch):
                parts = [faces]
                self.unswept[faces] |= not isinstance(was, ShapePatch)
            elif was is not None and len(faces) > 2 * _FEW:
                parts = self._halves(faces)
            left = np.zeros(len(label), dtype=np.bool_)
            left[faces] = True
            for some, patch in self._cut(parts, -1):
                if patch is not None:
                    label[some] = len(patches)
                    left[some] = False
                    patches.append(patch)
            alone = np.flatnonzero(left)
            label[alone] = len(patches) + np.arange(len(alone))
            facets.update(range(len(patches), len(patches) + len(alone)))
            patches += [None] * len(alone)
        return Charts(label, tuple(patches), charts.tolerance, frozenset(facets))

    def _kept(self, was: Patch | None, faces: Ints, places: Floats | None) -> list[Ints]:
        """The pieces of a shape's faces that are away from some places, further each time; none
        where that leaves little of them, or has been done often."""
        if not isinstance(was, ShapePatch) or places is None or not len(places):
            return []
        from scipy.spatial import cKDTree

        times = self.trimmed.get(id(was), 0)
        self.trimmed[id(was)] = times + 1
        t = self.mesh.triangles[faces]
        reach = _REACH * 2**times * float(np.median(np.linalg.norm(t[:, 0] - t[:, 1], axis=1)))
        away = np.asarray(cKDTree(places).query(t.reshape(-1, 3))[0]).reshape(-1, 3).min(axis=1)
        rest = faces[away > reach]
        if times >= _TRIMS or len(rest) < _MOSTLY * len(faces) or len(rest) == len(faces):
            return []
        kind = np.full(len(self.beside), -1, dtype=np.int32)
        kind[rest] = 0
        number = self._joined_in(rest, kind)
        pieces = [rest[number == k] for k in range(int(number.max()) + 1)]
        return [piece for piece in pieces if len(piece) >= _FEW]

    def first_of(self, charts: Charts, bad: frozenset[int]) -> frozenset[int]:
        """Of charts that failed those that are to be cut first.

        What is wrong between two charts is wrong with both. A shape stays while a chart beside it
        fails that is no shape, or a smaller one: the other may be what does not fit.
        """
        if len(bad) < 2:
            return bad
        size = np.bincount(charts.label, minlength=len(charts.patches))
        rank = [isinstance(p, ShapePatch) * int(size[k]) for k, p in enumerate(charts.patches)]
        of, beside = charts.label[:, None], charts.label[self.beside]
        both = np.isin(of, list(bad)) & np.isin(beside, list(bad)) & (self.beside >= 0)
        pairs = np.unique(np.stack([np.broadcast_to(of, both.shape)[both], beside[both]]), axis=1)
        return bad - {a for a, b in pairs.T.tolist() if rank[a] > rank[b]}

    def _cut(self, waiting: Sequence[Ints], shape: int) -> Iterator[tuple[Ints, Patch | None]]:
        """Connected pieces, cut until there is a surface under each, or none that is too small."""
        rest = list(waiting)
        while rest:
            faces = rest.pop()
            patch = self._patch(faces, shape, self.piece)
            if patch is None and len(faces) > 2 * _FEW:
                rest += self._halves(faces)
            else:
                yield faces, patch

    def _kinds(self) -> Ints:
        """(f,) the shape of each face; −1 for freeform, −2 in a filling of its own."""
        corner = self.found.label[self.mesh.faces]
        alike = (corner[:, 0] == corner[:, 1]) & (corner[:, 0] == corner[:, 2])
        kind: Ints = np.where(alike, corner[:, 0], np.int32(-1)).astype(np.int32)
        added = ~self.known[self.mesh.faces].all(axis=1)
        if self.mesh.measured is not None:
            added |= ~self.mesh.measured
        filling = self._joined(np.asarray(added, dtype=np.int32))
        large = np.bincount(filling)[filling] >= _FILLING
        kind[added & large] = -2
        self.far = far = np.full((len(self.found.shapes), len(self.mesh.vertices)), np.inf)
        for k, s in enumerate(self.found.shapes):
            far[k] = np.abs(s.distances(self.mesh.vertices))
        for _ in range(_SPREAD if len(far) else 0):
            near = np.where(self.beside >= 0, kind[self.beside], -1).max(axis=1)
            free = np.flatnonzero((kind == -1) & (near >= 0))
            off = far[near[free, None], self.mesh.faces[free]]
            on = (off <= 2 * self.limit[self.mesh.faces[free]]).all(axis=1)
            kind[free[on]] = near[free[on]]
        return kind

    def _pieces(self, kind: Ints) -> Ints:
        """(f,) number of the connected piece of one kind, small ones added to a freeform one."""
        piece = self._joined(kind)
        for _ in range(_PASSES):
            size = np.bincount(piece)
            face, side = np.nonzero((size[piece] < _FEW)[:, None] & (self.beside >= 0))
            other = piece[self.beside[face, side]]
            there = kind[self.beside[face, side]]
            differs = (other != piece[face]) & self._takes(piece, piece[face], there)
            if not differs.any():
                break
            pair, many = np.unique(
                np.stack([piece[face][differs], other[differs]], axis=1), axis=0, return_counts=True
            )
            order = np.lexsort((many, size[pair[:, 1]] >= _FEW, pair[:, 0]))
            goes = np.arange(len(size))
            goes[pair[order, 0]] = pair[order, 1]
            # Two small ones that would change places: the one with the lower number stays.
            back = (goes[goes] == np.arange(len(goes))) & (np.arange(len(goes)) < goes)
            goes[back] = np.flatnonzero(back)
            kind_of = np.zeros(len(size), np.int32)
            kind_of[piece] = kind
            kind[:] = kind_of[goes[piece]]
            piece = np.unique(goes[piece], return_inverse=True)[1].reshape(-1).astype(np.int32)
        return piece

    def _takes(self, piece: Ints, small: Ints, kind: Ints) -> Bools:
        """(n,) whether small pieces may go to a piece of a kind: freeform, or a shape near them."""
        out = kind == -1
        for p, k in np.unique(np.stack([small, kind], axis=1)[kind >= 0], axis=0):
            corners = self.mesh.faces[piece == p]
            if (self.far[k, corners] <= _NEAR * self.limit[corners]).all():
                out |= (small == p) & (kind == k)
        return np.asarray(out)

    def _joined(self, kind: Ints) -> Ints:
        """(f,) number of the piece of faces of one kind that share sides."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        face, side = np.nonzero(self.beside >= 0)
        other = self.beside[face, side]
        same = kind[face] == kind[other]
        ones = np.ones(int(same.sum()), dtype=np.int8)
        link = coo_array((ones, (face[same], other[same])), shape=(len(kind), len(kind)))
        number: Ints = connected_components(link, directed=False)[1].astype(np.int32)
        return number

    def _patch(self, faces: Ints, shape: int, piece: Ints) -> Patch | None:
        """The surface under a chart; None where it has to be cut, or has none."""
        corners = np.unique(self.mesh.faces[faces])
        if shape >= 0 and self.found.shapes[shape].kind == "plane":
            return patch_of_shape(self.found.shapes[shape], self.mesh.vertices[corners])
        up = self.normal[faces].sum(axis=0)
        length = float(np.linalg.norm(up))
        if length == 0:
            return None
        up = up / length
        lean = self.normal[faces] @ up
        if float(np.quantile(lean, 1 - _NEARLY)) < _OPEN:
            return None
        if shape >= 0:
            return patch_of_shape(self.found.shapes[shape], self.mesh.vertices[corners])
        return self._freeform(faces, up, corners, piece)

    def _freeform(
        self, faces: Ints, up: Floats, corners: Ints, piece: Ints
    ) -> SweptPatch | SplinePatch | None:
        wide = np.unique(self.mesh.faces[self._around(faces, piece)])
        within = np.isin(wide, corners)
        known = self.known[wide]
        inside, normal = self._inside_wide_faces(faces)
        more = len(inside)
        sample = Sample(
            np.concatenate([self.mesh.vertices[wide], inside]),
            np.concatenate([self.vertex_normal[wide], normal]),
            np.r_[self.sigma[wide], np.full(more, self.found.tolerance / LIMIT)],
            np.r_[known, np.zeros(more, dtype=np.bool_)],
            np.r_[within, np.ones(more, dtype=np.bool_)],
        )
        asked = within & known if (within & known).any() else within

        def fits(off: Floats) -> bool:
            own, between = np.abs(off[: len(wide)][asked]), np.abs(off[len(wide) :])
            if more and float((between <= self.found.tolerance).mean()) < _NEARLY:
                return False
            if float((own <= self.limit[wide[asked]]).mean()) < _NEARLY:
                return False
            return not self._off_together(wide[asked], off[: len(wide)][asked])

        one = self._sweep_of(corners)
        if one is not None and not self.unswept[faces].any():
            swept = (
                extruded_patch(sample, one.axis, up)
                if one.kind == "extrusion"
                else turned_patch(sample, one.point, one.axis)
            )
            if swept is not None and fits(swept.offsets(sample.points)[0]):
                return swept
        patch, off = fitted_patch(sample, up)
        return patch if fits(off) else None

    def _off_together(self, vertices: Ints, off: Floats) -> bool:
        """Whether one of some vertices and its neighbours among them stand far off a surface, by
        ``off`` (n,) mm, on average: noise does not."""
        share = np.full(len(self.mesh.vertices), np.nan)
        share[vertices] = off / self.limit[vertices]
        far = vertices[np.abs(share[vertices]) > _TIP]
        for k in far.tolist():
            about = share[self.near[self.start[k] : self.start[k + 1]]]
            about = about[np.isfinite(about)]
            if len(about) >= _ABOUT and abs(float(about.mean())) > _TIP:
                return True
        return False

    def _inside_wide_faces(self, faces: Ints) -> tuple[Floats, Floats]:
        """(n, 3) mm within those of some faces that are far wider than usual, such as of a lid, and
        the unit normals (n, 3) there: a spline that knows their corners alone bulges between."""
        t = self.mesh.triangles[faces]
        longest = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
        points, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
        for k in np.flatnonzero(longest > _WIDE * self.side):
            parts = min(int(np.ceil(longest[k] / (_WIDE * self.side))), _PARTS)
            i, j = np.divmod(np.arange((parts + 1) ** 2), parts + 1)
            a, b = i[i + j <= parts] / parts, j[i + j <= parts] / parts
            points.append(np.column_stack([a, b, 1 - a - b]) @ t[k])
            twice = np.cross(t[k, 1] - t[k, 0], t[k, 2] - t[k, 0])
            normals.append(np.broadcast_to(twice / max(np.linalg.norm(twice), 1e-300), (len(a), 3)))
        return np.concatenate(points), np.concatenate(normals)

    def _sweep_of(self, corners: Ints) -> Swept | None:
        """The swept piece that most measured vertices of a chart are of."""
        of = self.sweep[corners[self.known[corners]]]
        if not (of >= 0).any():
            return None
        most = int(np.bincount(of[of >= 0]).argmax())
        return self.swept[most] if float((of == most).mean()) >= _SWEPT else None

    def _around(self, faces: Ints, piece: Ints) -> Ints:
        """The faces of a chart and the rings beyond, up to a crease or the end of its piece."""
        inside = np.zeros(len(piece), dtype=np.bool_)
        inside[faces] = True
        rim = faces
        for _ in range(_BEYOND):
            near = self.beside[rim]
            face, side = np.nonzero((near >= 0) & ~inside[near])
            other = near[face, side]
            bend = np.einsum("ij,ij->i", self.normal[rim[face]], self.normal[other])
            rim = np.unique(other[(bend > _CREASE) & (piece[other] == piece[rim[face]])])
            inside[rim] = True
        return np.flatnonzero(inside).astype(np.int32)

    def _halves(self, faces: Ints) -> list[Ints]:
        """A connected piece in two or more, about as long as wide, parted where it turns."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        n = len(faces)
        place = np.full(len(self.beside), -1, dtype=np.int32)
        place[faces] = np.arange(n)
        near = np.where(self.beside[faces] >= 0, place[self.beside[faces]], -1)
        a, side = np.nonzero(near >= 0)
        b = near[a, side]
        x, m = self.middle[faces], self.normal[faces]
        bend = np.arccos(np.clip(np.einsum("ij,ij->i", m[a], m[b]), -1, 1))
        width = float(np.linalg.norm(np.ptp(x, axis=0))) / 2
        far = np.linalg.norm(x[a] - x[b], axis=1) + width * bend + 1e-9
        graph = csr_array((far, (a, b)), shape=(n, n))

        def furthest(start: int) -> int:
            away = dijkstra(graph, indices=[start])[0]
            return int(np.argmax(np.where(np.isfinite(away), away, -1.0)))

        first = furthest(0)
        ends = [first, furthest(first)]
        _, _, source = dijkstra(graph, indices=ends, min_only=True, return_predecessors=True)
        half = (source == ends[1]).astype(np.int8)
        for smooth in (True, False):
            kind = np.full(len(self.beside), -1, dtype=np.int32)
            kind[faces] = _evened(half, near) if smooth else half
            pieces = self._apart(faces, kind) if smooth else [faces[half == 0], faces[half == 1]]
            if len(pieces) > 1:
                break
        return pieces

    def _apart(self, faces: Ints, kind: Ints) -> list[Ints]:
        """The connected pieces of both halves; small ones go to the half about them."""
        for _ in range(2):
            number = self._joined_in(faces, kind)
            small = np.bincount(number)[number] < _FEW
            kind[faces[small]] = 1 - kind[faces[small]]
        number = self._joined_in(faces, kind)
        return [faces[number == k] for k in range(int(number.max()) + 1)]

    def _joined_in(self, faces: Ints, kind: Ints) -> Ints:
        """(n,) number of the piece of one kind for some faces."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        place = np.full(len(kind), -1, dtype=np.int32)
        place[faces] = np.arange(len(faces))
        near = np.where(self.beside[faces] >= 0, place[self.beside[faces]], -1)
        a, side = np.nonzero(near >= 0)
        b = near[a, side]
        same = kind[faces[a]] == kind[faces[b]]
        link = coo_array(
            (np.ones(int(same.sum()), np.int8), (a[same], b[same])), shape=(len(faces), len(faces))
        )
        number: Ints = connected_components(link, directed=False)[1].astype(np.int32)
        return number


def _with_rims(mesh: Mesh, free: Bools, swept: Sequence[Swept]) -> Longs:
    """(v,) the swept piece of a vertex, or of those near it, if no shape has it; −1 for none."""
    out = np.full(len(mesh.vertices), -1, dtype=np.int64)
    for k, one in enumerate(swept):
        out[one.vertices] = k
    if not len(swept):
        return out
    start, near = region.neighbours(mesh.faces, len(mesh.vertices))
    return region.spread(out, free, start, near, _SPREAD)[0]


def _evened(half: Ints, near: Ints) -> Ints:
    """Halves with a straighter border: each face goes with most of its neighbours."""
    there: Bools = near >= 0
    for _ in range(_PASSES):
        side = np.where(there, 2 * half[near] - 1, 0).sum(axis=1)
        new = np.where(side > 0, 1, np.where(side < 0, 0, half)).astype(half.dtype)
        alone = there.sum(axis=1) < 2
        half = np.where(alone, half, new)
    return half
