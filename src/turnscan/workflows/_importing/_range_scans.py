"""Range scans of another scanner, read from files and merged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from turnscan.errors import FormatError, InputError, UnsafePath
from turnscan.findings import Finding
from turnscan.meshing import to_mesh
from turnscan.pipeline import Reconstruction
from turnscan.points import RangeGrid, placements_from_conf, range_scan_from_ply
from turnscan.progress import Progress
from turnscan.rig import Pose
from turnscan.settings import Settings
from turnscan.surface.clean import clean
from turnscan.workflows._files._reading import read_bytes
from turnscan.workflows._options._units import UNITS

_CONF_BYTES = 2**20
_PLY_BYTES = 2 * 2**30


def placed_scans(source: Path, unit: str) -> dict[Path, Pose]:
    """The range scans that a .conf file names, beside it, and where it places them (mm).

    Raises FormatError, InputError, and UnsafePath for a name that leads to another folder.
    """
    try:
        text = read_bytes(source, _CONF_BYTES).decode()
    except UnicodeDecodeError:
        raise FormatError(f"{source}: not a text file", hint="give the scans' .conf") from None
    placed = placements_from_conf(text, str(source), scale=UNITS[unit])
    for name in placed:
        if Path(name).name != name:
            raise UnsafePath(f"{source}: {name!r} is not a plain file name", hint="correct it")
    return {source.with_name(name): pose for name, pose in placed.items()}


def read_range_scan(
    path: Path, pose: Pose, unit: str, settings: Settings
) -> tuple[RangeGrid, list[Finding]]:
    """One range scan, placed and cleaned. Raises FormatError, InputError naming file and place."""
    scan = range_scan_from_ply(read_bytes(path, _PLY_BYTES), path.name, scale=UNITS[unit])
    if scan.grid is None:
        raise InputError(f"{path.name}: a mesh or unordered points, not a range grid")
    grid = scan.range_grid(pose)
    return (grid, []) if settings.clean is None else clean(grid, settings.clean)


def join_scans(
    source: Path,
    placed: Mapping[Path, Pose],
    unit: str,
    settings: Settings,
    progress: Progress,
) -> Reconstruction:
    """The range scans that ``source`` places, merged into one mesh in mm.

    Raises FormatError, InputError naming file and place.
    """
    grids: list[RangeGrid] = []
    findings: list[Finding] = []
    for path, pose in progress.subrange(0, 0.7, "reading range scans").track(list(placed.items())):
        grid, remarks = read_range_scan(path, pose, unit, settings)
        grids.append(grid)
        findings += remarks
    caps = None if settings.caps is None else replace(settings.caps, floor=None, top=None)
    told = progress.subrange(0.7, 1, "building the surface")
    made = to_mesh(grids, replace(settings, caps=caps), progress=told)
    mesh = made.mesh
    size = np.ptp(mesh.vertices, axis=0).max() if len(mesh.vertices) else 0.0
    points = sum(int(g.found.sum()) for g in grids)
    text = f"{points} points of {len(grids)} scans, unit {unit}: {size:.1f} mm across"
    about = Finding(
        "points.range-scans", "note", text, source.name, "for other units, give the unit"
    )
    said = (about, *findings, *made.findings)
    return Reconstruction(
        tuple(made.grids), mesh, said, (), made.opened, (), caps, lost=made.lost, merged=made.merged
    )
