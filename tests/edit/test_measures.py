"""Measurements are entries of the history: they change nothing, and are taken anew on a re-scan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.shapes.tubes import NOISE, cylinder, noisy, wall_of
from turnscan.edit import (
    Cut,
    Delete,
    Document,
    MeasureAngle,
    MeasureArea,
    MeasureCorner,
    MeasureDiameter,
    MeasureDistance,
    MeasureSection,
    MeasureToPlane,
    MeasureVolume,
    Region,
    Specify,
    action_to_json,
    describe,
    history_from_log,
)
from turnscan.mesh import Mesh, Provenance
from turnscan.shapes import Spot
from turnscan.workflows._session._measures import Renewed, measures_of


def session(seed: int) -> tuple[Document, list[str]]:
    """A cylinder, measured in every way there is."""
    mesh = noisy(cylinder(10.0, 30.0), np.random.default_rng(seed))
    document = Document.open(lambda *_: (mesh, ()))
    n = len(mesh.vertices)
    wall = Region.of(document.body, np.flatnonzero(wall_of(mesh)))
    ends = [np.flatnonzero((mesh.faces == k).any(axis=1)) for k in (n - 1, n - 2)]
    top, bottom = (Region.of(document.body, faces) for faces in ends)
    log = []
    for edit in (
        MeasureDiameter(wall),
        MeasureSection((0.0, 0.0, 1.0), 12.2),
        MeasureDistance((10.0, 0.0, 0.0), (10.0, 0.0, 30.0)),
        MeasureToPlane((0.0, 0.0, 0.0), top),
        MeasureAngle(top, bottom),
        MeasureCorner((10.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 10.0, 0.0)),
        MeasureArea(wall),
        MeasureArea(),
        MeasureVolume(),
        Cut((0.0, 0.0, 1.0), 15.0),
        MeasureVolume(),
    ):
        document, change = document.add(edit)
        assert change.findings == ()
        assert (change.patches == ()) == edit.kind.startswith("measure")
        log.append(action_to_json(change.action))
    return document, log


def test_every_measurement_is_near_the_truth_here_and_on_another_scan() -> None:
    document, log = session(0)
    other = noisy(cylinder(10.0, 30.0, n=44, m=17), np.random.default_rng(9))
    replayed = Document.open(lambda *_: (other, ()), history_from_log(log))
    assert [f for f in replayed.findings if f.code.startswith("edit.")] == []
    side = 2 * np.pi * 10 * 30
    truth = [20, 20, 30, -30, np.pi, np.pi / 2, side, side + 2 * np.pi * 100]
    truth += [np.pi * 3000, np.pi * 1500]
    for done in (document, replayed):
        values = [m.value for _, m in done.measured]
        assert values == pytest.approx(truth, rel=0.02, abs=4 * NOISE)
        assert all(np.isfinite(m.sigma) for _, m in done.measured[:7])
        for (_, m), wanted in list(zip(done.measured, truth, strict=True))[:6]:
            assert abs(m.value - wanted) < 6 * m.sigma
    assert all(describe(entry.edit).startswith("measure") for entry, _ in document.measured)


def placed(turn_deg: float, shift: float, seed: int) -> Mesh:
    """The cylinder turned about x at the middle of its top, and shifted along x."""
    mesh = noisy(cylinder(10.0, 30.0, n=44, m=17), np.random.default_rng(seed))
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    top = np.array([0.0, 0.0, 30.0])
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return replace(mesh, vertices=(mesh.vertices - top) @ turn.T + top + [shift, 0.0, 0.0])


@pytest.mark.parametrize(
    ("turn", "shift", "doubtful"),
    [(0.0, 0.0, set()), (4.0, 0.5, set()), (0.0, 7.0, {1, 6, 7}), (35.0, 0.0, {1, 5, 7})],
)
def test_a_measurement_says_where_another_surface_is_not_that_of_the_part(
    turn: float, shift: float, doubtful: set[int]
) -> None:
    _, log = session(0)
    other = placed(turn, shift, 9)
    replayed = Document.open(lambda *_: (other, ()), history_from_log(log))
    assert set(replayed.doubts) == doubtful
    said = [f for f in replayed.findings if f.code == "edit.misfit"]
    assert bool(said) == bool(doubtful)
    assert all(f.severity == "warning" and f.remedy for f in said)
    uncut, _ = replayed.switch(10, False)
    limited, _ = uncut.add(Specify(1, "diameter", 20.0, -9.0, 9.0))
    known = Renewed(shared={1: 0.0})
    diameter = next(m for m in measures_of(limited, known) if m.edit == 1)
    assert diameter.verdict == ("undecided" if doubtful else "pass")
    assert bool(diameter.doubt) == bool(doubtful)


def test_they_follow_undo_and_their_place_in_the_history() -> None:
    document, _ = session(1)
    before = document.body.digest()
    whole, half = (m.value for e, m in document.measured if e.edit.kind == "measure_volume")
    assert half == pytest.approx(whole / 2, rel=0.01)
    undone, _ = document.undo()
    assert len(undone.measured) == 9
    assert undone.body.digest() == before
    uncut, _ = document.switch(10, False)
    assert [m.value for e, m in uncut.measured if e.edit.kind == "measure_volume"] == [whole] * 2


def test_they_are_taken_again_on_the_surface_that_was_edited_since() -> None:
    document, _ = session(1)
    (whole, then), (_, now) = (
        (e, m) for e, m in document.measured if e.edit.kind == "measure_volume"
    )
    assert document.outdated(whole.id)
    assert document.retaken(whole).value == now.value != then.value
    last, _ = document.measured[-1]
    assert not document.outdated(last.id)
    before, _ = document.switch(10, False)
    assert not before.outdated(whole.id)


def test_a_dimension_changes_no_surface_and_is_undone_like_any_edit() -> None:
    document, _ = session(1)
    before, digest = len(document.measured), document.body.digest()
    named, change = document.add(Specify(1, "height", 30.0, -0.1, 0.1))
    assert (change.patches, change.findings) == ((), ())
    assert named.body.digest() == digest
    assert len(named.measured) == before
    assert named.undo()[0].history.enabled == document.history.enabled


def test_one_that_cannot_be_taken_is_a_remark_and_no_error() -> None:
    mesh = noisy(cylinder(10.0, 30.0), np.random.default_rng(2))
    document = Document.open(lambda *_: (mesh, ()))
    gone = Region.of(document.body, [0, 1, 2])
    document, _ = document.add(Delete(gone))
    for edit, words in (
        (MeasureVolume(), "the surface is open"),
        (MeasureArea(gone), "its region no longer exists"),
        (MeasureDistance((10.0, 0.0, 5.0), (0.0, 0.0, 99.0)), "69.0 mm away"),
        (MeasureSection((0.0, 0.0, 1.0), 99.0), "does not meet"),
    ):
        after, change = document.add(edit)
        assert [(f.code, f.severity) for f in change.findings] == [("edit.refused", "warning")]
        assert words in change.findings[0].message
        assert after.measured == ()


def test_a_picked_point_is_as_sure_as_the_vertex_beside_it() -> None:
    """One sure corner at the foot, one unsure at the top; what is picked takes its own."""
    mesh = cylinder(10.0, 30.0)
    sigma = np.full(len(mesh.vertices), 0.05)
    foot, top = 0, len(mesh.vertices) - 3
    sigma[[foot, top]] = 0.01, 0.4
    zero = np.zeros(len(sigma), np.int32)
    known = replace(mesh, provenance=Provenance(sigma, zero, zero, zero, ("left",)))
    document = Document.open(lambda *_: (known, ()))
    own = {foot: 0.01, top: 0.4, 200: 0.05, 300: 0.05}
    for ends in ((foot, top), (foot, 200), (200, 300)):
        places = known.vertices[list(ends)]
        a, b = (tuple(float(x) for x in place) for place in places)
        document, _ = document.add(MeasureDistance(a, b))  # type: ignore[arg-type]
        along = np.diff(places, axis=0)[0] / np.linalg.norm(np.diff(places, axis=0))
        across = [Spot.on(known, k, known.vertices[k]).across for k in ends]
        shares = [along @ directions @ along for directions in across]
        parts = [own[k] ** 2 * share for k, share in zip(ends, shares, strict=True)]
        assert document.measured[-1][1].sigma == pytest.approx(np.sqrt(sum(parts)))
        assert max(shares) > 0.1
