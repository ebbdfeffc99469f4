"""One laser and a part in two poses: a rig is refined through the verb, from scans."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.calibrate.bodies import both, doubted, sphere
from turnscan.arrays import Floats
from turnscan.rig import Rig
from turnscan.scan import Scan, rig_for
from turnscan.shapes import fit_sphere
from turnscan.workflows import refine, simulate

TURN = np.radians(np.arange(0.0, 360.0, 9.0))


def roundness(true: Rig, rig: Rig) -> float:
    """mm, of 95 % of a ball that the true rig would see."""
    seen = both(true, sphere((10.0, -8.0, 23.0), 18.0), TURN, TURN, 5, noise=0.0, every=6)
    at: Floats = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in seen])
    ball = fit_sphere(at)
    off = np.abs(np.linalg.norm(at - ball.centre, axis=1) - ball.radius)
    return float(2 * np.quantile(off, 0.95))


def test_a_rig_whose_surfaces_agree_nowhere_is_refined_by_two_poses(tmp_path: Path) -> None:
    """Every number is wrong by 1 mm or 0.5°: as exact surfaces the two scans fit nowhere."""
    paths = [tmp_path / f"{name}.turnscan" for name in ("up", "tipped")]
    for path, tip in zip(paths, (None, 35.0), strict=True):
        simulate("head", path, lasers=1, steps=48, tip_deg=tip)
    with Scan.open(paths[0]) as scan:
        true = replace(rig_for(scan, None), covariance=None)
    known = doubted(true, 1.0, 0.5)
    assert known.covariance is not None
    sign = np.random.default_rng(1).choice([-1.0, 1.0], len(known.covariance))
    wrong = known.perturbed(sign * np.sqrt(np.diag(known.covariance)))
    wrong = replace(wrong, covariance=known.covariance)
    done = refine(paths, tmp_path / "rig.json", rig=wrong).refined
    assert roundness(true, wrong) > 1.0
    # Noise of the stripes leaves some of it: none would be a comparison with itself.
    assert 0.003 < roundness(true, done.rig) < 0.1
    assert done.gap_after < 1.2 * done.gap_noise
    assert math.isfinite(done.gap_before)
