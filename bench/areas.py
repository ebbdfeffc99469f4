"""Areas of the simulator's ball and cup, by rigs calibrated from pictures, against the truth.

``python -m bench areas`` scans the ball of 40 mm and the cup on the paper's rig, each with eight
rigs calibrated from few pictures of a board, and from more; and with the rig known exactly.
``--quick``: two rigs; ``--write`` puts the table into the page. ``python -m bench.areas --keep
FOLDER`` keeps calibrations and scans there and finds them again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench import _keep, _page, uncertainty
from bench._rigs import from_pictures
from bench._sized_parts import Sized
from turnscan.rig import Pose, Rig, rig_from_json, rig_to_json
from turnscan.simulate import Bench, Body, bench
from turnscan.simulate import _parts as parts

ACROSS, WALL = 40.0, 3.0
"""mm: diameter of the ball, and the cup's wall."""
WANTED = 0.01
VIEWS = ((8, 8, 12), (12, 12, 16))
"""Pictures of the board: held freely, under the laser, on the table."""
HEAD = (
    "| rig | scans | area of the ball off by, median, most | that of the cup | median U of both |",
    "|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Standard(uncertainty.Task):
    """A scan of the ball or the cup, which stands upright on the axis."""

    @property
    def part(self) -> Sized:
        """What stands on the table."""
        if self.kind == "cup":
            return Sized(parts.cup(WALL))
        ball = {"sphere": (ACROSS, lambda p: np.abs(p[:, 2] - ACROSS / 2) < 0.4 * ACROSS)}
        return Sized(parts.sphere(ACROSS / 2), rounds=ball)

    def made(self) -> Bench:
        """The bench with the part on it."""
        made, part = bench(self.spec), self.part.part
        low = float(part.mesh.vertices[:, 2].min())
        place = Pose(np.eye(3), np.array([0.0, 0.0, -low]))
        body = Body(part, made.scene.bodies[0].material, place)
        return replace(made, scene=replace(made.scene, bodies=(body, *made.scene.bodies[1:])))


def believed(task: Standard, views: tuple[int, int, int], folder: Path) -> Rig:
    """The rig that so many pictures calibrated; kept in the folder."""
    path = folder / f"rig-{task.rig}-{sum(views)}.json"
    if not path.exists():
        path.write_text(rig_to_json(from_pictures(task.spec, views)))
    return rig_from_json(path.read_text())


def off(task: Standard, rig: Rig | None, folder: Path) -> tuple[float, float]:
    """By how much the area is off, and its U, as shares of it; ``rig`` None is the true one."""
    (area,) = (
        taken
        for taken in uncertainty.measured_by(task, rig, folder)
        if taken.kind == "area of the whole"
    )
    return area.error / area.true, (area.U or np.nan) / area.true


def run(quick: bool = False, into_pages: bool = False, keep: Path | None = None) -> None:
    """Print the table."""
    seeds = [uncertainty.FIRST + 5 * k for k in range(2 if quick else uncertainty.RIGS)]
    with _keep.folder(keep) as folder:
        lines = [*HEAD, *(_row(views, seeds, folder) for views in (*VIEWS, None))]
    lines += ["", f"{uncertainty.STEPS} steps, one laser; wanted: at most {WANTED:.0%}."]
    print("\n".join(lines))
    if into_pages:
        _page.write(_page.ACCURACY, "areas", lines)


def _row(views: tuple[int, int, int] | None, seeds: Sequence[int], folder: Path) -> str:
    found: dict[str, list[tuple[float, float]]] = {"sphere": [], "cup": []}
    for seed in seeds:
        for kind, of_kind in found.items():
            task = Standard(seed, seed, kind)
            rig = None if views is None else believed(task, views, folder)
            of_kind.append(off(task, rig, folder))
            error, told = of_kind[-1]
            print(f"{views or 'exact'} {seed} {kind}: {error:+.2%}, U {told:.2%}", flush=True)
    name = "known exactly" if views is None else f"calibrated from {sum(views)} pictures"
    ball, cup = (np.abs([error for error, _ in of_kind]) for of_kind in found.values())
    told = np.median([told for of_kind in found.values() for _, told in of_kind])
    sizes = " | ".join(f"{np.median(of):.2%}, {np.max(of):.2%}" for of in (ball, cup))
    return f"| {name} | {2 * len(seeds)} | {sizes} | {told:.1%} |"


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="folder of calibrations and scans")
    parser.add_argument("--quick", action="store_true", help="two rigs")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    given = parser.parse_args()
    run(given.quick, given.write, given.keep)


if __name__ == "__main__":
    main()
