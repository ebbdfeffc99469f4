"""Finding: a numbered diagnosis with cause, place and remedy."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

from turnscan.remedy import Remedy

Severity = Literal["note", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """Something a person should know about a result.

    ``code`` is stable and made of a room and a word, like ``calibrate.marker-size``;
    ``message`` says what was found, with the value and what was expected;
    ``where`` names the place (a picture, a step, a marker); ``remedy`` says what to do.
    """

    code: str
    severity: Severity
    message: str
    where: str = ""
    remedy: str | Remedy = ""

    def __str__(self) -> str:
        """One line for a terminal or a report."""
        place = f" [{self.where}]" if self.where else ""
        remedy = f" → {self.remedy}" if self.remedy else ""
        return f"{self.severity} {self.code}{place}: {self.message}{remedy}"


def findings_json(findings: Iterable[Finding]) -> str:
    """Write findings as a JSON list of objects of strings."""
    return json.dumps([record(f) for f in findings], indent=2, ensure_ascii=False)


def record(finding: Finding) -> dict[str, str]:
    """A finding as a JSON object of strings."""
    return {**asdict(finding), "remedy": str(finding.remedy)}
