"""Drift: does a test value wander from run to run?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, frozen
from turnscan.errors import InputError

ALLOWANCE, ALARM = 0.5, 5.0
"""Reference value k and decision interval h of the CUSUM, in standard deviations."""
SINGLE = 4.0
"""Standard deviations beyond which one value alone is an alarm."""
_JUDGE = 5
"""Values by which the scatter of setting-up is judged, at least."""
_NORMAL = 0.9539
"""Median of |a − b| of two normal values, over their standard deviation: √2 · 0.6745."""
_LEAST = 1e-9


@dataclass(frozen=True)
class Drift:
    """The control chart of one test value."""

    score: Floats
    """(n,) each value against the mean of all before it, in standard deviations; 0 for the first.
    """
    up: Floats
    """(n,) the upper sum."""
    down: Floats
    """(n,) the lower sum."""
    scatter: float
    """mm: standard deviation of setting-up that was allowed for."""

    def __post_init__(self) -> None:
        n = len(self.score)
        for name in ("score", "up", "down"):
            object.__setattr__(self, name, frozen(getattr(self, name), (n,), f"Drift.{name}"))

    @property
    def alarm(self) -> Bools:
        """(n,) True where a sum has passed its limit, or the value its own."""
        beyond = np.maximum(self.up, self.down) > ALARM
        return np.asarray(beyond | (np.abs(self.score) > SINGLE))


def drift(values: npt.ArrayLike, noise: npt.ArrayLike, scatter: float | None = None) -> Drift:
    """A self-starting Shewhart-CUSUM chart of the values (n,) mm of one test, in order of time.

    Each value is compared with the weighted mean of all before it, by the standard uncertainty of
    both: for values that only scatter, these scores are independent and standard normal (recursive
    residuals: Brown, Durbin and Evans, J. R. Stat. Soc. B 37 (1975) 149; as a control chart:
    Hawkins, The Statistician 36 (1987) 299). Two sums, S = max(0, S ± score − 0.5), alarm above 5
    (Page, Biometrika 41 (1954) 100), which finds what wanders, and an alarm where a score is beyond
    4, which finds what jumps (Lucas, J. Qual. Technol. 14 (1982) 51): a false alarm about once in
    450 values (465 by the sums alone), and a shift by 6.5 standard deviations at the first value
    that has it, after two without, in nine of ten cases.

    ``noise`` (n,) mm is the standard uncertainty of each value by itself; ``scatter`` mm the
    standard deviation of setting the artefact up again, which comes on top. Without it, it is taken
    from the median difference of successive values where there are at least 5, which a step does
    not spoil, and 0 before.

    Raises InputError where lengths differ or a noise is negative or not finite.
    """
    x, u = np.asarray(values, dtype=np.float64), np.asarray(noise, dtype=np.float64)
    if x.ndim != 1 or x.shape != u.shape or not np.isfinite(x).all():
        raise InputError(f"drift: {x.shape} values and {u.shape} uncertainties")
    if not (np.isfinite(u) & (u >= 0)).all():
        raise InputError(
            "drift: an uncertainty that is not above 0", hint="give standard uncertainties"
        )
    spread = _scatter(x, u) if scatter is None else scatter
    variance = np.maximum(u**2 + spread**2, _LEAST**2)
    score = _scores(x, variance)
    return Drift(score, _sums(score), _sums(-score), spread)


def _scores(x: Floats, variance: Floats) -> Floats:
    """Recursive residuals: each value against the weighted mean of those before it."""
    weight = np.cumsum(1.0 / variance)
    mean = np.cumsum(x / variance) / weight
    score = np.zeros(len(x))
    score[1:] = (x[1:] - mean[:-1]) / np.sqrt(variance[1:] + 1.0 / weight[:-1])
    return score


def _sums(score: Floats) -> Floats:
    total, out = 0.0, np.zeros(len(score))
    for k, z in enumerate(score):
        total = max(0.0, total + float(z) - ALLOWANCE)
        out[k] = total
    return out


def _scatter(x: Floats, u: Floats) -> float:
    if len(x) < _JUDGE:
        return 0.0
    each = float(np.median(np.abs(np.diff(x)))) / _NORMAL
    return float(np.sqrt(max(each**2 - float(np.median(u)) ** 2, 0.0)))
