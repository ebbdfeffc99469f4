"""What the part of a refinement is said to be, and what is no body to refine a rig by."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from turnscan.calibrate import Balls, Part, Round
from turnscan.drawings import Solid, write_step
from turnscan.errors import FormatError, InputError
from turnscan.formats import export
from turnscan.shapes.verification import step_block_body
from turnscan.workflows import RefineOptions, refine
from turnscan.workflows._calibration._refine_body import Form, Known, body_of

HEAD = 'format = "turnscan-artefact"\nversion = 1\nname = "it"\nmeasured = "exact"\nform_mm = 0.0\n'
BAR = (
    HEAD
    + """kind = "ball-bar"
diameters_mm = [20.002, 20.004]
diameters_U_mm = 0.002
distance_mm = 80.012
distance_U_mm = 0.004
"""
)
BLOCK = HEAD + 'kind = "step-block"\nheights_mm = [5.0, 10.0]\nheights_U_mm = 0.001\n'


@pytest.mark.parametrize(
    ("text", "form", "known"),
    [
        ("sphere", Balls(), (None,)),
        ("cylinder:40", Round(), ((20.0, 0.005),)),
        ("cone", Round(conical=True), (None, None)),
        ("cone:15", Round(conical=True), (None, (math.radians(15), math.radians(0.01)))),
    ],
)
def test_a_form_is_read_with_its_size(
    text: str, form: Form, known: tuple[Known | None, ...]
) -> None:
    assert body_of(RefineOptions(body=text), None) == (form, known)


@pytest.mark.parametrize("text", ["cube", "cylinder:wide", "cone:95", "cylinder:-4", "sphere:nan"])
def test_what_is_no_form_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="not a form with its size"):
        body_of(RefineOptions(body=text), None)


def test_a_ball_bar_counts_as_it_was_measured(tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    path.write_text(BAR)
    found = body_of(RefineOptions(), path)
    assert found is not None
    assert found[0] == Balls(2)
    lengths = [one for one in found[1] if one is not None]
    assert [value for value, _ in lengths] == pytest.approx([10.001, 10.002, 80.012])
    assert [sigma for _, sigma in lengths] == pytest.approx([0.0005, 0.0005, 0.002])


def test_a_drawn_part_is_read_with_its_scale(tmp_path: Path) -> None:
    path = tmp_path / "block.stl"
    path.write_bytes(export(step_block_body((5.0, 10.0)), ".stl"))
    found = body_of(RefineOptions(sphere_sigma=0.06), path)
    assert found is not None
    assert isinstance(found[0], Part)
    # Its longest side is 60 mm.
    assert found[1][0] == pytest.approx((1.0, 0.001))
    path.write_bytes(b"solid of nothing")
    with pytest.raises((InputError, FormatError), match=r"block\.stl"):
        body_of(RefineOptions(), path)


def test_a_part_may_be_drawn_in_step(tmp_path: Path) -> None:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    path = tmp_path / "block.step"
    block = BRepPrimAPI_MakeBox(40.0, 30.0, 8.0).Shape()
    path.write_bytes(write_step(Solid(block, 0.0, 0), "block", {}))
    found = body_of(RefineOptions(sphere_sigma=0.02), path)
    assert found is not None
    form, known = found
    assert isinstance(form, Part)
    assert known[0] == pytest.approx((1.0, 0.0005))
    away, _, _ = form.nearest(np.array([[20.0, 15.0, 11.0], [-4.0, 5.0, 2.0]]), np.ones(1))
    assert away == pytest.approx([3.0, 4.0])


def test_a_drawing_without_a_surface_is_named(tmp_path: Path) -> None:
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"line\.obj: "):
        body_of(RefineOptions(), path)


def test_what_was_measured_of_the_part_is_not_replaced_by_the_rig(tmp_path: Path) -> None:
    path, scan = tmp_path / "bar.json", tmp_path / "part.turnscan"
    path.write_text(BAR)
    scan.write_bytes(b"")
    with pytest.raises(InputError, match=r"bar\.json: this file is an input"):
        refine(scan, path, artefact=path)
    assert path.read_text() == BAR


def test_a_block_and_a_part_described_twice_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "block.toml"
    path.write_text(BLOCK)
    with pytest.raises(InputError, match="lengths of a step-block do not say"):
        body_of(RefineOptions(), path)
    scan = tmp_path / "part.turnscan"
    scan.write_bytes(b"")
    with pytest.raises(InputError, match="described twice"):
        refine(scan, tmp_path / "rig.json", sphere=36.0, body="cone")
    assert not (tmp_path / "rig.json").exists()


def test_what_is_wrong_with_several_poses_is_said_before_a_scan_is_read(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("up.turnscan", "tipped.turnscan")]
    paths[0].write_bytes(b"")
    with pytest.raises(InputError, match=r"tipped\.turnscan: no such file"):
        refine(paths, tmp_path / "rig.json")
    paths[1].write_bytes(b"")
    with pytest.raises(InputError, match="2 scans, and a body of known form"):
        refine(paths, tmp_path / "rig.json", sphere=36.0)
    with pytest.raises(InputError, match="no scan"):
        refine([], tmp_path / "rig.json")
    assert not (tmp_path / "rig.json").exists()
