"""Stripe extraction on one core: frames per second, against the usual recipe and memory speed.

``python -m bench stripes [pictures] [sparse]``; ``--write`` puts the figures of sparse files into
docs/explain/sizing.md.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from bench._page import DOCS, write
from bench.scale import make_rig, pictures, write_scan
from turnscan.detection import look_through
from turnscan.scan import Scan
from turnscan.stripes import Signal, StripeSettings, detect, find_candidates

U8 = npt.NDArray[np.uint8]
PAGE = DOCS / "explain" / "sizing.md"
PARTS = ("pictures", "sparse")
HALF = 8
THRESHOLD = 20
SPARSE = 24
"""Frames of the sparse file."""
RATE, FASTER = 2, 10
"""GB of stored pictures a second and core, and times the rate of whole pictures."""


def scene(height: int, width: int, seed: int = 0) -> tuple[U8, U8, npt.NDArray[np.float64]]:
    """Laser on, laser off, and the true centre per row: sigma 1.8 px, 180 levels, noise 2."""
    rng = np.random.default_rng(seed)
    v, u = np.arange(height), np.arange(width)
    centre = width * (0.5 + 0.2 * np.sin(7.0 * v / height))
    dark = rng.normal(20.0, 2.0, (height, width))
    lit = rng.normal(20.0, 2.0, (height, width))
    lit += 180.0 * np.exp(-0.5 * ((u - centre[:, None]) / 1.8) ** 2)
    as_u8 = [np.clip(p.round(), 0, 255).astype(np.uint8) for p in (lit, dark)]
    return as_u8[0], as_u8[1], centre


def _blurred(lit: U8, dark: U8) -> U8:
    image = cv2.subtract(lit, dark)
    image = cv2.threshold(image, THRESHOLD, 255, cv2.THRESH_TOZERO)[1]
    return np.asarray(cv2.GaussianBlur(image, (5, 5), 0), dtype=np.uint8)


def _centre(weights: npt.NDArray[np.float64], u: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    total = weights.sum(axis=1)
    missing = np.full(len(total), np.nan)
    np.divide((weights * u).sum(axis=1), total, out=missing, where=total > 0)
    return missing


def recipe(lit: U8, dark: U8) -> npt.NDArray[np.float64]:
    """The usual recipe in whole-picture NumPy: no loop, no trick."""
    image = _blurred(lit, dark)
    u = np.arange(image.shape[1])
    window = np.abs(u - image.argmax(axis=1)[:, None]) <= HALF
    return _centre(np.where(window, image, 0).astype(np.float64), u)


def recipe_by_rows(lit: U8, dark: U8) -> npt.NDArray[np.float64]:
    """The same as open scanner programs write it: a loop over the rows makes the mask."""
    image = _blurred(lit, dark)
    mask = np.zeros_like(image)
    for v, peak in enumerate(image.argmax(axis=1)):
        mask[v, max(0, peak - HALF) : peak + HALF + 1] = 255
    image = np.asarray(cv2.bitwise_and(image, mask))
    return _centre(image.astype(np.float64), np.arange(image.shape[1]))


def recipe_gathered(lit: U8, dark: U8) -> npt.NDArray[np.float64]:
    """The same tuned by hand: only the 17 pixels of each window are gathered."""
    image = _blurred(lit, dark)
    u = image.argmax(axis=1)[:, None] + np.arange(-HALF, HALF + 1)
    u = np.clip(u, 0, image.shape[1] - 1)
    return _centre(np.take_along_axis(image, u, axis=1).astype(np.float64), u)


def seconds(
    job: Callable[[], object], tries: int, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Best of several runs, after one to warm up."""
    job()
    best = np.inf
    for _ in range(tries):
        start = clock()
        job()
        best = min(best, clock() - start)
    return float(best)


def measure(height: int, width: int) -> None:
    """Print the figures for one size of picture."""
    settings = StripeSettings()
    lit, dark, centre = scene(height, width)
    words = [np.ascontiguousarray(p).view(np.uint64) for p in (lit, dark)]
    tries = 60 if height < 1000 else 15
    ours = seconds(lambda: detect(lit, dark, settings), 3 * tries)
    read = seconds(lambda: [np.bitwise_or.reduce(w, axis=None) for w in words], 3 * tries)
    error = float(np.nanstd(detect(lit, dark, settings).position - centre))
    print(f"{width}×{height} lit + dark, one core: {1 / ours:8.0f} frames/s, rms {error:.3f} px")
    print(f"    {ours / read:5.1f} × the time to read both pictures once")
    print(f"    times the speed of the usual recipe (wanted: {20 if height < 1000 else 40} ×):")
    for name, job in (
        (
            "recipe as scanner programs write it, the yardstick: a loop masks each row",
            recipe_by_rows,
        ),
        ("recipe in whole-picture NumPy", recipe),
        ("recipe with the windows gathered by hand", recipe_gathered),
    ):
        theirs = seconds(partial(job, lit, dark), tries // 3 + 5)
        off = float(np.nanstd(job(lit, dark) - centre))
        print(f"    {theirs / ours:5.1f} × {name} ({1 / theirs:.0f} frames/s, rms {off:.3f} px)")
    many = seconds(lambda: find_candidates(lit, dark, settings), tries)
    print(f"    all candidates: {1 / many:.0f} frames/s")


def from_runs(folder: Path) -> list[str]:
    """A table of how fast stripes are found in a sparse file, against whole pictures."""
    path, settings, cpu = folder / "vase.turnscan", StripeSettings(), time.process_time
    write_scan(path, SPARSE)
    with Scan.open(path) as scan:
        brackets, _ = look_through(scan, "laser", settings, jobs=1)
        stored = seconds(lambda: look_through(scan, "laser", settings, jobs=1), 5, cpu) / SPARSE
        signal = Signal(scan.plan.weights, scan.plan.dtype)
        first, taken = brackets[0][0], next(pictures(make_rig(), SPARSE))

        def unpacked() -> None:
            f = first.decode()
            signal.detect(f.lit, f.dark, settings, f.level, f.noise)

        whole = seconds(unpacked, 9, cpu)
        raw = seconds(lambda: signal.detect(taken.lit, taken.dark, settings), 9, cpu)
        pixels = 2 * scan.plan.width * scan.plan.height
        runs = [shots[0].runs() for shots in brackets]
    kept = np.mean([len(r.lit) + (0 if r.dark is None else len(r.dark)) for r in runs])
    return [
        "| | measured | wanted |",
        "|---|---|---|",
        f"| frames a second | {1 / stored:.0f} | |",
        f"| pixels of both pictures | {pixels / stored / 1e9:.1f} GB/s | {RATE} GB/s |",
        f"| of these kept in the file, {kept / pixels:.1%} | {kept / stored / 1e6:.0f} MB/s | |",
        f"| times the rate when whole pictures are unpacked | {whole / stored:.1f} | {FASTER} |",
        f"| times that of pictures in memory, as taken | {raw / stored:.1f} | |",
    ]


def run(parts: Sequence[str] = (), into_pages: bool = False) -> None:
    """Print the tables; the one of sparse files into the documentation where that is asked."""
    cv2.setNumThreads(1)
    if "pictures" in (parts or PARTS):
        measure(480, 640)
        measure(2048, 2560)
    if "sparse" not in (parts or PARTS):
        return
    with tempfile.TemporaryDirectory() as folder:
        lines = from_runs(Path(folder))
    print("\n".join(["from a sparse file, one core:", *lines]))
    if into_pages:
        write(PAGE, "sparse", lines)
