"""The settings in a scan file: kept, opened by every door, and of no concern to the frames."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.workflows.scans import write_can
from turnscan.cli import turnscan
from turnscan.edit import Add, ChangeSettings, action_to_json
from turnscan.errors import FormatError, InputError, ScanNewer
from turnscan.progress import no_progress
from turnscan.scan import Scan
from turnscan.workflows import (
    ReconstructOptions,
    ScanSession,
    check,
    compare,
    kept_names,
    kept_options,
    options_of,
    reconstruct,
)
from turnscan.workflows._options._declare import chosen


@pytest.fixture(scope="module")
def can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_can(tmp_path_factory.mktemp("can") / "can.turnscan")


@pytest.fixture
def scan(can: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(can, tmp_path / "can.turnscan"))


def run(*words: object) -> Result:
    return CliRunner().invoke(turnscan, [str(w) for w in words])


def test_the_command_line_keeps_what_it_was_told_and_opens_with_it(scan: Path) -> None:
    out = scan.with_name("can.ply")
    first = run("reconstruct", scan, "-o", out, "--strategy", "gauss3", "--close")
    assert first.exit_code == 0, first.output
    wanted = ReconstructOptions(strategy="gauss3", close=True)
    with Scan.open(scan) as kept:
        assert kept_options(kept) == wanted
        assert kept.sealed
        assert [trouble for _, trouble in kept.verify() if trouble] == []
    assert sorted(p.name for p in scan.parent.iterdir()) == ["can.ply", "can.turnscan"]
    made = out.read_bytes()
    again = run("reconstruct", scan, "-o", out)
    assert "settings kept in the scan: strategy=gauss3, close=True" in again.stderr
    assert out.read_bytes() == made


def test_options_replace_the_whole_set_or_change_it(scan: Path) -> None:
    out = scan.with_name("can.ply")
    run("reconstruct", scan, "-o", out, "--strategy", "gauss3")
    run("reconstruct", scan, "-o", out, "--settings", "own", "--edge", 2)
    assert options_of(scan) == ReconstructOptions(strategy="gauss3", edge=2)
    run("reconstruct", scan, "-o", out, "--every", 2)
    assert options_of(scan) == ReconstructOptions(every=2)
    run("reconstruct", scan, "-o", out, "--settings", "default")
    assert options_of(scan) == ReconstructOptions()
    assert options_of(scan, every=3).changed() == {"every": 3}


def test_named_sets_stand_beside_each_other(scan: Path) -> None:
    out = scan.with_name("can.ply")
    run("reconstruct", scan, "-o", out, "--every", 2)
    done = run("reconstruct", scan, "-o", out, "--set", "fine", "--edge", 2)
    assert done.exit_code == 0, done.output
    fine = out.read_bytes()
    assert options_of(scan) == ReconstructOptions(every=2)
    assert options_of(scan, "fine") == ReconstructOptions(edge=2)
    with Scan.open(scan) as opened:
        assert kept_names(opened) == ["default", "fine"]
    run("reconstruct", scan, "-o", out, "--set", "fine")
    assert out.read_bytes() == fine
    with pytest.raises(InputError, match="no set 'coarse' → there is default, fine"):
        reconstruct(scan, settings="coarse")
    with pytest.raises(InputError, match="not a name"):
        reconstruct(scan, settings=" ")


def test_edits_of_named_sets_stand_over_those_in_the_file_and_are_undone(scan: Path) -> None:
    out = scan.with_name("can.ply")
    run("reconstruct", scan, "-o", out, "--set", "fine", "--edge", 2)
    made = run("edits", scan, "--make", '{"kind": "rename_set", "name": "fine", "to": "finer"}')
    assert "rename settings 'fine' to 'finer'" in made.stdout
    assert options_of(scan, "finer") == ReconstructOptions(edge=2)
    with pytest.raises(InputError, match="no set 'fine'"):
        options_of(scan, "fine")
    reconstruct(scan, ReconstructOptions(edge=3), store=True, settings="finer")
    assert options_of(scan, "finer").edge == 3, "what is kept over an edit is an edit"
    run("edits", scan, "--undo")
    assert options_of(scan, "finer").edge == 2
    run("edits", scan, "--make", '{"kind": "delete_set", "name": "finer"}')
    again = run("edits", scan, "--make", '{"kind": "delete_set", "name": "finer"}')
    assert again.exit_code == 1
    assert "no set of settings 'finer'" in str(again.exception)
    for _ in range(2):
        run("edits", scan, "--undo")
    assert options_of(scan, "fine").edge == 2


def test_one_scan_is_compared_as_two_settings_make_it(scan: Path) -> None:
    run("edits", scan, "--make", '{"kind": "keep_set", "name": "low", "options": {"z_max": 20.0}}')
    whole, low = (reconstruct(scan, options_of(scan, name)) for name in ("default", "low"))
    found = compare(scan, scan, settings="low")
    assert found.areas is not None
    assert found.areas.measured == pytest.approx(low.mesh.area_of())
    assert found.areas.reference == pytest.approx(whole.mesh.area_of())
    assert found.areas.won < 0.01 * found.areas.measured
    assert found.areas.lost == pytest.approx(whole.mesh.area_of() - low.mesh.area_of(), rel=0.1)
    told = run("compare", scan, scan, "--settings", "low", "--reference-settings", "default")
    assert "cm² lost" in told.stdout
    none = run("compare", scan, scan, "--settings", "high")
    assert "no set 'high'" in str(none.exception)
    with pytest.raises(InputError, match="settings are of scans"):
        compare(low.mesh, scan, settings="low")


def test_an_edit_changes_settings_for_every_door_and_is_undone(scan: Path) -> None:
    out, usual, coarse = (scan.with_name(f"{name}.ply") for name in ("a", "usual", "coarse"))
    run("reconstruct", scan, "-o", usual)
    run("edits", scan, "--make", '{"kind": "profile_off", "laser": "L0", "steps": [3, 3]}')
    run("edits", scan, "--off", 1)
    made = run("edits", scan, "--make", '{"kind": "settings", "options": {"every": 2, "edge": 3}}')
    assert "settings: every 2, edge 3" in made.stdout
    assert options_of(scan) == reconstruct(scan).options == ReconstructOptions(every=2, edge=3)
    run("reconstruct", scan, "-o", out)
    run("edits", scan, "--undo")
    assert options_of(scan) == ReconstructOptions()
    run("reconstruct", scan, "-o", coarse, "--every", 2, "--edge", 3)
    assert out.read_bytes() == coarse.read_bytes(), "an edit is as good as options"
    run("reconstruct", scan, "-o", out, "--edits", "none", "--settings", "default")
    assert out.read_bytes() == usual.read_bytes()
    run("edits", scan, "--redo")
    assert options_of(scan).every == 2
    assert options_of(scan, "default", every=3).changed() == {"every": 3, "edge": 3}
    assert reconstruct(scan, edits="none").options == ReconstructOptions()


def test_options_that_are_kept_over_an_edit_are_an_edit(scan: Path, tmp_path: Path) -> None:
    """Else the edit would hide them, and undo would not lead back."""
    run("edits", scan, "--make", '{"kind": "settings", "options": {"every": 2}, "name": "fine"}')
    reconstruct(scan, ReconstructOptions(edge=3), store=True)
    reconstruct(scan, ReconstructOptions(edge=3), store=True)
    listed = run("edits", scan, "-o", tmp_path / "edits.json").stdout.splitlines()
    assert [line.split("  ")[-1].strip() for line in listed[:2]] == [
        "settings of set 'fine': every 2",
        "settings: edge 3",
    ]
    assert len(listed) == 3, "what is kept already is not kept again"
    assert json.loads((tmp_path / "edits.json").read_text())["version"] == 2
    run("edits", scan, "--undo")
    assert options_of(scan) == ReconstructOptions(every=2)
    assert reconstruct(scan, edits=str(tmp_path / "edits.json")).options.edge == 3


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ('{"every": 0}', "every: 0 is not at least 1|0 is not at least 1"),
        ('{"evry": 2}', "no option 'evry' → it is called every"),
        ('{"every": [2]}', "settings.options.every"),
    ],
)
def test_an_edit_of_settings_that_are_none_is_refused(scan: Path, options: str, says: str) -> None:
    before = scan.read_bytes()
    done = run("edits", scan, "--make", f'{{"kind": "settings", "options": {options}}}')
    assert isinstance(done.exception, InputError)
    assert re.search(says, str(done.exception)), done.exception
    assert scan.read_bytes() == before


def test_an_edit_of_settings_of_a_later_version_is_named(scan: Path) -> None:
    with Scan.resume(scan) as writing:
        later = ChangeSettings({"warp": 9.0})
        writing.append_edit(action_to_json(Add(1, later)), 0.0)
    with pytest.raises(ScanNewer, match=r"edit 1 \(settings\): from a later version"):
        options_of(scan)
    assert reconstruct(scan, edits="none").options == ReconstructOptions()


def test_a_scan_that_nobody_chose_settings_for_is_not_touched(scan: Path) -> None:
    before = scan.read_bytes()
    assert run("reconstruct", scan, "-o", scan.with_name("a.stl")).exit_code == 0
    reconstruct(scan, ReconstructOptions(every=2))
    assert scan.read_bytes() == before


def test_a_file_that_cannot_be_changed_is_reconstructed_with_a_note(scan: Path) -> None:
    options = ReconstructOptions(every=2)
    with Scan.resume(scan):
        (note,) = reconstruct(scan, options, store=True).notes
        assert "another process" in note.message
    before = scan.read_bytes()
    scan.chmod(0o444)
    done = run("reconstruct", scan, "-o", scan.with_name("a.stl"), "--every", 2)
    assert done.exit_code == 0
    assert "scan.settings-not-kept" in done.stderr
    assert "read-only" in done.stderr
    assert scan.read_bytes() == before


def test_a_result_without_a_surface_keeps_nothing(scan: Path) -> None:
    before = scan.read_bytes()
    run("reconstruct", scan, "-o", scan.with_name("a.stl"), "--threshold", 240)
    assert scan.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "kind", "says"),
    [
        ("{}", FormatError, "not in the expected form"),
        ("[]", FormatError, "not in the expected form"),
        ('{"version": 1, "sets": {"default": []}}', FormatError, "not in the expected form"),
        ('{"version": 1, "sets": {"default": {"every": 0}}}', FormatError, "every: 0 is not"),
        ('{"version": 1, "sets": {"default": {"every": true}}}', FormatError, "every: True"),
        ('{"version": 1, "sets": {"default": {"fill": "flat"}}}', FormatError, "no effect"),
        ('{"version": 1, "sets": {"default": {"warp": 9}}}', ScanNewer, "later version"),
        ('{"version": 2}', ScanNewer, "later version"),
    ],
)
def test_settings_that_are_none_are_named_and_can_be_replaced(
    scan: Path, text: str, kind: type[Exception], says: str
) -> None:
    with Scan.resume(scan) as writing:
        writing.keep_settings(text)
    with pytest.raises(kind, match=says):
        options_of(scan)
    if text == "{}":
        done = run("reconstruct", scan, "-o", scan.with_name("a.stl"), "--settings", "default")
        assert done.exit_code == 0, done.output
        assert options_of(scan) == ReconstructOptions()


@pytest.mark.parametrize(
    ("kept", "now"),
    [
        ({"voxel": 1.0, "merge": "grid"}, {"merge": "grid"}),
        ({"voxel": 1.0, "merge": "tsdf"}, {"voxel": 1.0, "merge": "tsdf"}),
        ({"spacing_by": "arc"}, {}),
        ({"spacing_by": "arc", "spacing": 1.0}, {"spacing_by": "arc", "spacing": 1.0}),
        ({"decimate": "0.05"}, {"decimate": "0.05mm"}),
        ({"decimate": "0.05mm"}, {"decimate": "0.05mm"}),
        ({"decimate": "2.0"}, {"decimate": "2mm"}),
        ({"decimate": "5e2"}, {"decimate": "500mm"}),
    ],
)
def test_what_earlier_versions_kept_is_read(
    scan: Path, kept: dict[str, object], now: dict[str, object]
) -> None:
    with Scan.resume(scan) as writing:
        writing.keep_settings(json.dumps({"version": 1, "sets": {"default": kept}}))
    assert options_of(scan).changed() == now
    with Scan.resume(scan) as writing:
        writing.append_edit(action_to_json(Add(1, ChangeSettings(kept))), 0.0)  # type: ignore[arg-type]
    assert options_of(scan).changed() == now


def test_a_number_of_faces_is_kept_in_digits(scan: Path) -> None:
    reconstruct(scan, ReconstructOptions(decimate="5e2"), store=True)
    assert options_of(scan).changed() == {"decimate": "500"}


def test_a_session_says_what_is_not_sound_about_what_it_exports(scan: Path) -> None:
    reconstruct(scan, ReconstructOptions(decimate="100"), store=True)
    session = ScanSession(scan, no_progress)
    try:
        result = session.result(session.now, no_progress)
    finally:
        session.close()
    result.save(scan.with_name("can.ply"))
    (finding,) = check(scan.with_name("can.ply")).findings
    assert finding.code == "surface.open"
    assert finding.code in [f.code for f in result.findings]


def test_what_a_change_leaves_no_effect_is_not_carried_along(scan: Path) -> None:
    options = ReconstructOptions(voxel=1.0, merge="tsdf", spacing=1.0, spacing_by="arc")
    reconstruct(scan, options, store=True)
    assert options_of(scan, merge="paste").changed().keys() == {"merge", "spacing", "spacing_by"}
    assert options_of(scan, spacing=None).changed().keys() == {"merge", "voxel"}
    closed = ReconstructOptions(close=True, fill="flat", edge=2)
    assert chosen(ReconstructOptions, closed, {"close": False}).changed() == {"edge": 2}
    with pytest.raises(InputError, match="voxel: no effect with merge grid"):
        options_of(scan, merge="grid", voxel=2.0)
    with pytest.raises(InputError, match="spacing_by: no effect without spacing"):
        reconstruct(scan, spacing=None, spacing_by="arc")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"strategy": "guess"}, "strategy: 'guess' is not one of window"),
        ({"denoise": 11}, "denoise: 11 is more than 10"),
        ({"threshold": 0.0}, "threshold: 0.0 is not more than 0"),
        ({"radius": float("nan")}, "radius: nan is not a finite number"),
        ({"edge": 1.5}, "edge: 1.5 is not a whole number"),
        ({"close": 1}, "close: 1 is not true or false"),
        ({"decimate": "3"}, "decimate: '3' faces are not a surface"),
        ({"decimate": "3.0"}, "decimate: '3.0' faces are not a surface"),
        ({"decimate": "0.05"}, "give a length as 0.05mm"),
        ({"voxel": 1.0, "merge": "paste"}, "voxel: no effect with merge paste"),
        ({"spacing_between": "5"}, "give an angle like 2deg"),
        ({"z_min": 9.0, "z_max": 3.0}, "no height between 9.0 and 3.0"),
        ({"every": None}, "every: no value"),
    ],
)
def test_an_option_out_of_its_limits_is_named(changes: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        ReconstructOptions(**changes)  # type: ignore[arg-type]


def test_a_scan_is_measured_like_the_file_made_of_it(scan: Path) -> None:
    ply = scan.with_name("can.ply")
    run("reconstruct", scan, "-o", ply, "--strategy", "blais-rioux", "--close")
    of_scan = json.loads(run("measure", scan, "--cylinder", "--json").stdout)
    of_file = json.loads(run("measure", ply, "--cylinder", "--json").stdout)
    assert of_scan.keys() == of_file.keys()
    assert of_scan["volume_mm3"] == pytest.approx(of_file["volume_mm3"], rel=1e-9)
    assert of_scan["volume_sigma_mm3"] == pytest.approx(of_file["volume_sigma_mm3"], rel=1e-9)
    assert of_scan["cylinder"]["radius_mm"] == pytest.approx(
        of_file["cylinder"]["radius_mm"], rel=1e-9
    )
    compared = json.loads(run("compare", scan, ply, "--json").stdout)
    assert compared["rms_mm"] < 1e-4
    exported = run("export", scan, "-o", scan.with_name("b.stl"))
    assert exported.exit_code == 0, exported.output
    scan.with_name("no.turnscan").write_text("")
    assert isinstance(run("measure", scan.with_name("none.turnscan")).exception, InputError)
