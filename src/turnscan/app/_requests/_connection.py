"""Requests of the connection itself: STOP, control, jobs."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol import Count, Model, Opaque
from turnscan.app._requests._base import Request


class Stop(Request):
    """Lasers dark and table stopped, at once; a scan being taken ends. Anybody may."""

    kind: Literal["stop"] = "stop"


class TakeControl(Request):
    """Become the operator."""

    kind: Literal["take_control"] = "take_control"


class ReleaseControl(Request):
    """Be the operator no more."""

    kind: Literal["release_control"] = "release_control"


class Ack(Model):
    """A live picture has been shown; not answered."""

    kind: Literal["ack"] = "ack"
    number: Count


class Cancel(Request):
    """End a job."""

    kind: Literal["cancel"] = "cancel"
    job: Opaque
