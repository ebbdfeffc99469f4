"""Why a simulated scan has the holes it has: from the part's own triangles, lamp and lens.

Nothing of the reconstruction is asked but where its mesh ends. The part's surface is cut into small
triangles; those that the mesh does not cover are asked, at each table angle that carries them
through a laser's sheet, whether the light reaches them and whether the camera sees them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from turnscan import points, shapes
from turnscan.arrays import Bools, Floats, Ints
from turnscan.rig import rotation_z
from turnscan.simulate import Bench
from turnscan.simulate._scene import PATTERNS, triangles
from turnscan.simulate._solids import bisected
from turnscan.surface import Caster, Hole, Mesh

COVERED = 0.3
"""mm: a triangle no further than this from the mesh was measured."""
FINE = 1.0
"""mm: longest side of the triangles that are asked."""
GRAZING = (float(np.cos(np.deg2rad(76.0))), float(np.cos(np.deg2rad(84.0))))
"""A surface lit or seen further from face-on counts as hidden. Where it makes a difference which of
the two limits is taken, the cause is not known."""
SURE = 2 / 3
"""Share of a hole's area that must have one cause for the cause to be known."""
FAINT = 0.01
"""Share of the grey scale below which no stripe is seen."""

CLIPPED = 1.5
"""Share of the grey scale from which a stripe is clipped in more than its very middle."""

LABELS = ("measurable", "dark", "saturated", "laser", "camera", "hidden", "outside")
MEASURABLE, DARK, SATURATED, LASER, CAMERA, HIDDEN, OUTSIDE = range(len(LABELS))
RIGHT: Mapping[str, tuple[str, ...]] = {
    "measurable": ("removed",),
    "dark": ("dark",),
    "saturated": ("saturated",),
    "laser": ("laser",),
    "camera": ("camera",),
    # Neither ever reaches it: both names are true.
    "hidden": ("laser", "camera"),
    "outside": ("outside",),
}
"""For each true cause, what the reconstruction may call it."""


@dataclass(frozen=True)
class Patches:
    """Small triangles of the part's true surface."""

    corners: Ints
    """(f, 3) numbers of vertices, by which triangles hang together."""
    middle: Floats
    """(f, 3) mm, object's frame."""
    normal: Floats
    """(f, 3)."""
    area: Floats
    """(f,) mm²."""

    def some(self, which: Ints) -> Patches:
        """Those alone."""
        return Patches(
            self.corners[which], self.middle[which], self.normal[which], self.area[which]
        )


def made_mesh(made: Bench, longest: float | None = None) -> Mesh:
    """The first body's triangles where it stands on the table, none longer than asked."""
    body = made.scene.bodies[0]
    mesh = body.part.mesh if longest is None else bisected(body.part.mesh, longest)
    return Mesh(body.T_table_part.apply(mesh.vertices), mesh.faces)


def patches(made: Bench) -> Patches:
    """The first body's surface, cut small."""
    body, mesh = made.scene.bodies[0], made_mesh(made, FINE)
    t = mesh.triangles
    cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    double = np.linalg.norm(cross, axis=1)
    good = double > 1e-9
    if body.part.distance is not None:
        # Parts made of several bodies have faces inside one another.
        off = (t.mean(axis=1) - body.T_table_part.translation) @ body.T_table_part.rotation
        n = cross / np.maximum(double, 1e-30)[:, None] @ body.T_table_part.rotation
        good &= body.part.distance(off + 0.05 * n) > 0.0
    return Patches(
        mesh.faces[good], t.mean(axis=1)[good], cross[good] / double[good, None], double[good] / 2
    )


def labels(made: Bench, some: Patches, steps: int, grazing: float, peak: float = 0.45) -> Ints:
    """(f,) for each patch what hinders it, index into `LABELS`, in a turn of ``steps``.

    ``peak`` is the share of the grey scale that the stripe reaches on plain grey, face-on.
    """
    whole = triangles(made.scene.bodies)
    caster = Caster(whole.vertices, whole.faces)
    T = made.rig.T_camera_table
    size = (made.rig.camera.width - 0.5, made.rig.camera.height - 0.5)
    both, seen, lit, bright, clipped, out = np.zeros((6, len(some.middle)), dtype=np.bool_)
    for beam in made.beams:
        within = points.working_volume(made.rig, beam.name).contains(some.middle)
        for at, angle in crossings(made, beam.name, some.middle, steps):
            X, n = some.middle[at], some.normal[at]
            turn = rotation_z(-angle)
            camera = T.apply(np.einsum("mji,mj->mi", turn, X))
            uv = made.rig.camera.project(camera)
            with np.errstate(invalid="ignore"):
                inside = ((uv > -0.5) & (uv < size)).all(axis=1) & within[at]
            apex = turn @ T.inverse().apply(beam.apex)
            s = inside & _reached(caster, X, n, turn @ T.inverse().translation, grazing)
            b = inside & _in_fan(made, beam.name, camera) & _reached(caster, X, n, apex, grazing)
            light = peak * _cosine(X, n, apex) * _albedo(made, X) / 0.6
            for hit, what in (
                (s, seen), (b, lit), (s & b, both), (s & b & (light > FAINT), bright),
                (s & b & (light > CLIPPED), clipped), (~inside, out),
            ):  # fmt: skip
                what[at[hit]] = True
    label = np.full(len(some.middle), HIDDEN, dtype=np.int32)
    for what, name in (
        (out & ~seen & ~lit, OUTSIDE), (lit, CAMERA), (seen, LASER), (both, DARK),
        (bright, MEASURABLE), (clipped, SATURATED),
    ):  # fmt: skip
        label[what] = name
    # What lies below the working volume is not looked for, whatever is seen of it.
    low = min(points.working_volume(made.rig, b.name).z_min for b in made.beams)
    label[some.middle[:, 2] < low] = OUTSIDE
    return label


def crossings(made: Bench, laser: str, X: Floats, steps: int) -> list[tuple[Ints, Floats]]:
    """Which points (m, 3) pass the laser's sheet, and at what table angles; in a few batches."""
    sheet, T = made.rig.sheet(laser), made.rig.T_camera_table
    angles = np.arange(steps + 1) * (2 * np.pi / steps)
    out = []
    for start in range(0, len(X), 4000):
        part = X[start : start + 4000]
        turned = np.einsum("sij,mj->smi", rotation_z(angles), part)
        off = sheet.distance(T.apply(turned.reshape(-1, 3))).reshape(len(angles), -1)
        k, at = np.nonzero((off[:-1] < 0) != (off[1:] < 0))
        share = off[k, at] / (off[k, at] - off[k + 1, at])
        out.append(((at + start).astype(np.int32), angles[k] + share * angles[1]))
    return out


def _cosine(X: Floats, n: Floats, towards: Floats) -> Floats:
    way = towards - X
    return np.asarray(np.einsum("ij,ij->i", way, n) / np.linalg.norm(way, axis=1))


def _reached(caster: Caster, X: Floats, n: Floats, towards: Floats, grazing: float) -> Bools:
    out = _cosine(X, n, towards) > grazing
    out[out] = caster.visible(X[out], n[out], towards[out])
    return out


def _in_fan(made: Bench, laser: str, camera: Floats) -> Bools:
    beam = next(b for b in made.beams if b.name == laser)
    way = camera - beam.apex
    along = way @ beam.aim
    across = way @ np.cross(made.rig.sheet(laser).normal, beam.aim)
    return np.asarray(np.abs(across) < along * np.tan(beam.half_angle))


def _albedo(made: Bench, X: Floats) -> Floats:
    from turnscan.simulate import _shade

    m = made.scene.bodies[0].material
    out = np.full(len(X), m.at(made.beams[0].wavelength))
    if m.pattern != "none":
        paint = np.array([1.0, PATTERNS.index(m.pattern), m.pitch, m.pattern_ratio])
        out = out * _shade.paint_all(X, paint)
    return np.asarray(out)


def true_causes(made: Bench, steps: int, mesh: Mesh, holes: Sequence[Hole]) -> list[str | None]:
    """For each hole of an open mesh the name of its true cause; None where it is not clear.

    Triangles further than `COVERED` from the mesh are missing. Those that hang together and come to
    a border of the mesh belong to its holes: each to the one whose border is nearest, and no
    further than that hole is large.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    true = patches(made)
    near = shapes.deviation(true.middle, mesh)
    t = mesh.triangles[near.face]
    flat = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    alike = np.einsum("ij,ij->i", flat, true.normal) > 0
    gone = np.flatnonzero(~((np.abs(near.distance) < COVERED) & alike))
    if not len(gone) or not holes:
        return [None] * len(holes)
    corner = true.corners[gone]
    v = int(true.corners.max()) + 1
    pairs = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]]])
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(v, v))
    piece = connected_components(graph, directed=False)[1][corner[:, 0]]
    edge = np.concatenate([h.loop for h in holes])
    owner = np.repeat(np.arange(len(holes)), [len(h.loop) for h in holes])
    tree = cKDTree(mesh.vertices[edge])
    away, which = tree.query(true.middle[gone])
    touch = np.full(int(piece.max()) + 1, np.inf)
    np.minimum.at(touch, piece, away)
    size = np.array([h.size for h in holes])
    keep = (touch[piece] < 2 * FINE) & (away < size[owner[which]])
    # A border that does not lie on the part is that of an artefact, and not of a hole in it.
    stray = np.abs(shapes.deviation(mesh.vertices[edge], made_mesh(made)).distance) > COVERED
    alien = np.bincount(owner, stray, len(holes)) > 0.5 * np.bincount(owner)
    some = true.some(gone[keep])
    found = []
    for grazing in GRAZING:
        votes = np.zeros((len(holes), len(LABELS)))
        np.add.at(votes, (owner[which[keep]], labels(made, some, steps, grazing)), some.area)
        total = votes.sum(axis=1)
        sure = (total > 0) & (votes.max(axis=1) >= SURE * total)
        found.append(np.where(sure, votes.argmax(axis=1), -1))
    agreed = np.where((found[0] == found[1]) & ~alien, found[0], -1)
    return [LABELS[k] if k >= 0 else None for k in agreed]
