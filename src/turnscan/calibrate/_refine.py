"""A rig made better without a board: what two lasers see of one part must be one surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._bodies import Body, Form, Known
from turnscan.calibrate._bodies_found import again, find_body, refuse_ends
from turnscan.calibrate._patches import patches_under
from turnscan.calibrate._prior import moved_by, prior_of
from turnscan.calibrate._quality import Measured
from turnscan.calibrate._shared import with_shared_noise
from turnscan.calibrate._surfaces import (
    WEAK,
    Pair,
    SurfaceNetwork,
    Surfaces,
    Sweep,
    doubt_of,
    gauge_of,
    motion_known,
    noise_of,
    not_below,
    thinned,
)
from turnscan.errors import Degenerate, DidNotConverge
from turnscan.rig import Rig, TableMotion

ORDERS = 3
"""Largest number of waves per turn in the model of the table's motion."""
_SETTLED = 0.1
"""Standard deviations: less than this, and another round changes nothing."""
_REACH_MM = 8.0
"""How far apart two surfaces may be at first."""
_FINER, _NEAR, _ROUGH_ROUNDS = 0.3, 1.2, 20
"""By how much finer surfaces are held against each other from round to round where the rig may be
far off, and how many such rounds there are at most."""
_FEWEST = 100
"""Places where two surfaces meet, below which nothing is said of a rig."""
_NO_FIT, _LEAST_MM = 3.0, 0.01
"""Times the noise, and mm of noise at least: surfaces farther apart have another cause."""
_TOLD = 0.5
"""Of what was known before: a parameter that stays less certain than this was told little."""
_MATERIAL = 0.2
"""Of the stripe's noise, rms: what moves the surfaces by less is not told from errors that stripes
have on tilted surfaces."""


@dataclass(frozen=True)
class RefineSettings:
    """What may move, and what is known of the part."""

    camera: bool = False
    """Whether the camera may move, too, within its uncertainty."""
    geometry: bool = True
    """Whether sheets and axis may move within their uncertainty."""
    body: tuple[Form, tuple[Known | None, ...]] | None = None
    """What the part is, and its sizes with their standard uncertainties, mm and rad; None for one
    that is free."""
    rounds: int = 12
    """How often surfaces are held against each other, at most, once the rig is near the truth."""
    queries: int = 4000
    """Places of each surface that are looked at, at most."""


@dataclass(frozen=True)
class Refined:
    """A rig that fits what scans of a part show."""

    rig: Rig
    gap_before: float
    """mm rms between the surfaces (or from the sphere) as the rig had them before."""
    gap_after: float
    gap_noise: float
    """mm rms that the stripes' own noise makes."""
    places: int
    """Where surfaces met."""
    estimated: dict[str, Measured]
    """Parameters that moved, by name; rig: how far, mm or rad; motion and sizes of bodies: their
    value, rad or mm."""
    held: tuple[str, ...]
    """What the scans say nothing of: it stays as it was known; ``scale`` is that of all lengths."""
    dropped: tuple[str, ...]
    """Errors of the table that the scans do not ask for."""
    fit: Fit[Surfaces]


def refine(
    rig: Rig,
    sweeps: Sequence[Sweep],
    settings: RefineSettings | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Refined:
    """Adjust table motion, sheets and axis until all surfaces of a part agree.

    Each point of a sweep is held against the patch of every other sweep's points under it; what was
    known of the rig (its covariance) counts as observations, and what it does not doubt is held.
    Errors of the table (harmonics, play) are kept where Bayes' information criterion asks for them.
    A body of known form counts like a surface that is known, and known sizes of it give the scale.
    Where the rig's uncertainty is of millimetres, such a body is what it takes: rounds that hardly
    weigh the gaps come first, in which what is known of the rig leads. ``tick`` is called after
    each round but these.
    Pang et al., Tool-free calibration of a turntable, is the nearest published relative.

    Raises Degenerate where surfaces do not overlap or leave a parameter undetermined that nothing
    else is known of, DidNotConverge.
    """
    s = settings or RefineSettings()
    many = tuple(thinned(sweep, rig) for sweep in sweeps)
    moving = any(sweep.moved for sweep in many)
    motion = TableMotion(np.zeros((ORDERS if moving else 0, 2)))
    if rig.motion is not None:
        waves = np.zeros((max(ORDERS, len(rig.motion.harmonics)), 2))
        waves[: len(rig.motion.harmonics)] = rig.motion.harmonics
        motion = replace(rig.motion, harmonics=waves, covariance=None)
    state = Surfaces(replace(rig, covariance=None, motion=motion))
    doubt = doubt_of(rig, many) if s.geometry else 0.0
    if s.body is not None:
        state = replace(state, bodies=(find_body(*s.body, many, state.rig, doubt),))
    free = _free(rig, state, many, s)
    fit: Fit[Surfaces] | None = None
    first = (float("nan"), float("nan"), 0)
    # A body needs no neighbours: while surfaces may lie anywhere, it alone is held against them.
    far = doubt > _REACH_MM / 2
    reach = 0.0 if s.body is not None and far else max(_REACH_MM, 2 * doubt)
    # Far from the truth a gap says little, and what is known of the rig keeps it from straying.
    each = sum(len(sweep.pixels) for sweep in many) / max(free.sum(), 1)
    coarse = doubt * float(np.sqrt(each)) if far else 0.0
    fine = max(float(np.median(np.abs(noise_of(sweep, rig)))) for sweep in many)
    exact = rough = 0
    while exact < s.rounds and rough < _ROUGH_ROUNDS:
        if fit is not None and not far:
            at = [sweep.points(state.rig, state.rig.camera.rays(sweep.pixels)) for sweep in many]
            state = replace(state, bodies=tuple(again(body, at) for body in state.bodies))
        network = _network(rig, state, many, free, reach, s, coarse)
        now = _gap(network, state)
        if fit is None:
            first = now
        fit = _adjusted(network, state, free, fit, told=far)
        moved, state = _moved(state, fit), fit.state
        after = _gap(network, state)
        reach = min(max(6 * after[0], 4 * after[1]), _REACH_MM)
        if moved < _SETTLED and not far:
            break
        if far:
            rough += 1
        else:
            exact += 1
            tick()
        coarse = _FINER * coarse if _FINER * coarse > fine else 0.0
        far = far and (coarse > 0 or after[0] > _NEAR * after[1])
    assert fit is not None
    for body in fit.state.bodies:
        refuse_ends(body, sum(len(sweep.pixels) for sweep in many))
    fit, free, dropped = _simplest(network, with_shared_noise(network, fit, free), free)
    last = _gap(network, fit.state)
    if last[0] > _NO_FIT * max(last[1], _LEAST_MM):
        raise Degenerate(
            f"the surfaces stay {last[0]:.3f} mm apart where the stripe's noise makes "
            f"{last[1]:.3f} mm: no rig near this one explains the scan",
            hint="did the part move, is it the body that was named, and is the rig the right one?",
        )
    return _told(rig, network, fit, free, dropped, first[0], last)


def _adjusted(
    network: SurfaceNetwork,
    state: Surfaces,
    free: Bools,
    near: Fit[Surfaces] | None,
    told: bool,
) -> Fit[Surfaces]:
    try:
        return adjust(network, state, free, near=None if told else near, told=told)
    except (DidNotConverge, np.linalg.LinAlgError):
        raise DidNotConverge(
            "the surfaces come to no rest against each other",
            hint="begin with a rig nearer to the truth (measure again with a ruler), or with one "
            "whose uncertainties say how far it may be off",
        ) from None


def _with_what_was_known(told: Floats, before: Rig, state: Surfaces, free: Bools) -> Floats:
    """(q, q) covariance of the table's motion: of what was held, that of before."""
    known, out = before.motion, np.array(told)
    if known is None or known.covariance is None:
        return out
    names = state.motion.names
    kept = [k for k, n in enumerate(names) if not free[k] and n in known.names]
    old = [known.names.index(names[k]) for k in kept]
    out[np.ix_(kept, kept)] = known.covariance[np.ix_(old, old)]
    return out


def _moved(before: Surfaces, fit: Fit[Surfaces]) -> float:
    """By how many standard deviations the parameter moved that moved most."""
    after = fit.state
    off = np.concatenate(
        [moved_by(before.rig, after.rig), after.motion.values - before.motion.values,
         *(_body_moved(a, b) for a, b in zip(after.bodies, before.bodies, strict=True))]
    )  # fmt: skip
    sigma = np.sqrt(np.diag(fit.covariance))
    return float(np.max(np.abs(off[sigma > 0]) / sigma[sigma > 0], initial=0.0))


def _body_moved(now: Body, before: Body) -> Floats:
    """(q,) by which one body leads to the other, to first order."""
    m = now.form.moves.shape[1]
    turn = before.pose.rotation.T @ now.pose.rotation
    small = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    shift = before.pose.rotation.T @ (now.pose.translation - before.pose.translation)
    motion = now.form.moves.T @ np.concatenate([small / 2, shift])
    return np.concatenate([motion[:m], now.sizes - before.sizes])


def _free(rig: Rig, state: Surfaces, sweeps: Sequence[Sweep], s: RefineSettings) -> Bools:
    names = SurfaceNetwork(tuple(sweeps), (), state, np.zeros(0, bool)).names
    own, motion = rig.parameter_names, state.motion.names
    free = np.zeros(len(names), dtype=bool)
    if rig.covariance is not None and s.geometry:
        free[: len(own)] = np.diag(rig.covariance) > 0
        if not s.camera:
            free[[k for k, n in enumerate(own) if n.startswith("camera.")]] = False
    moved = [sweep for sweep in sweeps if sweep.moved]
    if moved:
        free[len(own) : len(own) + len(motion)] = True
        back = any(np.ptp(np.sign(np.diff(np.unwrap(sweep.angles)))) > 0 for sweep in moved)
        free[len(own) + motion.index("motion.backlash")] = back
    free[len(own) + len(motion) :] = True
    return free


def _network(
    rig: Rig,
    state: Surfaces,
    sweeps: tuple[Sweep, ...],
    free: Bools,
    reach: float,
    s: RefineSettings,
    coarse: float = 0.0,
) -> SurfaceNetwork:
    """What meets what in the present state; ``coarse`` mm is how little a gap says besides."""
    names = state.rig.parameter_names
    stages = {n.rpartition(".")[0] for n, f in zip(names, free, strict=False) if f}
    prior = prior_of(rig, state.rig, stages) if stages else None
    network = SurfaceNetwork(sweeps, (), state, free, prior, rig.motion)
    at = network.places(state.rig)
    noise = [noise_of(sweep, state.rig) for sweep in sweeps]
    pairs = []
    for a in range(len(sweeps)):
        for b in range(len(sweeps)):
            if a == b:
                continue
            some = np.unique(np.linspace(0, len(at[a]) - 1, s.queries).astype(np.intp))
            found = patches_under(at[a][some], at[b], noise[b], reach)
            found = replace(found, query=some[found.query])
            if len(found.query) < _FEWEST:
                continue
            own = np.einsum("mi,mi->m", found.normal, noise[a][found.query])
            theirs = -found.weights * np.einsum("mi,mki->mk", found.normal, noise[b][found.near])
            sigma = np.hypot(not_below(np.sqrt(own**2 + (theirs**2).sum(axis=1))), coarse)
            pairs.append(Pair(a, b, found, own, theirs, sigma))
    if not pairs and not state.bodies:
        raise Degenerate(
            "no two surfaces overlap where they are smooth: one laser sees each place once in a "
            "turn, and where a part bends much from step to step no surface is known",
            hint="scan with two lasers, in smaller steps, or a body of known size",
        )
    on_bodies = tuple(
        tuple(
            np.einsum("mi,mi->m", body.distance(where[which])[1], moved[which])
            for where, moved, which in zip(at, noise, body.points, strict=True)
        )
        for body in state.bodies
    )
    sigmas = tuple(
        tuple(np.hypot(not_below(np.abs(own)), coarse) for own in one) for one in on_bodies
    )
    return replace(network, pairs=tuple(pairs), body_noise=on_bodies, body_sigma=sigmas)


def _gap(network: SurfaceNetwork, state: Surfaces) -> tuple[float, float, int]:
    """rms of the gaps (without the farthest hundredth), rms of their noise, number of places."""
    at = network.places(state.rig)
    gaps = [p.patches.gaps(at[p.asked], at[p.others]) for p in network.pairs]
    sigma = [p.sigma for p in network.pairs]
    for body, own in zip(state.bodies, network.body_sigma, strict=True):
        for i, which in enumerate(body.points):
            gaps.append(body.distance(at[i][which])[0])
            sigma.append(own[i])
    all_gaps, all_sigma = np.abs(np.concatenate(gaps)), np.concatenate(sigma)
    near = all_gaps <= np.quantile(all_gaps, 0.99)
    rms = float(np.sqrt(np.mean(all_gaps[near] ** 2)))
    return rms, float(np.sqrt(np.mean(all_sigma[near] ** 2))), len(all_gaps)


def _simplest(
    network: SurfaceNetwork, fit: Fit[Surfaces], free: Bools
) -> tuple[Fit[Surfaces], Bools, tuple[str, ...]]:
    """The fit without those errors of the table that do not earn their parameters.

    Wald's statistic of a group of k parameters is what they lower χ² by; Bayes' information
    criterion asks for k·ln n. The highest order goes first, as a wheel of order 1 is a commoner
    thing than one of order 3; those that the scans say nothing of go without being asked.
    """
    p = len(fit.state.rig.parameter_names)
    names = fit.state.motion.names
    orders = [(f"motion.cos{m}", f"motion.sin{m}") for m in range(ORDERS, 0, -1)]
    count = sum(len(b.residual) for b in fit.blocks)
    dropped: list[str] = []
    for group in [("motion.start",), ("motion.backlash",), *orders]:
        index = np.array([p + names.index(n) for n in group if n in names], dtype=np.intp)
        if not len(index) or not free[index].any():
            continue
        if (motion_known(names, network.known_motion)[1][index - p] < WEAK).all():
            continue  # it was estimated before: this scan adds to what is known
        values = fit.state.motion.values[index - p]
        C = fit.covariance[np.ix_(index, index)]
        weak = bool(np.diag(C).max() > (_TOLD * WEAK) ** 2)
        gain = float(values @ np.linalg.solve(C, values))
        if weak or gain < len(index) * np.log(count) or not _matters(fit, index, values):
            free = free.copy()
            free[index] = False
            network = replace(network, active=free)
            zero = fit.state.motion.values.copy()
            zero[index - p] = 0.0
            rig = replace(fit.state.rig, motion=TableMotion.of(zero))
            fit = _adjusted(network, replace(fit.state, rig=rig), free, fit, told=False)
            fit = with_shared_noise(network, fit, free)
            dropped += group
    return fit, free, tuple(dropped)


def _matters(fit: Fit[Surfaces], index: npt.NDArray[np.intp], values: Floats) -> bool:
    """Whether parameters move the surfaces that they move at all by enough to be believed."""
    moved = [b.common[:, index] @ values for b in fit.blocks if not b.kind.startswith("prior")]
    every = np.concatenate(moved)
    every = every[np.abs(every) > 1e-6]
    return bool(len(every)) and float(np.sqrt(np.mean(every**2))) > _MATERIAL


def _along_sight(rig: Rig, covariance: Floats | None = None) -> float:
    """Standard uncertainty of the distance between camera and table, mm: all lengths go with it."""
    C = rig.covariance if covariance is None else covariance
    assert C is not None
    way = rig.T_camera_table.translation / np.linalg.norm(rig.T_camera_table.translation)
    return float(np.sqrt(way @ C[-3:, -3:] @ way))


def _told(
    before: Rig,
    network: SurfaceNetwork,
    fit: Fit[Surfaces],
    free: Bools,
    dropped: tuple[str, ...],
    gap_before: float,
    last: tuple[float, float, int],
) -> Refined:
    state, p = fit.state, len(before.parameter_names)
    q = len(state.motion.names)
    sigma = np.sqrt(np.diag(fit.covariance))
    moved = np.concatenate(
        [moved_by(replace(before, motion=None), state.rig), state.motion.values,
         *([*np.zeros(b.form.moves.shape[1]), *b.sizes] for b in state.bodies)]
    )  # fmt: skip
    held = []
    covariance = None
    if before.covariance is not None:
        old = np.sqrt(np.diag(before.covariance))
        covariance = np.array(before.covariance)
        part = np.flatnonzero(free[:p])
        covariance[part, :] = 0.0
        covariance[:, part] = 0.0
        covariance[np.ix_(part, part)] = fit.covariance[np.ix_(part, part)]
        for gauge in gauge_of(before) if part.size else ():
            covariance += np.outer(gauge, gauge) * (gauge @ before.covariance @ gauge)
        held = [
            n for n, s, o, f in zip(before.parameter_names, sigma, old, free, strict=False)
            if f and s > _TOLD * o
        ]  # fmt: skip
        if part.size and _along_sight(state.rig, covariance) > _TOLD * _along_sight(before):
            held.append("scale")
    if (
        "motion.backlash" in state.motion.names
        and not free[p + state.motion.names.index("motion.backlash")]
        and "motion.backlash" not in dropped
    ):
        held.append("motion.backlash")
    motion = None
    if free[p : p + q].any() or before.motion is not None:
        told = fit.covariance[p : p + q, p : p + q]
        motion = replace(
            state.motion, covariance=_with_what_was_known(told, before, state, free[p:])
        )
    rig = replace(state.rig, covariance=covariance, motion=motion)
    estimated = {
        n: Measured(float(v), float(s))
        for n, v, s, f in zip(network.names, moved, sigma, free, strict=True)
        if f and ".place" not in n
    }
    return Refined(rig, gap_before, last[0], last[1], last[2], estimated, tuple(held), dropped, fit)
