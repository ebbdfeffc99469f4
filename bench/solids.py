"""Solids of simulated scans: whether STEP holds one, whether it is valid, and its volume.

``python -m bench solids`` scans eight parts, some as they stand and some leaning so that their
level faces are seen, on the paper's rig and the modern one, with one laser and with two; closes
them as ``turnscan reconstruct --close`` does, finds shapes, writes them as ``turnscan shapes … -o
x.step`` does, and reads that back. ``--quick`` takes two parts. ``python -m bench.solids --keep
FOLDER`` keeps the simulated scans there and finds them again, ``--parts cup,hexagon`` takes some
parts alone, ``--rig paper`` one rig, ``--write`` puts their rows into the page, each with the
commit that it is of, and leaves those of other scans.

The volume of a solid is compared with that of the mesh, and with the true one. The closing lays a
lid over the opening of a mug or a cup, so that their solid is a filled vessel: no drawing gives its
volume, and the true one is left out. Faces of a swept profile are counted with the B-splines, as
their profile is one.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench import _hole_truth as truth
from bench import _keep
from bench._page import DOCS, MEASURED, cells, figures, measured, replaced, write
from bench.surface_truth import scanned
from turnscan import workflows as w
from turnscan.drawings import read_step
from turnscan.mesh import is_closed
from turnscan.simulate import SimulationSpec

PAGE = DOCS / "how-to" / "shapes.md"
_SURE = 2.0
"""Standard uncertainties that a volume may be off."""
HEAD = (
    "| part | rig, lasers | mesh | STEP | faces: shapes, B-splines, triangles | volume off the "
    "mesh | off the truth | off the truth / u | points off it, rms µm | s of a core "
    f"| {MEASURED} |",
    "|---|---|---|---|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Case:
    """How a part is scanned."""

    part: str
    rig: str = "paper"
    lasers: int = 1
    steps: int = 100
    stands: dict[str, Any] = field(default_factory=dict)
    lid: bool = False
    """Whether closing lays a lid over it: then the true volume is not that of the closed mesh."""

    @property
    def request(self) -> SimulationSpec:
        """What the simulator is asked for."""
        return SimulationSpec(
            self.part, self.rig, lasers=self.lasers, steps=self.steps, **self.stands
        )


def _leaning(x: float, y: float, shift: tuple[float, float] = (0.0, 0.0)) -> dict[str, Any]:
    return {"lean": (math.radians(x), math.radians(y)), "shift": shift}


CASES = (
    Case("bracket", stands=_leaning(25, -10, (-3, 8))),
    Case("hexagon"),
    Case("hexagon", lasers=2, stands=_leaning(35, 0)),
    Case("gear", lasers=2, stands=_leaning(35, 0)),
    Case("shaft", lasers=2, stands=_leaning(35, 0)),
    Case("mug", lasers=2, lid=True),
    Case("cup", lasers=2, lid=True),
    Case("v-groove", lasers=2),
    Case("head", lasers=2),
    Case("hexagon", "modern", 1, 60, _leaning(35, 0)),
    Case("cup", "modern", 2, 60, lid=True),
    Case("bracket", "modern", 2, 60, _leaning(35, 0)),
)
ORDER = tuple(dict.fromkeys(case.part for case in CASES))


@dataclass(frozen=True)
class Row:
    """What became of a scan."""

    case: Case
    closed: bool
    """The mesh."""
    solids: int
    valid: bool
    made_of: str
    off_mesh: float
    """Share of the mesh's volume; NaN where the mesh is open, or there is no solid."""
    off: float
    """Share of the true volume; NaN where there is no solid, or the closing laid a lid over it."""
    ratio: float
    """The same in standard uncertainties."""
    rms: float
    """mm: measured points to the faces that are not triangles."""
    seconds: float

    def line(self) -> str:
        """For the table."""
        c = self.case
        how = f"{c.rig}, {c.lasers}{', leaning' if c.stands else ''}"
        what = "triangles" if self.made_of == "" else "shell"
        if self.solids:
            what = f"{self.solids} solid{'s' if self.solids > 1 else ''}"
        what += f", {'valid' if self.valid else 'NOT VALID'}"
        mesh = "closed" if self.closed else "open"
        said = (
            _figure(self.off_mesh, "+.2%"), _figure(self.off, "+.2%"), _figure(self.ratio, "+.2f"),
            _figure(1e3 * self.rms, ".0f"), f"{self.seconds:.0f}",
        )  # fmt: skip
        row = f"| {c.part} | {how} | {mesh} | {what} | {self.made_of} | {' | '.join(said)} |"
        return measured([row], f"{c.steps} steps")[0]


def _figure(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else ""


def row(case: Case, folder: Path) -> Row:
    """Scan a part, and write its solid."""
    made, path = scanned(case.request, folder)
    surface = w.reconstruct(path, close=True, store=False)
    found = w.find_shapes(surface)
    start = time.process_time()
    step = found.step
    spent = time.process_time() - start
    back = read_step(step.data, found.found.tolerance)
    mesh, true = found.mesh, math.nan if case.lid else truth.made_mesh(made).volume
    volume = back.volume if back.solids else math.nan
    closed = is_closed(mesh)
    u = math.nan if step.volume is None else step.volume.sigma
    of = step.figures
    made_of = ""
    if step.made is not None:
        splines = of.get("faces_bspline", 0) + of.get("faces_swept", 0)
        flat = of.get("faces_triangles", 0)
        made_of = f"{of['faces'] - splines - flat}, {splines}, {flat}"
    rms = of.get("deviation_rms_mm")
    return Row(
        case, closed, back.solids, back.valid, made_of,
        volume / mesh.volume - 1 if closed else math.nan, volume / true - 1, (volume - true) / u,
        math.nan if rms is None else rms, spent,
    )  # fmt: skip


def summary(lines: Sequence[str]) -> str:
    """How many of the scans in a table became solids, and how many volumes are right."""
    rows = [cells(line) for line in lines]
    valid = [r for r in rows if "NOT VALID" not in r[3]]
    made = [r for r in valid if "solid" in r[3]]
    shells = sum(r[3].startswith("shell") for r in valid)
    known = [float(r[7]) for r in made if r[7]]
    near = [ratio for ratio in known if abs(ratio) <= _SURE]
    return (
        f"Of {len(rows)} scans {sum(r[2] == 'closed' for r in rows)} had a closed mesh. "
        f"{len(made)} became valid solids, {shells} valid shells, "
        f"{sum(not r[4] for r in rows)} triangles alone. "
        f"{len(near)} of {len(known)} volumes are right within {_SURE:.0f} u."
    )


def solids(cases: Sequence[Case], folder: Path, into_pages: bool = False) -> None:
    """Print the lines of the table, and put each into the page as soon as it is known."""
    print("\n".join(HEAD))
    lines = list[str]()
    for case in cases:
        lines.append(row(case, folder).line())
        print(lines[-1], flush=True)
        if into_pages:
            table = replaced(figures(PAGE, "solids"), [*HEAD, *lines], 2, ORDER)
            write(PAGE, "solids", [*table, *_said(table[2:])])
    print("\n".join(_said(lines)))


def _said(lines: Sequence[str]) -> list[str]:
    """What stands under the rows of a table."""
    return [
        "",
        summary(lines),
        "u is the standard uncertainty of the solid's volume, by its shapes, the rest of the "
        "surface, and what was filled. The mesh of a mug or a cup has a lid, so it is compared "
        "with no true volume.",
    ]


def run(quick: bool = False, into_pages: bool = False) -> None:
    """All parts."""
    with _keep.folder(None) as folder:
        solids(CASES[:2] if quick else CASES, folder, into_pages)


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--parts", default="", help="parts, with commas between them")
    parser.add_argument("--rig", default="", help="this rig alone: paper or modern")
    parser.add_argument("--write", action="store_true", help="put their rows into the page")
    args = parser.parse_args()
    wanted = [
        c
        for c in CASES
        if c.part in (args.parts or c.part).split(",") and c.rig == (args.rig or c.rig)
    ]
    if not wanted:
        parser.error("no scan is of these parts on this rig")
    with _keep.folder(args.keep) as folder:
        solids(wanted, folder, args.write)


if __name__ == "__main__":
    main()
