"""Stated uncertainty of every measure of the Inspect room, held against the truth.

``python -m bench uncertainty`` scans parts of sizes drawn at random with a rig calibrated from
pictures, takes every measure as the Inspect room does, and prints how often the error is within the
stated U (k = 2), for each kind of measure and in all. ``--quick``: one rig and its parts;
``--write`` puts the table into the page. ``python -m bench.uncertainty --scans 40 --rigs 8 --keep
FOLDER`` keeps the calibrations and scans there and finds them again; ``--first 900`` takes other
seeds; ``--true-rig`` leaves the calibration out; ``--each`` prints every measure.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench import _keep, _page
from bench._measures import Taken, taken_on
from bench._rigs import from_pictures
from bench._sized_parts import KINDS, Sized, drawn
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.meshing import source_of, to_mesh
from turnscan.rig import Pose, Rig, rig_from_json, rig_to_json, rotation_from_vector
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import (
    Bench,
    Body,
    SimCamera,
    SimLasers,
    SimTurntable,
    Simulated,
    SimulationSpec,
    World,
    bench,
    check_view,
)
from turnscan.surface.holes import ClosingOptions
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file

SCANS, RIGS, FIRST, STEPS = 40, 8, 7001, 48
"""Scans, rigs calibrated for them, the first seed (no rule was made with it or those after it), and
table positions in a turn."""
RIG = "paper"
LEAN, SHIFT = math.radians(8.0), 6.0
"""By how much a part leans and stands beside the axis at most; half of them stand upright."""
HEAD = (
    "| measure | taken | error ≤ U | median error / U | median U |",
    "|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Task:
    """One scan."""

    number: int
    rig: int
    """Seed of the calibration that it is measured with."""
    kind: str
    steps: int = STEPS

    @property
    def part(self) -> Sized:
        """What stands on the table."""
        return drawn(self.kind, np.random.default_rng((self.number, 1)))

    @property
    def spec(self) -> SimulationSpec:
        """The bench, set up for a part of 80 mm: all parts are scanned with one rig."""
        return SimulationSpec("cylinder", RIG, lasers=1, seed=self.number, steps=self.steps)

    def made(self) -> Bench:
        """The bench with the part on it."""
        rng = np.random.default_rng((self.number, 2))
        upright = rng.random() < 0.5
        turn = rotation_from_vector(np.append(rng.uniform(-LEAN, LEAN, 2) * (not upright), 0.0))
        shift = rng.uniform(-SHIFT, SHIFT, 2)
        made, part = bench(self.spec), self.part.part
        low = float((part.mesh.vertices @ turn.T)[:, 2].min())
        first = made.scene.bodies[0]
        body = Body(part, first.material, Pose(turn, np.append(shift, -low)))
        out = replace(made, scene=replace(made.scene, bodies=(body, *made.scene.bodies[1:])))
        check_view(out)
        return out


@dataclass(frozen=True)
class Way:
    """How the scans are made and measured."""

    true_rig: bool = False
    """With the rig known exactly; else calibrated from pictures."""
    each: bool = False
    """Print every measure."""


def tasks(scans: int = SCANS, rigs: int = RIGS, first: int = FIRST) -> list[Task]:
    """Scans of all kinds of parts in turn, shared evenly between the rigs.

    A rig has the seed of the first scan that it measures.
    """
    each = -(-scans // rigs)
    return [Task(first + k, first + k // each * each, KINDS[k % len(KINDS)]) for k in range(scans)]


def believed(task: Task, folder: Path) -> Rig:
    """The rig that pictures calibrated; kept in the folder."""
    path = folder / f"rig-{RIG}-{task.rig}.json"
    if not path.exists():
        path.write_text(rig_to_json(from_pictures(replace(task.spec, seed=task.rig))))
    return rig_from_json(path.read_text())


def scanned(task: Task, made: Bench, folder: Path) -> Path:
    """The scan; kept in the folder."""
    path = folder / f"{task.kind}-{task.number}-{task.steps}.turnscan"
    if not path.exists():
        world = World(made)
        devices = Simulated(
            task.spec, world, SimCamera(world), SimTurntable(world), SimLasers(world)
        )
        scan_into_file(devices, plan_of(devices), path, "sparse")
    return path


def measured(task: Task, folder: Path, way: Way) -> list[Taken]:
    """Every measure of a scan, with its truth."""
    return measured_by(task, None if way.true_rig else believed(task, folder), folder)


def measured_by(task: Task, believed: Rig | None, folder: Path) -> list[Taken]:
    """Every measure of a scan by this rig, with its truth; None is the true rig."""
    made = task.made()
    rig = believed or made.rig
    s = Settings(caps=ClosingOptions())
    with Scan.open(scanned(task, made, folder)) as scan:
        grids = to_grids(detect_scan(scan, rig, s.stripes), s).grids
    mesh = to_mesh(grids, s, rig=rig).mesh
    body = made.scene.bodies[0]
    guess = body.T_table_part.inverse() @ made.rig.T_camera_table.inverse() @ rig.T_camera_table
    rng = np.random.default_rng((task.number, 3))
    return taken_on(
        mesh, source_of(grids, rig), task.part, guess, rng, aligned=believed is not None
    )


def table(found: Sequence[Taken]) -> list[str]:
    """A line for each kind of measure, and one for all."""
    kinds = list(dict.fromkeys(t.kind for t in found))
    each = [_row(kind, [t for t in found if t.kind == kind]) for kind in sorted(kinds)]
    return [*HEAD, *each, _row("**all**", found, unit="")]


def _row(name: str, found: Sequence[Taken], unit: str | None = None) -> str:
    known = [t for t in found if t.U is not None]
    ratio = np.array([abs(t.error) / t.U for t in known if t.U])
    if not len(ratio):
        return f"| {name} | {len(found)} | no U | | |"
    u = np.median([t.U for t in known if t.U])
    wide = f"{u:.3g} {found[0].unit}" if unit is None else ""
    share = f"{np.mean(ratio <= 1):.1%}"
    return f"| {name} | {len(ratio)} | {share} | {np.median(ratio):.2f} | {wide} |"


def run(quick: bool = False, into_pages: bool = False) -> None:
    """Print the table."""
    with _keep.folder(None) as folder:
        todo = tasks(len(KINDS), 1) if quick else tasks()
        _print(todo, folder, into_pages=into_pages)


def _print(todo: Sequence[Task], folder: Path, way: Way = Way(), into_pages: bool = False) -> None:
    found, areas = list[Taken](), list[float]()
    for task in todo:
        more = measured(task, folder, way)
        found += more
        areas += [t.error / t.true for t in more if t.kind == "area of the whole"]
        out = Counter(t.kind for t in more if t.U is not None and abs(t.error) > t.U)
        beyond = ", ".join(f"{k} {n}" for k, n in out.items()) or "none"
        print(f"{task.kind} {task.number}: {len(more)} measures, beyond U: {beyond}", flush=True)
        if way.each:
            print("\n".join(f"  {t}" for t in more), flush=True)
    worst = max(map(abs, areas), default=math.nan)
    said = (
        f"{len(todo)} scans of {len({t.kind for t in todo})} kinds of parts in sizes drawn at "
        f"random, {todo[0].steps} steps, the {RIG} rig, "
        + (
            "known exactly"
            if way.true_rig
            else f"calibrated from pictures (calibrations: {len({t.rig for t in todo})})"
        )
        + f"; wanted: 93 to 97 % within U. Areas of whole parts are off by {worst:.2%} at most."
    )
    lines = [*table(found), "", said]
    print("\n".join(lines))
    if into_pages:
        _page.write(_page.ACCURACY, "uncertainty", lines)


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=SCANS)
    parser.add_argument("--rigs", type=int, default=RIGS, help="how many calibrations they share")
    parser.add_argument("--first", type=int, default=FIRST, help="the first seed")
    parser.add_argument("--steps", type=int, default=STEPS, help="table positions in a turn")
    parser.add_argument("--keep", type=Path, help="folder of calibrations and scans")
    parser.add_argument("--true-rig", action="store_true", help="the rig known exactly")
    parser.add_argument("--each", action="store_true", help="print every measure")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    given = parser.parse_args()
    todo = [replace(t, steps=given.steps) for t in tasks(given.scans, given.rigs, given.first)]
    with _keep.folder(given.keep) as folder:
        way = Way(given.true_rig, given.each)
        _print(todo, folder, way, given.write)


if __name__ == "__main__":
    main()
