"""From a rig that is millimetres off to one near the truth, by a body, from several beginnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._bodies import Form, Known, Smooth
from turnscan.calibrate._bodies_found import find_body
from turnscan.calibrate._gaps import adjusted, gap_of, network_of
from turnscan.calibrate._part import Part
from turnscan.calibrate._prior import prior_of
from turnscan.calibrate._surfaces import Surfaces, Sweep
from turnscan.errors import CalibrationError, DidNotConverge
from turnscan.progress import Progress
from turnscan.rig import Rig

_NEAR = 1.6
"""Times the noise: surfaces that are no farther apart agree, but for points beside the body."""
_STARTS, _ROUNDS = 16, 12
_POINTS = 300
"""Of each sweep, that are looked at: where a rig is far off, gaps are larger than their noise."""
_FINER = 0.3
"""By how much finer surfaces are held against each other from round to round."""
_STRAYED = 3.0
"""Standard uncertainties, rms, that a rig may be off what was known of it."""
_EACH = 0.5
"""Of the progress that is left, for each start: most need one."""


@dataclass(frozen=True)
class _End:
    """Where one start led."""

    state: Surfaces
    gap: float
    """mm rms by which the points are off the body."""
    times: float
    """The same in terms of their noise."""


def approach(
    rig: Rig,
    state: Surfaces,
    sweeps: Sequence[Sweep],
    free: Bools,
    body: tuple[Form, tuple[Known | None, ...]],
    doubt: float,
    progress: Progress,
) -> tuple[Surfaces, float]:
    """A state in which the points lie on the body to about their noise, and how far off they are.

    Far from the truth a gap says little: rounds in which the gaps hardly weigh come first, and
    what is known of the rig leads. Equations that are so far from straight have more than one
    solution. The rig as it is known is one start, and others are drawn from its uncertainty, until
    one leads to surfaces that agree within that uncertainty; the table's own errors wait.
    ``doubt`` mm is how far the rig puts points beside their places.

    Raises Degenerate where there is no such body, DidNotConverge where no start leads to one.
    """
    few = tuple(_thin(sweep) for sweep in sweeps)
    own = len(rig.parameter_names)
    moves = free & (np.arange(len(free)) < own)
    ends = list[_End]()
    failed: CalibrationError | None = None
    left = 0.0
    for k in range(_STARTS):
        part = progress.subrange(
            left, left + _EACH * (1 - left), f"fitting the surfaces, start {k + 1}"
        )
        left += _EACH * (1 - left)
        way, drawn = _way(k) if isinstance(body[0], Part) else (0, k)
        begin = rig.perturbed(_drawn(rig, moves[:own], drawn))
        try:
            end = _led(rig, begin, state, few, moves, (*body, doubt, way), part)
        except (CalibrationError, np.linalg.LinAlgError) as e:
            failed = failed or (e if isinstance(e, CalibrationError) else None)
            continue
        ends.append(end)
        if end.times <= _NEAR:
            break
    if not ends:
        raise failed or DidNotConverge(
            f"none of {_STARTS} starts leads to a rig that explains the scan",
            hint="measure the rig again with a ruler, and state how far its numbers may be off",
        )
    best = min(ends, key=lambda e: e.times)
    return best.state, best.gap


def _led(
    known: Rig,
    begin: Rig,
    state: Surfaces,
    sweeps: tuple[Sweep, ...],
    free: Bools,
    body: tuple[Form, tuple[Known | None, ...], float, int],
    progress: Progress,
) -> _End:
    """The end of one start, for a body, the doubt and the way in which a drawn one stands.

    Raises CalibrationError where it strays.
    """
    form, sizes, doubt, way = body
    found = find_body(form, sizes, sweeps, begin, doubt, way)
    now = replace(state, rig=_like(begin, state.rig), bodies=(found,))
    count = np.count_nonzero(free) + len(found.names)
    free = np.concatenate([free, np.ones(len(found.names), dtype=bool)])
    points = sum(len(sweep.pixels) for sweep in sweeps)
    coarse = doubt * float(np.sqrt(points / count))
    for k in range(_ROUNDS):
        network = network_of(begin, now, sweeps, free, 0.0, 0, coarse)
        now = adjusted(network, now, free, None, told=True).state
        if _off(known, now.rig) > _STRAYED:
            what = (
                "" if isinstance(form, Smooth) else f", is the {form.name} the one that was scanned"
            )
            raise DidNotConverge(
                "the rig strays from what is known of it",
                hint=f"is the rig the right one{what}, and may its numbers be farther off?",
            )
        gap, noise, _ = gap_of(network_of(begin, now, sweeps, free, 0.0, 0), now)
        progress((k + 1) / _ROUNDS)
        if coarse == 0.0 or (k > 2 and gap <= noise):
            break
        coarse = _FINER * coarse if _FINER * coarse > noise else 0.0
    return _End(now, gap, gap / noise)


def _way(k: int) -> tuple[int, int]:
    """In which way a drawn part stands at start ``k``, and from which draw: the likely ones first,
    (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2) …"""
    row = int((np.sqrt(8 * k + 1) - 1) / 2)
    drawn = k - row * (row + 1) // 2
    return row - drawn, drawn


def _drawn(rig: Rig, free: Bools, k: int) -> Floats:
    """(p,) a start: 0 is the rig as it is, others are drawn from its uncertainty."""
    delta = np.zeros(len(free))
    if k and rig.covariance is not None:
        values, vectors = np.linalg.eigh(rig.covariance[np.ix_(free, free)])
        dice = np.random.default_rng(k).standard_normal(len(values))
        delta[free] = vectors @ (np.sqrt(np.maximum(values, 0.0)) * dice)
    return delta


def _like(begin: Rig, rig: Rig) -> Rig:
    """``rig`` with camera, sheets and table of another."""
    return replace(
        rig, camera=begin.camera, sheets=begin.sheets, T_camera_table=begin.T_camera_table
    )


def _off(known: Rig, rig: Rig) -> float:
    """Standard uncertainties, rms, by which a rig is off what was known."""
    stages = {n.rpartition(".")[0] for n in known.parameter_names}
    prior = prior_of(known, rig, stages)
    if prior is None:
        return 0.0
    return float(np.sqrt(np.mean(prior.residual(rig) ** 2)))


def _thin(sweep: Sweep) -> Sweep:
    some = np.unique(np.linspace(0, len(sweep.pixels) - 1, _POINTS).astype(np.intp))
    return replace(sweep, pixels=sweep.pixels[some], sigma=sweep.sigma[some], step=sweep.step[some])
