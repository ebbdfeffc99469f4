"""Measurements of an open scan: what their uncertainty is made of, and on another scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from tests.poses.scenes import STANDS, write_scan
from tests.workflows.scans import CAN_RIG, write_can
from turnscan.edit import MeasureDistance, Specify, edit_to_value
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.workflows import EditChanges, ScanSession, edits
from turnscan.workflows._session import _session

DELTA = 1e-3


class Nobody:
    """Who asks for an edit and never cancels it."""

    title = ""

    @property
    def progress(self) -> Progress:
        return no_progress

    def check(self) -> None: ...

    def commit(self) -> None: ...


@contextmanager
def opened(path: Path) -> Iterator[ScanSession]:
    session = ScanSession(path, no_progress)
    try:
        yield session
    finally:
        session.close()


def test_what_the_calibration_does_to_a_measurement_is_what_another_rig_measures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One cause alone: the diameter changes by what the rig that is wrong by it measures."""
    delta = DELTA * np.random.default_rng(5).normal(size=len(CAN_RIG.parameter_names))
    found = []
    for k, rig in enumerate(
        (replace(CAN_RIG, covariance=np.outer(delta, delta)), CAN_RIG.perturbed(delta))
    ):
        path = write_can(tmp_path / f"{k}.turnscan", rig)
        with opened(path) as session:
            session.measure("diameter", [(25.0, 0.0, 20.0)], {}, Nobody())
            found.append(session.now.measures[-1])
    here, there = found
    assert here.complete
    assert here.shared is not None
    assert here.noise is not None
    assert here.shared == pytest.approx(abs(there.value - here.value), rel=0.1)
    assert here.uncertainty == pytest.approx(2 * np.hypot(here.noise, here.shared))
    assert there.shared is None
    assert there.noise is not None
    assert there.uncertainty == pytest.approx(2 * there.noise)
    # A report asked for before anything was worked out has the same in it.
    sizes = Mock()
    monkeypatch.setattr(_session, "measure", sizes)
    with opened(tmp_path / "0.turnscan") as session:
        assert not session.now.measures[-1].complete
        session.save_report(tmp_path / "sizes.pdf", no_progress)
    (named,) = sizes.return_value.save_report.call_args.args[1].values
    assert named["complete"]
    assert named["uncertainty"] == pytest.approx(here.uncertainty)
    # A can fits on another one however it is turned: that is said.
    brought = edits(tmp_path / "1.turnscan", EditChanges(tmp_path / "0.turnscan", by_shape=True))
    assert any(f.code == "compare.free" for f in brought.findings), brought.findings


def test_named_measurements_follow_the_part_to_where_it_stands_in_another_scan(
    tmp_path: Path,
) -> None:
    up, lying = tmp_path / "up.turnscan", tmp_path / "lying.turnscan"
    for seed, (path, name) in enumerate(((up, "knob"), (lying, "knob lying"))):
        write_scan(path, name, seed)
    ends = np.array([[26.0, -4.0, 8.0], [24.0, 10.0, 34.0]])
    made = (
        MeasureDistance(*map(tuple, ends.tolist())),
        Specify(1, "diagonal", 30.0, -1.0, 1.0),
    )
    edits(up, EditChanges(make=tuple(json.dumps(edit_to_value(e)) for e in made)))
    edits(lying, EditChanges(make=('{"kind": "measure_volume"}',)))
    kept = edits(lying, EditChanges(source=up, by_shape=True))
    copied, said = kept.history.entries[1:]
    assert isinstance(said.edit, Specify)
    assert said.edit.measure == copied.id == 2
    assert isinstance(copied.edit, MeasureDistance)
    there = STANDS["knob lying"].apply(ends)
    # The two scans are brought together to a small part of a millimetre.
    assert np.abs(np.array([copied.edit.a, copied.edit.b]) - there).max() < 0.3
    edits(up, EditChanges(make=('{"kind": "profile_off", "laser": "L0", "steps": [3, 3]}',)))
    with pytest.raises(InputError, match="no measurement"):
        edits(lying, EditChanges(source=up, only=(3,), by_shape=True))
    assert len(edits(lying).history.entries) == 3
    # What is said of an edit that comes after it is of none.
    early = ('{"kind": "specify", "measure": 5, "name": "early"}', '{"kind": "measure_volume"}')
    edits(up, EditChanges(make=early))
    added = edits(lying, EditChanges(source=up, only=(4, 5))).history.entries[3:]
    assert [e.edit.kind for e in added] == ["measure_volume"]
