"""A scan on a table whose axis moves in a turn, from its pictures to the surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.analytic import sphere
from tests.workflows.scans import CAN_RIG, STEPS, write_can
from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.progress import no_progress
from turnscan.rig import Pose, Rig, Wobble
from turnscan.scan import Frame, Scan
from turnscan.workflows import ReconstructResult, reconstruct
from turnscan.workflows._surface import _texture

MOVES = Wobble(np.array([6e-3, -4e-3]), np.array([0.5, 0.3]), np.array([0.3, -0.2]))
BALL = sphere(18.0, (9.0, 4.0, 22.0))


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball beside the axis, whose file says nothing of how the axis moved."""
    true = replace(CAN_RIG, wobble=MOVES)
    return write_can(tmp_path_factory.mktemp("wobble") / "ball.turnscan", CAN_RIG, true, BALL)


def _round(result: ReconstructResult) -> tuple[float, float]:
    """Radius and rms from the ball that fits best, mm."""
    grid = result.grids[0]
    P = grid.points[grid.found]

    def off(x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(P - x[:3], axis=1) - x[3])

    fit = least_squares(off, np.array([*P.mean(axis=0), 18.0]), loss="soft_l1", f_scale=0.2)
    return float(fit.x[3]), float(np.median(np.abs(off(fit.x))))


def test_the_rig_that_knows_it_scans_a_round_ball(ball: Path) -> None:
    known: Rig = replace(CAN_RIG, wobble=MOVES)
    with_it, without = (reconstruct(ball, rig=rig) for rig in (known, CAN_RIG))
    radius, form = _round(with_it)
    # The pictures' noise: 180 grey levels, 1.5 px, 1 level of noise; 1 px is 1.3 mm.
    assert radius == pytest.approx(18.0, abs=0.05)
    assert 1e-4 < form < 0.05
    assert _round(without)[1] > max(0.1, 3 * form)
    said = [f for f in with_it.findings if f.code == "points.wobble-start"]
    assert [f"{STEPS} of {STEPS} angles" in f.message for f in said] == [True]
    assert not [f for f in without.findings if f.code == "points.wobble-start"]


def test_texture_pictures_are_where_the_axis_was(
    ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, path = replace(CAN_RIG, wobble=MOVES), tmp_path / "texture.turnscan"
    with Scan.open(ball) as scan, Scan.create(path, scan.plan, rig) as new:
        frames: list[Frame] = list(scan.frames())
        for frame in frames:
            new.add(frame)
        for frame in frames[::6]:
            new.add_texture(frame.step, frame.lit)
    seen = list[_texture.TexturePicture]()
    monkeypatch.setattr(_texture, "colours_of", lambda mesh, shots, channels: seen.extend(shots))
    with Scan.open(path) as scan:
        surface = Mesh(np.eye(3), [[0, 1, 2]])
        _texture.colours(surface, [_texture.TextureSource(scan, rig)], no_progress)
    assert len(seen) == len(frames[::6])
    for shot, frame in zip(seen, frames[::6], strict=True):
        assert frame.commanded is not None
        stands = rig.T_camera_table @ Pose(*rig.turning(frame.commanded))
        assert shot.T_camera_object.rotation == pytest.approx(stands.rotation, abs=1e-12)
        assert shot.T_camera_object.translation == pytest.approx(stands.translation, abs=1e-9)
