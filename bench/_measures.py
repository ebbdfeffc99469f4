"""Every measure of the Inspect room on a scan of a known part, each with its truth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bench._sized_parts import EDGE, Sized
from turnscan import edit, shapes
from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import TurnscanError
from turnscan.mesh import Mesh, is_closed, measured_vertices, vertex_normals
from turnscan.rig import Pose, rotation_from_vector
from turnscan.workflows._session._measures import measures_of, renewed

PICKS = 4
"""Distances of each way, and corners, on one scan."""
SOME = 400
"""Vertices among which points are picked."""
APART = 8.0
"""mm between picked points at least."""
_SEEN = 1.5
"""mm: vertices further from the part than this are on something else."""
_LEAST = 40
"""Faces of a region at least."""
_UPRIGHT = math.cos(math.radians(1.0))


@dataclass(frozen=True)
class Taken:
    """A measure and its truth, in its unit; angles in degrees."""

    kind: str
    name: str
    value: float
    true: float
    U: float | None
    """Expanded uncertainty (k = 2) as the room states it; None where it states none."""
    shared: float | None
    """Standard uncertainty from the calibration, part of it."""
    unit: str

    @property
    def error(self) -> float:
        """Measured less true."""
        return self.value - self.true

    def __str__(self) -> str:
        known = "no U" if not self.U else f"U {self.U:.4g}, error / U {self.error / self.U:+.2f}"
        shared = "" if self.shared is None else f", u of the calibration {self.shared:.3g}"
        return (
            f"{self.kind} {self.name}: {self.value:.4f} {self.unit}, error {self.error:+.4f}, "
            f"{known}{shared}"
        )


Wanted = tuple[str, str, edit.Edit, float]
"""Kind, name, edit and true value of a measure."""


class _Known:
    """A mesh beside its part."""

    def __init__(self, mesh: Mesh, sized: Sized, guess: Pose, aligned: bool) -> None:
        self.mesh, self.sized = mesh, sized
        self.measured = measured_vertices(mesh)
        at = _aligned(mesh.vertices[self.measured], sized, guess) if aligned else guess
        self.place = at
        self.own = at.apply(mesh.vertices)
        """(v, 3) mm: the vertices in the part's frame."""
        self.true = self.on_part(self.own)
        """(v, 3) mm: where they are on the part."""
        faces = np.ones(len(mesh.faces), dtype=np.bool_)
        self.faces = faces if mesh.measured is None else mesh.measured

    def on_part(self, points: Floats) -> Floats:
        """The points of the part nearest to points (n, 3) that are near it."""
        out = points
        for _ in range(3):
            distance, slope = _slope(self.sized, out)
            out = out - distance[:, None] * slope
        return np.asarray(out)

    def chosen(self, inside: Bools) -> Bools:
        """(f,) measured faces all of whose vertices (v,) are inside."""
        return np.asarray(self.faces & inside[self.mesh.faces].all(axis=1))

    def area(self, faces: Bools) -> float:
        """mm²: of the part below these faces, whose sides are halved to follow it."""
        f = self.mesh.faces[faces]
        sides = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        pairs, which = np.unique(sides, axis=0, return_inverse=True)
        middle = self.on_part(self.true[pairs].mean(axis=1))
        X = np.concatenate([self.true, middle])
        ab, bc, ca = which.reshape(3, -1) + len(self.true)
        a, b, c = f.T
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        t = X[np.concatenate([np.stack(q, axis=1) for q in quarters])]
        return float(
            np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2
        )

    def free(self, rng: np.random.Generator) -> Ints:
        """(n,) numbers of measured vertices on smooth surface, `EDGE` from all edges; of `SOME`."""
        near = np.linalg.norm(self.own - self.true, axis=1) < _SEEN
        some = np.flatnonzero(self.measured & near & (self.true[:, 2] > EDGE))
        some = rng.permutation(some)[:SOME]
        X = self.true[some]
        n = _slope(self.sized, X)[1]
        one = np.cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])
        one /= np.maximum(np.linalg.norm(one, axis=1), 1e-12)[:, None]
        other, good = np.cross(n, one), np.ones(len(some), dtype=np.bool_)
        for way in (one, -one, other, -other):
            beside = self.on_part(X + EDGE * way)
            good &= np.einsum("ij,ij->i", _slope(self.sized, beside + 0.01 * n)[1], n) > 0.9
        return np.asarray(some[good], dtype=np.int32)


def _slope(sized: Sized, points: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) of points (n, 3) from the part, and the unit directions away from it."""
    distance = sized.part.distance
    assert distance is not None
    step = 1e-5
    here = distance(points)
    n = np.stack([distance(points + step * e) - distance(points - step * e) for e in np.eye(3)], 1)
    return here, n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]


def _aligned(points: Floats, sized: Sized, guess: Pose) -> Pose:
    """Where the part is: what a calibration does not know is where the table's zero lies."""
    X = guess.apply(points[:: max(1, len(points) // 2000)])
    distance = sized.part.distance
    assert distance is not None

    def pose(p: Floats) -> Pose:
        return Pose(rotation_from_vector(p[:3]), p[3:])

    def off(p: Floats) -> Floats:
        return np.clip(distance(pose(p).apply(X)), -_SEEN, _SEEN)

    best = least_squares(off, np.zeros(6), loss="soft_l1", f_scale=0.1)
    return pose(best.x) @ guess


def taken_on(
    mesh: Mesh,
    source: shapes.Source,
    sized: Sized,
    guess: Pose,
    rng: np.random.Generator,
    *,
    aligned: bool,
) -> list[Taken]:
    """All measures that the part has, taken by the code of the Inspect room.

    ``guess`` leads from the frame of the mesh to that of the part; where the mesh is ``aligned`` it
    is the start of the best fit.
    """
    document = edit.Document.open(lambda entries, progress: (mesh, ()), source=lambda: source)
    known = _Known(mesh, sized, guess, aligned)
    wanted = list(_wanted(known, document.body, rng))
    said = dict[int, Wanted]()
    for one in wanted:
        try:
            document, _ = document.add(one[2])
        except TurnscanError as error:
            print(f"  {one[0]} {one[1]}: {error}")
            continue
        said[document.history.entries[-1].id] = one
    out = []
    for m in measures_of(document, renewed(document, None, lambda: None)):
        kind, name, _, true = said[m.edit]
        out.append(Taken(kind, name, m.value, true, m.uncertainty, m.shared, m.unit))
    return out


def _wanted(known: _Known, body: edit.Body, rng: np.random.Generator) -> Iterator[Wanted]:
    yield from _picked(known, rng)
    yield from _flat(known, body, rng)
    yield from _round(known, body, rng)
    yield from _areas(known, body)
    if is_closed(known.mesh) and not math.isnan(known.sized.volume):
        yield "volume", "", edit.MeasureVolume(), known.sized.volume


def _picked(known: _Known, rng: np.random.Generator) -> Iterator[Wanted]:
    """Between points: across the part, along it, and angles at corners."""
    free = known.free(rng)
    if len(free) < 100:
        return
    n = vertex_normals(known.mesh)
    for k in range(PICKS):
        a = int(rng.choice(free))
        to = known.mesh.vertices[free] - known.mesh.vertices[a]
        apart = np.linalg.norm(to, axis=1)
        far = free[apart > APART]
        if len(far) < 10:
            continue
        across = free[np.argmin((to @ n[a]) / np.maximum(apart, APART) - 0.02 * (n[free] @ n[a]))]
        for kind, b in (("distance across", int(across)), ("distance along", int(rng.choice(far)))):
            if np.linalg.norm(known.mesh.vertices[b] - known.mesh.vertices[a]) > APART:
                yield (
                    kind, str(k + 1),
                    edit.MeasureDistance(_place(known, a), _place(known, b)),
                    float(np.linalg.norm(known.true[b] - known.true[a])),
                )  # fmt: skip
        b, c = (int(x) for x in rng.choice(far, 2))
        p, q = known.true[b] - known.true[a], known.true[c] - known.true[a]
        if np.linalg.norm(p - q) > APART:
            true = math.degrees(math.atan2(float(np.linalg.norm(np.cross(p, q))), float(p @ q)))
            corner = edit.MeasureCorner(_place(known, b), _place(known, a), _place(known, c))
            yield "angle of three points", str(k + 1), corner, true


def _place(known: _Known, vertex: int) -> tuple[float, float, float]:
    x, y, z = known.mesh.vertices[vertex].tolist()
    return x, y, z


def _flat(known: _Known, body: edit.Body, rng: np.random.Generator) -> Iterator[Wanted]:
    """From a point to a plane, and between planes."""
    free = known.free(rng) if known.sized.flats else np.zeros(0)
    found = dict[str, tuple[edit.Region, Floats, Floats]]()
    for name, inside in known.sized.flats.items():
        chosen = known.chosen(inside(known.true))
        if chosen.sum() < _LEAST:
            continue
        X = known.true[np.unique(known.mesh.faces[chosen])]
        middle = X.mean(axis=0)
        normal = _slope(known.sized, middle[None])[1][0]
        found[name] = (edit.Region.of(body, np.flatnonzero(chosen)), middle, normal)
    names = list(found)
    for k, name in enumerate(names):
        region, middle, normal = found[name]
        v = int(rng.choice(free))
        true = float((known.true[v] - middle) @ normal)
        yield "point to plane", name, edit.MeasureToPlane(_place(known, v), region), true
        other = names[(k + 1) % len(names)]
        if other != name:
            cosine = float(np.clip(normal @ found[other][2], -1, 1))
            measure = edit.MeasureAngle(region, found[other][0])
            yield "angle of planes", f"{name}, {other}", measure, math.degrees(math.acos(cosine))


def _round(known: _Known, body: edit.Body, rng: np.random.Generator) -> Iterator[Wanted]:
    """Diameters of faces, whole and in part, and of sections."""
    for name, (true, inside) in known.sized.rounds.items():
        here = inside(known.true)
        turn = float(rng.uniform(-math.pi, math.pi))
        way = np.array([math.cos(turn), math.sin(turn)])
        half = known.true[:, :2] @ way > 0
        for which, chosen in (
            ("", known.chosen(here)),
            (", half of it", known.chosen(here & half)),
        ):
            if chosen.sum() >= _LEAST:
                region = edit.Region.of(body, np.flatnonzero(chosen))
                yield "diameter of a face", name + which, edit.MeasureDiameter(region), true
    if known.sized.turned is None or known.place.rotation[2, 2] < _UPRIGHT:
        return
    true, low, high = known.sized.turned
    for k in range(2):
        z = float(rng.uniform(low, high))
        v = int(np.argmin(np.abs(known.own[:, 2] - z)))
        on = known.mesh.vertices[v]
        cut = edit.MeasureSection((0.0, 0.0, 1.0), float(on[2]), _place(known, v))
        yield "diameter of a section", str(k + 1), cut, true


def _areas(known: _Known, body: edit.Body) -> Iterator[Wanted]:
    """Of faces, and of the whole: a ball that is closed, or all that was measured of a cup."""
    faces = [(name, inside) for name, (_, inside) in known.sized.rounds.items()]
    for name, inside in [*faces, *list(known.sized.flats.items())[:2]]:
        chosen = known.chosen(inside(known.true))
        if chosen.sum() >= _LEAST:
            region = edit.Region.of(body, np.flatnonzero(chosen))
            yield "area of a face", name, edit.MeasureArea(region), known.area(chosen)
    if known.sized.part.name == "sphere" and is_closed(known.mesh):
        across = known.sized.rounds["sphere"][0]
        yield "area of the whole", "sphere", edit.MeasureArea(), math.pi * across**2
    if known.sized.part.name == "cup":
        near = np.linalg.norm(known.own - known.true, axis=1) < _SEEN
        chosen = known.chosen(near)
        region = edit.Region.of(body, np.flatnonzero(chosen))
        yield "area of the whole", "cup", edit.MeasureArea(region), known.area(chosen)
