"""A part of many faces, drawn as STEP, scanned in two poses and recovered: what comes back of it.

``python -m bench step_part`` simulates `featuretype.STEP` of the shared data on the paper's rig in
two poses, as it lies and turned over, both leaning so that most of it is seen, then in three; joins
them and closes the surface, finds shapes, and holds these against the faces of the drawing: found,
missed, invented, and how far points lie off; then writes it as STEP and reads that back, by
OpenCASCADE and by FreeCAD where that is installed. Which faces a scan in these poses can show is
asked of the drawing itself, by rays to lamp and lens; of each face that was not found it is told
how many points lie on it. ``--write`` puts the table into the page. ``python -m bench.step_part
PART.STEP`` takes another part, ``--steps`` (200) for each turn; ``--poses 3`` these many poses
alone; ``--rig``; ``--keep FOLDER`` keeps the scans there and finds them again; ``--free`` joins the
poses by their own shape, not by the drawing.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bench import _hole_truth as truth
from bench import _keep
from bench._freecad import read_by_freecad
from bench._page import DOCS, write
from bench.surface_truth import scanned
from turnscan import workflows as w
from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.drawings import read_step
from turnscan.formats import export
from turnscan.mesh import Mesh, is_closed
from turnscan.progress import no_progress
from turnscan.shapes import deviation
from turnscan.shapes.primitives._ground import Ground, prepared, sigma_of
from turnscan.shapes.primitives._judged import LEAST, SPAN, poor, spanned
from turnscan.shapes.primitives._shapes import KINDS
from turnscan.simulate import Bench, SimulationSpec
from turnscan.workflows._inspection._compare import measured_labels
from turnscan.workflows._inspection._compared_features import matched
from turnscan.workflows._surface._aligning import labels_of
from turnscan.workflows._surface._nominal import Nominal, nominal

PART = Path(__file__).parents[2] / "shared" / "data" / "parts" / "featuretype.STEP"
PAGE = DOCS / "how-to" / "shapes.md"
POSES = ((0.0, (-35.0, -35.0)), (180.0, (0.0, -60.0)), (180.0, (60.0, 0.0)))
"""Degrees: how far the part is tipped over, then leans about x and y. Of all pairs and triples of
31 such poses, those that show most faces, by rays to lamp and lens."""
_PLACES = 100_000
"""Places of the drawing that are asked for, about."""


@dataclass(frozen=True)
class Task:
    """How a part is scanned."""

    drawing: Path
    rig: str = "paper"
    steps: int = 200
    poses: int = 2
    """The first so many of `POSES`."""
    free: bool = False
    """Joined by their own shape, not by the drawing."""


def recovered(task: Task, folder: Path) -> list[str]:
    """The lines of the report."""
    drawing = task.drawing
    drawn = nominal(drawing, "mm", no_progress)
    mesh = folder / f"{drawing.stem}-mm.stl"
    mesh.write_bytes(export(drawn.mesh, ".stl"))
    specs = [
        SimulationSpec(
            str(mesh),
            task.rig,
            lasers=1,
            seed=1 + k,
            steps=task.steps,
            tip=math.radians(tip),
            lean=(math.radians(lean[0]), math.radians(lean[1])),
        )
        for k, (tip, lean) in enumerate(POSES[: task.poses])
    ]
    made, scans = zip(*(scanned(spec, folder) for spec in specs), strict=True)
    joined = w.join(scans, reference=None if task.free else drawing, close=True)
    found = w.find_shapes(joined)
    moved = w.compare(joined, drawing, align="shape" if task.free else "none")
    return [
        *_told(drawn, found, moved, in_sight(drawn, made, task.steps)),
        *_solid(drawn, found),
    ]


@dataclass(frozen=True)
class Sight:
    """What of a face of the drawing some pose shows: a laser lights it, and the camera sees it."""

    area: float
    """mm²."""
    normals: Floats
    """(n, 3) of its places."""


def in_sight(drawn: Nominal, made: Sequence[Bench], steps: int) -> list[Sight]:
    """Each face as rays to lamp and lens tell it, of the part as it stands in each pose."""
    seen, at = np.zeros(0, dtype=np.bool_), np.zeros(0, dtype=np.int32)
    for one in made:
        whole = truth.patches(one)
        every = 1 + len(whole.area) // _PLACES
        some = whole.some(np.arange(0, len(whole.area), every, dtype=np.int32))
        good: Bools = truth.labels(one, some, steps, truth.GRAZING[0]) == truth.MEASURABLE
        seen = seen | good if len(seen) else good
        if not len(at):
            T = one.scene.bodies[0].T_table_part.inverse()
            lowest = one.scene.bodies[0].part.mesh.vertices.min(axis=0)
            X = T.apply(some.middle) - lowest + drawn.mesh.vertices.min(axis=0)
            at = drawn.label[deviation(X, drawn.mesh).face]
            area = some.area * whole.area.sum() / some.area.sum()
            normals = some.normal @ one.scene.bodies[0].T_table_part.rotation
    on = [seen & (at == k) for k in range(len(drawn.shapes))]
    return [Sight(float(area[own].sum()), normals[own]) for own in on]


@dataclass(frozen=True)
class Faces:
    """(f,) Which faces of the drawing a scan in these poses shows, and which it measured."""

    visible: Bools
    """As large a part of it as a shape must have is lit and seen, and turns as far."""
    points: Ints
    """Measured points that lie on it, within three of their standard deviations."""
    measured: Bools
    """So many of them as a shape must have, in one piece of as much surface."""
    badly: Bools
    """Of these faces, those whose points are known so much worse than the rest of the part that a
    shape must have more stripes."""


def faces_of(drawn: Nominal, mesh: Mesh, label: Ints, off: Floats, sight: list[Sight]) -> Faces:
    """Of a mesh whose vertices (v,) lie ``off`` mm from the faces ``label`` of the drawing."""
    g = prepared(mesh, sigma_of(mesh), None)
    least = w.ShapesOptions().smallest * float(g.area.sum())
    visible, measured, badly = np.zeros((3, len(drawn.shapes)), dtype=np.bool_)
    points = np.zeros(len(drawn.shapes), dtype=np.int32)
    for k, (s, shown) in enumerate(zip(drawn.shapes, sight, strict=True)):
        on = (label == k) & (np.abs(off) <= g.limit)
        own = _largest_piece(g, on)
        flat = s.kind == "plane"
        visible[k] = shown.area >= least and (flat or spanned(shown.normals) >= SPAN)
        points[k] = on.sum()
        measured[k] = (
            len(own) >= LEAST[KINDS.index(s.kind)]
            and float(g.area[own].sum()) >= least
            and (flat or spanned(g.normals[own]) >= SPAN)
        )
        badly[k] = measured[k] and poor(g, own)
    return Faces(visible, points, measured, badly)


def _largest_piece(g: Ground, on: Bools) -> Longs:
    """The vertices of the largest connected piece of those where ``on`` (v,) is True."""
    own = np.flatnonzero(on)
    if not len(own):
        return own
    there = np.repeat(np.arange(len(on)), np.diff(g.start))
    both = on[there] & on[g.near]
    link = coo_matrix((np.ones(int(both.sum())), (there[both], g.near[both])), shape=2 * on.shape)
    piece: Ints = connected_components(link, directed=False)[1][own]
    largest: Longs = own[piece == np.bincount(piece).argmax()]
    return largest


def _told(
    drawn: Nominal, found: w.FoundShapes, moved: w.Comparison, sight: list[Sight]
) -> list[str]:
    label = labels_of(drawn, moved.every.face, moved.every.beyond)
    match = matched(drawn, label, found.found, measured_labels(found.mesh, found))
    of = faces_of(drawn, moved.mesh, label, moved.every.distance, sight)
    shapes = found.found.shapes
    got = np.zeros(len(drawn.shapes), dtype=np.bool_)
    got[list(match.values())] = True
    lines = [
        "| kind | drawn | visible | measured | found | missed of these | invented |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in Counter(s.kind for s in (*drawn.shapes, *shapes)):
        own = np.array([s.kind == kind for s in drawn.shapes])
        alien = sum(s.kind == kind and k not in match for k, s in enumerate(shapes))
        told = (own, own & of.visible, own & of.measured, own & got, own & of.measured & ~got)
        lines.append(f"| {kind} | {' | '.join(str(int(n.sum())) for n in told)} | {alien} |")
    d = deviation(moved.mesh.vertices, drawn.mesh)
    return [
        *lines,
        "",
        *_not_found(drawn, of, got),
        "",
        f"measured points off the drawing: {1e3 * d.mean:+.1f} µm mean, {1e3 * d.rms:.1f} µm rms, "
        f"95 % within {1e3 * d.quantile(0.95):.1f} µm",
        "",
    ]


def _not_found(drawn: Nominal, of: Faces, got: Bools) -> list[str]:
    """Why faces were not found, and how many points there are on each of them."""
    flat = np.array([s.kind == "plane" for s in drawn.shapes])
    none = of.points == 0
    causes = (
        ("no point on it", none),
        ("too few points, or too little surface in one piece", ~none & ~of.measured),
        ("a few stripes that are known badly", of.badly),
        ("missed", of.measured & ~of.badly),
    )
    lines = ["| not found | planes | points on each | curved | points on each |", "|" + "---|" * 5]
    for cause, here in causes:
        cells = []
        for kind in (flat, ~flat):
            points = np.sort(of.points[here & kind & ~got])
            cells += [str(len(points)), ", ".join(map(str, points))]
        lines.append(f"| {cause} | {' | '.join(cells)} |")
    return lines


def _solid(drawn: Nominal, found: w.FoundShapes) -> list[str]:
    """What the STEP holds, and its volume against the drawing's and the mesh's."""
    made = found.step
    back = read_step(made.data)
    mesh = "the mesh is open"
    if is_closed(found.mesh):
        known = found.mesh.measured
        filled = 0.0 if known is None else found.mesh.area_of(~known) / found.mesh.area_of()
        mesh = f"mesh {found.mesh.volume:.0f} mm³, {filled:.0%} of its surface filled"
    if made.volume is not None and back.solids:
        off = (back.volume - drawn.mesh.volume) / made.volume.sigma
        mesh += f"; the solid is off the drawing by {off:+.2f} u"
    held = f"{back.solids} solids, {back.faces} faces, {'valid' if back.valid else 'not valid'}"
    volume = f", {back.volume:.0f} mm³" if back.solids else ""
    other = read_by_freecad(made.data)
    by_freecad = [] if other is None else [f"read back by FreeCAD {other.version}: {other}"]
    return [
        *(f"STEP: {f.message}" for f in made.findings),
        f"read back by OpenCASCADE: {held}{volume}; drawn {drawn.mesh.volume:.0f} mm³, {mesh}",
        *by_freecad,
    ]


def run(quick: bool = False, into_pages: bool = False) -> None:
    """The part of the shared data."""
    if not PART.exists():
        print(f"{PART} is not there")
        return
    with _keep.folder(None) as folder:
        if quick:
            print("\n".join(recovered(Task(PART, steps=60), folder)))
            return
        _in_poses(Task(PART), (2, len(POSES)), folder, into_pages)


def _in_poses(task: Task, poses: Sequence[int], folder: Path, into_pages: bool) -> None:
    """A part in so many poses each time; into the page, too."""
    lines = list[str]()
    for count in poses:
        more = [f"In {count} poses:", "", *recovered(replace(task, poses=count), folder), ""]
        print("\n".join(more), flush=True)
        lines += more
    if into_pages:
        write(PAGE, "step-part", lines[:-1])


def main() -> None:
    """Print what comes back of a drawing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drawing", type=Path, nargs="?", default=PART)
    parser.add_argument("--rig", default="paper")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--poses", type=int, nargs="+", default=[2, len(POSES)])
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--free", action="store_true", help="join by shape, without the drawing")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    args = parser.parse_args()
    task = Task(args.drawing, args.rig, args.steps, free=args.free)
    with _keep.folder(args.keep) as folder:
        _in_poses(task, args.poses, folder, args.write)


if __name__ == "__main__":
    main()
