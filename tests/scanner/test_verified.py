"""What the doctor says of the last verification."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from turnscan.cli import turnscan
from turnscan.errors import FormatError
from turnscan.scan import VerifiedFigure, VerifiedRun, add_verification, read_verifications
from turnscan.scanner import verification_findings

DAY = 86_400.0


def run(day: float, value: float) -> VerifiedRun:
    figure = VerifiedFigure(0, "a.turnscan", "size of the ball", value, 0.001, math.nan, 0.0, 0.02)
    return VerifiedRun(day * DAY, "bar", "key", "", "1", (figure,))


def codes(history: Path, day: float, days: float = 90.0) -> list[str]:
    return [f.code for f in verification_findings(history, day * DAY, days)]


def test_none_an_old_and_a_failed_verification_are_warnings_a_fresh_one_a_note(
    tmp_path: Path,
) -> None:
    history = tmp_path / "h"
    assert codes(history, 10) == ["doctor.never-verified"]
    assert not history.exists()
    add_verification(history, run(10, 0.01))
    assert codes(history, 50) == ["doctor.verified"]
    assert codes(history, 101) == ["doctor.verification-old"]
    assert codes(history, 101, 100) == ["doctor.verified"]
    add_verification(history, run(100, 0.03))
    assert codes(history, 101) == ["doctor.not-passed"]
    # One that was made up later for an earlier day is not the last one.
    add_verification(history, run(99, 0.01))
    assert codes(history, 101) == ["doctor.not-passed"]
    assert [r.time / DAY for r in read_verifications(history)] == [10, 99, 100]
    assert math.isnan(read_verifications(history)[0].figures[0].calibration)


def test_the_doctor_reads_the_history_before_it_lights_anything(tmp_path: Path) -> None:
    wrong = tmp_path / "h"
    wrong.write_text("no history")
    words = ["doctor", "--device", "sim:cup", "--history", str(wrong)]
    done = CliRunner().invoke(turnscan, words)
    assert isinstance(done.exception, FormatError)


@pytest.mark.slow
def test_the_doctor_says_it(tmp_path: Path) -> None:
    history = tmp_path / "h"
    add_verification(history, run(1, 0.01))
    words = ["doctor", "--device", "sim:sphere?speckle=0"]
    done = CliRunner().invoke(turnscan, [*words, "--still", "--history", str(history)])
    assert done.exit_code == 1, done.output
    assert "doctor.verification-old" in done.output
