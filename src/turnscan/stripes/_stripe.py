"""Stripe: one sub-pixel centre per scan line; Candidates: all the centres it was chosen from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import Literal

import numpy as np

from turnscan.arrays import Flags, Floats, frozen

Orientation = Literal["vertical", "horizontal"]
"""vertical: one centre per image row (its column); horizontal: one centre per column (its row)."""
MEASURES = 6
"""Rows of a table of centres: position, sigma, amplitude, width, halo, skew."""
_OPTIONAL = ("halo", "skew")
"""Those that are None where nothing measured them."""


class StripeFlag(IntFlag):
    """What is known about a centre, or why there is none."""

    OK = 0
    DARK = 1
    """Missing: nothing above the threshold."""
    OUTSIDE = 2
    """Missing: outside the region of interest or the picture."""
    AMBIGUOUS = 4
    """Several candidates that the choice could not tell apart."""
    SATURATED = 8
    """Clipped pixels inside the window."""
    HALO = 16
    """Light spread inside or around the surface, and moves the centre by more than its sigma."""
    EDGE = 32
    """The stripe ends here, or is cut by the picture's border: one-sided light."""
    MULTI = 64
    """More than one candidate in this line."""
    GRAZING = 128
    """Far wider than the stripe's usual width."""
    REFINED = 256
    """Moved to where the light of its surface element balances in the pictures around."""
    HAND = 512
    """Set or picked by a person: not taken for a jump off the line of its profile. Alone, where
    there is no centre: deleted by a person."""


@dataclass(frozen=True)
class Stripe:
    """The laser line in one picture: one centre per scan line, NaN where there is none.

    Lines are image rows for a vertical stripe and image columns for a horizontal one.
    """

    position: Floats
    """(n,) px across the stripe (column for vertical), NaN where missing."""
    sigma: Floats
    """(n,) px standard uncertainty of ``position``, NaN where missing."""
    amplitude: Floats
    """(n,) grey levels above background at the peak, NaN where missing."""
    width: Floats
    """(n,) px rms width of the light in the window, NaN where missing."""
    flags: Flags
    """(n,) bits of `StripeFlag`."""
    orientation: Orientation = "vertical"
    scatter: float = 0.0
    """px² for each px of width: the variance in ``sigma`` that the photons leave unexplained, from
    how the centres scatter along the stripe; NaN where they are too few to tell, and none is in
    it. Refined lines (flag REFINED) have it no more. `points.build_grid` takes it from several
    pictures together."""
    halo: Floats | None = None
    """(n,) px: how far light that spread in the material is estimated to have moved the centre,
    towards higher numbers if positive, where it is flagged HALO; NaN elsewhere and where the tails
    do not tell. None where nothing looked for it."""
    skew: Floats | None = None
    """(n,) third standardised moment of the light in the window: 0 for light that is alike on both
    sides of its centre, positive with the longer tail towards higher numbers; NaN where missing,
    and where noise cancels the light.
    None where nothing measured it."""

    def __post_init__(self) -> None:
        n = len(self.position)
        for name in ("position", "sigma", "amplitude", "width", *_OPTIONAL):
            if name not in _OPTIONAL or getattr(self, name) is not None:
                values = frozen(getattr(self, name), (n,), f"Stripe.{name}", nan=True)
                object.__setattr__(self, name, values)
        object.__setattr__(self, "flags", frozen(self.flags, (n,), "Stripe.flags", np.uint16))

    @classmethod
    def made_of(
        cls, table: Floats, flags: Flags, orientation: Orientation, scatter: float = 0.0
    ) -> Stripe:
        """A stripe of fresh arrays that no one else writes to: kept as they are, not checked.

        ``table`` (6, n) is position, sigma, amplitude, width, halo and skew, ``flags`` (n,) uint16;
        both become read-only. For the detector, where checks and copies would cost a twentieth of a
        frame.
        """
        table.flags.writeable = False
        flags.flags.writeable = False
        stripe = object.__new__(cls)
        position, sigma, amplitude, width, halo, skew = table
        stripe.__dict__.update(
            position=position,
            sigma=sigma,
            amplitude=amplitude,
            width=width,
            flags=flags,
            orientation=orientation,
            scatter=scatter,
            halo=halo,
            skew=skew,
        )
        return stripe

    def scatters(self) -> tuple[Floats, Floats]:
        """(3,) px² for each px of width: as `scatter`, from centres 1, 2 and 4 lines apart, and
        (3,) from how many differences; 0 where they are too few to tell.

        Adjacent lines may share an error, which wider ones show; but the largest of three that
        chance alone parts is too large. Several pictures together know which it is.
        """
        from turnscan.stripes._choice import LAGS, scatter_by_lag

        values, counts = np.zeros(len(LAGS)), np.zeros(len(LAGS))
        scatter_by_lag(self.alone(), np.array(self.flags), values, counts)
        return np.where(counts > 0, values, 0.0), counts

    @staticmethod
    def scatter_together(stripes: Sequence[Stripe]) -> float:
        """px² for each px of width: `scatter` of the lines of several pictures together.

        For pictures of few lines: centres are compared that lie in half of the usual lines, for
        further apart they tell of the part's shape. It is raised by its own standard uncertainty.
        NaN where they are too few to tell even so.
        """
        from turnscan.stripes import _choice as k

        gap = np.full((MEASURES, 1), np.nan)
        table = np.concatenate([t for s in stripes for t in (s.alone(), gap)], axis=1)
        flags = np.concatenate([f for s in stripes for f in (s.flags, np.zeros(1, np.uint16))])
        usual = float(np.median([np.count_nonzero(s.found) for s in stripes]))
        lags = [lag for lag in k.LAGS if lag == 1 or 2 * (3 * lag + 1) <= usual]
        for clean in (True, False):
            found = [k.unexplained(table, flags, lag, clean, -np.inf) for lag in lags]
            enough = [(value, n) for value, n in found if n >= k.ENOUGH_LINES]
            best = most = 0.0
            for value, n in enough:
                twice = k.SURELY_MORE / math.sqrt(n)
                if value > (1.0 + twice) * best:
                    best, most = value, (1.0 + twice / 2) * value
            if enough:
                return most
        return math.nan

    def alone(self) -> Floats:
        """(6, n) as `table`, with the sigmas that the photons explain."""
        table = self.table()
        photons = table[1] ** 2 - np.nan_to_num(self.scatter) * table[3]
        table[1] = np.sqrt(np.maximum(photons, 0.0))
        return table

    def table(self) -> Floats:
        """(6, n) position, sigma, amplitude, width, halo, skew: a copy."""
        return _table(self)

    @property
    def found(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n,) True where there is a centre."""
        return ~np.isnan(self.position)

    @property
    def pixels(self) -> Floats:
        """(n, 2) pixel coordinates (u, v) of the centres, NaN where missing."""
        line = np.where(self.found, np.arange(len(self.position), dtype=np.float64), np.nan)
        pair = (self.position, line) if self.orientation == "vertical" else (line, self.position)
        return np.stack(pair, axis=-1)


@dataclass(frozen=True)
class Candidates:
    """Up to K possible centres per scan line, ordered by position; NaN beyond the last one."""

    position: Floats
    """(n, K) px."""
    sigma: Floats
    """(n, K) px."""
    amplitude: Floats
    """(n, K) grey levels."""
    width: Floats
    """(n, K) px."""
    flags: Flags
    """(n, K) bits of `StripeFlag`."""
    orientation: Orientation = "vertical"
    beyond: Floats | None = None
    """(n, J) px, NaN where there is none: centres outside the region that counts. None of them can
    be chosen; they tell where a stripe goes on across the region's border."""
    halo: Floats | None = None
    """(n, K) px, as `Stripe.halo`."""
    skew: Floats | None = None
    """(n, K), as `Stripe.skew`."""

    def __post_init__(self) -> None:
        shape = self.position.shape
        if len(shape) != 2:
            raise ValueError(f"Candidates.position: shape {shape}, expected (lines, K)")
        for name in ("position", "sigma", "amplitude", "width", *_OPTIONAL):
            if name not in _OPTIONAL or getattr(self, name) is not None:
                values = frozen(getattr(self, name), shape, f"Candidates.{name}", nan=True)
                object.__setattr__(self, name, values)
        object.__setattr__(self, "flags", frozen(self.flags, shape, "Candidates.flags", np.uint16))
        if self.beyond is not None:
            beyond = frozen(self.beyond, (shape[0], None), "Candidates.beyond", nan=True)
            object.__setattr__(self, "beyond", beyond)

    @classmethod
    def made_of(
        cls, table: Floats, flags: Flags, orientation: Orientation, beyond: Floats | None = None
    ) -> Candidates:
        """Candidates of a table (6, n, K) of position, sigma, amplitude, width, halo and skew."""
        position, sigma, amplitude, width, halo, skew = table
        return cls(position, sigma, amplitude, width, flags, orientation, beyond, halo, skew)

    def table(self) -> Floats:
        """(6, n, K) position, sigma, amplitude, width, halo, skew: a copy."""
        return _table(self)


def _table(of: Stripe | Candidates) -> Floats:
    nothing = np.full(of.position.shape, np.nan)
    more = [nothing if v is None else v for v in (of.halo, of.skew)]
    return np.stack([of.position, of.sigma, of.amplitude, of.width, *more])
