"""A scan file with edits and settings, as turnscan wrote it in November 2026, before the log of
edits had branches: every door must open it with them."""

from __future__ import annotations

import shutil
from pathlib import Path

from turnscan import workflows

EDITED = Path(__file__).parents[1] / "museum" / "scan" / "edited-1.turnscan"


def test_edits_and_settings_of_an_earlier_version(tmp_path: Path) -> None:
    scan = tmp_path / "part.turnscan"
    shutil.copy(EDITED, scan)
    history = workflows.edits(scan).history
    assert [entry.edit.kind for entry in history.entries] == [
        "delete_points", "profile_off", "set_point", "fill", "decimate", "measure_distance",
        "measure_corner",
    ]  # fmt: skip
    assert [entry.on for entry in history.entries] == [True, False] + 5 * [True]
    assert history.cursor == 6
    part = workflows.reconstruct(scan)
    assert part.options.strategy == "gauss3"
    assert len(part.edits) == 5
    assert not part.failed
    # The line of steps 5 and 6 is there, as the edit that leaves it out is off.
    assert {5, 6} <= set(part.points["step"])
    assert not set(zip([3, 3, 3], [100, 101, 102], strict=True)) & set(
        zip(part.points["step"].tolist(), part.points["row"].tolist(), strict=True)
    )
    said = [f.message for f in part.findings if f.code == "edit.measured"]
    assert len(said) == 1
    assert abs(float(said[0].split()[0]) - 20.0) < 0.15
