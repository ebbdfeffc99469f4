"""C1, C2, C9, C14: kill -9 at any moment loses at most what was before the camera."""

from __future__ import annotations

import os
import random
import threading
from pathlib import Path

from tests.crash.conftest import Zygote
from tests.crash.rows import rows_of
from tests.crash.zygote import STEPS
from turnscan.errors import ScanError, TurnscanError
from turnscan.scan import Scan

KILLS = 50
CHAINS = 20
FEW = 100
"""Steps of four scans in five; the fifth has all, so that kills meet side files of every length."""
SEED = 5


def frames_in(path: Path) -> int:
    if not path.exists():
        return 0
    with Scan.open(path) as scan:
        assert [trouble for _, trouble in scan.verify() if trouble] == []
        return len(scan)


def reference(zygote: Zygote, steps: int = STEPS) -> tuple[list[tuple[bytes, bytes]], float]:
    """An uninterrupted run, complete, and how long it takes; it is the same twice."""
    runs, seconds = [], []
    for name in ("one", "two"):
        path = zygote.new_folder(name) / "a.turnscan"
        done = zygote.ask("whole", path=str(path), steps=steps)
        assert done["error"] == ""
        seconds.append(done["seconds"])
        with Scan.open(path) as scan:
            assert scan.complete
            assert scan.sealed
            assert scan.steps("left") == list(range(steps))
        runs.append(rows_of(path))
    assert runs[0] == runs[1]
    return runs[0], min(seconds)


def a_kill(rng: random.Random, seconds: float, aimed: bool, steps: int) -> dict[str, float]:
    """A moment counted from a commit, as a clock counts other steps on another day.

    ``aimed``: inside the commit, or next to it; if not: anywhere in a step, or before the first.
    """
    if aimed:
        return {"commit": rng.randrange(1, steps), "delay": rng.random() * 0.002}
    return {"commit": rng.randrange(steps), "delay": rng.random() * seconds / steps}


def test_fifty_kills_lose_nothing_and_resume_to_the_byte(zygote: Zygote) -> None:
    references = {steps: reference(zygote, steps) for steps in (FEW, STEPS)}
    rng = random.Random(SEED)
    inside = 0
    for number in range(KILLS):
        folder = zygote.new_folder("killed")
        path = folder / "a.turnscan"
        steps = STEPS if number % 5 == 0 else FEW
        whole, seconds = references[steps]
        moment = a_kill(rng, seconds, aimed=number % 2 == 1, steps=steps)
        zygote.ask("kill", path=str(path), steps=steps, **moment)
        there = frames_in(path)
        inside += 0 < there < steps
        # The frame in the hands of the writer may be lost; all before it are on the disk.
        assert there >= moment["commit"] - 1, (SEED, number, moment)
        done = zygote.ask("whole", path=str(path), steps=steps)
        assert done["error"] == "", (SEED, number, moment)
        assert rows_of(path) == whole, (SEED, number, moment)
        assert os.listdir(folder) == ["a.turnscan"], "nothing is left beside it"
    assert inside >= 0.9 * KILLS, f"only {inside} of {KILLS} kills hit a scan"
    left = zygote.ask("children")
    assert left["children"] == 0
    assert left["descriptors"] < 12


def test_ten_frames_in_one_transaction_would_be_noticed(zygote: Zygote) -> None:
    """The mutant of C1: what the test above asserts of a kill at a commit does not hold."""
    rng = random.Random(SEED)
    lost = 0
    for _ in range(6):
        path = zygote.new_folder("mutant") / "a.turnscan"
        moment = a_kill(rng, 1.0, aimed=True, steps=STEPS)
        zygote.ask("kill", path=str(path), steps=STEPS, mutant=True, **moment)
        lost += frames_in(path) < moment["commit"] - 1
    assert lost >= 1, "each of these would fail the test above"


def test_killed_again_while_it_resumes(zygote: Zygote) -> None:
    steps = 150
    whole, seconds = reference(zygote, steps)
    rng = random.Random(SEED + 1)
    deepest = 0
    for number in range(CHAINS):
        path = zygote.new_folder("chain") / "a.turnscan"
        progress = [0]
        for link in range(5):
            left = 1 - progress[-1] / steps
            within = 0.002 if rng.random() < 0.5 else seconds / steps
            moment = {
                "commit": rng.randrange(max(2, int(steps * left * 0.4))),
                "delay": rng.random() * within,
            }
            done = zygote.ask("kill", path=str(path), steps=steps, **moment)
            progress.append(frames_in(path))
            assert progress[-1] >= progress[-2], (SEED, number, link)
            deepest += link == 4 and 0 < progress[-1] < steps and not done["done"]
        assert zygote.ask("whole", path=str(path), steps=steps)["error"] == ""
        assert rows_of(path) == whole, (SEED, number)
    assert deepest >= 0.9 * CHAINS, "all are counted from commits, which no load moves"


def test_of_two_processes_one_gets_it(zygote: Zygote) -> None:
    path = zygote.new_folder("raced") / "a.turnscan"
    zygote.ask("kill", path=str(path), steps=STEPS, commit=5, delay=0.0)
    assert path.with_name("a.turnscan-lock").exists(), "the lock of the dead is no lock"
    for _ in range(50):
        said = zygote.ask("race", path=str(path))
        assert said["results"] == ["ScanBusy", "got it"]
    assert frames_in(path) >= 4


def test_a_scan_that_is_being_taken_can_be_watched(zygote: Zygote) -> None:
    """Readers see only whole frames, more and more of them, and do not disturb."""
    steps = 60
    whole, _ = reference(zygote, steps)
    path = zygote.new_folder("watched") / "a.turnscan"
    seen: list[int] = []
    troubles: list[TurnscanError] = []
    stop = threading.Event()

    def watch() -> None:
        while not stop.is_set():
            try:
                with Scan.open(path) as scan:
                    busy = scan.being_written
                    stored = [(s.row.digest(), s.payload) for s in scan.stored()]
            except ScanError as e:
                troubles.append(e)
                continue
            except TurnscanError:
                continue  # there is no file yet
            if busy:
                seen.append(len(stored))
            if stored != whole[: len(stored)]:
                troubles.append(TurnscanError("other frames"))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        done = zygote.ask("whole", path=str(path), steps=steps, rest=0.04)
        assert done["error"] == ""
    finally:
        stop.set()
        watcher.join()
    assert troubles == []
    assert seen == sorted(seen)
    assert len(set(seen)) > 5
    assert rows_of(path) == whole
