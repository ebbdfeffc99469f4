"""Faces that cut through each other: all pairs, found as an exhaustive search finds them."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean, closed, scanned
from turnscan.mesh import Mesh, crossings, join

PAGE = "0029-crossings-libraries.md"
COLUMNS = ["pairs", "missed", "wrong"]


def do_ours(given: Arrays) -> Arrays:
    return {"pairs": crossings(judge.mesh_of(given)).astype(np.int64)}


def do_open3d(given: Arrays) -> Arrays:
    import open3d

    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(given["vertices"]),
        open3d.utility.Vector3iVector(given["faces"]),
    )
    return {"pairs": np.asarray(mesh.get_self_intersecting_triangles(), dtype=np.int64)}


def do_libigl(given: Arrays) -> Arrays:
    """Boxes by rtree, the test of two triangles by libigl: what the libraries have, put together.

    Pairs that share a corner are left out: libigl's test calls all of them crossing.
    """
    return {"pairs": _by_parts(given["vertices"], given["faces"])}


def _by_parts(vertices: Any, faces: Any) -> Any:
    import igl
    from rtree import index

    t = vertices[faces]
    low, high = t.min(axis=1), t.max(axis=1)
    setting = index.Property(dimension=3)
    boxes = np.concatenate([low, high], axis=1)
    tree = index.Index(
        ((k, box, None) for k, box in enumerate(boxes)), properties=setting, interleaved=True
    )
    found = []
    for i, box in enumerate(boxes):
        for j in tree.intersection(box):
            if j > i and not set(faces[i]) & set(faces[j]):
                corners = [np.asfortranarray(c[None]) for c in (*t[i], *t[j])]
                if igl.tri_tri_intersection_test_3d(*corners)[0]:
                    found.append((i, j))
    return np.asarray(found, dtype=np.int64).reshape(-1, 2)


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Pairs without a common corner against those of the exhaustive search."""
    faces = given["faces"]
    pairs = np.sort(made["pairs"].reshape(-1, 2), axis=1)
    apart = ~(faces[pairs[:, 0]][:, :, None] == faces[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
    found = {tuple(p) for p in pairs[apart].tolist()}
    true = {tuple(p) for p in given["true_pairs"].tolist()}
    values = [str(len(pairs)), str(len(true - found)), str(len(found - true))]
    return dict(zip(COLUMNS, values, strict=True))


def exhaustive(mesh: Mesh) -> Any:
    """(k, 2) pairs without a common corner of which a side of one goes through the other.

    Every pair whose boxes meet, by sweep along z; sides against triangles by signed volumes in 64
    bits: another way than any contender's.
    """
    t, f = mesh.triangles, mesh.faces
    low, high = t.min(axis=1), t.max(axis=1)
    order = np.argsort(low[:, 2], kind="stable")
    found = []
    for at, i in enumerate(order):
        end = np.searchsorted(low[order, 2], high[i, 2], side="right")
        others = order[at + 1 : end]
        near = ((low[others] <= high[i]) & (high[others] >= low[i])).all(axis=1)
        others = others[near]
        others = others[~(f[others][:, :, None] == f[i][None, None, :]).any(axis=(1, 2))]
        if len(others):
            through = _pierced(t[i][None], t[others]) | _pierced(t[others], t[i][None])
            found += [(min(i, j), max(i, j)) for j in others[through]]
    return np.asarray(sorted(found), dtype=np.int64).reshape(-1, 2)


def _pierced(a: Any, b: Any) -> Any:
    """(n,) whether a side of triangles a goes through triangles b."""
    out = np.zeros(max(len(a), len(b)), dtype=bool)
    for k in range(3):
        p, q = a[:, k], a[:, (k + 1) % 3]
        ends = _volume(p, b[:, 0], b[:, 1], b[:, 2]) * _volume(q, b[:, 0], b[:, 1], b[:, 2]) < 0
        x, y, z = (_volume(p, q, b[:, i], b[:, (i + 1) % 3]) for i in range(3))
        out |= ends & (((x > 0) & (y > 0) & (z > 0)) | ((x < 0) & (y < 0) & (z < 0)))
    return out


def _volume(p: Any, q: Any, a: Any, b: Any) -> Any:
    return np.einsum("ni,ni->n", q - p, np.cross(a - p, b - p))


def measure(quick: bool = False) -> list[str]:
    """The lines of the tables."""
    contenders = [
        Contender("ours", do_ours),
        Contender("Open3D", do_open3d, "open3d-cpu", "MIT", "get_self_intersecting_triangles"),
        Contender("rtree and libigl", do_libigl, "rtree", "MIT, MPL-2.0", "put together here"),
    ]
    out = list[str]()
    for steps, lines in ((100, 120),) if quick else ((100, 120), (300, 320)):
        part = closed(scanned(clean(steps, lines)))
        part = Mesh(part.vertices, part.faces)
        other = Mesh(part.vertices * 0.7 + [18.0, 11.0, 13.0], part.faces)
        both = join([part, other])
        true = exhaustive(both)
        given = {"vertices": both.vertices, "faces": both.faces, "true_pairs": true}
        out += [f"Two parts in one mesh, {len(both.faces)} faces, {len(true)} crossing pairs:", ""]
        out += [*compare(contenders, given, figures, COLUMNS), ""]
        contenders = [contenders[0], contenders[2]] if len(both.faces) > 40_000 else contenders
    return out[:-1]
