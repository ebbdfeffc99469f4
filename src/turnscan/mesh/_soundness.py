"""Soundness: what a printer, a CAD program or a machine tool would stumble over in a mesh."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Longs, Singles
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._topology import opposite_half_edges, unpaired, vertex_fans
from turnscan.threads import in_parts

_THIN = 1e-9
"""A face has no area where its height is less than this share of its longest side."""
_LEAF = 8
"""Faces, about, in a leaf of the tree of boxes."""
_MANY = 20_000
"""Faces above which the search for crossings is done in parts, by several threads."""
_PARTS, _STARTS = 16, 256
_PAIRS = 16
"""Times the number of faces: the most pairs of faces that cut through each other to search for.
A heap of loose faces has millions, and nobody needs them all."""


def soundness(mesh: Mesh) -> list[Finding]:
    """What is not sound about a mesh, each kind with its number and the place of the first.

    Sides with more than two faces, or with two that wind against each other; vertices where
    parts merely touch; corners at equal places (in the 32-bit numbers of an STL), which other
    programs join; faces without area; faces that cut through each other. An empty list: manifold,
    oriented, without self-intersection; whether it is closed is `is_closed`'s to say.
    """
    if not len(mesh.faces):
        return []
    from turnscan.mesh import _soundness_kernels as kernels

    crossed = crossings(mesh)
    many, against = _side_places(mesh)
    without_area = np.flatnonzero(kernels.without_area(mesh.vertices, mesh.faces, _THIN))
    checks = (
        ("surface.side", "non-manifold edges (more than two faces)", many),
        ("surface.orientation", "edges whose two faces have opposite orientations",
         against),
        ("surface.touching", "non-manifold vertices",
         mesh.vertices[_touching(mesh)]),
        ("surface.equal", "duplicate vertices", _equal_places(mesh)),
        ("surface.degenerate", "degenerate faces (no area)", _middles(mesh, without_area)),
        ("surface.crossing", "pairs of intersecting faces"
         + (", or more" if len(crossed) == _PAIRS * len(mesh.faces) else ""),
         _middles(mesh, crossed[:, 0])),
    )  # fmt: skip
    return [_finding(code, text, places) for code, text, places in checks if len(places)]


def _middles(mesh: Mesh, which: Ints | npt.NDArray[np.intp]) -> Floats:
    middles: Floats = mesh.vertices[mesh.faces[which]].mean(axis=1)
    return middles


def _finding(code: str, text: str, places: Floats) -> Finding:
    x, y, z = places[0]
    where = f"({x:.2f}, {y:.2f}, {z:.2f}) mm"
    more = "" if len(places) == 1 else f", the first of {len(places)}"
    return Finding(code, "warning", f"{len(places)} {text}", where + more, "")


def crossings(mesh: Mesh, asked: Bools | None = None) -> Ints:
    """(k, 2) pairs of faces, lower number first, that cut through or overlap each other.

    Only pairs with a face ``asked`` (f,) for; None looks at all. Faces without area are left out.
    No more than 16 times as many pairs as faces are looked for.
    """
    from turnscan.mesh import _crossing_kernels as kernels
    from turnscan.mesh._tree_kernels import boxes, morton_order, spans

    if not len(mesh.faces) or (asked is not None and not asked.any()):
        return np.empty((0, 2), dtype=np.int32)
    plain = np.zeros(len(mesh.vertices), dtype=np.bool_)
    if asked is None:
        plain = kernels.plain_fans(mesh.vertices, mesh.faces, opposite_half_edges(mesh.faces))
        order: Ints = morton_order(mesh.vertices, mesh.faces).astype(np.int32)
        which = np.ones(len(order), dtype=np.bool_)
    else:
        near = kernels.around(mesh.vertices, mesh.faces, asked)
        order = near[morton_order(mesh.vertices, mesh.faces[near])].astype(np.int32)
        which = asked[order]
    vertices, faces, plain = kernels.as_they_come(mesh.vertices, mesh.faces[order], plain)
    leaves = 1 << max(0, int(np.ceil(np.log2(max(1, len(faces) / _LEAF)))))
    reach = spans(vertices, faces)
    nodes, wanted = boxes(reach, leaves), kernels.nodes_with(which, leaves)
    tree = kernels.Faces(vertices, faces, which, reach, nodes, wanted, plain)
    starts = kernels.beginnings(nodes, wanted, _STARTS)
    most, parts = _PAIRS * len(mesh.faces), _PARTS if len(faces) > _MANY else 1
    each = most if parts == 1 else most // 8
    found = in_parts(lambda a, b: kernels.crossings(tree, starts[a:b], each), len(starts), parts)
    if parts > 1 and any(len(pairs) == each for pairs in found):  # a heap: as many as may be
        found = [kernels.crossings(tree, starts, most)]
    pairs = np.concatenate([np.empty((0, 2), dtype=np.int32), *found])
    pairs = np.sort(order[pairs], axis=1)
    in_order: Ints = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    return in_order


def _side_places(mesh: Mesh) -> tuple[Floats, Floats]:
    """Middles of the sides with more than two faces, and of those with two that disagree."""
    a, b = unpaired(mesh.faces)
    size = len(mesh.vertices)
    key = np.minimum(a, b) * size + np.maximum(a, b)
    which, group, count = np.unique(key, return_inverse=True, return_counts=True)
    forward = np.bincount(group[a < b], minlength=len(which))
    middle = (mesh.vertices[which // size] + mesh.vertices[which % size]) / 2
    return middle[count > 2], middle[(count == 2) & (forward != 1)]


def _touching(mesh: Mesh) -> npt.NDArray[np.intp]:
    _, about = vertex_fans(mesh.faces)
    return np.flatnonzero(np.bincount(about, minlength=len(mesh.vertices)) > 1)


def _equal_places(mesh: Mesh) -> Floats:
    found: Floats = mesh.vertices[repeated(mesh.vertices.astype(np.float32), mesh.faces)]
    return found


def repeated(places: Singles, faces: Ints) -> Longs:
    """Numbers of the places (v, 3) of vertices that faces use and that are equal to one before."""
    from turnscan.mesh import _soundness_kernels as kernels

    used = np.zeros(len(places), dtype=np.bool_)
    used[faces.ravel()] = True
    found: Longs = kernels.again(places + np.float32(0), used)  # −0 becomes 0
    return found
