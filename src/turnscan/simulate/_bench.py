"""The bench: everything that a simulated picture depends on, except the moment it is taken."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from turnscan.rig import Rig
from turnscan.simulate import _speckle as speckle
from turnscan.simulate._beam import Beam, Lens
from turnscan.simulate._motion import Motion
from turnscan.simulate._scene import Scene
from turnscan.simulate._sensor import Sensor

Waves = Literal["speckle", "diffraction", "rays"]

PLANCK_C = 6.62607015e-34 * 2.99792458e11
"""J mm: energy of a photon times its wavelength."""


@dataclass(frozen=True)
class Bench:
    """A simulated rig: its true geometry, its light, its camera, and what stands on it."""

    rig: Rig
    """The truth; a calibration may find something else."""
    beams: tuple[Beam, ...]
    """One per laser sheet of the rig, of the same name."""
    lens: Lens
    sensor: Sensor
    scene: Scene
    motion: Motion = field(default_factory=Motion)
    waves: Waves = "speckle"
    """speckle: wave-true; diffraction: the lens's blur without speckle; rays: neither."""
    bounces: bool = False
    """Also the light that comes by a second surface: inter-reflection and mirror ghosts."""
    modes: float = 1.0
    """Mutually incoherent wavelengths of the laser: they average the speckle."""
    noise: bool = True
    """False: the sensor counts without noise, dark current or fixed pattern, and only rounds."""
    seed: int = 0

    def __post_init__(self) -> None:
        for b in self.beams:
            sheet = self.rig.sheet(b.name)
            if abs(float(sheet.normal @ b.aim)) > 1e-6:
                raise ValueError(f"Bench.beams: {b.name} does not aim along its sheet")

    @property
    def grain(self) -> tuple[float, float]:
        """Speckle grain λN' in pixel heights and widths, of the first laser."""
        pitch = (self.sensor.pitch_y, self.sensor.pitch_x)
        w = self.beams[0].wavelength
        return speckle.grain(w, self.lens.f_number, self.lens.magnification, pitch)

    def electrons_per_radiance(self, wavelength: float, seconds: float) -> float:
        """Photons that a pixel on the axis collects per radiance, W/(mm² sr)."""
        n, m = self.lens.f_number, self.lens.magnification
        area = self.sensor.pitch_x * self.sensor.pitch_y
        power = math.pi / (4.0 * n * n * (1.0 + m) ** 2) * area * self.lens.transmission
        return power * seconds * wavelength / PLANCK_C
