"""Rig: camera model, laser sheets, table pose, and how well all of it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen
from turnscan.picture import card
from turnscan.rig._camera import Camera
from turnscan.rig._drawing import Beam, views
from turnscan.rig._motion import TableMotion
from turnscan.rig._pose import Pose, rotation_from_vector, rotation_z
from turnscan.rig._sheet import LaserSheet
from turnscan.rig._wobble import Wobble

_CAMERA = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "tilt_x", "tilt_y")
_SHEET = ("turn_along", "turn_across", "offset", "bow_aa", "bow_ab", "bow_bb")
_RIM = 50.0
"""mm from the axis, at which what the axis moves is said."""
_TABLE = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")


@dataclass(frozen=True)
class Marker:
    """A fiducial marker fixed to the platter, by which a picture tells the table's angle."""

    dictionary: str
    """Name of the ArUco dictionary, like ``DICT_4X4_50``."""
    number: int
    """The marker's id in its dictionary."""
    corners: Floats
    """(4, 3) mm in the table frame at angle 0; clockwise from the marker's top left."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen(self.corners, (4, 3), "Marker.corners"))


@dataclass(frozen=True)
class Rig:
    """Everything needed to turn a stripe and a table angle into millimetres.

    The table frame has its origin on the rotation axis at platter height and z along the axis, up;
    table angles run counter-clockwise seen from above.
    """

    camera: Camera
    sheets: tuple[LaserSheet, ...]
    T_camera_table: Pose
    """Table frame at angle 0 → camera frame."""
    markers: tuple[Marker, ...] = ()
    """Markers on the platter; empty when there are none."""
    covariance: Floats | None = None
    """(p, p) covariance of the parameters named by `parameter_names`, or None when not known."""
    table_known: bool = True
    """False before the axis is calibrated: ``T_camera_table`` then says nothing."""
    motion: TableMotion | None = None
    """The table's own errors, where nothing measured its angle; None where none are known."""
    wobble: Wobble | None = None
    """How the axis itself moves while the table turns; None where nothing is known of it. Where
    there is one it has its part of `covariance`."""
    evidence: tuple[str, ...] = ()
    """Digests of the scans that refined it, none of which may count again."""

    def __post_init__(self) -> None:
        names = [s.name for s in self.sheets]
        if len(set(names)) != len(names):
            raise ValueError(f"Rig.sheets: two sheets have the same name: {names}")
        if self.covariance is not None:
            p = len(self.parameter_names)
            object.__setattr__(
                self, "covariance", frozen(self.covariance, (p, p), "Rig.covariance")
            )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the rig's free parameters, in the order of `covariance` and `perturbed`."""
        sheets = tuple(f"{s.name}.{p}" for s in self.sheets for p in _SHEET)
        wobble = () if self.wobble is None else Wobble.NAMES
        table = tuple(f"table.{p}" for p in _TABLE)
        return tuple(f"camera.{p}" for p in _CAMERA) + sheets + wobble + table

    @property
    def lacking(self) -> tuple[str, ...]:
        """What is still to be calibrated before this rig can scan, in words."""
        out = () if self.sheets else ("a laser sheet",)
        return out if self.table_known else (*out, "the rotation axis")

    def html(self, title: str = "Rig", more: Sequence[tuple[str, object]] = ()) -> str:
        """What a notebook shows: two views to scale, the main figures, and ``more`` of them."""
        c, back = self.camera, self.T_camera_table.inverse()
        if not self.table_known:
            size = f"{c.width} × {c.height} px, focal length {c.fx:.0f} px"
            missing = ", ".join(self.lacking)
            return card(title, [("camera", size), ("not calibrated yet", missing), *more], "")
        eye = back.translation
        rows: list[tuple[str, object]] = [
            ("camera", f"{c.width} × {c.height} px, focal length {c.fx:.0f} px"),
            ("from the axis", f"{np.hypot(eye[0], eye[1]):.1f} mm, {eye[2]:.1f} mm high"),
        ]
        for s in self.sheets:
            angle = np.degrees(np.arcsin(min(abs(float(s.normal[2])), 1.0)))
            rows.append((f"laser {s.name}", f"{angle:.1f}° to the optical axis"))
        rows += self._moves
        known = "not known" if self.covariance is None else "known (covariance)"
        beams = [
            Beam(s.name, back.apply(self.light_source(s.name)), back.apply(s.centre))
            for s in self.sheets
        ]
        drawn = views(eye, back.turn(np.array([0.0, 0.0, 1.0])), beams)
        return card(title, [*rows, ("uncertainty", known), *more], drawn)

    @property
    def _moves(self) -> list[tuple[str, object]]:
        """What is known of the drive's errors and of the axis's own motion, in words."""
        out: list[tuple[str, object]] = []
        if self.motion is not None:
            turn = np.linspace(0.0, 2 * np.pi, 361)
            off = np.degrees(self.motion.angle(turn) - turn)
            even = f"off an even turn by {off.min():+.3f}° to {off.max():+.3f}°"
            out.append(("drive", f"{even}, backlash {np.degrees(self.motion.backlash):.3f}°"))
        if self.wobble is not None:
            tilt = float(np.degrees(np.linalg.norm(self.wobble.tilt)))
            at = f"{self.wobble.reach(_RIM):.3f} mm at a radius of {_RIM:g} mm"
            out.append(("axis", f"tilts by {tilt:.3f}° in a turn, moves by up to {at}"))
        return out

    def _repr_html_(self) -> str:
        return self.html()

    def sheet(self, name: str) -> LaserSheet:
        """The sheet of that name; raises KeyError that lists the names there are."""
        for s in self.sheets:
            if s.name == name:
                return s
        raise KeyError(f"no laser {name!r} in this rig; it has {[s.name for s in self.sheets]}")

    def light_source(self, name: str) -> Floats:
        """Where the light of a laser comes from, (3,) mm in the camera frame.

        Where the rig does not say, the laser is taken to stand as high above the platter and as far
        from the axis as the camera, on the camera's side. Raises KeyError as `sheet`.
        """
        sheet = self.sheet(name)
        if sheet.source is not None:
            return sheet.source
        T = self.T_camera_table.inverse()
        eye, normal, centre = T.translation, T.turn(sheet.normal), T.apply(sheet.centre)
        along = np.cross(normal, (0.0, 0.0, 1.0))
        along *= np.copysign(1.0, along @ eye) / max(float(np.linalg.norm(along)), 1e-12)
        up = np.cross(along, normal)
        away = float(np.hypot(eye[0], eye[1])) - (centre @ along)
        rise = (eye - centre)[2] / up[2] if abs(up[2]) > 1e-6 else 0.0
        return self.T_camera_table.apply(centre + away * along + rise * up)

    def turning(self, angle: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Rotations (..., 3, 3) and shifts, mm, that take the object's frame to the table frame at
        rest at true table angles (...) rad, the axis's own motion included.

        Shifts are (..., 3), or (3,) zeros where nothing is known of such a motion.
        """
        turned = rotation_z(angle)
        if self.wobble is None:
            return turned, np.zeros(3)
        tilted, shift = self.wobble.motion(angle)
        return tilted @ turned, shift

    def perturbed(self, delta: npt.ArrayLike) -> Rig:
        """The rig with its parameters moved by ``delta`` (p,), in the order of `parameter_names`.

        Camera parameters and bows add. A sheet turns about its centre by ``turn_along`` about e₁
        and ``turn_across`` about e₂ (radians), then shifts by ``offset`` mm along its normal. The
        table frame turns by the rotation vector ``turn`` (radians) and shifts (mm) in camera axes.
        Those of `wobble` add.
        """
        d = frozen(delta, (len(self.parameter_names),), "delta")
        k = len(_CAMERA)
        c = self.camera
        camera = replace(
            c,
            fx=c.fx + d[0],
            fy=c.fy + d[1],
            cx=c.cx + d[2],
            cy=c.cy + d[3],
            distortion=c.distortion + d[4:9],
            tilt=c.tilt + d[9:11],
        )
        sheets = []
        for s in self.sheets:
            sheets.append(_moved_sheet(s, d[k : k + len(_SHEET)]))
            k += len(_SHEET)
        wobble = self.wobble
        if wobble is not None:
            wobble = Wobble.of(wobble.values + d[k : k + len(Wobble.NAMES)])
            k += len(Wobble.NAMES)
        T = self.T_camera_table
        moved = Pose(rotation_from_vector(d[k : k + 3]) @ T.rotation, T.translation + d[k + 3 :])
        return replace(
            self, camera=camera, sheets=tuple(sheets), T_camera_table=moved, wobble=wobble
        )


def _moved_sheet(sheet: LaserSheet, d: Floats) -> LaserSheet:
    e1, e2 = sheet.axes
    normal = rotation_from_vector(d[0] * e1 + d[1] * e2) @ sheet.normal
    centre = sheet.centre + d[2] * sheet.normal
    return replace(sheet, normal=normal, centre=centre, bow=sheet.bow + d[3:6])
