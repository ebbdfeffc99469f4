"""The image sensor: what it does to light, as numbers; `_exposure` takes the picture.

Light → pixel response → dark current → shot noise → bloom → full well → read noise → converter
→ demosaic → gamma → JPEG. Everything random is a hash of the seed and the pixel's place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Floats

Bayer = Literal["", "RGGB", "BGGR", "GRBG", "GBRG"]
Bloom = Literal["none", "column", "blob"]

_PATTERNS = ("", "RGGB", "BGGR", "GRBG", "GBRG")
_BLOOMS = ("none", "column", "blob")
_FILTERS_NM = ((605.0, 50.0), (535.0, 45.0), (460.0, 40.0))
"""Centre and rms width of typical red, green and blue filters."""
_FILTER_LEAK = 0.03

_RANGES = {
    "pitch_x": (1e-4, 1.0),
    "pitch_y": (1e-4, 1.0),
    "full_well": (1.0, 1e9),
    "gain": (1e-6, 1e9),
    "read_noise": (0.0, 1e6),
    "bits": (8, 16),
    "adc_bits": (0, 16),
    "black": (0.0, 65535.0),
    "dark_current": (0.0, 1e9),
    "efficiency": (1e-6, 1.0),
    "prnu": (0.0, 0.5),
    "gamma": (0.2, 5.0),
    "jpeg_quality": (0, 100),
    "anti_bloom": (0.0, 1.0),
    "jitter": (0.0, 10.0),
    "line_time": (0.0, 1.0),
}


@dataclass(frozen=True)
class Sensor:
    """What an image sensor and its electronics do to light.

    Raises ValueError, naming the field and the value, where a value is out of range.
    """

    pitch_x: float
    """Width of a pixel, mm."""
    pitch_y: float
    """Height of a pixel, mm."""
    full_well: float
    """Electrons a pixel holds."""
    gain: float
    """Electrons per converter step (grey level of the linear picture)."""
    read_noise: float
    """rms electrons added by the readout."""
    bits: int = 8
    """Bits of the picture given out, 8 to 16."""
    adc_bits: int = 0
    """Bits of the converter where they differ from ``bits``; 0 means the same."""
    black: float = 0.0
    """Black level, converter steps."""
    dark_current: float = 0.0
    """Electrons per pixel and second."""
    efficiency: float = 0.6
    """Electrons per photon at the best wavelength (quantum efficiency)."""
    prnu: float = 0.0
    """rms of the fixed relative differences in response between pixels."""
    gamma: float = 1.0
    """The picture is linear ** (1/gamma)."""
    bayer: Bayer = ""
    """Colour filter pattern from the top-left pixel, or "" for a grey camera."""
    jpeg_quality: int = 0
    """Quality of the JPEG coder the picture went through, 1 to 100; 0: none."""
    bloom: Bloom = "none"
    """Where charge beyond the full well goes: nowhere, along the column, or all around."""
    anti_bloom: float = 0.0
    """Share of the excess charge that a drain carries off before it blooms."""
    jitter: float = 0.0
    """rms error of the start of each video line, pixels."""
    line_time: float = 0.0
    """Seconds between the exposure of one row and the next (rolling shutter); 0: global."""
    serial: int = 0
    """Which specimen: the seed of everything fixed in the silicon."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"Sensor.{name}: {value}, expected {low:g} to {high:g}")
        for name, words in (("bayer", _PATTERNS), ("bloom", _BLOOMS)):
            if getattr(self, name) not in words:
                raise ValueError(f"Sensor.{name}: {getattr(self, name)!r}, expected one of {words}")
        if self.adc_bits and self.adc_bits < self.bits:
            raise ValueError(f"Sensor.adc_bits: {self.adc_bits}, fewer than bits: {self.bits}")
        if self.jpeg_quality and self.bits != 8:
            raise ValueError(f"Sensor.jpeg_quality: JPEG has 8 bits, the sensor {self.bits}")
        if self.black >= self.converter_levels - 1:
            raise ValueError(f"Sensor.black: {self.black}, beyond {self.converter_levels - 1}")

    @property
    def converter_levels(self) -> int:
        """Number of steps of the analogue-digital converter."""
        return 1 << (self.adc_bits or self.bits)

    @property
    def levels(self) -> int:
        """Number of grey levels of the picture."""
        return 1 << self.bits

    @property
    def saturation(self) -> float:
        """Electrons at which a pixel gives its highest grey level."""
        return min(self.full_well, (self.converter_levels - 1 - self.black) * self.gain)

    def amplified(self, factor: float) -> Sensor:
        """The same sensor with its amplifier set ``factor`` times higher."""
        return replace(self, gain=self.gain / factor)

    def response(self, wavelength: float) -> Floats:
        """Electrons per photon at this wavelength, mm: shape (1,), or (3,) behind a Bayer filter.

        The silicon is a broad bell around 530 nm; the filters are typical ones.
        """
        nm = wavelength * 1e6
        silicon = self.efficiency * np.exp(-0.5 * ((nm - 530.0) / 190.0) ** 2)
        if not self.bayer:
            return np.array([silicon])
        passed = [np.exp(-0.5 * ((nm - c) / w) ** 2) for c, w in _FILTERS_NM]
        return np.asarray(silicon * np.maximum(passed, _FILTER_LEAK), dtype=np.float64)


def ccd_1990s(serial: int = 0) -> Sensor:
    """A television CCD of the paper's time, 11 x 9 µm, digitised to 8 bits from analogue video."""
    return Sensor(
        pitch_x=0.011,
        pitch_y=0.009,
        full_well=100_000.0,
        gain=100_000.0 / 255,
        read_noise=100.0,
        dark_current=2000.0,
        efficiency=0.4,
        prnu=0.01,
        bloom="column",
        anti_bloom=0.9,
        jitter=0.03,
        serial=serial,
    )


def webcam(serial: int = 0) -> Sensor:
    """A USB webcam: 3 µm Bayer pixels, rolling shutter, gamma, JPEG."""
    return Sensor(
        pitch_x=0.003,
        pitch_y=0.003,
        full_well=8000.0,
        gain=8000.0 / 1023,
        read_noise=4.0,
        adc_bits=10,
        dark_current=20.0,
        efficiency=0.55,
        prnu=0.01,
        gamma=2.2,
        bayer="RGGB",
        jpeg_quality=90,
        line_time=3.0e-5,
        serial=serial,
    )


def cmos_imx264(serial: int = 0) -> Sensor:
    """A machine-vision sensor like the IMX264: 3.45 µm, 10.5 ke⁻, 12 bits, global shutter."""
    return Sensor(
        pitch_x=0.00345,
        pitch_y=0.00345,
        full_well=10_500.0,
        gain=2.5,
        read_noise=2.3,
        bits=12,
        black=30.0,
        dark_current=3.0,
        efficiency=0.65,
        prnu=0.005,
        serial=serial,
    )
