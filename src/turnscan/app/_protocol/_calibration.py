"""Messages of calibrations and verifications."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque, Remark


class CalibrationView(Model):
    """A picture of a calibration."""

    view: Count
    stage: Literal["camera", "laser", "table"]
    laser: str
    """Lit in it; empty for none."""
    name: str
    failure: str
    """Why it cannot be used; empty where it can."""
    corners: Count
    rms_px: float | None
    """How far its corners are off in the last adjustment; None before one."""


Verdict = Literal["good", "usable", "refused"]
"""No warnings; warnings, but worth a scan; not worth one, and not kept."""


class CalibrationVerdict(Model):
    """What a calibration came to."""

    verdict: Verdict
    text: str
    hint: str
    rig: str
    """The rig file that was written; empty for none."""
    report: Opaque | None
    """The file of its report: at ``/api/files/{file}/page``."""
    findings: list[Remark]


class VerificationTrend(Model):
    """One test value in all runs with an artefact and a rig, mm."""

    name: str
    times: list[str]
    """ISO time, UTC."""
    values: list[float]
    noise: list[float]
    """Expanded uncertainty (k = 2) of each by itself."""
    limit: float | None
    alarm: bool
    """Whether the newest value drifts beyond the limit of its control chart."""


class VerificationRuns(Model):
    """All runs with one artefact and one rig."""

    artefact: str
    rig: str
    """Digest of the rig; empty where unknown."""
    trends: list[VerificationTrend]


class Calibration(Model):
    """A calibration in the making, each time a picture has been looked at. Array ``marked`` f32
    (n, 3): every corner of the board that was seen, u and v px, and the number of its view. Array
    ``placed`` f32 (n, 4): where the corners were in the last adjustment, x, y, z mm in the frame
    of the camera, and the number of the view."""

    kind: Literal["calibration"] = "calibration"
    board: str
    views: list[CalibrationView]
    coverage: float
    """Share of the cells of the picture in which a corner of the board was seen."""
    columns: Count
    rows: Count
    cells: list[int]
    """Corners in each cell, row by row from the top left."""
    width: Count
    height: Count
    """Of the pictures."""
    missing: list[str]
    """What is still wanted, in words."""
    undetermined: list[str]
    """What no pictures have determined yet."""
    advice_stage: str
    """Which pictures would help most: camera, table, or the name of a laser; empty for none."""
    advice: str
    """The same in words; empty before it is known."""
    verdict: CalibrationVerdict | None
    reach: list[float]
    """Half of the picture's width and height at a distance of one; empty before an adjustment."""
    axis: list[float]
    """Of rotation, in the frame of the camera: the table's middle, mm, and a direction; empty
    before it is known."""


class Verifications(Model):
    """The history of verifications of the folder, the newest last."""

    kind: Literal["verifications"] = "verifications"
    id: Count
    histories: list[VerificationRuns]
