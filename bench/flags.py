"""What the flags of a stripe promise, against stripes whose centres are known.

``python -m bench flags`` prints four tables. Clipped: the bias and the scatter of stripes that are
cut off at the top over so many pixels, in widths of the stripe, and their scatter over the claimed
sigma. Lopsided: stripes whose flanks have widths of so many to one; by how much clipping moves
their centres, and the rms of that over sigma. Halo: one-sided light of growing strength beside the
stripe; how far it moves the centre, in sigma, where the flag stands and where it does not.
Pictures: how much sigma and the rms of the true error change from picture to picture of simulated
scans of parts that are measured alike all round.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.stripes.pictures import light, picture

from bench import _hole_truth
from bench.surface_truth import scanned
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.points import build_grid, normal_sigma
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import SimulationSpec
from turnscan.stripes import StripeFlag, StripeSettings, detect

ROWS = 2000
SLANT = 0.01
"""px from row to row, so that every phase of the pixels comes up."""
FULL = 4000.0
"""Electrons at which a pixel is full."""
SIGMAS = (1.5, 3.0, 5.0)
"""px: widths of the stripes that are clipped."""
RUNS = (0, 2, 4, 6, 8, 10, 12, 14, 18)
"""px: clipped pixels in a row."""
LOPSIDED = (1.2, 1.5, 2.0)
"""Widths of one flank over that of the other."""
GLOWS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2)
"""Light of a halo over that of the stripe itself."""
LENGTH = 6.0
"""px over which a halo fades."""
PARTS = ("cup", "cylinder")
STEPS = 72
MANY = 30
"""Points of a picture that are enough."""


@dataclass(frozen=True)
class Told:
    """Stripes as they were found."""

    error: Floats
    """(n,) px."""
    sigma: Floats
    flagged: Floats
    """(n,) 1 where the flag that is asked for stands."""
    halo: Floats
    """(n,) px by which a halo is estimated to move it, NaN where none is flagged."""


def _found(electrons: Floats, centre: Floats, full: float | None, flag: StripeFlag) -> Told:
    lit = picture(np.random.default_rng(11), electrons, 5.0, full)
    settings = StripeSettings(saturation=None if full is None else full + 100.0)
    stripe = detect(lit, np.full_like(lit, 100), settings)
    there = stripe.found
    return Told(
        (stripe.position - centre)[there], stripe.sigma[there],
        ((stripe.flags & flag) != 0)[there].astype(np.float64), stripe.table()[4, there],
    )  # fmt: skip


def clipped(sigma: float, run: int) -> Told:
    """Stripes clipped over ``run`` px: so bright that they are full that far from their middle."""
    centre = np.asarray(50.0 + SLANT * np.arange(ROWS), dtype=np.float64)
    peak = FULL * math.exp(0.5 * (0.5 * run / sigma) ** 2) if run else 0.5 * FULL
    return _found(light(centre, sigma, peak, 121), centre, FULL, StripeFlag.SATURATED)


def two_halves(centre: Floats, widths: tuple[float, float], peak: float) -> Floats:
    """(n, 121) stripes of two halves of Gaussians that meet at their highest, over each pixel."""
    from scipy.special import erf

    off = np.arange(122) - 0.5 - centre[:, None]
    s = np.where(off < 0, *widths)
    return np.asarray(peak * np.diff(s * np.sqrt(np.pi / 2) * erf(off / (s * np.sqrt(2.0)))))


def lopsided(sigma: float, ratio: float, run: int) -> tuple[Floats, Floats]:
    """(n,) px by which clipping moves the centres of lopsided stripes, and (n,) the claimed sigma.

    ``run`` px are clipped; the flanks have widths of ``ratio`` to one, ``sigma`` px in the mean.
    """
    centre = np.asarray(50.0 + SLANT * np.arange(ROWS), dtype=np.float64)
    widths = sigma / math.sqrt(ratio), sigma * math.sqrt(ratio)
    peak = FULL * math.exp(0.5 * (run / sum(widths)) ** 2)
    plain = _found(two_halves(centre, widths, 0.5 * FULL), centre, FULL, StripeFlag.SATURATED)
    cut = _found(two_halves(centre, widths, peak), centre, FULL, StripeFlag.SATURATED)
    return cut.error - plain.error.mean(), cut.sigma


def haloed(glow: float, sigma: float = 1.5, peak: float = 8000.0) -> Told:
    """Stripes with light that fades exponentially to one side, and speckle in every row."""
    rng = np.random.default_rng(6)
    centre = np.asarray(45.0 + SLANT * np.arange(ROWS), dtype=np.float64)
    # The halo is the stripe itself, carried to the right by an exponential's quantiles.
    carried = -LENGTH * np.log1p(-(np.arange(40) + 0.5) / 40)
    halo = np.mean([light(centre + far, sigma, peak, 121) for far in carried], axis=0)
    whole = light(centre, sigma, peak, 121) + glow * halo
    grains = rng.gamma(8.0, 1.0 / 8.0, whole.shape)
    return _found(whole * grains, centre, None, StripeFlag.HALO)


def steadiness(part: str) -> tuple[float, float]:
    """Change of the rms error and of sigma from picture to picture of a scan, as parts of both."""
    with tempfile.TemporaryDirectory() as folder:
        made, path = scanned(SimulationSpec(part, "paper", lasers=1, steps=STEPS), Path(folder))
        with Scan.open(path) as scan:
            (seen,) = detect_scan(scan, made.rig, Settings().stripes)
    s = seen.stripes
    grid = build_grid(made.rig, s.laser, s.stripes, s.steps, s.angles)
    clean = grid.found & (grid.flags == 0)
    clean &= (clean.sum(axis=1) > MANY)[:, None]
    off = deviation(grid.points[clean], _hole_truth.made_mesh(made)).distance
    step = np.nonzero(clean)[0]
    many = np.maximum(np.bincount(step), 1)
    changes = []
    for values in (off, normal_sigma(grid)[clean]):
        rms = np.sqrt(np.bincount(step, values**2) / many)
        rms = rms[rms > 0]
        changes.append(float(rms.std() / rms.mean()))
    return changes[0], changes[1]


def middle(values: Floats) -> str:
    """The median of those that are known, in words."""
    known = values[~np.isnan(values)]
    return f"{np.median(known):+.3f}" if len(known) else "–"


def run() -> None:
    """Print the tables."""
    print(
        "| clipped px | " + " | ".join(f"σ {s:g} px: bias, scatter in σ, z" for s in SIGMAS) + " |"
    )
    print("|" + "---|" * (len(SIGMAS) + 1))
    for many in RUNS:
        cells = []
        for sigma in SIGMAS:
            t = clipped(sigma, many)
            z = float(np.std(t.error / t.sigma))
            cells.append(f"{t.error.mean() / sigma:+.3f}, {np.std(t.error) / sigma:.3f}, {z:.2f}")
        print(f"| {many} | " + " | ".join(cells) + " |", flush=True)
    heads = " | ".join(f"σ {s:g} px, {r:g} : 1" for s in SIGMAS[:2] for r in LOPSIDED)
    print(f"\n| clipped px of lopsided stripes: px moved, rms over sigma | {heads} |")
    print("|" + "---|" * (1 + 2 * len(LOPSIDED)))
    for many in (run for run in RUNS[2:] if run % 4 == 0):
        cells = []
        for sigma in SIGMAS[:2]:
            for ratio in LOPSIDED:
                moved, said = lopsided(sigma, ratio, many)
                cells.append(f"{moved.mean():+.3f}, {np.sqrt(np.mean((moved / said) ** 2)):.2f}")
        print(f"| {many} | " + " | ".join(cells) + " |", flush=True)
    print(
        "\n| halo, light over the stripe's | flagged % | bias px | bias in sigma | estimated px |"
    )
    print("|---|---|---|---|---|")
    for glow in GLOWS:
        t = haloed(glow)
        bias = float(np.mean(t.error))
        print(
            f"| {glow:g} | {100 * t.flagged.mean():.1f} | {bias:+.3f} "
            f"| {bias / float(np.median(t.sigma)):+.2f} | {middle(t.halo)} |", flush=True,
        )  # fmt: skip
    print("\n| part | error from picture to picture % | sigma % |\n|---|---|---|")
    for part in PARTS:
        error, sigma = steadiness(part)
        print(f"| {part} | {100 * error:.1f} | {100 * sigma:.1f} |", flush=True)


if __name__ == "__main__":
    run()
