"""Colours from texture images against the paint of a simulated pillar with a ball before it."""

from __future__ import annotations

import numpy as np
from tests.texture import pillar as scene

from turnscan.texture import colours_of


def run() -> None:
    """Print errors of colours, of exposures that drift, and what a lamp at one side does."""
    found = colours_of(scene.PART, scene.shots(scene.taken()))
    error = 100 * scene.off(found)[scene.plain() & found.seen]
    half, most = np.quantile(error, [0.5, 0.99])
    print(f"colours of {len(error)} vertices: half within {half:.2f} %, 99 % within {most:.1f} %")
    red = found.colour[:, 0] > 2.5 * found.colour[:, 1].astype(float)
    print(f"vertices of the pillar with the ball's red: {int(red[~scene.NOSE].sum())}")
    pictures = scene.taken(drift=True)
    for level in (True, False):
        found = colours_of(scene.PART, scene.shots(pictures), level=level)
        half = 100 * np.median(scene.off(found)[scene.plain() & found.seen])
        ratio = found.gains / scene.DRIFT[:, None]
        off = 100 * float(np.abs(ratio / ratio.mean() - 1).max())
        name = "levelled" if level else "as taken"
        print(f"drift of 20 %, {name}: half within {half:.2f} %, gains within {off:.1f} %")
    turn = range(scene.TURN // 2 + 1)
    found = colours_of(scene.PART, scene.shots(scene.taken(lamp=0.4), turn))
    trend = np.polyfit(turn, np.log(found.gains[:, 1]), 1)[0] * len(turn)
    print(
        f"half a turn under a lamp at one side: {100 * np.expm1(abs(trend)):.0f} % of drift found"
    )
