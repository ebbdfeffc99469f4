"""The scan file: what is kept comes back to the bit, and gives the stripe of the full frame."""

from __future__ import annotations

import math
import os
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.scan.small import PLAN, rig_of, stripe_pair, write
from turnscan.errors import InputError, ScanBusy, ScanCorrupt, ScanError, ScanNewer
from turnscan.rig import rig_to_json
from turnscan.scan import Frame, Scan, ScanPlan, replacing_scan, signal_of, statistics


def kept_mask(lit: np.ndarray, dark: np.ndarray, plan: ScanPlan) -> np.ndarray:
    """What must be kept at least: everything near a pixel that is above the threshold."""
    signal = signal_of(lit, dark, plan.weights)
    bright = signal > statistics(signal).level + plan.threshold
    axis = 1 if plan.orientation == "vertical" else 0
    out = bright.copy()
    for shift in range(1, plan.margin + 1):
        for sign in (-1, 1):
            moved = np.roll(bright, sign * shift, axis)
            edge = [slice(None)] * 2
            edge[axis] = slice(0, shift) if sign > 0 else slice(-shift, None)
            moved[tuple(edge)] = False
            out |= moved
    return out


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
@pytest.mark.parametrize("keep", ["sparse", "full"])
def test_what_is_kept_comes_back_to_the_bit(
    tmp_path: Path, dtype: str, channels: int, orientation: str, keep: str
) -> None:
    plan = ScanPlan(
        64, 48, dtype, channels, ("left",), 3, 20.0 if dtype == "uint8" else 5000.0, keep, 6,
        orientation, (1.0, -0.5, -0.5) if channels == 3 else None,
    )  # fmt: skip
    frames = write(tmp_path / "a.turnscan", plan)
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan == plan
        for frame, got in zip(frames, scan.frames(), strict=True):
            assert got.lit.dtype == frame.lit.dtype
            assert got.lit.shape == frame.lit.shape
            mask = kept_mask(frame.lit, frame.dark, plan)
            assert 0.1 < mask.mean() < 0.7
            if keep == "full":
                mask[:] = True
            np.testing.assert_array_equal(got.lit[mask], frame.lit[mask])
            np.testing.assert_array_equal(got.dark[mask], frame.dark[mask])
            level = statistics(signal_of(frame.lit, frame.dark, plan.weights)).level
            rest = signal_of(got.lit, got.dark, plan.weights)[~mask]
            assert (rest <= level + plan.threshold).all()


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_pixels_any_shape(tmp_path: Path, data: st.DataObject) -> None:
    draw = data.draw
    channels = draw(st.sampled_from([1, 3]))
    dtype = draw(st.sampled_from(["uint8", "uint16"]))
    plan = ScanPlan(
        draw(st.integers(1, 40)), draw(st.integers(1, 12)), dtype, channels, ("a",), 1,
        float(draw(st.integers(0, 60))), draw(st.sampled_from(["sparse", "full"])),
        draw(st.integers(0, 9)), draw(st.sampled_from(["vertical", "horizontal"])),
        (0.3, 1.0, -0.7) if channels == 3 else None,
    )  # fmt: skip
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    top = draw(st.sampled_from([3, 80, 255, np.iinfo(dtype).max]))
    lit, dark = rng.integers(0, top, (2, *plan.shape), dtype=dtype, endpoint=True)
    own, shared = draw(st.sampled_from([(True, False), (False, True), (False, False)]))
    path = tmp_path / "x.turnscan"
    path.unlink(missing_ok=True)
    with Scan.create(path, plan) as scan:
        if shared:
            scan.add_background("a", dark)
        scan.add(Frame(0, "a", lit, dark if own else None))
    with Scan.open(path) as scan:
        got = scan.frame(0, "a")
    if own or shared:
        mask = kept_mask(lit, dark, plan) | (plan.keep == "full")
        np.testing.assert_array_equal(got.dark[mask], dark[mask])
    else:
        assert got.dark is None
        signal = signal_of(lit, None, plan.weights)
        mask = (signal > statistics(signal).level + plan.threshold) | (plan.keep == "full")
    np.testing.assert_array_equal(got.lit[mask], lit[mask])


@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
@pytest.mark.parametrize("peak", [0.04, 0.1, 0.7])
def test_sparse_gives_the_same_stripe_as_full(
    tmp_path: Path, orientation: str, peak: float
) -> None:
    from turnscan.stripes import StripeSettings, detect

    wide = (320, 96) if orientation == "vertical" else (96, 320)
    noise = 0.005
    plan = ScanPlan(*wide, "uint8", 1, ("left",), 3, 4 * noise * 255 * 2**0.5,
                    orientation=orientation)  # fmt: skip
    with Scan.create(tmp_path / "a.turnscan", plan) as scan:
        pairs = [stripe_pair(k, plan, peak, noise) for k in range(3)]
        for k, pair in enumerate(pairs):
            assert scan.add(Frame(k, "left", *pair)) < 0.45
    found = 0
    with Scan.open(tmp_path / "a.turnscan") as scan:
        for frame, pair in zip(scan.frames(), pairs, strict=True):
            for strategy in ("window", "maximum", "centroid", "median", "parabola", "squared"):
                chosen = StripeSettings(
                    strategy=strategy,
                    orientation=orientation,
                    background=(frame.level, frame.noise),
                )
                full, sparse = detect(*pair, chosen), detect(frame.lit, frame.dark, chosen)
                for name in ("position", "amplitude", "width", "sigma", "flags"):
                    np.testing.assert_array_equal(getattr(sparse, name), getattr(full, name))
                found += int(full.found.sum())
    assert found > (20 if peak < 0.05 else 500)


@pytest.mark.parametrize("shared", [True, False])
def test_sparse_colour_gives_the_same_stripe_as_full(tmp_path: Path, shared: bool) -> None:
    from turnscan.stripes import Signal, StripeSettings

    weights = (1.0, -0.5, -0.5)
    plan = ScanPlan(320, 96, "uint8", 3, ("left",), 3, 8.0, weights=weights)
    pairs = [stripe_pair(k, plan) for k in range(3)]
    if shared:
        pairs = [(lit, pairs[0][1]) for lit, _ in pairs]
    with Scan.create(tmp_path / "a.turnscan", plan) as scan:
        if shared:
            scan.add_background("left", pairs[0][1])
        for k, (lit, dark) in enumerate(pairs):
            scan.add(Frame(k, "left", lit, None if shared else dark))
    signal = Signal(weights)
    with Scan.open(tmp_path / "a.turnscan") as scan:
        for frame in scan.frames(project=signal.project):
            lit, dark = (signal.project(p) for p in pairs[frame.step])
            known = (StripeSettings(), frame.level, frame.noise)
            full = signal.detect(lit, dark, *known)
            sparse = signal.detect(frame.lit, frame.dark, *known)
            assert full.found.sum() == plan.height
            for name in ("position", "amplitude", "width", "sigma", "flags"):
                np.testing.assert_array_equal(getattr(sparse, name), getattr(full, name))


def test_noise_and_level_of_the_whole_frame_are_remembered(tmp_path: Path) -> None:
    plan = replace(PLAN, width=400, height=300, steps=1)
    rng = np.random.default_rng(1)
    lit = np.rint(rng.normal(60, 3, plan.shape)).astype(np.uint8)
    dark = np.rint(rng.normal(50, 3, plan.shape)).astype(np.uint8)
    with Scan.create(tmp_path / "a.turnscan", plan) as scan:
        scan.add(Frame(0, "left", lit, dark))
        frame = scan.frame(0, "left")
    truth = math.hypot(3, 3)
    assert frame.noise == pytest.approx(math.hypot(truth, 12**-0.5), rel=0.04)
    assert frame.level == pytest.approx(10, abs=0.1)


def test_the_shared_background_is_stored_once(tmp_path: Path) -> None:
    plan = replace(PLAN, steps=20, width=400, height=300, margin=32)
    background = stripe_pair(99, plan)[1]
    sizes = []
    for shared in (True, False):
        path = tmp_path / f"{shared}.turnscan"
        with Scan.create(path, plan) as scan:
            if shared:
                scan.add_background("left", background)
            for k in range(plan.steps):
                lit = stripe_pair(k, plan)[0]
                scan.add(Frame(k, "left", lit, None if shared else background))
        sizes.append(path.stat().st_size)
        with Scan.open(path) as scan:
            frame = scan.frame(3, "left")
            mask = kept_mask(stripe_pair(3, plan)[0], background, plan)
            np.testing.assert_array_equal(frame.lit[mask], stripe_pair(3, plan)[0][mask])
            np.testing.assert_array_equal(frame.dark[mask], background[mask])
            if shared:
                np.testing.assert_array_equal(scan.background("left"), background)
    assert sizes[0] < 0.8 * sizes[1]


def test_colour_can_be_projected_on_the_way_out(tmp_path: Path) -> None:
    plan = ScanPlan(64, 48, "uint8", 3, ("left",), 3, 20.0, weights=(1.0, -0.5, -0.5))

    from turnscan.stripes import project_colour

    def project(pixels: np.ndarray) -> np.ndarray:
        return project_colour(pixels, plan.weights, np.uint16)

    frames = write(tmp_path / "a.turnscan", plan)
    background = frames[0].dark
    with Scan.create(tmp_path / "b.turnscan", plan) as scan:
        scan.add_background("left", background)
        scan.add(Frame(0, "left", frames[0].lit))
    for name in ("a", "b"):
        with Scan.open(tmp_path / f"{name}.turnscan") as scan:
            for plain, signal in zip(scan.frames(), scan.frames(project=project), strict=True):
                assert signal.lit.shape == (48, 64)
                np.testing.assert_array_equal(signal.lit, project(plain.lit))
                np.testing.assert_array_equal(signal.dark, project(plain.dark))
                whole = frames[signal.step]
                dark = background if name == "b" else whole.dark
                truth = statistics(signal_of(project(whole.lit), project(dark), None))
                assert signal.noise == pytest.approx(truth.noise, rel=0.05)
                assert signal.level == pytest.approx(truth.level, abs=0.5 * truth.noise)


def test_a_scan_knows_itself(tmp_path: Path) -> None:
    plan = replace(PLAN, lasers=("left", "right"), steps=4, source="a test")
    rig = rig_of()
    with Scan.create(tmp_path / "a.turnscan", plan, rig) as scan:
        for laser in ("right", "left"):
            for k in (2, 0, 3):
                scan.add(
                    Frame(
                        k,
                        laser,
                        *stripe_pair(k),
                        commanded=k * 0.5,
                        measured=k * 0.51,
                        angle_sigma=0.001,
                        time=5.0,
                        settings={"gain": 2.5, "auto": False},
                    )
                )
        assert not scan.complete
        scan.add_missing(1, "left", "the camera slept")
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert len(scan) == 6
        assert scan.sealed
        assert not scan.complete
        assert scan.missing("left") == {1: "the camera slept"}
        assert scan.missing("right") == {1: "it was not taken"}
        order = [(f.laser, f.step) for f in scan.frames()]
        assert order == [(a, k) for a in ("left", "right") for k in (0, 2, 3)]
        np.testing.assert_allclose(scan.angles("left"), [0, 1.02, 1.53])
        assert scan.steps("right") == [0, 2, 3]
        frame = scan.frame(2, "right")
        assert (frame.angle, frame.commanded, frame.angle_sigma) == (1.02, 1.0, 0.001)
        assert dict(frame.settings) == {"gain": 2.5, "auto": False}
        assert scan.rig is not None
        assert rig_to_json(scan.rig) == rig_to_json(rig)
        with pytest.raises(InputError, match="the camera slept"):
            scan.frame(1, "left")
        with pytest.raises(InputError, match="no laser 'middle'"):
            scan.angles("middle")
        with pytest.raises(InputError, match="reading only"):
            scan.add(Frame(1, "right", *stripe_pair(1)))
    assert not list(tmp_path.glob("a.turnscan-*")), "side files are gone"


def test_angles_of_every_kind_come_back(tmp_path: Path) -> None:
    angles = [-0.0, 0.0, -1e-320, 1e300, 7.0, math.nan]
    with Scan.create(tmp_path / "a.turnscan", PLAN) as scan:
        for k, angle in enumerate(angles):
            scan.add(Frame(k, "left", *stripe_pair(k), commanded=angle))
    with Scan.open(tmp_path / "a.turnscan") as scan:
        np.testing.assert_array_equal(scan.angles(), angles)


def test_what_does_not_fit_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    lit, dark = stripe_pair(0)
    with Scan.create(tmp_path / "a.turnscan", PLAN) as scan:
        scan.add(Frame(0, "left", lit, dark))
        for bad in (
            Frame(0, "left", lit, dark),
            Frame(6, "left", lit, dark),
            Frame(-1, "left", lit, dark),
            Frame(1, "right", lit, dark),
            Frame(1, "left", lit[:, 1:], dark[:, 1:]),
            Frame(1, "left", lit.astype(np.uint16), dark),
            Frame(1, "left", lit, dark[1:]),
            Frame(1, "left", lit, dark, settings={"x": math.nan}),
            Frame(1, "left", lit, dark, settings={"x": [1]}),  # type: ignore[dict-item]
        ):
            with pytest.raises(InputError):
                scan.add(bad)
        assert len(scan) == 1
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert len(list(scan.frames())) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"width": 0}, {"width": 10**6, "height": 10**6}, {"dtype": "float32"}, {"channels": 2},
        {"lasers": ()}, {"lasers": ("a", "a")}, {"lasers": ("",)}, {"lasers": ("a\nb",)},
        {"lasers": ("x" * 300,)}, {"steps": 0}, {"threshold": math.nan}, {"threshold": -1.0},
        {"keep": "some"}, {"margin": -1}, {"orientation": "slanted"}, {"weights": (1.0, 0.0, 0.0)},
        {"channels": 3}, {"channels": 3, "weights": (0.0, 0.0, 0.0)},
    ],
)  # fmt: skip
def test_impossible_plans(change: dict[str, object]) -> None:
    with pytest.raises(InputError):
        replace(PLAN, **change)  # type: ignore[arg-type]


def test_create_leaves_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "a.turnscan").write_text("precious")
    with pytest.raises(InputError, match="already exists"):
        Scan.create(tmp_path / "a.turnscan", PLAN)
    assert (tmp_path / "a.turnscan").read_text() == "precious"
    with pytest.raises(ScanError, match="cannot be written"):
        Scan.create(tmp_path / "no" / "a.turnscan", PLAN)


def test_replacing_is_all_or_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    write(path)
    before = path.read_bytes()

    def fail() -> None:
        with replacing_scan(path, PLAN) as scan:
            scan.add(Frame(0, "left", *stripe_pair(0)))
            scan.add(Frame(0, "left", *stripe_pair(0)))

    with pytest.raises(InputError, match="there already"):
        fail()
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.turnscan"]
    with replacing_scan(path, replace(PLAN, source="new")) as scan:
        scan.add(Frame(0, "left", *stripe_pair(0)))
    with Scan.open(path) as scan:
        assert scan.plan.source == "new"
    assert os.listdir(tmp_path) == ["a.turnscan"]


def test_replacing_does_not_touch_an_unfinished_scan(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    with (
        Scan.create(path, PLAN) as scan,
        pytest.raises(ScanBusy),
        replacing_scan(path, PLAN),
    ):
        pass
    assert not scan.complete


def test_leftovers_of_a_killed_import_are_swept_and_living_ones_are_not(tmp_path: Path) -> None:
    dead = tmp_path / ".a.turnscan.0011aabb.part"
    write(dead)
    with Scan.create(tmp_path / ".a.turnscan.ccdd2233.part", PLAN) as living:
        with replacing_scan(tmp_path / "a.turnscan", PLAN) as scan:
            scan.add(Frame(0, "left", *stripe_pair(0)))
        assert not dead.exists()
        living.add(Frame(0, "left", *stripe_pair(0)))
        assert living.path.exists()


def test_one_writer_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    with Scan.create(path, PLAN) as scan:
        scan.add(Frame(0, "left", *stripe_pair(0)))
        probe = (
            "import sys\nfrom turnscan.scan import Scan\nfrom turnscan.errors import ScanBusy\n"
            "try: Scan.resume(sys.argv[1])\n"
            "except ScanBusy: print('busy')\n"
            "with Scan.open(sys.argv[1]) as scan: print(len(scan), scan.being_written)\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", probe, str(path)], capture_output=True, text=True, check=True
        )
        assert done.stdout == "busy\n1 True\n"
        scan.add(Frame(1, "left", *stripe_pair(1)))
    with Scan.open(path) as one, Scan.open(path) as two:
        assert len(one) == len(two) == 2
        assert not one.being_written


def test_a_scan_that_was_closed_meanwhile_is_not_called_damaged(tmp_path: Path) -> None:
    write(tmp_path / "a.turnscan")
    scan = Scan.resume(tmp_path / "a.turnscan")
    late = next(scan.stored())
    scan.close()
    for reach in (
        late.decode,
        lambda: scan.frame(0),
        scan.edits,
        lambda: next(scan.verify()),
        lambda: scan.append_edit("{}", 0.0),
        lambda: scan.keep_settings("{}"),
    ):
        with pytest.raises(InputError, match=r"a\.turnscan: the scan was closed meanwhile"):
            reach()


def test_resume_adds_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    frames = write(path, steps=3)
    with Scan.resume(path) as scan:
        assert sorted(scan.missing("left")) == [3, 4, 5]
        for k in scan.missing("left"):
            scan.add(Frame(k, "left", *stripe_pair(k), commanded=0.1 * k, settings={"n": k}))
        assert scan.complete
    whole = tmp_path / "b.turnscan"
    write(whole)
    with Scan.open(path) as one, Scan.open(whole) as two:
        assert one.sealed
        payloads = [[s.payload for s in scan.stored()] for scan in (one, two)]
    assert payloads[0] == payloads[1]
    assert len(frames) == 3


def test_a_newer_file_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    write(path)
    db = sqlite3.connect(path)
    db.execute("PRAGMA user_version = 2")
    db.close()
    with pytest.raises(ScanNewer, match="version 2"):
        Scan.open(path)


def test_storage_errors_have_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from turnscan.errors import StorageFull

    with Scan.create(tmp_path / "a.turnscan", PLAN) as scan:
        scan.add(Frame(0, "left", *stripe_pair(0)))
        pages = scan._db.execute("PRAGMA page_count").fetchone()[0]
        scan._db.execute(f"PRAGMA max_page_count = {pages}")
        noisy = np.random.default_rng(0).integers(0, 255, (2, *PLAN.shape), dtype=np.uint8)
        with pytest.raises(StorageFull, match="the disk is full"):
            scan.add(Frame(1, "left", noisy[0], noisy[1]))
        assert len(scan) == 1
        scan._db.execute("PRAGMA max_page_count = 100000")
        scan.add(Frame(1, "left", noisy[0], noisy[1]))
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert [f.step for f in scan.frames()] == [0, 1]


def test_views_and_triggers_of_a_stranger_are_refused(tmp_path: Path) -> None:
    for extra in (
        "CREATE VIEW more AS SELECT * FROM frames",
        "CREATE TRIGGER evil AFTER INSERT ON frames BEGIN DELETE FROM meta; END",
        "CREATE INDEX i ON frames (step)",
    ):
        path = tmp_path / f"{abs(hash(extra))}.turnscan"
        write(path)
        db = sqlite3.connect(path)
        db.execute(extra)
        db.commit()
        db.close()
        with pytest.raises(ScanCorrupt, match="tables are not those"):
            Scan.open(path)


@pytest.mark.parametrize(
    ("source", "simulated"),
    [("sim:cup?seed=7", True), ("simulated cup, rig paper", True), ("uvc:0", False), ("", False)],
)
def test_a_plan_tells_whether_its_part_is_real(source: str, simulated: bool) -> None:
    plan = ScanPlan(64, 48, "uint8", 1, ("a",), 4, 20.0, source=source)
    assert plan.simulated == (source if simulated else "")


def test_two_scans_of_the_same_frames_are_the_same_to_the_byte(tmp_path: Path) -> None:
    """Whether somebody looks on or not."""
    made = []
    for name, watched in (("a", False), ("b", True)):
        path = tmp_path / f"{name}.turnscan"
        with Scan.create(path, PLAN, rig_of()) as scan:
            for k in range(PLAN.steps):
                scan.add(Frame(k, "left", *stripe_pair(k), commanded=0.1 * k))
                if watched:
                    with Scan.open(path) as seen:
                        assert len(seen.steps()) == k + 1
            scan.keep_settings('{"kept": 1}')
        made.append(path.read_bytes())
    assert made[0] == made[1]
