"""The doors translate, and no more: the same surface and findings from each of them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.workflows.scans import write_can
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job
from turnscan.app._open_scan import OpenScan
from turnscan.cli import turnscan
from turnscan.cli._words import with_flags
from turnscan.formats import ExportOptions, export
from turnscan.progress import no_progress
from turnscan.workflows import declared

SETTINGS = [
    {},
    {"strategy": "blais-rioux"},
    {"strategy": "gauss3", "choose": "first", "every": 2},
    {"spacing": 2.0, "spacing_by": "arc"},
    {"spacing_between": "5deg", "edge": 2},
    {"z_min": 5.0, "z_max": 35.0, "radius": 40.0},
    {"denoise": 2.0, "outliers": 8.0, "keep_strays": True},
    {"merge": "tsdf", "voxel": 2.0, "island": 10},
    {"close": True, "top": "fan"},
    {"close": True, "decimate": "0.05mm"},
]


@pytest.fixture(scope="module")
def can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_can(tmp_path_factory.mktemp("doors") / "can.turnscan")


@pytest.mark.parametrize("changes", SETTINGS, ids=lambda c: ",".join(c) or "usual")
def test_all_doors_make_the_same_surface(
    changes: dict[str, object], can: Path, tmp_path: Path
) -> None:
    scan = Path(shutil.copy(can, tmp_path / "can.turnscan"))
    words = ["reconstruct", str(scan), "-o", str(tmp_path / "cli.ply")]
    for name, value in changes.items():
        words += ["--" + name.replace("_", "-"), *([] if value is True else [str(value)])]
    told = CliRunner().invoke(turnscan, words)
    assert told.exit_code == 0, told.output
    of_cli = (tmp_path / "cli.ply").read_bytes()

    options = ts.ReconstructOptions(**changes)  # type: ignore[arg-type]
    made = ts.reconstruct(scan)
    assert made.options == options, "the command line kept what it was told"
    made.save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == of_cli
    said = [line for line in told.stderr.splitlines() if not line.startswith("settings")]
    found = [str(with_flags(f)) for f in made.findings]
    assert said[: len(found)] == found

    browser = OpenScan("can", scan, Hub(), Job(Hub(), "open", "", None))
    try:
        shown = browser.result(browser.now, no_progress)
        codes = {f.code for f in browser.findings}
    finally:
        browser.close()
    formats, _ = shown.content(ExportOptions())
    assert export(shown.mesh, ".ply", options=formats) == of_cli, "provenance included"
    if options.close:
        assert "scan.finished-on-export" in codes
    else:
        assert codes == {f.code for f in made.findings}


def test_each_option_is_declared_once_and_has_a_flag() -> None:
    options = declared(ts.ReconstructOptions)
    assert set(options) == set(ts.ReconstructOptions().__dataclass_fields__)
    help_text = CliRunner().invoke(turnscan, ["reconstruct", "--help"]).output
    for name in options:
        assert "--" + name.replace("_", "-") in help_text
    assert replace(ts.ReconstructOptions(), every=2).changed() == {"every": 2}
