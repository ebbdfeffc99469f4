"""Import: pictures made elsewhere become a scan file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import ColourWeights, Image
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option
from turnscan.rig import Rig
from turnscan.scan import NOISE_FACTOR, ScanPlan, replacing_scan
from turnscan.workflows._files._history import refuse_over_repairs
from turnscan.workflows._files._reading import read_rig_file, require_complete
from turnscan.workflows._files._writing import check_output
from turnscan.workflows._importing._angles import find_angles
from turnscan.workflows._importing._frames import Tally, write_frames
from turnscan.workflows._importing._series import Series, find_series
from turnscan.workflows._importing._signal import Signal, find_signal
from turnscan.workflows._importing._turn import check_outline
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._import import AngleSource, EvenSteps, ImportOptions, MarkerAngles

Pictures = str | Path | Sequence[str | Path]
"""A folder, a pattern, a file, a video, or several of them."""

_MARKERS = 0.3
"""Of the work of an import, where markers are searched for."""
_SAMPLES = 0.1
"""Of the work of an import, for the samples."""


@dataclass(frozen=True)
class ImportedScan:
    """A scan file that was made of pictures."""

    path: Path
    plan: ScanPlan
    frames: int
    angles: tuple[float, float] | None
    """rad: the smallest and the largest; None where none is known."""
    angle_source: str
    """Where the angles come from, in words."""
    backgrounds: tuple[str, ...]
    """Where the pictures without the laser come from, in words; one for each way."""
    threshold_source: str
    """Where the threshold comes from, in words."""
    line_share: float
    """Fraction of the rows of the samples in which a line was found."""
    kept: float
    """Fraction of the pixels that is kept."""
    raw_bytes: int
    """Of the pictures, unpacked."""
    size_bytes: int
    """Of the scan file."""
    findings: tuple[Finding, ...]
    clipped: tuple[str, ...] = ()
    """Which channel counts little as the line is clipped in it, in words."""

    @property
    def summary(self) -> list[str]:
        """What was imported, in a few lines."""
        plan = self.plan
        kind = "colour" if plan.channels == 3 else "grey"
        span = " … ".join(f"{math.degrees(angle):.2f}°" for angle in self.angles or ())
        lines = [
            f"{self.path}: {self.frames} frames, {plan.steps} steps × {', '.join(plan.lasers)}, "
            f"{plan.width}×{plan.height} {kind} {plan.dtype}",
            f"angles: {span or 'unknown'}, from {self.angle_source}",
        ]
        if plan.weights is not None:
            red, green, blue = plan.weights
            mix = f"laser: {red:+.2f} red {green:+.2f} green {blue:+.2f} blue"
            lines.append("; ".join((mix, *self.clipped)))
        backgrounds = "; ".join(self.backgrounds)
        size = f"{self.size_bytes / 1e6:.1f} MB, 1/{self.raw_bytes / self.size_bytes:.1f}"
        return [
            *lines,
            f"background: {backgrounds}; line in {self.line_share:.0%} of rows",
            f"threshold: {plan.threshold:.2f} grey levels, {self.threshold_source}",
            f"kept: {100 * self.kept:.1f} % of the pixels, {size} of the raw ones",
        ]

    def __fspath__(self) -> str:
        """Its path: it stands for its file wherever a file is wanted."""
        return fspath(self.path)


def import_pictures(
    pictures: Pictures | Mapping[str, Pictures],
    output: str | PathLike[str],
    angles: AngleSource,
    *,
    dark: Pictures | Mapping[str, Pictures] = (),
    rig: Rig | str | PathLike[str] | None = None,
    options: ImportOptions | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> ImportedScan:
    """Make a scan file of pictures.

    The numbers in the names (step_num133.jpg) say which step a picture belongs to; steps without
    a picture are recorded as missing. Nothing is written unless all of it is good.

    Parameters
    ----------
    pictures
        With the laser on; of several lasers, by the names of the lasers.
    output
        The scan file, ``….turnscan``; replaced where it is an older scan without repairs by hand.
    angles
        Where the table's angle of each picture comes from.
    dark
        With the laser off: as many as lit ones, or one for all; also by laser. Without them the
        background is found from the scan itself.
    rig
        The rig to store with it, or its file; its camera must have the size of the pictures.
    options
        Choices about the import; None takes the usual ones.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``colour="red"``.

    Returns
    -------
    ImportedScan
        What was written, and what is worth knowing about it; it stands for the scan file wherever
        one is wanted.

    Raises
    ------
    InputError, FormatError, LimitExceeded
        Pictures, angles, rig and options that do not fit together, or cannot be read.
    ScanError, ExportError
        The scan file cannot be written.
    Cancelled
        By ``progress``; the output is as it was.

    >>> import turnscan as ts
    >>> scan = ts.import_pictures("pictures", "part.turnscan", ts.EvenSteps(15.0), rig="rig.json")
    >>> scan.frames, scan.angle_source
    (24, 'steps of 15°')
    """
    output, wanted = Path(output), chosen(ImportOptions, options, changes)
    stored = rig if rig is None or isinstance(rig, Rig) else read_rig_file(rig)
    lit = by_laser(pictures)
    series, steps, found = find_series(lit, dark_by_laser(dark, list(lit)), wanted)
    check_output(output, (".turnscan",))
    refuse_over_repairs(output)
    first = next(picture for _, picture in series[0].pictures(series[0].shots[:1]))
    _fits_rig(first, stored, series[0])
    marked = _MARKERS if isinstance(angles, MarkerAngles) else 0.0
    reading = progress.subrange(0, marked, "reading angles")
    table, remarks, source = find_angles(angles, series, wanted.every, stored, reading)
    sampling = progress.subrange(marked, marked + _SAMPLES, "sampling pictures")
    signals = find_signals(series, wanted, first, sampling)
    if isinstance(angles, EvenSteps) and stored is not None and not stored.markers:
        remarks = [*remarks, *check_outline(angles, series, signals, stored, wanted)]
    plan = _plan(series, steps, wanted, first, signals, source)
    total = sum(len(s.shots) for s in series)
    count = progress.subrange(marked + _SAMPLES, 1, "importing").counter(total)
    with replacing_scan(output, plan, stored) as scan:
        tally = write_frames(scan, series, signals, table, first, count)
    found += [*remarks, *(f for s in signals for f in s.findings), *tally.findings]
    return _imported(output, wanted, plan, signals, tally, source, found)


def by_laser(pictures: Pictures | Mapping[str, Pictures]) -> dict[str, list[str]]:
    """Names of pictures by laser; the only one is called ``laser``."""
    named = pictures if isinstance(pictures, Mapping) else {"laser": pictures}
    out = {
        laser: [str(some)] if isinstance(some, str | Path) else [str(one) for one in some]
        for laser, some in named.items()
    }
    if not out or not all(out.values()):
        raise InputError("no pictures are named", option=Option("pictures"))
    return out


def dark_by_laser(
    dark: Pictures | Mapping[str, Pictures], lasers: Sequence[str]
) -> dict[str, list[str]]:
    if isinstance(dark, Mapping):
        out = by_laser(dark) if dark else {}
        unknown = [name for name in out if name not in lasers]
        if unknown:
            raise InputError(
                f"no laser {unknown[0]!r}",
                hint=f"have {list(lasers)}",
                option=Option("dark", unknown[0]),
            )
        return out
    some = [str(dark)] if isinstance(dark, str | Path) else [str(one) for one in dark]
    return {laser: some for laser in lasers if some}


def find_signals(
    series: Sequence[Series], options: ImportOptions, first: Image, progress: Progress
) -> list[Signal]:
    """What is laser in the pictures of each laser; all have the weights of the first one."""
    signals: list[Signal] = []
    for k, one in enumerate(series):
        known = signals[0].weights if signals else None
        mine = progress.subrange(k / len(series), (k + 1) / len(series))
        signals.append(find_signal(one, options, known, first, mine))
    return signals


def _plan(
    series: Sequence[Series],
    steps: int,
    options: ImportOptions,
    first: Image,
    signals: Sequence[Signal],
    source: str,
) -> ScanPlan:
    weights = signals[0].weights
    threshold = options.threshold
    if threshold is None:
        threshold = max(s.threshold for s in signals)
    else:
        _check_threshold(threshold, first, weights)
    return ScanPlan(
        width=first.shape[1],
        height=first.shape[0],
        dtype="uint16" if first.dtype == np.uint16 else "uint8",
        channels=3 if first.ndim == 3 else 1,
        lasers=tuple(s.laser for s in series),
        steps=steps,
        threshold=threshold,
        keep=options.keep,
        orientation=options.orientation,
        weights=weights,
        source=f"imported, angles from {source}",
    )


def _check_threshold(threshold: float, first: Image, weights: ColourWeights | None) -> None:
    """Raise InputError for a threshold that no picture of this kind can pass."""
    full = float(np.iinfo(first.dtype).max)
    if weights is not None:
        full *= sum(w for w in weights if w > 0.0)
    if threshold >= full:
        raise InputError(
            f"the brightest pixel has {full:g} grey levels",
            hint="give a lower one, or leave it out to derive it from the noise",
            option=Option("threshold", threshold),
        )


def _fits_rig(picture: Image, rig: Rig | None, series: Series) -> None:
    if rig is None:
        return
    require_complete(rig, "rig")
    height, width = picture.shape[:2]
    if (width, height) != (rig.camera.width, rig.camera.height):
        raise InputError(
            f"{series.shots[0].name} is {width}×{height}, but the rig's camera has "
            f"{rig.camera.width}×{rig.camera.height}",
            hint="give the rig that was calibrated with pictures of this size",
        )


def _imported(
    path: Path,
    options: ImportOptions,
    plan: ScanPlan,
    signals: Sequence[Signal],
    tally: Tally,
    source: str,
    findings: Sequence[Finding],
) -> ImportedScan:
    per_frame = 2 if any(s.background is None for s in signals) else 1
    pixels = tally.frames * plan.width * plan.height
    noise = max(s.noise for s in signals)
    chosen = f"{NOISE_FACTOR:g} × the noise of {noise:.2f}"
    return ImportedScan(
        path,
        plan,
        tally.frames,
        (tally.first, tally.last) if tally.first <= tally.last else None,
        source,
        tuple(dict.fromkeys(s.origin for s in signals)),
        chosen if options.threshold is None else "as given",
        min(s.line_share for s in signals),
        tally.kept / max(tally.frames, 1),
        pixels * plan.channels * np.dtype(plan.dtype).itemsize * per_frame,
        path.stat().st_size,
        tuple(findings),
        tuple(dict.fromkeys(s.clipped for s in signals if s.clipped)),
    )
