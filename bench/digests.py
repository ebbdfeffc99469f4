"""Digests of results, so that two commits are compared to the last digit.

``python -m bench digests [scans] [accuracy]`` prints a line for each result; run it at both commits
on one machine, and ``diff`` shows what differs. ``scans``: simulated scans at several settings;
pictures, points and mesh have a digest each, so that the first stage that differs is seen.
``accuracy``: the figures of ``python -m bench.accuracy`` with all their digits, times apart.
``--quick`` takes the first scan and the first two rows.
"""

from __future__ import annotations

import hashlib
import platform
import tempfile
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from bench.accuracy import SHORT, measure
from turnscan.scan import Scan
from turnscan.workflows import ReconstructOptions, SimulateOptions, reconstruct, simulate

PARTS = ("scans", "accuracy")
"""Words that may follow the name of this benchmark."""

SCANS: dict[str, dict[str, Any]] = {
    "cup": {"lasers": 1, "steps": 60},
    "head": {"lasers": 2, "steps": 60},
    "bracket": {"lasers": 1, "steps": 60},
}
"""Parts of the simulator, and how they are scanned."""

SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "gauss3, nearest": {"strategy": "gauss3", "choose": "nearest"},
    "blais-rioux": {"strategy": "blais-rioux", "every": 2},
    "arc spacing": {"spacing": 1.0, "spacing_by": "arc"},
    "denoise, outliers": {"denoise": 2.0, "outliers": 8.0},
    "voxels": {"merge": "tsdf", "voxel": 2.0},
    "close": {"close": True},
    "close, decimate": {"close": True, "decimate": "0.05mm"},
}
"""Options of a reconstruction by a name for the table."""

TIMED = ("detect s", "all s", "GB")
"""Figures of the accuracy table that differ from run to run."""


def digest(arrays: Iterable[np.ndarray[Any, Any]]) -> str:
    """Eight digits that change with any bit, shape or type of these arrays."""
    made = hashlib.sha256()
    for a in arrays:
        made.update(f"{a.shape} {a.dtype.str} ".encode())
        made.update(np.ascontiguousarray(a).tobytes())
    return made.hexdigest()[:8]


def _pictures(path: Path) -> str:
    with Scan.open(path) as scan:
        pictures = [p for f in scan.frames() for p in (f.lit, f.dark) if p is not None]
    return f"{len(pictures)} pictures {digest(pictures)}"


def _surface(path: Path, changes: dict[str, Any]) -> str:
    done = reconstruct(path, ReconstructOptions(**changes))
    mesh, codes = done.mesh, sorted(f.code for f in done.findings)
    points = [a for g in done.grids for a in (g.points[g.found], g.sigma[g.found])]
    count = sum(int(g.found.sum()) for g in done.grids)
    sigma = "-" if mesh.provenance is None else digest([mesh.provenance.sigma])
    return (
        f"{count} points {digest(points)}, "
        f"{len(mesh.vertices)} vertices {digest([mesh.vertices])}, "
        f"{len(mesh.faces)} faces {digest([mesh.faces])}, sigma {sigma}, "
        f"findings {' '.join(codes) or 'none'}"
    )


def _scans(quick: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for part in list(SCANS)[: 1 if quick else None]:
            path = Path(folder) / f"{part}.turnscan"
            simulate(part, path, SimulateOptions(**SCANS[part]))
            print(f"{part}: {_pictures(path)}", flush=True)
            for name, changes in SETTINGS.items():
                print(f"{part}, {name}: {_surface(path, changes)}", flush=True)


def _accuracy(quick: bool) -> None:
    for case in SHORT[: 2 if quick else None]:
        row = measure(case, 1)
        for name in TIMED:
            row.pop(name, None)
        print(f"{case.name}, {case.part}:", flush=True)
        for name, value in row.items():
            print(f"  {name} = {float(value)!r}", flush=True)


def run(quick: bool = False, parts: Sequence[str] = ()) -> None:
    """Print what the results rest on, and a line for each result."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy"))
    print(f"{platform.machine()}, Python {platform.python_version()}, {libraries}")
    for part in parts or PARTS:
        {"scans": _scans, "accuracy": _accuracy}[part](quick)
