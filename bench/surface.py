"""Merge of two lasers in angle and height, and of two million points in voxels."""

from __future__ import annotations

import resource
import time

import numpy as np

from turnscan.points import RangeGrid
from turnscan.surface import merge

SMALL = (400, 480)
LARGE = (1600, 640)
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
        steps=np.arange(steps),
        angles=phi,
        points=r[..., None] * out[:, None] + z[:, None] * [0.0, 0.0, 1.0],
        sigma=np.full((steps, lines), NOISE),
        amplitude=np.ones((steps, lines)),
        flags=np.zeros((steps, lines), dtype=np.uint16),
        closed=True,
        eyes=500.0 * out + [0.0, 0.0, 120.0],
    )


def run() -> None:
    """Print processor seconds (compiled before) and the most memory used."""
    few = [grid(40, 48, k) for k in range(2)]
    for how in ("grid", "tsdf"):
        merge(few, how=how)  # compiles
    two = [grid(*SMALL, k) for k in range(2)]
    start = time.process_time()
    mesh, _ = merge(two, how="grid")
    spent = time.process_time() - start
    size = f"{SMALL[0]} × {SMALL[1]} × 2 lasers in angle and height"
    print(f"{size}: {len(mesh.faces)} faces in {spent:.2f} s of one core (wanted: below 1 s)")
    many = [grid(*LARGE, k) for k in range(2)]
    start = time.process_time()
    mesh, _ = merge(many, how="tsdf")
    spent = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{2 * LARGE[0] * LARGE[1]} points in voxels: {len(mesh.faces)} faces in {spent:.1f} s "
        f"of one core, {peak:.2f} GB at most (wanted: below 60 s and 4 GB)"
    )


if __name__ == "__main__":
    run()
