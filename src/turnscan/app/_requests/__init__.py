"""What the browser asks for: requests on the WebSocket, and bodies of POSTs (see `_protocol`)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, TypeAdapter

from turnscan.app._requests._base import Angle, Limit, Request, Ruler, Seconds, Stage
from turnscan.app._requests._bodies import (
    Added,
    ExportRequest,
    Invitation,
    LoginRequest,
    Problem,
    Received,
    StartedExport,
    Uploaded,
)
from turnscan.app._requests._calibration import (
    BeginCalibration,
    Capture,
    FinishCalibration,
    ForgetView,
    ListVerifications,
)
from turnscan.app._requests._connection import Ack, Cancel, ReleaseControl, Stop, TakeControl
from turnscan.app._requests._edits import (
    CompareSettings,
    CopyEdits,
    EditRequest,
    GoTo,
    NameEdit,
    Redo,
    Switch,
    TrySettings,
    Undo,
)
from turnscan.app._requests._folder import (
    Duplicate,
    EmptyBin,
    Open,
    Rename,
    Restore,
    ShowFolder,
    ToBin,
    TryDemo,
)
from turnscan.app._requests._inspection import (
    FindShapes,
    ForgetMeasure,
    ListDefects,
    ListHoles,
    MeasureAgain,
    SaveReport,
    ShowColours,
    ShowDeviation,
    SpecifyMeasure,
    TakeMeasure,
)
from turnscan.app._requests._rig import (
    Abort,
    Connect,
    Disconnect,
    Doctor,
    FindDevices,
    GoOn,
    Look,
    Pause,
    Resume,
    ScanPlan,
    StartScan,
    Turn,
    UseRig,
)
from turnscan.app._requests._verbs import ListFiles, ListVerbs, PreviewImport, RunVerb

__all__ = [
    "BODIES",
    "REQUESTS",
    "Abort",
    "Ack",
    "Added",
    "Angle",
    "BeginCalibration",
    "Cancel",
    "Capture",
    "ClientMessage",
    "CompareSettings",
    "Connect",
    "CopyEdits",
    "Disconnect",
    "Doctor",
    "Duplicate",
    "EditRequest",
    "EmptyBin",
    "ExportRequest",
    "FindDevices",
    "FindShapes",
    "FinishCalibration",
    "ForgetMeasure",
    "ForgetView",
    "GoOn",
    "GoTo",
    "Invitation",
    "Limit",
    "ListDefects",
    "ListFiles",
    "ListHoles",
    "ListVerbs",
    "ListVerifications",
    "LoginRequest",
    "Look",
    "MeasureAgain",
    "NameEdit",
    "Open",
    "Pause",
    "PreviewImport",
    "Problem",
    "Received",
    "Redo",
    "ReleaseControl",
    "Rename",
    "Request",
    "Restore",
    "Resume",
    "Ruler",
    "RunVerb",
    "SaveReport",
    "ScanPlan",
    "Seconds",
    "ShowColours",
    "ShowDeviation",
    "ShowFolder",
    "SpecifyMeasure",
    "Stage",
    "StartScan",
    "StartedExport",
    "Stop",
    "Switch",
    "TakeControl",
    "TakeMeasure",
    "ToBin",
    "TryDemo",
    "TrySettings",
    "Turn",
    "Undo",
    "Uploaded",
    "UseRig",
]

ClientMessage = Annotated[
    Stop
    | TakeControl
    | ReleaseControl
    | Ack
    | Cancel
    | Open
    | Rename
    | Duplicate
    | ToBin
    | Restore
    | EmptyBin
    | ShowFolder
    | TryDemo
    | ListVerbs
    | ListFiles
    | RunVerb
    | PreviewImport
    | EditRequest
    | Undo
    | Redo
    | GoTo
    | NameEdit
    | Switch
    | CopyEdits
    | TrySettings
    | CompareSettings
    | ListHoles
    | ListDefects
    | TakeMeasure
    | ForgetMeasure
    | SpecifyMeasure
    | MeasureAgain
    | ShowDeviation
    | ShowColours
    | FindShapes
    | SaveReport
    | FindDevices
    | Connect
    | Disconnect
    | Look
    | Turn
    | Doctor
    | UseRig
    | BeginCalibration
    | Capture
    | ForgetView
    | FinishCalibration
    | ListVerifications
    | StartScan
    | Resume
    | Pause
    | GoOn
    | Abort,
    Field(discriminator="kind"),
]
REQUESTS: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
BODIES = (
    LoginRequest, Invitation, ExportRequest, StartedExport, Added, Received, Uploaded, Problem,
)  # fmt: skip
"""Models that no message holds."""
