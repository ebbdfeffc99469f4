"""The rig as a JSON file, strictly parsed: unknown keys, NaN and duplicates are errors."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from turnscan.errors import FormatError
from turnscan.json_text import strict_json
from turnscan.rig._camera import Camera
from turnscan.rig._motion import TableMotion
from turnscan.rig._pose import Pose
from turnscan.rig._rig import Marker, Rig
from turnscan.rig._sheet import LaserSheet
from turnscan.rig._wobble import Wobble

RIG_FORMAT = "turnscan-rig"
RIG_VERSION = 1

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Vec5 = tuple[float, float, float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class _CameraFile(_Strict):
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Vec5 = (0.0, 0.0, 0.0, 0.0, 0.0)
    tilt: Vec2 = (0.0, 0.0)


class _SheetFile(_Strict):
    name: str = Field(min_length=1, max_length=200)
    normal: Vec3
    centre: Vec3
    bow: Vec3 = (0.0, 0.0, 0.0)
    source: Vec3 | None = None
    thickness: float | None = None


class _PoseFile(_Strict):
    rotation: tuple[Vec3, Vec3, Vec3]
    translation: Vec3


class _MarkerFile(_Strict):
    dictionary: str
    number: int
    corners: tuple[Vec3, Vec3, Vec3, Vec3]


class _MotionFile(_Strict):
    harmonics: tuple[Vec2, ...] = ()
    start: float = 0.0
    backlash: float = 0.0
    covariance: tuple[tuple[float, ...], ...] | None = None


class _WobbleFile(_Strict):
    tilt: Vec2
    shift: Vec2
    rise: Vec2


class _RigFile(_Strict):
    format: Literal["turnscan-rig"]
    version: Literal[1]
    unit: Literal["mm"]
    camera: _CameraFile
    sheets: tuple[_SheetFile, ...]
    T_camera_table: _PoseFile | None
    """None before the axis is calibrated."""
    markers: tuple[_MarkerFile, ...] = ()
    covariance: tuple[tuple[float, ...], ...] | None = None
    motion: _MotionFile | None = None
    wobble: _WobbleFile | None = None
    evidence: tuple[str, ...] = ()


def rig_to_json(rig: Rig) -> str:
    """Write a rig as JSON text; `rig_from_json` gives the same rig back, to the bit."""
    body: dict[str, Any] = {
        "format": RIG_FORMAT,
        "version": RIG_VERSION,
        "unit": "mm",
        "camera": {
            **{k: getattr(rig.camera, k) for k in ("width", "height", "fx", "fy", "cx", "cy")},
            "distortion": rig.camera.distortion.tolist(),
            "tilt": rig.camera.tilt.tolist(),
        },
        "sheets": [
            {
                "name": s.name,
                "normal": s.normal.tolist(),
                "centre": s.centre.tolist(),
                "bow": s.bow.tolist(),
                # Left out where not known: rigs of before keep their text and their hash.
                **({} if s.source is None else {"source": s.source.tolist()}),
                **({} if s.thickness is None else {"thickness": s.thickness}),
            }
            for s in rig.sheets
        ],
        "T_camera_table": {
            "rotation": rig.T_camera_table.rotation.tolist(),
            "translation": rig.T_camera_table.translation.tolist(),
        }
        if rig.table_known
        else None,
        "markers": [
            {"dictionary": m.dictionary, "number": m.number, "corners": m.corners.tolist()}
            for m in rig.markers
        ],
        "covariance": None if rig.covariance is None else rig.covariance.tolist(),
        **({} if rig.motion is None else {"motion": _motion_text(rig.motion)}),
        **({} if rig.wobble is None else {"wobble": _wobble_text(rig.wobble)}),
        **({"evidence": list(rig.evidence)} if rig.evidence else {}),
    }
    return json.dumps(body, indent=1, allow_nan=False)


def rig_from_json(text: str, source: str = "rig") -> Rig:
    """Parse a rig from JSON text.

    ``source`` names the place in errors. Raises FormatError naming the key and the value, or
    LimitExceeded for a text over 16 MiB.
    """
    # Once for what pydantic lets pass (keys that stand twice, NaN), once for the types.
    try:
        strict_json(text, source)
    except FormatError as e:
        raise FormatError(e.message, hint=_HINT) from None
    try:
        return _build(_RigFile.model_validate_json(text))
    except ValidationError as e:
        first = e.errors()[0]
        key = ".".join(str(p) for p in first["loc"]) or "top level"
        value = repr(first.get("input"))
        shown = value if len(value) <= 60 else value[:57] + "…"
        raise FormatError(f"{source}: {key}: {first['msg']} (found {shown})", hint=_HINT) from None
    except (ValueError, RecursionError) as e:
        raise FormatError(f"{source}: {e}", hint=_HINT) from None


_HINT = "write the rig again with `turnscan calibrate`, or correct that key by hand"


def rig_hash(rig: Rig) -> str:
    """SHA-256 (hex) of the rig's JSON text: the rig's identity in exports and scan files."""
    return hashlib.sha256(rig_to_json(rig).encode()).hexdigest()


def _build(f: _RigFile) -> Rig:
    return Rig(
        camera=Camera(**f.camera.model_dump()),
        sheets=tuple(_sheet(s) for s in f.sheets),
        T_camera_table=Pose(**f.T_camera_table.model_dump()) if f.T_camera_table else Pose(),
        table_known=f.T_camera_table is not None,
        markers=tuple(Marker(**m.model_dump()) for m in f.markers),
        covariance=None if f.covariance is None else _square(f.covariance),
        motion=None if f.motion is None else _motion(f.motion),
        wobble=None if f.wobble is None else Wobble(**f.wobble.model_dump()),
        evidence=f.evidence,
    )


def _sheet(f: _SheetFile) -> LaserSheet:
    sheet = LaserSheet(**f.model_dump())
    if sheet.thickness is not None and sheet.thickness > sheet.thickest:
        raise ValueError(
            f"sheets.thickness: laser {sheet.name!r} is {sheet.thickness:g} mm thick (rms); more "
            f"than {sheet.thickest:.2g} mm so far from the camera is no line"
        )
    return sheet


def _motion(f: _MotionFile) -> TableMotion:
    covariance = None if f.covariance is None else np.array(_square(f.covariance))
    harmonics = np.array(f.harmonics, dtype=np.float64).reshape(-1, 2)
    return TableMotion(harmonics, f.start, f.backlash, covariance)


def _motion_text(m: TableMotion) -> dict[str, Any]:
    return {
        "harmonics": m.harmonics.tolist(),
        "start": m.start,
        "backlash": m.backlash,
        "covariance": None if m.covariance is None else m.covariance.tolist(),
    }


def _wobble_text(w: Wobble) -> dict[str, Any]:
    return {name: getattr(w, name).tolist() for name in ("tilt", "shift", "rise")}


def _square(rows: tuple[tuple[float, ...], ...]) -> Any:
    if any(len(r) != len(rows) for r in rows):
        raise ValueError(f"covariance: {len(rows)} rows, but not every row has that length")
    return rows
