"""The table's angle of every picture, for an import: even steps, a list, or markers."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan.arrays import Image
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.findings import Finding
from turnscan.progress import Progress
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan import is_video, read_picture
from turnscan.workflows._importing._look import check_turn
from turnscan.workflows._importing._series import Series, Shot
from turnscan.workflows._options._import import AngleSource, EvenSteps, MarkerAngles

_TABLE_BYTES = 16 << 20


@dataclass(frozen=True)
class Angle:
    """The angle of one shot, rad; NaN where that kind of angle is not known."""

    commanded: float = math.nan
    measured: float = math.nan
    sigma: float = math.nan


Angles = dict[tuple[str, int], Angle]
"""By laser and step."""


def find_angles(
    source: AngleSource,
    series: Sequence[Series],
    every: int,
    rig: Rig | None,
    progress: Progress,
) -> tuple[Angles, list[Finding], str]:
    """Angles of all shots, findings, and in words where they come from.

    ``progress`` hears of the pictures that are searched for markers. Raises InputError,
    FormatError where a shot has no angle, or the list cannot be read.
    """
    if isinstance(source, EvenSteps):
        step, found = source.step_deg, list[Finding]()
        if rig is not None and rig.markers:
            found = check_turn(source, rig, _sampled(series[0]), every)
        even = {
            (s.laser, shot.step): Angle(math.radians(step * every * shot.step))
            for s in series
            for shot in s.shots
        }
        return even, found, f"steps of {step:g}°"
    if isinstance(source, MarkerAngles):
        angles, found = _by_markers(series, rig, progress)
        return angles, found, "markers"
    if not source.path.is_file():
        raise InputError(
            "no such file",
            hint="give step:DEG, markers, or a CSV file",
            option=Option("angles", str(source)),
        )
    return _by_table(source.path, series), [], f"the list {source.path.name}"


def _sampled(series: Series) -> list[tuple[int, str, Image]]:
    """Step, name and picture of the first steps, which tell turns apart, and some of the rest."""
    count = len(series.shots)
    some = {*range(min(4, count)), *np.linspace(0, count - 1, 8).round().astype(int).tolist()}
    wanted = {series.shots[i] for i in some}
    return [(s.step, s.name, p) for s, p in _marker_pictures(series, wanted)]


def _by_table(path: Path, series: Sequence[Series]) -> Angles:
    """Angles from a CSV file: a line per picture in order, or lines of number and angle."""
    rows = _table(path)
    width = len(rows[0][1])
    shots = [(s.laser, shot) for s in series for shot in s.shots]
    if width == 1:
        if any(len(s.shots) != len(rows) for s in series):
            counts = ", ".join(str(len(s.shots)) for s in series)
            raise InputError(
                f"{path}: {len(rows)} angles for {counts} pictures",
                hint="give one line for every picture, or lines of number,angle_deg",
            )
        return {
            (s.laser, shot.step): Angle(math.radians(row[1][0]))
            for s in series
            for shot, row in zip(s.shots, rows, strict=True)
        }
    by_number: dict[float, tuple[float, ...]] = {}
    for line, row in rows:
        if row[0] in by_number:
            raise FormatError(f"{path}: line {line}: number {row[0]:g} is given twice")
        by_number[row[0]] = row
    lacking = [shot.name for _, shot in shots if shot.number not in by_number]
    if lacking:
        raise InputError(
            f"{path}: no angle for {lacking[0]} and {len(lacking) - 1} other pictures",
            hint="the first column is the number in the picture's name",
        )
    return {(laser, shot.step): _listed(by_number[shot.number]) for laser, shot in shots}


def _listed(row: tuple[float, ...]) -> Angle:
    sigma = math.radians(row[2]) if len(row) == 3 else math.nan
    return Angle(math.radians(row[1]), sigma=sigma)


def _table(path: Path) -> list[tuple[int, tuple[float, ...]]]:
    """Numbers of each line, with the line's number. One first line of words is passed over."""
    if path.stat().st_size > _TABLE_BYTES:
        raise LimitExceeded(f"{path}: larger than {_TABLE_BYTES} bytes")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint="write it as CSV in UTF-8") from None
    rows: list[tuple[int, tuple[float, ...]]] = []
    heading = True
    for line, text in enumerate(lines, 1):
        cells = [c.strip() for c in text.replace(";", ",").split(",")]
        if not any(cells) or text.lstrip().startswith("#"):
            continue
        if heading and all(any(c.isalpha() for c in cell) for cell in cells) and not rows:
            heading = False
            if cells[0].lower() not in ("nan", "inf", "-nan", "-inf"):
                continue
        row = tuple(_number(c, f"{path}: line {line}") for c in cells)
        if len(row) > 3 or (rows and len(row) != len(rows[0][1])):
            raise FormatError(
                f"{path}: line {line}: {len(row)} values",
                hint="give angle_deg, or number,angle_deg, or number,angle_deg,sigma_deg",
            )
        if len(row) == 3 and row[2] < 0:
            raise FormatError(f"{path}: line {line}: a negative uncertainty")
        rows.append((line, row))
    if not rows:
        raise FormatError(f"{path}: no angle in it", hint="give one line for every picture")
    return rows


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise FormatError(f"{where}: {text!r} is not a number") from None
    if not math.isfinite(value):
        raise FormatError(f"{where}: {text} is not an angle", hint="give finite degrees")
    return value


def _by_markers(
    series: Sequence[Series], rig: Rig | None, progress: Progress
) -> tuple[Angles, list[Finding]]:
    """Angles seen by the markers on the platter, outliers out and gaps filled by the motion."""
    from turnscan.calibrate import angle_model, moved_platter, platter_seen

    if rig is None or not rig.markers:
        raise InputError(
            "this needs a rig with table markers",
            hint=Remedy("give ", Option("rig"), " with a file made by turnscan calibrate"),
            option=Option("angles", "markers"),
        )
    count = progress.counter(sum(len(one.shots) for one in series))
    places: list[tuple[str, int]] = []
    names: list[str] = []
    seen: list[tuple[float, float]] = []
    off: list[float] = []
    for one in series:
        for shot, picture in _marker_pictures(one):
            platter = platter_seen(picture, rig)
            angle = platter.angle
            off.append(platter.off)
            places.append((one.laser, shot.step))
            names.append(shot.name)
            seen.append((math.nan, math.nan) if angle is None else (angle.angle, angle.sigma))
            count()
    table, moved = np.array(seen), moved_platter(rig, off)
    if moved and np.isnan(table[:, 0]).all():
        raise InputError(moved[0].message, hint=moved[0].remedy, option=Option("rig"))
    steps = np.array([step for _, step in places])
    model = angle_model(table[:, 0], table[:, 1], steps, names=names)
    angles = {
        place: Angle(measured=float(angle), sigma=float(sigma))
        for place, angle, sigma in zip(places, model.angles, model.sigmas, strict=True)
    }
    return angles, [*moved, *model.findings]


def _marker_pictures(
    series: Series, wanted: Collection[Shot] | None = None
) -> Iterator[tuple[Shot, Image]]:
    """Pictures in which to look for markers: with the laser off where each shot has one."""
    shots = [s for s in series.shots if wanted is None or s in wanted]
    if len(series.dark) == len(series.shots) > 1 and not is_video(series.lit[0]):
        dark = dict(zip(series.shots, series.dark, strict=True))
        return ((shot, read_picture(dark[shot])) for shot in shots)
    return series.pictures(shots)
