"""Calls of a detector from elsewhere: its arguments, and the check of what it returns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Flags, Floats, Image
from turnscan.errors import PluginError
from turnscan.plugins import Plugin
from turnscan.stripes._settings import Detector, StripeSettings
from turnscan.stripes._stripe import Candidates, Stripe, StripeFlag


def centres_of(
    detector: Detector | Plugin, lit: Image, dark: Image, settings: StripeSettings, most: int
) -> tuple[Floats, Flags]:
    """Ask a detector: (6, n, most) measures, as `Candidates.table`, and (n, most) flags.

    Centres are in ascending order, those that are too many left out from the faintest.
    Raises PluginError where it fails or returns what cannot be.
    """
    if isinstance(detector, Plugin):
        found = detector.run(detector.value, lit, dark, settings)
    else:
        found = detector(lit, dark, settings)
    if not isinstance(found, Stripe | Candidates):
        kind = type(found).__name__
        raise _failure(detector, f"it returned a {kind}, not a Stripe or Candidates")
    whole = found.table()
    table = whole.reshape(*whole.shape[:2], -1)
    flags = found.flags.reshape(len(found.flags), -1)
    trouble = _trouble(table, lit.shape)
    if trouble:
        raise _failure(detector, trouble)
    return _ordered(table, flags, most)


def named(detector: object) -> str:
    """How a detector is called where its result is kept."""
    if isinstance(detector, str | Plugin):
        return str(detector)
    kind: Any = detector if hasattr(detector, "__qualname__") else type(detector)
    return f"{kind.__module__}:{kind.__qualname__}"


def told(settings: StripeSettings, base: float, noise: float, threshold: float) -> StripeSettings:
    """The settings as a detector gets them: numbers for what is known, no region left to mind."""
    return replace(
        settings,
        strategy="window",
        background=(base, noise),
        threshold=threshold,
        orientation="vertical",
        roi=None,
        mask=None,
    )


def _failure(detector: Detector | Plugin, text: str) -> PluginError:
    if isinstance(detector, Plugin):
        return detector.failure(text)
    return PluginError(f"the detector {named(detector)} failed: {text}", hint="correct it")


def _trouble(table: Floats, shape: tuple[int, ...]) -> str:
    """What cannot be in (5, n, k) of the measures of centres; nothing where all is well."""
    rows, columns = shape
    if table.shape[1] != rows:
        return f"{table.shape[1]} rows for a picture of {rows}"
    position, sigma, amplitude, width = table[:4]
    there: Bools = ~np.isnan(position)
    if not there.any():
        return ""
    low, high = float(position[there].min()), float(position[there].max())
    if low < -0.5 or high > columns - 0.5:
        return f"a centre at {low if low < -0.5 else high:g} px of {columns}"
    for name, values, least in (
        ("sigma", sigma, np.nextafter(0.0, 1.0)),
        ("amplitude", amplitude, 0.0),
        ("width", width, 0.0),
    ):
        bad = there & ~(values >= least)
        if bad.any():
            row, k = np.argwhere(bad)[0]
            return f"{name} {values[row, k]:g} of the centre in row {row}"
    return ""


def _ordered(table: Floats, flags: Flags, most: int) -> tuple[Floats, Flags]:
    """The brightest ``most`` centres of each row in ascending order, NaN behind the last."""
    there = ~np.isnan(table[0])
    bright = np.argsort(np.where(there, -table[2], np.inf), axis=1, kind="stable")[:, :most]
    table = np.stack([np.take_along_axis(v, bright, axis=1) for v in table])
    bits = np.take_along_axis(flags, bright, axis=1)
    order = np.argsort(table[0], axis=1, kind="stable")  # NaN comes last
    table = np.stack([np.take_along_axis(v, order, axis=1) for v in table])
    bits = np.take_along_axis(bits, order, axis=1)
    none = np.isnan(table[0])
    table[:, none] = np.nan
    bits[none] = 0
    several = (~none).sum(axis=1) > 1
    bits[several] |= np.where(none[several], 0, StripeFlag.MULTI).astype(np.uint16)
    empty = none.all(axis=1)
    bits[empty, 0] = StripeFlag.DARK
    lack = most - bits.shape[1]
    if lack > 0:
        table = np.pad(table, ((0, 0), (0, 0), (0, lack)), constant_values=np.nan)
        bits = np.pad(bits, ((0, 0), (0, lack)))
    return table, bits
