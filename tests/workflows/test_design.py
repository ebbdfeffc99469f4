"""`design` called from Python: figures, files, and clear errors that write nothing."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from turnscan.errors import ExportError, InputError
from turnscan.rig import rig_from_json
from turnscan.workflows import DesignOptions, design, parse_theta, published_design


def test_a_design_for_each_angle_and_its_figures(tmp_path: Path) -> None:
    done = design(DesignOptions(focal=25.0, pixel_um="5,6", sensor="1000x800"), [20.0, 30.0])
    assert [math.degrees(d.theta) for d in done.designs] == pytest.approx([20, 30])
    one = done.designs[0]
    assert (one.focal, one.columns, one.rows) == (25.0, 1000, 800)
    assert (one.pixel_width, one.pixel_height) == pytest.approx((0.005, 0.006))
    body = json.loads(json.dumps(done.body(), allow_nan=False))
    assert [row["theta_deg"] for row in body["rows"]] == [20, 30]
    assert any("1000×800 pixels" in line for line in done.lines())
    assert len(design().designs) == 1
    design(rig=tmp_path / "rig.json")
    assert rig_from_json((tmp_path / "rig.json").read_text(), "rig").camera.width > 2000


def test_the_paper_has_five_angles() -> None:
    done = published_design()
    assert len(done.designs) == 5
    assert done.lines()[0].startswith("Table 1")
    assert len(done.body()["rows"]) == 5


@pytest.mark.parametrize(
    ("make", "option"),
    [
        (lambda: DesignOptions(preset="none"), "preset"),  # type: ignore[arg-type]
        (lambda: DesignOptions(focal=math.nan), "focal"),
        (lambda: design(DesignOptions(sensor="640")), "sensor"),
        (lambda: design(DesignOptions(pixel_um="1,2,3")), "pixel_um"),
        (lambda: design(theta_deg=[1.0] * 101), "theta_deg"),
        (lambda: parse_theta("60:10:5"), "theta_deg"),
        (lambda: parse_theta("thirty"), "theta_deg"),
        (lambda: design(DesignOptions(focal=-16.0)), None),
        (lambda: design(theta_deg=[90.0]), None),
    ],
)
def test_what_cannot_be_names_its_option(make: Callable[[], object], option: str | None) -> None:
    with pytest.raises(InputError) as caught:
        make()
    named = caught.value.option
    assert (None if named is None else named.name) == option
    assert "--" not in str(caught.value)


def test_a_rig_has_one_angle_and_nothing_is_written_otherwise(tmp_path: Path) -> None:
    rig, picture = tmp_path / "rig.json", tmp_path / "rig.png"
    with pytest.raises(InputError, match="one angle, but there are 2") as caught:
        design(theta_deg=[20.0, 30.0], rig=rig, picture=picture)
    assert str(caught.value.hint) == "give one theta_deg"
    with pytest.raises(InputError, match="here are 5"):
        published_design(rig=rig)
    with pytest.raises(InputError, match="ends"):
        design(picture=tmp_path / "rig.txt")
    with pytest.raises(ExportError, match="no folder"):
        design(picture=picture, rig=tmp_path / "none" / "rig.json")
    assert not any(tmp_path.iterdir())
