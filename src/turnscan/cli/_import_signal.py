"""What is laser and what is not, found from samples of the pictures, for ``turnscan import``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Image
from turnscan.cli._import_series import Series, Shot
from turnscan.errors import InputError
from turnscan.scan import read_picture, signal_of, statistics

NOISE_FACTOR = 4.0
"""Automatic threshold of what is kept = this × the noise: well below what detectors go by, and
one pixel in 30 000 is above it by chance."""
LEAST_THRESHOLD = 3.0
"""Grey levels."""
_SAMPLES = 41
_LESSONS = 8
_SAMPLE_BYTES = 512 << 20

Weights = tuple[float, float, float]


@dataclass(frozen=True)
class Signal:
    """How the light of the laser is told from the rest in the pictures of one laser."""

    weights: Weights | None
    """Of red, green, blue; None for grey pictures."""
    background: Image | None
    """Shared picture without the laser; None where every picture has its own."""
    origin: str
    """Where the dark pictures come from, in words."""
    noise: float
    """Grey levels of the signal."""
    threshold: float
    """Grey levels of the signal from which pixels are kept."""


def find_signal(
    series: Series, colour: str, known: Weights | None, first: Image, tick: Callable[[], None]
) -> Signal:
    """Look at up to 41 pictures of a series.

    ``colour`` is the user's choice for colour pictures; ``known`` are weights already found with
    another laser of the same scan. Raises InputError where the pictures differ in size or type.
    """
    lit: list[Image] = []
    own: list[Image] = []
    shots = _samples(series, first)
    for shot, picture in series.pictures(shots):
        check_kind(picture, first, shot.name)
        lit.append(picture)
        path = series.dark_of(shot)
        if path is not None:
            own.append(read_picture(path))
            check_kind(own[-1], first, str(path))
        tick()
    background, origin = _background(series, lit, own, first)
    darks: list[Image | None] = list(own) or [background] * len(lit)
    weights = None if first.ndim == 2 else known or _weights(colour, lit, darks)
    some = range(0, len(lit), max(1, len(lit) // 16))
    noise = float(np.median([statistics(signal_of(lit[i], darks[i], weights)).noise for i in some]))
    threshold = max(NOISE_FACTOR * noise, LEAST_THRESHOLD)
    return Signal(weights, background, origin, noise, threshold)


def check_kind(picture: Image, first: Image, name: str) -> None:
    """Raise InputError where a picture has not the size and type of the first one."""
    if picture.shape != first.shape or picture.dtype != first.dtype:
        raise InputError(
            f"{name} is {_kind(picture)}, but the first picture is {_kind(first)}",
            hint="all pictures of one scan must have one size and type",
        )


def _samples(series: Series, first: Image) -> list[Shot]:
    each = first.nbytes * (2 if series.dark_of(series.shots[0]) else 1)
    count = max(3, min(_SAMPLES, _SAMPLE_BYTES // each, len(series.shots)))
    places = np.unique(np.linspace(0, len(series.shots) - 1, count).round().astype(int))
    return [series.shots[i] for i in places]


def _background(
    series: Series, lit: list[Image], own: list[Image], first: Image
) -> tuple[Image | None, str]:
    if own:
        return None, "laser-off pictures"
    if series.dark:
        picture = read_picture(series.dark[0])
        check_kind(picture, first, str(series.dark[0]))
        return picture, f"one laser-off picture, {series.dark[0].name}"
    if len(lit) < 3:
        raise InputError(
            f"{len(series.shots)} pictures of laser {series.laser!r}, none with the laser off",
            hint="give --dark, or at least 3 pictures from which the background can be learned",
        )
    from turnscan.stripes import temporal_background

    return temporal_background(lit), f"median of {len(lit)} pictures"


def _weights(colour: str, lit: list[Image], darks: list[Image | None]) -> Weights:
    """Weights of red, green, blue from the user's choice, or learned from the samples."""
    from turnscan.stripes import COLOURS

    if colour == "learn":
        return _learned(lit, darks)
    if colour in COLOURS:
        return COLOURS[colour]
    try:
        red, green, blue = (float(c) for c in colour.split(","))
    except ValueError:
        red = green = blue = math.nan
    if not all(math.isfinite(w) for w in (red, green, blue)) or max(red, green, blue) <= 0.0:
        raise InputError(
            f"--colour {colour}: neither a colour nor three weights",
            hint=f"give learn, {', '.join(COLOURS)}, or weights like 1,-0.5,-0.5",
        )
    return red, green, blue


def _learned(lit: list[Image], darks: list[Image | None]) -> Weights:
    """Mean of what the samples teach; those in which no line is seen teach nothing."""
    from turnscan.stripes import learn_colour

    learned = []
    trouble = None
    for i in range(0, len(lit), max(1, len(lit) // _LESSONS)):
        try:
            learned.append(learn_colour(lit[i], darks[i]))
        except InputError as e:
            trouble = e
    if not learned:
        assert trouble is not None
        raise InputError(
            f"the laser's colour cannot be learned: {trouble.message}",
            hint="give --colour red, green, blue or three weights",
        )
    red, green, blue = (round(float(w), 4) for w in np.mean(learned, axis=0))
    return red, green, blue


def _kind(picture: Image) -> str:
    colour = "colour" if picture.ndim == 3 else "grey"
    return f"{picture.shape[1]}×{picture.shape[0]} {colour} {picture.dtype}"
