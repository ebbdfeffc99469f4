"""Shapes of simulated scans against the truth: dimensions, edges, what is missed and invented.

``python -m bench shapes`` scans parts with the paper's rig, known exactly, at 1.8° (``--quick``:
two of them); ``python -m bench shapes hexagon shaft`` some alone; ``--write`` puts the table into
the page. ``python -m bench.shapes --rig modern --calibrated`` takes another rig, or one calibrated
from pictures, and then the calibration's uncertainty counts, too.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bench._page import DOCS, write
from bench._rigs import known_rig
from bench.accuracy import NEAR_EDGE, Case, scan
from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.meshing import source_of, to_mesh
from turnscan.rig import Pose, rotation_from_vector
from turnscan.settings import Settings
from turnscan.shapes import calibration_moves
from turnscan.shapes.primitives import (
    ShapeSet,
    ShapeSize,
    find_edges,
    find_shapes,
    sharpened,
    sizes_between,
)
from turnscan.shapes.primitives._edges import normals_and_distances
from turnscan.simulate import Part, bench, seconds_of

PAGE = DOCS / "how-to" / "shapes.md"
PARTS = ("hexagon", "shaft", "bracket", "grooves", "torus", "gear")
STEPS = 200
_ALIKE = 0.05
"""Of a true size (at least 0.5 mm): a measured one further off is not it."""
_LOOSE = 0.05
"""mm: scatter beyond which a point has less say in the alignment."""


@dataclass(frozen=True)
class Truth:
    """A size that a part has; angles in degrees."""

    name: str
    kind: str
    value: float
    times: int = 1
    """How often the part has it."""


TRUTHS: dict[str, tuple[Truth, ...]] = {
    "hexagon": (
        Truth("across flats", "distance", 40.0, 3),
        Truth("boss ⌀", "diameter", 24.0),
        Truth("angle of sides", "angle", 60.0, 6),
    ),
    "shaft": (
        Truth("low ⌀", "diameter", 50.0),
        Truth("middle ⌀", "diameter", 36.0),
        Truth("high ⌀", "diameter", 24.0),
        Truth("axis to floor of keyway", "axis to plane", 14.0),
    ),
    "bracket": (
        Truth("hole ⌀", "diameter", 24.0),
        Truth("wall", "distance", 10.0),
        Truth("width", "distance", 60.0),
        Truth("depth of foot", "distance", 40.0),
    ),
    "grooves": (Truth("depth", "distance", 1.0), Truth("width", "distance", 60.0)),
    "torus": (
        Truth("ring ⌀", "diameter", 60.0),
        Truth("tube ⌀", "tube diameter", 20.0),
    ),
    "gear": (Truth("hub ⌀", "diameter", 24.0), Truth("tip ⌀", "diameter", 66.0)),
}
HEAD = (
    "| part | size | true | measured | ± | error µm | E_n |",
    "|---|---|---|---|---|---|---|",
)


def measured_part(name: str, rig: str, calibrated: bool, seed: int) -> list[str]:
    """The lines of a part in the table, and what else there is to say of it, after a scan."""
    case = Case(rig, name, STEPS, knowledge="calibrated" if calibrated else "exact")
    wish = case.wish(seed)
    made = bench(wish)
    believed = known_rig(made, wish, case.knowledge) or made.rig
    real = scan(made, seconds_of(wish), STEPS, believed)
    grids = [real.grid]
    mesh = to_mesh(grids, Settings(), rig=believed).mesh
    moves = list(calibration_moves(mesh, source_of(grids, believed))) if calibrated else []
    start = time.process_time()
    found = find_shapes(mesh, moves=moves)
    sizes = sizes_between(mesh, found)
    spent = time.process_time() - start
    body = made.scene.bodies[0]
    true_frame = made.rig.T_camera_table.inverse() @ believed.T_camera_table
    place = _aligned(mesh, found, body.part, body.T_table_part.inverse() @ true_frame)
    lines = [line for t in TRUTHS[name] for line in _lines(name, t, sizes)]
    return [*lines, *_edge_line(name, mesh, found, body.part, place), _rest(name, found, mesh,
            body.part, place, spent)]  # fmt: skip


def _lines(name: str, truth: Truth, sizes: Sequence[ShapeSize]) -> list[str]:
    """A true size beside the measured ones nearest to it."""
    unit = 180 / math.pi if "angle" in truth.kind else 1.0
    near = sorted(
        (abs(s.value * unit - truth.value), s.value * unit, s.sigma * unit)
        for s in sizes
        if s.kind == truth.kind
    )
    near = [n for n in near if n[0] <= max(_ALIKE * truth.value, 0.5)][: truth.times]
    many = f" × {truth.times}" if truth.times > 1 else ""
    what = f"| {name} | {truth.name}{many} | {truth.value:g}{'°' if unit != 1 else ''}"
    if len(near) < truth.times:
        return [f"{what} | {len(near)} found | | | |"]
    off, value, sigma = near[-1]  # the worst
    error = (
        f"{60 * (value - truth.value):+.2f}′"
        if unit != 1
        else f"{1e3 * (value - truth.value):+.1f}"
    )
    return [f"{what} | {value:.4f} | {sigma:.4f} | {error} | {off / (2 * sigma):.2f} |"]


def _aligned(mesh: Mesh, found: ShapeSet, part: Part, base: Pose) -> Pose:
    """Where the part is: what a calibration does not know is where the table's zero lies."""
    X = base.apply(mesh.vertices[found.used][:: max(1, int(found.used.sum()) // 4000)])
    if part.distance is None or not len(X):
        return base
    distance = part.distance

    def pose(p: Floats) -> Pose:
        return Pose(rotation_from_vector(p[:3]), p[3:])

    def off(p: Floats) -> Floats:
        return np.clip(distance(pose(p).apply(X)), -1, 1)

    best = least_squares(off, np.zeros(6), loss="soft_l1", f_scale=_LOOSE)
    return pose(best.x) @ base


def _edge_line(name: str, mesh: Mesh, found: ShapeSet, part: Part, place: Pose) -> list[str]:
    """Root mean square distance of points of the surface near sharp edges, before and after."""
    edges = find_edges(mesh, found)
    done = sharpened(mesh, found, edges)
    if part.distance is None or not done.on_edge.any():
        return []
    from scipy.spatial import cKDTree

    tree = cKDTree(done.mesh.vertices[done.on_edge])
    out = []
    for some in (mesh, done.mesh):
        X = some.triangles.mean(axis=1)
        X = X[tree.query(X)[0] < NEAR_EDGE]
        out.append(1e3 * float(np.sqrt(np.mean(part.distance(place.apply(X)) ** 2))))
    edge = part.distance(place.apply(done.mesh.vertices[done.on_edge]))
    on = 1e3 * float(np.sqrt(np.mean(edge**2)))
    sharp = sum(e.form == "sharp" for e in edges)
    return [
        f"| {name} | {sharp} sharp edges: surface within {NEAR_EDGE:g} mm, rms | 0 | "
        f"{out[0]:.1f} → {out[1]:.1f} µm | | {on:.1f} on the edge | |"
    ]


def _rest(name: str, found: ShapeSet, mesh: Mesh, part: Part, place: Pose, spent: float) -> str:
    """What was found, how much of the surface it covers, and what of it is not there."""
    kinds = [s.kind for s in found.shapes]
    told = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds))
    invented = 0
    if part.distance is not None:
        for k, s in enumerate(found.shapes):
            X = np.asarray(mesh.vertices[found.used & (found.label == k)])
            d, n = normals_and_distances(s, X)
            off = np.abs(part.distance(place.apply(X - d[:, None] * n)))  # where its points are
            invented += float(np.median(off)) > found.tolerance
    return (
        f"| {name} | {told or 'no shape'} on {found.coverage:.0%} | | {invented} invented | | "
        f"| {len(mesh.faces)} faces, {spent:.1f} s |"
    )


def run(parts: Sequence[str] = (), quick: bool = False, into_pages: bool = False) -> None:
    """Print the table of the paper's rig, known exactly."""
    _table(parts or (PARTS[:2] if quick else PARTS), "paper", False, 1, into_pages)


def _table(parts: Sequence[str], rig: str, calibrated: bool, seed: int, into_pages: bool) -> None:
    lines = list(HEAD)
    print("\n".join(lines), flush=True)
    for name in parts:
        more = measured_part(name, rig, calibrated, seed)
        lines += more
        print("\n".join(more), flush=True)
    if into_pages:
        write(PAGE, "shapes", lines)


def main() -> None:
    """The same with another rig."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rig", default="paper")
    parser.add_argument("--calibrated", action="store_true", help="rig calibrated from pictures")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    _table(args.parts or PARTS, args.rig, args.calibrated, args.seed, False)


if __name__ == "__main__":
    main()
