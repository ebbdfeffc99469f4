"""`simulate` called from Python: a scan file or a folder of pictures, or a clear error."""

from __future__ import annotations

from pathlib import Path

import pytest

from turnscan.errors import ExportError, InputError
from turnscan.progress import Cancelled, Progress
from turnscan.scan import Scan
from turnscan.workflows import SimulatedScan, SimulateOptions, simulate

FEW = SimulateOptions(rig="ciclop", steps=3, no_speckle=True)


def test_a_scan_file_with_the_true_rig(tmp_path: Path) -> None:
    reports: list[tuple[float, str]] = []
    progress = Progress(lambda fraction, text: reports.append((fraction, text)))
    done = simulate("sphere", tmp_path / "a.turnscan", FEW, progress)
    assert isinstance(done, SimulatedScan)
    assert (done.scene, done.rig, done.steps) == ("sphere", "ciclop", 3)
    assert done.exposure > 0
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.rig is not None
        assert scan.complete
        assert scan.plan.lasers == done.lasers
    assert reports == [(pytest.approx((k + 1) / 3), "scanning") for k in range(3)]
    simulate("sphere", tmp_path / "pictures", FEW)
    assert {"dark", *done.lasers} < {p.name for p in (tmp_path / "pictures").iterdir()}


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        ("no-such-part", SimulateOptions(), "no scene"),
        ("sphere", SimulateOptions(rig="none"), "no rig"),
        ("sphere", SimulateOptions(exposure=-1.0), "exposure -1"),
        ("sphere", SimulateOptions(theta_deg=95.0), "theta 95"),
        ("sim:cup?colour=red", SimulateOptions(), "no key"),
    ],
)
@pytest.mark.parametrize("name", ["a.turnscan", "pictures"])
def test_what_cannot_be_simulated_writes_nothing(
    tmp_path: Path, scene: str, options: SimulateOptions, words: str, name: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        simulate(scene, tmp_path / name, options)
    assert "--" not in str(caught.value)
    assert not any(tmp_path.iterdir())


def test_outputs_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not an empty folder"):
        simulate("sphere", tmp_path / "full", FEW)
    with pytest.raises(ExportError, match="no folder"):
        simulate("sphere", tmp_path / "none" / "a.turnscan", FEW)
    assert [p.name for p in tmp_path.rglob("*")] == ["full", "mine.txt"]


def test_options_have_types() -> None:
    for wrong in ({"steps": 2.5}, {"keep": "all"}, {"theta_deg": float("nan")}, {"perfect": 1}):
        with pytest.raises(InputError) as caught:
            SimulateOptions(**wrong)  # type: ignore[arg-type]
        assert caught.value.option is not None
        assert caught.value.option.name == next(iter(wrong))


def test_cancelled_it_leaves_no_scan_file(tmp_path: Path) -> None:
    reports: list[float] = []
    progress = Progress(lambda fraction, _: reports.append(fraction), lambda: bool(reports))
    with pytest.raises(Cancelled):
        simulate("sphere", tmp_path / "a.turnscan", FEW, progress)
    assert not any(tmp_path.iterdir())
