"""Messages of devices, of live pictures, and of a scan that is being taken."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque, Remark


class LaserState(Model):
    """What is known of a laser. Where dark is not confirmed, show it as lit."""

    name: str
    lit: bool | None
    """None: not known."""
    age_seconds: float
    """Since it was confirmed."""


class DeviceState(Model):
    """A camera or a turntable."""

    state: Literal["none", "ready", "busy", "failed"]
    text: str


class FoundDevice(Model):
    """Something that can be connected."""

    address: str
    text: str
    role: Literal["camera", "board"]


class Found(Model):
    """What is connected to the computer."""

    kind: Literal["found"] = "found"
    id: Count
    devices: list[FoundDevice]
    notes: list[Remark]


class Devices(Model):
    """The devices in use, each time something changes, and each second while a laser may be lit."""

    kind: Literal["devices"] = "devices"
    addresses: list[str]
    """Camera, turntable, lasers; empty where nothing is connected."""
    camera: DeviceState
    table: DeviceState
    angle_deg: float | None
    lasers: list[LaserState]
    looking: bool
    rig: bool
    """Whether a rig (calibration) is known for them."""
    rig_name: str
    """Of the file it is from; empty for that of a simulated rig."""
    rigs: list[str]
    """Rig files in the folder, for ``use_rig``."""


class Seen(Model):
    """A live picture: arrays jpeg u8 (bytes); stripe, stripe_width and stripe_signal f32 (lines),
    px and grey levels, NaN where there is none; corners f32 (n, 2) of the calibration's board;
    histogram u32 of grey levels, from black to the largest possible value.

    Send ``ack`` with its number; with two unanswered the server sends no more.
    """

    kind: Literal["frame"] = "frame"
    number: Count
    width: Count
    height: Count
    orientation: Literal["vertical", "horizontal"]
    lit: list[str]
    step: Count | None
    view: Count | None
    """Of the calibration, where it was taken for it."""
    failure: str
    """Why the calibration's board was not found, where it was looked for."""
    saturated: float
    """Share of the stripe's lines that are clipped."""
    sharpness: float
    """Focus measure: largest in focus, for one scene at any exposure."""
    clipped: float
    """Share of the pixels at the largest possible value."""


class Points(Model):
    """Points of a scan that is being taken, to be added: array points f32 (m, 3)."""

    kind: Literal["points"] = "points"
    scan: Opaque
    laser: str
    step: Count


class Scanning(Model):
    """A scan that is being taken."""

    kind: Literal["scanning"] = "scanning"
    scan: Opaque
    state: Literal["running", "paused", "complete", "aborted", "failed"]
    done: Count
    total: Count
    seconds_left: float | None
    missing: Count
    text: str
