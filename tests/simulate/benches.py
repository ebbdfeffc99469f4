"""Small benches whose pictures are known from theory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.rig import Design, Rig, design_preset
from turnscan.simulate import Beam, Bench, Body, Lens, Material, Part, Renderer, Scene, Sensor, part

SECONDS = 0.01


def laser(rig: Rig, distance: float = 550.0, waist: float = 0.3, **more: object) -> Beam:
    """A beam along the rig's first sheet, at camera height, aimed at the axis."""
    sheet = rig.sheets[0]
    back = rig.T_camera_table.inverse()
    along = np.cross(back.turn(sheet.normal), (0.0, 0.0, 1.0))
    along *= np.sign(along[0])
    foot = back.apply(sheet.centre)
    apex = rig.T_camera_table.apply(foot + distance * along)
    made: dict[str, object] = {
        "half_angle": 0.3,
        "power": 1e-3,
        "wavelength": 632.8e-6,
        "waist": waist,
        "waist_distance": distance,
    }
    return Beam(sheet.name, apex, sheet.centre - apex, **{**made, **more})  # type: ignore[arg-type]


def sensor(design: Design) -> Sensor:
    """A sensor that only has a pixel size."""
    return Sensor(design.pixel_width, design.pixel_height, 1e9, 1e5, 0.0, bits=16)


def lens(design: Design, f_number: float = 1e4) -> Lens:
    """A lens of the design's principal distance, focused on the axis; by default a pinhole."""
    focal = design.focal * design.distance / (design.distance + design.focal)
    return Lens(focal, f_number, design.distance)


def bench(
    body: Part | Body,
    design: Design | None = None,
    *,
    height: float = 0.0,
    waist: float = 0.3,
    material: Material | None = None,
    **more: object,
) -> Bench:
    """One body under one laser, seen through a pinhole without noise; paper's rig by default."""
    d = design or design_preset("paper")
    rig = d.rig(height=height)
    own = body if isinstance(body, Body) else Body(body, material or Material())
    made = Bench(rig, (laser(rig, waist=waist),), lens(d), sensor(d), Scene((own,)), waves="rays")
    return replace(made, **more)  # type: ignore[arg-type]


def light(made: Bench, angle: float = 0.0) -> Floats:
    """Photons (H, W) of the bench's first laser."""
    T = made.rig.T_camera_table @ made.motion.pose(angle)
    return Renderer(made).laser_light(T, made.beams[0], SECONDS).astype(np.float64)


def centres(picture: Floats, least: float = 0.3) -> tuple[Floats, Floats]:
    """Rows and centres of gravity of the rows that have ``least`` of the median light."""
    rows = picture.sum(axis=1)
    good = np.flatnonzero(rows > least * np.median(rows[rows > 0]))
    u = np.arange(picture.shape[1])
    return good.astype(np.float64), picture[good] @ u / rows[good]


def wall(x: float, width: float = 200.0, height: float = 240.0) -> Part:
    """A broad upright plate whose face looks at the camera from x, centred on height 0."""
    flat = part("plate").mesh
    low, high = flat.bounds
    unit = (flat.vertices - low) / (high - low)
    v = (unit - (1.0, 0.5, 0.5)) * (20.0, width, height) + (x, 0.0, 0.0)
    return Part("wall", Mesh(v, flat.faces), lambda p: p[..., 0] - x)
