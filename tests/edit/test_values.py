"""Edits as JSON: what is written is read again, what is strange is named, what is told is true."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.edit.surfaces import sheet
from turnscan import edit
from turnscan.edit import (
    Add,
    Body,
    Edit,
    History,
    Region,
    action_from_json,
    action_to_json,
    describe,
    edit_from_json,
    edit_from_value,
    edit_to_value,
    history_from_json,
    history_from_log,
    history_to_json,
)
from turnscan.errors import FormatError, InputError, LimitExceeded, ScanNewer

REGION = Region.of(Body.of(sheet(6)), np.arange(7))
SAMPLES: list[Edit] = [
    edit.ChangeSettings({"every": 2, "denoise": 2.0, "close": True, "radius": None}, "fine"),
    edit.KeepSet("fine", {"every": 2}),
    edit.RenameSet("fine", "finer"),
    edit.DeleteSet("finer"),
    edit.DeletePoints("left", 3, (1, 2, 5)),
    edit.SetPoint("left", 3, 1, 17.25),
    edit.PickCandidate("left", 3, (4, 9), 133.5),
    edit.ProfileOff("left", (3, 3)),
    edit.Redetect("left", (1, 2), (0, 479), 12.0, "gauss3", "first"),
    edit.CloseSeam("left"),
    edit.Delete(REGION),
    edit.Fill((edit.HoleName((1.0, 2.0, 3.0), 4.0),), "curvature", 9.0),
    edit.BridgeSides((0.0, 0.0, 1.0), (5.0, 0.0, 1.0)),
    edit.BridgeHoles(edit.HoleName((1.0, 2.0, 3.0), 4.0), edit.HoleName((1.0, 2.0, 9.0), 4.0)),
    edit.Close(None, 3.0, "open", "fan", None, 2.0),
    edit.Cut((0.0, 0.6, 0.8), -3.5, False),
    edit.Decimate(0.05, 4000),
    edit.Smooth(REGION, 3, 0.5),
    edit.Despike(REGION, 4.0, "flat"),
    edit.RemovePieces(100),
    edit.MeasureDistance((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    edit.MeasureToPlane((0.0, 0.0, 0.0), REGION),
    edit.MeasureDiameter(REGION),
    edit.MeasureSection((0.0, 0.0, 1.0), 5.0, (1.0, 2.0, 3.0)),
    edit.MeasureAngle(REGION, REGION),
    edit.MeasureCorner((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    edit.MeasureArea(None),
    edit.MeasureVolume(),
    edit.Specify(3, "bore", 24.0, -0.05, 0.05),
]


def test_there_is_a_sample_of_every_kind() -> None:
    assert {type(s) for s in SAMPLES} == set(get_args(Edit))


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.kind)
def test_every_edit_survives_json_and_is_told_in_words_and_in_the_reference(sample: Edit) -> None:
    text = json.dumps(edit_to_value(sample))
    assert edit_from_json(text) == sample
    assert action_from_json(action_to_json(Add(4, sample))) == Add(4, sample)
    assert 5 < len(describe(sample)) < 100
    page = (Path(__file__).parents[2] / "docs/reference/edits.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith(f"| `{sample.kind}` |"))
    for f in fields(sample):
        assert f.name == "kind" or f"`{f.name}`" in row, f.name


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "not an object"),
        ("{", "Expecting"),
        ("{}", "kind"),
        ('{"kind":"explode"}', "explode"),
        ('{"kind":"cut","normal":[0,0,1],"distance":1,"distance":2}', "is given twice"),
        ('{"kind":"cut","normal":[0,0,0],"distance":1}', "needs a direction"),
        ('{"kind":"cut","normal":[0,0,1e400],"distance":1}', "cut.normal"),
        ('{"kind":"cut","normal":[0,1],"distance":1}', "cut.normal.2"),
        ('{"kind":"cut","normal":[0,0,1],"distance":1,"cap":"maybe"}', "cut.cap"),
        ('{"kind":"cut","normal":[0,0,1],"distance":Infinity}', "Infinity is not a number"),
        ('{"kind":"decimate"}', "give a tolerance or a face count"),
        ('{"kind":"decimate","faces":2}', "decimate.faces"),
        ('{"kind":"fill","how":"magic"}', "fill.how"),
        ('{"kind":"fill","holes":[]}', "fill.holes"),
        ('{"kind":"profile_off","laser":"","steps":[0,1]}', "profile_off.laser"),
        ('{"kind":"profile_off","laser":"a","steps":[0,-1]}', "profile_off.steps.1"),
        ('{"kind":"profile_off","laser":"a","steps":[0,1],"x":1}', "profile_off.x"),
        ('{"kind":"redetect","laser":"a","steps":[0,1],"lines":[0,1],"choose":"best"}', "choose"),
        ('{"kind":"set_point","laser":"a","step":1,"line":1}', "set_point.position"),
    ],
)
def test_what_is_strange_is_named(text: str, words: str) -> None:
    with pytest.raises(FormatError, match=r"^my edit: ") as caught:
        edit_from_json(text, "my edit")
    assert words in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_region_must_be_whole() -> None:
    good = edit_to_value(edit.Delete(REGION))
    for change, words in (
        ({"faces": [1, 2, 3]}, "not pairs"),
        ({"faces": [1, -2]}, "faces.1"),
        ({"mesh": ""}, "mesh"),
        ({"place": {**good["where"]["place"], "inside": [1, 2]}}, "not triples"),
        ({"place": {**good["where"]["place"], "spacing": 0.0}}, "spacing"),
        ({"place": {**good["where"]["place"], "spacing": float("nan")}}, "spacing"),
        ({"place": {**good["where"]["place"], "inside": [1] * 60003}}, "60000"),
    ):
        with pytest.raises(FormatError, match="where") as caught:
            edit_from_value({**good, "where": {**good["where"], **change}})
        assert words in str(caught.value)
    assert edit_from_value({"kind": "delete", "where": REGION}) == edit.Delete(REGION)


def test_a_text_too_long_or_too_deep_is_not_looked_at() -> None:
    with pytest.raises(LimitExceeded, match="characters"):
        edit_from_json(" " * (16 << 20) + "{}")
    with pytest.raises(LimitExceeded, match="nested"):
        edit_from_json("[" * 40 + "]" * 40)


@given(st.text(max_size=40) | st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(["kind", "do", "version", "id", "edit", "on", "cursor", "format", "edits"]),
        inner, max_size=4),
).map(json.dumps))  # fmt: skip
def test_anything_at_all_is_read_or_refused_by_name(text: str) -> None:
    for read in (edit_from_json, action_from_json, history_from_json):
        with suppress(InputError, ScanNewer):
            read(text)


def test_histories_and_logs() -> None:
    history = History()
    log = []
    for sample in SAMPLES:
        action = history.add(sample)
        log.append(action_to_json(action))
        history = history.after(action)
    for action in (history.switch(3, False), history.undo()):
        log.append(action_to_json(action))
        history = history.after(action)
    assert history_from_log(log) == history
    done = history_from_json(history_to_json(history))
    assert done.entries == history.entries[:-1]
    assert done.enabled == history.enabled
    with pytest.raises(FormatError, match="entry 2 of the log: edit 1 is in the history already"):
        history_from_log([log[0], log[0]])
    with pytest.raises(FormatError, match="entry 1 of the log: there are 0 edits"):
        history_from_log(['{"version":1,"do":"go","cursor":2}'])
    with pytest.raises(FormatError, match="there is no edit 5"):
        history_from_log(['{"version":1,"do":"switch","id":5,"on":true}'])
    with pytest.raises(ScanNewer, match="version 5"):
        history_from_log(['{"version":5,"do":"go","cursor":0}'])
    with pytest.raises(FormatError, match="version"):
        history_from_log(['{"do":"go","cursor":0}'])


def test_undo_and_redo_pass_over_what_is_switched_off() -> None:
    history = History()
    for sample in SAMPLES[:3]:
        history = history.after(history.add(sample))
    history = history.after(history.switch(3, False))
    undone = history.after(history.undo())
    assert [e.id for e in undone.enabled] == [1]
    assert [e.id for e in undone.after(undone.redo()).enabled] == [1, 2]
    with pytest.raises(InputError, match="nothing to redo"):
        undone.after(undone.redo()).redo()
