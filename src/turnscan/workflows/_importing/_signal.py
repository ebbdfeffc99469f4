"""What is laser and what is not, found from samples of the pictures, for an import."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from turnscan.arrays import ColourWeights, Image
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress
from turnscan.remedy import Option, Remedy
from turnscan.scan import LEAST_THRESHOLD, NOISE_FACTOR, read_picture, signal_of, statistics
from turnscan.stripes import Orientation
from turnscan.workflows._importing._colour import LEARN, colour_weights
from turnscan.workflows._importing._look import look_at_line
from turnscan.workflows._importing._series import Series, Shot
from turnscan.workflows._options._import import ImportOptions

if TYPE_CHECKING:
    from turnscan.stripes import Candidates

_SAMPLES = 41
_LESSONS = 8
_BEND = 2.0  # px between a centre and the line through its neighbours, at most
_SAMPLE_BYTES = 512 << 20
_REACH = 8
"""px: what is farther from the middle of a line is no part of it."""
_MOST = 0.5
"""Of the light: less of it on a line is worth a warning."""
_THIN, _BETTER = 0.3, 1.5
"""Part of the light on a line, times the part of rows with one: below it other colours are tried.
Times: another one must be so much better."""
_TWICE, _SURE, _BLOCK = 2.0, 4.0, 8
"""Noise and blocks of JPEG make as much of a line in a difference as in its mirror, where channels
that are added and taken off have changed places and a line is a ditch. A difference must exceed so
many times that figure by so many standard deviations of a share of blocks of so many rows. Of white
noise both figures are 0; of JPEG of quality 40 to 95 without a line the difference's was at most
three times the mirror's."""
_EDGES = 0.3
"""Of the light of a difference, the part on a line: what moves with the edges of a coloured part
has 0.13 to 0.28 of it there, a weak line in a lit room at least 0.33."""
_COLOUR_STEP = 10.0 / 255.0
"""Of full scale: pictures of a lossy format know colours in steps, which follow the edges of a
part that is nearly grey. Where no line was, half of what a difference found had at most 2 to 8 of
255 (quality 30 to 90); of a line of 35, at least 16."""
_FULL, _CLIPPED = 0.97, 0.3
"""Of full scale: a channel above it is clipped. Of the line: so much clipped is worth a word."""


Trial = tuple["Image | None", str, "list[Image | None]", "ColourWeights | None"]
"""Background, its origin in words, the dark pictures of the samples, and weights."""


@dataclass(frozen=True)
class Signal:
    """How the light of the laser is separated from the rest in the pictures of one laser."""

    weights: ColourWeights | None
    """Of red, green, blue; None for grey pictures."""
    background: Image | None
    """Shared picture without the laser; None where every picture has its own."""
    origin: str
    """Where the dark pictures come from, in words."""
    noise: float
    """Grey levels of the signal."""
    threshold: float
    """Grey levels of the signal from which pixels are kept."""
    line_share: float = 0.0
    """Of the rows of the samples: those in which a line stands in line with its neighbours."""
    findings: tuple[Finding, ...] = ()
    """What is wrong with the line."""
    clipped: str = ""
    """That a channel counts little as the line is clipped in it, in words; may be empty."""


def find_signal(
    series: Series,
    options: ImportOptions,
    known: ColourWeights | None,
    first: Image,
    progress: Progress,
) -> Signal:
    """Look at up to 41 pictures of a series.

    ``known`` are weights already found with another laser of the same scan. Raises InputError
    where the pictures differ in size or type.
    """
    lit: list[Image] = []
    own: list[Image] = []
    samples = _samples(series, first)
    count = progress.counter(len(samples))
    for shot, picture in series.pictures(samples):
        check_kind(picture, first, shot.name)
        lit.append(picture)
        path = series.dark_of(shot)
        if path is not None:
            own.append(read_picture(path))
            check_kind(own[-1], first, str(path))
        count()
    trials: list[Trial] = []
    trouble: InputError | None = None
    remarks: list[Finding] = []
    for background, origin in _backgrounds(series, lit, own, first, options, known):
        darks: list[Image | None] = list(own) or [background] * len(lit)
        try:
            weights = None if first.ndim == 2 else known or _weights(options.colour, lit, darks)
        except InputError as e:  # another background may show the line
            trouble = e
            continue
        trials.append((background, origin, darks, weights))
    if trouble is not None and not trials:
        raise trouble
    background, origin, darks, weights = _best(trials, lit, options.orientation)
    if weights is not None and known is None and options.colour == LEARN:
        on_it, rows = _on_the_line(lit, darks, weights, options.orientation)
        thin = on_it * rows
        if thin < _THIN:
            other, found = _by_difference(trials, lit, options.orientation)
            least = _COLOUR_STEP * np.iinfo(first.dtype).max if series.lossy else 0.0
            is_line = found > _BETTER * thin and _is_line(other, found, lit, options)
            if better := is_line and _height(other, lit, options.orientation) >= least:
                background, origin, darks, weights = other
            # With much of the light on it the line is thin, and the part small in the picture.
            if (not better or found <= _THIN / 2) and on_it < _MOST:
                remarks.append(_no_thin_line(series.laser))
    some = range(0, len(lit), max(1, len(lit) // 16))
    noise = float(np.median([statistics(signal_of(lit[i], darks[i], weights)).noise for i in some]))
    threshold = max(NOISE_FACTOR * noise, LEAST_THRESHOLD)
    pairs = ((grey_of(lit[i], weights), grey_of(darks[i], weights)) for i in some)
    share, more = look_at_line(series.laser, pairs, options.orientation)
    told = ""
    if weights is not None and options.colour == LEARN:
        told = _clipped(lit, darks, weights)
    return Signal(weights, background, origin, noise, threshold, share, (*remarks, *more), told)


def _best(trials: list[Trial], lit: list[Image], orientation: Orientation) -> Trial:
    """The background that lets most of the stripe be seen."""
    if len(trials) == 1:
        return trials[0]
    return trials[int(np.argmax([_smooth_lines(lit, t[2], t[3], orientation) for t in trials]))]


def _by_difference(
    trials: list[Trial], lit: list[Image], orientation: Orientation
) -> tuple[Trial, float]:
    """The background and the difference of channels that show most of a thin line, and how much.

    In a difference nothing that is grey is seen. Each channel minus the mean of the others comes
    first: what the light that moves is made of says nothing where the part is brighter than the
    line. Of the best one, the others are then taken off by themselves.
    """
    best, most = trials[0], -1.0
    for share in (0.5, 0.0, 1.0):
        channels = range(3) if most < 0 else (int(np.argmax(best[3] or (0.0,))),)
        for k in channels:
            mix = [0.0, 0.0, 0.0]
            mix[k], mix[(k + 1) % 3], mix[(k + 2) % 3] = 1.0, 0.0 - share, share - 1.0
            weights = (mix[0], mix[1], mix[2])
            for background, origin, darks, _ in trials:
                found = math.prod(_on_the_line(lit, darks, weights, orientation))
                if found > most:
                    best, most = (background, origin, darks, weights), found
    return best, most


def _is_line(trial: Trial, found: float, lit: list[Image], options: ImportOptions) -> bool:
    """Whether a difference of channels shows a line: neither noise nor edges of a coloured part."""
    _, _, darks, weights = trial
    assert weights is not None
    mirror = (-weights[0], -weights[1], -weights[2])
    chance = math.prod(_on_the_line(lit, darks, mirror, options.orientation))
    rows = lit[0].shape[0 if options.orientation == "vertical" else 1]
    blocks = len(range(0, len(lit), max(1, len(lit) // _LESSONS))) * rows / _BLOCK
    if found <= _TWICE * chance + _SURE * math.sqrt(found / blocks):
        return False
    return _on_the_line(lit, darks, weights, options.orientation)[0] >= _EDGES


def _height(trial: Trial, lit: list[Image], orientation: Orientation) -> float:
    """Grey levels: the median of the light where the line is."""
    from turnscan.stripes import StripeSettings, detect

    _, _, darks, weights = trial
    on_it = list[Any]()
    for i in range(0, len(lit), max(1, len(lit) // _LESSONS)):
        place = detect(
            grey_of(lit[i], weights),
            grey_of(darks[i], weights),
            StripeSettings(orientation=orientation),
        ).position
        rows = np.flatnonzero(np.isfinite(place))
        light = signal_of(lit[i], darks[i], weights)
        lines = light if orientation == "vertical" else light.T
        on_it.append(lines[rows, place[rows].round().astype(int).clip(0, lines.shape[1] - 1)])
    light = np.concatenate(on_it)
    return float(np.median(light)) if len(light) else 0.0


def _clipped(lit: list[Image], darks: list[Image | None], weights: ColourWeights) -> str:
    """That a channel counts little as much of the line is clipped in it, or nothing.

    The line is what has more than half of the most light; a plateau says little about where its
    middle is.
    """
    some = range(0, len(lit), max(1, len(lit) // _LESSONS))
    full = np.zeros(3)
    for i in some:
        dark = darks[i]
        light = lit[i].astype(np.float32) - (0 if dark is None else dark)
        grey = light.sum(axis=2)
        line = grey > 0.5 * grey.max()
        full += (lit[i][line] >= _FULL * np.iinfo(lit[i].dtype).max).mean(axis=0) / len(some)
    k = int(np.argmax(full))
    if full[k] < _CLIPPED or weights[k] >= max(weights):
        return ""
    name = ("red", "green", "blue")[k]
    return f"{name} counts little, as {full[k]:.0%} of the line is clipped in it"


def _no_thin_line(laser: str) -> Finding:
    return Finding(
        "scan.no-line",
        "warning",
        "most of the light that moves from picture to picture lies on no thin line: it is the part "
        "itself, lit by the room",
        where=f"laser {laser}",
        remedy=Remedy("take the pictures in a darker room, or give those with the laser off: ",
                      Option("dark"), ", or its ", Option("colour")),
    )  # fmt: skip


def _on_the_line(
    lit: list[Image],
    darks: list[Image | None],
    weights: ColourWeights | None,
    orientation: Orientation,
) -> tuple[float, float]:
    """Of the light that would be kept, the part on a thin line; and of the rows, those with one.

    Where a part moves in a lit room, what is kept is mostly the part itself; its outline, too, is
    continuous from row to row.
    """
    from turnscan.stripes import StripeSettings, detect

    settings = StripeSettings(orientation=orientation)
    near = total = formed = rows = 0
    for i in range(0, len(lit), max(1, len(lit) // _LESSONS)):
        light = signal_of(lit[i], darks[i], weights)
        seen = statistics(light)
        above = light > seen.level + max(NOISE_FACTOR * seen.noise, LEAST_THRESHOLD)
        place = detect(grey_of(lit[i], weights), grey_of(darks[i], weights), settings).position
        above = above if orientation == "vertical" else above.T
        line = np.zeros(len(place), dtype=bool)
        line[1:-1] = np.abs(np.diff(place, 2)) < _BEND
        beside = np.abs(np.arange(above.shape[1]) - place[:, None]) <= _REACH
        near += int(np.count_nonzero(above & beside & line[:, None]))
        total += int(np.count_nonzero(above))
        formed += int(np.count_nonzero(line))
        rows += len(place)
    return near / max(total, 1), formed / max(rows, 1)


def grey_of(picture: Image | None, weights: ColourWeights | None) -> Any:
    """One channel of a picture, by the weights of the colours where it has several."""
    from turnscan.stripes import project_colour

    if picture is None or weights is None:
        return picture
    return project_colour(picture, weights, np.uint16)


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


def _backgrounds(
    series: Series,
    lit: list[Image],
    own: list[Image],
    first: Image,
    options: ImportOptions,
    known: ColourWeights | None,
) -> Iterator[tuple[Image | None, str]]:
    """Pictures without the laser that may serve, with their origin in words."""
    if own:
        yield None, "laser-off pictures"
        return
    if series.dark:
        picture = read_picture(series.dark[0])
        check_kind(picture, first, str(series.dark[0]))
        yield picture, f"one laser-off picture, {series.dark[0].name}"
        return
    if len(lit) < 3:
        raise InputError(
            f"{len(series.shots)} pictures of laser {series.laser!r}, none with the laser off",
            hint=Remedy(
                "give ",
                Option("dark"),
                ", or at least 3 pictures from which the background can be learned",
            ),
        )
    from turnscan.stripes import background_beside, temporal_background

    if options.background in ("auto", "median"):
        yield temporal_background(lit), f"median of {len(lit)} pictures"
    if options.background in ("auto", "beside"):
        try:
            lines = _lines(lit, options, known)
        except InputError:  # no colour is seen in one picture alone: the others may show it
            if options.background != "auto":
                raise
        else:
            beside = background_beside(lit, lines)
            yield beside, f"median of {len(lit)} pictures, of each pixel outside the stripe"
    if options.background in ("auto", "darkest"):
        yield temporal_background(lit, 0.0), f"darkest of {len(lit)} pictures"


def _lines(
    lit: list[Image], options: ImportOptions, known: ColourWeights | None
) -> list[Candidates]:
    """What may be the stripe in each of the pictures, by what is narrow and bright in them."""
    from turnscan.stripes import StripeSettings, find_candidates, project_colour, without_lines

    weights = known
    if lit[0].ndim == 3 and known is None:
        some = lit[:: max(1, len(lit) // _LESSONS)]
        weights = _weights(
            options.colour, some, [without_lines(p, options.orientation) for p in some]
        )
    settings = StripeSettings(orientation=options.orientation, max_candidates=5)
    out = []
    for picture in lit:
        dark = without_lines(picture, options.orientation)
        if weights is not None:
            picture, dark = (project_colour(p, weights, np.uint16) for p in (picture, dark))
        out.append(find_candidates(picture, dark, settings))
    return out


def _smooth_lines(
    lit: list[Image],
    darks: list[Image | None],
    weights: ColourWeights | None,
    orientation: Orientation,
) -> int:
    """Lines in which a background lets the stripe be seen in line with its neighbours.

    The median keeps what never moves: rightly a line on the wall, wrongly a stripe that stays in
    place, as on a round part. What a pixel shows away from the stripe spares that one; where a dark
    part hides much of a bright wall, so that no one picture is the background, the darkest does.
    """
    from turnscan.stripes import StripeSettings, detect, project_colour

    chosen = StripeSettings(orientation=orientation)
    total = 0
    for i in range(0, len(lit), max(1, len(lit) // _LESSONS)):
        on, off = lit[i], darks[i]
        if weights is not None:
            on = project_colour(on, weights, np.uint16)
            off = None if off is None else project_colour(off, weights, np.uint16)
        bend = np.abs(np.diff(detect(on, off, chosen).position, 2))
        total += int(np.count_nonzero(bend < _BEND))
    return total


def _weights(colour: str, lit: list[Image], darks: list[Image | None]) -> ColourWeights:
    """Weights of red, green and blue from the user's choice, or learned from the samples."""
    return _learned(lit, darks) if colour == LEARN else colour_weights(colour)


def _learned(lit: list[Image], darks: list[Image | None]) -> ColourWeights:
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
            hint=Remedy("give ", Option("colour"), " red, green, blue or three weights"),
        )
    red, green, blue = (round(float(w), 4) for w in np.mean(learned, axis=0))
    return red, green, blue


def _kind(picture: Image) -> str:
    colour = "colour" if picture.ndim == 3 else "grey"
    return f"{picture.shape[1]}×{picture.shape[0]} {colour} {picture.dtype}"
