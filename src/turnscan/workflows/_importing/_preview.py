"""What an import would make of pictures, before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import ColourWeights, Image
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.scan import read_picture
from turnscan.workflows._importing._pictures import (
    Pictures,
    by_laser,
    dark_by_laser,
    find_signals,
)
from turnscan.workflows._importing._series import Series, find_series, same_pictures
from turnscan.workflows._importing._signal import Signal, check_kind, grey_of
from turnscan.workflows._options._import import ImportOptions


@dataclass(frozen=True, eq=False)
class SeriesPreview:
    """The pictures of one laser, as they would be imported."""

    series: Series
    signal: Signal
    missing: tuple[int, ...]
    """Steps without a picture."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the pictures, in the order of their steps."""
        return tuple(shot.name for shot in self.series.shots)


@dataclass(frozen=True, eq=False)
class PreviewedPicture:
    """One picture, and the stripe that is found in it."""

    name: str
    step: int
    picture: Image
    position: npt.NDArray[np.float32]
    """px across the stripe, one for each line; NaN where there is none."""


@dataclass(frozen=True, eq=False)
class ImportPreview:
    """What was recognised in the pictures of an import."""

    series: tuple[SeriesPreview, ...]
    steps: int
    options: ImportOptions
    findings: tuple[Finding, ...]

    @property
    def weights(self) -> ColourWeights | None:
        """How much of red, green and blue is laser; None for grey pictures."""
        return self.series[0].signal.weights

    def picture(self, laser: str, number: int) -> PreviewedPicture:
        """The picture of this place in the series of a laser, and the stripe in it.

        Raises InputError where there is none, or it has another size than the first one.
        """
        from turnscan.stripes import StripeSettings, detect

        one = next((s for s in self.series if s.series.laser == laser), None)
        if one is None or not 0 <= number < len(one.series.shots):
            raise InputError(f"there is no picture {number} of laser {laser!r}")
        shot, lit = next(one.series.pictures([one.series.shots[number]]))
        own = one.series.dark_of(shot)
        dark = one.signal.background if own is None else read_picture(own)
        if dark is not None:
            check_kind(lit, dark, shot.name)
        weights = one.signal.weights
        # What lies lower is not stored, so that nothing could be made of it.
        given = self.options.threshold
        threshold = one.signal.threshold if given is None else given
        settings = StripeSettings(orientation=self.options.orientation, threshold=threshold)
        stripe = detect(grey_of(lit, weights), grey_of(dark, weights), settings)
        return PreviewedPicture(shot.name, shot.step, lit, stripe.position.astype(np.float32))


def preview_import(
    pictures: Pictures | Mapping[str, Pictures],
    *,
    dark: Pictures | Mapping[str, Pictures] = (),
    options: ImportOptions | None = None,
    progress: Progress = no_progress,
) -> ImportPreview:
    """Look at pictures as `import_pictures` would: steps and gaps, the laser's colour, the stripe.

    Nothing is written. Raises as `import_pictures` for pictures and options.
    """
    wanted = options or ImportOptions()
    lit = by_laser(pictures)
    series, steps, found = find_series(lit, dark_by_laser(dark, list(lit)), wanted)
    first = next(picture for _, picture in series[0].pictures(series[0].shots[:1]))
    signals = find_signals(series, wanted, first, progress)
    looked = tuple(
        SeriesPreview(one, signal, _missing(one, steps))
        for one, signal in zip(series, signals, strict=True)
    )
    found += [f for one in series for f in same_pictures(one)]
    found += [f for signal in signals for f in signal.findings]
    return ImportPreview(looked, steps, wanted, tuple(found))


def _missing(series: Series, steps: int) -> tuple[int, ...]:
    there = {shot.step for shot in series.shots}
    return tuple(k for k in range(steps) if k not in there)
