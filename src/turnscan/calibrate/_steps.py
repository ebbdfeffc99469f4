"""The angles of a whole turn: outliers out, gaps filled, and what is odd about the steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, frozen
from turnscan.calibrate._unevenness import unevenness
from turnscan.errors import Degenerate, NotEnoughViews
from turnscan.findings import Finding

_HARMONICS = 3
_LEAST_ANGLES = 5
_AT_ONCE = 500_000
"""Phases that are computed in one array."""
_OUTLIER = 6.0  # robust sigmas
_MISREAD = 3.0  # steps: a table may lose or double one, a wrong marker is farther off
_ROUNDS = 10
_FLOOR = np.radians(0.002)  # no hobby or lab table is read better than this by a picture
_SENSIBLE = np.radians(0.25)  # deviation from even steps that is worth a warning whatever σ says


@dataclass(frozen=True)
class AngleModel:
    """One angle per picture, and how even the steps are."""

    angles: Floats
    """(n,) rad, unwrapped: a full turn ends 2π from where it began."""
    sigmas: Floats
    """(n,) rad, standard uncertainty of `angles`."""
    measured: Bools
    """(n,) True where the angle comes from its own picture, False where it was filled in."""
    step: float
    """rad per step number, of the even motion nearest to the angles; negative when clockwise."""
    deviation: Floats
    """(n,) rad: angle minus even motion; NaN where filled in."""
    findings: tuple[Finding, ...]

    def __post_init__(self) -> None:
        n = len(self.angles)
        object.__setattr__(self, "angles", frozen(self.angles, (n,), "angles"))
        object.__setattr__(self, "sigmas", frozen(self.sigmas, (n,), "sigmas"))
        object.__setattr__(self, "measured", frozen(self.measured, (n,), "measured", np.bool_))
        object.__setattr__(self, "deviation", frozen(self.deviation, (n,), "deviation", nan=True))


def angle_model(
    angles: npt.ArrayLike,
    sigmas: npt.ArrayLike,
    step_numbers: npt.ArrayLike | None = None,
    nominal_step: float | None = None,
    names: Sequence[str] = (),
) -> AngleModel:
    """Fill in and check the angles of a turn.

    ``angles`` (n,) rad, wrapped or not, NaN where a picture gave none; ``sigmas`` (n,) rad,
    NaN there too; ``step_numbers`` (n,) say how many steps the table was sent (default 0, 1, 2 …);
    ``nominal_step`` rad per step number, if one was specified: it is compared, never trusted.

    The model is an even motion, plus harmonics of the table angle where there is more than half
    a turn and they explain more than their number does by chance. An angle far from what its
    neighbours and the model say is an outlier and is filled in like a missing one. Where the motor
    really is uneven the angles keep what their pictures say: each is the mean of picture and model
    weighted by their scatters.

    Raises NotEnoughViews below five angles, Degenerate when no steady motion explains them.
    """
    a = np.array(angles, dtype=np.float64)
    s = np.maximum(np.array(sigmas, dtype=np.float64), _FLOOR)
    k = np.arange(len(a), dtype=np.float64)
    if step_numbers is not None:
        k = np.array(step_numbers, dtype=np.float64)
    if not a.shape == s.shape == k.shape or a.ndim != 1:
        raise ValueError(f"angle_model: shapes {a.shape}, {s.shape}, {k.shape} differ")
    have = np.isfinite(a) & np.isfinite(s)
    if np.count_nonzero(have) < _LEAST_ANGLES:
        raise NotEnoughViews(
            f"table angles: {np.count_nonzero(have)} of {len(a)} pictures show a marker; "
            f"at least {_LEAST_ANGLES} are needed",
            hint="uncover the markers, or give the angles in another way",
        )
    a[have] = _unwrapped(k[have], a[have], nominal_step)
    good = _without_jumps(k, a, have)
    fit, step, start = _smooth(k, a, s, good, nominal_step)
    residual = a - fit
    scatter = 1.4826 * float(np.median(np.abs(residual[good] - np.median(residual[good]))))
    limit = max(_OUTLIER * scatter, _MISREAD * abs(step), float(_SENSIBLE))
    good &= np.abs(np.where(good, residual, 0.0)) <= limit
    fit, step, start = _smooth(k, a, s, good, nominal_step)
    residual = a - fit
    spread2 = max(float(np.mean(residual[good] ** 2) - np.median(s[good] ** 2)), float(_FLOOR) ** 2)
    weight = 1 / s**2 + 1 / spread2
    gap = np.interp(k, *_by_step(k[good], residual[good]))
    best = np.where(good, fit + residual / s**2 / np.where(good, weight, 1.0), fit + gap)
    sigma = np.where(good, 1 / np.sqrt(np.where(good, weight, 1.0)), np.sqrt(2 * spread2))
    deviation = np.where(good, a - (start + step * k), np.nan)
    found = unevenness(k, best, sigma, good, names)
    found += _findings(k, best, sigma, deviation, have, good, step, nominal_step)
    return AngleModel(best, sigma, good, step, deviation, tuple(found))


def _by_step(k: Floats, values: Floats) -> tuple[Floats, Floats]:
    order = np.argsort(k, kind="stable")
    return k[order], values[order]


def _unwrapped(k: Floats, a: Floats, nominal: float | None) -> Floats:
    """Undo the wrap at ±π with the steady motion that explains most of the angles."""
    phase = np.exp(1j * a)
    if len(np.unique(k)) < 2:
        raise Degenerate(
            "table angles: all pictures have the same step number",
            hint="number the pictures by the steps of the table",
        )
    smallest = float(np.min(np.diff(np.unique(k))))
    limit = np.pi / smallest
    span = float(np.ptp(k))
    if nominal is None:
        tries = np.linspace(-limit, limit, int(8 * limit * span / np.pi) + 3)
    else:
        # A promised step tells turns apart that the pictures alone cannot.
        some = nominal * np.linspace(0.5, 1.5, 4001)
        tries = np.concatenate([some, -some])
    pieces = np.array_split(tries, 1 + len(tries) * len(k) // _AT_ONCE)
    fit = np.concatenate([np.abs(np.exp(-1j * np.outer(part, k)) @ phase) for part in pieces])
    step = float(tries[fit.argmax()])
    if fit.max() < 0.5 * len(a):
        raise Degenerate(
            "table angles: no uniform motion fits the angles given by the markers",
            hint="check that the pictures are in the order in which they were taken",
        )
    start = float(np.angle(np.sum(phase * np.exp(-1j * step * k))))
    even = start + step * k
    wrapped: Floats = even + np.angle(np.exp(1j * (a - even)))
    return wrapped


def _without_jumps(k: Floats, a: Floats, have: Bools) -> Bools:
    """Drop single angles that stand far off both neighbours: a marker read wrongly."""
    index = np.flatnonzero(have)
    index = index[np.argsort(k[index], kind="stable")]
    x, y = k[index], a[index]
    slope, offset = np.polyfit(x, y, 1)
    rest = y - slope * x - offset
    padded = np.pad(rest, 3, mode="reflect")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1)
    off = np.abs(rest - around)
    scale = 1.4826 * float(np.median(off))
    good = have.copy()
    good[index[off > max(_OUTLIER * scale, _MISREAD * abs(slope), float(_SENSIBLE))]] = False
    return good


def _smooth(
    k: Floats, a: Floats, s: Floats, good: Bools, nominal: float | None
) -> tuple[Floats, float, float]:
    """Even motion, and harmonics where they pay → model (n,), step, start of the even motion."""
    slope, offset = np.polyfit(k[good], a[good], 1)
    even = slope * k + offset
    turn = float(np.ptp(even[good]))
    if turn < np.pi or np.count_nonzero(good) < 4 * (2 * _HARMONICS + 2):
        return even, float(slope), float(offset)
    waves = [f(m * even) for m in range(1, _HARMONICS + 1) for f in (np.cos, np.sin)]
    design = np.stack([np.ones_like(k), k, *waves], axis=1)
    solved = _huber(design[good], a[good])
    wavy = design @ solved
    plain = float(np.sum((a - even)[good] ** 2))
    better = float(np.sum((a - wavy)[good] ** 2))
    n = int(np.count_nonzero(good))
    # Bayes' information criterion: six waves must earn their six numbers.
    if n * np.log(max(better, 1e-300) / max(plain, 1e-300)) + 2 * _HARMONICS * np.log(n) < 0:
        return wavy, float(slope), float(offset)
    return even, float(slope), float(offset)


def _huber(design: Floats, values: Floats) -> Floats:
    weight = np.ones(len(values))
    solved: Floats = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        solved = np.asarray(np.linalg.lstsq(design * root, values * root[:, 0], rcond=None)[0])
        rest = values - design @ solved
        scale = max(1.4826 * float(np.median(np.abs(rest))), 1e-12)
        weight = 1.0 / np.maximum(np.abs(rest) / (2 * scale), 1.0)
    return solved


def _findings(
    k: Floats,
    angles: Floats,
    sigmas: Floats,
    deviation: Floats,
    have: Bools,
    good: Bools,
    step: float,
    nominal: float | None,
) -> list[Finding]:
    out: list[Finding] = []
    deg = np.degrees
    worst = float(np.nanmax(np.abs(deviation)))
    noise = float(np.median(sigmas[good]))
    span = float(np.ptp(k[good]))
    step_sigma = noise / max(span, 1.0) * 3.5 + worst / max(span, 1.0) / 2
    if nominal is not None and abs(abs(step) - abs(nominal)) > max(4 * step_sigma, 1e-9):
        out.append(
            Finding(
                "calibrate.step-size",
                "warning",
                f"the mean step is {deg(abs(step)):.4f}° ± {deg(step_sigma):.4f}°, but "
                f"{deg(abs(nominal)):.4f}° was specified: {deg(abs(step) * span):.2f}° instead of "
                f"{deg(abs(nominal) * span):.2f}° over the {span:g} steps seen",
                remedy="take the angles from the markers, or give the step that was measured",
            )
        )
    missing = int(np.count_nonzero(~have))
    dropped = np.flatnonzero(have & ~good)
    if missing or len(dropped):
        out.append(
            Finding(
                "calibrate.angle-filled",
                "note" if missing + len(dropped) < 0.2 * len(k) else "warning",
                f"{missing} pictures show no marker and {len(dropped)} give an angle far from "
                "their neighbours'; those angles come from the motion of the rest",
                where=", ".join(f"step {k[i]:g}" for i in dropped[:5]),
            )
        )
    out.append(
        Finding(
            "calibrate.turn",
            "note",
            f"the table turns {'counter-clockwise' if step > 0 else 'clockwise'} seen from above, "
            f"{deg(abs(float(np.ptp(angles)))):.2f}° between the first and the last picture",
        )
    )
    return out
