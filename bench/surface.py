"""Merge in angle and height and in voxels, decimation and denoising: seconds and memory."""

from __future__ import annotations

import resource
import time

import numpy as np

from turnscan.mesh import Mesh
from turnscan.points import RangeGrid
from turnscan.shapes import deviation
from turnscan.surface import mesh_grid
from turnscan.surface.clean import denoise
from turnscan.surface.decimation import decimate
from turnscan.surface.fusion import merge

SMALL = (400, 480)
LARGE = (1600, 640)
DENSE = (550, 546)
WANTED = 100_000
TOLERANCE = 0.05
RATIO = 1.5
"""Of our time and that of fast-simplification."""
RADIUS, HEIGHT, NOISE = 40.0, 80.0, 0.02


def grid(steps: int, lines: int, seed: int) -> RangeGrid:
    """A fluted column scanned all round, with noise along the radius."""
    rng = np.random.default_rng(seed)
    phi = np.arange(steps) * 2 * np.pi / steps
    z = np.linspace(0.0, HEIGHT, lines)
    r = (
        RADIUS
        + np.cos(6 * phi)[:, None]
        + 0.5 * np.sin(z / 5)
        + rng.normal(0, NOISE, (steps, lines))
    )
    out = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    return RangeGrid(
        laser=f"L{seed}",
        steps=np.arange(steps, dtype=np.int32),
        angles=phi,
        points=r[..., None] * out[:, None] + z[:, None] * [0.0, 0.0, 1.0],
        sigma=np.full((steps, lines), NOISE),
        amplitude=np.ones((steps, lines)),
        flags=np.zeros((steps, lines), dtype=np.uint16),
        closed=True,
        eyes=500.0 * out + [0.0, 0.0, 120.0],
    )


def _peak() -> float:
    """GB of memory used at most, so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def _off(one: Mesh, other: Mesh) -> float:
    """mm: the largest distance of either from the other, at one of eight vertices and faces."""
    return max(
        float(
            np.abs(
                deviation(np.concatenate([a.vertices[::8], a.triangles[::8].mean(1)]), b).distance
            ).max()
        )
        for a, b in ((one, other), (other, one))
    )


def _against_others(dense: Mesh, less: Mesh, spent: float) -> None:
    """The same by fast-simplification, which keeps neither border nor vertices."""
    try:
        import fast_simplification
    except ImportError:
        print("fast-simplification is not here → pip install -e '.[bench]'")
        return
    points, faces, theirs = dense.vertices.astype(np.float32), dense.faces.copy(), np.inf
    for _ in range(3):
        start = time.process_time()
        made = fast_simplification.simplify(points, faces, target_count=WANTED)
        theirs = min(theirs, time.process_time() - start)
    print(
        f"fast-simplification takes {theirs:.2f} s; ours {spent / theirs:.2f} × that "
        f"(wanted: {RATIO}); off by at most {_off(dense, Mesh(*made[:2])):.3f} mm, ours by "
        f"{_off(dense, less):.3f} mm"
    )


def run() -> None:
    """Print processor seconds of one core (compiled before), and the most memory used so far."""
    few = [grid(40, 48, k) for k in range(2)]
    for how in ("grid", "tsdf"):
        merge(few, how=how)  # compiles
    small = mesh_grid(few[0])
    decimate(small, faces=100)
    decimate(small, tolerance=1.0)
    denoise(few[0])

    two = [grid(*SMALL, k) for k in range(2)]
    start = time.process_time()
    mesh, _ = merge(two, how="grid")
    spent = time.process_time() - start
    size = f"{SMALL[0]} × {SMALL[1]} × 2 lasers"
    print(
        f"{size} in angle and height: {len(mesh.faces)} faces in {spent:.2f} s, "
        f"{_peak():.2f} GB (wanted: below 1 s)"
    )
    start = time.process_time()
    for one in two:
        denoise(one)
    print(f"{size} denoised in {time.process_time() - start:.2f} s")

    dense = mesh_grid(grid(*DENSE, 0))
    spent = np.inf
    for _ in range(3):
        start = time.process_time()
        less = decimate(dense, faces=WANTED)
        spent = min(spent, time.process_time() - start)
    print(
        f"{len(dense.faces)} faces decimated to {len(less.faces)} in {spent:.2f} s, "
        f"{_peak():.2f} GB (wanted: below 2 s)"
    )
    _against_others(dense, less, spent)
    start = time.process_time()
    less = decimate(dense, tolerance=TOLERANCE)
    spent = time.process_time() - start
    print(
        f"{len(dense.faces)} faces decimated to {TOLERANCE} mm: {len(less.faces)} in {spent:.2f} s"
    )

    many = [grid(*LARGE, k) for k in range(2)]
    start = time.process_time()
    mesh, _ = merge(many, how="tsdf")
    spent = time.process_time() - start
    print(
        f"{2 * LARGE[0] * LARGE[1]} points in voxels: {len(mesh.faces)} faces in {spent:.1f} s, "
        f"{_peak():.2f} GB (wanted: below 60 s and 4 GB)"
    )


if __name__ == "__main__":
    run()
