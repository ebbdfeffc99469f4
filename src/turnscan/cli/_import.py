"""``turnscan import``: pictures made elsewhere become a scan file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import click
import numpy as np

from turnscan.arrays import Image
from turnscan.cli._import_angles import Angle, Angles, find_angles
from turnscan.cli._import_series import Series, find_series, same_pictures
from turnscan.cli._import_signal import Signal, Weights, Wishes, check_kind, find_signal
from turnscan.cli._input import read_rig_file
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output
from turnscan.cli._progress import progress
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import Rig
from turnscan.scan import (
    NOISE_FACTOR,
    Frame,
    Scan,
    ScanPlan,
    read_picture,
    replacing_scan,
    signal_of,
    statistics,
)


@dataclass
class _Tally:
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


@click.command("import")
@click.argument("pictures", nargs=-1, metavar="PICTURES...")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Scan file.")
@click.option(
    "--angles",
    required=True,
    metavar="ANGLES",
    help="Table angle of each picture: step:DEG between neighbouring pictures (counter-clockwise "
    "seen from above, negative for clockwise), markers (with --rig), or a CSV file of angle_deg "
    "a line, or of number,angle_deg[,sigma_deg].",
)
@click.option(
    "--lit",
    multiple=True,
    metavar="NAME=PICTURES",
    help="Pictures of one of several lasers; repeatable. Instead of PICTURES.",
)
@click.option(
    "--dark",
    multiple=True,
    metavar="[NAME=]PICTURES",
    help="Pictures with the laser off: as many as lit ones, or one for all. Without them the "
    "background is found from the scan itself (--background).",
)
@click.option("--laser", default="laser", show_default=True, help="Name of the one laser.")
@click.option("--rig", "rig_path", type=click.Path(path_type=Path), help="Rig to store with it.")
@click.option(
    "--colour",
    default="learn",
    show_default=True,
    metavar="COLOUR",
    help="Of the laser, in colour pictures: red, green, blue, grey, three weights R,G,B, or learn.",
)
@click.option(
    "--keep",
    type=click.Choice(["sparse", "full"]),
    default="sparse",
    show_default=True,
    help="Keep the pixels around the stripe, or all; both to the bit.",
)
@click.option(
    "--threshold",
    type=Finite(min=0.0),
    help="Grey levels above the background from which pixels are kept.  [default: from the noise]",
)
@click.option(
    "--orientation",
    type=click.Choice(["vertical", "horizontal"]),
    default="vertical",
    show_default=True,
    help="Of the stripe in the picture.",
)
@click.option(
    "--background",
    type=click.Choice(["auto", "median", "beside", "darkest"]),
    default="auto",
    show_default=True,
    help="Without laser-off pictures: the median of each pixel over the scan, that over the "
    "pictures in which it lies beside the stripe, or its darkest; auto takes the one with which "
    "more of the stripe is seen.",
)
@click.option("--every", type=click.IntRange(min=1), default=1, help="Take every N-th step only.")
@click.option("--first-step", type=int, help="Number (in the names) of step 0.  [default: lowest]")
def verb(
    pictures: tuple[str, ...],
    output: Path,
    angles: str,
    lit: tuple[str, ...],
    dark: tuple[str, ...],
    laser: str,
    rig_path: Path | None,
    colour: str,
    keep: Literal["sparse", "full"],
    threshold: float | None,
    orientation: Literal["vertical", "horizontal"],
    background: str,
    every: int,
    first_step: int | None,
) -> None:
    """Make a scan file of pictures: folders, patterns, files, or one video.

    The numbers in the names (step_num133.jpg) say which step a picture belongs to; steps without
    a picture are recorded as missing. Nothing is written unless all of it is good.
    """
    lit_specs, dark_specs = _by_laser(pictures, lit, dark, laser)
    rig = None if rig_path is None else read_rig_file(rig_path)
    series, steps, found = find_series(lit_specs, dark_specs, first_step, every)
    check_output(output, (".turnscan",))
    total = sum(len(s.shots) for s in series)
    first = _first_picture(series[0])
    _fits_rig(first, rig, series[0])
    with progress("reading angles", total) as tick:
        table, more, source = find_angles(angles, series, every, rig, tick)
    found += more
    with progress("looking at samples", None) as tick:
        signals: list[Signal] = []
        wishes = Wishes(colour, background, orientation)
        for one in series:
            known = signals[0].weights if signals else None
            signals.append(find_signal(one, wishes, known, first, tick))
    if threshold is not None:
        _check_threshold(threshold, first, signals[0].weights)
    plan = ScanPlan(
        width=first.shape[1],
        height=first.shape[0],
        dtype="uint16" if first.dtype == np.uint16 else "uint8",
        channels=3 if first.ndim == 3 else 1,
        lasers=tuple(s.laser for s in series),
        steps=steps,
        threshold=max(s.threshold for s in signals) if threshold is None else threshold,
        keep=keep,
        orientation=orientation,
        weights=signals[0].weights,
        source=f"imported, angles from {source}",
    )
    tally = _Tally(findings=found)
    with progress("importing", total) as tick, replacing_scan(output, plan, rig) as scan:
        for one, signal in zip(series, signals, strict=True):
            tally.findings += same_pictures(one)
            if signal.background is not None:
                scan.add_background(one.laser, signal.background)
            seen = False
            for frame in _frames(one, table, first):
                kept = scan.add(frame)
                tally.add(frame.angle, kept)
                seen = seen or _has_light(frame, plan, signal, kept)
                tick()
            if not seen:
                tally.findings.append(_no_stripe(one.laser, plan.threshold))
            tally.findings += _record_missing(scan, one.laser, table)
    _say_summary(output, plan, signals, tally, source, threshold is None)


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


def _check_threshold(threshold: float, first: Image, weights: Weights | None) -> None:
    """Raise InputError for a threshold that no picture of this kind can pass."""
    full = float(np.iinfo(first.dtype).max)
    if weights is not None:
        full *= sum(w for w in weights if w > 0.0)
    if threshold >= full:
        raise InputError(
            f"--threshold {threshold:g}: the brightest pixel has {full:g} grey levels",
            hint="give a lower one, or leave it out: it is chosen by the noise",
        )


def _has_light(frame: Frame, plan: ScanPlan, signal: Signal, kept: float) -> bool:
    """Whether any pixel passes the threshold; a sparse frame keeps pixels only where one does."""
    if plan.keep == "sparse":
        return kept > 0.0
    dark = signal.background if frame.dark is None else frame.dark
    light = signal_of(frame.lit, dark, plan.weights)
    return bool(light.max() > statistics(light).level + plan.threshold)


def _no_stripe(laser: str, threshold: float) -> Finding:
    return Finding(
        "scan.no-stripe",
        "warning",
        f"no pixel of any picture is {threshold:.2f} grey levels above the background",
        where=f"laser {laser}",
        remedy="was the laser on, and in the picture? else give --dark, or a lower --threshold",
    )


def _by_laser(
    pictures: Sequence[str], lit: Sequence[str], dark: Sequence[str], laser: str
) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    if bool(pictures) == bool(lit):
        raise InputError(
            "give PICTURES of one laser, or --lit NAME=PICTURES for each of several",
            hint="turnscan import --help",
        )
    lit_specs: dict[str, list[str]] = {laser: list(pictures)} if pictures else {}
    for text in lit:
        name, mark, spec = text.partition("=")
        if not mark or not name or not spec:
            raise InputError(f"--lit {text}: not NAME=PICTURES", hint="like --lit left=pics/left")
        lit_specs.setdefault(name, []).append(spec)
    dark_specs: dict[str, list[str]] = {}
    for text in dark:
        name, mark, spec = text.partition("=")
        if mark and name in lit_specs:
            dark_specs.setdefault(name, []).append(spec)
        elif len(lit_specs) == 1 or not mark:
            for one in lit_specs:
                dark_specs.setdefault(one, []).append(text)
        else:
            raise InputError(f"--dark {text}: no laser {name!r}", hint=f"have {list(lit_specs)}")
    return lit_specs, dark_specs


def _first_picture(series: Series) -> Image:
    return next(picture for _, picture in series.pictures(series.shots[:1]))


def _fits_rig(picture: Image, rig: Rig | None, series: Series) -> None:
    if rig is None:
        return
    height, width = picture.shape[:2]
    if (width, height) != (rig.camera.width, rig.camera.height):
        raise InputError(
            f"{series.shots[0].name} is {width}×{height}, but the rig's camera has "
            f"{rig.camera.width}×{rig.camera.height}",
            hint="give the rig that was calibrated with pictures of this size",
        )


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
            remedy="they stay empty in the surface; take them again if the part matters there",
        )
    ]


def _say_summary(
    path: Path,
    plan: ScanPlan,
    signals: Sequence[Signal],
    tally: _Tally,
    source: str,
    automatic: bool,
) -> None:
    itemsize = np.dtype(plan.dtype).itemsize
    own = sum(s.background is None for s in signals) > 0
    raw = tally.frames * plan.width * plan.height * plan.channels * itemsize * (2 if own else 1)
    size = path.stat().st_size
    kind = "colour" if plan.channels == 3 else "grey"
    lines = [
        f"{path}: {tally.frames} frames, {plan.steps} steps × {', '.join(plan.lasers)}, "
        f"{plan.width}×{plan.height} {kind} {plan.dtype}",
        f"angles: {_degrees(tally)}, from {source}",
    ]
    if plan.weights is not None:
        red, green, blue = plan.weights
        lines.append(f"laser: {red:+.2f} red {green:+.2f} green {blue:+.2f} blue")
    lines.append("background: " + "; ".join(dict.fromkeys(s.origin for s in signals)))
    noise = max(s.noise for s in signals)
    reason = f"{NOISE_FACTOR:g} × the noise of {noise:.2f}" if automatic else "as given"
    lines.append(f"threshold: {plan.threshold:.2f} grey levels, {reason}")
    share = 100 * tally.kept / max(tally.frames, 1)
    times = f"1/{raw / size:.1f} of the raw ones"
    lines.append(f"kept: {share:.1f} % of the pixels, {size / 1e6:.1f} MB, {times}")
    for line in lines:
        click.echo(line)
    for finding in tally.findings:
        click.echo(str(finding))


def _degrees(tally: _Tally) -> str:
    if tally.first > tally.last:
        return "unknown"
    return f"{math.degrees(tally.first):.2f}° … {math.degrees(tally.last):.2f}°"
