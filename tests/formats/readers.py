"""Programs that are not ours, asked what they see in a file."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

Triangles = npt.NDArray[np.float64]
"""(f, 3, 3) corners."""


def _run(*command: str | Path) -> str:
    done = subprocess.run(
        [str(c) for c in command], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-500:]} {done.stderr[-500:]}"
    return done.stdout


def assimp(path: Path) -> Triangles:
    """Ask assimp for a binary STL, which holds the 32-bit numbers it works with as they are."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.stl"
        _run("assimp", "export", path, out, "-fstlb")
        data = out.read_bytes()
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(data, kind, offset=84)["corners"].astype(float)


def dime(path: Path) -> Triangles:
    """Ask dime for VRML, which it prints with 8 digits."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.wrl"
        _run("dxf2vrml", path, "-o", out)
        text = out.read_text()
    found = [np.empty((0, 3, 3))]
    pattern = r"point \[([^]]*)\]\s*\}\s*IndexedFaceSet \{\s*coordIndex \[([^]]*)\]"
    for points, index in re.findall(pattern, text):
        xyz = np.array(points.replace(",", " ").split(), float).reshape(-1, 3)
        for polygon in index.replace(",", " ").split("-1"):
            numbers = [int(i) for i in polygon.split()]
            found += [xyz[[numbers[0], a, b]][None] for a, b in _fan(numbers)]
    return np.concatenate(found)


def gdal(path: Path) -> Triangles:
    """Ask GDAL/OGR for its geometries as text, which it prints with 15 digits."""
    layout = ["-lco", "GEOMETRY=AS_WKT", "-lco", "SEPARATOR=SEMICOLON"]
    text = _run("ogr2ogr", "-f", "CSV", "/vsistdout/", path, *layout, "-select", "Layer")
    found = [np.empty((0, 3, 3))]
    for line in text.splitlines():
        if not re.match(r'"?(MULTI)?(POLYGON|POLYHEDRALSURFACE|TIN)', line):
            continue
        for ring in re.findall(r"\(([^()]+)\)", line):
            xyz = np.array([corner.split() for corner in ring.split(",")], float)
            corners = list(range(len(xyz) - 1))
            found += [xyz[[0, a, b]][None] for a, b in _fan(corners)]
    return np.concatenate(found)


def _fan(numbers: list[int]) -> list[tuple[int, int]]:
    return list(pairwise(numbers[1:]))


READERS: dict[str, Callable[[Path], Triangles]] = {"assimp": assimp, "dime": dime, "gdal": gdal}
"""How to ask each, by its name in `tests.needs`."""


def volume(triangles: Triangles) -> float:
    """Signed volume of a closed surface, about its own middle."""
    t = triangles - triangles.reshape(-1, 3).mean(axis=0)
    return float(np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2])) / 6.0)
