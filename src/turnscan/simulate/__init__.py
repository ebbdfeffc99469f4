"""The physical simulator: scene, optics, sensor, motion."""

from turnscan.simulate._sensor import Sensor, ccd_1990s, cmos_imx264, expose, webcam
from turnscan.simulate._speckle import (
    cell_keys,
    cell_size,
    contrast,
    gamma_speckle,
    grain,
    oversampling,
    path_phase,
    pattern_weights,
    pixel_contrast,
    speckled,
)

__all__ = [
    "Sensor",
    "ccd_1990s",
    "cell_keys",
    "cell_size",
    "cmos_imx264",
    "contrast",
    "expose",
    "gamma_speckle",
    "grain",
    "oversampling",
    "path_phase",
    "pattern_weights",
    "pixel_contrast",
    "speckled",
    "webcam",
]
