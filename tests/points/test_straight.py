"""Doubted stripes whose points lie where the profiles beside lead straight on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.points.walls import DUE, N, S, notched
from turnscan.points._lit_points import LitPoints
from turnscan.points._straight import straight_on
from turnscan.points._wholeness import wholeness

NOISE = 0.05
"""mm."""
OFF = 0.6
"""px by which what is cut is off, in due widths."""


def wide(seed: int, width: float, *, off: float = 0.0, odd: float = 0.0) -> LitPoints:
    """A flat wall in short steps, the last two profiles of which are narrower; all of them are off
    by so many px, and one of their lines by more."""
    seen = notched(1.0, 1.0, deep=0.0, step=0.9)
    wide_lines = np.repeat(np.arange(N), 2)
    many = replace(
        seen,
        points=seen.points[:, wide_lines] * [1.0, 1.0, 0.0]
        + 0.3 * np.arange(2 * N)[:, None] * [0.0, 0.0, 1.0],
        **{
            name: getattr(seen, name)[:, wide_lines].copy()
            for name in ("moves", "sheets", "width", "amplitude")
        },
    )
    along = many.along.copy()
    scatter = np.random.default_rng(seed).normal(0.0, NOISE, many.width.shape)
    points = many.points + along * (scatter / np.linalg.norm(along, axis=-1))[..., None]
    points[-2:] += off * along[-2:]
    points[-1, N] += odd * along[-1, N]
    many.width[-2:] *= width
    many.amplitude[-2:] *= width
    return replace(many, points=points)


def doubt(seen: LitPoints) -> np.ndarray:
    """px of the last profile."""
    told = wholeness(seen)
    return straight_on(seen, told.doubt, told.shift)[-1]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("width", [0.4, 0.5])
def test_what_lies_where_the_profiles_beside_lead_is_not_doubted_by_its_width(seed, width):
    off = OFF * DUE
    on, aside = (doubt(wide(seed, width, off=o)) for o in (0.0, off))
    per_px = np.linalg.norm(wide(seed, width).along[-1], axis=-1).mean()
    # Where a way of ten profiles leads is known half as well as single points are.
    assert np.median(on) < 2.5 * NOISE / per_px
    assert np.median(aside) > 0.3 * off, "a cut moves its point off the wall, and stays doubted"
    assert np.median(aside) > 2 * np.median(on)


def test_a_line_that_is_unlike_those_about_it_stays_doubted():
    plain, odd = (doubt(wide(1, 0.5, odd=o)) for o in (0.0, 1.5 * DUE))
    assert odd[N] > 5 * np.median(plain)
    assert np.median(odd) < 2 * np.median(plain)


def test_few_profiles_lead_nowhere():
    """Three sure ones tell no way."""
    seen = wide(2, 0.5)
    few = replace(
        seen,
        **{
            name: getattr(seen, name)[S - 5 :].copy()
            for name in ("points", "eyes", "moves", "sheets", "width", "amplitude", "angles")
        },
    )
    assert np.median(doubt(few)) > 3 * np.median(doubt(seen))
