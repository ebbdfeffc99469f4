"""Volumes of simulated parts beside the truth, and what their uncertainties are worth.

``python -m bench volumes`` scans ten parts alone, each as it stands on the table, lying, leaning,
upside down and on an edge, and closes what was not seen, as ``turnscan reconstruct --close`` does;
and four parts in two or three poses each, joined and closed, on the modern rig. ``--quick`` takes
the parts as they stand alone, and the paper rig for the joined ones. ``python -m bench.volumes
--keep FOLDER`` keeps the simulated scans there and finds them again, ``--only alone`` or ``--only
joined`` prints one table, ``--parts sphere,torus`` some parts alone, ``--write`` puts the rows of
single scans into docs/explain/accuracy.md, each with its commit; those of what was not measured
again stay.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from bench import _hole_truth as truth
from bench import _keep, _page
from bench._page import MEASURED
from bench.surface_truth import Size, scanned
from turnscan import poses, shapes
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh, components, crossings, is_closed
from turnscan.meshing import source_of, to_mesh
from turnscan.pipeline import build
from turnscan.points import RangeGrid, placed
from turnscan.rig import Pose
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import VolumeSigma
from turnscan.simulate import Bench, SimulationSpec
from turnscan.surface.fusion import RangeSurface, range_surfaces
from turnscan.surface.holes import ClosingOptions

PICKED = 1.0
"""mm: how well a place is picked by hand, in each direction."""


@dataclass(frozen=True)
class Plan:
    """How a part is scanned."""

    stands: Sequence[Mapping[str, object]]
    """How it stands in each pose (fields of `SimulationSpec`): so that, over all, every face is met
    by the sheets, which all hold the axis, at less than 75° from face-on."""
    picks: bool
    """True where nothing but points picked by hand tells how the poses lie: a ball, a ring, and a
    block whose ends only one of the poses sees."""


def _stand(
    tip: float = 0.0, lean: tuple[float, float] = (0.0, 0.0), shift: tuple[float, float] = (0, 0)
) -> Mapping[str, object]:
    a, b = lean
    return {
        "tip": math.radians(tip), "lean": (math.radians(a), math.radians(b)), "shift": shift
    }  # fmt: skip


PLANS: Mapping[str, Plan] = {
    # Rolled over, so that the poles of the one pose are on the equator of the other.
    "sphere": Plan([_stand(), _stand(tip=90)], picks=True),
    # On its rim beside the axis: the sheets go through the hole to the inside. Once each side.
    "torus": Plan(
        [_stand(tip=90, shift=(0, 30)), _stand(tip=90, lean=(0, 90), shift=(0, -30))], picks=True
    ),
    # Leaning, so that each pose sees sides, ends and bore, and knows where it lies to the others.
    "bracket": Plan(
        [
            _stand(lean=(0, -60), shift=(40, 0)),
            _stand(lean=(0, -45), shift=(35, -30)),
            _stand(lean=(0, 30), shift=(-20, 0)),
        ],
        picks=False,
    ),
    # The groove looks at the axis, from which the light comes; leaning to show both its ends.
    "v-groove": Plan(
        [_stand(lean=(-45, 0), shift=(-45, -40)), _stand(lean=(45, 0), shift=(-45, 40))],
        picks=True,
    ),
}  # fmt: skip


ALONE = (
    "sphere", "cylinder", "bracket", "cone", "torus", "hexagon", "shaft", "v-groove", "head",
    "gear",
)  # fmt: skip
STANDS: Mapping[str, Mapping[str, object]] = {
    "upright": {**_stand(shift=(4, -3)), "seed": 1},
    "lying": {**_stand(tip=90, lean=(0, 15), shift=(-6, 5)), "seed": 2},
    "leaning": {**_stand(lean=(25, -10), shift=(-3, 8)), "seed": 3},
    "upside down": {**_stand(tip=180, lean=(-20, 30), shift=(5, 6)), "seed": 4},
    "on edge": {**_stand(tip=55, lean=(10, -20), shift=(7, -2)), "seed": 5},
}
STEPS = 48
"""A turn in coarse steps, as newcomers begin, on the paper's rig."""
HEAD = (
    "| part | stands | error | u | error / u | measured ± mm³ | filled ± mm³ | not measured "
    f"| {MEASURED} |",
    "|" + "---|" * 9,
)
_RATIO = 4
"""Column of the error over its uncertainty."""


@dataclass(frozen=True)
class Alone:
    """A part scanned once and closed."""

    part: str
    stands: str
    true: float
    """mm³."""
    volume: float
    """mm³; NaN where it could not be closed soundly."""
    known: VolumeSigma | None
    filled: float
    """Share of the surface that was not measured."""

    @property
    def ratio(self) -> float:
        """Error over its uncertainty; NaN where there is no volume."""
        total = math.nan if self.known is None else self.known.total
        return (self.volume - self.true) / total

    def line(self) -> str:
        """For the table."""
        k = self.known
        if k is None:
            return f"| {self.part} | {self.stands} | stays open | | | | | {self.filled:.0%} |"
        off = (self.volume - self.true) / self.true
        return (
            f"| {self.part} | {self.stands} | {off:+.2%} | {k.total / self.true:.2%} | "
            f"{abs(self.ratio):.2f} | {self.volume - k.added:.0f} ± {k.measured:.0f} | "
            f"{k.added:+.0f} ± {k.unmeasured:.0f} | {self.filled:.0%} |"
        )


def alone(scene: str, stands: str, folder: Path) -> Alone:
    """Scan a part once, close it, and weigh its volume as ``turnscan reconstruct --close`` does."""
    spec = SimulationSpec(scene, "paper", lasers=2, steps=STEPS, **STANDS[stands])  # type: ignore
    made, path = scanned(spec, folder)
    s = Settings(caps=ClosingOptions())
    with Scan.open(path) as scan:
        done = build(tuple(detect_scan(scan, made.rig, s.stripes)), s)
    mesh, true = done.mesh, truth.made_mesh(made).volume
    filled = 0.0 if mesh.measured is None else 1 - mesh.area_of(mesh.measured) / mesh.area_of()
    if not is_closed(mesh):
        return Alone(scene, stands, true, math.nan, None, filled)
    known = shapes.volume_sigma(mesh, source_of(done.grids, made.rig, done.merged))
    return Alone(scene, stands, true, mesh.volume, known, filled)


def said(rows: Sequence[str]) -> str:
    """What all single scans of a table's rows come to."""
    told = [_page.cells(row)[_RATIO] for row in rows]
    ratios = np.array([float(cell) for cell in told if cell])
    usual = float(np.median(1 / np.maximum(ratios, 0.005)))
    return (
        f"Of {len(rows)} scans {len(ratios)} could be closed; {np.mean(ratios <= 2):.0%} of their "
        f"volumes are right within 2 u (wanted: 95 %), and the usual u is "
        f"{usual:.1f} errors wide (wanted: 4 at most)."
    )


def singles(
    stands: Sequence[str], folder: Path, scenes: Sequence[str], into_pages: bool = False
) -> None:
    """The table of single scans."""
    print("\n".join(HEAD))
    rows = list[str]()
    for how, scene in product(stands, scenes):
        rows += _page.measured([alone(scene, how, folder).line()], "rig known")
        print(rows[-1], flush=True)
    print(said(rows))
    if into_pages:
        old = _page.figures(_page.ACCURACY, "volumes")
        table = _page.replaced(old, [*HEAD, *rows], 2, ALONE)
        order = list(STANDS)
        place = {
            row: (ALONE.index(_page.cells(row)[0]), order.index(_page.cells(row)[1]))
            for row in table[2:]
        }
        table[2:] = sorted(table[2:], key=lambda row: place[row])
        _page.write(_page.ACCURACY, "volumes", [*table, "", said(table[2:])])


@dataclass(frozen=True)
class Joined:
    """A part joined from its poses."""

    made: Bench
    """Of the first pose, whose frame counts."""
    found: poses.Alignment
    profiles: Sequence[RangeSurface]
    grids: Sequence[RangeGrid]
    closed: Mesh
    merged: Mesh
    """Before it was closed."""


def joined(scene: str, size: Size, folder: Path, seed: int = 0) -> Joined:
    """Scan, bring together, merge and close a part, as ``turnscan join --close`` does."""
    plan, s = PLANS[scene], Settings(caps=ClosingOptions(floor=None, top=None))
    benches, grids = list[Bench](), list[list[RangeGrid]]()
    for how in plan.stands:
        spec = SimulationSpec(scene=scene, rig=size.rig, lasers=2, steps=size.steps, **how)  # type: ignore
        made, path = scanned(spec, folder)
        with Scan.open(path) as scan:
            grids.append(to_grids(detect_scan(scan, made.rig, s.stripes), s)[0])
        benches.append(made)
    names = [f"pose {k + 1}" for k in range(len(grids))]
    parts = [[r for g in gs for r in range_surfaces(g, s.tears)] for gs in grids]
    views = [poses.view(n, rs) for n, rs in zip(names, parts, strict=True)]
    starts = picked(benches, names, seed) if plan.picks else poses.place(views)
    found = poses.align(views, starts)
    poses.check(found, by_shape=not plan.picks)
    pairs = zip(names, grids, found.poses, strict=True)
    merged = to_mesh([placed(g, p, f"{n} {g.laser}") for n, gs, p in pairs for g in gs], s)
    profiles = [r for rs in parts for r in rs]
    return Joined(benches[0], found, profiles, merged.grids, merged.mesh, merged.merged)


def picked(benches: Sequence[Bench], names: Sequence[str], seed: int) -> list[Pose]:
    """Where four places of the part, picked by hand in each pose, put the poses."""
    rng = np.random.default_rng(seed)
    v = benches[0].scene.bodies[0].part.mesh.vertices
    four = v[[int(np.argmax(v @ d)) for d in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]]
    known = {
        f"place {k}": {
            n: b.scene.bodies[0].T_table_part.apply(x) + rng.normal(0.0, PICKED, 3)
            for n, b in zip(names, benches, strict=True)
        }
        for k, x in enumerate(four)
    }
    return poses.from_landmarks(names, known)


def sheet_sigma(made: Bench, mesh: Mesh) -> float:
    """mm³: what the thickness of the light does, common to all points.

    A sheet of rms thickness σ shows a surface of curvature k lower by 3/2 σ²k
    (docs/explain/accuracy.md). Over all of it that is 3/2 σ² times the integral of the mean
    curvature, half the sum of length times angle over the sides (Steiner), edges included.
    """
    thick = max(b.waist for b in made.beams) / 2
    return 1.5 * thick**2 * abs(shapes.mean_curvature(mesh))


def figures(scene: str, size: Size, folder: Path) -> float:
    """Print a part's volume and its uncertainty; the error over it."""
    start = time.process_time()
    done = joined(scene, size, folder)
    mesh, true = done.closed, truth.made_mesh(done.made).volume
    moves = poses.pose_moves(done.found, mesh)
    known = shapes.volume_sigma(
        mesh,
        shapes.Source(done.grids, None, done.profiles, moves, surface=done.merged),
    )
    parts = {
        "noise": known.noise,
        "edges": known.alike,
        "poses": known.shared,
        "between the profiles": known.profiles,
        "between the vertices": known.between,
        "filled": known.filled,
        "points beside it": known.passed,
        "sheet": sheet_sigma(done.made, mesh),
    }
    u = math.sqrt(sum(v * v for v in parts.values()))
    off = mesh.volume - true
    sound = "watertight" if is_closed(mesh) else "OPEN"
    crossing, pieces = len(crossings(mesh)), len(np.unique(components(mesh)))
    print(
        f"{scene}, {size.rig} (true rig), {len(PLANS[scene].stands)} poses of {size.steps} steps "
        f"({time.process_time() - start:.0f} s of a core): {sound}, {pieces} piece(s), {crossing} "
        f"faces cut through others\n  volume {mesh.volume:.0f} mm³, true {true:.0f}: "
        f"{off / true:+.2%}; u {u:.0f} mm³ ({u / true:.2%}), error {abs(off) / u:.2f} u (wanted: "
        f"2 at most)\n  u: " + ", ".join(f"{k} {v:.0f}" for k, v in parts.items()),
        flush=True,
    )
    return off / u


def volumes(size: Size, folder: Path, scenes: Sequence[str] = tuple(PLANS)) -> None:
    """All parts; that u is not too wide is seen where all errors stay below half of it."""
    ratios = [abs(figures(scene, size, folder)) for scene in scenes]
    print(
        f"volumes, {size.rig} (true rig): errors {min(ratios):.2f} to {max(ratios):.2f} u, rms "
        f"{math.sqrt(sum(r * r for r in ratios) / len(ratios)):.2f} u (honest: 0.3 to 2)"
    )


def run(
    quick: bool = False,
    keep: Path | None = None,
    scenes: Sequence[str] = (),
    only: str = "",
    into_pages: bool = False,
) -> None:
    """Print all figures."""
    with _keep.folder(keep) as folder:
        if only != "joined":
            stands = list(STANDS)[:1] if quick else list(STANDS)
            singles(stands, folder, scenes or ALONE, into_pages)
        if only != "alone":
            size = Size("paper", 100) if quick else Size("modern", 80)
            volumes(size, folder, [s for s in scenes or PLANS if s in PLANS])


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="parts as they stand; the paper rig")
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--only", choices=("alone", "joined"), default="", help="one table")
    parser.add_argument("--parts", default="", help="parts, with commas between them")
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    given = parser.parse_args()
    scenes = [part for part in given.parts.split(",") if part]
    run(given.quick, given.keep, scenes, given.only, given.write)


if __name__ == "__main__":
    main()
