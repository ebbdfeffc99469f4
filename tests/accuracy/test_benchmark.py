"""The accuracy benchmark on a few pictures: its truth, the theory it compares with, its rows."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from bench._exact import WINDOW_LOSS, Exact, speckle_error
from bench._page import ACCURACY, figures
from bench.accuracy import (
    COLUMNS,
    SHORT,
    Case,
    Scan,
    head,
    measure,
    scan,
    stripe_figures,
    undisturbed,
)

from turnscan import points, shapes
from turnscan.simulate import Bench, SimulationSpec, bench, seconds_of


@cache
def benched(case: Case) -> tuple[Bench, float]:
    spec = case.spec(1)
    return bench(spec), seconds_of(spec)


@cache
def scanned(case: Case) -> Scan:
    made, seconds = benched(case)
    return scan(made, seconds, case.steps)


@pytest.mark.parametrize("part", ["cylinder", "plate", "torus", "hexagon"])
def test_exact_crossings_triangulate_to_the_part(part: str) -> None:
    made, _ = benched(Case("paper", part))
    laser, body = made.beams[0].name, made.scene.bodies[0]
    assert body.part.distance is not None
    for angle in (0.0, 1.1):
        truth = Exact(made).crossings(angle, laser)
        own = truth.own
        assert own.sum() > 40
        pixels = np.stack([truth.column, truth.row.astype(float)], axis=-1)[own]
        X, _ = points.triangulate(made.rig, laser, pixels, np.ones(len(pixels)))
        at = body.T_table_part.inverse().apply(points.to_object(made.rig, X, angle))
        assert np.abs(body.part.distance(at)).max() < 0.002


def test_hidden_and_unlit_rows_have_no_crossing() -> None:
    """A hexagon's rows above its boss are empty, and no row is crossed twice by a convex side."""
    made, _ = benched(Case("paper", "hexagon"))
    truth = Exact(made).crossings(0.3, made.beams[0].name)
    top = made.rig.camera.project(made.rig.T_camera_table.apply([0.0, 0.0, 55.0]))[1]
    assert truth.row[truth.own].min() >= top - 8
    # Seen from the same height as the middle of the part, every surface point lies on one row.
    side = truth.own & (truth.row > top + 60)
    assert len(np.unique(truth.row[side])) == side.sum()


@pytest.mark.parametrize("part", ["cylinder", "plate"])
def test_paper_rig_errs_as_speckle_and_camera_must(part: str) -> None:
    """Full speckle and noise, through the detector: within 20 % of theory, above and below."""
    case = Case("paper", part, 8)
    figures = stripe_figures(scanned(case), benched(case)[0])
    assert 0.8 < figures["ratio"] < 1.2
    assert 0.8 < figures["z"] < 1.25
    assert figures["missed %"] < 5
    assert figures["gross %"] < 0.5


def test_error_is_near_the_limit_of_the_whole_line() -> None:
    """Even without the window's loss and the camera: C √(K s / (4√π)), within 20 %."""
    case = Case("paper", "cylinder", 8)
    made, done = benched(case)[0], scanned(case)
    width = np.concatenate([t.width[t.fine] for t in done.truth])
    limit = math.sqrt(float(np.mean(speckle_error(made, width) ** 2)) / WINDOW_LOSS)
    assert 0.8 < stripe_figures(done, made)["fine rms"] / limit < 1.2


@pytest.mark.parametrize("case", [Case("ciclop", "sphere", 2), Case("modern", "sphere", 1)])
def test_claimed_sigma_is_honest_where_speckle_is_coarse(case: Case) -> None:
    """Grains as large as pixels, colour interpolation and JPEG: adjacent rows share errors."""
    figures = stripe_figures(scanned(case), benched(case)[0])
    assert 0.75 < figures["z"] < 1.25
    assert figures["missed %"] < 2


def test_a_perfect_rig_reconstructs_a_sphere_within_3_micrometres() -> None:
    spec = SimulationSpec("sphere", "modern", lasers=1, perfect=True)
    made = bench(spec)
    grid = scan(made, seconds_of(spec), 3).grid
    at = grid.points[grid.found]
    body = made.scene.bodies[0]
    at = body.T_table_part.inverse().apply(at)
    # Away from the last half millimetre below the pole, where the sheet only grazes.
    at = at[at[:, 2] < 39.5]
    away = np.linalg.norm(at - (0.0, 0.0, 20.0), axis=1) - 20.0
    assert len(at) > 1000
    assert np.sqrt(np.mean(away**2)) < 0.003
    assert np.abs(away).max() < 0.02
    ball = shapes.fit_sphere(at)
    assert abs(ball.radius - 20.0) < 0.001
    assert np.linalg.norm(ball.centre - (0.0, 0.0, 20.0)) < 0.003


def test_a_thick_sheet_makes_a_round_part_smaller() -> None:
    """By 3/2 σ²/R for the whole line; the window cuts some of that off."""
    made, seconds = benched(Case("paper", "cylinder"))
    grid = scan(undisturbed(made), seconds, 4).grid
    body = made.scene.bodies[0]
    assert body.part.distance is not None
    at = body.T_table_part.inverse().apply(grid.points[grid.found])
    away = body.part.distance(at[at[:, 2] < 78])
    sigma = made.beams[0].waist / 2
    expected = -1.5 * sigma**2 / 25.0
    assert 0.6 < away.mean() / expected < 1.0
    assert away.std() < 0.1 * abs(expected)


def test_a_rig_that_is_only_planned_is_far_off() -> None:
    """What the other rows take for granted shows when it is missing."""
    row = measure(Case("paper", "sphere", 4, knowledge="uncalibrated"), 1)
    assert abs(row["size µm"]) > 200
    assert row["rms µm"] > 200


def test_rows_have_their_columns() -> None:
    row = measure(Case("paper", "plate", 6), 1)
    for name in ("bias px", "rms px", "ratio", "z", "rms µm", "C@0.2", "F@0.2", "size µm", "E_n"):
        assert np.isfinite(row[name]), name
    assert row["C@0.05"] < row["C@0.1"] < row["C@0.2"]
    assert 50 < row["F@0.2"] < 100


def test_the_page_shows_what_is_measured_now() -> None:
    """The quickest row of docs/explain/accuracy.md, anew; the others stand by the same command."""
    header, _, *rows = figures(ACCURACY, "short")
    assert header == head()[0]
    (case,) = (c for c in SHORT if c.part == "hexagon")
    assert [r.split(" | ")[:3] for r in rows] == [[f"| {c.name}", c.part, "1"] for c in SHORT]
    (page,) = (r for r in rows if "| hexagon |" in r)
    now = measure(case, 1)
    assert 20 < now["edge µm"] < 500
    for name, cell in zip(COLUMNS, page.strip("| ").split(" | ")[3:], strict=False):
        if name not in ("detect s", "all s", "GB") and cell.strip():
            shown = float(cell)
            near = pytest.approx(now[name], rel=0.03, abs=0.01)
            assert shown == near, f"{name} → python -m bench.accuracy --write"
