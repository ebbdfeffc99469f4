"""The frames of an import: read one at a time, written, counted, and judged."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from turnscan.arrays import Image
from turnscan.findings import Finding
from turnscan.scan import Frame, Scan, ScanPlan, read_picture, signal_of, statistics
from turnscan.workflows._importing._angles import Angle, Angles
from turnscan.workflows._importing._look import no_stripe
from turnscan.workflows._importing._series import Series, same_pictures
from turnscan.workflows._importing._signal import Signal, check_kind


@dataclass
class Tally:
    """What is counted while the frames are written."""

    frames: int = 0
    kept: float = 0.0
    first: float = math.inf
    last: float = -math.inf
    findings: list[Finding] = field(default_factory=list)

    def add(self, angle: float, kept: float) -> None:
        """Count one frame."""
        self.frames += 1
        self.kept += kept
        if not math.isnan(angle):
            self.first, self.last = min(self.first, angle), max(self.last, angle)


def write_frames(
    scan: Scan,
    series: Sequence[Series],
    signals: Sequence[Signal],
    angles: Angles,
    first: Image,
    count: Callable[[], None],
) -> Tally:
    """Write all frames into a new scan file, and record the missing ones.

    ``first`` is the picture whose size and type all have; ``count`` is called after each frame.
    Raises InputError for another picture, ScanError.
    """
    tally = Tally()
    for one, signal in zip(series, signals, strict=True):
        tally.findings += same_pictures(one)
        if signal.background is not None:
            scan.add_background(one.laser, signal.background)
        seen = False
        for frame in _frames(one, angles, first):
            kept = scan.add(frame)
            tally.add(frame.angle, kept)
            seen = seen or _has_light(frame, scan.plan, signal, kept)
            count()
        if not seen and all(f.code != "scan.no-stripe" for f in signal.findings):
            level = f"{scan.plan.threshold:.2f} grey levels"
            why = f"no pixel of any picture is {level} above the background"
            tally.findings.append(no_stripe(one.laser, why))
        tally.findings += _record_missing(scan, one.laser, angles)
    return tally


def _frames(series: Series, angles: Angles, first: Image) -> Iterator[Frame]:
    for shot, picture in series.pictures():
        check_kind(picture, first, shot.name)
        path = series.dark_of(shot)
        dark = None if path is None else read_picture(path)
        if dark is not None:
            check_kind(dark, first, str(path))
        angle = angles.get((series.laser, shot.step), Angle())
        yield Frame(
            step=shot.step,
            laser=series.laser,
            lit=picture,
            dark=dark,
            commanded=angle.commanded,
            measured=angle.measured,
            angle_sigma=angle.sigma,
            settings={"picture": shot.name, "number": shot.number},
        )


def _has_light(frame: Frame, plan: ScanPlan, signal: Signal, kept: float) -> bool:
    """Whether any pixel passes the threshold; a sparse frame keeps pixels only where one does."""
    if plan.keep == "sparse":
        return kept > 0.0
    dark = signal.background if frame.dark is None else frame.dark
    light = signal_of(frame.lit, dark, plan.weights)
    return bool(light.max() > statistics(light).level + plan.threshold)


def _between(angles: Angles, laser: str, step: int) -> float:
    """Angle a missing step would have had, where its neighbours were commanded evenly."""
    low, high = angles.get((laser, step - 1)), angles.get((laser, step + 1))
    return math.nan if low is None or high is None else (low.commanded + high.commanded) / 2


def _record_missing(scan: Scan, laser: str, angles: Angles) -> list[Finding]:
    missing = sorted(scan.missing(laser))
    for step in missing:
        scan.add_missing(step, laser, "no picture", _between(angles, laser, step))
    if not missing:
        return []
    shown = ", ".join(str(step) for step in missing[:8]) + (" …" if len(missing) > 8 else "")
    return [
        Finding(
            "scan.missing-step",
            "warning",
            f"{len(missing)} of {scan.plan.steps} steps have no picture",
            where=f"laser {laser}, steps {shown}",
            remedy="they stay empty in the surface; capture them again if needed",
        )
    ]
