"""The rig file: the same rig back to the bit, and every bad text refused by name."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from turnscan.errors import FormatError, LimitExceeded
from turnscan.rig import (
    Camera,
    LaserSheet,
    Marker,
    Pose,
    Rig,
    Wobble,
    design_preset,
    rig_from_json,
    rig_hash,
    rig_to_json,
    rotation_from_vector,
)

number = st.floats(-1e6, 1e6)
positive = st.floats(1e-3, 1e6)


def _vector(n: int, elements: Any = number) -> Any:
    return hnp.arrays(float, n, elements=elements)


cameras = st.builds(
    Camera,
    st.integers(1, 100_000),
    st.integers(1, 100_000),
    positive,
    positive,
    number,
    number,
    _vector(5),
    _vector(2),
)
normals = _vector(3, st.floats(-1, 1)).filter(lambda n: np.linalg.norm(n) > 1e-6)
sheets = st.builds(
    LaserSheet,
    st.text(min_size=1, max_size=20),
    normals,
    _vector(3),
    _vector(3),
    st.none() | _vector(3),
)
poses = st.builds(
    lambda r, t: Pose(rotation_from_vector(r), t), _vector(3, st.floats(-3, 3)), _vector(3)
)
markers = st.builds(
    Marker, st.text(max_size=20), st.integers(0, 999), hnp.arrays(float, (4, 3), elements=number)
)


@st.composite
def rigs(draw: Any) -> Rig:
    lasers = tuple(draw(st.lists(sheets, max_size=3, unique_by=lambda s: s.name)))
    rig = Rig(draw(cameras), lasers, draw(poses), tuple(draw(st.lists(markers, max_size=2))))
    rig = replace(rig, wobble=draw(st.none() | st.builds(Wobble.of, _vector(6))))
    if draw(st.booleans()):
        p = len(rig.parameter_names)
        values = np.random.default_rng(draw(st.integers(0, 9))).normal(size=(p, p))
        rig = replace(rig, covariance=values @ values.T)
    return rig


def _bits(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, float):
        return np.float64(value).tobytes()
    if isinstance(value, tuple):
        return tuple(_bits(v) for v in value)
    if hasattr(value, "__dataclass_fields__"):
        return tuple(_bits(getattr(value, name)) for name in value.__dataclass_fields__)
    return value


@given(rigs())
@settings(max_examples=60)
def test_a_rig_survives_its_file_to_the_bit(rig: Rig) -> None:
    text = rig_to_json(rig)
    back = rig_from_json(text)
    assert _bits(back) == _bits(rig)
    assert rig_to_json(back) == text
    assert rig_hash(back) == rig_hash(rig)


def test_a_rig_that_does_not_say_where_its_lasers_are_keeps_the_text_of_before() -> None:
    text = rig_to_json(design_preset("paper").rig(both=True))
    assert "source" not in text
    assert rig_from_json(text).sheets[0].source is None


def test_a_rig_without_a_motion_of_its_axis_keeps_the_text_of_before() -> None:
    rig = design_preset("paper").rig(both=True)
    text = rig_to_json(rig)
    assert "wobble" not in text
    assert rig_from_json(text).wobble is None
    assert not any("wobble" in name for name in rig.parameter_names)


@pytest.mark.parametrize(
    ("key", "value"), [("tilt", [0.0]), ("rise", [0.0, None]), ("lean", [0, 0])]
)
def test_a_motion_of_the_axis_that_is_none_is_refused_by_name(key: str, value: list[Any]) -> None:
    body = _good()
    body["wobble"] = {"tilt": [0.0, 0.0], "shift": [0.1, 0.0], "rise": [0.0, 0.0], key: value}
    with pytest.raises(FormatError, match=f"wobble.{key}"):
        rig_from_json(json.dumps(body))


def _good() -> dict[str, Any]:
    rig = design_preset("paper").rig(both=True)
    body: dict[str, Any] = json.loads(rig_to_json(rig))
    return body


def _set(*path: Any) -> Callable[[dict[str, Any]], None]:
    *keys, last, value = path

    def change(body: dict[str, Any]) -> None:
        at: Any = body
        for key in keys:
            at = at[key]
        at[last] = value

    return change


def _drop(key: str) -> Callable[[dict[str, Any]], None]:
    return lambda body: body.pop(key)


BAD: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (_drop("camera"), "camera"),
    (_drop("unit"), "unit"),
    (_drop("T_camera_table"), "T_camera_table"),
    (_set("unit", "inch"), "unit"),
    (_set("version", 2), "version"),
    (_set("format", "turnscan-scan"), "format"),
    (_set("colour", "red"), "colour"),
    (_set("camera", "zoom", 2), "camera.zoom"),
    (_set("camera", "fx", "1136"), "camera.fx"),
    (_set("camera", "fx", None), "camera.fx"),
    (_set("camera", "fx", True), "camera.fx"),
    (_set("camera", "fx", -3.0), "fx"),
    (_set("camera", "width", 640.5), "camera.width"),
    (_set("camera", "width", 0), "width"),
    (_set("camera", "distortion", [0, 0, 0]), "camera.distortion"),
    (_set("camera", "distortion", 3, [1]), "camera.distortion.3"),
    (_set("sheets", 0, "normal", [0, 0, 0]), "normal"),
    (_set("sheets", 1, "name", ""), "sheets.1.name"),
    (_set("sheets", 1, "name", "right"), "same name"),
    (_set("sheets", {}), "sheets"),
    (_set("T_camera_table", "rotation", 0, [2, 0, 0]), "rotation"),
    (_set("T_camera_table", "translation", [1, 2]), "T_camera_table.translation"),
    (_set("markers", [{"dictionary": "D", "number": 1, "corners": [[0, 0, 0]]}]), "markers.0"),
    (_set("covariance", [[1.0, 0.0], [0.0]]), "covariance"),
    (_set("covariance", [[1.0, 0.0], [0.0, 1.0]]), "covariance"),
    (_set("covariance", "none"), "covariance"),
]


@pytest.mark.parametrize(("change", "key"), BAD, ids=[f"{i}-{k}" for i, (_, k) in enumerate(BAD)])
def test_a_bad_key_is_named(change: Callable[[dict[str, Any]], Any], key: str) -> None:
    body = _good()
    change(body)
    with pytest.raises(FormatError) as wrong:
        rig_from_json(json.dumps(body), "bench.json")
    line = str(wrong.value)
    assert line.startswith("bench.json: ")
    assert key in line
    assert "\n" not in line
    assert len(line) < 400


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
def test_numbers_that_are_none(value: str) -> None:
    text = json.dumps(_good()).replace('"fx": 1136.3636363636365', f'"fx": {value}')
    assert value in text
    with pytest.raises(FormatError, match=r"fx|NaN|Infinity"):
        rig_from_json(text)


def test_a_key_that_stands_twice() -> None:
    text = rig_to_json(design_preset("paper").rig()).replace('"unit"', '"version": 1, "unit"')
    with pytest.raises(FormatError, match="'version' is given twice"):
        rig_from_json(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "3",
        "{} {}",
        "\x00",
        "\ufeff{}",
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"format": "\ud800"}',
        '{"version": ' + "9" * 10_000 + "}",
    ],
    ids=lambda t: repr(t[:12]),
)
def test_texts_that_are_no_rig(text: str) -> None:
    with pytest.raises(FormatError) as wrong:
        rig_from_json(text, "bench.json")
    assert "\n" not in str(wrong.value)
    assert wrong.value.exit_code == 2


def test_a_huge_text_is_refused_unread() -> None:
    with pytest.raises(LimitExceeded, match="characters"):
        rig_from_json(" " * (16 * 2**20 + 1))


@given(st.text(max_size=60) | st.binary(max_size=60).map(lambda b: b.decode("latin-1")))
@settings(max_examples=200)
def test_any_text_is_refused_politely(text: str) -> None:
    with pytest.raises(FormatError):
        rig_from_json(text)


@given(st.integers(0, 2000), st.sampled_from(list('{}[]",:e-9')))
@settings(max_examples=200)
def test_one_wrong_character_is_a_rig_or_a_named_error(where: int, character: str) -> None:
    text = rig_to_json(design_preset("paper").rig())
    where %= len(text)
    broken = text[:where] + character + text[where + 1 :]
    try:
        rig = rig_from_json(broken)
    except FormatError:
        return
    assert rig_from_json(rig_to_json(rig)).camera.width == rig.camera.width
