"""One laser and a part in two poses: a rig is refined through the verb, from scans."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.calibrate.bodies import Body, both, doubted, sphere, swept, two_lasers
from turnscan.arrays import Floats
from turnscan.rig import Pose, Rig, rotation_from_vector
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.shapes import fit_sphere
from turnscan.workflows import refine

TURN = np.radians(np.arange(0.0, 360.0, 9.0))


def lump(lies: Pose) -> Body:
    """Three smooth swellings, each of another size, and no side like another."""
    centres = ((0.0, 0.0, 20.0), (13.0, 4.0, 25.0), (-6.0, 11.0, 12.0))
    sizes = ((13.0, 10.0, 15.0), (9.0, 8.0, 8.0), (9.0, 11.0, 9.0))

    def outside(p: Floats) -> Floats:
        at = lies.inverse().apply(p)
        away = [
            np.exp(4.0 * (1.0 - np.linalg.norm((at - c) / s, axis=-1)))
            for c, s in zip(centres, sizes, strict=True)
        ]
        return np.asarray(-2.0 * np.log(np.sum(away, axis=0) + 1e-30))

    return outside


def write_scan(path: Path, rig: Rig, body: Body, seed: int) -> None:
    """Pictures of the stripe that the true rig sees, as bright as a wide part of a Gaussian."""
    seen = swept(rig, "right", body, TURN, TURN, seed, noise=0.1, every=1, heights=(0.5, 60.0))
    wide, high = rig.camera.width, rig.camera.height
    plan = ScanPlan(wide, high, "uint8", 1, ("right",), len(TURN), 12.0)
    dice, columns = np.random.default_rng(seed), np.arange(wide)
    with Scan.create(path, plan, rig) as scan:
        for k, angle in enumerate(TURN):
            light = dice.normal(12.0, 1.5, (high, wide))
            u, v = seen.pixels[seen.step == k].T
            light[v.astype(int)] += 180 * np.exp(-0.5 * ((columns - u[:, None]) / 1.5) ** 2)
            picture = np.clip(np.rint(light), 0, 255).astype(np.uint8)
            scan.add(Frame(k, "right", picture, None, commanded=float(angle)))


def roundness(true: Rig, rig: Rig) -> float:
    """mm, of 95 % of a ball that the true rig would see."""
    seen = both(true, sphere((10.0, -8.0, 23.0), 18.0), TURN, TURN, 5, noise=0.0, every=6)
    at: Floats = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in seen])
    ball = fit_sphere(at)
    off = np.abs(np.linalg.norm(at - ball.centre, axis=1) - ball.radius)
    return float(2 * np.quantile(off, 0.95))


def test_a_rig_whose_surfaces_agree_nowhere_is_refined_by_two_poses(tmp_path: Path) -> None:
    """Every number is wrong by 1 mm or 0.5°: as exact surfaces the two scans fit nowhere."""
    true = two_lasers(lasers=1)
    tipped = Pose(rotation_from_vector([0.5, 0.3, -0.4]), np.array([2.0, 9.0, 4.0]))
    paths = [tmp_path / f"{name}.turnscan" for name in ("up", "tipped")]
    for k, (path, lies) in enumerate(zip(paths, (Pose(), tipped), strict=True)):
        write_scan(path, true, lump(lies), k)
    known = doubted(true, 1.0, 0.5)
    assert known.covariance is not None
    sign = np.random.default_rng(1).choice([-1.0, 1.0], len(known.covariance))
    wrong = known.perturbed(sign * np.sqrt(np.diag(known.covariance)))
    wrong = replace(wrong, covariance=known.covariance)
    report = tmp_path / "report.html"
    made = refine(paths, tmp_path / "rig.json", rig=wrong, report=report)
    done = made.refined
    assert roundness(true, wrong) > 1.0
    # Noise of the stripes leaves some of it: none would be a comparison with itself.
    assert 0.003 < roundness(true, done.rig) < 0.1
    assert done.gap_after < 1.2 * done.gap_noise
    assert math.isfinite(done.gap_before)
    # Two poses say nothing of the scale, and so a known length would help most.
    assert done.advice.stage == "body"
    assert "the scale of all lengths" in done.advice.undetermined
    text = report.read_text()
    for said in (done.advice.text, "up.turnscan, tipped.turnscan", "rotation axis: shift right"):
        assert said in text, said
    assert text.count("<img") == 1
    for raw in (text, str(made)):
        assert not re.search(r"(table|right|motion|camera)\.[a-z]+", raw)
