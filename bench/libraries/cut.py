"""A plane through a closed part and through a torn scan: what is left, its lid, its vertices."""

from __future__ import annotations

import numpy as np

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean, closed, scanned, torn
from turnscan.mesh import Mesh, cut

PAGE = "0027-cut-libraries.md"
NORMAL = np.array([0.36, 0.48, 0.8])
OFFSET = 36.0
COLUMNS = [
    "faces", "volume off", "open sides", "beyond the plane, mm", "vertices kept",
    "crowded / crossing",
]  # fmt: skip


def _made(vertices: object, faces: object) -> Arrays:
    return {
        "vertices": np.asarray(vertices, dtype=np.float64),
        "faces": np.asarray(faces, np.int32),
    }


def do_ours(given: Arrays) -> Arrays:
    left = cut(judge.mesh_of(given), NORMAL, OFFSET)
    return _made(left.vertices, left.faces)


def do_trimesh(given: Arrays) -> Arrays:
    import trimesh

    mesh = trimesh.Trimesh(given["vertices"], given["faces"], process=False)
    left = trimesh.intersections.slice_mesh_plane(mesh, NORMAL, OFFSET * NORMAL, cap=True)
    return _made(left.vertices, left.faces)


def do_manifold(given: Arrays) -> Arrays:
    import manifold3d

    whole = manifold3d.Manifold(
        manifold3d.Mesh64(given["vertices"], given["faces"].astype(np.uint64))
    )
    if whole.status() != manifold3d.Error.NoError:
        raise ValueError(str(whole.status()))
    left = whole.trim_by_plane(tuple(NORMAL), OFFSET).to_mesh64()
    return _made(left.vert_properties[:, :3], left.tri_verts)


def do_open3d(given: Arrays) -> Arrays:
    import open3d

    mesh = open3d.t.geometry.TriangleMesh(
        open3d.core.Tensor(given["vertices"]), open3d.core.Tensor(given["faces"].astype(np.int64))
    )
    left = mesh.clip_plane(open3d.core.Tensor(OFFSET * NORMAL), open3d.core.Tensor(NORMAL))
    return _made(left.vertex.positions.numpy(), left.triangle.indices.numpy())


def do_vtk(given: Arrays) -> Arrays:
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(given["vertices"], given["faces"])
    left = mesh.clip_closed_surface(normal=NORMAL, origin=OFFSET * NORMAL).triangulate()
    return _made(left.points, left.regular_faces)


def do_vtk_open(given: Arrays) -> Arrays:
    """What VTK has for open surfaces: no lid."""
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(given["vertices"], given["faces"])
    left = mesh.clip(normal=NORMAL, origin=OFFSET * NORMAL, invert=False).triangulate()
    return _made(left.points, left.regular_faces)


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Volume (of the closed part), open sides, what lies beyond, and vertices that moved."""
    old, new = judge.mesh_of(given), judge.mesh_of(made)
    true = float(given["volume"])
    height = old.vertices @ NORMAL - OFFSET
    there = {p.tobytes() for p in new.vertices.astype(np.float32)}
    above = np.unique(old.faces)
    above = above[height[above] > 1e-3]
    stay = sum(p.tobytes() in there for p in old.vertices[above].astype(np.float32)) / len(above)
    found = [
        str(len(new.faces)), "" if np.isnan(true) else f"{abs(new.volume / true - 1):.1e}",
        str(len(judge.open_edges(new))),
        f"{max(0.0, float((OFFSET - new.vertices[np.unique(new.faces)] @ NORMAL).max())):.1e}",
        f"{stay:.2%}", judge.faults(new),
    ]  # fmt: skip
    return dict(zip(COLUMNS, found, strict=True))


def _volume_above(mesh: Mesh) -> float:
    """mm³ of a closed mesh above the plane: every face clipped by itself, apexes on the plane.

    The divergence theorem with the origin in the plane: the lid adds nothing, so none is needed.
    """
    t = mesh.triangles - OFFSET * NORMAL
    h = t @ NORMAL
    total = float(
        np.einsum("fi,fi->", t[:, 0], np.cross(t[:, 1], t[:, 2]) * (h > 0).all(1)[:, None])
    )
    crossed = (h > 0).any(1) & (h <= 0).any(1)
    for corners, heights in zip(t[crossed], h[crossed], strict=True):
        ring = []
        for k in range(3):
            a, b = corners[k], corners[(k + 1) % 3]
            ha, hb = heights[k], heights[(k + 1) % 3]
            if ha > 0:
                ring.append(a)
            if (ha > 0) != (hb > 0):
                ring.append(a + (b - a) * (ha / (ha - hb)))
        for k in range(1, len(ring) - 1):
            total += float(ring[0] @ np.cross(ring[k], ring[k + 1]))
    return total / 6.0


def measure(quick: bool = False) -> list[str]:
    """The lines of both tables."""
    side = scanned(clean(*(200, 250) if quick else (450, 446)))
    whole, open_ = closed(side), torn(side, 12 if quick else 33)
    volume = np.float64(_volume_above(whole))
    given = {"vertices": whole.vertices, "faces": whole.faces, "volume": volume}
    every = [
        Contender("ours", do_ours),
        Contender("trimesh", do_trimesh, "trimesh", "MIT", "slice_mesh_plane, cap"),
        Contender("Manifold", do_manifold, "manifold3d", "Apache-2.0", "trim_by_plane"),
        Contender("VTK", do_vtk, "pyvista", "BSD-3, MIT", "clip_closed_surface"),
        Contender("Open3D", do_open3d, "open3d-cpu", "MIT", "clip_plane, no lid"),
    ]
    out = [f"Closed, {len(whole.faces)} faces:", "", *compare(every, given, figures, COLUMNS)]
    given = {"vertices": open_.vertices, "faces": open_.faces, "volume": np.float64("nan")}
    every[3] = Contender("VTK", do_vtk_open, "pyvista", "BSD-3, MIT", "clip, no lid")
    sides = len(judge.open_edges(open_))
    out += ["", f"A torn scan, {len(open_.faces)} faces, {sides} open sides:", ""]
    return out + compare(every, given, figures, COLUMNS)
