"""A small scan file, its plan, rig and pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from turnscan.rig import Camera, LaserSheet, Pose, Rig
from turnscan.scan import Frame, Scan, ScanPlan

PLAN = ScanPlan(64, 48, "uint8", 1, ("left",), 6, threshold=8.0, margin=6)


def rig_of(plan: ScanPlan = PLAN) -> Rig:
    camera = Camera(plan.width, plan.height, 800.0, 801.0, 31.5, 23.5)
    sheet = LaserSheet("left", np.array([0.6, 0.0, -0.8]), np.array([0.0, 0.0, 300.0]))
    return Rig(camera, (sheet,), Pose(np.eye(3), np.array([0.0, 0.0, 300.0])))


def stripe_pair(
    seed: int, plan: ScanPlan = PLAN, peak: float = 0.7, noise: float = 0.005
) -> tuple[np.ndarray, np.ndarray]:
    """A bright stripe with noise, lit and dark, of the plan's shape and type."""
    rng = np.random.default_rng(seed)
    top = np.iinfo(plan.dtype).max
    v, u = np.mgrid[: plan.height, : plan.width]
    if plan.orientation == "horizontal":
        u, v = v, u
    centre = 20 + 6 * np.sin(v / 9 + seed)
    light = peak * np.exp(-((u - centre) ** 2) / 2 / 1.6**2)
    if plan.channels == 3:
        light = light[..., np.newaxis] * np.array([1.0, 0.3, 0.2])
    dark = rng.normal(0.05, noise, plan.shape)
    lit = rng.normal(0.05, noise, plan.shape) + light
    return tuple(np.clip(np.rint(top * p), 0, top).astype(plan.dtype) for p in (lit, dark))


def write(path: Path, plan: ScanPlan = PLAN, steps: int | None = None) -> list[Frame]:
    frames = [
        Frame(k, plan.lasers[0], *stripe_pair(k, plan), commanded=0.1 * k, settings={"n": k})
        for k in range(plan.steps if steps is None else steps)
    ]
    with Scan.create(path, plan, rig_of(plan)) as scan:
        for frame in frames:
            scan.add(frame)
    return frames
