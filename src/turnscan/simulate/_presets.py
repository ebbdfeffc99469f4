"""Ready benches: the rigs of `turnscan.rig.design_preset` with light, glass and silicon."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.rig import (
    PRESET_NAMES,
    Camera,
    Design,
    LaserSheet,
    Pose,
    Rig,
    design_preset,
    rotation_from_vector,
)
from turnscan.simulate import _parts as parts
from turnscan.simulate._beam import Beam, Lens, Profile
from turnscan.simulate._bench import Bench, Waves
from turnscan.simulate._boards import BOARDS, board
from turnscan.simulate._motion import Motion
from turnscan.simulate._scene import PATTERNS, Body, Material, PatternKind, Scene
from turnscan.simulate._sensor import Sensor, ccd_1990s, cmos_imx264, webcam

_PAPER_WHITE = 0.6
_PAINT = 0.4
"""Albedo of a painted pattern's dark half over its light one: the laser still shows on it."""
_PEAK = 0.45
"""Share of the grey scale that the middle of the stripe reaches on plain matt grey."""
_THINNEST = 0.7
"""px rms of the stripe."""


@dataclass(frozen=True)
class SimulationSpec:
    """A bench in words; `bench` builds it. Angles in radians, lengths in mm.

    Raises InputError, naming the value, where it cannot be.
    """

    scene: str = "cup"
    """Name of a part or a board, or a mesh file (STL, PLY, OBJ, 3MF, GLB)."""
    rig: str = "paper"
    """Name of a design preset."""
    theta: float | None = None
    """Angle of triangulation; None for the preset's."""
    lasers: int | None = None
    """1 or 2; None for what the scene needs."""
    seed: int = 0
    steps: int | None = None
    """Table positions in one turn; None for the preset's."""
    waves: Waves = "speckle"
    perfect: bool = False
    """No speckle, diffraction, defocus or noise, a thin sheet and 16 bits."""
    room: float = 0.02
    """Room light: share of the grey scale that white paper reaches in one exposure."""
    shift: tuple[float, float] = (0.0, 0.0)
    """Where the part's axis stands on the table, x and y."""
    lean: tuple[float, float] = (0.0, 0.0)
    """The part tilted about x and y."""
    tip: float = 0.0
    """The part tipped over about x before that, its middle put over the axis: another pose."""
    motion: Motion = field(default_factory=Motion)
    galvo: float | None = None
    """Frequency of the mirror, Hz; None for the preset's."""
    lying: bool = False
    """The camera lies on its side: the stripe runs along the rows of its picture."""
    hand: str | None = None
    """A board that a hand holds before the camera of the rig that is set up for the scene, with the
    room's light on; None for the scene itself."""
    pattern: PatternKind = "none"
    """Painted on the part."""

    def __post_init__(self) -> None:
        if self.rig not in PRESET_NAMES:
            raise InputError(f"no rig {self.rig!r}", hint=f"take one of {', '.join(PRESET_NAMES)}")
        if self.theta is not None and not 0.0 < self.theta < math.pi / 2:
            raise InputError(
                f"theta {math.degrees(self.theta):g}°: laser and camera would look the same way, "
                "and the stripe would say nothing about depth",
                hint="take 10° to 60°",
            )
        if self.hand is not None and self.hand not in BOARDS:
            raise InputError(f"no board {self.hand!r}", hint=f"take one of {', '.join(BOARDS)}")
        if self.pattern not in PATTERNS:
            raise InputError(
                f"no pattern {self.pattern!r}", hint=f"take one of {', '.join(PATTERNS)}"
            )
        if self.lasers not in (None, 1, 2):
            raise InputError(f"{self.lasers} lasers", hint="take 1 or 2")
        if self.steps is not None and not 1 <= self.steps <= 1_000_000:
            raise InputError(f"{self.steps} steps", hint="take 1 to 1000000")
        if not 0.0 <= self.room <= 1.0:
            raise InputError(f"room light {self.room:g}", hint="take 0 to 1")
        if self.galvo is not None and not 1.0 <= self.galvo <= 1e5:
            raise InputError(f"galvanometer {self.galvo:g} Hz", hint="the paper has 105 to 900")


@dataclass(frozen=True)
class _Kit:
    """What a preset's design does not say."""

    sensor: Sensor
    seconds: float
    profile: Profile = "powell"
    transmission: float = 0.85
    look_down: float = 0.0
    lasers: int = 1
    motion: Motion = field(default_factory=Motion)


_KITS: Mapping[str, _Kit] = {
    "paper": _Kit(ccd_1990s(), 0.04, "galvo", transmission=0.05),
    "modern": _Kit(cmos_imx264(), 0.008),
    "ciclop": _Kit(webcam(), 1 / 30, "gaussian", look_down=math.radians(12.0), lasers=2),
}

_MATT = Material((0.6, 0.6, 0.6))
_MATERIALS: Mapping[str, Material] = {
    # The paper's objects: thin diffusing china, red velvet on polystyrene, polished stone.
    "cup": Material((0.75, 0.73, 0.68), specular=0.04, roughness=0.35, halo=0.25, halo_length=1.2),
    "mug": Material((0.75, 0.73, 0.68), specular=0.04, roughness=0.35, halo=0.25, halo_length=1.2),
    "head": Material((0.55, 0.06, 0.06)),
    "bust": Material((0.6, 0.58, 0.52), specular=0.05, roughness=0.2, halo=0.4, halo_length=2.0),
}
_TWO_LINES = ("head", "bust")
_PLATTER = Material((0.04, 0.04, 0.04))
_LIGHT_ON = 0.3
"""Room light, as `SimulationSpec.room`, where a board is to be seen."""


def design_of(spec: SimulationSpec) -> Design:
    """The design that a specification asks for."""
    d = design_preset(spec.rig)
    return d if spec.theta is None else replace(d, theta=spec.theta)


def steps_of(spec: SimulationSpec) -> int:
    """Number of table positions per turn."""
    return spec.steps or round(2 * math.pi / design_preset(spec.rig).step)


def seconds_of(spec: SimulationSpec) -> float:
    """Exposure time that suits the preset, s."""
    return _KITS[spec.rig].seconds


def body_of(spec: SimulationSpec) -> Body:
    """What stands on the table. Raises InputError for a name that is nothing."""
    if spec.scene in BOARDS:
        return board(spec.scene)
    part = _part(spec.scene)
    turned = rotation_from_vector((*spec.lean, 0.0)) @ rotation_from_vector((spec.tip, 0.0, 0.0))
    corners = part.mesh.vertices @ turned.T
    # Tilted about its own foot, or tipped over its middle, and set down again on the platter.
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = (low + high)[:2] / 2 if spec.tip else np.zeros(2)
    at = Pose(turned, np.array([*(spec.shift - middle), -low[2]]))
    paint = _MATERIALS.get(part.name, _MATT)
    if spec.pattern != "none":
        paint = replace(paint, pattern=spec.pattern, pattern_ratio=_PAINT)
    return Body(part, paint, at)


def bench(spec: SimulationSpec) -> Bench:
    """Build the bench.

    Raises InputError for an unknown scene, a part larger than the field of view, or a laser that
    never lights the axis.
    """
    kit, design = _KITS[spec.rig], design_of(spec)
    body = body_of(spec)
    top = float(body.T_table_part.apply(body.part.mesh.vertices)[:, 2].max())
    both = (spec.lasers or max(kit.lasers, 2 if body.part.name in _TWO_LINES else 1)) == 2
    sensor = replace(
        kit.sensor,
        pitch_x=design.pixel_width,
        pitch_y=design.pixel_height,
        serial=spec.seed,
    )
    if spec.perfect:
        sensor = replace(sensor, bits=16, adc_bits=0, gamma=1.0, jpeg_quality=0, bayer="")
    up = top / 2 + design.distance * math.tan(kit.look_down)
    rig = design.rig(height=up, look_down=kit.look_down, both=both)
    if spec.lying:
        rig = _on_its_side(rig)
        sensor = replace(sensor, pitch_x=sensor.pitch_y, pitch_y=sensor.pitch_x)
    focal = design.focal * design.distance / (design.distance + design.focal)
    stop = 1e4 if spec.perfect else design.f_number
    lens = Lens(focal, stop, design.distance, kit.transmission)
    made = Bench(
        rig=rig,
        beams=(),
        lens=lens,
        sensor=sensor,
        scene=Scene((body, Body(_platter(design), _PLATTER))),
        motion=spec.motion,
        waves="rays" if spec.perfect else spec.waves,
        noise=not spec.perfect,
        bounces=not spec.perfect,
        seed=spec.seed,
    )
    made = _lit(made, design, kit, spec)
    check_view(made)
    return made


def _on_its_side(rig: Rig) -> Rig:
    """The same with its camera, which has no distortion, a quarter turn about its optical axis."""
    c = rig.camera
    camera = Camera(c.height, c.width, c.fy, c.fx, c.cy, c.width - 1 - c.cx)
    roll = Pose(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    sheets = [
        replace(s, normal=roll.turn(s.normal), centre=roll.apply(s.centre)) for s in rig.sheets
    ]
    return Rig(camera, tuple(sheets), roll @ rig.T_camera_table)


def check_view(made: Bench) -> None:
    """Raise InputError where the rig cannot see the first body, or no laser meets the axis."""
    body = made.scene.bodies[0]
    v = body.T_table_part.apply(body.part.mesh.vertices)
    R, low, high = float(np.hypot(v[:, 0], v[:, 1]).max()), v[:, 2].min(), v[:, 2].max()
    turn = np.linspace(-np.pi / 2, np.pi / 2, 37)
    ring = np.column_stack([R * np.cos(turn), R * np.sin(turn)])
    corners = np.concatenate([np.column_stack([ring, np.full(37, z)]) for z in (low, high)])
    camera = made.rig.camera
    uv = camera.project(made.rig.T_camera_table.apply(corners))
    edge = (camera.width - 0.5, camera.height - 0.5)
    if not ((uv > -0.5).all() and (uv < edge).all()):
        raise InputError(
            f"{body.part.name} is larger than the field of view: turning, it fills a cylinder of "
            f"radius {R:.0f} mm and height {high - low:.0f} mm",
            hint="scale it down, centre it, or take a rig that sees more (`turnscan design`)",
        )
    for beam in made.beams:
        _check_axis(made.rig, beam)


def _check_axis(rig: Rig, beam: Beam) -> None:
    axis = rig.T_camera_table.apply(np.column_stack([np.zeros((101, 2)), np.linspace(0, 200, 101)]))
    way = axis - beam.apex
    along = way @ beam.aim
    across = way @ np.cross(rig.sheet(beam.name).normal, beam.aim)
    near = np.abs(rig.sheet(beam.name).distance(axis)) < 10.0 * beam.radius(along)
    if not (near & (along > 0) & (np.abs(across) < along * math.tan(beam.half_angle))).any():
        raise InputError(
            f"laser {beam.name!r} never hits the rotation axis",
            hint="aim the laser at the axis: without that, most of the part is never lit",
        )


def _lit(made: Bench, design: Design, kit: _Kit, spec: SimulationSpec) -> Bench:
    """Lasers bright enough for the exposure, and room light."""
    beams = tuple(_beam(made, s, design, kit, spec) for s in made.rig.sheets)
    known = {b.name: (b.apex, b.waist / 2) for b in beams}
    sheets = tuple(
        replace(s, source=known[s.name][0], thickness=known[s.name][1]) for s in made.rig.sheets
    )
    made = replace(made, rig=replace(made.rig, sheets=sheets), beams=beams)
    white = made.electrons_per_radiance(550e-6, kit.seconds) * made.sensor.efficiency / math.pi
    room = spec.room if spec.hand is None else max(spec.room, _LIGHT_ON)
    sky = room * made.sensor.saturation / white
    scene = replace(made.scene, sky=0.6 * sky, lamp=0.6 * sky, background=0.05)
    return replace(made, scene=scene)


def _beam(made: Bench, sheet: LaserSheet, design: Design, kit: _Kit, spec: SimulationSpec) -> Beam:
    T = made.rig.T_camera_table
    centre = T.inverse().apply(sheet.centre)
    normal = T.inverse().turn(sheet.normal)
    along = np.cross(normal, (0.0, 0.0, 1.0))
    along = along if along[0] > 0 else -along
    distance = 1.1 * design.distance
    apex = T.apply(centre + distance * along / np.linalg.norm(along))
    aim = sheet.centre - apex
    aim = aim - (aim @ sheet.normal) * sheet.normal
    # Perfect: as thin as still makes the centre of gravity free of the pixels' grid. A thicker
    # sheet would measure a round part too small, by 3/2 of its variance over the radius.
    sigma = _THINNEST if spec.perfect else design.stripe_sigma
    sigma *= design.pixel_width / made.lens.magnification
    waist = 2.0 * sigma * math.cos(design.theta)
    half = math.atan(0.62 * float(design.visible_height(0.0)) / distance)
    beam = Beam(
        sheet.name, apex, aim, half, 1e-3, design.wavelength, waist, distance,
        profile="powell" if spec.perfect else kit.profile, frequency=spec.galvo or 300.0,
    )  # fmt: skip
    return replace(beam, power=_power(made, beam, kit.seconds))


def _power(made: Bench, beam: Beam, seconds: float) -> float:
    """W that brings the middle of the stripe on plain grey to the wanted share of the scale."""
    at_one_watt = 0.5 / (beam.waist_distance * math.tan(beam.half_angle))
    at_one_watt *= math.sqrt(2.0 / math.pi) / beam.waist * _PAPER_WHITE / math.pi
    electrons = at_one_watt * made.electrons_per_radiance(beam.wavelength, seconds)
    electrons *= float(made.sensor.response(beam.wavelength).max())
    return _PEAK * made.sensor.saturation / electrons


def _platter(design: Design) -> parts.Part:
    R = min(0.5 * design.r_max, 75.0)
    disc = parts.cylinder(R, 6.0)
    v: Floats = disc.mesh.vertices - (0.0, 0.0, 6.0 + 1e-3)
    return parts.Part("platter", replace(disc.mesh, vertices=v))


def _part(name: str) -> parts.Part:
    path = Path(name)
    if path.suffix.lower() not in (".stl", ".ply", ".obj", ".3mf", ".glb"):
        if name not in parts.PARTS:
            known = ", ".join([*parts.PARTS, *BOARDS])
            raise InputError(f"no scene {name!r}", hint=f"take one of {known}, or a mesh file")
        return parts.part(name)
    if not path.is_file():
        raise InputError(f"{name}: no such file", hint="check the name")
    from turnscan.formats import read_mesh

    made = parts.from_mesh(path.stem, read_mesh(path.read_bytes(), path.suffix))
    low, high = made.mesh.bounds
    middle = np.array([*((low + high) / 2)[:2], low[2]])
    return replace(made, mesh=replace(made.mesh, vertices=made.mesh.vertices - middle))
