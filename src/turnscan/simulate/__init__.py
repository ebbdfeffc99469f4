"""The physical simulator: scene, optics, sensor, motion."""

from turnscan.simulate._address import Simulated, sim_camera, simulated, spec_of
from turnscan.simulate._beam import Beam, Lens
from turnscan.simulate._bench import Bench
from turnscan.simulate._devices import SimCamera, SimLasers, SimTurntable, World
from turnscan.simulate._exposure import expose
from turnscan.simulate._gige import GigeServer
from turnscan.simulate._parts import PARTS, Part, from_mesh, part
from turnscan.simulate._presets import SimulationSpec, bench, check_view, seconds_of, steps_of
from turnscan.simulate._render import Renderer
from turnscan.simulate._scene import Body, Material, Scene
from turnscan.simulate._sensor import Sensor, ccd_1990s, cmos_imx264, webcam
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
    "PARTS",
    "Beam",
    "Bench",
    "Body",
    "GigeServer",
    "Lens",
    "Material",
    "Part",
    "Renderer",
    "Scene",
    "Sensor",
    "SimCamera",
    "SimLasers",
    "SimTurntable",
    "Simulated",
    "SimulationSpec",
    "World",
    "bench",
    "ccd_1990s",
    "cell_keys",
    "cell_size",
    "check_view",
    "cmos_imx264",
    "contrast",
    "expose",
    "from_mesh",
    "gamma_speckle",
    "grain",
    "oversampling",
    "part",
    "path_phase",
    "pattern_weights",
    "pixel_contrast",
    "seconds_of",
    "sim_camera",
    "simulated",
    "spec_of",
    "speckled",
    "steps_of",
    "webcam",
]
