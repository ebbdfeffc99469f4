"""The judge of laser safety: 8 000 transitions in CI, more with ``TURNSCAN_EXPLORE=1``.

Long runs are the bench's (``python -m bench.judge``), whose figures stand in docs/safety.md. Each
defect below is one that the guard, the link or a driver could have; the judge must find it.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import pytest
from bench._stand_ins import installed
from bench.judge import CONFIRM, FAULTS, Bench, Violation, explore, firmware
from bench.virtual import Pipe, Process, World

from turnscan.devices import _dialects, _guard, _guard_client, _lit, _rescue
from turnscan.devices._guard import LONGEST_LEASE
from turnscan.errors import TurnscanError

TRANSITIONS = 400_000 if os.environ.get("TURNSCAN_EXPLORE") == "1" else 8_000


@pytest.mark.parametrize("half", [0, 1])
def test_nothing_is_lit_beyond_the_last_sign_of_life(half: int) -> None:
    figures = explore(TRANSITIONS // 2, seed=half * 1_000_000)
    print("\n" + figures.table())
    assert figures.transitions >= TRANSITIONS // 2
    assert figures.lit > TRANSITIONS / 10
    assert figures.while_lit > TRANSITIONS / 10
    assert set(figures.faults) == {*FAULTS, "hidden line"}
    assert min(figures.faults.values()) > TRANSITIONS / 2000
    assert LONGEST_LEASE < figures.longest < LONGEST_LEASE + CONFIRM
    assert figures.unreached > 10.0  # where nobody could reach the board; then a person was told


# Defects


@contextmanager
def mutated(module: ModuleType, old: str, new: str, **places: ModuleType) -> Iterator[None]:
    """A module with one passage replaced; ``places`` say where its things are used."""
    assert module.__file__ is not None
    source = Path(module.__file__).read_text()
    assert source.count(old) == 1, f"{source.count(old)} places for {old!r}"
    changed = ModuleType("turnscan.devices._mutant")
    with ExitStack() as stack:
        stack.enter_context(mock.patch.dict(sys.modules, {changed.__name__: changed}))
        exec(compile(source.replace(old, new), module.__file__, "exec"), changed.__dict__)
        for name, place in places.items():
            stack.enter_context(mock.patch.object(place, name, getattr(changed, name)))
        yield


@contextmanager
def renewing_for_ever() -> Iterator[None]:
    """What burns is renewed by a thread of its own, whatever becomes of the work."""

    @contextmanager
    def burning(lasers: Any, lit: frozenset[str]) -> Iterator[None]:
        over = _lit_threading().Event()
        lasers.light(lit, LONGEST_LEASE)

        def renew() -> None:
            with suppress(TurnscanError):
                while not over.wait(0.5):
                    lasers.renew(LONGEST_LEASE)

        _lit_threading().Thread(target=renew).start()
        try:
            yield
        finally:
            over.set()
            lasers.light(frozenset(), LONGEST_LEASE)

    with (
        mock.patch.object(_lit, "burning", burning),
        mock.patch.object(_lit, "alive"),
    ):
        yield


def _lit_threading() -> Any:
    """What the link has for ``threading``: the world's, while one is installed."""
    return _guard_client.threading  # type: ignore[attr-defined]


def _guard_mutant(old: str, new: str) -> Callable[[], Any]:
    return lambda: mutated(_guard, old, new, Guard=_guard)


def _link_mutant(old: str, new: str) -> Callable[[], Any]:
    return lambda: mutated(_guard_client, old, new, GuardedLink=_guard_client)


DEFECTS: dict[str, Callable[[], Any]] = {
    "a guard that forgets after three tries": _guard_mutant(
        "self._again = 0.0 if self._sure else time.monotonic() + AGAIN", "self._again = 0.0"
    ),
    "a lease counted from nothing": _guard_mutant(
        "min(time.monotonic() + lease, self._last_end)", "float('inf')"
    ),
    "a lease that a renewal makes longer": _guard_mutant(
        "self._lease_end = min(time.monotonic() + lease, self._last_end)",
        "self._lease_end += lease",
    ),
    "a filter that misses hidden bytes": lambda: mutated(
        _dialects, "        if line and not passes:", "        if line and not passes and False:",
        LineFilter=_guard,
    ),
    "a filter that takes the board's instant bytes in a line": lambda: mutated(
        _dialects,
        "        passes = len(line) <= _LONGEST_LINE and d.lines.fullmatch(line) is not None",
        "        line = re.sub(rb'[^ -}]', b'', line)\n"
        "        passes = len(line) <= _LONGEST_LINE and d.lines.fullmatch(line) is not None",
        LineFilter=_guard,
    ),
    "a renewing thread that lives on": renewing_for_ever,
    "a guard that opens no port again": _guard_mutant(
        "if self._port is None and not self._sure:", "if False:"
    ),
    "a guard that believes an off": _guard_mutant(
        "            if self._sure or self._port is None or self._leave:",
        "            self._sure = True\n            if True:",
    ),
    "a guard that does not mind the end of its scanner": _guard_mutant(
        "kind + payload))\n        self.leave()", "kind + payload))\n        self._lit = False"
    ),
    "a guard whose last word is no dark": _guard_mutant(
        "self._port is not None:\n                    self._dark(0, DONE, tries=1",
        "False:\n                    self._dark(0, DONE, tries=1",
    ),
    "a link that leaves a guard that hangs": _link_mutant("if silent >= most:", "if False:"),
    "a link that does not step in": _link_mutant(
        "        elif self._maybe_lit.is_set() or not (self._closing.is_set() or self._failure):\n"
        "            self._rescue()", "",
    ),
}  # fmt: skip


SEEDS = {
    "a guard that forgets after three tries": 105,
    "a lease counted from nothing": 108,
    "a lease that a renewal makes longer": 108,
    "a guard that believes an off": 101,
}
"""Those that lead to a defect early; to the others the usual one does."""


@pytest.mark.parametrize("defect", DEFECTS)
def test_the_judge_finds(defect: str) -> None:
    with DEFECTS[defect](), pytest.raises(Violation) as found:
        explore(8000, seed=SEEDS.get(defect, 7))
    print(f"{defect}: {found.value}")


# The judge's own world


def test_the_same_seed_gives_the_same_run() -> None:
    tables = {explore(200, seed=3).table() for _ in range(2)}
    assert len(tables) == 1


def test_the_dead_do_nothing_and_the_stopped_wait() -> None:
    world, done = World(firmware("grbl")), []
    with installed(world):
        one, two = Process(world, "one"), Process(world, "two")
        pipe = Pipe(one, two)

        def count(name: str) -> None:
            try:
                while True:
                    world.sleep(1.0)
                    done.append(name)
            finally:
                world.check()
                done.append("never")

        one.start(lambda: count("one"))
        two.start(lambda: count("two"))
        two.start(lambda: done.append(f"end {pipe.read(9)!r}"))
        world.run(2.5)
        assert sorted(done) == ["one", "one", "two", "two"]
        two.stopped = True
        one.end(-9)
        world.run(10.0)
        assert len(done) == 4
        two.stopped = False
        world.run(0.5)
        assert sorted(done[4:]) == ["end b''", "two"]
        world.end()
        assert "never" not in done


def test_a_scan_goes_on_for_minutes_and_the_judge_is_content() -> None:
    bench = Bench("horus", seed=1)
    with installed(bench.world):
        bench.scan()
        bench.world.run(300.0)
        assert not bench.errors
        assert bench.lights() > 40
        assert bench.longest < 0.5
        bench.end()


@pytest.mark.parametrize("dialect", ["grbl", "horus", "fabscan", "sardauscan"])
def test_a_laser_that_nobody_can_reach_is_said_and_darkened_minutes_later(dialect: str) -> None:
    bench = Bench(dialect, seed=2)
    world = bench.world
    with installed(world):
        bench.scan()
        while not (world.board.lit and bench.wanted):
            world.run(0.02)
        world.unplug(powered=True)
        world.run(200.0)
        assert world.board.lit
        assert math.isfinite(bench.told)
        assert bench.told < bench.ceased + 10.0
        world.plug()
        world.run(1.5)
        assert not world.board.lit
        bench.end()


# What the judge has found, each with the defect that it was


@contextmanager
def lit_bench(dialect: str) -> Iterator[Bench]:
    """A scan that has just lit a laser."""
    bench = Bench(dialect, seed=3)
    with installed(bench.world):
        bench.scan()
        while not (bench.world.board.lit and bench.wanted):
            bench.world.run(0.02)
        try:
            yield bench
        finally:
            bench.end()


def said_while_the_work_hangs() -> None:
    """The scanner cannot say what its link was told, so the guard does."""
    with lit_bench("grbl") as bench:
        assert bench.work is not None
        bench.work.held = True
        bench.world.board.deafen(20.0)
        bench.world.run(8.0)
        assert [text for _, text in bench.world.said if "may be lit" in text]
        bench.world.run(15.0)
        assert not bench.world.board.lit
        assert "is dark" in bench.world.said[-1][1]


def replaced_when_killed() -> None:
    """Who steps in for a guard is replaced as long as the scanner lives."""
    with lit_bench("fabscan") as bench:
        assert bench.work is not None
        bench.work.held = True
        bench.world.unplug(powered=True)
        for _ in range(2):
            bench.guards[0].end(-9)
            bench.world.run(6.0)
            assert bench.world.board.lit
        bench.world.plug()
        bench.world.run(1.5)
        assert not bench.world.board.lit


def said_soon_after_the_scanner_has_gone() -> None:
    with lit_bench("sardauscan") as bench:
        assert bench.scanner is not None
        bench.world.board.deafen(60.0)
        bench.scanner.end(-9)
        bench.world.run(2.5)
        assert [text for _, text in bench.world.said if "may be lit" in text]


FOUND = {
    said_while_the_work_hangs: _guard_mutant(
        "                self._dark(0, DONE, tries=1)\n                self._inform()\n",
        "                self._dark(0, DONE, tries=1)\n",
    ),
    replaced_when_killed: lambda: mutated(
        _rescue, "            if code in (0, 4):", "            if True:", Rescue=_guard_client
    ),
    said_soon_after_the_scanner_has_gone: _guard_mutant(
        "if self._sure or self._port is None or self._leave:",
        "if self._sure or self._port is None:",
    ),
}  # fmt: skip


@pytest.mark.parametrize("check", FOUND)
def test_what_the_judge_has_found_stays_repaired(check: Callable[[], None]) -> None:
    check()
    with FOUND[check](), pytest.raises(AssertionError):
        check()
