"""Everything that the server sends: the messages of the WebSocket, and headers of binary GETs."""

from __future__ import annotations

from typing import Annotated, get_args

from pydantic import Field, TypeAdapter

from turnscan.app import _protocol as p

ServerMessage = Annotated[
    p.Hello
    | p.Done
    | p.Refused
    | p.StartedJob
    | p.JobState
    | p.Verbs
    | p.Files
    | p.ImportPreviewed
    | p.Control
    | p.Beat
    | p.Stopped
    | p.Scans
    | p.FirstSurface
    | p.Opened
    | p.Closed
    | p.Patch
    | p.History
    | p.SettingsChanged
    | p.SettingsTried
    | p.SettingsCompared
    | p.GridChanged
    | p.PreviewShown
    | p.Holes
    | p.Defects
    | p.Measures
    | p.DeviationShown
    | p.ColoursShown
    | p.ShapesShown
    | p.Found
    | p.Devices
    | p.Calibration
    | p.Verifications
    | p.Seen
    | p.Points
    | p.Scanning,
    Field(discriminator="kind"),
]
ANSWERS: TypeAdapter[ServerMessage] = TypeAdapter(ServerMessage)
MESSAGES: tuple[type[p.Model], ...] = get_args(get_args(ServerMessage)[0])
HEADERS = (p.MeshHeader, p.FileMeshHeader, p.GridHeader, p.ProfileHeader)
"""Models that no message holds."""
