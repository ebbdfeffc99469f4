"""Detection: the frames of a scan → the stripes of its lasers; all at once, or one step again."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from queue import Empty, SimpleQueue
from types import MappingProxyType

import numpy as np

from turnscan import points
from turnscan.arrays import Bools, Floats
from turnscan.edit import Redetect
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.memory import give_back
from turnscan.points import Volume
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig, TableMotion
from turnscan.scan import Frame, Scan, Stored, lit_in
from turnscan.stripes import (
    Candidates,
    Exposed,
    Light,
    RunDetector,
    Signal,
    Stripe,
    Stripes,
    StripeSettings,
)
from turnscan.threads import thread_count

_REACH = 50.0
"""mm from the axis at which it is said how far its own motion puts places aside."""
FLANKS = 24
"""px beyond the working volume in which a stripe is still seen, but does not count."""


Looked = tuple[int, float, Stripe, float]
"""Step, angle rad, stripe, and standard uncertainty of the angle; NaN where not known."""
Known = Mapping[int, Looked]
"""What the frames of some steps show of one laser, by step."""


@dataclass(frozen=True, eq=False)
class View:
    """How the stripe of one laser is searched in the frames of a scan.

    It looks into the scan file again when asked for single steps (`turnscan.edit.StripeSearch`).
    """

    scan: Scan
    rig: Rig
    lit: str
    """What the frames are called; this laser may not be alone in them."""
    laser: str
    volume: Volume
    """What is kept of the points; stripes outside of it do not count."""
    settings: StripeSettings
    inside: Bools
    """(H, W) True where a stripe counts."""

    @property
    def others(self) -> set[str]:
        """The lasers that are lit in the same frames."""
        return set(lit_in(self.lit, self.rig)) - {self.laser}

    def seek(
        self,
        tick: Callable[[], None],
        jobs: int | None = None,
        only: Collection[int] | None = None,
        known: Known = MappingProxyType({}),
    ) -> tuple[Stripes, list[Finding]]:
        """The stripes of all frames, and what is missing; ``tick`` is called after each frame.

        With ``only``, of the frames of these steps; those of ``known`` steps are not searched
        again. ``jobs`` threads share the work, one for each core where it is None. Raises
        ScanCorrupt naming a frame.
        """
        scan, look = self.scan, self.settings
        brackets, done = look_through(scan, self.lit, look, self.inside, tick, jobs, only, known)
        good = [k for k, (_, angle, *_) in enumerate(done) if not np.isnan(angle)]
        findings = points.lost_frames(self.lit, scan.missing(self.lit), len(done) - len(good))
        steps = tuple(done[k][0] for k in good)
        angles = np.array([done[k][1] for k in good], np.float64)
        stripes = tuple(done[k][2] for k in good)
        shaky = np.array([done[k][3] for k in good], np.float64)
        told = int(np.count_nonzero(np.isnan(shaky)))
        findings += wobble_findings(self.laser, self.rig, len(shaky), told)
        if self.rig.motion is not None:
            # An angle that was measured has an uncertainty; one that a motor reached has none.
            angles, shaky = moved(self.rig.motion, angles, shaky, np.isnan(shaky))
        if self.settings.refine != "none":
            swept = self._refined(stripes, angles, [brackets[k] for k in good], jobs)
            asked = self.settings.refine == "spacetime"
            findings += points.swept_findings(self.laser, swept, asked=asked)
            stripes = swept.stripes
        return Stripes(self.laser, steps, angles, stripes, shaky), findings

    def _refined(
        self,
        stripes: tuple[Stripe, ...],
        angles: Floats,
        brackets: list[list[Stored]],
        jobs: int | None,
    ) -> points.Swept:
        """The stripes of these frames, refined with the light of the frames around each."""
        signal = self._signal

        def look(k: int) -> Light:
            frames = [stored.decode() for stored in brackets[k]]
            if self.scan.plan.exposures > 1:
                return signal.light_of_bracket(_bracket(frames), self.settings)
            first = frames[0]
            return signal.light(first.lit, first.dark, self.settings, first.level, first.noise)

        with ThreadPoolExecutor(jobs or thread_count()) as pool:
            return points.refine(self.rig, self.laser, stripes, angles, look, pool.map)

    def candidates(self, step: int) -> Candidates:
        """Everything in the frame of a step that might be the stripe.

        Raises InputError where there is no frame, ScanCorrupt naming it.
        """
        return self._signal.candidates(self._frames(step), self.settings, self.inside)

    def again(self, step: int, edit: Redetect) -> Stripe:
        """The stripe of a step, searched as the edit wants it. Raises like `candidates`."""
        own = {name: getattr(edit, name) for name in ("threshold", "strategy", "choose")}
        given = {name: value for name, value in own.items() if value is not None}
        look = replace(self.settings, **given)
        return self._signal.detect_bracket(self._frames(step), look, self.inside)

    @property
    def _signal(self) -> Signal:
        return Signal(self.scan.plan.weights, self.scan.plan.dtype)

    def _frames(self, step: int) -> list[Exposed]:
        frames = []
        for exposure in range(self.scan.plan.exposures):
            with suppress(InputError):  # of a bracket, one may be missing
                frames.append(self.scan.frame(step, self.lit, exposure))
        return _bracket(frames or [self.scan.frame(step, self.lit)])


@dataclass(frozen=True, eq=False)
class Detection:
    """What was seen of one laser, and how to look again."""

    view: View
    stripes: Stripes
    findings: tuple[Finding, ...]


def moved(
    motion: TableMotion, angles: Floats, sigmas: Floats, told: Bools
) -> tuple[Floats, Floats]:
    """Angles (n,) rad in scan order and their uncertainties, with the table's own errors in those
    that it was ``told`` and nothing says how well it followed."""
    told = told & np.isnan(sigmas)
    if not told.any():
        return angles, sigmas
    return (
        np.where(told, motion.angle(angles), angles),
        np.where(told, motion.sigma(angles), sigmas),
    )


def wobble_findings(laser: str, rig: Rig, angles: int, commanded: int) -> list[Finding]:
    """Findings on a rig whose axis moves in a turn, where ``commanded`` of the ``angles`` are those
    that a motor reached: whether they count from where the calibration's did, no picture says."""
    if rig.wobble is None or not commanded:
        return []
    text = (
        f"the axis of this rig moves once in a turn ({rig.wobble.reach(_REACH):.2f} mm, "
        f"{_REACH:g} mm from it), and {commanded} of {angles} angles were not measured: they are "
        "taken to count from where those of the calibration did"
    )
    remedy = Remedy(
        "begin where the first picture of the calibrated table was taken, or read the angles from "
        "markers with ",
        Option("angles"),
    )
    return [Finding("points.wobble-start", "note", text, f"laser {laser}", remedy)]


def look_through(
    scan: Scan,
    lit: str,
    settings: StripeSettings,
    inside: Bools | None = None,
    tick: Callable[[], None] = lambda: None,
    jobs: int | None = None,
    only: Collection[int] | None = None,
    known: Known = MappingProxyType({}),
) -> tuple[list[list[Stored]], list[Looked]]:
    """The frames of a name, those of a step together, and the stripe of each step.

    ``inside`` (H, W) is True where a stripe counts; ``tick`` is called after each frame, by any
    thread; ``jobs`` threads share the work. With ``only``, the frames of these steps; what is
    ``known`` of a step is taken as it is. Raises ScanCorrupt naming a frame.
    """
    search = _Search(scan, settings, inside, tick, known)
    # A bracket tells what is clipped by the colours as they were taken.
    stored = scan.stored(lit, search.signal.project if scan.plan.exposures == 1 else None)
    with ThreadPoolExecutor(jobs or thread_count()) as pool:
        steps = groupby(stored, key=lambda shot: shot.row.step)
        brackets = [list(shots) for step, shots in steps if only is None or step in only]
        return brackets, list(pool.map(search.find, brackets))


class _Search:
    """Finds the stripes of one laser, step by step, in any number of threads at a time."""

    def __init__(
        self,
        scan: Scan,
        settings: StripeSettings,
        inside: Bools | None,
        tick: Callable[[], None],
        known: Known,
    ) -> None:
        self.signal = Signal(scan.plan.weights, scan.plan.dtype)
        self._plan = scan.plan
        self._settings = settings
        self._inside = inside
        self._tick = tick
        self._known = known
        self._sparse = (
            scan.plan.keep == "sparse"
            and scan.plan.exposures == 1
            and isinstance(settings.strategy, str)  # a detector of others wants pictures
        )
        self._idle = SimpleQueue[RunDetector]()
        """Each has a work surface of the size of a picture: as many as there are threads."""

    def find(self, shots: list[Stored]) -> Looked:
        """The stripe in the frames of one step. Raises ScanCorrupt naming a frame."""
        looked = self._known.get(shots[0].row.step) or self._look(shots)
        for _ in shots:
            self._tick()
        return looked

    def _look(self, shots: list[Stored]) -> Looked:
        first = shots[0]
        stripe = self._in_runs(first) if self._sparse else None
        if stripe is None:
            stripe = self._in_pictures([stored.decode() for stored in shots])
        return first.row.step, first.angle, stripe, first.row.sigma

    def _in_pictures(self, frames: list[Frame]) -> Stripe:
        if self._plan.exposures > 1:
            return self.signal.detect_bracket(_bracket(frames), self._settings, self._inside)
        f = frames[0]
        return self.signal.detect(f.lit, f.dark, self._settings, f.level, f.noise, self._inside)

    def _in_runs(self, shot: Stored) -> Stripe | None:
        """The same from the pixels that are kept, if they tell."""
        try:
            detector = self._idle.get_nowait()
        except Empty:
            shape = (self._plan.height, self._plan.width)
            detector = RunDetector(self.signal, self._settings, shape, self._inside)
        stripe = detector.stripe(shot.runs(), shot.level, shot.noise)
        self._idle.put(detector)
        return stripe


def detect_scan(
    scan: Scan,
    rig: Rig,
    settings: StripeSettings,
    volume: Volume | None = None,
    tick: Callable[[], None] = lambda: None,
    only: str | None = None,
    jobs: int | None = None,
    known: Sequence[Known] = (),
) -> list[Detection]:
    """The stripes of each laser of a scan, in all its frames.

    ``volume`` None takes what the rig can measure; ``tick`` is called after each frame; ``only``
    names one laser, None takes all. It is what takes time in a reconstruction, and what no edit
    changes. ``jobs`` threads share it, one for each core where it is None; their number
    changes nothing in the result. ``known`` is, for each laser in turn, what `look_in_block` found
    of some steps: they are not searched again. Raises ScanCorrupt naming a frame.
    """
    seen = []
    for number, view in enumerate(views_of(scan, rig, settings, volume, only)):
        stripes, found = view.seek(tick, jobs, known=known[number] if known else {})
        seen.append(Detection(view, stripes, tuple(found)))
    give_back()
    return seen


def look_in_block(
    scan: Scan,
    rig: Rig,
    settings: StripeSettings,
    volume: Volume | None,
    block: int,
    blocks: int,
) -> tuple[Known, ...]:
    """What one of so many blocks of a scan's steps shows of each laser, for `detect_scan`.

    Each block is a run of neighbouring steps, and all are of about the same length. Raises
    ScanCorrupt naming a frame.
    """
    found = []
    for view in views_of(scan, rig, settings, volume):
        steps = sorted(scan.steps(view.lit))
        a, b = (len(steps) * k // blocks for k in (block, block + 1))
        chosen = frozenset(steps[a:b])
        _, done = look_through(scan, view.lit, view.settings, view.inside, only=chosen)
        found.append({looked[0]: looked for looked in done})
    return tuple(found)


def views_of(
    scan: Scan,
    rig: Rig,
    settings: StripeSettings,
    volume: Volume | None = None,
    only: str | None = None,
) -> Iterator[View]:
    """How the stripe of each laser of a scan is searched; as in `detect_scan`."""
    for lit in scan.plan.lasers:
        for laser in (n for n in lit_in(lit, rig) if only in (None, n)):
            kept = volume or points.working_volume(rig, laser)
            others = set(lit_in(lit, rig)) - {laser}
            inside = points.view_mask(rig, laser, kept, others=others)
            mask = points.widened(inside, FLANKS)
            look = replace(settings, orientation=scan.plan.orientation, mask=mask)
            yield View(scan, rig, lit, laser, kept, look, inside)


def _bracket(frames: Sequence[Frame]) -> list[Exposed]:
    if len(frames) == 1:
        f = frames[0]
        return [Exposed(f.lit, f.dark, 1.0, f.level, f.noise)]
    return [_exposed(f) for f in frames]


def _exposed(frame: Frame) -> Exposed:
    seconds, gain = frame.settings.get("seconds"), frame.settings.get("gain", 1.0)
    if not isinstance(seconds, int | float) or not isinstance(gain, int | float):
        raise InputError(
            f"step {frame.step} of laser {frame.laser!r}: exposure {frame.exposure} does not tell "
            "how long it was, so it cannot be fused with the others"
        )
    return Exposed(frame.lit, frame.dark, seconds * gain, frame.level, frame.noise)
