"""Why a simulated scan has the holes it has: from the part's own triangles, lamp and lens.

Nothing of the reconstruction is asked but where its mesh ends. What the true cause is, and when it
counts as known, follows from geometry and light alone:

1. The part's surface is cut into triangles no longer than `FINE`. Those that the mesh does not
   cover and that hang together up to a border of the mesh are the **gap** of the hole there.
2. A place of the part passes a laser's sheet at some table angles. There it is *inside* in the
   picture and in the working volume; *seen* where the camera looks at it less flatly than
   `GRAZING` and nothing of the scene stands between; *lit* where it lies in the laser's fan and the
   same holds for the laser; and its stripe is as *bright* as Lambert's and the microfacets' law
   say, against the threshold of detection (`threshold`) below and the camera's white above.
3. A place that is seen, lit, bright enough and not clipped at one such moment is **measurable**.
   Otherwise it is **saturated** where it would be measurable but for clipping, **dark** where it
   was seen and lit and never bright enough. Never both at once, it is hidden: from the **laser**
   where it was seen, from the **camera** where it was lit, and from both where both came about, or
   neither. Where nothing stood between at such a moment, and it was turned to both, but to one of
   them less than `GRAZING`, it is **grazing**, and hidden from that one, too: what lies at 80° to
   90° and what is turned away differ by the tilt of a face that nobody saw. **Outside** is what
   never was inside, and what the working volume leaves out.
4. A mesh has corners only where there are samples. It ends up to one sample before the place where
   the light ends, and the clean-up takes one more, whatever ended the light. So what is measurable
   and no further than `SAMPLES` from what is not belongs to the cause beside it, and has no say.
   Where all of the gap is measurable, or most of what has a say, it was **removed**. A hole so
   narrow that all within it counts as covered has no gap of its own: it was removed where all
   within `SAMPLES` of its border is measurable, and else its cause is not known.
5. The cause is known where `SURE` of the area that has a say bears one name; where it bears two
   (hidden from both), either is right. It must do so with both limits of what is too flat and of
   what is too faint: a cause that hangs on where exactly the limit lies is not known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from turnscan import points, shapes
from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Caster, Mesh
from turnscan.rig import rotation_z
from turnscan.simulate import Bench
from turnscan.simulate._scene import PATTERNS, triangles
from turnscan.simulate._solids import bisected
from turnscan.surface.holes import Hole

COVERED = 0.3
"""mm: a triangle no further than this from the mesh was measured; with coarse pixels, no further
than half a pixel across the stripe moves a point in depth (`depth_of_a_pixel`)."""
FINE = 1.0
"""mm: longest side of the triangles that are asked."""
GRAZING = (float(np.cos(np.deg2rad(76.0))), float(np.cos(np.deg2rad(84.0))))
"""Cosines of the angle off face-on from which a surface counts as hidden: by definition 80°, as
`TearLimits.grazing`; up to 4° to either side it hangs on a facet's tilt, and is not known."""
HORIZON = float(np.cos(np.deg2rad(90.0)))
"""Cosine beyond which it is turned away, and no longer grazing."""
SAMPLES = 2.0
"""Steps or picture lines: one for the sampling, one that the clean-up takes."""
ASKED = 20_000
"""Missing triangles that are asked, about."""
SURE = 2 / 3
"""Share of the area that must bear one name for the cause to be known."""
FAINT = (2.0, 0.5)
"""Times the threshold: from twice on a speckled stripe surely shows, below half surely not."""
CLIPPED = (1.5, 1.0)
"""Times white: at 1.5 a stripe is clipped in more than its very middle, below 1 at most there."""
PEAK = 0.45
"""Share of the grey scale that the stripe reaches on plain grey of `GREY`, face-on (presets)."""
GREY = 0.6

LABELS = (
    "measurable", "dark", "saturated", "laser", "camera", "hidden", "outside",
    "flat to the laser", "flat to the camera", "flat to both",
)  # fmt: skip
(
    MEASURABLE, DARK, SATURATED, LASER, CAMERA, HIDDEN, OUTSIDE,
    LASER_FLAT, CAMERA_FLAT, BOTH_FLAT,
) = range(len(LABELS))  # fmt: skip
NAMES = ("removed", "dark", "saturated", "laser", "camera", "outside", "grazing")
RIGHT: Mapping[str, tuple[str, ...]] = {
    "measurable": ("removed",),
    "dark": ("dark",),
    "saturated": ("saturated",),
    "laser": ("laser",),
    "camera": ("camera",),
    "hidden": ("laser", "camera"),
    "outside": ("outside",),
    "flat to the laser": ("grazing", "laser"),
    "flat to the camera": ("grazing", "camera"),
    "flat to both": ("grazing", "laser", "camera"),
}
"""For each true label, the names that are right."""


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


def threshold(made: Bench) -> float:
    """Share of the grey scale that a stripe must reach to be found, as the detector documents it.

    The larger of four grey levels and seven times the noise of a picture with the laser less one
    without: readout and rounding, in both.
    """
    s = made.sensor
    readout = s.read_noise / s.gain * s.levels / s.converter_levels
    noise = math.sqrt(2.0) * math.hypot(readout, math.sqrt(1.0 / 12.0))
    return max(4.0, 7.0 * noise) / s.levels


def labels(
    made: Bench,
    some: Patches,
    steps: int,
    grazing: float,
    faint: float = 1.0,
    clipped: float = math.inf,
) -> Ints:
    """(f,) for each patch what hinders it, index into `LABELS`, in a turn of ``steps``.

    ``grazing`` is the cosine off face-on below which it is too flat, ``faint`` the light below
    which there is no stripe, in `threshold`, ``clipped`` that from which there is none, in white.
    """
    faint *= threshold(made)
    whole = triangles(made.scene.bodies)
    caster = Caster(whole.vertices, whole.faces)
    T = made.rig.T_camera_table
    size = (made.rig.camera.width - 0.5, made.rig.camera.height - 0.5)
    good, white, dark, seen, lit, dim, slant, inside = np.zeros(
        (8, len(some.middle)), dtype=np.bool_
    )
    for beam in made.beams:
        within = points.working_volume(made.rig, beam.name).contains(some.middle)
        for place, angle in crossings(made, beam.name, some.middle, steps):
            X, n = some.middle[place], some.normal[place]
            turn = rotation_z(-angle)
            camera = T.apply(np.einsum("mji,mj->mi", turn, X))
            uv = made.rig.camera.project(camera)
            with np.errstate(invalid="ignore"):
                ok = ((uv > -0.5) & (uv < size)).all(axis=1) & within[place]
            eye, apex = turn @ T.inverse().translation, turn @ T.inverse().apply(beam.apex)
            s = ok & _reached(caster, X, n, eye, HORIZON)
            b = ok & _in_fan(made, beam.name, camera) & _reached(caster, X, n, apex, HORIZON)
            light = brightness(made, X, n, eye, apex)
            looked, shone = _cosine(X, n, eye) > grazing, _cosine(X, n, apex) > grazing
            both, flat = s & b & looked & shone, s & b & ~(looked & shone)
            for hit, what in (
                (ok, inside), (s, seen), (b, lit), (flat & ~shone, dim), (flat & ~looked, slant),
                (both & (light <= faint), dark), (both & (light >= clipped), white),
                (both & (light > faint) & (light < clipped), good),
            ):  # fmt: skip
                what[place[hit]] = True
    label = np.full(len(some.middle), HIDDEN, dtype=np.int32)
    for what, name in (
        (~inside, OUTSIDE), (seen & ~lit, LASER), (lit & ~seen, CAMERA), (dim, LASER_FLAT),
        (slant, CAMERA_FLAT), (dim & slant, BOTH_FLAT), (dark, DARK),
        (white, SATURATED), (good, MEASURABLE),
    ):  # fmt: skip
        label[what] = name
    return label


def brightness(made: Bench, X: Floats, n: Floats, eye: Floats, apex: Floats) -> Floats:
    """(m,) share of the grey scale that the stripe reaches in the mean, in its middle.

    Lambert and the microfacets of Walter et al. (2007), as in `Material`.
    """
    m = made.scene.bodies[0].material
    nl, nv = _cosine(X, n, apex), _cosine(X, n, eye)
    to_lamp, to_eye = (
        (end - X) / np.linalg.norm(end - X, axis=1, keepdims=True) for end in (apex, eye)
    )
    half = to_lamp + to_eye
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    nh, vh = np.einsum("ij,ij->i", n, half), np.einsum("ij,ij->i", to_eye, half)
    a2 = m.roughness**2
    spread = a2 / (math.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    light, view = np.maximum(nl, 1e-3), np.maximum(nv, 1e-3)
    shadow = 1.0
    for c in (light, view):
        shadow = shadow * 2.0 * c / (c + np.sqrt(a2 + (1.0 - a2) * c * c))
    fresnel = m.specular + (1.0 - m.specular) * (1.0 - np.clip(vh, 0.0, 1.0)) ** 5
    shine = spread * shadow * fresnel / (4.0 * light * view) if m.specular > 0.0 else 0.0
    share = _albedo(made, X) + math.pi * shine
    return np.asarray(PEAK * np.maximum(nl, 0.0) * share / GREY)


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


def true_causes(
    made: Bench, steps: int, mesh: Mesh, holes: Sequence[Hole]
) -> list[tuple[str, ...]]:
    """For each hole of an open mesh the right names of its cause; none where it is not clear."""
    from scipy.spatial import cKDTree

    true = patches(made)
    gone, owner = gaps(made, true, mesh, holes)
    narrow = np.array([2 * h.area <= h.perimeter * covered(made) for h in holes], dtype=np.bool_)
    beside, near = surroundings(made, true, mesh, holes, narrow, steps)
    wide = ~narrow[owner]
    gone, owner = np.append(gone[wide], beside), np.append(owner[wide], near)
    # Evenly some of them, in their own order, stand for all.
    few = np.arange(0, len(gone), max(1, len(gone) // ASKED))
    gone, owner = gone[few], owner[few]
    some = true.some(gone)
    found = np.ones((len(holes), len(NAMES)), dtype=np.bool_)
    right = np.array([[name in RIGHT[label] for name in NAMES] for label in LABELS], np.float64)
    reach = SAMPLES * spacing(made, some.middle, steps) + FINE
    for limits in zip(GRAZING, FAINT, CLIPPED, strict=True):
        label = labels(made, some, steps, *limits)
        lost = label != MEASURABLE
        say = lost.copy()
        if lost.any():
            say |= cKDTree(some.middle[lost]).query(some.middle)[0] > reach
        else:
            say[:] = True
        say |= narrow[owner]
        votes = np.zeros((len(holes), len(NAMES)))
        total = np.bincount(owner[say], some.area[say], len(holes))
        np.add.at(votes, owner[say], some.area[say, None] * right[label[say]])
        share = np.where(narrow, 1.0 - 1e-9, SURE)
        found &= (votes >= (share * total)[:, None]) & (total > 0)[:, None]
    return [tuple(n for n, ok in zip(NAMES, row, strict=True) if ok) for row in found]


def spacing(made: Bench, X: Floats, steps: int) -> Floats:
    """(m,) mm between samples at places (m, 3): of a step or of a picture line, the larger."""
    step = np.hypot(X[:, 0], X[:, 1]) * 2.0 * np.pi / steps
    return np.asarray(np.maximum(step, _pixels(made).max()))


def surroundings(
    made: Bench, true: Patches, mesh: Mesh, holes: Sequence[Hole], narrow: Bools, steps: int
) -> tuple[Ints, Ints]:
    """The patches within `SAMPLES` of the borders of narrow holes, and whose they are."""
    from scipy.spatial import cKDTree

    which = [k for k, h in enumerate(holes) if narrow[k]]
    if not which:
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    edge = np.concatenate([holes[k].loop for k in which])
    owner = np.repeat(which, [len(holes[k].loop) for k in which]).astype(np.int32)
    away, nearest = cKDTree(mesh.vertices[edge]).query(true.middle)
    at = np.flatnonzero(away < SAMPLES * spacing(made, true.middle, steps) + FINE)
    return at.astype(np.int32), owner[np.asarray(nearest)[at]]


def covered(made: Bench) -> float:
    """mm: a triangle no further than this from the mesh was measured."""
    return max(COVERED, depth_of_a_pixel(made) / 2)


def depth_of_a_pixel(made: Bench) -> float:
    """mm that a pixel across the stripe moves a point towards the camera, at the axis."""
    T, sheet = made.rig.T_camera_table, made.rig.sheets[0]
    ray = T.translation / np.linalg.norm(T.translation)
    return float(_pixels(made)[0] / abs(float(sheet.normal @ ray)))


def _pixels(made: Bench) -> Floats:
    """(2,) mm: width and height of a pixel at the axis."""
    depth = float(np.linalg.norm(made.rig.T_camera_table.translation))
    return np.asarray(depth / np.diag(made.rig.camera.matrix)[:2])


def gaps(made: Bench, true: Patches, mesh: Mesh, holes: Sequence[Hole]) -> tuple[Ints, Ints]:
    """Numbers of the patches that are missing beside a hole, and which hole they belong to.

    Missing patches that hang together and come to a border of the mesh belong to its hole; where
    they come to several, each to the one whose border is nearest, and no further than it is large.
    A border that does not lie on the part is that of an artefact and not of a hole in it: it gets
    none.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    none = np.zeros(0, np.int32)
    if not holes:
        return none, none
    near = shapes.deviation(true.middle, mesh)
    t = mesh.triangles[near.face]
    flat = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    alike = np.einsum("ij,ij->i", flat, true.normal) > 0
    pixel = depth_of_a_pixel(made)
    gone = np.flatnonzero(~((np.abs(near.distance) < covered(made)) & alike))
    if not len(gone):
        return none, none
    corner = true.corners[gone]
    v = int(true.corners.max()) + 1
    pairs = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]]])
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(v, v))
    piece = connected_components(graph, directed=False)[1][corner[:, 0]]
    edge = np.concatenate([h.loop for h in holes])
    owner = np.repeat(np.arange(len(holes)), [len(h.loop) for h in holes])
    away, which = cKDTree(mesh.vertices[edge]).query(true.middle[gone])
    # The inside of a cup may be nearer to the cup's foot than to its rim, where it ends.
    meets = np.zeros((int(piece.max()) + 1, len(holes)), dtype=np.bool_)
    meets[piece[away < 2 * FINE], owner[np.asarray(which)[away < 2 * FINE]]] = True
    mine = owner[np.asarray(which)]
    mine = np.where(meets.sum(axis=1)[piece] == 1, meets.argmax(axis=1)[piece], mine)
    size = np.array([h.size for h in holes])
    # Where the light is cut, the stripe's centre is off by as much as the stripe is wide: a pixel.
    off = np.abs(shapes.deviation(mesh.vertices[edge], made_mesh(made)).distance)
    stray = off > max(COVERED, pixel)
    alien = np.bincount(owner, stray, len(holes)) > 0.5 * np.bincount(owner)
    keep = meets[piece, mine] & (away < size[mine]) & ~alien[mine]
    return gone[keep].astype(np.int32), mine[keep].astype(np.int32)
