"""Error of every strategy on synthetic stripes, beside the Cramér-Rao bound."""

from __future__ import annotations

from typing import get_args

import numpy as np
from tests.stripes.pictures import bound, light, picture, speckled

from turnscan.stripes import Strategy, StripeSettings, detect

ROWS = 4000
CASES = {
    "σ 1.5, 10 ke⁻": (1.5, 10_000.0, 5.0, 0.0, None),
    "σ 0.6, 10 ke⁻": (0.6, 10_000.0, 5.0, 0.0, None),
    "σ 3, 10 ke⁻": (3.0, 10_000.0, 5.0, 0.0, None),
    "σ 1.5, 300 e⁻": (1.5, 300.0, 8.0, 50.0, None),
    "clipped × 3": (1.5, 30_000.0, 8.0, 0.0, 10_000.0),
}
SPECKLE = {"speckle .24, σ 1.5": (0.24, 1.5, 16), "speckle .5, σ 2": (0.5, 2.0, 8)}


def clean(strategy: str, name: str) -> tuple[float, float]:
    """Rms error, px, and rms of error over claimed sigma, random phase."""
    sigma, peak, read, background, full = CASES[name]
    rng = np.random.default_rng(7)
    centre = 50 + rng.uniform(-0.5, 0.5, ROWS)
    lit = picture(rng, light(centre, sigma, peak, 101) + background, read, full)
    saturation = None if full is None else full
    settings = StripeSettings(
        strategy=strategy,
        electrons_per_dn=1.0,
        saturation=saturation,
    )
    stripe = detect(lit, None, settings)
    error = stripe.position - centre
    return float(np.sqrt(np.nanmean(error**2))), float(np.nanstd(error / stripe.sigma))


def speckle(strategy: str, name: str) -> tuple[float, float]:
    """The same in fully developed speckle."""
    grain, sigma, fine = SPECKLE[name]
    rng = np.random.default_rng(3)
    error, claimed = [], []
    for _ in range(4):
        intensity, centre = speckled(rng, grain, sigma, rows=192, fine=fine)
        lit = picture(rng, intensity / intensity[:, 30].mean() * 5000)
        settings = StripeSettings(
            strategy=strategy,
            electrons_per_dn=1.0,
            speckle_contrast=1.0,
            speckle_grain=grain,
        )
        stripe = detect(lit, None, settings)
        error.append(stripe.position - centre)
        claimed.append(stripe.sigma)
    e, s = np.concatenate(error), np.concatenate(claimed)
    return float(np.sqrt(np.nanmean(e**2))), float(np.nanstd(e / s))


def run() -> None:
    """Print rms error in px and, in brackets, the rms of error over claimed sigma."""
    print("| strategy | " + " | ".join([*CASES, *SPECKLE]) + " |")
    bounds = [f"{bound(*case[:4]):.4f}" for case in CASES.values()][:-1]
    print("| bound | " + " | ".join([*bounds, "–", "–", "–"]) + " |")
    for strategy in get_args(Strategy):
        cells = [clean(strategy, name) for name in CASES]
        cells += [speckle(strategy, name) for name in SPECKLE]
        print(f"| {strategy} | " + " | ".join(f"{rms:.4f} ({z:.2f})" for rms, z in cells) + " |")
