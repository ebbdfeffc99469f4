"""A scan on devices: order, faults, pause, abort, resume; whatever happens, the lasers end dark."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tests.acquire.rig import Rig, picture_of, plan_of
from turnscan.acquire import (
    Control,
    Ended,
    Event,
    Exposure,
    FirstLook,
    Missing,
    Outcome,
    Paused,
    Plan,
    StepDone,
    Stored,
    Taken,
    Texture,
    WentOn,
    check_angle,
    check_room,
    estimate,
    look,
    reindexed,
    run,
)
from turnscan.arrays import Image
from turnscan.errors import (
    AngleLost,
    DeviceDisconnected,
    DeviceTimeout,
    InputError,
    LaserStateUnknown,
    StorageFull,
)
from turnscan.scan import Scan


def scan_with(
    rig: Rig, plan: Plan, path: Path, control: Control | None = None, fresh: bool = True
) -> tuple[Outcome, list[Event]]:
    events: list[Event] = []
    first: FirstLook | None = None
    if fresh:
        first = look(plan, rig.hardware)
        Scan.create(path, first.scan_plan).close()
    with Scan.resume(path) as scan:
        outcome = run(
            plan, rig.hardware, scan, first=first, listener=events.append, control=control,
            clock=lambda: 5.0,
        )  # fmt: skip
    return outcome, events


def rows_of(path: Path) -> list[tuple[object, ...]]:
    """Everything that is stored, to the byte, but the order of storing."""
    with Scan.open(path) as scan:
        assert not [t for _, t in scan.verify() if t]
        out = [(s.row.digest(), s.payload) for s in scan.stored()]
        return [*out, *(scan.texture(k).lit.tobytes() for k in range(9) if scan.has_texture(k))]


def test_each_step_is_dark_then_each_laser_alone(tmp_path: Path) -> None:
    rig = Rig()
    scan_with(rig, plan_of(2), tmp_path / "a.turnscan")
    step = ["grab dark", "grabbed", "light left", "grab left", "grabbed", "light none",
            "light right", "grab right", "grabbed", "light none"]  # fmt: skip
    pictures = [s for s in rig.said if not s.startswith(("configure", "off"))]
    moves = [["move 0", "moved"], ["move 9", "moved"]]
    # The first pictures are taken once, and dark is looked at once more at the end.
    assert pictures == [
        *moves[0], *step, *moves[0], *moves[1], *step, "grab dark", "grabbed"
    ]  # fmt: skip
    assert rig.said[0] == "off"
    assert rig.said[-1] == "off"
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.complete
        frame = scan.frame(1, "right")
        assert frame.settings == {"seconds": 0.01, "gain": 1.0}
        assert frame.commanded == pytest.approx(math.radians(9))
        assert math.isnan(frame.measured)
        truth = picture_of(math.radians(9), frozenset({"right"}), 0.01, 0)
        bright = truth > 60
        np.testing.assert_array_equal(frame.lit[bright], truth[bright])


def test_every_option_of_a_plan_is_in_the_file(tmp_path: Path) -> None:
    rig = Rig(names=("left", "right", "lamp"))
    plan = plan_of(
        3, start_deg=Fraction(30), step_deg=Fraction(-15), passes=2, together=True, dark_every=2,
        exposures=(Exposure(0.01), Exposure(0.04, 2.0)),
        texture=Texture(Exposure(0.2), 3, ("lamp",)),
    )  # fmt: skip
    outcome, events = scan_with(rig, plan, tmp_path / "a.turnscan")
    assert outcome == Outcome(True, 12, 0)
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.lasers == ("left+right",)
        frames = list(scan.frames())
        assert [(f.step, f.exposure) for f in frames] == [(s, e) for s in range(6) for e in (0, 1)]
        angles = [round(math.degrees(f.commanded)) for f in frames[::2]]
        assert angles == [30, 15, 0, -330, -345, -360]
        assert [f.settings["gain"] for f in frames[:2]] == [1.0, 2.0]
        assert [k for k in range(6) if scan.has_texture(k)] == [0, 3]
        assert scan.texture(3).settings == {"seconds": 0.2, "gain": 1.0}
        # One dark picture serves two steps.
        off = picture_of(plan.angle(2), frozenset(), 0.04, 0)
        kept = frames[7].lit.astype(int) > 60
        np.testing.assert_array_equal(frames[7].dark[kept], off[kept])
    assert sum(isinstance(e, Taken) for e in events) == 12
    assert "grab lamp" in rig.said
    assert "grab left+right" in rig.said


def test_no_dark_pictures(tmp_path: Path) -> None:
    rig = Rig()
    scan_with(rig, plan_of(3, dark_every=0), tmp_path / "a.turnscan")
    assert rig.said.count("grab dark") == 1, "the threshold needs one"
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.frame(2, "left").dark is None


def test_events_tell_the_story_and_the_time_left(tmp_path: Path) -> None:
    rig = Rig(moving=0.02)
    _, events = scan_with(rig, plan_of(6), tmp_path / "a.turnscan")
    done = [e for e in events if isinstance(e, StepDone)]
    assert [e.done for e in done] == [1, 2, 3, 4, 5, 6]
    assert done[-1].seconds_left == 0
    assert 0.02 < done[2].seconds_left < 60.0
    assert events[-1] == Ended(True, "complete")
    stored = [i for i, e in enumerate(events) if isinstance(e, Stored)]
    taken = [i for i, e in enumerate(events) if isinstance(e, Taken)]
    assert len(stored) == len(taken) == 12
    assert all(t < s for t, s in zip(taken, stored, strict=True))


def test_a_picture_that_does_not_come_is_asked_for_again_then_missing(tmp_path: Path) -> None:
    once = Rig(errors={5: DeviceTimeout("late")})
    outcome, _ = scan_with(once, plan_of(3), tmp_path / "a.turnscan")
    assert outcome == Outcome(True, 6, 0)
    twice = Rig(errors={5: DeviceTimeout("late"), 6: DeviceTimeout("late")})
    outcome, events = scan_with(twice, plan_of(3), tmp_path / "b.turnscan")
    assert outcome == Outcome(True, 5, 1)
    assert [e for e in events if isinstance(e, Missing)] == [Missing(1, "left", 0, "late")]
    with Scan.open(tmp_path / "b.turnscan") as scan:
        assert scan.missing("left") == {1: "late"}
        assert scan.complete


def test_a_camera_that_is_gone_ends_the_scan(tmp_path: Path) -> None:
    rig = Rig(errors={n: DeviceTimeout("late") for n in range(5, 100)})
    with pytest.raises(DeviceTimeout, match="5 times in a row"):
        scan_with(rig, plan_of(30), tmp_path / "a.turnscan")
    assert rig.grabs < 20
    assert not rig.lit


@pytest.mark.parametrize("number", range(1, 12))
@pytest.mark.parametrize("error", [KeyboardInterrupt, DeviceDisconnected, MemoryError])
def test_dark_and_stopped_however_it_ends_and_resumed_to_the_byte(
    tmp_path: Path, number: int, error: type[BaseException]
) -> None:
    path, whole = tmp_path / "a.turnscan", tmp_path / "whole.turnscan"
    scan_with(Rig(), plan_of(4), whole)
    rig = Rig(errors={number: error("gone")})
    with pytest.raises(error):
        scan_with(rig, plan_of(4), path)
    assert not rig.lit
    assert rig.said[-2:] == ["off", "stop"]
    outcome, _ = scan_with(Rig(), plan_of(4), path, fresh=not path.exists())
    assert outcome.complete
    assert rows_of(path) == rows_of(whole)


def test_only_what_is_missing_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    rig = Rig(errors={8: KeyboardInterrupt()})
    with pytest.raises(KeyboardInterrupt):
        scan_with(rig, plan_of(4), path)
    with Scan.open(path) as scan:
        assert [(f.step, f.laser) for f in scan.frames()] == [
            (0, "left"), (1, "left"), (0, "right"), (1, "right")
        ]  # fmt: skip
    again = Rig()
    outcome, _ = scan_with(again, plan_of(4), path, fresh=False)
    assert outcome.frames == 4
    assert "move 0" not in again.said
    idle = Rig()
    assert scan_with(idle, plan_of(4), path, fresh=False)[0] == Outcome(True, 0, 0)
    assert not [s for s in idle.said if s.startswith(("grab", "move", "light"))]


def test_a_long_exposure_in_daylight_is_not_taken_for_a_laser_still_lit(tmp_path: Path) -> None:
    plan = plan_of(5, exposures=(Exposure(0.001), Exposure(0.02)))
    outcome, _ = scan_with(Rig(sunlit=5000.0), plan, tmp_path / "a.turnscan")
    assert outcome.frames == 5 * 2 * 2
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.plan.exposures == 2
        assert scan.complete
    long = plan_of(20, exposures=plan.exposures)
    with pytest.raises(LaserStateUnknown, match="laser 'left'"):
        scan_with(Rig(sunlit=5000.0, stuck_on=frozenset({"left"})), long, tmp_path / "b.turnscan")


def test_a_group_taken_up_in_the_middle_has_the_dark_picture_of_its_first_step(
    tmp_path: Path,
) -> None:
    plan = plan_of(8, dark_every=4)
    scan_with(Rig(), plan, tmp_path / "whole.turnscan")
    for number in (6, 7, 9, 13):
        path = tmp_path / f"{number}.turnscan"
        with pytest.raises(KeyboardInterrupt):
            scan_with(Rig(errors={number: KeyboardInterrupt()}), plan, path)
        scan_with(Rig(), plan, path, fresh=False)
        assert rows_of(path) == rows_of(tmp_path / "whole.turnscan")


def test_pause_is_dark_and_still_and_goes_on_to_the_byte(tmp_path: Path) -> None:
    scan_with(Rig(), plan_of(6), tmp_path / "whole.turnscan")
    rig, control, events = Rig(exposing=0.005), Control(), []
    first = look(plan_of(6), rig.hardware)
    quiet: list[int] = []

    def listen(event: Event) -> None:
        events.append(event)
        if isinstance(event, StepDone) and event.done == 2:
            control.pause()
            threading.Timer(0.4, control.go_on).start()
        if isinstance(event, Paused):
            quiet.append(len(rig.log))
        if isinstance(event, WentOn):
            quiet.append(len(rig.log))

    with Scan.create(tmp_path / "a.turnscan", first.scan_plan) as scan:
        run(plan_of(6), rig.hardware, scan, first=first, listener=listen, control=control,
            clock=lambda: 5.0)  # fmt: skip
    assert quiet[0] == quiet[1], "nothing is asked of the devices in a pause"
    assert rig.said[quiet[0] - 1] == "off"
    done = [e for e in events if isinstance(e, StepDone)]
    assert done[2].seconds_left < 0.4, "a pause is not counted"
    assert rows_of(tmp_path / "a.turnscan") == rows_of(tmp_path / "whole.turnscan")


def test_abort_is_at_once_and_resumable(tmp_path: Path) -> None:
    scan_with(Rig(), plan_of(6), tmp_path / "whole.turnscan")

    class Slow(Rig):
        """Its third move would take a minute; it is aborted in the middle of it."""

        def move_to(self, angle: float, timeout: float) -> float:
            if angle == pytest.approx(math.radians(18)):
                self.moving = 60.0
                threading.Timer(0.2, control.abort).start()
            return super().move_to(angle, timeout)

    rig, control = Slow(), Control()
    outcome, events = scan_with(rig, plan_of(6), tmp_path / "a.turnscan", control)
    assert not outcome.complete
    assert events[-1] == Ended(False, "aborted")
    after = rig.said[rig.said.index("move 18") :]
    assert "off" in after
    assert "moved" not in after
    scan_with(Rig(), plan_of(6), tmp_path / "a.turnscan", fresh=False)
    assert rows_of(tmp_path / "a.turnscan") == rows_of(tmp_path / "whole.turnscan")


def test_after_an_abort_nothing_lights_turns_or_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At fifty moments of turning, dark and lit pictures; a picture truncated is taken again."""
    # On a machine that is busy for two seconds a lease ends, and another picture is taken.
    monkeypatch.setattr("turnscan.devices._lit.LEASE", 60.0)

    class Rolling(Rig):
        """A picture whose laser goes out meanwhile has its lower half dark."""

        def grab(self, timeout: float) -> Image:
            lit = self.lit
            picture = super().grab(timeout)
            if self.lit != lit:
                picture[24:] = picture_of(self.at, frozenset(), self.seconds, 0)[24:]
            return picture

    plan, aborted = plan_of(4, dark_every=1), 0
    scan_with(Rig(), plan, tmp_path / "whole.turnscan")
    whole = rows_of(tmp_path / "whole.turnscan")
    first = look(plan, Rig().hardware)
    for k in range(50):
        path, rig, control = tmp_path / f"{k}.turnscan", Rolling(), Control()
        rig.exposing = rig.moving = 0.004
        returned: list[float] = []

        def abort(control: Control = control, returned: list[float] = returned) -> None:
            control.abort()
            returned.append(time.monotonic())

        Scan.create(path, first.scan_plan).close()
        timer = threading.Timer(0.0014 * k, abort)
        timer.start()
        outcome, _ = scan_with(rig, plan, path, control, fresh=False)
        timer.join()
        aborted += not outcome.complete
        late = [what for at, what in rig.log if at > returned[0]]
        orders = [w for w in late if w.startswith(("move ", "light ")) and w != "light none"]
        assert not orders, (k, late)
        scan_with(Rig(), plan, path, fresh=False)
        rows = rows_of(path)
        sizes = [len(row[1]) for row in rows if isinstance(row[1], bytes)]  # half dark: half of it
        assert rows == whole, (k, sizes, rig.log)
    assert aborted >= 25


def test_lit_only_while_a_shutter_is_open(tmp_path: Path) -> None:
    """S6, from the log of the lasers: exposure + 100 ms a step, and none while moving or paused."""
    rig = Rig(exposing=0.02, moving=0.02)
    control = Control()
    timers = [threading.Timer(0.2, control.pause), threading.Timer(0.6, control.go_on)]
    for timer in timers:
        timer.start()
    scan_with(rig, plan_of(6), tmp_path / "a.turnscan", control)
    since, lit = math.nan, []
    moving = False
    for at, what in rig.log:
        if what.startswith("move "):
            moving = True
            assert math.isnan(since)
        if what == "moved":
            moving = False
        if what.startswith("light ") and what != "light none":
            assert not moving
            since = at
        elif what in ("light none", "off") and not math.isnan(since):
            lit.append(at - since)
            since = math.nan
    assert len(lit) == 12
    assert 0.02 * 12 <= sum(lit) < (0.02 + 0.1) * 12
    assert max(lit) < 0.3


@pytest.mark.parametrize("fault", ["dead", "stuck_on"])
def test_a_laser_that_does_not_obey_is_noticed(tmp_path: Path, fault: str) -> None:
    """S11: lit pictures must show a stripe, and dark ones must not."""
    rig = Rig(**{fault: frozenset({"right"})})
    with pytest.raises(LaserStateUnknown, match=r"'right'.*no stripe"):
        scan_with(rig, plan_of(30), tmp_path / "a.turnscan")
    assert rig.grabs < 3 * 10
    trusting = plan_of(12, blind_steps=0)
    assert scan_with(Rig(**{fault: frozenset({"right"})}), trusting, tmp_path / "b.turnscan")


def test_a_laser_that_stays_on_during_a_scan_is_noticed_at_the_next_dark_picture(
    tmp_path: Path,
) -> None:
    class Sticking(Rig):
        def light(self, lit: frozenset[str], lease: float) -> None:
            if lit == {"left"} and self.at > 0.5:
                self.stuck_on = frozenset({"left"})
            super().light(lit, lease)

    rig = Sticking()
    with pytest.raises(LaserStateUnknown, match=r"'left'.*still show"):
        scan_with(rig, plan_of(30), tmp_path / "a.turnscan")
    assert rig.at < math.radians(9 * 6)
    late = Sticking()
    with pytest.raises(LaserStateUnknown, match=r"'left'.*still show"):  # the last step has a next
        scan_with(late, plan_of(5), tmp_path / "b.turnscan")


def test_light_that_changes_is_no_laser(tmp_path: Path) -> None:
    class Flickering(Rig):
        def grab(self, timeout: float) -> np.ndarray:
            picture = super().grab(timeout)
            return np.clip(picture.astype(int) + 40 * (self.grabs % 2), 0, 255).astype(np.uint8)

    assert scan_with(Flickering(), plan_of(10), tmp_path / "a.turnscan")[0].complete


def test_what_cannot_be_done_is_refused_before_anything_moves(tmp_path: Path) -> None:
    rig = Rig()
    for plan in (plan_of(lasers=("green",)), plan_of(texture=Texture(Exposure(0.1), 1, ("lamp",)))):
        with pytest.raises(InputError, match="no laser"):
            look(plan, rig.hardware)
    assert not rig.log


def test_room_is_asked_for_with_both_numbers(tmp_path: Path) -> None:
    first = look(plan_of(8), Rig().hardware)
    wanted = estimate(plan_of(8), first)
    assert 16 * 500 < wanted < 16 * 10_000
    with pytest.raises(StorageFull, match="needs 1400 MB with reserve, 1399 MB are free"):
        check_room(tmp_path / "a", 1_000_000_000, 1_399_000_000)
    check_room(tmp_path / "a", 1_000_000_000, 1_400_000_000)
    check_room(tmp_path / "a", 1)
    scan_with(Rig(), plan_of(8), tmp_path / "a.turnscan")
    size = (tmp_path / "a.turnscan").stat().st_size
    assert 0.4 * size < wanted < 1.5 * size


def test_the_threshold_is_chosen_and_said() -> None:
    first = look(plan_of(8), Rig().hardware)
    assert math.hypot(1.0, 1.0) < first.noise < 1.3 * math.hypot(1.0, 1.0)  # and the stripe
    assert first.scan_plan.threshold == pytest.approx(4 * first.noise)
    assert "4 × the noise of 1." in first.threshold_reason
    assert look(plan_of(8), Rig().hardware, threshold=9.0).scan_plan.threshold == 9.0


class CountingRig(Rig):
    """Its controller counts from where it was switched on."""

    remembers = True
    angle = 0.0


@pytest.mark.parametrize(
    ("remembers", "at_deg", "good"),
    [(True, 9.0, True), (True, 18.0, True), (True, 13.0, True), (True, 0.0, False),
     (True, 8.9, False), (True, 38.0, True), (True, 38.5, False), (False, 9.0, False),
     (False, 0.0, False)],
)  # fmt: skip
def test_the_angle_is_lost_where_the_controller_says_otherwise(
    tmp_path: Path, remembers: bool, at_deg: float, good: bool
) -> None:
    path, plan = tmp_path / "a.turnscan", plan_of(6)
    with pytest.raises(KeyboardInterrupt):
        scan_with(Rig(errors={7: KeyboardInterrupt()}), plan, path)
    rig = CountingRig()
    rig.remembers, rig.angle = remembers, math.radians(at_deg)
    with Scan.open(path) as scan:
        assert math.degrees(scan.last_angle) == pytest.approx(9)
        if good:
            check_angle(plan, scan, rig)
        else:
            with pytest.raises(AngleLost, match=r"taken at 9\.000°"):
                check_angle(plan, scan, rig)
        check_angle(plan, scan, Rig())
    table = reindexed(rig, math.radians(45.0))
    assert table.move_to(math.radians(54.0), 1.0) == math.radians(54.0)
    assert math.degrees(rig.at) == pytest.approx(at_deg + 9.0)
    with pytest.raises(InputError, match="absolute"):
        reindexed(Rig(), 0.0)


def test_an_error_of_the_disk_ends_the_scan_dark(tmp_path: Path) -> None:
    rig = Rig()
    first = look(plan_of(8), rig.hardware)
    with Scan.create(tmp_path / "a.turnscan", first.scan_plan) as scan:
        pages = scan._db.execute("PRAGMA page_count").fetchone()[0]
        scan._db.execute(f"PRAGMA max_page_count = {pages + 4}")
        with pytest.raises(StorageFull):
            run(plan_of(8), rig.hardware, scan, first=first)
        assert rig.said[-2:] == ["off", "stop"]
        scan._db.execute("PRAGMA max_page_count = 100000")
    assert scan_with(Rig(), plan_of(8), tmp_path / "a.turnscan", fresh=False)[0].complete


def test_the_table_turns_while_a_frame_is_stored(tmp_path: Path) -> None:
    rig = Rig(names=("left",), moving=0.05)
    plan = replace(plan_of(6), lasers=("left",))
    first = look(plan, rig.hardware)
    stored: list[tuple[float, float]] = []
    with Scan.create(tmp_path / "a.turnscan", first.scan_plan) as scan:
        add = scan.add

        def slow(frame: object) -> float:
            began = time.monotonic()
            time.sleep(0.04)
            share = add(frame)  # type: ignore[arg-type]
            stored.append((began, time.monotonic()))
            return share

        scan.add = slow  # type: ignore[method-assign]
        run(plan, rig.hardware, scan, first=first)
    moves = [
        (t, next(u for u, w in rig.log if w == "moved" and u >= t))
        for t, what in rig.log if what.startswith("move ")
    ]  # fmt: skip
    during = sum(any(a < m1 and m0 < b for m0, m1 in moves) for a, b in stored)
    assert during >= 3  # of six; without a thread none
