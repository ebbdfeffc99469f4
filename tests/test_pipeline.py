"""The whole story: frames in a scan file → a part with the right size."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic import box, full_turn, make_rig, scan_shape
from turnscan.errors import InputError
from turnscan.pipeline import Settings, reconstruct
from turnscan.points import Volume
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.stripes import StripeSettings
from turnscan.surface import Caps, is_closed

STEPS = 40
LASERS = (0.45, -0.45)


@pytest.fixture(scope="module")
def rig():
    return make_rig(elevation=0.35, lift=20.0, lasers=LASERS)


@pytest.fixture(scope="module")
def scan_path(rig, tmp_path_factory):
    """A box, two lasers, frames with noise and a bright line on a wall behind, in colour."""
    path = tmp_path_factory.mktemp("scan") / "box.turnscan"
    plan = ScanPlan(320, 240, "uint8", 3, ("L0", "L1"), STEPS, 12.0, weights=(-0.2, 1.0, -0.2))
    rng = np.random.default_rng(0)
    u = np.arange(320)
    angles = full_turn(STEPS)
    with Scan.create(path, plan, rig) as scan:
        for laser in plan.lasers:
            shape = box((25, 18, 20), (3, 2, 20), 0.3)
            for k, stripe in enumerate(scan_shape(rig, shape, angles, laser)):
                if (laser, k) == ("L1", 7):
                    scan.add_missing(k, laser, "the picture is damaged")
                    continue
                at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
                light = 150 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)
                wall = 10.0 if laser == "L0" else 309.0
                light += 200 * np.exp(-0.5 * ((u - wall) / 2.0) ** 2)
                dark = rng.normal(12, 1.2, (240, 320, 3))
                lit = rng.normal(12, 1.2, (240, 320, 3))
                lit[..., 1] += light
                as_u8 = [np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (lit, dark)]
                scan.add(Frame(k, laser, *as_u8, commanded=float(angles[k])))
    return path


def test_a_box_comes_out_of_its_pictures(scan_path):
    ticks = []
    with Scan.open(scan_path) as scan:
        done = reconstruct(scan, settings=Settings(caps=Caps()), tick=lambda: ticks.append(1))
        again = reconstruct(scan, settings=Settings(caps=Caps()))
    assert len(ticks) == 2 * STEPS - 1
    assert done.mesh.vertices.tobytes() == again.mesh.vertices.tobytes(), "threads change nothing"
    assert done.mesh.faces.tobytes() == again.mesh.faces.tobytes()
    assert [g.laser for g in done.grids] == ["L0", "L1"]
    assert len(done.grids[1].steps) == STEPS - 1
    c, s = np.cos(0.3), np.sin(0.3)
    for grid in done.grids:
        Q = (grid.points[grid.found] - (3, 2, 20)) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        off = (np.abs(Q) / (25, 18, 20) - 1) * (25, 18, 20)
        away = off.max(axis=1)
        assert np.quantile(np.abs(away), 0.95) < 0.25
        sigma = grid.sigma[grid.found]
        assert 0.4 < np.median(np.abs(away)) / (0.6745 * np.median(sigma)) < 1.6
    codes = [f.code for f in done.findings]
    assert "points.missing-frames" in codes
    assert not [f for f in done.findings if f.severity == "error"]


def test_choices_of_the_user_are_obeyed(scan_path, rig):
    low = Settings(volume=Volume(60, 5, 25), every=2, spacing=2.0)
    with Scan.open(scan_path) as scan:
        done = reconstruct(scan, rig, low)
        assert len(done.grids[0].steps) == STEPS // 2
        z = done.mesh.vertices[:, 2]
        assert z.min() >= 5
        assert z.max() <= 25
        assert np.allclose(z / 2, np.round(z / 2))
        assert not is_closed(done.mesh)
        nothing = reconstruct(scan, rig, Settings(stripes=StripeSettings(threshold=250.0)))
    assert [f.code for f in nothing.findings if f.severity == "error"] == [
        "points.none",
        "points.none",
        "surface.none",
    ]


def test_a_rig_that_does_not_fit_is_refused(scan_path, tmp_path):
    with Scan.open(scan_path) as scan:
        with pytest.raises(InputError, match="no laser L1"):
            reconstruct(scan, make_rig())
        with pytest.raises(InputError, match="pictures of 320 × 240"):
            reconstruct(scan, make_rig(lasers=LASERS, size=(640, 240)))
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), 1, 12.0)
    with Scan.create(tmp_path / "bare.turnscan", plan) as bare:
        bare.add(Frame(0, "L0", np.zeros((240, 320), np.uint8)))
        with pytest.raises(InputError, match="no rig"):
            reconstruct(bare)
        with pytest.raises(InputError, match="table angle"):
            reconstruct(bare, make_rig())
