"""The rig of a real turntable, calibrated from the pictures that its owner took."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from tests.needs import needs_shared
from turnscan.cli._calibrate import verb


def calibrate_mouse(folder: Path) -> None:
    """``rig.json``, ``report.html`` and ``said.txt`` from every fifth picture of the table."""
    data = needs_shared("turntable-mouse")
    table = folder / "table"
    table.mkdir()
    for n in range(1, 320, 10):
        name = f"step_num_table{n}.jpg"
        (table / name).symlink_to(data / "empty-table" / name)
    arguments = [
        *("--camera", data / "camera-boards", "--board", "chessboard:8x6:40"),
        *("--laser", data / "laser-boards", "--table", table),
        *("--markers", "DICT_4X4_50:30", "--table-step-deg", "11.25"),
        *("-o", folder / "rig.json", "--report", folder / "report.html"),
    ]
    done = CliRunner().invoke(verb, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0
    (folder / "said.txt").write_text(done.output)
