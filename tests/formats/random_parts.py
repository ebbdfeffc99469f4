"""Random parts for the formats: unions and differences of solids, shells, touching and grazing."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold

from turnscan.errors import TurnscanError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, cut, cut_touching, join, soundness, submesh
from turnscan.surface.clean import drop_islands, settled
from turnscan.surface.decimation import decimate
from turnscan.surface.holes import ClosingOptions, close

VERBS = ("close", "decimate", "cut", "join")


def solid(rng: np.random.Generator) -> Manifold:
    """A ball, box, cylinder or torus somewhere; sizes and places are often whole, so that parts
    touch in points, lines and faces, and graze."""
    size = rng.uniform(4, 15, 3)
    place = rng.uniform(-12, 12, 3)
    if rng.random() < 0.5:
        size, place = np.rint(size), np.rint(place)
    around = int(rng.integers(8, 28))
    kind = rng.integers(4)
    if kind == 0:
        made = Manifold.sphere(size[0], around)
    elif kind == 1:
        made = Manifold.cube(tuple(size), True)
    elif kind == 2:
        made = Manifold.cylinder(size[0], size[1] / 2, size[1] / 2, around)
    else:
        ring = CrossSection.circle(min(size[0], size[1]) / 3, 10).translate((size[0], 0.0))
        made = Manifold.revolve(ring, around)
    if rng.random() < 0.5:
        made = made.rotate(tuple(rng.uniform(0, 360, 3)))
    return made.translate(tuple(place))


def part(rng: np.random.Generator) -> Mesh:
    """Two to four solids added and subtracted; at times a shell with a piece broken out, or two
    parts side by side that share a place. Where nothing is left, a ball."""
    made = solid(rng)
    for _ in range(int(rng.integers(1, 4))):
        other = solid(rng)
        made = made + other if rng.random() < 0.6 else made - other
    if made.is_empty():
        made = Manifold.sphere(9.0, 16)
    if rng.random() < 0.5:
        made = made.refine_to_length(3.0)
    mesh = _mesh(made)
    if rng.random() < 0.3:
        # Beside itself, touching where it is widest.
        wide = float(np.ptp(mesh.vertices[:, 0]))
        mesh = join([mesh, Mesh(mesh.vertices + (wide, 0, 0), mesh.faces)])
    if rng.random() < 0.5:
        away = np.linalg.norm(mesh.triangles.mean(axis=1) - rng.choice(mesh.vertices), axis=1)
        keep = away > rng.uniform(2, 8)
        if keep.any():
            mesh = submesh(mesh, keep)
    return Mesh(mesh.vertices * rng.choice([1.0, 1.0, 12.0]), mesh.faces)


def _mesh(made: Manifold) -> Mesh:
    m = made.to_mesh64()
    faces = np.asarray(m.tri_verts, dtype=np.int32)
    # Vertices that differ in properties alone are one place.
    points = np.asarray(m.vert_properties, dtype=np.float64)[:, :3]
    return Mesh(points, faces)


def worked(mesh: Mesh, verbs: list[str], rng: np.random.Generator) -> Mesh:
    """What the verbs make of a part, as `turnscan.meshing.to_mesh` ends."""
    for verb in verbs:
        try:
            if verb == "close":
                floor = float(mesh.vertices[:, 2].min()) - 1 if rng.random() < 0.5 else None
                mesh, _ = close(mesh, ClosingOptions(floor=floor))
            elif verb == "decimate":
                mesh = decimate(mesh, tolerance=float(rng.choice([0.01, 0.2, 2.0])))
            elif verb == "cut":
                at = float(np.quantile(mesh.vertices[:, 2], rng.uniform(0.2, 0.8)))
                at = np.rint(at) if rng.random() < 0.5 else at
                left = cut(mesh, rng.choice([[0, 0, 1], [0.1, 0.3, -1.0]]), at)
                mesh = left if len(left.faces) else mesh
            else:
                away = rng.choice([[0.0, 0.0, 0.0], [5.0, 0.0, 1.0], [1e-7, 0.0, 0.0]])
                mesh = join([mesh, Mesh(mesh.vertices[::1] + away, mesh.faces)])
        except TurnscanError:  # a refusal in words is no crash
            continue
    mesh, _ = cut_touching(mesh)
    mesh, _, _ = drop_islands(mesh)
    return settled(mesh)


def said(found: list[Finding]) -> set[str]:
    """The kinds of findings, each with a place and a number."""
    for f in found:
        assert f.message[0].isdigit() or f.code == "surface.open", f
        assert "mm" in f.where or f.code == "surface.open", f
    return {f.code for f in found}


__all__ = ["VERBS", "part", "said", "soundness", "worked"]
