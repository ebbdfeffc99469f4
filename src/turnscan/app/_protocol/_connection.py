"""Messages of the connection itself: answers, jobs, who is the operator, STOP."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from turnscan.app._protocol._base import Count, Model, Opaque, Remark, RemedyOption
from turnscan.app._protocol._folder import BinEntry, ScanEntry
from turnscan.app._protocol._verbs import ResultFile, ResultTable


class Hello(Model):
    """The first message: where things stand."""

    kind: Literal["hello"] = "hello"
    protocol: int
    version: str
    client: Opaque
    operator: Opaque | None
    scans: list[ScanEntry]
    binned: list[BinEntry]
    lasers_allowed: bool
    """False for a browser on another computer, unless the server is configured otherwise."""
    can_show_folder: bool
    """Whether ``show_folder`` opens it where this person sees it: on the server's computer."""


class Done(Model):
    """The request is done."""

    kind: Literal["done"] = "done"
    id: Count
    findings: list[Remark] = Field(default_factory=list)
    """What there is to say of it."""


class Refused(Model):
    """The request is not done, and nothing has changed."""

    kind: Literal["refused"] = "refused"
    id: Count | None
    code: str
    """``stale``, ``cancelled``, ``not-operator``, ``no-lasers``, ``busy``, ``bad-request`` or the
    error's name."""
    text: str
    hint: str
    options: list[RemedyOption] = Field(default_factory=list)
    """What the error is about, first, and what the hint names."""


class StartedJob(Model):
    """The request goes on as a job."""

    kind: Literal["started"] = "started"
    id: Count
    job: Opaque


class JobState(Model):
    """A job, each time it gets on; the last message has ``state`` done, failed or cancelled."""

    kind: Literal["job"] = "job"
    job: Opaque
    what: Literal["open", "edit", "export", "doctor", "calibrate", "scan", "verb", "demo"]
    scan: Opaque | None
    title: str
    state: Literal["running", "done", "failed", "cancelled"]
    done: Count
    total: Count | None
    seconds_left: float | None
    text: str
    hint: str
    options: list[RemedyOption] = Field(default_factory=list)
    """Where it failed: what the error is about, first, and what the hint names."""
    download: Opaque | None
    files: list[ResultFile]
    tables: list[ResultTable] = Field(default_factory=list)
    findings: list[Remark]


class Control(Model):
    """Who is the operator now."""

    kind: Literal["control"] = "control"
    operator: Opaque | None
    clients: Count


class Beat(Model):
    """The server is alive: sent several times a second, so that its silence is a message, too."""

    kind: Literal["beat"] = "beat"


class Stopped(Model):
    """Somebody pressed STOP."""

    kind: Literal["stopped"] = "stopped"
    client: Opaque | None
    """Who; None where it was asked for by HTTP."""
    confirmed: bool
    """Whether all lasers are known to be dark, and the table to stand still."""
