"""What is shown of a large scan until the whole of it is there."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from tests.analytic import cylinder, full_turn, make_rig, scan_shape
from turnscan import edit
from turnscan.errors import ScanCorrupt
from turnscan.progress import Cancelled, Progress, no_progress
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.workflows import ReconstructOptions, ScanSession
from turnscan.workflows._session import _first as _session_first
from turnscan.workflows._session._first import FirstSurface

RADIUS, HEIGHT, LINES = 25.0, 40.0, 240
LASERS = (0.4, -0.4)
"""Radians from the camera."""
STEPS = 48


def write_can(path: Path, lasers: int, *, skipped: int = 0) -> Path:
    """A can about the axis, scanned with some lasers; the first steps of each have no frame."""
    rig = make_rig(elevation=0.1, lift=20.0, lasers=LASERS[:lasers])
    names = tuple(f"L{k}" for k in range(lasers))
    u, rng, angles = np.arange(320), np.random.default_rng(3), full_turn(STEPS)
    with Scan.create(path, ScanPlan(320, LINES, "uint8", 1, names, STEPS, 12.0), rig) as scan:
        for name in names:
            (stripe,) = scan_shape(rig, cylinder(RADIUS, 0, HEIGHT), angles[:1], name)
            at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
            for k in range(skipped, STEPS):
                light = 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2)
                lit, dark = (light * n + rng.normal(12, 1.0, light.shape) for n in (1, 0))
                seen, off = (np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (lit, dark))
                scan.add(Frame(k, name, seen, off, commanded=float(angles[k])))
    return path


def first_of(path: Path, progress: Progress = no_progress) -> list[FirstSurface]:
    found: list[FirstSurface] = []
    ScanSession(path, progress, first=lambda *it: found.append(FirstSurface(*it))).close()
    return found


@pytest.mark.parametrize(("lasers", "profiles"), [(1, 96), (1, 24), (1, 20), (2, 48), (2, 14)])
def test_evenly_chosen_profiles_lie_on_the_part_all_round(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lasers: int, profiles: int
) -> None:
    monkeypatch.setattr(_session_first, "WORTH_IT", lasers * STEPS * LINES)
    monkeypatch.setattr(_session_first, "_PROFILES", profiles)
    (found,) = first_of(write_can(tmp_path / "can.turnscan", lasers))
    assert found.every == max(1, int(np.ceil(lasers * STEPS / profiles)))
    assert found.edits == 0
    at = found.arrays["positions"]
    side = at[(at[:, 2] > 3) & (at[:, 2] < HEIGHT - 3)]
    off = np.hypot(side[:, 0], side[:, 1]) - RADIUS
    assert 0.005 < np.sqrt(np.mean(off**2)) < 0.1, "mm: the noise of the pictures, and no more"
    turn = np.sort(np.arctan2(side[:, 1], side[:, 0]))
    gap = np.diff(np.append(turn, turn[0] + 2 * np.pi)).max()
    assert gap < 2 * np.pi * (found.every + 1) / STEPS
    assert found.arrays["faces"].max() < len(at)
    assert len(at) < 1.1 * LINES * min(profiles + lasers, lasers * STEPS)


def test_a_small_scan_and_one_that_shows_nothing_are_not_shown_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_can(tmp_path / "can.turnscan", 1)
    monkeypatch.setattr(_session_first, "WORTH_IT", STEPS * LINES + 1)
    assert first_of(path) == []
    monkeypatch.setattr(_session_first, "WORTH_IT", 0)
    assert len(first_of(path)) == 1
    empty = write_can(tmp_path / "empty.turnscan", 1, skipped=STEPS - 1)
    assert first_of(empty) == []


def test_how_many_repairs_are_not_in_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_session_first, "WORTH_IT", 0)
    path = write_can(tmp_path / "can.turnscan", 1)
    made: list[edit.Edit] = [
        edit.ProfileOff("L0", (3, 9)),
        edit.ChangeSettings(asdict(ReconstructOptions(every=2))),
        edit.MeasureDistance((25.0, 0.0, 9.0), (25.0, 0.0, 30.0)),
        edit.Despike(beyond=5.0),
    ]
    with Scan.resume(path) as scan:
        for k, one in enumerate(made, 1):
            scan.append_edit(edit.action_to_json(edit.Add(k, one)), time.time())
    (found,) = first_of(path)
    assert found.edits == 2, "the settings are in it, and a measurement changes nothing"


def test_it_is_cancelled_like_the_rest_and_hides_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_session_first, "WORTH_IT", 0)
    path = write_can(tmp_path / "can.turnscan", 1)
    with pytest.raises(Cancelled):
        first_of(path, Progress(cancelled=lambda: True))

    def torn(*_: object, **__: object) -> Callable[[], None]:
        raise ScanCorrupt("a frame is damaged")

    monkeypatch.setattr(_session_first, "to_grids", torn)
    assert first_of(path) == []
