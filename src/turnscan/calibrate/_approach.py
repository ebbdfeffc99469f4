"""From a rig that is millimetres off to one near the truth, by a body, from several beginnings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._bodies import Body, Form, Known
from turnscan.calibrate._bodies_found import again, find_body, refuse_other_unit
from turnscan.calibrate._gaps import adjusted, gap_of, network_of
from turnscan.calibrate._part import Loose, Part, Placement
from turnscan.calibrate._prior import prior_of
from turnscan.calibrate._surfaces import Surfaces
from turnscan.calibrate._sweeps import Sweep, doubt_of
from turnscan.errors import CalibrationError, DidNotConverge
from turnscan.progress import Progress
from turnscan.rig import Rig, rotation_z

_NEAR = 1.6
"""Times the noise: surfaces that are no farther apart agree, but for points beside the body."""
_STARTS, _ROUNDS = 16, 12
_WAYS = 4
"""In which a drawn part may stand, that are tried from each beginning."""
_POINTS = 300
"""Of each sweep, that are looked at: where a rig is far off, gaps are larger than their noise."""
_FINER = 0.3
"""By how much finer surfaces are held against each other from round to round."""
_STRAYED = 3.0
"""Standard uncertainties, rms, that a rig may be off what was known of it."""
_EACH = 0.5
"""Of the progress that is left, for each search and start: most need one."""


@dataclass(frozen=True)
class _End:
    """Where one start led."""

    state: Surfaces
    times: float
    """Of their noise: how far the points are off the body, rms."""


class _Ahead:
    """Progress of work that is done again an unknown number of times."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._begin = progress, 0.0

    def __call__(self, text: str) -> Progress:
        """That of the next piece of it."""
        begin = self._begin
        self._begin += _EACH * (1 - begin)
        return self._progress.subrange(begin, self._begin, text)


def approach(
    rig: Rig,
    state: Surfaces,
    sweeps: Sequence[Sweep],
    free: Bools,
    body: tuple[Form, tuple[Known | None, ...]],
    doubt: float,
    progress: Progress,
) -> Surfaces:
    """A state in which the points lie on the body to about their noise.

    Far from the truth a gap says little: rounds in which the gaps hardly weigh come first, and
    what is known of the rig leads. Equations that are so far from straight have more than one
    solution. The rig as it is known is one start, and others are drawn from its uncertainty, until
    one leads to surfaces that agree within that uncertainty; the table's own errors wait. A drawn
    part stands in more than one way for each of them.
    ``doubt`` mm is how far the rig puts points beside their places.

    Raises Degenerate where there is no such body, DidNotConverge where no start leads to one.
    """
    few = tuple(_thin(sweep) for sweep in sweeps)
    own = len(rig.parameter_names)
    moves = free & (np.arange(len(free)) < own)
    ends = list[_End]()
    failed: CalibrationError | None = None
    ahead = _Ahead(progress)
    for k, start in enumerate(_starts(rig, few, moves[:own], body, doubt, ahead)):
        part = ahead(f"fitting the surfaces, start {k + 1}")
        try:
            end = _led(rig, start(), state, few, moves, part)
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
    return min(ends, key=lambda e: e.times).state


@dataclass(frozen=True)
class _Start:
    """Where the search for a rig may begin."""

    rig: Rig
    body: Body
    doubt: float
    """mm by which points may lie beside it."""


def _starts(
    rig: Rig,
    sweeps: tuple[Sweep, ...],
    moves: Bools,
    body: tuple[Form, tuple[Known | None, ...]],
    doubt: float,
    ahead: _Ahead,
) -> Iterator[Callable[[], _Start]]:
    """What finds each start, the likeliest first; they raise Degenerate where there is no body."""
    form, known = body
    if not isinstance(form, Part):
        for k in range(_STARTS):
            begin = rig.perturbed(_drawn(rig, moves, k))
            yield partial(_found, form, known, sweeps, begin, doubt)
        return
    refuse_other_unit(form, _places(rig, sweeps), doubt)
    for k in range(_STARTS // _WAYS):
        begin = rig.perturbed(_drawn(rig, moves, k))
        yield from _standing(form, known, begin, sweeps, moves, ahead("placing the drawn part"))


def _found(
    form: Form, known: tuple[Known | None, ...], sweeps: tuple[Sweep, ...], rig: Rig, doubt: float
) -> _Start:
    return _Start(rig, find_body(form, known, sweeps, rig, doubt), doubt)


def _standing(
    form: Part,
    known: tuple[Known | None, ...],
    rig: Rig,
    sweeps: tuple[Sweep, ...],
    moves: Bools,
    progress: Progress,
) -> Iterator[Callable[[], _Start]]:
    """The ways in which a drawn part may stand, by all sweeps together: one alone fits in more."""
    ways = _spread(rig, moves)
    at = [_places(rig, sweeps)]
    for way in ways:
        ends = [_places(rig.perturbed(sign * way), sweeps) for sign in (0.5, -0.5)]
        at.append(ends[0] - ends[1])
    doubt = doubt_of(rig, sweeps) if len(ways) else 0.0
    modes = np.stack(at[1:], axis=2) if len(ways) else np.zeros((*at[0].shape, 0))
    camera = rig.T_camera_table.inverse().translation
    eyes = np.concatenate([(rotation_z(-s.angles) @ camera)[s.step] for s in sweeps])
    towards = eyes - at[0]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    for placed in form.placements(Loose(at[0], towards, modes), doubt, _WAYS, progress):
        yield partial(_stood, form, known, sweeps, rig.perturbed(placed.off @ ways), placed)


def _stood(
    form: Part,
    known: tuple[Known | None, ...],
    sweeps: tuple[Sweep, ...],
    rig: Rig,
    placed: Placement,
) -> _Start:
    there = [s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps]
    body = Body(form, placed.pose, np.ones(1), known, tuple(np.arange(len(a)) for a in there))
    return _Start(rig, again(body, there), placed.gap)


def _places(rig: Rig, sweeps: Sequence[Sweep]) -> Floats:
    """(n, 3) mm: all points of the sweeps."""
    return np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps])


def _led(
    known: Rig,
    start: _Start,
    state: Surfaces,
    sweeps: tuple[Sweep, ...],
    free: Bools,
    progress: Progress,
) -> _End:
    """The end of one start. Raises CalibrationError where it strays."""
    begin, found, form = start.rig, start.body, start.body.form
    now = replace(state, rig=_like(begin, state.rig), bodies=(found,))
    count = np.count_nonzero(free) + len(found.names)
    free = np.concatenate([free, np.ones(len(found.names), dtype=bool)])
    points = sum(len(sweep.pixels) for sweep in sweeps)
    coarse = start.doubt * float(np.sqrt(points / count))
    for k in range(_ROUNDS):
        network = network_of(begin, now, sweeps, free, 0.0, 0, coarse)
        now = adjusted(network, now, free, None, told=True).state
        refuse_strayed(known, now.rig, form.name)
        gap, noise, _ = gap_of(network_of(begin, now, sweeps, free, 0.0, 0), now)
        progress((k + 1) / _ROUNDS)
        if coarse == 0.0 or (k > 2 and gap <= noise):
            break
        coarse = _FINER * coarse if _FINER * coarse > noise else 0.0
    return _End(now, gap / noise)


def _spread(rig: Rig, free: Bools) -> Floats:
    """(m, p) independent directions in which the rig may be off, by 1 standard uncertainty each."""
    count = 0 if rig.covariance is None else int(np.count_nonzero(free))
    out = np.zeros((count, len(free)))
    if rig.covariance is not None:
        values, vectors = np.linalg.eigh(rig.covariance[np.ix_(free, free)])
        out[:, free] = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return out


def _drawn(rig: Rig, free: Bools, k: int) -> Floats:
    """(p,) a start: 0 is the rig as it is, others are drawn from its uncertainty."""
    ways = _spread(rig, free)
    if not k or not len(ways):
        return np.zeros(len(free))
    drawn: Floats = np.random.default_rng(k).standard_normal(len(ways)) @ ways
    return drawn


def _like(begin: Rig, rig: Rig) -> Rig:
    """``rig`` with camera, sheets and table of another."""
    return replace(
        rig, camera=begin.camera, sheets=begin.sheets, T_camera_table=begin.T_camera_table,
        wobble=begin.wobble,
    )  # fmt: skip


def refuse_strayed(known: Rig, rig: Rig, body: str = "") -> None:
    """Raise DidNotConverge for a rig that is further off what was ``known`` than that allows.

    Surfaces of a part with few directions agree in rigs that are far from the truth; what was known
    is all that tells. ``body`` is the name of what was scanned, where it is known.
    """
    stages = {n.rpartition(".")[0] for n in known.parameter_names}
    prior = prior_of(known, rig, stages)
    off = 0.0 if prior is None else float(np.sqrt(np.mean(prior.residual(rig) ** 2)))
    if off > _STRAYED:
        what = f", is the {body} the one that was scanned" if body else ""
        raise DidNotConverge(
            f"the rig strays from what is known of it, by {off:.1f} standard uncertainties (rms)",
            hint=f"is the rig the right one{what}, and may its numbers be farther off? A ball or "
            "another part that faces in all directions determines more",
        )


def _thin(sweep: Sweep) -> Sweep:
    some = np.unique(np.linspace(0, len(sweep.pixels) - 1, _POINTS).astype(np.intp))
    return replace(sweep, pixels=sweep.pixels[some], sigma=sweep.sigma[some], step=sweep.step[some])
