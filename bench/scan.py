"""The scan file: milliseconds to store and to read a frame, and its size against raw pictures."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from turnscan.scan import Frame, Scan, ScanPlan

FRAMES = 64
NOISE = 0.005


def pictures(plan: ScanPlan, step: int) -> list[np.ndarray]:
    """Lit and dark picture of one bright stripe with noise."""
    rng = np.random.default_rng(step)
    top = np.iinfo(plan.dtype).max
    column = np.arange(plan.width)
    row = np.arange(plan.height)[:, np.newaxis]
    centre = plan.width / 2 + 0.1 * plan.width * np.sin(row / 50 + step / 20)
    light = 0.7 * np.exp(-((column - centre) ** 2) / 2 / 1.5**2)
    out = []
    for picture in (light, 0.0 * light):
        noisy = top * (picture + rng.normal(0.05, NOISE, plan.shape))
        out.append(np.clip(np.rint(noisy), 0, top).astype(plan.dtype))
    return out


def run() -> None:
    """Print a line for each size, type and way of keeping."""
    print("scan file: lit + dark pairs, one stripe, noise 0.5 % of full scale")
    for width, height in ((640, 480), (2560, 2048)):
        for dtype in ("uint8", "uint16"):
            for keep in ("sparse", "full"):
                _line(ScanPlan(
                    width, height, dtype, 1, ("laser",), FRAMES,
                    threshold=4 * NOISE * np.iinfo(dtype).max * 2**0.5,
                    keep=keep,
                ))  # fmt: skip


def _line(plan: ScanPlan) -> None:
    pairs = [pictures(plan, k) for k in range(4)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.turnscan"
        count = FRAMES if plan.width < 1000 else 8
        start = time.perf_counter()
        with Scan.create(path, plan) as scan:
            for k in range(count):
                lit, dark = pairs[k % 4]
                scan.add(Frame(k, "laser", lit, dark, commanded=0.01 * k))
        written = time.perf_counter()
        with Scan.open(path) as scan:
            opened = time.perf_counter()
            for _ in scan.frames():
                pass
            read = time.perf_counter()
        raw = count * 2 * pairs[0][0].nbytes
        print(
            f"  {plan.width}×{plan.height} {plan.dtype:6} {plan.keep:6}: "
            f"store {1e3 * (written - start) / count:6.2f} ms, "
            f"read {1e3 * (read - opened) / count:6.2f} ms a frame, "
            f"1/{raw / path.stat().st_size:.1f} of the raw pictures"
        )


if __name__ == "__main__":
    run()
