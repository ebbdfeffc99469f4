"""Where the axis of the modern rig comes out, over draws, and what it hangs on.

Corners and stripes are drawn with the noise that those of rendered pictures have (`bench._drawn`),
of which one rig takes some ten minutes. In the camera's frame the axis is as far away as the
focal length says, and that is told by how a tilted board narrows: by the size of the board in the
picture, its tilt, and how many there are. What is measured depends on the axis against the sheet,
which the pictures under the laser and on the table tell.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench._drawn import Drawn, bench_board
from bench._held import LARGE, STANDARD, Held
from bench._rigs import BOARD
from bench.calibration._figures import Figure, at_most
from bench.calibration.boards import ASKED, seen_of, spread_of
from turnscan.rig import Pose, Rig
from turnscan.simulate import SimulationSpec, bench

WAYS = (
    Held("20 + 12 of a board of 108 × 72 mm, tilted 17 to 52°", BOARD, 20, (0.3, 0.9)),
    Held("80 + 48 of it", BOARD, 80, (0.3, 0.9), 48),
    STANDARD,
    Held("40 + 24 of it", LARGE, 40, (0.6, 1.0), 24),
)
_DRAWS = (16, 48)
"""Of each way, and of the last."""
STOPS = 24
"""Pictures of the small board on the turning table."""


def figures(quick: bool) -> Iterator[Figure]:
    """Median and largest errors over the draws; the last way is what is asked for."""
    spec = SimulationSpec("ball-bar", "modern", lasers=1)
    true = bench(spec).rig
    stand = bench_board(spec)
    for way in WAYS:
        draws = 4 if quick else _DRAWS[way is WAYS[-1]]
        rigs = [_drawn(true, stand, way, seed) for seed in range(draws)]
        yield from _lines(true, rigs, way)


def _lines(true: Rig, rigs: list[Rig], way: Held) -> Iterator[Figure]:
    laser, asked = true.sheets[0].name, way is WAYS[-1]
    basis = np.linalg.svd(true.T_camera_table.rotation[:, 2:].T)[2][1:]
    off = np.array([seen_of(rig, laser, basis) - seen_of(true, laser, basis) for rig in rigs])
    each = np.array([np.diag(spread_of(rig, laser, basis)) for rig in rigs])
    told = each.mean(axis=0)
    for what, unit, part, k in (
        ("axis in the camera's frame, off", "mm", slice(0, 2), 0),
        ("axis in the camera's frame, turned", "°", slice(2, 4), 1),
        ("axis from the sheet, off", "mm", slice(4, 5), 0),
        ("axis to the sheet, turned", "°", slice(5, 6), 1),
    ):
        size = np.linalg.norm(off[:, part], axis=1)
        line = at_most(f"{way.words}: {what}", float(size.max()), ASKED[k], unit, 4)
        words = (
            f"median {np.median(size):.4f}, largest {size.max():.4f} {unit} of {len(size)} draws"
        )
        z = float(np.sqrt(np.mean(off[:, part] ** 2 / each[:, part])))
        words += f" (U = {2 * np.sqrt(told[part].sum()):.4f} {unit}, rms of z {z:.2f})"
        yield Figure(line.name, line.asked if asked else "", words, line.met if asked else None)


def _drawn(true: Rig, stand: Pose, way: Held, seed: int) -> Rig:
    drawn = Drawn(true, np.random.default_rng(seed))
    return drawn.calibrated(*way.poses(true, drawn.dice), stand, STOPS, way.board)


__all__ = ["figures"]
