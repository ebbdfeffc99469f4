"""The doctor: looks at devices with a part on the table, and says what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from turnscan.findings import Finding
from turnscan.rig import Rig
from turnscan.scanner._examine import CameraFacts, Examination, LaserFacts
from turnscan.scanner._open import Opened

Verdict = Literal["ready", "usable", "not ready"]
_VERDICTS: dict[Verdict, str] = {
    "ready": "ready for a scan",
    "usable": "a scan is possible, but will be worse than it could be",
    "not ready": "not ready for a scan",
}
_LIES = 0.02
_FLICKER = 0.005
_BRIGHT_ROOM = 0.25
_DIM, _WIDE, _CLIPPED, _FEW = 0.1, 6.0, 0.05, 0.05


@dataclass(frozen=True)
class TableFacts:
    """What turning tells."""

    counter_clockwise: bool | None
    """None where the direction was not seen."""
    degrees_per_turn: float | None
    """None where it was not seen."""


@dataclass(frozen=True)
class Diagnosis:
    """What the doctor saw."""

    camera: CameraFacts
    lasers: tuple[LaserFacts, ...]
    table: TableFacts | None
    """None where it was not turned."""
    findings: tuple[Finding, ...]
    calibrated: bool = False
    """Whether a rig is known, so that a scan has somewhere to go."""

    @property
    def verdict(self) -> Verdict:
        """``not ready`` with an error, ``usable`` with a warning, else ``ready``."""
        found = {f.severity for f in self.findings}
        return "not ready" if "error" in found else "usable" if "warning" in found else "ready"

    @property
    def next_step(self) -> str:
        """The one thing to do next: the remedy of the first of the worst findings.

        Where nothing is wrong: to calibrate, or to scan where a rig is known.
        """
        for severity in ("error", "warning"):
            worst = [f for f in self.findings if f.severity == severity and f.remedy]
            if worst:
                place = f"{worst[0].where}: " if worst[0].where else ""
                return f"{place}{worst[0].remedy}"
        return "scan the part" if self.calibrated else "calibrate the scanner"

    @property
    def conclusion(self) -> list[str]:
        """Verdict and next step in words, a line each."""
        return [f"verdict: {_VERDICTS[self.verdict]}", f"next step: {self.next_step}"]


def examine(
    bench: Opened,
    seconds: float | None = None,
    gain: float = 1.0,
    *,
    still: bool = False,
    rig: Rig | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Diagnosis:
    """Take dark pictures and one of each laser, then turn the table once, unless ``still``.

    Markers of ``rig`` on the platter say whether it has moved since the rig was calibrated.
    ``seconds`` None takes the bench's own exposure. The lasers are dark when this returns, however
    it does. Raises DeviceError and SafetyError as the devices do.
    """
    exposure = seconds or bench.exposure
    look = Examination(bench.hardware, exposure, gain)
    with look.shooter.dark_at_the_end():
        camera = look.camera()
        found = _camera(camera, exposure, gain)
        if rig is not None and rig.markers:
            found += _platter(look, rig)
        lasers = []
        for name in bench.hardware.lasers.names:
            tick()
            lasers.append(look.laser(name))
            found += _laser(lasers[-1])
        found += _sides(lasers)
        table = None if still else _table(look, found, tick)
    return Diagnosis(camera, tuple(lasers), table, tuple(found), bench.rig is not None)


def _camera(camera: CameraFacts, seconds: float, gain: float) -> list[Finding]:
    found = []
    for what, asked, got in (("exposure", seconds, camera.seconds), ("gain", gain, camera.gain)):
        if math.isnan(got):
            found.append(Finding("doctor.untold", "note", f"the camera does not report its {what}"))
        elif abs(got - asked) > _LIES * asked:
            found.append(
                Finding(
                    "doctor.setting",
                    "warning",
                    f"{what} {asked:g} was asked for, {got:g} is set",
                    where="camera",
                    remedy="choose a value that the camera supports",
                )
            )
    if camera.flicker > _FLICKER:
        found.append(
            Finding(
                "doctor.flicker",
                "warning",
                f"dark pictures differ by {100 * camera.flicker:.1f} % of the scale",
                where="camera",
                remedy="darken the room, or use an exposure of a whole period of the lamp's "
                "flicker",
            )
        )
    if camera.level > _BRIGHT_ROOM:
        found.append(
            Finding(
                "doctor.bright",
                "warning",
                f"without laser the picture is at {100 * camera.level:.0f} % of the scale",
                where="camera",
                remedy="darken the room, or use a filter for the laser's colour",
            )
        )
    return found


def _platter(look: Examination, rig: Rig) -> list[Finding]:
    """Whether the markers on the platter are where the rig puts them."""
    from turnscan.calibrate import moved_platter, platter_seen

    picture = look.picture()
    if picture.shape[:2] != (rig.camera.height, rig.camera.width):
        return [
            Finding(
                "doctor.other-camera",
                "error",
                f"the camera takes pictures of {picture.shape[1]}×{picture.shape[0]} px, the rig's "
                f"of {rig.camera.width}×{rig.camera.height}",
                "camera",
                "give the rig of this camera, or set the camera as it was calibrated",
            )
        ]
    seen = platter_seen(picture, rig)
    if math.isnan(seen.off):
        return [
            Finding(
                "doctor.no-markers",
                "note",
                "no marker of the rig is seen on the platter: whether it has moved since it was "
                "calibrated is not known",
                "camera",
                "light the room, or expose longer",
            )
        ]
    return moved_platter(rig, [seen.off])


def _laser(laser: LaserFacts) -> list[Finding]:
    where = f"laser {laser.name}"
    if laser.found < _FEW:
        return [
            Finding(
                "doctor.no-stripe",
                "error",
                "no stripe in its picture",
                where=where,
                remedy="check that it is lit and falls on the part; increase the exposure",
            )
        ]
    found = []
    if laser.saturated > _CLIPPED:
        found.append(
            Finding(
                "doctor.saturated",
                "warning",
                f"{100 * laser.saturated:.0f} % of the stripe is clipped",
                where=where,
                remedy="shorten the exposure, or bracket it",
            )
        )
    if laser.peak < _DIM:
        found.append(
            Finding(
                "doctor.dim",
                "warning",
                f"the stripe reaches {100 * laser.peak:.0f} % of the scale",
                where=where,
                remedy="lengthen the exposure",
            )
        )
    if laser.width > _WIDE:
        found.append(
            Finding(
                "doctor.focus",
                "warning",
                f"the stripe is {laser.width:.1f} px wide (rms)",
                where=where,
                remedy="focus the camera on the axis, then the laser's line",
            )
        )
    return found


def _sides(lasers: list[LaserFacts]) -> list[Finding]:
    """A laser from the left throws its stripe left of one from the right, on what is in front."""
    by_name = {laser.name: laser.column for laser in lasers if laser.found >= _FEW}
    if not {"left", "right"} <= by_name.keys() or by_name["left"] <= by_name["right"]:
        return []
    return [
        Finding(
            "doctor.swapped",
            "error",
            f"the stripe of laser left ({by_name['left']:.0f} px) is to the right of that of laser "
            f"right ({by_name['right']:.0f} px)",
            where="lasers",
            remedy="swap their names or outputs",
        )
    ]


def _table(look: Examination, found: list[Finding], tick: Callable[[], None]) -> TableFacts:
    turn = look.turn(tick)
    as_told, degrees, telling = turn.counter_clockwise, turn.degrees, turn.telling
    if as_told is None:
        found.append(
            Finding(
                "doctor.direction",
                "note",
                "the direction of rotation was not observed",
                where="table",
                remedy="place an object that is not round, or off the axis, in more light",
            )
        )
    elif not as_told:
        found.append(
            Finding(
                "doctor.direction",
                "error",
                "the table turns clockwise seen from above when its angle grows",
                where="table",
                remedy="swap the wires of one motor coil",
            )
        )
    if not telling:
        found.append(
            Finding(
                "doctor.turn",
                "note",
                "the part looks the same from several sides: whether 360° are a full turn was "
                "not observed",
                where="table",
                remedy="place an irregular object on the table",
            )
        )
    elif math.isnan(degrees) or degrees != 360.0:
        what = "another number" if math.isnan(degrees) else f"{degrees:.1f}°"
        found.append(
            Finding(
                "doctor.turn",
                "error",
                f"one turn of the part takes {what} instead of 360°",
                where="table",
                remedy="correct steps_per_rev in the table's address",
            )
        )
    return TableFacts(as_told, None if math.isnan(degrees) else degrees)
