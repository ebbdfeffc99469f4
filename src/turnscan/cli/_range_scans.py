"""Range scans of another scanner, read from files and pasted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from turnscan.cli._input import UNITS, read_bytes
from turnscan.cli._progress import progress
from turnscan.errors import FormatError, InputError, UnsafePath
from turnscan.findings import Finding
from turnscan.pipeline import Reconstruction, Settings
from turnscan.points import RangeGrid, placements_from_conf, range_scan_from_ply
from turnscan.surface import Caps, close, drop_islands, mesh_findings, paste

_CONF_BYTES = 2**20
_PLY_BYTES = 2 * 2**30


def join_conf(source: Path, unit: str, settings: Settings) -> Reconstruction:
    """The range scans that a .conf file places, pasted into one mesh in mm.

    The scans lie beside the .conf file. Raises FormatError, InputError naming file and place.
    """
    scale = UNITS[unit]
    try:
        text = read_bytes(source, _CONF_BYTES).decode()
    except UnicodeDecodeError:
        raise FormatError(f"{source}: not a text file", hint="give the scans' .conf") from None
    placed = placements_from_conf(text, str(source), scale=scale)
    grids: list[RangeGrid] = []
    with progress("reading range scans", len(placed)) as tick:
        for name, pose in placed.items():
            if Path(name).name != name:
                raise UnsafePath(f"{source}: {name!r} is not a plain file name", hint="mend it")
            data = read_bytes(source.with_name(name), _PLY_BYTES)
            scan = range_scan_from_ply(data, name, scale=scale)
            if scan.grid is None:
                raise InputError(f"{name}: a mesh or loose points, not a grid of ranges")
            grids.append(scan.range_grid(pose))
            tick()
    whole = paste(grids, settings.tears)
    mesh, islands, faces = drop_islands(whole, settings.island)
    size = np.ptp(mesh.vertices, axis=0).max() if len(mesh.vertices) else 0.0
    points = sum(int(g.found.sum()) for g in grids)
    text = f"{points} points of {len(grids)} scans, unit {unit}: {size:.1f} mm across"
    findings = [Finding("points.range-scans", "note", text, source.name, "other units: --unit")]
    gaps = None
    if settings.caps is not None:
        mesh, gaps = close(mesh, Caps(floor=None, longest=settings.caps.longest))
    findings += mesh_findings(mesh, islands, faces, gaps)
    return Reconstruction(tuple(grids), mesh, tuple(findings))
