"""The box under the mouse, from real pictures: do sizes of its section agree as they say?

``python -m bench box`` calibrates the rig of ``../shared/data/turntable-mouse``, imports the
pictures of the box, and draws a section of all points and of four parts of them without a common
point: once of each fourth row, once of each other step and other row, where a corner of the box has
two or three points. Widths and corner radii stand beside what their uncertainties let them differ
by. ``python -m bench.box --rig rig.json`` takes a rig that was calibrated before, ``--drawing
box.pdf`` writes the section of all points, ``--write`` puts the table into the page.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench._page import DOCS, write
from bench.calibration.real import MOUSE
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.meshing import to_mesh
from turnscan.points import RangeGrid
from turnscan.points._build import goes_round
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import Arc, FittedSection, fit_section, plane_cut
from turnscan.workflows import CalibrationPictures, MarkerAngles, calibrate, import_pictures
from turnscan.workflows import read_rig_file as read_rig
from turnscan.workflows._solids._sections import section_file

PAGE = DOCS / "how-to" / "section.md"
HEIGHT = 15.0
"""mm over the table: of the box, which is 51 mm wide and 88 mm long."""
_ROUND = 12.0
"""mm: an arc of a larger radius is no corner."""
_PLACE = 3.0
"""mm: sizes whose middles are further apart are not the same one."""
WAYS = {
    "each fourth row": [(slice(None), slice(k, None, 4)) for k in range(4)],
    "each other step and row": [
        (slice(i, None, 2), slice(j, None, 2)) for i in range(2) for j in range(2)
    ],
}
HEAD = (
    "| size | all points, mm | four parts of them | four results, mm | worst E_n of two |",
    "|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Told:
    """A size of a section, mm."""

    name: str
    place: Floats
    value: float
    sigma: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ±{self.sigma:.2f}"


def grids_of(rig: Rig, folder: Path) -> list[RangeGrid]:
    """The box and the mouse on it as they were seen; the imported scan is kept in the folder."""
    path = folder / "mouse.turnscan"
    if not path.exists():
        import_pictures(str(MOUSE / "object"), path, MarkerAngles(), rig=rig)
    wanted = Settings()
    with Scan.open(path) as kept:
        return list(to_grids(detect_scan(kept, rig, wanted.stripes), wanted).grids)


def part_of(grid: RangeGrid, steps: slice, rows: slice) -> RangeGrid:
    """Some of the profiles, and of each some of the rows."""
    return replace(
        grid,
        steps=grid.steps[steps],
        angles=grid.angles[steps],
        points=grid.points[steps, rows],
        sigma=grid.sigma[steps, rows],
        amplitude=grid.amplitude[steps, rows],
        flags=grid.flags[steps, rows],
        closed=goes_round(grid.angles[steps]),
        eyes=None if grid.eyes is None else grid.eyes[steps],
        behind=None if grid.behind is None else grid.behind[steps, rows],
        light_doubt=None if grid.light_doubt is None else grid.light_doubt[steps, rows],
        halo=None if grid.halo is None else grid.halo[steps, rows],
    )


def section_of(grids: Sequence[RangeGrid], rig: Rig) -> FittedSection:
    """The section at the height."""
    mesh = to_mesh(grids, Settings(), rig=rig).mesh
    return fit_section(mesh, plane_cut([0.0, 0.0, 1.0], HEIGHT, f"z = {HEIGHT:g} mm"))


def sizes_of(section: FittedSection) -> list[Told]:
    """Widths between parallel sides, and radii of corners, of the largest outline."""
    outline = max(section.fitted, key=lambda o: float(np.ptp(o.box)))
    out = [
        Told("width", s.places.mean(axis=0), s.value, s.sigma)
        for s in outline.sizes
        if s.kind == "distance"
    ]
    for p in outline.pieces:
        if isinstance(p, Arc) and p.radius < _ROUND:
            out.append(Told("corner radius", p.sampled(0.1).mean(axis=0), p.radius, p.radius_sigma))
    return out


def same(size: Told, others: Sequence[Told]) -> Told | None:
    """The size of another section at the same place."""
    near = [
        o
        for o in others
        if o.name == size.name
        and np.hypot(*(o.place - size.place)) < _PLACE
        and abs(o.value - size.value) < _PLACE
    ]
    return min(near, key=lambda o: float(np.hypot(*(o.place - size.place))), default=None)


def compared(grids: Sequence[RangeGrid], rig: Rig, whole: FittedSection) -> list[str]:
    """The lines of the table."""
    out = list(HEAD)
    parts = {
        way: [sizes_of(section_of([part_of(g, *one) for g in grids], rig)) for one in some]
        for way, some in WAYS.items()
    }
    for size in sizes_of(whole):
        for way, some in parts.items():
            found = [same(size, one) for one in some]
            there = [f for f in found if f is not None]
            worst = max(
                (
                    abs(a.value - b.value) / (2 * float(np.hypot(a.sigma, b.sigma)))
                    for a, b in itertools.combinations(there, 2)
                ),
                default=None,
            )
            told = "; ".join(str(f) if f is not None else "no arc" if size.name != "width" else
                             "not parallel" for f in found)  # fmt: skip
            end = "" if worst is None else f"{worst:.2f}"
            out.append(f"| {size.name} | {size} | {way} | {told} | {end} |")
    return out


def _rig(folder: Path) -> Rig:
    """The rig, calibrated from its pictures."""
    taken = CalibrationPictures(
        str(MOUSE / "camera-boards"),
        {"laser": str(MOUSE / "laser-boards")},
        str(MOUSE / "empty-table"),
    )
    made = folder / "rig.json"
    calibrate(taken, "chessboard:8x6:40", made, markers="DICT_4X4_50:30", table_step_deg=2.25)
    return read_rig(made)


def run(into_pages: bool = False, known: Path | None = None, drawing: Path | None = None) -> None:
    """Print the table."""
    if not MOUSE.is_dir():
        print(f"no {MOUSE}: the pictures of others are not part of turnscan")
        return
    with tempfile.TemporaryDirectory() as scratch:
        rig = _rig(Path(scratch)) if known is None else read_rig(known)
        grids = grids_of(rig, Path(scratch))
    whole = section_of(grids, rig)
    lines = compared(grids, rig, whole)
    print("\n".join(lines))
    if drawing is not None:
        drawing.write_bytes(section_file([whole], drawing.suffix, "box", {}))
    if into_pages:
        write(PAGE, "box", lines)


def main() -> None:
    """The same with a rig that was calibrated before."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", type=Path, help="a rig file that was calibrated before")
    parser.add_argument("--drawing", type=Path, help="section of all points: .dxf .svg .pdf .json")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    args = parser.parse_args()
    run(args.write, args.rig, args.drawing)


if __name__ == "__main__":
    main()
