"""Which picture belongs to which step and laser, for an import."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from turnscan.arrays import Image
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.remedy import Option, Remedy
from turnscan.scan import (
    is_video,
    list_pictures,
    numbers_apart,
    picture_numbers,
    read_picture,
    read_video,
)
from turnscan.workflows._options._import import ImportOptions

_SPARSE_NUMBERS = 5
"""Numbers in names are steps only where at least one in so many of them has a picture."""


@dataclass(frozen=True)
class Shot:
    """One exposure that is to be imported."""

    step: int
    number: int
    """The number in the picture's name, or its place in the order."""
    name: str


@dataclass(frozen=True)
class Series:
    """The pictures of one laser, in step order."""

    laser: str
    shots: tuple[Shot, ...]
    lit: tuple[Path, ...]
    """One path a shot, or the one path of a video."""
    dark: tuple[Path, ...] = ()
    """None, one for all, or one a shot."""

    @property
    def lossy(self) -> bool:
        """Whether colours are known in steps only, as in JPEG and videos."""
        return is_video(self.lit[0]) or self.lit[0].suffix.lower() in (".jpg", ".jpeg")

    def pictures(self, shots: Sequence[Shot] | None = None) -> Iterator[tuple[Shot, Image]]:
        """The lit pictures of these shots (default all) in order, read one at a time."""
        wanted = self.shots if shots is None else tuple(shots)
        if not is_video(self.lit[0]):
            path_of = dict(zip(self.shots, self.lit, strict=True))
            for shot in wanted:
                yield shot, read_picture(path_of[shot])
            return
        by_number = {shot.number: shot for shot in wanted}
        for number, picture in enumerate(read_video(self.lit[0])):
            if number in by_number:
                yield by_number[number], picture

    def dark_of(self, shot: Shot) -> Path | None:
        """The laser-off picture of a shot, where each shot has its own."""
        return self.dark[self.shots.index(shot)] if len(self.dark) == len(self.shots) > 1 else None


def find_series(
    lit: dict[str, list[str]], dark: dict[str, list[str]], options: ImportOptions
) -> tuple[list[Series], int, list[Finding]]:
    """Series of each laser, the number of steps, and what is worth saying.

    ``lit`` and ``dark`` give folders, patterns or files by laser.
    Raises InputError where pictures are missing or lit and dark ones do not match.
    """
    found: list[Finding] = []
    first = options.first_step
    paths = {laser: _paths(specs) for laser, specs in lit.items()}
    numbers = {laser: _numbers(some, found) for laser, some in paths.items()}
    lowest = min(min(n) for n in numbers.values()) if first is None else first
    if any(n < lowest for some in numbers.values() for n in some):
        raise InputError(
            "there are pictures with lower numbers",
            hint="give the lowest number that takes part, or leave the option out",
            option=Option("first_step", first),
        )
    apart = numbers_apart([n for some in numbers.values() for n in some], lowest)
    series = []
    for laser, some in paths.items():
        shots = tuple(
            Shot((n - lowest) // apart, n, _name(path, n))
            for path, n in zip(some * len(numbers[laser]) if _one_video(some) else some,
                               numbers[laser], strict=not _one_video(some))
        )  # fmt: skip
        series.append(_with_dark(Series(laser, shots, tuple(some)), dark.get(laser, [])))
    series = [_thinned(s, options.every) for s in series]
    steps = 1 + max(shot.step for s in series for shot in s.shots)
    return series, steps, found


def same_pictures(series: Series) -> list[Finding]:
    """Neighbouring pictures with the same bytes: a camera that froze, or a file copied twice."""
    if is_video(series.lit[0]):
        return []
    digests = [hashlib.sha256(p.read_bytes()).digest() for p in series.lit]
    same = [
        b.name
        for a, b, x, y in zip(series.lit, series.lit[1:], digests, digests[1:], strict=False)
        if x == y and a != b
    ]
    if not same:
        return []
    return [
        Finding(
            "scan.same-picture",
            "warning",
            f"{len(same)} pictures are identical to the picture before them",
            where=", ".join(same[:5]),
            remedy="remove them, or scan again: the camera delivered the same picture repeatedly",
        )
    ]


def _paths(specs: list[str]) -> list[Path]:
    if len(specs) == 1 and is_video(specs[0]):
        return [Path(specs[0])]
    if any(is_video(s) for s in specs):
        raise InputError("a video and other pictures in one series", hint="import them one by one")
    out = [path for spec in specs for path in list_pictures(spec)]
    if len(set(out)) != len(out):
        twice = next(p for p in out if out.count(p) > 1)
        raise InputError(f"{twice}: given twice", hint="name every picture once")
    return out


def _one_video(paths: list[Path]) -> bool:
    return len(paths) == 1 and is_video(paths[0])


def _numbers(paths: list[Path], found: list[Finding]) -> list[int]:
    """A number for each picture: the one in its name, or else its place in the order."""
    if _one_video(paths):
        found.append(
            Finding(
                "scan.video",
                "warning",
                "a lossy video moves the centre of the stripe from frame to frame",
                where=str(paths[0]),
                remedy="for measuring, take single pictures without loss (PNG)",
            )
        )
        return list(range(sum(1 for _ in read_video(paths[0]))))
    numbers = picture_numbers([p.name for p in paths])
    if numbers is None:
        if len(paths) > 1:
            found.append(
                Finding(
                    "scan.no-numbers",
                    "note",
                    "the names do not differ in one number; pictures are numbered in natural order",
                    where=f"{paths[0].name} … {paths[-1].name}",
                )
            )
        return list(range(len(paths)))
    low = min(numbers)
    apart = numbers_apart(numbers, low)
    if (max(numbers) - low) // apart >= _SPARSE_NUMBERS * len(numbers):
        found.append(
            Finding(
                "scan.wild-numbers",
                "warning",
                "the numbers in the names are too far apart to be steps; pictures are numbered "
                "in order",
                where=f"{paths[0].name} … {paths[-1].name}",
                remedy="number the pictures by their step if some are missing",
            )
        )
        return list(range(len(paths)))
    return numbers


def _name(path: Path, number: int) -> str:
    return f"{path.name}#{number}" if is_video(path) else path.name


def _with_dark(series: Series, specs: list[str]) -> Series:
    """Add the laser-off pictures: one for all, or one for each by number or by order."""
    if not specs:
        return series
    dark = _paths(specs)
    if _one_video(dark) or _one_video(list(series.lit)):
        raise InputError(
            "a video has no laser-off pictures", hint=Remedy("leave ", Option("dark"), " out")
        )
    if len(dark) == 1:
        return replace(series, dark=tuple(dark))
    numbers = picture_numbers([p.name for p in dark])
    own = {shot.number for shot in series.shots}
    if numbers is not None and own <= set(numbers) and len(own) == len(series.shots):
        by_number = dict(zip(numbers, dark, strict=True))
        return replace(series, dark=tuple(by_number[shot.number] for shot in series.shots))
    if len(dark) != len(series.shots):
        raise InputError(
            f"{len(series.shots)} pictures of laser {series.laser!r} with the laser on, "
            f"{len(dark)} with it off",
            hint="give as many of both, one laser-off picture for all, or none",
        )
    return replace(series, dark=tuple(dark))


def _thinned(series: Series, every: int) -> Series:
    if every == 1:
        return series
    keep = [i for i, shot in enumerate(series.shots) if shot.step % every == 0]
    if not keep:
        raise InputError(
            f"no picture of this laser remains: {series.laser!r}", option=Option("every", every)
        )
    shots = tuple(replace(series.shots[i], step=series.shots[i].step // every) for i in keep)
    each = len(series.dark) == len(series.shots) > 1
    return Series(
        series.laser,
        shots,
        series.lit if is_video(series.lit[0]) else tuple(series.lit[i] for i in keep),
        tuple(series.dark[i] for i in keep) if each else series.dark,
    )
