"""The doors translate, and no more: the same surface and findings from each of them."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.once import once
from tests.workflows.scans import write_can
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job
from turnscan.app._open_scan import OpenScan
from turnscan.app._step_pictures import StepPictures
from turnscan.cli import turnscan
from turnscan.cli._words import with_flags
from turnscan.formats import ExportOptions, export
from turnscan.progress import no_progress
from turnscan.workflows import EditChanges, declared, edits, simulate

SETTINGS = [
    {},
    {"strategy": "blais-rioux"},
    {"strategy": "gauss3", "choose": "first", "every": 2},
    {"spacing": 2.0, "spacing_by": "arc"},
    {"spacing_between": "5deg", "edge": 2},
    {"z_min": 5.0, "z_max": 35.0, "radius": 40.0},
    {"denoise": 2.0, "outliers": 8.0, "keep_strays": True},
    {"merge": "tsdf", "voxel": 2.0, "island": 10},
    {"largest_sigma": 0.2},
    {"close": True, "top": "fan"},
    {"close": True, "decimate": "0.05mm"},
]


SCANS = ("cup", "bracket", "can")
"""Translucent with two lasers, with an edge and a bore, and edited by hand."""
REPAIRS = (
    '{"kind": "profile_off", "laser": "L0", "steps": [3, 4]}',
    '{"kind": "cut", "normal": [0, 0, -1], "distance": -36.0, "cap": false}',
    '{"kind": "fill", "how": "membrane", "largest": 12.0}',
)


def _written(folder: Path) -> None:
    simulate("cup", folder / "cup.turnscan", rig="paper", steps=12, lasers=2, seed=2)
    simulate("bracket", folder / "bracket.turnscan", rig="paper", steps=16, lasers=1, seed=3)
    edits(write_can(folder / "can.turnscan"), EditChanges(make=REPAIRS))


@dataclass
class Doors:
    """A scan behind three doors: a file of the command line, which Python opens, and a browser."""

    scan: Path
    browser: OpenScan
    job: Job


@pytest.fixture(scope="module", params=SCANS)
def doors(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    made = once(tmp_path_factory, "same-surface", _written)
    here, there = tmp_path_factory.mktemp("cli"), tmp_path_factory.mktemp("browser")
    name = f"{request.param}.turnscan"
    scan, shown = (Path(shutil.copy(made / name, folder / name)) for folder in (here, there))
    pictures = StepPictures(there)
    browser = OpenScan("scan", shown, Hub(), Job(Hub(), "open", "", None), pictures)
    yield Doors(scan, browser, Job(Hub(), "edit", "", None))
    browser.close()
    pictures.close()


@pytest.mark.parametrize("changes", SETTINGS, ids=lambda c: ",".join(c) or "usual")
def test_all_doors_make_the_same_surface(
    changes: dict[str, object], doors: Doors, tmp_path: Path
) -> None:
    """Whether settings are flags, stand in the file, or are an edit."""
    words = ["reconstruct", str(doors.scan), "-o", str(tmp_path / "cli.ply")]
    for name, value in changes.items():
        words += ["--" + name.replace("_", "-"), *([] if value is True else [str(value)])]
    words += [] if changes else ["--settings", "default"]
    told = CliRunner().invoke(turnscan, words)
    assert told.exit_code == 0, told.output
    of_cli = (tmp_path / "cli.ply").read_bytes()

    options = ts.ReconstructOptions(**changes)  # type: ignore[arg-type]
    made = ts.reconstruct(doors.scan)
    assert made.options == options, "the command line kept what it was told"
    made.save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == of_cli
    found = [str(with_flags(f)) for f in made.findings]
    assert told.stderr.splitlines()[: len(found)] == found

    browser = doors.browser
    if browser.now.options != options:
        asked = {"kind": "settings", "options": changes}
        doors.job.over = False
        browser.make(browser.now.revision, asked, {}, doors.job)
    assert browser.now.options == options
    shown = browser.result(browser.now, no_progress)
    formats, _ = shown.content(ExportOptions())
    assert export(shown.mesh, ".ply", options=formats) == of_cli, "provenance included"
    assert [(h.cause, h.also) for h in shown.holes] == [(h.cause, h.also) for h in made.holes]
    assert faces_left_out(shown) == faces_left_out(made)
    assert (faces_left_out(made) > 0) == any("merged vertices" in f.message for f in made.findings)
    assert shown.points.tobytes() == made.points.tobytes()
    before = {str(f) for f in browser.findings}
    if options.close:
        assert any(f.code == "scan.finished-on-export" for f in browser.findings)
    else:
        assert before == {str(f) for f in made.findings}


def faces_left_out(done: ts.ReconstructResult) -> int:
    """How many were left out for their uncertainty, which the causes of holes look at."""
    lost = done.reconstruction.lost
    return 0 if lost is None else len(lost.faces.faces)


def test_a_browser_opens_a_scan_with_the_settings_in_its_file(tmp_path: Path) -> None:
    scan = write_can(tmp_path / "can.turnscan")
    made = ts.reconstruct(scan, strategy="gauss3", close=True, store=True)
    pictures = StepPictures(tmp_path)
    browser = OpenScan("can", scan, Hub(), Job(Hub(), "open", "", None), pictures)
    try:
        shown = browser.result(browser.now, no_progress)
    finally:
        browser.close()
        pictures.close()
    assert shown.options == made.options
    one, two = (r.content(ExportOptions())[0] for r in (shown, made))
    assert export(shown.mesh, ".ply", options=one) == export(made.mesh, ".ply", options=two)


def test_each_option_is_declared_once_and_has_a_flag() -> None:
    options = declared(ts.ReconstructOptions)
    assert set(options) == set(ts.ReconstructOptions().__dataclass_fields__)
    help_text = CliRunner().invoke(turnscan, ["reconstruct", "--help"]).output
    for name in options:
        assert "--" + name.replace("_", "-") in help_text
    assert replace(ts.ReconstructOptions(), every=2).changed() == {"every": 2}
