"""What a scan costs by its size, and what a million scans a year would need.

``python -m bench sizing`` measures three sizes (``--quick``: two); ``--write`` puts the tables into
docs/explain/sizing.md. Processor time counts all cores; memory is that of a process of its own.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from bench._page import DOCS, write
from bench.scale import HEIGHT, WARM, WIDTH, Cost, make_rig, measured_apart, write_scan
from turnscan import workflows
from turnscan.formats import export
from turnscan.scan import Scan

PAGE = DOCS / "explain" / "sizing.md"
SCANS = 1_000_000
YEAR = 365.25 * 86400.0
WORKING = 2000 * 3600.0
"""s that a scanner works in a year: one shift."""
DISK = 200e6
"""Bytes a second that one hard disk reads in order; a network of 1 Gbit/s carries 120e6."""
CAPTURE = 0.1
"""s for a frame: two exposures, and a step of the table."""


@dataclass(frozen=True)
class Size:
    """A kind of scan."""

    name: str
    frames: int
    scale: float

    @property
    def pictures(self) -> str:
        """Width and height."""
        return f"{round(WIDTH * self.scale)}×{round(HEIGHT * self.scale)}"


SIZES = (
    Size("workshop", 200, 640 / WIDTH),
    Size("laboratory", 400, 1280 / WIDTH),
    Size("fine", 1600, 1.0),
)


@dataclass(frozen=True)
class Measured:
    """What a scan of a size costs."""

    size: Size
    stored: int
    """Bytes of the scan file."""
    faces: int
    costs: tuple[Cost, ...]
    files: float
    """s of processor to write DXF and STL."""
    written: int
    """Bytes of both."""

    @property
    def processor(self) -> float:
        """s of one scan, in all."""
        return sum(cost.processor for cost in self.costs) + self.files

    @property
    def peak(self) -> float:
        """MB."""
        return max(cost.peak for cost in self.costs)


def _measured(size: Size) -> Measured:
    with tempfile.TemporaryDirectory() as folder:
        path, warm = Path(folder) / "vase.turnscan", Path(folder) / "warm.turnscan"
        write_scan(warm, WARM, size.scale)
        write_scan(path, size.frames, size.scale)
        costs, faces, _ = measured_apart(path, warm, size.scale)
        files, written = _exported(path, size)
        return Measured(size, path.stat().st_size, faces, tuple(costs), files, written)


def _exported(path: Path, size: Size) -> tuple[float, int]:
    with Scan.open(path) as scan:
        mesh = workflows.reconstruct(scan, rig=make_rig(size.scale)).mesh
    for _ in range(2):  # the first one compiles
        begin = time.process_time()
        written = sum(len(export(mesh, suffix)) for suffix in (".dxf", ".stl"))
    return time.process_time() - begin, written


def costs(found: list[Measured]) -> list[str]:
    """The table of what one scan costs."""
    lines = [
        "| scan | frames | pictures | file | faces | s of processor: stripes | grids | mesh "
        "| DXF and STL | in all | ms a frame | µs a face | memory |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for m in found:
        by = {cost.name: cost.processor for cost in m.costs}
        frame, face = by["stripes"] / m.size.frames, (by["grids"] + by["mesh"]) / m.faces
        lines.append(
            f"| {m.size.name} | {m.size.frames} | {m.size.pictures} | {m.stored / 1e6:.1f} MB "
            f"| {m.faces:,} | {by['open'] + by['stripes']:.2f} | {by['grids']:.2f} "
            f"| {by['mesh']:.2f} | {m.files:.2f} | {m.processor:.1f} | {1e3 * frame:.1f} "
            f"| {1e6 * face:.1f} | {m.peak:.0f} MB |".replace(",", " ")
        )
    return lines


def projection(found: list[Measured]) -> list[str]:
    """The table of what a million scans a year need."""
    lines = [
        "| scan | scanners in one shift | cores | memory of a core's worker | scans kept | results "
        "kept | read from disk, mean | first limit |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for m in found:
        scanners = SCANS * m.size.frames * CAPTURE / WORKING
        cores = SCANS * m.processor / YEAR
        rate = SCANS * m.stored / YEAR
        per_core = m.stored / m.processor
        limit = "disk" if per_core > DISK else f"processor, to {DISK / per_core:.0f} cores a disk"
        lines.append(
            f"| {m.size.name} | {scanners:.1f} | {cores:.2f} | {m.peak / 1e3:.1f} GB "
            f"| {SCANS * m.stored / 1e12:.1f} TB | {SCANS * m.written / 1e12:.0f} TB "
            f"| {rate / 1e6:.2f} MB/s | {limit} |"
        )
    return lines


def run(quick: bool = False, into_pages: bool = False) -> None:
    """Print both tables; ``quick`` leaves the largest size out."""
    found = [_measured(size) for size in (SIZES[:2] if quick else SIZES)]
    for name, lines in (("costs", costs(found)), ("projection", projection(found))):
        print("\n".join(lines))
        if into_pages:
            write(PAGE, name, lines)
