"""When was the scanner last verified, and did it pass?"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from turnscan.findings import Finding
from turnscan.scan import read_verifications

_DAY = 86_400.0
USUAL_DAYS = 90.0
"""Days after which a verification is old, where nothing else is given."""


def verification_findings(history: Path, now: float, days: float = USUAL_DAYS) -> list[Finding]:
    """What a history of `turnscan.workflows.verify` says at the time ``now`` (s since 1970, UTC).

    A warning where there is no verification, where the last one is more than ``days`` old, and
    where one of its values was beyond its limit; else a note with its date. Raises as
    `turnscan.scan.read_verifications`.
    """
    runs = [r for r in read_verifications(history) if r.time <= now + _DAY]
    if not runs:
        return [
            Finding(
                "doctor.never-verified",
                "warning",
                "no verification in the history",
                str(history),
                "scan an artefact that was measured, then turnscan verify",
            )
        ]
    last = runs[-1]
    date = f"{datetime.fromtimestamp(last.time, UTC):%Y-%m-%d}"
    beyond = [f for f in last.figures if f.limit is not None and abs(f.value) > f.limit]
    found = [
        Finding(
            "doctor.not-passed",
            "warning",
            f"the last verification ({last.artefact}, {date}) was not passed: {f.name} "
            f"{f.value:+.4f} mm, limit {f.limit:g} mm",
            str(history),
            "calibrate again, then turnscan verify",
        )
        for f in beyond[:1]
    ]
    age = (now - last.time) / _DAY
    if age > days:
        found.append(
            Finding(
                "doctor.verification-old",
                "warning",
                f"the last verification ({last.artefact}, {date}) is {age:.0f} days old, more than "
                f"{days:g}",
                str(history),
                "scan an artefact that was measured, then turnscan verify",
            )
        )
    return found or [
        Finding("doctor.verified", "note", f"last verified {date}, {last.artefact}", str(history))
    ]
