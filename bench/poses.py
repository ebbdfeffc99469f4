"""Several poses of one part: the wall of a cup from outside and inside, and the bunny's ten scans.

Most of the time is the simulator's: 2 × 120 pictures of 5 megapixels, about 5 minutes of a core.
``python -m bench.poses --keep FOLDER`` keeps the scans there and finds them again; ``--quick``
takes 60 profiles of each pose, ``--only bunny`` the range scans alone. The bunny needs
../shared/data/bunny-range and is left out where it is not.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from bench import _keep
from bench.surface_truth import scanned
from turnscan import poses
from turnscan.formats import read_mesh
from turnscan.mesh import Mesh
from turnscan.pipeline import reconstruct
from turnscan.points import RangeGrid
from turnscan.rig import Pose, rotation_from_vector
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import SimulationSpec, part
from turnscan.surface.fusion import range_surfaces
from turnscan.workflows import compare, join
from turnscan.workflows._importing._range_scans import placed_scans, read_range_scan

STEPS = 120
MM = 1000.0
"""mm in the unit of the range scans."""
WALL = part("cup").dimensions["wall"]
BUNNY = Path(__file__).parents[2] / "shared" / "data" / "bunny-range"


def view_of(name: str, grids: list[RangeGrid]) -> poses.View:
    """The view of a pose."""
    return poses.view(name, [s for g in grids for s in range_surfaces(g)])


def cup_pose(folder: Path, name: str, tip: float, steps: int) -> poses.View:
    """A cup scanned by the modern rig, tipped by so much; with speckle, noise and halo."""
    start = time.process_time()
    spec = SimulationSpec(scene="cup", rig="modern", lasers=1, steps=steps, tip=tip)
    path = scanned(spec, folder)[1]
    print(f"  {name}: {path.name}, {time.process_time() - start:.0f} s of a core", flush=True)
    with Scan.open(path) as scan:
        return view_of(name, list(reconstruct(scan).grids))


def wall(up: poses.View, side: poses.View, found: poses.Alignment) -> tuple[np.ndarray, np.ndarray]:
    """mm: thickness where the lying cup shows its inside, and its standard uncertainty.

    From each point of the inside straight through the wall to the outside that the standing cup
    shows: the mean over 1 mm of it.
    """
    from scipy.spatial import cKDTree

    x, n = found.poses[1].apply(side.points), found.poses[1].turn(side.normals)
    inside = side.inner & (np.einsum("ij,ij->i", n[:, :2], x[:, :2]) < 0) & (abs(n[:, 2]) < 0.5)
    x, n, sigma = x[inside], n[inside], side.sigma[inside]
    near = cKDTree(up.points).query_ball_point(x - WALL * n, 1.0)
    some = [k for k, at in enumerate(near) if len(at) >= 5]
    outer = [np.einsum("ij,ij->i", up.normals[near[k]], up.points[near[k]] - x[k]) for k in some]
    noise = [up.sigma[near[k]].mean() / len(near[k]) ** 0.5 for k in some]
    pose = found.sigma(1, x[some], n[some])
    return np.array([o.mean() for o in outer]), np.sqrt(
        sigma[some] ** 2 + np.square(noise) + pose**2
    )


def cup(folder: Path, steps: int) -> None:
    """Wall thickness from two poses."""
    print(f"cup, 2 poses of {steps} profiles, modern rig (the true one) with speckle", flush=True)
    up = cup_pose(folder, "up", 0.0, steps)
    side = cup_pose(folder, "side", math.pi / 2, steps)
    views = [up, side]
    start = time.process_time()
    found = poses.align(views, poses.place(views))
    spent = time.process_time() - start
    poses.check(found)
    m = found.meetings[0]
    print(
        f"  brought together in {spent:.1f} s of a core: overlap {m.points} places, "
        f"{m.rms:.3f} mm rms, {m.sigmas:.2f} sigma"
    )
    for free in found.freedoms:
        print(f"  not determined: {free}")
    thick, sigma = wall(up, side, found)
    off = np.abs(thick - WALL) / sigma
    print(
        f"  wall at {len(thick)} places of the inside: {thick.mean():.3f} mm (true {WALL:.3f}), "
        f"scatter {thick.std():.3f}, sigma {np.median(sigma):.3f} mm; "
        f"{(off < 3).mean():.1%} within 3 sigma"
    )


def bunny() -> None:
    """Ten range scans from perturbed placements, and from none."""
    conf = placed_scans(BUNNY / "bun.conf", "m")
    views, true = [], []
    for path, pose in conf.items():
        views.append(view_of(path.stem, [read_range_scan(path, Pose(), "m", Settings())[0]]))
        true.append(pose)
    true = [true[0].inverse() @ p for p in true]
    best = poses.align(views, true)
    rng = np.random.default_rng(0)
    rough = [true[0], *(t @ nudge(v, rng) for t, v in zip(true[1:], views[1:], strict=True))]
    given: tuple[tuple[str, Callable[[], Sequence[Pose]]], ...] = (
        ("5 mm and 5° off", lambda: rough),
        ("none", lambda: poses.place(views)),
    )
    for what, starts in given:
        clock, start = time.perf_counter(), time.process_time()
        placed = starts()
        found = poses.align(views, placed)
        spent, clock = time.process_time() - start, time.perf_counter() - clock
        poses.check(found)
        rms = np.array([m.rms for m in found.meetings if m.points > 1000])
        print(
            f"bunny, 10 scans, starts {what}: {clock:.0f} s by the clock, {spent:.0f} s of "
            f"processor; overlaps {np.median(rms):.3f} mm rms; "
            f"worst view {worst(found.poses, best.poses, views):.3f} mm from where the given places"
            f" lead, {worst(found.poses, true, views):.3f} mm from the given places themselves"
        )

    against_theirs(conf)


def against_theirs(conf: Mapping[Path, Pose]) -> None:
    """The joined surface and, at the given places, single scans against that of the scans' owners.

    Theirs was put together by other means from the same scans, and leaves much out where these
    overlap; it is no truth, and how far single scans lie off it says how near one can come.
    """
    theirs = read_mesh((BUNNY / "bun_zipper.ply").read_bytes(), ".ply")
    theirs = Mesh(theirs.vertices * MM, theirs.faces)
    alone = []
    for path, pose in conf.items():
        points = read_range_scan(path, pose, "m", Settings())[0]
        off = deviation(points.points[points.found], theirs).covered()
        alone.append(off.rms)
    found = compare(join([BUNNY / "bun.conf"]), theirs, align="shape").deviation
    print(
        f"bunny, 10 scans joined, against bun_zipper.ply: {len(found.distance)} vertices, mean"
        f" {found.mean:+.3f} mm, {found.rms:.3f} mm rms, 95 % within {found.quantile(0.95):.3f} mm;"
        f" single scans at the given places {min(alone):.3f} to {max(alone):.3f} mm rms"
    )


def nudge(v: poses.View, rng: np.random.Generator) -> Pose:
    """A turn by 5° about the view's middle and a shift by 5 mm."""
    middle = v.points.mean(axis=0)
    turn, shift = (x / np.linalg.norm(x) for x in rng.normal(size=(2, 3)))
    R = rotation_from_vector(np.deg2rad(5.0) * turn)
    return Pose(R, middle - R @ middle + 5.0 * shift)


def worst(a: Sequence[Pose], b: Sequence[Pose], views: list[poses.View]) -> float:
    """mm rms of the view that lies furthest apart in two sets of poses."""
    pairs = zip(a, b, views, strict=True)
    return max(
        float(np.sqrt(((p.apply(v.points) - q.apply(v.points)) ** 2).sum(1).mean()))
        for p, q, v in pairs
    )


def run(quick: bool = False, keep: Path | None = None, only: str | None = None) -> None:
    """Print both."""
    if only in (None, "cup"):
        with _keep.folder(keep) as folder:
            cup(folder, STEPS // 2 if quick else STEPS)
    if only in (None, "bunny") and BUNNY.is_dir():
        bunny()


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="half as many profiles")
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--only", choices=("cup", "bunny"), help="one of the two")
    given = parser.parse_args()
    run(given.quick, given.keep, given.only)


if __name__ == "__main__":
    main()
