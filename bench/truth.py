"""Merged surfaces of simulated scans against the parts' own: what each way of merging keeps.

``python -m bench truth`` scans every part on both rigs, with one line and two, in coarse and in
fine steps, merges it every way; ``--quick`` takes the paper rig with 60 steps alone. ``--write``
puts each row into docs/explain/accuracy.md as it is measured, with its commit; those of what was
not measured again stay. ``python -m bench.truth --keep FOLDER`` keeps the simulated scans there and
finds them again, ``--parts mug``, ``--rigs paper``, ``--lasers 2`` and ``--steps 24 60`` take some
of those alone. ``--calibrated`` measures with a rig calibrated from pictures of a board, lays the
surface onto the part (`bench._laid`), and adds to sigma what the calibration says of itself.
``--largest-sigma 0.2 0.5`` measures each surface once more without what states more than that, as
``reconstruct`` makes it. ``--spacing-between 2deg`` measures each with profiles so far apart, too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from bench import _hole_truth as truth
from bench import _keep, _page
from bench._laid import laid
from bench._page import MEASURED
from bench._rigs import from_pictures
from bench.surface_truth import FLAT, Run, covered, places, scanned, visible
from turnscan import shapes
from turnscan.arrays import Bools, Floats
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh, cut_touching, longest_sides
from turnscan.rig import Pose, Rig, rig_from_json, rig_to_json
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import Bench, SimulationSpec, bench
from turnscan.surface.clean import drop_islands, part_uncertain
from turnscan.surface.fusion import MergeMethod, merge
from turnscan.workflows._options._reconstruct import spacing_between

PARTS = ("mug", "head", "mannequin", "bracket", "gear", "v-groove", "shaft", "grooves")
ALSO = ("hexagon", "plate")
"""Parts that are measured only where they are asked for."""
RIGS, LASERS, STEPS = ("paper", "modern"), (1, 2), (24, 60, 120, 200)
WAYS: Sequence[MergeMethod] = ("grid", "tsdf", "paste")
KNOWN = ("", ", calibrated")
"""What a rig's name has behind it where it is exactly known, and calibrated from pictures."""
HEAD = (
    "| part, rig | lines | steps | way | vertices | max mm | rms mm | rms / σ | within 1, 2, 3 σ % "
    f"| invented | complete % | {MEASURED} |",
    "|" + "---|" * 12,
)


@dataclass(frozen=True)
class Row:
    """One merged surface against the part."""

    name: str
    lasers: int
    steps: int
    way: str
    vertices: int
    worst: float
    """mm."""
    rms: float
    """mm."""
    ratio: float
    """rms of error over sigma."""
    within: tuple[float, float, float]
    """Shares within one, two, three sigma."""
    invented: int
    """Vertices further off than three sigma and half the longest side there."""
    complete: float
    """Share of what could be seen that lies within what the rig can tell of the surface."""

    def line(self) -> str:
        """For the table, but for when it was measured."""
        shares = ", ".join(f"{100 * w:.1f}" for w in self.within)
        cells = (
            self.name, str(self.lasers), str(self.steps), self.way, str(self.vertices),
            f"{self.worst:.2f}", f"{self.rms:.3f}", f"{self.ratio:.2f}", shares,
            str(self.invented), f"{100 * self.complete:.1f}",
        )  # fmt: skip
        return f"| {' | '.join(cells)} |"


def row(
    run: Run,
    name: str,
    lasers: int,
    way: str,
    mesh: Mesh,
    seen: Bools,
    common: Floats | float = 0.0,
) -> Row:
    """Hold one merged surface against the part. Raises ValueError for one without sigma.

    ``common`` (v,) mm is what the calibration says of each vertex, beside its own sigma.
    """
    p = mesh.provenance
    if p is None:
        raise ValueError("the mesh does not know its sigma")
    off = np.abs(shapes.deviation(mesh.vertices, truth.made_mesh(run.made)).distance)
    sigma = np.hypot(p.sigma, common)
    z = off / sigma
    half = longest_sides(mesh) / 2
    return Row(
        name, lasers, run.steps, way, len(off), float(off.max()),
        float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean(z**2))),
        (float((z <= 1).mean()), float((z <= 2).mean()), float((z <= 3).mean())),
        int((off > 3 * sigma + half).sum()),
        covered(mesh, places(run.made), seen, run.near),
    )  # fmt: skip


def rows(
    parts: Sequence[str],
    rigs: Sequence[str],
    lines: Sequence[int],
    steps: Sequence[int],
    folder: Path,
    calibrated: bool,
    limits: Sequence[float] = (),
    spaced: Sequence[str] = (),
) -> Iterator[Row]:
    """The table's rows, each scan simulated once, each surface again with each limit, and all of
    them with profiles ``spaced`` otherwise than they were measured."""
    for part, rig, lasers, count in product(parts, rigs, lines, steps):
        spec = SimulationSpec(part, rig, lasers=lasers, steps=count)
        made, path = scanned(spec, folder)
        ours = _calibrated(made, rig, lasers, folder) if calibrated else made.rig
        with Scan.open(path) as scan:
            seen = tuple(detect_scan(scan, ours, Settings().stripes))
        run = Run(made, count, seen)
        sees = visible(run, places(made), FLAT, lasers)
        ways = WAYS if lasers > 1 else ("paste",)
        for text in ("", *spaced):
            between = spacing_between(text) if text else None
            grids = to_grids(seen, Settings(between=between)).grids
            merged = {way: merge(grids, how=way)[0] for way in ways}
            for way, limit in product(ways, (None, *limits)):
                mesh, _, _ = part_uncertain(merged[way], limit)
                mesh, _ = cut_touching(mesh)
                mesh, _, _ = drop_islands(mesh, None, grids)
                name = f"{part}, {rig}{KNOWN[calibrated]}"
                name += f", {text} between" if text else ""
                name += "" if limit is None else f", at most {limit:g} mm"
                common: Floats | float = 0.0
                if calibrated:
                    mesh, common = laid(mesh, grids, ours, made)
                yield row(run, name, lasers, way, mesh, sees, common)


def _calibrated(made: Bench, rig: str, lasers: int, folder: Path) -> Rig:
    """A rig calibrated from pictures of a board, or the one that is in the folder, at the height at
    which it stands on this bench: the camera looks at the middle of each part, and of the board."""
    spec, path = SimulationSpec("charuco", rig, lasers=lasers), folder / f"rig-{rig}-{lasers}.json"
    if not path.exists():
        path.write_text(rig_to_json(from_pictures(spec)))
    believed = rig_from_json(path.read_text())
    ends = (bench(spec).rig.T_camera_table.translation, made.rig.T_camera_table.translation)
    lift = Pose(np.eye(3), np.array([0.0, 0.0, ends[0][1] - ends[1][1]]))
    return replace(believed, T_camera_table=believed.T_camera_table @ lift)


def run(
    quick: bool = False,
    into_pages: bool = False,
    keep: Path | None = None,
    calibrated: bool = False,
    parts: Sequence[str] = PARTS,
    rigs: Sequence[str] = RIGS,
    lasers: Sequence[int] = LASERS,
    steps: Sequence[int] = STEPS,
    limits: Sequence[float] = (),
    spaced: Sequence[str] = (),
) -> None:
    """Print every row as it is measured, and put it into the page.

    With ``limits``, mm, also without what states more sigma, and with profiles ``spaced``
    otherwise; such rows are for no page.
    """
    order = [f"{part}, {rig}{more}" for rig in RIGS for part in PARTS for more in KNOWN]
    with _keep.folder(keep) as folder:
        rigs, steps = (("paper",), (60,)) if quick else (rigs, steps)
        print("\n".join(HEAD))
        for one in rows(parts, rigs, lasers, steps, folder, calibrated, limits, spaced):
            lines = _page.measured([one.line()], KNOWN[calibrated].strip(", ") or "rig known")
            print(lines[0], flush=True)
            if into_pages:
                _page.put(_page.ACCURACY, "truth", [*HEAD, *lines], 4, order)


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the paper rig with 60 steps")
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--write", action="store_true", help="put the rows into the documents")
    parser.add_argument(
        "--parts", choices=(*PARTS, *ALSO), nargs="+", default=PARTS, help="these parts"
    )
    parser.add_argument("--calibrated", action="store_true", help="from a calibrated rig")
    parser.add_argument("--rigs", choices=RIGS, nargs="+", default=RIGS, help="these rigs")
    parser.add_argument("--lasers", type=int, nargs="+", default=LASERS, help="so many lines")
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="these steps a turn")
    parser.add_argument(
        "--largest-sigma", type=float, nargs="+", default=[], help="mm: again without what has more"
    )
    parser.add_argument(
        "--spacing-between", nargs="+", default=[], metavar="SIZE", help="2deg, 1mm: again so"
    )
    given = parser.parse_args()
    if given.write and (given.largest_sigma or given.spacing_between or {*given.parts} & {*ALSO}):
        parser.error("--write puts rows of the page's parts, as they are measured, into it")
    some = given.parts, given.rigs, given.lasers, given.steps
    more = given.largest_sigma, given.spacing_between
    run(given.quick, given.write, given.keep, given.calibrated, *some, *more)


if __name__ == "__main__":
    main()
