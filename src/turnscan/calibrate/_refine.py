"""A rig made better without a board: what two lasers see of one part must be one surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import Fit
from turnscan.calibrate._advice import Advice
from turnscan.calibrate._approach import approach, refuse_strayed
from turnscan.calibrate._bodies import Body, Form, Known
from turnscan.calibrate._bodies_found import again, find_body, refuse_ends
from turnscan.calibrate._gaps import adjusted, gap_of, network_of
from turnscan.calibrate._part import Part
from turnscan.calibrate._prior import moved_by
from turnscan.calibrate._quality import Measured
from turnscan.calibrate._refine_advice import refine_advice
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.calibrate._shape import shape_doubt
from turnscan.calibrate._shared import with_shared_noise
from turnscan.calibrate._surfaces import (
    WEAK,
    SurfaceNetwork,
    Surfaces,
    gauge_of,
    known_together,
    motion_known,
)
from turnscan.calibrate._sweeps import Sweep, doubt_of, thinned, turns_of
from turnscan.calibrate._words import amount_in_words, parameter_in_words
from turnscan.errors import Degenerate, DidNotConverge
from turnscan.progress import Progress, no_progress
from turnscan.rig import Pose, Rig, TableMotion

ORDERS = 3
"""Largest number of waves per turn in the model of the table's motion."""
_SETTLED = 0.1
"""Standard deviations: less than this, and another round changes nothing."""
_REACH_MM, _FAR_MM = 8.0, 4.0
"""How far apart two surfaces may be at first, and how far a rig may put a point beside its place
before that has to be made less."""
_REACHES = 6.0
"""Times the usual gap of poses that were found by shape: farther apart is another surface."""
_WIDE = 3.0
"""Times what is known of how far a rig may put points aside: so far surfaces may be apart."""
_FINER = 0.3
"""By how much finer surfaces are held against each other from round to round."""
_APPROACH = 0.5
"""Of the work, where the rig may be far off at first."""
_NO_FIT, _LEAST_MM = 3.0, 0.01
"""Times the noise, and mm of noise at least: surfaces farther apart have another cause."""
_TOLD = 0.5
"""Of what was known before: a parameter that stays less certain than this was hardly determined."""
_WILD = 3.0
"""Times what is thought possible of a table."""
_RAYS = np.radians(1.5)
"""rad rms: a camera whose uncertainty turns its rays by more is not known. Where they are off by
0.8°, a ball still leads to the rig; by 2.4°, none of the starts does, after half a minute."""
_OPEN = 1.5
"""Times the noise of a point: a body by which the rig may bend shapes more says too little. By the
rig's covariance, which is what it does bend within a factor of two, whatever was known before;
bodies that stand well leave half of the noise, a ball 0.1 mm beside the axis fifteen times it."""
_STAYS = 2.0
"""Times its noise: a stripe that moves less, whichever way the table is turned, stays."""
_MATERIAL = 0.2
"""Of the stripe's noise, rms: less cannot be distinguished from errors that stripes have on tilted
surfaces."""


@dataclass(frozen=True)
class RefineSettings:
    """What may move, and what is known of the part."""

    camera: bool = False
    """Whether the camera may move, too, within its uncertainty; it always does where it is known
    together with the rest, as from pictures of boards."""
    geometry: bool = True
    """Whether sheets and axis may move within their uncertainty."""
    body: tuple[Form, tuple[Known | None, ...]] | None = None
    """What the part is, and its sizes with their standard uncertainties, mm and rad; None for one
    that is free."""
    rounds: int = 12
    """How often surfaces are held against each other, at most, once the rig is near the truth."""
    queries: int = 4000
    """Places of each surface that are looked at, at most."""
    poses: tuple[Pose, ...] = ()
    """About where the part lay in its second pose and those that follow: its object's frame → the
    first one's."""


@dataclass(frozen=True)
class Refined:
    """A rig that fits what scans of a part show."""

    rig: Rig
    gap_before: float
    """mm rms between the surfaces (or from the sphere) as the rig had them before."""
    gap_after: float
    gap_noise: float
    """mm rms that the stripes' own noise makes."""
    shape_before: float
    """mm rms by which the rig's uncertainty bends what it measures in the volume of the part, its
    place and size left aside."""
    shape_after: float
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
    advice: Advice
    """What is still undetermined, in words, and the scan that would help most."""
    known: dict[str, float]
    """Standard uncertainties of the rig's parameters before, by name, as of `estimated`."""

    @property
    def worded(self) -> list[tuple[str, str, str]]:
        """Of `estimated`: what it is, how far it moved (or its value) with its uncertainty, and the
        uncertainty of before, in words."""
        return [
            (
                parameter_in_words(name),
                amount_in_words(name, m.value, m.sigma),
                amount_in_words(name, 0.0, self.known[name]).partition("± ")[2]
                if name in self.known
                else "–",
            )
            for name, m in self.estimated.items()
        ]

    @property
    def left_out(self) -> str:
        """`dropped`, in words."""
        return "; ".join(map(parameter_in_words, self.dropped))


def refine(
    rig: Rig,
    sweeps: Sequence[Sweep],
    settings: RefineSettings | None = None,
    progress: Progress = no_progress,
) -> Refined:
    """Adjust table motion, sheets and axis until all surfaces of a part agree.

    Each point of a sweep is held against the patch of every other sweep's points under it; what was
    known of the rig (its covariance) counts as observations, and what it does not doubt is held.
    Errors of the table (harmonics, play) are kept where Bayes' information criterion asks for them.
    A body of known form counts like a surface that is known, and known sizes of it give the scale.
    Where the rig's uncertainty is of millimetres, the body alone is what the points are held
    against first (`turnscan.calibrate._approach`); without one, rigs whose laser sheets are so
    little known are refused, as surfaces of any shape agree then in more than one.
    A part that was laid down again between two turns is seen by one laser as by two; how it lay is
    estimated with the rest, from about where it is known to be. What one laser saw in two turns, or
    there and back, is held against each other, too: that shows play, but no wave that comes again
    at the same angle.
    A rig that was calibrated by boards counts by its whole covariance, the camera's too, which is
    one joint adjustment of boards and body.
    Pang et al., Tool-free calibration of a turntable, is the nearest published relative.

    Raises Degenerate where surfaces do not overlap or leave a parameter undetermined that nothing
    else is known of, or where too little is known of the lasers for a part of unknown shape;
    DidNotConverge, also where the rig strays from what was known of it.
    """
    s = settings or RefineSettings()
    many = tuple(thinned(sweep, rig) for sweep in sweeps)
    if len({sweep.laser for sweep in many}) == 1:
        many = tuple(part for sweep in many for part in turns_of(sweep))
    _check_poses(many, s)
    if s.body is not None and s.geometry:
        _refuse_about_axis(many, s.body[0].name)
    if s.geometry and (s.camera or known_together(rig)):
        _refuse_free_camera(rig, many)
    begin = Surfaces(replace(rig, covariance=None, motion=_motion(rig, many)), (), s.poses)
    doubt = doubt_of(rig, many) if s.geometry else 0.0
    state, rough = _begun(rig, begin, many, s, doubt, progress.subrange(0, _APPROACH))
    free = _free(rig, state, many, s)
    part = progress.subrange(_APPROACH if doubt > _FAR_MM or _drawn(s) else 0.0, 1.0)
    try:
        network, fit = _settled(rig, state, many, free, s, rough, part)
    except DidNotConverge as error:
        if s.body is None:
            raise
        raise DidNotConverge(
            f"{error.message}: alone, the {s.body[0].name} says too little of a rig that is known "
            "so little",
            hint="take a ball or ball bar beside the rotation axis, which faces in all directions",
        ) from None
    before = _gap_before(rig, begin, network, fit.state, s, doubt)
    refuse_strayed(rig, fit.state.rig, "" if s.body is None else s.body[0].name)
    _refuse_wild(fit.state.motion)
    for body in fit.state.bodies:
        refuse_ends(body, sum(len(sweep.pixels) for sweep in many))
    shared = with_shared_noise(network, fit, free)
    fit, free, dropped, unseen = _simplest(network, shared, free)
    last = gap_of(network, fit.state)
    if last[0] > _NO_FIT * max(last[1], _LEAST_MM):
        raise Degenerate(
            f"the surfaces stay {last[0]:.3f} mm apart where the stripe's noise makes "
            f"{last[1]:.3f} mm: no rig near this one explains the scan",
            hint="did the part move, is it the body that was named, and is the rig the right one?",
        )
    done = _told(rig, network, fit, free, (dropped, unseen), before, last)
    if s.body is not None and s.geometry:
        _refuse_open(done, s.body[0].name)
    return done


def _refuse_wild(motion: TableMotion) -> None:
    """Raise DidNotConverge for a table that is farther off its angles than any table."""
    worst = float(np.abs(motion.values).max(initial=0.0))
    if worst > _WILD * WEAK:
        raise DidNotConverge(
            f"the surfaces agree only with a table that is {np.degrees(worst):.0f}° off its angles",
            hint="is the scan one of this rig, and did the part stay in its place? A scan of a "
            "second laser, or of the part in another pose, determines more",
        )


def _refuse_open(done: Refined, name: str) -> None:
    """Raise Degenerate for a body that says next to nothing of the rig where it stands."""
    noise = max(done.gap_noise, _LEAST_MM)
    if done.shape_after <= _OPEN * noise or done.shape_before <= _NO_FIT * noise:
        return  # it says enough, or a rig that was known well before is known no worse
    # What turns or lifts the part in its frame shows in no surface, and bends none.
    names = [parameter_in_words(n) for n in done.held if not n.startswith("motion.")]
    raise Degenerate(
        f"the {name} stands so that it says too little: what the rig measures may be bent by "
        f"{done.shape_after:.2f} mm (rms), {done.shape_before:.2f} mm before; open are "
        f"{', '.join(names) or 'sums of several parameters'}",
        hint="scan it again away from the rotation axis, and tilted; or take a ball or ball bar",
    )


def _refuse_about_axis(sweeps: Sequence[Sweep], name: str) -> None:
    """Raise Degenerate for a body whose stripe stays in its place, however the table is turned: it
    is round about the axis, and says nothing of where that is."""
    moves = []
    for sweep in sweeps:
        line = np.round(sweep.pixels[:, 1 - sweep.across]).astype(np.int64)
        _, where, count = np.unique(line, return_inverse=True, return_counts=True)
        place = sweep.pixels[:, sweep.across]
        middle = np.bincount(where, place) / count
        off = (place - middle[where]) / sweep.sigma
        moves.append(off[count[where] > 2])
    every = np.abs(np.concatenate(moves)) if moves else np.zeros(0)
    if len(every) and float(np.median(every)) < _STAYS:
        raise Degenerate(
            f"the {name} stands about the rotation axis: its stripe stays in its place at all "
            "angles of the table, which leaves open where the axis is and how it leans",
            hint="scan it again away from the rotation axis, and tilted",
        )


def _refuse_free_camera(rig: Rig, sweeps: Sequence[Sweep]) -> None:
    """Raise Degenerate for a camera of which next to nothing is known: no surface tells a lens."""
    if rig.covariance is None:
        return
    far = np.zeros(len(sweeps))
    for k in np.flatnonzero(np.diag(rig.covariance)[:CAMERA_SIZE] > 0):
        step = np.zeros(len(rig.covariance))
        step[k] = np.sqrt(rig.covariance[k, k])
        off = rig.perturbed(step).camera
        for i, sweep in enumerate(sweeps):
            turn = off.rays(sweep.pixels) - rig.camera.rays(sweep.pixels)
            far[i] += float(np.mean((turn**2).sum(axis=1)))
    off_by = float(np.sqrt(far.mean()))
    if not off_by <= _RAYS:
        raise Degenerate(
            f"by what is known of the camera its rays may be off by {np.degrees(off_by):.1f}° "
            "(rms): what a scan shows of a part says next to nothing of the lens",
            hint="calibrate the camera by pictures of a board first, or state how far its focal "
            "length and the middle of its picture may be off",
        )


def _check_poses(sweeps: Sequence[Sweep], s: RefineSettings) -> None:
    if {sweep.pose for sweep in sweeps} != set(range(len(s.poses) + 1)):
        raise ValueError("a pose without sweeps, or sweeps of a pose that is not known")
    if s.poses and s.body is not None:
        raise ValueError("bodies are fitted in one pose")


def _motion(rig: Rig, sweeps: Sequence[Sweep]) -> TableMotion:
    """The table's errors as they are known, with room for all orders."""
    if rig.motion is None:
        moving = any(sweep.moved for sweep in sweeps)
        return TableMotion(np.zeros((ORDERS if moving else 0, 2)))
    waves = np.zeros((max(ORDERS, len(rig.motion.harmonics)), 2))
    waves[: len(rig.motion.harmonics)] = rig.motion.harmonics
    return replace(rig.motion, harmonics=waves, covariance=None)


def _begun(
    rig: Rig,
    begin: Surfaces,
    sweeps: tuple[Sweep, ...],
    s: RefineSettings,
    doubt: float,
    progress: Progress,
) -> tuple[Surfaces, float]:
    """A state near the truth with its bodies, and how far surfaces are apart there, mm; 0 where
    that is not known."""
    if s.poses:
        return begin, _usual_gap(rig, begin, sweeps, s)
    if doubt <= _FAR_MM and not _drawn(s):
        if s.body is None:
            return begin, 0.0
        return replace(begin, bodies=(find_body(*s.body, sweeps, rig, doubt),)), 0.0
    if s.body is None:
        sheets = doubt_of(_sheets_alone(rig), sweeps)
        if sheets <= _FAR_MM:
            return begin, doubt
        raise Degenerate(
            f"by what is known of its lasers the rig may put points {sheets:.0f} mm (rms) aside: "
            "so far off, the surfaces of a part of unknown shape agree in several rigs",
            hint="refine it by a body of known form first, a ball for example (of unknown size, "
            "where none is known); or measure the rig again and state how far its numbers may be "
            "off",
        )
    near = approach(rig, begin, sweeps, _free(rig, begin, sweeps, s), s.body, doubt, progress)
    bodies = tuple(_with_its_points(b, near, sweeps) for b in near.bodies)
    return replace(near, bodies=bodies), 0.0


def _sheets_alone(rig: Rig) -> Rig:
    """The rig as uncertain as its laser sheets are."""
    if rig.covariance is None:
        return rig
    sheets = [not n.startswith(("camera.", "table.")) for n in rig.parameter_names]
    return replace(rig, covariance=rig.covariance * np.outer(sheets, sheets))


def _usual_gap(rig: Rig, begin: Surfaces, sweeps: tuple[Sweep, ...], s: RefineSettings) -> float:
    """mm, the median: poses are found by shape, and the other side of a thin wall is farther off
    than the surface that is meant."""
    free = np.zeros_like(_free(rig, begin, sweeps, s))
    network = network_of(rig, begin, sweeps, free, _REACH_MM, s.queries)
    at = network.places(begin)
    gaps = [np.abs(p.patches.gaps(at[p.asked], at[p.others])) for p in network.pairs]
    return float(np.median(np.concatenate(gaps)))


def _drawn(s: RefineSettings) -> bool:
    """Whether the part is a mesh, which may stand in more than one way."""
    return s.body is not None and isinstance(s.body[0], Part)


def _with_its_points(body: Body, state: Surfaces, sweeps: Sequence[Sweep]) -> Body:
    return again(body, [sweep.points(state.rig, state.rig.camera.rays(sweep.pixels))
                        for sweep in sweeps])  # fmt: skip


def _settled(
    rig: Rig,
    state: Surfaces,
    sweeps: tuple[Sweep, ...],
    free: Bools,
    s: RefineSettings,
    rough: float,
    progress: Progress,
) -> tuple[SurfaceNetwork, Fit[Surfaces]]:
    """Surfaces held against each other, round after round, until none moves any more.

    Where they are ``rough`` mm apart at first, gaps weigh no more than that at first.
    """
    fit: Fit[Surfaces] | None = None
    reach = min(_REACHES * rough, _REACH_MM) if s.poses else max(_REACH_MM, _WIDE * rough)
    for k in range(s.rounds):
        if fit is not None:
            state = replace(
                state, bodies=tuple(_with_its_points(b, state, sweeps) for b in state.bodies)
            )
        network = network_of(rig, state, sweeps, free, reach, s.queries, rough)
        fit = adjusted(network, state, free, fit, told=rough > 0)
        moved, state = _moved(state, fit), fit.state
        gap, noise, _ = gap_of(network, state)
        reach = min(max(6 * gap, 4 * noise), _REACH_MM)
        progress((k + 1) / s.rounds)
        if moved < _SETTLED and not rough:
            break
        rough = _FINER * rough if _FINER * rough > noise else 0.0
    assert fit is not None
    return network, fit


def _gap_before(
    rig: Rig,
    begin: Surfaces,
    network: SurfaceNetwork,
    end: Surfaces,
    s: RefineSettings,
    doubt: float,
) -> float:
    """mm rms by which the surfaces were apart; of a body that the rig was too far off to show, the
    distance from where it is."""
    free = np.zeros_like(network.active)
    at = replace(end, rig=begin.rig)
    if s.body is not None and not _drawn(s):
        try:
            at = replace(begin, bodies=(find_body(*s.body, network.sweeps, begin.rig, doubt),))
        except Degenerate:
            return gap_of(network, at)[0]
    elif s.body is not None:
        return gap_of(network, at)[0]
    reach = max(_REACH_MM, 2 * doubt)
    return gap_of(network_of(rig, at, network.sweeps, free, reach, s.queries), at)[0]


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
         *(_apart(a, b) for a, b in zip(after.poses, before.poses, strict=True)),
         *(_body_moved(a, b) for a, b in zip(after.bodies, before.bodies, strict=True))]
    )  # fmt: skip
    sigma = np.sqrt(np.diag(fit.covariance))
    return float(np.max(np.abs(off[sigma > 0]) / sigma[sigma > 0], initial=0.0))


def _body_moved(now: Body, before: Body) -> Floats:
    """(q,) by which one body leads to the other, to first order."""
    m = now.form.moves.shape[1]
    motion = now.form.moves.T @ _apart(now.pose, before.pose)
    return np.concatenate([motion[:m], now.sizes - before.sizes])


def _apart(now: Pose, before: Pose) -> Floats:
    """(6,) rad and mm by which one pose leads to the other, in its own frame, to first order."""
    turn = before.rotation.T @ now.rotation
    small = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    shift = before.rotation.T @ (now.translation - before.translation)
    return np.concatenate([small / 2, shift])


def _free(rig: Rig, state: Surfaces, sweeps: Sequence[Sweep], s: RefineSettings) -> Bools:
    names = SurfaceNetwork(tuple(sweeps), (), state, np.zeros(0, bool)).names
    own, motion = rig.parameter_names, state.motion.names
    free = np.zeros(len(names), dtype=bool)
    if rig.covariance is not None and s.geometry:
        free[: len(own)] = np.diag(rig.covariance) > 0
        if not s.camera and not known_together(rig):
            free[[k for k, n in enumerate(own) if n.startswith("camera.")]] = False
    moved = [sweep for sweep in sweeps if sweep.moved]
    if moved:
        free[len(own) : len(own) + len(motion)] = True
        if len({(sweep.laser, sweep.pose) for sweep in sweeps}) == 1:
            # It sees each place at the same table angles in every turn.
            free[len(own) : len(own) + 2 * len(state.motion.harmonics)] = False
        back = any(_turns_back(sweep.angles) for sweep in moved)
        free[len(own) + motion.index("motion.backlash")] = back
    free[len(own) + len(motion) :] = True
    return free


def _turns_back(angles: Floats) -> bool:
    """Whether the table went both ways; at a single angle it went none."""
    return len(np.unique(np.sign(np.diff(np.unwrap(angles))))) > 1


def _simplest(
    network: SurfaceNetwork, fit: Fit[Surfaces], free: Bools
) -> tuple[Fit[Surfaces], Bools, tuple[str, ...], tuple[str, ...]]:
    """The fit without those errors of the table that do not earn their parameters; their names, and
    those of which the scans say nothing.

    Wald's statistic of a group of k parameters is what they lower χ² by; Bayes' information
    criterion asks for k·ln n. The highest order goes first, as a wheel of order 1 is a commoner
    thing than one of order 3; those that the scans say nothing of go without being asked.
    """
    p = len(fit.state.rig.parameter_names)
    names = fit.state.motion.names
    orders = [(f"motion.cos{m}", f"motion.sin{m}") for m in range(ORDERS, 0, -1)]
    count = sum(len(b.residual) for b in fit.blocks)
    dropped, unseen = list[str](), list[str]()
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
            fit = adjusted(network, replace(fit.state, rig=rig), free, fit, told=False)
            fit = with_shared_noise(network, fit, free)
            if weak:
                unseen += group
            else:
                dropped += group
    return fit, free, tuple(dropped), tuple(unseen)


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
    table: tuple[tuple[str, ...], tuple[str, ...]],
    gap_before: float,
    last: tuple[float, float, int],
) -> Refined:
    state, p = fit.state, len(before.parameter_names)
    q = len(state.motion.names)
    dropped, unseen = table
    sigma = np.sqrt(np.diag(fit.covariance))
    moved = np.concatenate(
        [moved_by(replace(before, motion=None), state.rig), state.motion.values,
         np.zeros(6 * len(state.poses)),
         *([*np.zeros(b.form.moves.shape[1]), *b.sizes] for b in state.bodies)]
    )  # fmt: skip
    held = []
    covariance = None
    known = dict[str, float]()
    if before.covariance is not None:
        old = np.sqrt(np.diag(before.covariance))
        known = dict(zip(before.parameter_names, map(float, old), strict=True))
        covariance = np.array(before.covariance)
        part = np.flatnonzero(free[:p])
        covariance[part, :] = 0.0
        covariance[:, part] = 0.0
        covariance[np.ix_(part, part)] = fit.covariance[np.ix_(part, part)]
        if part.size and not known_together(before):
            # The axis moved: along the old one, what nobody knows would bend shapes.
            for was, now in zip(gauge_of(before), gauge_of(state.rig), strict=True):
                covariance += np.outer(now, now) * (was @ before.covariance @ was)
        held = [
            n for n, s, o, f in zip(before.parameter_names, sigma, old, free, strict=False)
            if f and s > _TOLD * o
        ]  # fmt: skip
        if part.size and _along_sight(state.rig, covariance) > _TOLD * _along_sight(before):
            held.append("scale")
    if free[p : p + q].any() or dropped or unseen:
        held += [
            n for n, f in zip(state.motion.names, free[p : p + q], strict=True)
            if not f and n not in dropped
        ]  # fmt: skip
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
        if f and ".place" not in n and not n.startswith("pose")
    }
    bent = [shape_doubt(r, network.sweeps) for r in (before, rig)]
    advice = refine_advice(rig, fit, free, held, network.sweeps, bent[1])
    return Refined(
        rig, gap_before, last[0], last[1], bent[0], bent[1], last[2], estimated, tuple(held),
        dropped, fit, advice, known,
    )  # fmt: skip
