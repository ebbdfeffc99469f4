"""The judge of laser safety: a state machine over scanner, guard, cable and board.

Run by hand: ``python -m bench.judge`` (``--transitions N``, ``--seed N``, ``--write`` puts the
figures into docs/safety.md). The real drivers, the real link and the real guard live in a
`bench.virtual.World` before an emulated board that keeps a laser log of its own. Faults fall at
random moments; after every span of time the board is asked whether it is lit, and whether anybody
above it still wanted that.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from bench._stand_ins import installed
from bench.virtual import Actor, Process, World
from turnscan.devices import _lit
from turnscan.devices._guard import LONGEST_LEASE
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._registry import board
from turnscan.errors import LaserStateUnknown, TurnscanError
from turnscan.simulate.controllers import (
    FabScanFirmware,
    Firmware,
    GrblFirmware,
    HorusFirmware,
    SardauscanFirmware,
)

CONFIRM = 2.5
"""s beyond the lease in which somebody can reach the board and must have it dark: to notice a guard
that hangs (1.25), to ask once more (1), to open the port again (0.25)."""
TELL = 6.0
"""s after the lease in which a person is told, where somebody lives who can tell."""
PAGE = Path(__file__).parents[1] / "docs" / "safety.md"
BEGIN, END = "<!-- judged: python -m bench.judge --write -->", "<!-- end of what was judged -->"
HIDDEN = {
    "grbl": [
        b"M?3 S1000\n", b"M~3 S1000\n", b"M\x903 S1000\n", b"M\x0b3 S1000\n", b"M(x)3 S9\n",
        b"M16387 S1000\n", b"M-16381 S5\n", b"M03.001 S1000\n", b"m/3 s5\n", b"G1 F100 M 3 S9\n",
        b"\xa0", b"X\xa0\n", b"M5\xa0\n", b"G4 P0\xa0\n", b"?\xa0", b"!\xa0", b"G92 \xa0X0\n",
        b"$N0=M3 S1000\n", b"M8\n", b"M+08\n", b"(a" + b" " * 300 + b")M3S9\n",
        b" " * 300 + b"M3 S1000\n", b"G1 X0 F9\rM3 S9\n", b"G1 X0 (\nM3 S9\n", b"\x18M3 S9\n",
    ],
    "horus": [
        b"M71T1\r\n", b"M327T257\r\n", b"M?71T1\r\n", b"m\x0b71 t1\r\n", b"M(x)71T1\r\n",
        b"G1" + b"0" * 68 + b"M71T1\r\n", b"$N0=M71T1\r\n", b"G1F9M71T2\n", b"~M71T1\n",
    ],
    "fabscan": [b"M21\n", b"M021;\n", b"X M21\n", b"M65557\n", b"M05 M19\n", b"M22 \rM21\r"],
    "sardauscan": [
        b"L 0 1\r", b"l 1 1\r", b"\x01L 0 1\r", b"L\x00 0 1\r", b"T\rL 2 1\r", b"L 4 1\r",
        b"L  0 +1\r", b"T S" + b"x" * 20 + b"\rL 0 1\r",
    ],
}  # fmt: skip
"""Lines that light a laser on the real board, or would like to."""


def firmware(dialect: str) -> Firmware:
    """A board with a quick table."""
    if dialect == "grbl":
        return GrblFirmware({"100": 8.889, "110": 60000, "120": 8000})
    others: dict[str, Callable[[], Firmware]] = {
        "horus": HorusFirmware, "fabscan": FabScanFirmware, "sardauscan": SardauscanFirmware,
    }  # fmt: skip
    return others[dialect]()


@dataclass
class CalibrationQuality:
    """What a run has seen."""

    transitions: int = 0
    runs: int = 0
    hours: float = 0.0
    lit: int = 0
    """How often a laser was lit."""
    faults: Counter[str] = field(default_factory=Counter)
    while_lit: int = 0
    """Faults that fell while a laser burned."""
    longest: float = 0.0
    """s lit beyond the last sign of life while the board could be reached."""
    unreached: float = 0.0
    """s lit beyond the last sign of life while nobody could reach it, and a person was told."""
    told: int = 0

    def table(self) -> str:
        """For the page on safety."""
        kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(self.faults.items()))
        return "\n".join([
            "| what | how much |", "|---|---|",
            f"| transitions | {self.transitions} in {self.runs} runs |",
            f"| time of their own | {self.hours:.2g} h |",
            f"| times lit | {self.lit} |",
            f"| faults injected | {self.faults.total()}, {self.while_lit} of them while lit |",
            f"| by kind | {kinds} |",
            f"| longest lit beyond the last sign of life, board in reach | {self.longest:.2f} s |",
            f"| the same, board out of reach, reported each time | {self.unreached:.1f} s |",
        ])  # fmt: skip


FIGURES = CalibrationQuality()


class Violation(AssertionError):
    """A laser was lit that nobody answered for."""


class Bench:
    """One board, its world, a scanner that comes and goes, and the judge's clocks."""

    def __init__(self, dialect: str, seed: int) -> None:
        self.dialect, self.random = dialect, Random(seed)
        self.world = World(firmware(dialect), seed)
        self.world.watch = self._judge
        self.scanner: Process | None = None
        self.work: Actor | None = None
        self.device: Any = None
        self.sign = self.ceased = self.world.now
        """When the work last showed that it goes on; when everything above the laser last lived."""
        self.wanted = False
        self.able = self.silent = self.longest = 0.0
        self.told = -math.inf
        self.errors: list[BaseException] = []
        self.failed = False

    # The scanner.

    def scan(self) -> None:
        """A new scanner, if there is none."""
        if self.scanner is not None and self.scanner.alive:
            return
        self.scanner = process = Process(self.world, "scanner")
        self.device, self.wanted = None, False
        self.work = process.start(lambda: self._program(process))

    def _program(self, process: Process) -> None:
        try:
            self._connect_and_scan()
        except LaserStateUnknown as error:
            self._tell()
            self.errors.append(error)
        except TurnscanError as error:
            self.errors.append(error)
        self.wanted = False
        process.end(0)

    def _connect_and_scan(self) -> None:
        quick = Deadlines(acknowledge=1.0, move_extra=2.0, connect=4.0)
        self.device = device = board(f"{self.dialect}:p?lasers=a,b", deadlines=quick)
        try:
            if device.alarm:
                device.acknowledge()
            for step in range(10_000):
                device.move_to(0.02 * step, 20.0)
                self.world.sleep(self.random.choice([0.01, 0.1, 0.4]))
                self._expose(device, self.random.choice([{"a"}, {"b"}, {"a", "b"}]))
        finally:
            self.wanted = False
            device.close()

    def _expose(self, device: Any, lit: set[str]) -> None:
        self._show_life()
        self.wanted = True
        with _lit.burning(device, frozenset(lit)):
            end = self.world.now + self.random.choice([0.05, 0.3, 1.0, 3.0, 6.0])
            while self.world.now < end:
                self.world.sleep(0.1)
                self._show_life()
                _lit.alive()
            self.wanted = False

    def _show_life(self) -> None:
        self.sign = self.world.now

    def _tell(self) -> None:
        self.told = self.world.now
        FIGURES.told += 1

    # The judge.

    @property
    def guards(self) -> list[Process]:
        """The guard, and those that step in for it."""
        return [p for p in self.world.processes if p.name == "guard"]

    @property
    def works(self) -> bool:
        """Whether anybody of turnscan lives who could act and speak."""
        return any(p.works for p in self.world.processes)

    @property
    def clear(self) -> bool:
        """Whether what is sent arrives."""
        w = self.world
        return w.plugged and not w.deaf and not (w.cable.drop or w.cable.spoil)

    def _judge(self, passed: float) -> None:
        """Before a span of time in which nothing changes."""
        now = self.world.now
        scanner = self.scanner is not None and self.scanner.works and self.wanted
        guard = any(p.works for p in self.guards)
        held = self.work is None or self.work.held
        if scanner and guard and self.world.plugged and not held:
            self.ceased = max(self.ceased, self.sign)
            self.able = self.silent = now - self.ceased
        if not self.world.board.lit or not self.world.powered:
            self.able = self.silent = 0.0
            return
        beyond = now + passed - self.ceased
        if self.world.said and self.world.said[-1][0] > self.told:
            self.told = self.world.said[-1][0]
            FIGURES.told += 1
        # A new scanner that is not connected yet has no laser in its charge; a person has been
        # told of the one that was left lit.
        charged = self.device is not None or self.told <= self.ceased
        self.able += passed if self.works and self.clear and charged else 0.0
        self.silent += passed if self.works else 0.0
        FIGURES.longest = max(FIGURES.longest, min(beyond, self.able))
        self.longest = max(self.longest, min(beyond, self.able))
        if self.able > LONGEST_LEASE + CONFIRM:
            self._fail(
                f"lit {beyond:.2f} s beyond the last sign of life, {self.able:.2f} s of it in reach"
            )
        if self.told > self.ceased:
            FIGURES.unreached = max(FIGURES.unreached, beyond)
        elif self.silent > LONGEST_LEASE + TELL:
            self._fail(f"lit {beyond:.2f} s beyond the last sign of life, and nobody was told")

    def _fail(self, text: str) -> None:
        self.world.watch = lambda passed: None
        self.failed = True
        raise Violation(text)

    def lights(self) -> int:
        """How often a laser has been lit."""
        return sum(bool(entry.outputs) for entry in self.world.board.log)

    def fault(self, kind: str) -> None:
        """Count it."""
        FIGURES.faults[kind] += 1
        FIGURES.while_lit += bool(self.world.board.lit)

    def slip(self, line: bytes) -> None:
        """The scanner's program sends a line that it must not, while nothing is to be lit."""
        if self.random.random() < 0.8:
            self.repair()
        for _ in range(60):
            idle = self.device is not None and not self.wanted and not self.world.board.lit
            if idle:
                break
            self.world.run(0.05)
        if not idle or self.scanner is None or self.work is None:
            return
        link, before = self.device._link, self.lights()
        self.work.held = True

        def write() -> None:
            try:
                link.write(line)
            except TurnscanError as error:
                self.errors.append(error)

        self.scanner.start(write)
        self.world.run(0.3)
        self.work.held = False
        if self.lights() > before:
            self._fail(f"{line[:40]!r} lit a laser that nobody had ordered")

    def repair(self) -> None:
        """A person repairs everything, ends what hangs and starts a scan."""
        w = self.world
        w.plug()
        w.cable.repair()
        w.foreign = 0
        for process in w.processes:
            process.stopped = False
        if self.work is not None and self.work.held and self.scanner is not None:
            self.scanner.end(-9)
        self.scan()

    def reach_light(self) -> None:
        """Most of the time: wait until a laser burns, before that let a person repair things."""
        w = self.world
        if w.board.lit or self.random.random() < 0.2:
            return
        if self.random.random() < 0.8:
            self.repair()
        for _ in range(60):
            if w.board.lit:
                break
            w.run(0.05)
        w.run(self.random.choice([0.0, 0.0, 0.002, 0.1]) * self.random.random())

    def settle(self) -> None:
        """Everything is repaired: then it must be dark, with a new scanner where none was left."""
        w = self.world
        self.repair()
        w.board._deaf_until = 0.0
        if self.scanner is not None and self.scanner.alive:
            self.scanner.end(-9)
        w.run(6.0)
        if w.board.lit:
            if self.guards:
                raise Violation("still lit though everything is repaired and a guard is at work")
            self.scan()
            w.run(3.0)
            if w.board.lit and not self.wanted:
                raise Violation("a new scanner did not make it dark")
        for crash in w.crashes:
            raise Violation(f"a thread ended with {crash!r}") from crash

    def end(self) -> None:
        """Count, and take the world down."""
        FIGURES.runs += 1
        FIGURES.lit += self.lights()
        FIGURES.hours += (self.world.now - 1000.0) / 3600
        self.world.watch = lambda passed: None
        self.world.end()


Fault = Callable[[Bench], None]


def _to_scanner(how: str) -> Fault:
    def fault(bench: Bench) -> None:
        process, work = bench.scanner, bench.work
        if process is None or work is None or not process.alive:
            return
        if how in ("kill", "terminate"):
            process.end(-9 if how == "kill" else -15)
        elif how in ("stop", "go on"):
            process.stopped = how == "stop"
        else:
            work.held = how == "hang"

    return fault


def _to_guard(how: str) -> Fault:
    def fault(bench: Bench) -> None:
        for guard in bench.guards[:1]:
            if how == "kill":
                guard.end(-9)
            elif how == "terminate":
                guard.terminate()
            elif guard.stdin is not None:  # nobody watches for one that steps in being stopped
                guard.stopped = how == "stop"

    return fault


def _unplug(powered: bool) -> Fault:
    def fault(bench: Bench) -> None:
        bench.world.unplug(powered=powered)
        if seconds := bench.random.choice([0.05, 0.5, 2.0, 8.0, 30.0, 0.0]):
            bench.world.at(seconds, bench.world.plug)  # 0 s: until a person does

    return fault


def _loose(bench: Bench) -> None:
    """The cable comes loose again and again, mostly soon after the port was opened."""
    world, every = bench.world, bench.random.choice([0.3, 0.5, 1.0])
    for k in range(8):
        world.at(k * every, lambda: world.unplug(powered=True))
        world.at(k * every + 0.1, world.plug)


def _hang_up(bench: Bench) -> None:
    """The cable comes loose, and then the port hangs up while it is opened."""
    bench.world.foreign = bench.random.choice([1, 3, 10])
    bench.world.unplug(powered=True)
    bench.world.at(0.3, bench.world.plug)


def _reset(how: str) -> Fault:
    def fault(bench: Bench) -> None:
        if how == "watchdog":
            bench.world.board.hang(1.5, silent=bench.random.random() < 0.5)
        elif bench.world.powered:
            bench.world.board.power_on(silent=how == "silent reset")

    return fault


def _interlock(how: str) -> Fault:
    """A door or a limit switch, where the firmware knows them; the message may come in parts."""

    def fault(bench: Bench) -> None:
        board_ = bench.world.board
        if not isinstance(board_, GrblFirmware) or not bench.world.powered:
            return
        if how == "door, split":
            bench.world.cable.piece, bench.world.cable.gap = 9, 0.004
        if how == "alarm":
            board_._alarm(1)
        else:
            board_.open_door(ajar=False)

    return fault


def _answers(how: str) -> Fault:
    def fault(bench: Bench) -> None:
        cable, much = bench.world.cable, bench.random.choice([1, 2, 3])
        if how == "late":
            cable.late = 0.2 * much
        elif how == "split":
            cable.piece, cable.gap = much, 0.003 * much
        elif how == "lost":
            cable.lose = much
        else:
            cable.double = much

    return fault


def _bytes(how: str) -> Fault:
    """Towards the board, for two seconds."""

    def fault(bench: Bench) -> None:
        cable, much = bench.world.cable, bench.random.choice([0.1, 0.2, 0.3])
        cable.drop, cable.spoil = (much, 0.0) if how == "dropped" else (0.0, much)
        bench.world.at(2.0, cable.repair)

    return fault


FAULTS: dict[str, Fault] = {
    **{f"scanner: {h}": _to_scanner(h) for h in ("kill", "stop", "go on", "terminate")},
    **{f"scanner's thread: {h}": _to_scanner(h) for h in ("hang", "go on with the work")},
    **{f"guard: {h}": _to_guard(h) for h in ("kill", "stop", "go on", "terminate")},
    "unplugged, power kept": _unplug(True), "unplugged, power lost": _unplug(False),
    "unplugged again and again": _loose, "hangs up while it is opened": _hang_up,
    "board deaf": lambda b: b.world.board.deafen(b.random.choice([0.2, 1.0, 3.0, 10.0, 30.0])),
    **{h: _reset(h) for h in ("brown-out", "silent reset", "watchdog")},
    **{h: _interlock(h) for h in ("door", "door, split", "alarm")},
    **{f"answers {h}": _answers(h) for h in ("late", "split", "lost", "doubled")},
    **{f"bytes {h}": _bytes(h) for h in ("dropped", "spoilt")},
}  # fmt: skip


class Machine(RuleBasedStateMachine):
    """Rules are what may happen; each ends with a little time."""

    def __init__(self) -> None:
        super().__init__()
        self.stack = ExitStack()
        self.bench: Bench | None = None

    @initialize(dialect=st.sampled_from(sorted(HIDDEN)), seed=st.integers(0, 1 << 30))
    def begin(self, dialect: str, seed: int) -> None:
        """A board, and a scanner that connects to it."""
        self.bench = Bench(dialect, seed)
        self.stack.callback(self.bench.end)
        self.stack.enter_context(installed(self.bench.world))
        self.bench.scan()
        self._pass(1.0)

    def teardown(self) -> None:
        """Repair everything and look; then nothing is left."""
        try:
            if self.bench is not None and not self.bench.failed:
                self.bench.settle()
        finally:
            self.stack.close()

    @property
    def _b(self) -> Bench:
        assert self.bench is not None
        return self.bench

    def _pass(self, seconds: float) -> None:
        FIGURES.transitions += 1
        self._b.world.run(seconds)

    @rule(seconds=st.sampled_from([0.02, 0.3, 2.0, 6.0]))
    def wait(self, seconds: float) -> None:
        """Nothing happens."""
        self._pass(seconds)

    @rule()
    def repair(self) -> None:
        """A person plugs the cable in, repairs it and starts a scan."""
        self._b.repair()
        self._pass(0.5)

    def _befall(self, kinds: list[str], apart: float, after: float) -> None:
        self._b.reach_light()
        for kind in kinds:
            self._b.fault(kind)
            FAULTS[kind](self._b)
            self._pass(apart)
        self._b.world.run(after)

    @rule(
        kinds=st.lists(st.sampled_from(sorted(FAULTS)), min_size=1, max_size=3),
        apart=st.sampled_from([0.0, 0.003, 0.1, 0.6]),
        after=st.sampled_from([0.0, 0.1, 1.0, 5.0]),
    )
    def faults(self, kinds: list[str], apart: float, after: float) -> None:
        """One to three things go wrong, most of the time while a laser burns."""
        self._befall(kinds, apart, after)

    @rule(
        who=st.sampled_from([k for k in sorted(FAULTS) if k.startswith(("scanner", "guard"))]),
        where=st.sampled_from(["board deaf", "unplugged, power kept", "watchdog", "answers lost"]),
    )
    def cut_off(self, who: str, where: str) -> None:
        """A process or a thread fails while the board cannot be reached; then nothing happens."""
        self._befall([who, where] if self._b.random.random() < 0.5 else [where, who], 0.01, 8.0)

    @rule(which=st.integers(0, 99), at=st.integers(0, 20), noise=st.binary(max_size=3))
    def hidden(self, which: int, at: int, noise: bytes) -> None:
        """The scanner's program sends a line that lights a laser, in disguise."""
        line = (lines := HIDDEN[self._b.dialect])[which % len(lines)]
        self._b.fault("hidden line")
        self._b.slip(line[:at] + noise + line[at:])
        self._pass(0.1)


def explore(transitions: int, seed: int = 0, steps: int = 40) -> CalibrationQuality:
    """Run the machine for about so many transitions. Raises Violation, with the way to it."""
    global FIGURES
    FIGURES = CalibrationQuality()
    while FIGURES.transitions < transitions:
        left = max(1, math.ceil((transitions - FIGURES.transitions) / steps))
        run_state_machine_as_test(
            seeded(seed)(Machine),
            settings=settings(
                max_examples=left, stateful_step_count=steps, deadline=None, database=None,
                phases=[Phase.generate], suppress_health_check=list(HealthCheck),
                report_multiple_bugs=False,
            ),
        )  # fmt: skip
        seed += 1
    return FIGURES


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--transitions", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="put the figures into docs/safety.md")
    asked = parser.parse_args()
    table = explore(asked.transitions, asked.seed).table()
    print(table)
    if asked.write:
        before, _, rest = PAGE.read_text().partition(BEGIN)
        after = rest.partition(END)[2]
        assert after, f"{PAGE}: the marks are missing"
        PAGE.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}")


if __name__ == "__main__":
    main()
