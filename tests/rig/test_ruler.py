"""A rig from numbers of a ruler and a protractor."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from turnscan.errors import FormatError, InputError
from turnscan.rig import rig_from_json, rig_from_ruler, rig_to_json
from turnscan.workflows import read_rig_file

TEXT = """
[camera]
width = 640
height = 480
focal_mm = 4.0
pixel_um = 6.0
distance_mm = 300
height_mm = 150.0
tilt_deg = 20
roll_deg = 5

[[laser]]
name = "left"
angle_deg = -28
beside_mm = 3
distance_mm = 250
height_mm = 100

[[laser]]
name = "right"
angle_deg = 31.5
lean_deg = 2

[uncertainty]
length_mm = 4
"""


def test_everything_stands_where_it_was_measured() -> None:
    rig = rig_from_ruler(TEXT)
    assert [s.name for s in rig.sheets] == ["left", "right"]
    assert rig.camera.fx == pytest.approx(4000 / 6)
    back = rig.T_camera_table.inverse()
    assert back.translation == pytest.approx([300, 0, 150])
    forward = back.turn([0.0, 0.0, 1.0])
    assert forward == pytest.approx([-math.cos(math.radians(20)), 0, -math.sin(math.radians(20))])
    # Rolled clockwise by 5°: what is up in the world leans to the left in the picture.
    up = rig.T_camera_table.turn([0.0, 0.0, 1.0])
    assert math.degrees(math.atan2(up[0], -up[1])) == pytest.approx(-5)
    left, right = rig.sheets
    for sheet, angle in ((left, -28), (right, 31.5)):
        way = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0])
        along = rig.T_camera_table.turn(way)
        assert abs(sheet.normal @ along) < 1e-12, "the laser's direction lies in its sheet"
    assert float(left.distance(rig.T_camera_table.translation)) == pytest.approx(-3)
    assert left.source is not None
    assert right.source is None
    assert float(left.distance(left.source)) == pytest.approx(0, abs=1e-9)
    lean = math.asin(right.normal @ rig.T_camera_table.rotation[:, 2])
    assert abs(math.degrees(lean)) == pytest.approx(2)


def test_its_uncertainty_is_that_of_a_ruler() -> None:
    rig = rig_from_ruler(TEXT)
    assert rig.covariance is not None
    sigma = dict(zip(rig.parameter_names, np.sqrt(np.diag(rig.covariance)), strict=True))
    assert sigma["left.offset"] == sigma["table.shift_z"] == 4
    assert math.degrees(sigma["right.turn_along"]) == pytest.approx(2)
    assert sigma["camera.fx"] == pytest.approx(0.05 * rig.camera.fx)
    again = rig_from_json(rig_to_json(rig))
    assert rig_to_json(again) == rig_to_json(rig)


@pytest.mark.parametrize("focal", ["focal_px = 666.0", "field_of_view_deg = 51.3"])
def test_other_ways_to_say_how_long_the_lens_is(focal: str) -> None:
    rig = rig_from_ruler(TEXT.replace("focal_mm = 4.0\npixel_um = 6.0", focal))
    assert rig.camera.fx == pytest.approx(666, rel=2e-3)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("width = 640", "", "camera.width"),
        ("width = 640", "width = 0", "camera.width"),
        ("width = 640", "width = 640\nwidth = 640", "not TOML"),
        ("pixel_um = 6.0", "", "focal_px"),
        ("pixel_um = 6.0", "pixel_um = 6.0\nfocal_px = 600.0", "focal_px"),
        ("tilt_deg = 20", "tilt_deg = 95", "camera.tilt_deg"),
        ("tilt_deg = 20", "tilt_deg = nan", "camera.tilt_deg"),
        ("tilt_deg = 20", "tilt = 20", "camera.tilt"),
        ('name = "right"', 'name = "left"', "same name"),
        ("angle_deg = -28", 'angle_deg = "a"', "laser.0.angle_deg"),
        ("length_mm = 4", "length_mm = 0", "uncertainty.length_mm"),
    ],
)
def test_what_cannot_be_is_one_line_that_names_the_key(old: str, new: str, says: str) -> None:
    with pytest.raises(FormatError, match=says) as caught:
        rig_from_ruler(TEXT.replace(old, new, 1), "my.toml")
    assert str(caught.value).startswith("my.toml: ")
    assert "\n" not in str(caught.value)


def test_a_rig_that_is_not_complete_is_no_rig_to_scan_with(tmp_path: Path) -> None:
    path = tmp_path / "half.toml"
    path.write_text(TEXT[: TEXT.index("[[laser]]")])
    assert read_rig_file(path, partial=True).lacking == ("a laser sheet",)
    with pytest.raises(InputError, match="a laser sheet of this rig is not calibrated yet"):
        read_rig_file(path)
