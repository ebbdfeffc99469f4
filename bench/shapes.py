"""Shapes of simulated scans against the truth: dimensions, edges, what is missed and invented.

``python -m bench shapes`` scans parts with the paper's rig, known exactly, at 1.8° (``--quick``:
two of them); ``python -m bench shapes hexagon shaft`` some alone; ``--write`` puts their rows into
the page, each with the commit that it is of, and leaves those of other parts.
``python -m bench.shapes --rig modern --calibrated`` takes another rig, or one calibrated from
pictures, and then the calibration's uncertainty counts, too; ``--seed 1 2 3`` does it with other
noise each time, of pictures as of the scan; ``--seeds 20 --steps 24 shaft``
scans a part so many times and tells how often its sizes keep their uncertainty; with ``--drawn`` it
is one scan by so many calibrations from drawn corners and stripes, which take seconds, not minutes;
``--pictures 8,8,12 24,16,24`` draws so many boards held freely, under the laser and on the table,
each in turn, of rendered ones with ``--calibrated``; with ``--large`` the board that is held is one
that fills the modern rig's picture (`bench._held`); ``--keep FOLDER`` keeps the scans and the rigs
there and finds them again; ``--plain`` takes the mesh as an STL holds it, without sigmas; parts
without sizes, such as ``head``, can be named, too; ``--freeform`` tells what is invented on a dense
mesh of which nothing is a shape, and how long that takes.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from bench import _keep
from bench._commit import commit_of_code
from bench._drawn import from_drawn
from bench._held import from_large_boards, from_large_drawn
from bench._page import DOCS, MEASURED, figures, measured, replaced, write
from bench._rigs import VIEWS, from_pictures
from bench.accuracy import NEAR_EDGE
from bench.surface_truth import scanned
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh
from turnscan.meshing import source_of, to_mesh
from turnscan.rig import Pose, Rig, rig_from_json, rig_to_json, rotation_from_vector
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import calibration_moves
from turnscan.shapes.primitives import (
    Shape,
    ShapeSet,
    ShapeSize,
    _fit_kernels,
    find_edges,
    find_shapes,
    sharpened,
    sizes_between,
)
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import sigma_of
from turnscan.shapes.primitives._shapes import KINDS
from turnscan.shapes.primitives._surface_kernels import FREE
from turnscan.simulate import Bench, Part, SimulationSpec
from turnscan.simulate._truth import Distance

PAGE = DOCS / "how-to" / "shapes.md"
PARTS = ("hexagon", "shaft", "bracket", "grooves", "v-groove", "torus", "gear")
STEPS = 200
_ALIKE = 0.05
"""Of a true size (at least 0.5 mm): a measured one further off is not it."""
_STEP = 1e-4
"""mm: for the slope of a distance."""
_MOST = 0.75
"""Share of the points of a shape of which the part must have such a surface: others lie beside its
edges."""
_LOOSE = 0.01
"""mm: distance beyond which a place on a shape has less say in the alignment."""


@dataclass(frozen=True)
class Truth:
    """A size that a part has; angles in degrees."""

    name: str
    kind: str
    value: float
    times: int = 1
    """How often the part has it."""


TRUTHS: dict[str, tuple[Truth, ...]] = {
    "hexagon": (
        Truth("across flats", "distance", 40.0, 3),
        Truth("boss ⌀", "diameter", 24.0),
        Truth("angle of sides", "angle", 60.0, 6),
    ),
    "shaft": (
        Truth("low ⌀", "diameter", 50.0),
        Truth("middle ⌀", "diameter", 36.0),
        Truth("high ⌀", "diameter", 24.0),
        Truth("axis to floor of keyway", "axis to plane", 14.0),
    ),
    "bracket": (
        Truth("hole ⌀", "diameter", 24.0),
        Truth("wall", "distance", 10.0),
        Truth("width", "distance", 60.0),
        Truth("depth of foot", "distance", 40.0),
        Truth("axis of hole to sides", "axis to plane", 30.0, 2),
    ),
    "grooves": (Truth("depth", "distance", 1.0), Truth("width", "distance", 60.0)),
    "v-groove": (
        Truth("angle of flanks", "angle", 90.0),
        Truth("angle of flank and face", "angle", 45.0, 2),
        Truth("width", "distance", 46.0),
    ),
    "torus": (
        Truth("ring ⌀", "diameter", 60.0),
        Truth("tube ⌀", "tube diameter", 20.0),
    ),
    "gear": (Truth("hub ⌀", "diameter", 24.0), Truth("tip ⌀", "diameter", 66.0)),
}
HEAD = (
    f"| part | size | true | found | ± | error µm | E_n | {MEASURED} |",
    "|---|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Task:
    """How a part is scanned."""

    part: str
    rig: str = "paper"
    calibrated: bool = False
    """By simulated pictures of a board; else the rig is known exactly."""
    seed: int = 1
    steps: int = STEPS
    drawn: int | None = None
    """Seed of a calibration from drawn corners and stripes (`_drawn`)."""
    pictures: tuple[int, int, int] = VIEWS
    """That those stand for."""
    plain: bool = False
    """Whether the mesh is taken without what a scan says of its points."""
    large: bool = False
    """Whether the board that is held fills the picture of the modern rig."""

    @property
    def spec(self) -> SimulationSpec:
        """The bench to build."""
        return SimulationSpec(self.part, self.rig, lasers=1, seed=self.seed, steps=self.steps)

    @property
    def how(self) -> str:
        """What the table says of it."""
        by = " + ".join(map(str, self.pictures))
        board = f"{'large ' if self.large else ''}boards"
        more = f", rig by {by} rendered {board}" if self.calibrated else ""
        if self.drawn is not None:
            more = f", rig by {by} drawn {board}"
        more += ", as STL" if self.plain else ""
        return f"{self.steps} steps{more}" + (f", seed {self.seed}" if self.seed != 1 else "")


@dataclass(frozen=True, eq=False)
class Found:
    """A part that was scanned, and what was found on it."""

    mesh: Mesh
    shapes: ShapeSet
    sizes: Sequence[ShapeSize]
    spent: float
    """Seconds of the processor."""
    made: Bench
    believed: Rig
    usual: float
    """mm: median sigma of the points of the scan."""


def found_on(task: Task, folder: Path) -> Found:
    """Scan a part, or take the scan in the folder, and find its shapes."""
    made, path = scanned(task.spec, folder)
    believed = _believed(task, made, folder)
    wanted = Settings()
    with Scan.open(path) as kept:
        seen = detect_scan(kept, believed, wanted.stripes)
    grids = to_grids(seen, wanted).grids
    mesh = to_mesh(grids, wanted, rig=believed).mesh
    moves = list(calibration_moves(mesh, source_of(grids, believed)))
    known = sigma_of(mesh)
    usual = math.nan if known is None else float(np.median(known))
    if task.plain:
        mesh, moves = Mesh(mesh.vertices.astype(np.float32).astype(float), mesh.faces), []
    spent = list[float]()
    for _ in range(2):  # the first may compile
        start = time.process_time()
        found = find_shapes(mesh, moves=moves)
        sizes = sizes_between(mesh, found)
        spent.append(time.process_time() - start)
    return Found(mesh, found, sizes, min(spent), made, believed, usual)


def _believed(task: Task, made: Bench, folder: Path) -> Rig:
    """The rig to measure with; one by pictures is kept beside the scans."""
    if task.drawn is not None:
        by_drawn = from_large_drawn if task.large else from_drawn
        return by_drawn(task.spec, task.drawn, task.pictures)
    if not task.calibrated:
        return made.rig
    many = "-".join(map(str, task.pictures)) + ("-large" if task.large else "")
    path = folder / f"rig-{task.part}-{task.rig}-seed-{task.seed}-pictures-{many}.json"
    if not path.exists():
        by_pictures = from_large_boards if task.large else from_pictures
        path.write_text(rig_to_json(by_pictures(task.spec, task.pictures)))
    return rig_from_json(path.read_text())


def measured_part(task: Task, folder: Path) -> list[str]:
    """The lines of a part in the table, and what else there is to say of it, after a scan."""
    f = found_on(task, folder)
    part, place, name = f.made.scene.bodies[0].part, placed(f), task.part
    lines = [line for t in TRUTHS.get(name, ()) for line in _lines(name, t, f.sizes)]
    near = _near_edges(f.mesh, f.shapes, part, place)
    edges = [] if near is None else [near.line(name)]
    rest = _rest(name, f.shapes, f.mesh, part, place, f.spent, f.usual)
    return [*lines, *edges, rest]


def placed(f: Found) -> Pose:
    """From the frame of the mesh to that of the part: as the simulator has laid it where the rig is
    known exactly, else by the best fit of all shapes, of which one that is false pulls the others
    along."""
    if f.believed is f.made.rig:
        return _expected(f)
    return _aligned(f.mesh, f.shapes, f.made.scene.bodies[0].part, _expected(f))


def _expected(f: Found) -> Pose:
    """The same as the simulator has laid the part; as well as the rig is known."""
    true_frame = f.made.rig.T_camera_table.inverse() @ f.believed.T_camera_table
    return f.made.scene.bodies[0].T_table_part.inverse() @ true_frame


def repeated(task: Task, seeds: int, folder: Path) -> list[str]:
    """Of many scans of a part, or calibrations, each size: its mean error, its scatter, its E_n;
    and how far the surface is off near sharp edges."""
    offs, near = dict[str, list[tuple[float, float]]](), list[float]()
    for seed in range(1, seeds + 1):
        again = replace(task, seed=seed) if task.drawn is None else replace(task, drawn=seed)
        f = found_on(again, folder)
        for t in TRUTHS[task.part]:
            offs.setdefault(t.name, []).extend(_errors(t, f.sizes))
        edges = _near_edges(f.mesh, f.shapes, f.made.scene.bodies[0].part, placed(f))
        near += [] if edges is None else [edges.after]
    out = [
        "| part | size | found | mean error µm | scatter µm | u µm | E_n < 1 |",
        "|---|---|---|---|---|---|---|",
    ]
    for t in TRUTHS[task.part]:
        off = np.array(offs[t.name]).reshape(-1, 2)
        name = f"{t.name}, ′ in place of µm" if "angle" in t.kind else t.name
        head = f"| {task.part} | {name} | {len(off)} of {seeds * t.times} "
        if not len(off):
            out.append(f"{head}| | | | |")
            continue
        e, u = (60 if "angle" in t.kind else 1e3) * off.T
        kept = float(np.mean(np.abs(e) < 2 * u))
        spread = f"{e.std(ddof=1):.2f}" if len(e) > 1 else ""
        out.append(f"{head}| {e.mean():+.2f} | {spread} | {u.mean():.2f} | {kept:.0%} |")
    if near:
        what = f"| {task.part} | surface near sharp edges, rms | {len(near)} of {seeds} "
        spread = f"{np.std(near, ddof=1):.1f}" if len(near) > 1 else ""
        out.append(f"{what}| {np.mean(near):.1f} | {spread} | | |")
    return out


def _errors(truth: Truth, sizes: Sequence[ShapeSize]) -> list[tuple[float, float]]:
    """Error and standard uncertainty, mm or degrees, of the sizes nearest to a true one."""
    unit = 180 / math.pi if "angle" in truth.kind else 1.0
    near = sorted(
        ((s.value * unit - truth.value, s.sigma * unit) for s in sizes if s.kind == truth.kind),
        key=lambda o: abs(o[0]),
    )
    most = max(_ALIKE * truth.value, 0.5)
    return [o for o in near if abs(o[0]) <= most][: truth.times]


def _lines(name: str, truth: Truth, sizes: Sequence[ShapeSize]) -> list[str]:
    """A true size beside the measured ones nearest to it."""
    unit = 180 / math.pi if "angle" in truth.kind else 1.0
    near = _errors(truth, sizes)
    many = f" × {truth.times}" if truth.times > 1 else ""
    what = f"| {name} | {truth.name}{many} | {truth.value:g}{'°' if unit != 1 else ''}"
    if len(near) < truth.times:
        return [f"{what} | {len(near)} found | | | |"]
    off, sigma = near[-1]  # the worst
    value = truth.value + off
    error = (
        f"{60 * (value - truth.value):+.2f}′"
        if unit != 1
        else f"{1e3 * (value - truth.value):+.1f}"
    )
    return [f"{what} | {value:.4f} | {sigma:.4f} | {error} | {abs(off) / (2 * sigma):.2f} |"]


def _aligned(mesh: Mesh, found: ShapeSet, part: Part, base: Pose) -> Pose:
    """Where the part is: what a calibration does not know is where the table's zero lies.

    The points lie on the shapes, not where they were measured, for their scatter may be more than
    the shapes are off.
    """
    some = np.flatnonzero(found.used)[:: max(1, int(found.used.sum()) // 4000)]
    if part.distance is None or not len(some):
        return base
    X = mesh.vertices[some]
    for k, s in enumerate(found.shapes):
        on = found.label[some] == k
        d, n = surface.distances(KINDS.index(s.kind), s.numbers, X[on])
        X[on] -= d[:, None] * n
    X = base.apply(X)
    distance = part.distance

    def pose(p: Floats) -> Pose:
        return Pose(rotation_from_vector(p[:3]), p[3:])

    def off(p: Floats) -> Floats:
        return np.clip(distance(pose(p).apply(X)), -1, 1)

    best = least_squares(off, np.zeros(6), loss="soft_l1", f_scale=_LOOSE)
    return pose(best.x) @ base


@dataclass(frozen=True)
class _NearEdges:
    """µm: root mean square distances of points of the surface near sharp edges."""

    before: float
    after: float
    """With the true edges."""
    on_edge: float
    laid: float
    """The same of the vertices there that were laid onto shapes."""
    told: float
    """Of the standard uncertainties that these claim; NaN where the mesh knows none."""
    sharp: int
    """Edges."""

    def line(self, name: str) -> str:
        """The row of a part."""
        known = f"{1e-3 * self.told:.4f}" if self.told == self.told else ""
        kept = f"{self.laid / (2 * self.told):.2f}" if self.told == self.told else ""
        return (
            f"| {name} | {self.sharp} sharp edges: surface within {NEAR_EDGE:g} mm, rms | 0 | "
            f"{self.before:.1f} → {self.after:.1f} µm | {known} | {self.on_edge:.1f} on the edge "
            f"| {kept} |"
        )


def _near_edges(mesh: Mesh, found: ShapeSet, part: Part, place: Pose) -> _NearEdges | None:
    """Of a part whose distance is known, if it has sharp edges."""
    edges = find_edges(mesh, found)
    done = sharpened(mesh, found, edges)
    if part.distance is None or not done.on_edge.any():
        return None
    from scipy.spatial import cKDTree

    tree = cKDTree(done.mesh.vertices[done.on_edge])
    out = []
    for some in (mesh, done.mesh):
        X = some.triangles.mean(axis=1)
        X = X[tree.query(X)[0] < NEAR_EDGE]
        out.append(1e3 * float(np.sqrt(np.mean(part.distance(place.apply(X)) ** 2))))
    edge = part.distance(place.apply(done.mesh.vertices[done.on_edge]))
    on = 1e3 * float(np.sqrt(np.mean(edge**2)))
    u = sigma_of(done.mesh)
    near = done.constructed & (tree.query(done.mesh.vertices)[0] < NEAR_EDGE)
    off = part.distance(place.apply(done.mesh.vertices[near]))
    laid = 1e3 * float(np.sqrt(np.mean(off**2)))
    told = math.nan if u is None else 1e3 * float(np.sqrt(np.mean(u[near] ** 2)))
    return _NearEdges(out[0], out[1], on, laid, told, sum(e.form == "sharp" for e in edges))


def _is_there(s: Shape, X: Floats, place: Pose, distance: Distance, usual: float) -> bool:
    """Whether the part has a shape where one was found, of which points lie at ``X`` (n, 3) in the
    part's frame: the places of the true surface nearest to most of them lie on a surface of that
    kind, of about that radius, and it is where it was found, to the ``usual`` sigma of the scan.

    The tolerance of the search is no measure: without sigmas it may be wide enough for anything.
    """
    n = np.stack([distance(X + _STEP * e) - distance(X - _STEP * e) for e in np.eye(3)], axis=1)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)
    true = np.ascontiguousarray(place.inverse().apply(X - distance(X)[:, None] * n))
    kind = KINDS.index(s.kind)
    every, scale = np.arange(len(true)), np.full(len(true), usual / 3)
    size = 4 * float(np.linalg.norm(np.ptp(true, axis=0)))
    q = surface.slid(kind, s.numbers, true, every)
    q, cost = _fit_kernels.fitted(kind, q, true, scale, every, FREE[kind], 4.0, size, 60)
    if not np.isfinite(cost):
        return False
    on = np.abs(surface.distances(kind, q, true)[0]) <= usual / 3
    found = np.abs(s.distances(true)) <= usual
    wide = max(4 * s.radius_sigma, _ALIKE * s.radius, usual)
    round_ = s.kind in ("plane", "cone") or abs(float(q[6]) - s.radius) <= wide
    return bool(min(on.mean(), found.mean()) >= _MOST and round_)


def _rest(
    name: str, found: ShapeSet, mesh: Mesh, part: Part, place: Pose, spent: float, usual: float
) -> str:
    """What was found, how much of the surface it covers, and what of it is not there."""
    kinds = [s.kind for s in found.shapes]
    told = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds))
    invented = 0
    if part.distance is not None:
        for k, s in enumerate(found.shapes):
            X = np.asarray(mesh.vertices[found.used & (found.label == k)])
            invented += not _is_there(s, place.apply(X), place, part.distance, usual)
    return (
        f"| {name} | {told or 'no shape'} on {found.coverage:.0%} | | {invented} invented | | "
        f"| {len(mesh.faces)} faces, {spent:.1f} s |"
    )


def run(parts: Sequence[str] = (), quick: bool = False, into_pages: bool = False) -> None:
    """Print the table of the paper's rig, known exactly."""
    tasks = [Task(name) for name in parts or (PARTS[:2] if quick else PARTS)]
    with _keep.folder(None) as folder:
        _table(tasks, folder, into_pages)


def _table(tasks: Sequence[Task], folder: Path, into_pages: bool) -> None:
    lines = list(HEAD)
    print("\n".join(lines), flush=True)
    for task in tasks:
        more = measured(measured_part(task, folder), task.how)
        lines += more
        print("\n".join(more), flush=True)
        if into_pages:
            into_page("shapes-calibrated" if task.calibrated else "shapes", task.rig, lines)


def into_page(table: str, rig: str, lines: Sequence[str]) -> None:
    """Put the rows of some parts into the page's table of a rig; those of other parts stay."""
    name = table if rig == "paper" else f"{table}-{rig}"
    write(PAGE, name, replaced(figures(PAGE, name), lines, 1, PARTS))


def freeform(columns: int = 450, sigma: float = 0.02) -> Mesh:
    """A lumpy closed body of about 80 mm with noise of ``sigma`` mm: no shape anywhere."""
    turn = np.arange(columns) * 2 * np.pi / columns
    u, v = np.meshgrid(turn, np.linspace(0.02, np.pi - 0.02, columns))
    r = 40 + 8 * np.cos(3 * u) * np.sin(v) ** 3 + 4 * np.sin(5 * v)
    r += 5 * np.sin(2 * u + 1) * np.sin(v) ** 2
    X = np.stack([r * np.cos(u) * np.sin(v), r * np.sin(u) * np.sin(v), r * np.cos(v)], axis=-1)
    X = X.reshape(-1, 3) + np.random.default_rng(1).normal(0, sigma, (columns**2, 3))
    i, j = (k.ravel() for k in np.meshgrid(np.arange(columns), np.arange(columns - 1)))
    a, b = j * columns + i, j * columns + (i + 1) % columns
    c, d = a + columns, b + columns
    return Mesh(X, np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]))


def _freeform(into_page: bool) -> None:
    find_shapes(freeform(60))  # compiles
    mesh, spent = freeform(), list[float]()
    for _ in range(3):
        start = time.process_time()
        found = find_shapes(mesh)
        spent.append(time.process_time() - start)
    line = (
        f"freeform, {len(mesh.faces)} triangles: {len(found.shapes)} shapes invented, "
        f"{min(spent):.1f} to {max(spent):.1f} s of a processor in three runs, at "
        f"{commit_of_code()}"
    )
    print(line)
    if into_page:
        write(PAGE, "shapes-freeform", [line])


def main() -> None:
    """The same with another rig, kept scans, or many seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rig", default="paper")
    parser.add_argument("--calibrated", action="store_true", help="rig calibrated from pictures")
    parser.add_argument("--drawn", action="store_true", help="by corners that are drawn")
    usual = ",".join(map(str, VIEWS))
    parser.add_argument("--pictures", nargs="+", default=[usual], help="that they stand for")
    parser.add_argument("--large", action="store_true", help="the board held fills the picture")
    parser.add_argument("--seed", type=int, nargs="+", default=[1], help="each in turn")
    parser.add_argument("--seeds", type=int, help="scan each part so many times")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    parser.add_argument("--plain", action="store_true", help="the mesh as an STL holds it")
    parser.add_argument("--freeform", action="store_true", help="a dense mesh without shapes")
    args = parser.parse_args()
    if args.freeform:
        _freeform(args.write)
        return
    if args.plain and args.write:
        parser.error("the pages' rows are of scans, not of files without sigmas")
    tasks = [
        Task(
            name, args.rig, args.calibrated, seed, args.steps,
            seed if args.drawn else None, _pictures(text), args.plain, args.large,
        )
        for name in args.parts or PARTS
        for text in args.pictures
        for seed in args.seed
    ]  # fmt: skip
    with _keep.folder(args.keep) as folder:
        if args.seeds is None:
            _table(tasks, folder, args.write)
            return
        _seeds(tasks, args.seeds, folder, args.write)


def _pictures(text: str) -> tuple[int, int, int]:
    free, under, turned = map(int, text.split(","))
    return free, under, turned


def _seeds(tasks: Sequence[Task], seeds: int, folder: Path, into_pages: bool) -> None:
    """The table of many scans, or calibrations, of each part."""
    lines = list[str]()
    for task in tasks:
        head, line, *rows = repeated(task, seeds, folder)
        rows = measured(rows, f"{seeds} × {task.how}")
        more = rows if lines else [f"{head} {MEASURED} |", f"{line}---|", *rows]
        print("\n".join(more), flush=True)
        lines += more
        if into_pages:
            table = "shapes-seeds" if task.drawn is None else "shapes-drawn"
            into_page(table, task.rig, lines)


if __name__ == "__main__":
    main()
