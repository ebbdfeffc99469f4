"""The table's own errors: where it is when an angle is commanded."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, frozen


@dataclass(frozen=True)
class TableMotion:
    """What a drive that is eccentric, or has play, makes of the commanded angles.

    A table told to be at c, in scan order, is at p + Σ (a_m cos m p + b_m sin m p) with p = c plus
    play: while it takes up play at the start it stays ``start`` ahead of its first angle, and once
    it turns back it lags by ``backlash``. An eccentric wheel gives m = 1, an oval one m = 2.
    """

    harmonics: Floats
    """(m, 2) rad: a and b of the orders 1, 2, … per turn."""
    start: float = 0.0
    """rad: play taken up by the first moves of a scan; negative for a leap."""
    backlash: float = 0.0
    """rad: play between turning one way and the other."""
    covariance: Floats | None = None
    """(p, p) of the parameters in `names`, or None when not known."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "harmonics", frozen(self.harmonics, (None, 2), "harmonics"))
        if self.covariance is not None:
            p = len(self.names)
            whole = frozen(self.covariance, (p, p), "TableMotion.covariance")
            object.__setattr__(self, "covariance", whole)

    @classmethod
    def of(cls, values: npt.ArrayLike, covariance: Floats | None = None) -> TableMotion:
        """From the values of `names`, as many as there are."""
        v = np.asarray(values, dtype=np.float64)
        return cls(v[:-2].reshape(-1, 2), float(v[-2]), float(v[-1]), covariance)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters, all in radians."""
        orders = range(1, len(self.harmonics) + 1)
        return (*(f"motion.{f}{m}" for m in orders for f in ("cos", "sin")),
                "motion.start", "motion.backlash")  # fmt: skip

    @property
    def values(self) -> Floats:
        """(p,) rad, in the order of `names`."""
        return np.array([*self.harmonics.ravel(), self.start, self.backlash])

    def angle(self, commanded: npt.ArrayLike) -> Floats:
        """True angles (n,) rad of a scan whose steps went to ``commanded`` (n,) rad, in order."""
        c = np.asarray(commanded, dtype=np.float64)
        sense, back, left = _way(c.tobytes())
        play = np.copysign(np.maximum(abs(self.start) - left, 0.0), self.start)
        p = c + sense * (play + self.backlash * back)
        angles: Floats = p + self._waves(p) @ self.harmonics.ravel()
        return angles

    def sigma(self, commanded: npt.ArrayLike) -> Floats:
        """(n,) rad: standard uncertainty of `angle`; 0 where nothing is known of it."""
        c = np.asarray(commanded, dtype=np.float64)
        if self.covariance is None:
            return np.zeros(len(c))
        slope = self.slopes(c)
        # What turns all angles alike turns the part, and harms nothing.
        slope = slope - slope.mean(axis=0)
        variance = np.einsum("ni,ij,nj->n", slope, self.covariance, slope)
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
        return sigma

    def slopes(self, commanded: npt.ArrayLike) -> Floats:
        """(n, p) derivative of `angle` by the parameters in `names`."""
        c = np.asarray(commanded, dtype=np.float64)
        sense, back, left = _way(c.tobytes())
        play = np.copysign(np.maximum(abs(self.start) - left, 0.0), self.start)
        waves = self._waves(c + sense * (play + self.backlash * back))
        a, b = self.harmonics.T
        orders = np.arange(1, len(a) + 1)
        along = 1.0 + waves[:, ::2] @ (orders * b) - waves[:, 1::2] @ (orders * a)
        taken = sense * np.stack([left <= abs(self.start), back], axis=1)
        slopes: Floats = np.concatenate([waves, along[:, None] * taken], axis=1)
        return slopes

    def _waves(self, p: Floats) -> Floats:
        orders = np.arange(1, len(self.harmonics) + 1)
        turns = p[:, None] * orders
        return np.stack([np.cos(turns), np.sin(turns)], axis=-1).reshape(len(p), -1)


@lru_cache(maxsize=64)
def _way(told: bytes) -> tuple[float, Bools, Floats]:
    """Sense in which a scan began, where it goes back, and how far it went since, by its commanded
    angles: an adjustment asks for that of a few scans again and again."""
    c = np.unwrap(np.frombuffer(told))  # a list may begin again at 0 after 360
    moves = np.sign(np.diff(c, prepend=c[:1]))
    some = np.flatnonzero(moves)
    sense = float(moves[some[0]]) if len(some) else 1.0
    last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(c)), 0))
    back: Bools = moves[last] == -sense
    turned = np.maximum.accumulate(back)
    left = np.where(turned, np.inf, np.abs(c - c[:1]))
    for array in (back, left):
        array.flags.writeable = False
    return sense, back, left
