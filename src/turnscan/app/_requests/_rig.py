"""Requests to devices, and of scans that are being taken."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from turnscan.app._protocol import Model, Name, Opaque
from turnscan.app._requests._base import Angle, Request, Seconds
from turnscan.workflows import Orientation


class FindDevices(Request):
    """Answered by ``found``; with ``probe``, serial ports are opened and asked."""

    kind: Literal["find_devices"] = "find_devices"
    probe: bool = False


class Connect(Request):
    """Open devices by address; a simulated rig is one address for all three."""

    kind: Literal["connect"] = "connect"
    camera: Name
    turntable: Name
    lasers: Name


class Disconnect(Request):
    """Lasers dark, and let the devices go."""

    kind: Literal["disconnect"] = "disconnect"


class Look(Request):
    """Live pictures with these lasers lit, until it is sent with ``on`` false."""

    kind: Literal["look"] = "look"
    on: bool
    lit: tuple[Name, ...] = ()
    seconds: Seconds | None = None
    """Exposure; None takes what suits the devices."""
    gain: Annotated[float, Field(gt=0, le=1000)] = 1.0
    orientation: Orientation = "vertical"
    board: bool = False
    """Look for the board of the calibration in them."""


class Turn(Request):
    """Turn the table to an angle."""

    kind: Literal["turn"] = "turn"
    angle_deg: Angle


class Doctor(Request):
    """Look at the devices: a job with findings."""

    kind: Literal["doctor"] = "doctor"
    still: bool = False
    seconds: Seconds | None = None


class UseRig(Request):
    """Take the rig of a file in the folder for the scans from now on."""

    kind: Literal["use_rig"] = "use_rig"
    name: Name


class ScanPlan(Model):
    """What a scan is to be; None leaves it to the server, which says what it chose."""

    name: Name
    steps: Annotated[int, Field(ge=1, le=100000)] | None = None
    from_deg: float = 0.0
    to_deg: float = 360.0
    lasers: tuple[Name, ...] | None = None
    seconds: Annotated[tuple[Seconds, ...], Field(max_length=8)] = ()
    gain: Annotated[float, Field(gt=0, le=1000)] = 1.0
    keep: Literal["sparse", "full"] = "sparse"
    threshold: Annotated[float, Field(ge=0, le=65535)] | None = None
    orientation: Orientation = "vertical"
    """Orientation of the stripe in the picture."""
    texture: Seconds | None = None
    """Exposure of a whole picture without laser, taken too; None for none."""
    texture_every: Annotated[int, Field(ge=1, le=100000)] = 1
    """Steps."""
    lamps: Annotated[tuple[Name, ...], Field(max_length=64)] = ()
    """Outputs of the laser board that are lamps: never lit as lasers, but for those pictures."""


class StartScan(Request):
    """Take a scan: a job; ``scanning``, ``frame`` and ``points`` tell how it goes."""

    kind: Literal["scan"] = "scan"
    plan: ScanPlan


class Resume(Request):
    """Take what an interrupted scan is missing, with the devices that are connected: a job."""

    kind: Literal["resume"] = "resume"
    scan: Opaque
    retake: bool = False
    """Also take frames again that are damaged or recorded as missing."""
    at_deg: Angle | None = None
    """Current table angle in the scan's frame, set by the operator, degrees."""


class Pause(Request):
    """Wait after the picture that is being taken, lasers dark."""

    kind: Literal["pause"] = "pause"


class GoOn(Request):
    """End the pause."""

    kind: Literal["go_on"] = "go_on"


class Abort(Request):
    """End the scan; what was taken stays, and can be resumed."""

    kind: Literal["abort"] = "abort"
