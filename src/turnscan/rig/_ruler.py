"""A rig as a ruler and a protractor know it: a TOML file of lengths in mm and angles in degrees."""

from __future__ import annotations

import math
import tomllib

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from turnscan.arrays import Floats
from turnscan.errors import FormatError
from turnscan.rig._camera import Camera
from turnscan.rig._design import looking
from turnscan.rig._pose import Pose, rotation_about, rotation_z
from turnscan.rig._rig import Rig
from turnscan.rig._sheet import LaserSheet

_CENTRE = 0.03
"""Of the picture's width: standard uncertainty of the principal point of an unknown lens."""
_LENS = {"camera.k1": 0.2, "camera.k2": 0.2}
"""Standard uncertainty of the distortion of an unknown lens."""


_LENGTH, _ANGLE, _FOCAL = 5.0, 2.0, 5.0
"""mm, degrees, per cent: standard uncertainty of what a hand measures, where nothing is said."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class _CameraPart(_Strict):
    width: int = Field(ge=1, le=100_000)
    height: int = Field(ge=1, le=100_000)
    distance_mm: float = Field(gt=0)
    height_mm: float
    tilt_deg: float = Field(0.0, gt=-90, lt=90)
    pan_deg: float = Field(0.0, gt=-90, lt=90)
    roll_deg: float = Field(0.0, ge=-180, le=180)
    focal_px: float | None = Field(None, gt=0)
    focal_mm: float | None = Field(None, gt=0)
    pixel_um: float | None = Field(None, gt=0)
    field_of_view_deg: float | None = Field(None, gt=0, lt=175)


class _LaserPart(_Strict):
    name: str = Field(min_length=1, max_length=200)
    angle_deg: float = Field(ge=-180, le=180)
    beside_mm: float = 0.0
    lean_deg: float = Field(0.0, gt=-90, lt=90)
    distance_mm: float | None = Field(None, gt=0)
    height_mm: float | None = None


class _Uncertainty(_Strict):
    length_mm: float = Field(_LENGTH, gt=0)
    angle_deg: float = Field(_ANGLE, gt=0)
    focal_percent: float = Field(_FOCAL, gt=0)


class _RulerFile(_Strict):
    camera: _CameraPart
    laser: tuple[_LaserPart, ...] = ()
    uncertainty: _Uncertainty | None = None


def rig_from_ruler(text: str, source: str = "ruler") -> Rig:
    """A rig from lengths and angles that were measured by hand, with its wide covariance.

    ``text`` is TOML with the tables ``camera``, ``laser`` (several) and ``uncertainty``
    (docs/how-to/calibrate.md). The camera stands ``distance_mm`` from the axis and ``height_mm``
    above the platter; it looks at the axis, down by ``tilt_deg``, past it to its right by
    ``pan_deg``, rolled clockwise by ``roll_deg``. A laser stands ``angle_deg`` about the axis from
    the camera, positive to the right of it as the camera sees it; its sheet passes ``beside_mm``
    to the right of the axis, as the laser sees the camera's side, and leans by ``lean_deg``. The
    table's x axis points to the camera. ``source`` names the text in errors.

    Raises FormatError naming the key and the value.
    """
    try:
        held = tomllib.loads(text)
    except tomllib.TOMLDecodeError as e:
        raise FormatError(f"{source}: not TOML ({e})", hint=_HINT) from None
    if isinstance(held.get("laser"), list):
        held["laser"] = tuple(held["laser"])
    try:
        file = _RulerFile.model_validate(held)
        focal = _focal(file.camera)
        rig = _rig(file, focal)
    except ValidationError as e:
        first = e.errors()[0]
        key = ".".join(str(p) for p in first["loc"]) or "top level"
        shown = repr(first.get("input"))[:60]
        raise FormatError(f"{source}: {key}: {first['msg']} (found {shown})", hint=_HINT) from None
    except ValueError as e:
        raise FormatError(f"{source}: {e}", hint=_HINT) from None
    return Rig(
        rig.camera, rig.sheets, rig.T_camera_table, covariance=_covariance(rig, file.uncertainty)
    )


_HINT = "see docs/how-to/calibrate.md for a file that can be filled in"


def _focal(c: _CameraPart) -> float:
    """Principal distance in pixels, from the one way in which it was given."""
    by_mm = c.focal_mm is not None and c.pixel_um is not None
    ways = [c.focal_px is not None, by_mm, c.field_of_view_deg is not None]
    if sum(ways) != 1 or (not by_mm and (c.focal_mm is not None or c.pixel_um is not None)):
        raise ValueError(
            "camera: give either focal_px, or focal_mm with pixel_um, or field_of_view_deg (across "
            "the width)"
        )
    if c.focal_px is not None:
        return c.focal_px
    if c.focal_mm is not None and c.pixel_um is not None:
        return 1e3 * c.focal_mm / c.pixel_um
    assert c.field_of_view_deg is not None
    return c.width / 2 / math.tan(math.radians(c.field_of_view_deg) / 2)


def _rig(file: _RulerFile, focal: float) -> Rig:
    c = file.camera
    at = np.array([c.distance_mm, 0.0, c.height_mm])
    T = looking(at, math.radians(c.pan_deg), math.radians(c.tilt_deg))
    roll = rotation_z(-math.radians(c.roll_deg))
    T = Pose(roll @ T.rotation, roll @ T.translation)
    camera = Camera(c.width, c.height, focal, focal, (c.width - 1) / 2, (c.height - 1) / 2)
    return Rig(camera, tuple(_sheet(part, T) for part in file.laser), T)


def _sheet(part: _LaserPart, T: Pose) -> LaserSheet:
    angle = math.radians(part.angle_deg)
    along = np.array([math.cos(angle), math.sin(angle), 0.0])
    normal = np.array([-math.sin(angle), math.cos(angle), 0.0])
    foot = part.beside_mm * normal
    leaning = rotation_about(along, math.radians(part.lean_deg)) @ normal
    light = None
    if part.distance_mm is not None and part.height_mm is not None:
        light = T.apply(foot + part.distance_mm * along + [0.0, 0.0, part.height_mm])
    return LaserSheet(part.name, T.turn(leaning), T.apply(foot), source=light)


def _covariance(rig: Rig, said: _Uncertainty | None) -> Floats:
    """Every number by itself: a ruler is laid again for each."""
    u = said or _Uncertainty(length_mm=_LENGTH, angle_deg=_ANGLE, focal_percent=_FOCAL)
    focal, centre = 0.01 * u.focal_percent * rig.camera.fx, _CENTRE * rig.camera.width
    angle = math.radians(u.angle_deg)
    known = {"fx": focal, "fy": focal, "cx": centre, "cy": centre}
    sigma = {f"camera.{name}": s for name, s in known.items()} | _LENS
    for sheet in rig.sheets:
        sigma |= {f"{sheet.name}.turn_along": angle, f"{sheet.name}.turn_across": angle}
        sigma[f"{sheet.name}.offset"] = u.length_mm
    for axis in "xyz":
        sigma |= {f"table.turn_{axis}": angle, f"table.shift_{axis}": u.length_mm}
    variance: Floats = np.array([sigma.get(name, 0.0) for name in rig.parameter_names]) ** 2
    return np.diag(variance)
