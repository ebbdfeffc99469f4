"""Which way does the table turn? The outline of the part is followed in two independent ways."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image

Singles = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex128]

VIEWS = 16
"""Of a whole turn; symmetries up to half as many fold are distinguished."""
_ANGLES_DEG = tuple(range(8, 62, 3))
"""Of triangulation, as a rig may have it: it is not known here."""
_ROUND = 0.1
"""Of its width by which a part's outline may vary and still count as round."""
_ALIKE, _CLEARER = 0.18, 0.18
"""Correlation of two witnesses from which they tell the same outline, and its lead over the other
way round."""

_LEAST_SHIFT = 0.03
"""px."""
_CERTAIN = 4.0
"""Times the shift that is chance, from which one is none."""
_EQUAL = 1.5
"""One of equal shifts is no larger than so many times another."""


@dataclass(frozen=True)
class OutlineTrack:
    """How far out the part's outline reaches, seen from one side, at each commanded angle."""

    reach: Floats
    """(views, rows) in any unit, larger is farther from the axis; NaN where it is not seen."""
    side: int
    """1 right, -1 left, as the camera sees it."""
    edge: bool
    """Seen as the edge against the background, 90° from the camera; else by a laser between."""

    @property
    def is_round(self) -> bool:
        """Whether the outline is nearly the same from everywhere."""
        seen = self.reach[:, np.isfinite(self.reach).all(axis=0)]
        return bool(seen.size) and float(seen.std(axis=0).mean()) < _ROUND * float(seen.mean())


def sense(witnesses: Sequence[OutlineTrack]) -> bool | None:
    """Whether the part turned counter-clockwise seen from above; None where they do not tell.

    What one witness sees of the part at one angle another sees after the table has turned by the
    angle between them, one way or the other. Both ways are tried, and the one in which they agree
    is right.
    """
    best = {+1: 0.0, -1: 0.0}
    spectra = [_spectrum(w.reach) for w in witnesses]
    for angle in _ANGLES_DEG:
        for way in best:
            scores = []
            for i, a in enumerate(witnesses):
                for j in range(i):
                    b = witnesses[j]
                    if a.edge and b.edge:
                        continue  # opposite each other: the same both ways
                    lag = way * (_azimuth(b, angle) - _azimuth(a, angle))
                    scores.append(_agreement(spectra[i], spectra[j], lag))
            if scores:
                best[way] = max(best[way], float(np.mean(scores)))
    if max(best.values()) < _ALIKE or abs(best[1] - best[-1]) < _CLEARER:
        return None
    return best[1] > best[-1]


def drift(views: Sequence[Singles]) -> bool | None:
    """Whether what is in front moves right from view to view; None where that is not seen.

    The first two views are of the same angle, each of the others is the same angle further on.
    What does not turn (light, shadows, the silhouette) holds the shift back, so only its sign
    counts: where it is larger than the shift between the first two, which is chance, and each time
    about the same, as equal angles make it and chance does not.
    """
    import cv2

    window = cv2.createHanningWindow(views[0].shape[::-1], cv2.CV_32F)
    shifts = np.array([cv2.phaseCorrelate(a, b, window)[0][0] for a, b in pairwise(views)])
    still, moved = abs(shifts[0]), shifts[1:]
    if np.abs(moved).min() < max(_LEAST_SHIFT, _CERTAIN * still, np.abs(moved).max() / _EQUAL):
        return None
    return bool(moved[0] > 0) if (moved > 0).all() or (moved < 0).all() else None


def edges(views: Sequence[Image]) -> tuple[OutlineTrack, OutlineTrack, float]:
    """Left and right edge of the part in pictures with room light, and the column of the axis."""
    import cv2

    stack = np.stack([_level(view) for view in views])
    threshold, _ = cv2.threshold(stack.reshape(len(stack), -1), 0, 255, cv2.THRESH_OTSU)
    inside = stack > threshold
    columns = np.arange(stack.shape[2])
    found = inside.sum(axis=2)
    middle = (inside * columns).sum(axis=2) / np.maximum(found, 1)
    axis = float(np.median(middle[found > 0])) if (found > 0).any() else stack.shape[2] / 2
    out = []
    for side in (-1, 1):
        reach = (inside & ((columns - axis) * side > 0)).sum(axis=2).astype(np.float64)
        reach[found == 0] = np.nan
        out.append(OutlineTrack(reach, side, True))
    return out[0], out[1], axis


def _level(view: Image) -> npt.NDArray[np.uint8]:
    """8 bits, a little smoothed."""
    import cv2

    grey = view if view.ndim == 2 else view.mean(axis=2)
    scaled = np.asarray(grey, np.float32) * (255.0 / max(float(np.percentile(grey, 99.5)), 1.0))
    return np.asarray(cv2.blur(np.clip(scaled, 0, 255).astype(np.uint8), (5, 5)))


def _azimuth(witness: OutlineTrack, angle: float) -> float:
    """Degrees from the camera's direction, positive to its right."""
    return witness.side * (90.0 if witness.edge else angle)


def _spectrum(reach: Floats) -> Spectrum:
    """(harmonics, rows); a row that is not seen nearly always says nothing."""
    seen = np.isfinite(reach)
    rows = seen.mean(axis=0) >= 0.75
    filled = np.where(seen, reach, 0.0)
    mean = filled.sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    away = np.where(seen & rows, reach - mean, 0.0)
    return np.fft.rfft(away, axis=0)


def _agreement(a: Spectrum, b: Spectrum, lag_deg: float) -> float:
    """Correlation of a at an angle with b at the angle and ``lag_deg`` more."""
    turn = np.exp(1j * math.radians(lag_deg) * np.arange(len(a)))[:, None]
    power = math.sqrt(float((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum()))
    return float((np.conj(a) * b * turn).real.sum()) / power if power > 0 else 0.0
