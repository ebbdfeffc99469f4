"""The laser: a fan of light with Gaussian thickness, from a line lens or a swept spot.

Gaussian-beam optics (Siegman, Lasers, 1986, ch. 17) across the sheet;
along it the profile of the lens, or the dwell time of a galvanometer mirror.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen

Profile = Literal["powell", "gaussian", "galvo"]
_PROFILES: tuple[Profile, ...] = ("powell", "gaussian", "galvo")


@dataclass(frozen=True)
class Beam:
    """One laser, in the camera frame; its sheet is the `LaserSheet` of the same name in the rig.

    Raises ValueError, naming the field, where a value is out of range.
    """

    name: str
    apex: Floats
    """(3,) mm: where the fan opens."""
    aim: Floats
    """(3,) unit vector: the middle of the fan."""
    half_angle: float = 0.25
    """Half the opening of the fan, rad."""
    power: float = 5e-3
    """W."""
    wavelength: float = 650e-6
    """mm."""
    waist: float = 0.1
    """mm: 1/e² radius of the sheet where it is thinnest (σ = waist/2)."""
    waist_distance: float = 400.0
    """mm from the apex to the waist."""
    quality: float = 1.0
    """M²: how much faster than an ideal beam it diverges."""
    profile: Profile = "powell"
    """powell: even; gaussian: 1/e² at the fan's ends; galvo: a spot swept by a vibrating mirror."""
    frequency: float = 300.0
    """Hz of the galvanometer."""
    spot: float = 0.02
    """Size of the swept spot relative to half the fan."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "apex", frozen(self.apex, (3,), "Beam.apex"))
        aim = np.asarray(self.aim, dtype=np.float64)
        put(self, "aim", frozen(aim / np.linalg.norm(aim), (3,), "Beam.aim"))
        above_zero = ("power", "wavelength", "waist", "frequency", "spot", "half_angle")
        for name in above_zero:
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"Beam.{name}: {getattr(self, name)}, expected above 0")
        if not self.half_angle < 1.5:
            raise ValueError(f"Beam.half_angle: {self.half_angle} rad, expected below 1.5")
        if self.quality < 1.0:
            raise ValueError(f"Beam.quality: M² = {self.quality}, expected 1 or more")
        if self.profile not in _PROFILES:
            raise ValueError(f"Beam.profile: {self.profile!r}, expected one of {_PROFILES}")

    @property
    def rayleigh(self) -> float:
        """Rayleigh length, mm."""
        return float(np.pi * self.waist**2 / (self.wavelength * self.quality))

    def radius(self, distance: npt.ArrayLike) -> Floats:
        """1/e² radius of the sheet, mm, at distances (...) mm from the apex along the aim."""
        z = (np.asarray(distance, dtype=np.float64) - self.waist_distance) / self.rayleigh
        return np.asarray(self.waist * np.sqrt(1.0 + z * z))

    def share(self, s: npt.ArrayLike, start: npt.ArrayLike, seconds: float) -> Floats:
        """Share of the power per unit of s in (−1, 1) across the fan; integrates to 1.

        ``start`` and ``seconds`` are when the shutter opens and for how long: a galvanometer that
        does not make a whole number of sweeps in that time lights part of the line once more.
        """
        x = np.asarray(s, dtype=np.float64)
        inside = np.abs(x) <= 1.0
        if self.profile == "powell":
            return np.where(inside, 0.5, 0.0)
        if self.profile == "gaussian":
            # ∫exp(−2s²) from −1 to 1 = √(π/2)·erf(√2)
            return np.where(inside, np.exp(-2.0 * x * x) / (1.2533141373 * 0.9544997361), 0.0)
        return self._swept(x, np.asarray(start, dtype=np.float64), seconds)

    def _swept(self, s: Floats, start: Floats, seconds: float) -> Floats:
        # Mean dwell density over the spot: the bare 1/(π√(1−s²)) is infinite at the ends.
        h = self.spot
        high, low = np.clip(s + h, -1, 1), np.clip(s - h, -1, 1)
        dwell = np.arcsin(high) - np.arcsin(low)
        # Its integral over the fan, by ∫asin x = x asin x + √(1 − x²).
        x = max(h - 1.0, -1.0)
        whole = 2.0 * (np.pi / 2 * (1 + h) - x * np.arcsin(x) - np.sqrt(1 - x * x))
        dwell = dwell / whole
        turn = np.arcsin(np.clip(s, -1, 1)) / (2 * np.pi)
        first, last = start * self.frequency, (start + seconds) * self.frequency
        passes = sum(np.floor(last - at) - np.floor(first - at) for at in (turn, 0.5 - turn))
        return np.asarray(dwell * passes / (2.0 * seconds * self.frequency))


@dataclass(frozen=True)
class Lens:
    """The camera's lens, as far as light is concerned (its geometry is in the rig's camera)."""

    focal: float
    """mm."""
    f_number: float
    """Focal length over aperture."""
    focus: float
    """mm: distance of the plane in focus on the optical axis."""
    transmission: float = 0.9
    """Share of the light let through at the laser's wavelength, filters included."""

    def __post_init__(self) -> None:
        for name in ("focal", "f_number", "transmission"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"Lens.{name}: {getattr(self, name)}, expected above 0")
        if not self.focus > 2 * self.focal:
            raise ValueError(f"Lens.focus: {self.focus} mm, expected beyond 2 × {self.focal} mm")

    @property
    def magnification(self) -> float:
        """Image size over object size in the plane of focus."""
        return self.focal / (self.focus - self.focal)
