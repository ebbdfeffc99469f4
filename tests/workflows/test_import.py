"""`import_pictures` called from Python: typed results, clear errors, and nothing half written."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

from turnscan.edit import Add, ProfileOff, action_to_json
from turnscan.errors import FormatError, InputError
from turnscan.progress import Cancelled, Progress
from turnscan.scan import Scan
from turnscan.workflows import (
    EvenSteps,
    ImportOptions,
    ListedAngles,
    MarkerAngles,
    import_pictures,
    parse_angles,
    simulate,
)

SIZE = (40, 60)


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Six pictures of a moving stripe."""
    folder = tmp_path / "on"
    folder.mkdir()
    u = np.arange(SIZE[1])
    for k in range(6):
        noise = np.random.default_rng(k).normal(0, 0.8, SIZE)
        stripe = 150 * np.exp(-((u - 12 - 6 * k) ** 2) / 4)
        seen = (30 + stripe + noise).clip(0, 255).astype(np.uint8)
        Pillow.fromarray(seen).save(folder / f"s{k}.png")
    return folder


def test_a_folder_becomes_a_scan_and_its_result_says_how(tmp_path: Path, pictures: Path) -> None:
    reports: list[tuple[float, str]] = []
    progress = Progress(lambda fraction, text: reports.append((fraction, text)))
    out = tmp_path / "a.turnscan"
    done = import_pictures(pictures, out, EvenSteps(-2.0), progress=progress)
    assert (done.path, done.frames, done.plan.steps, done.findings) == (out, 6, 6, ())
    assert done.angles == pytest.approx((math.radians(-10), 0))
    assert done.angle_source == "steps of -2°"
    assert done.threshold_source.startswith("4 × the noise of ")
    assert done.size_bytes == out.stat().st_size
    assert done.raw_bytes == 6 * SIZE[0] * SIZE[1]
    assert 0 < done.kept <= 1
    with Scan.open(out) as scan:
        assert len(scan) == 6
    assert reports[-1] == (pytest.approx(1.0), "importing")
    fractions = [fraction for fraction, _ in reports]
    assert fractions == sorted(fractions)


def test_one_dark_picture_serves_all_lasers_and_findings_name_options_as_data(
    tmp_path: Path, pictures: Path
) -> None:
    dark = tmp_path / "dark.png"
    Pillow.fromarray(np.full(SIZE, 30, np.uint8)).save(dark)
    both = {"left": pictures, "right": [str(p) for p in sorted(pictures.iterdir())]}
    options = ImportOptions(threshold=254.0, every=2)
    done = import_pictures(both, tmp_path / "a.turnscan", EvenSteps(9), dark=dark, options=options)
    assert done.plan.lasers == ("left", "right")
    assert done.frames == 6
    assert done.threshold_source == "as given"
    assert [f.code for f in done.findings] == ["scan.no-stripe"] * 2
    remedy = done.findings[0].remedy
    assert not isinstance(remedy, str)
    assert [option.name for option in remedy.options] == ["dark", "threshold"]


@pytest.mark.parametrize(
    ("source", "more", "option", "words"),
    [
        (MarkerAngles(), {}, "angles", "needs a rig"),
        (ListedAngles(Path("none.csv")), {}, "angles", "no such file"),
        (EvenSteps(1), {"options": ImportOptions(first_step=3)}, "first_step", "lower numbers"),
        (EvenSteps(1), {"options": ImportOptions(threshold=255.0)}, "threshold", "brightest pixel"),
        (EvenSteps(1), {"dark": {"left": "on"}}, "dark", "no laser 'left'"),
        (EvenSteps(1), {"rig": Path("no-rig.json")}, None, "no such file"),
    ],
)
def test_wrong_input_is_an_error_that_names_the_option_and_writes_nothing(
    tmp_path: Path,
    pictures: Path,
    source: Any,
    more: dict[str, Any],
    option: str | None,
    words: str,
) -> None:
    out = tmp_path / "a.turnscan"
    out.write_bytes(b"an older file")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=words) as caught:
        import_pictures(pictures, out, source, **more)
    named = caught.value.option
    assert (None if named is None else named.name) == option
    assert "--" not in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before
    assert out.read_bytes() == b"an older file"


def test_no_pictures_and_a_wrong_suffix(tmp_path: Path, pictures: Path) -> None:
    for none in ([], {}, {"left": []}):
        with pytest.raises(InputError, match="no pictures are named"):
            import_pictures(none, tmp_path / "a.turnscan", EvenSteps(1))
    with pytest.raises(InputError, match="turnscan"):
        import_pictures(pictures, tmp_path / "a.stl", EvenSteps(1))
    assert not list(tmp_path.glob("a.*"))


@pytest.mark.parametrize("after", [1, 4])
def test_cancelled_it_leaves_the_older_scan(tmp_path: Path, pictures: Path, after: int) -> None:
    out = tmp_path / "a.turnscan"
    import_pictures(pictures, out, EvenSteps(1))
    before = out.read_bytes()
    reports: list[str] = []
    progress = Progress(
        lambda _, text: reports.append(text), lambda: reports.count("importing") >= after
    )
    with pytest.raises(Cancelled):
        import_pictures(pictures, out, EvenSteps(2), progress=progress)
    assert out.read_bytes() == before
    assert [p for p in tmp_path.iterdir() if p != pictures] == [out]


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: EvenSteps(0), InputError, "not a step"),
        (lambda: EvenSteps(181), InputError, "not a step"),
        (lambda: EvenSteps(math.nan), FormatError, "not an angle"),
        (lambda: parse_angles("step:x"), FormatError, "'x' is not a number"),
        (lambda: ImportOptions(every=0), InputError, "every"),
        (lambda: ImportOptions(threshold=math.inf), InputError, "threshold"),
        (lambda: ImportOptions(keep="all"), InputError, "keep"),  # type: ignore[arg-type]
        (lambda: ImportOptions(colour=7), InputError, "colour"),  # type: ignore[arg-type]
    ],
)
def test_wrong_options_are_refused_when_they_are_made(
    make: Callable[[], object], kind: type[InputError], words: str
) -> None:
    with pytest.raises(kind, match=words) as caught:
        make()
    assert type(caught.value) is kind
    assert caught.value.option is not None


def test_repairs_by_hand_are_not_overwritten(tmp_path: Path, pictures: Path) -> None:
    out = tmp_path / "a.turnscan"
    import_pictures(pictures, out, EvenSteps(2.0))
    import_pictures(pictures, out, EvenSteps(3.0))
    with Scan.resume(out) as scan:
        scan.append_edit(action_to_json(Add(1, ProfileOff("laser", (2, 3)))), 0.0)
    before = out.read_bytes()
    with pytest.raises(InputError, match="holds 1 repair by hand"):
        import_pictures(pictures, out, EvenSteps(4.0))
    with pytest.raises(InputError, match="holds 1 repair by hand"):
        simulate("sphere", out)
    assert out.read_bytes() == before


def test_sources_of_angles_are_parsed_once() -> None:
    assert parse_angles("step:-2.5") == EvenSteps(-2.5)
    assert parse_angles("markers") == MarkerAngles()
    assert parse_angles("angles.csv") == ListedAngles(Path("angles.csv"))
