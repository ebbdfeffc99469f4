"""Does the camera see what the lasers are said to do?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.acquire._plan import Plan
from turnscan.arrays import Image
from turnscan.errors import LaserStateUnknown
from turnscan.remedy import Option, Remedy
from turnscan.scan import ScanPlan, signal_of, statistics

Pixels = npt.NDArray[Any]

_LINES = 120
"""Image lines that are looked at, of all there are."""
_LEAST_PIXELS = 12
_STILL_LIT = 0.5
"""Share of a stripe's light that is left in a dark picture from which the laser counts as lit."""
_BLIND_DEG = 30
"""A part may show no stripe over such an angle, once it has shown one."""


@dataclass(frozen=True)
class _Seen:
    """A stripe: its pixels, and its mean light there."""

    place: npt.NDArray[np.bool_]
    light: float
    dark: Pixels


class LaserWatch:
    """Compares lit and dark pictures, coarsely: is there a stripe, and is it gone afterwards?

    It knows no measuring; a stripe is light above the threshold of the scan.
    """

    def __init__(self, plan: Plan, scan_plan: ScanPlan) -> None:
        self._scan = scan_plan
        lines = scan_plan.height if scan_plan.orientation == "vertical" else scan_plan.width
        self._stride = max(1, lines // _LINES)
        self._least = max(_LEAST_PIXELS, min(lines, _LINES) // 10)
        self._limit = plan.blind_steps
        step = abs(float(plan.step_deg)) or 360.0
        self._later = max(self._limit, round(_BLIND_DEG / step))
        self._exposures = range(len(plan.exposures))
        self._blind: dict[tuple[str, int], int] = {}
        self._shown: set[str] = set()
        self._last: dict[tuple[str, int], _Seen] = {}

    def lit(self, laser: str, exposure: int, lit: Image, dark: Image) -> bool:
        """Note a lit picture and say whether it shows a stripe.

        Raises LaserStateUnknown where this laser has shown none for too many steps, in none of its
        exposures.
        """
        if not self._limit:
            return True
        off = self._thin(dark)
        signal = signal_of(self._thin(lit), off, self._scan.weights)
        place = signal > statistics(signal).level + 2 * self._scan.threshold
        key = laser, exposure
        if int(np.count_nonzero(place)) >= self._least:
            self._shown.add(laser)
            self._blind[key] = 0
            self._last[key] = _Seen(place, float(signal[place].mean()), off)
            return True
        self._last.pop(key, None)
        self._blind[key] = self._blind.get(key, 0) + 1
        blind = min(self._blind.get((laser, k), 0) for k in self._exposures)
        limit = self._later if laser in self._shown else self._limit
        if blind >= limit:
            raise LaserStateUnknown(
                f"laser {laser!r}: {blind} consecutive steps show no stripe although it was lit: "
                "it is defective, was lit all the time, or is not seen by the camera",
                hint=Remedy(
                    "if it is lit, cut its power; check laser and exposure (or ",
                    Option("blind_steps", 0),
                    ")",
                ),
            )
        return False

    def still_lit(self, exposure: int, dark: Image) -> str | None:
        """The laser of which a picture taken after its switching off shows the stripe."""
        off = self._thin(dark)
        for (laser, exposed), seen in self._last.items():
            if exposed != exposure:
                continue
            added = signal_of(off, seen.dark, self._scan.weights)
            shift = statistics(added).level
            if float(np.median(added[seen.place])) - shift > _STILL_LIT * seen.light:
                return laser
        return None

    def _thin(self, picture: Image) -> Image:
        if self._scan.orientation == "vertical":
            return picture[:: self._stride]
        return picture[:, :: self._stride]
