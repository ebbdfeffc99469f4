"""Errors over the standard uncertainties that turnscan states of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.calibration._figures import Figure, within
from bench.calibration._worlds import FEW, SMALL, USUAL, Pictures, outcome

SETS = (
    ("6 + 6 + 12 pictures", SMALL, 0.85, 1.25),
    ("16 + 10 + 24", USUAL, 0.9, 1.1),
    ("6 + 4 + 12", FEW, 0.85, 1.25),
)
"""Boards, boards under the laser, stops of the table; between what the rms of z must lie."""


def figures(quick: bool) -> Iterator[Figure]:
    """One line for each set of pictures and each measured thing."""
    seeds = range(20 if quick else 100)
    for words, some, low, high in SETS:
        yield from _set(words, some, low, high, seeds)


def _set(words: str, some: Pictures, low: float, high: float, seeds: range) -> list[Figure]:
    done = [outcome(seed, some) for seed in seeds]
    out = []
    for name in done[0].error:
        z = np.array([o.z(name) for o in done])
        rms = float(np.sqrt(np.mean(z**2)))
        of = f"z of {name}, {words}, {len(z)} rigs"
        line = within(of, rms, low, high)
        mean, stated = float(z.mean()), np.mean([o.sigma[name] for o in done])
        unit = f"{60 * np.degrees(stated):.2f}′" if name == "angle" else f"{stated:.3f} mm"
        told = f"{line.reached} (mean {mean:+.2f}, stated {unit})"
        out.append(Figure(line.name, line.asked, told, line.met))
    return out


__all__ = ["figures"]
