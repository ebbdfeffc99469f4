"""Range scans of other scanners: what is read, and what is refused."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.points.range_scans import POINTS, cyberware
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.points import placements_from_conf, range_scan_from_ply
from turnscan.rig import rotation_about


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_range_scan_is_read(form, newline):
    scan = range_scan_from_ply(cyberware(form, newline), "a.ply", scale=1000.0)
    assert np.allclose(scan.points, POINTS * 1000.0)
    assert scan.grid.tolist() == [[0, 1, -1], [2, -1, 3]]
    grid = scan.range_grid()
    assert grid.points.shape == (3, 2, 3)
    assert np.array_equal(grid.points[1, 0], scan.points[1])
    assert not grid.found[2, 0]
    assert grid.found.sum() == 4
    assert not grid.closed


def test_plain_points_and_triangles_are_read():
    head = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
    head += b"property double z\nproperty float confidence\n"
    body = b"0 0 0 1\n1 0 0 1\n0 1 0 1\n"
    loose = range_scan_from_ply(head + b"end_header\n" + body)
    assert loose.grid is None
    assert loose.faces is None
    with pytest.raises(FormatError, match="not ordered in a grid"):
        loose.range_grid()
    face = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    assert range_scan_from_ply(head + face + body + b"3 0 1 2\n").faces.tolist() == [[0, 1, 2]]
    with pytest.raises(FormatError, match=r"names .0, 1, 7."):
        range_scan_from_ply(head + face + body + b"3 0 1 7\n")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: b"hello", "no PLY header"),
        (lambda d: d[:60], "no PLY header"),
        (lambda d: d[:-12], "number expected here|ends"),
        (lambda d: d.replace(b"1.0\r\n", b"2.0\r\n"), "format line"),
        (lambda d: d.replace(b"property float x", b"property quad x"), "not a property line"),
        (lambda d: d.replace(b"float z", b"float w"), "no x, y, z"),
        (lambda d: d.replace(b"num_cols 3", b"num_cols x"), "is no count"),
        (lambda d: d.replace(b"num_cols 3", b"num_cols 4"), "range_grid is not 2 × 4"),
        (lambda d: d.replace(b"obj_info num_rows 2\r\n", b""), "without num_rows"),
        (lambda d: d.replace(b"1 3\r\n", b"1 9\r\n"), "outside 0 to 3"),
        (lambda d: d.replace(b"2 2 0\r\n", b"2 nan 0\r\n"), "vertex 4 at .* is not finite"),
        (lambda d: d.replace(b"2 2 0\r\n", b"2 two 0\r\n"), "not the number expected"),
        (lambda d: d.replace(b"vertex 4", b"vertex 4000000"), "cannot fit"),
    ],
)
def test_a_bad_file_is_one_clear_line(change, says):
    with pytest.raises(FormatError, match=says) as e:
        range_scan_from_ply(change(cyberware()), "bad.ply")
    assert "bad.ply" in str(e.value)
    assert "\n" not in str(e.value)


def test_sizes_are_checked_before_anything_is_made():
    huge = cyberware().replace(b"num_cols 3", b"num_cols 99999999")
    huge = huge.replace(b"num_rows 2", b"num_rows 99999999")
    with pytest.raises(LimitExceeded, match="the limit"):
        range_scan_from_ply(huge)
    with pytest.raises(LimitExceeded):
        range_scan_from_ply(cyberware().replace(b"vertex 4", b"vertex 99999999999"))


@settings(max_examples=150)
@given(
    form=st.sampled_from(["ascii", "binary_little_endian"]),
    at=st.integers(0, 400),
    value=st.binary(min_size=0, max_size=6),
)
def test_no_damage_gives_anything_but_a_named_error(form, at, value):
    data = cyberware(form)
    with contextlib.suppress(InputError):
        range_scan_from_ply(data[:at] + value + data[at + len(value) :])


def test_placements_use_the_inverse_rotation():
    axis, angle = np.array([1.0, 2.0, -1.0]) / np.sqrt(6), 0.7
    q = [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]
    text = (
        f"camera 0 0 0\nbmesh a.ply 0.1 0.2 0.3 {' '.join(map(str, q))}\n\nbmesh b 0 0 0 0 0 0 1\n"
    )
    placed = placements_from_conf(text, scale=1000.0)
    assert list(placed) == ["a.ply", "b"]
    want = rotation_about(axis, angle).T @ [1.0, 2.0, 3.0] + [100.0, 200.0, 300.0]
    assert np.allclose(placed["a.ply"].apply([1.0, 2.0, 3.0]), want)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no line"),
        ("bmesh a 0 0 0 0 0 0", "line 1: expected"),
        ("bmesh a 0 0 0 0 0 0 9", "unit quaternion"),
        ("bmesh a 0 nan 0 0 0 0 1", "expected"),
        ("bmesh a 0 x 0 0 0 0 1", "could not convert"),
        ("bmesh a 0 0 0 0 0 0 1\nbmesh a 0 0 0 0 0 0 1", "a is given twice"),
    ],
)
def test_bad_placements(text, says):
    with pytest.raises(FormatError, match=says):
        placements_from_conf(text, "x.conf")


@pytest.mark.parametrize("kinds", [b"float int", b"uchar float", b"double double"])
def test_binary_lists_of_floats_are_refused(kinds):
    data = cyberware("binary_little_endian").replace(b"list uchar int", b"list " + kinds)
    with pytest.raises(FormatError, match=r"range_grid are not integers|a list we can read"):
        range_scan_from_ply(data, "a.ply")
