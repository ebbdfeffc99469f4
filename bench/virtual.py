"""A computer that is not there: processes, threads, pipes, a serial port and a clock of its own.

The laser guard, its link and the drivers run in it unchanged: what they import as ``time``,
``threading``, ``queue``, ``os`` and ``subprocess`` is replaced by things of the same name that know
only this world's time. So hours pass in seconds, every run with the same seed is the same, and a
process can be killed or stopped between any two of its steps.
"""

from __future__ import annotations

import heapq
import termios
from collections.abc import Callable
from random import Random

from greenlet import getcurrent, greenlet

from turnscan.devices import _dialects, _guard
from turnscan.simulate.controllers import Cable, Firmware

_TICK = 1e-6
"""s that looking at the clock takes: who waits in a circle sees time pass."""
_WIRE = 0.001
"""s that bytes take to the board or back."""
_MOST_STEPS = 200_000
"""Of all threads without any time passing; more is a circle that nobody leaves."""


class Killed(BaseException):
    """A thread of a process that is no more."""


class Actor:
    """A thread."""

    def __init__(self, process: Process, target: Callable[[], object]) -> None:
        self.process = process
        self.ready: Callable[[], bool] = lambda: True
        self.deadline = float("inf")
        self.held = False
        """It hangs, though its process runs."""
        self._target = target
        self.light = greenlet(self._run, parent=process.world.hub)

    def _run(self) -> None:
        try:
            self._target()
        except Killed:
            pass
        except BaseException as error:
            if self.process.alive:
                self.process.world.crashes.append(error)
                raise
        finally:
            self.process.end_actor(self)


class Process:
    """Some threads that live and die together."""

    def __init__(self, world: World, name: str) -> None:
        self.world, self.name = world, name
        self.stopped = False
        self.code: int | None = None
        self.actors: list[Actor] = []
        self.pipes: list[Pipe] = []
        self.guard: _guard.Guard | None = None
        self.stdin: Pipe | None = None
        self.stdout: Pipe | None = None
        world.processes.append(self)

    @property
    def alive(self) -> bool:
        """Not yet ended."""
        return self.code is None

    @property
    def works(self) -> bool:
        """Alive, and not stopped."""
        return self.code is None and not self.stopped

    def start(self, target: Callable[[], object]) -> Actor:
        """Another thread."""
        actor = Actor(self, target)
        self.actors.append(actor)
        return actor

    def end_actor(self, actor: Actor) -> None:
        """It has returned."""
        if actor in self.actors:
            self.actors.remove(actor)

    def end(self, code: int) -> None:
        """The process is gone, now; the system closes what it had open."""
        if self.code is not None:
            return
        self.code = code
        for pipe in self.pipes:
            pipe.hang_up(self)
        if self.world.owner is not None and self.world.owner.process is self:
            self.world.owner = None
        self.world.graves += self.actors
        self.actors = []
        self.world.processes.remove(self)

    def terminate(self) -> None:
        """SIGTERM, which the guard hears and the scanner does not."""
        if self.guard is None:
            self.end(-15)
        else:
            self.start(self.guard.terminated)


class Pipe:
    """Bytes from one process to another."""

    def __init__(self, writer: Process, reader: Process) -> None:
        self.writer, self.reader = writer, reader
        self.data = bytearray()
        self.write_open = self.read_open = True
        writer.pipes.append(self)
        reader.pipes.append(self)

    def hang_up(self, process: Process) -> None:
        """A process has ended, or closed its end."""
        if process is self.writer:
            self.write_open = False
        else:
            self.read_open = False

    def write(self, data: bytes) -> int:
        """Waits while the reader is 64 KiB behind. Raises BrokenPipeError."""
        world = self.writer.world
        world.wait(lambda: not self.read_open or len(self.data) < 65536, None)
        if not (self.read_open and self.write_open):
            raise BrokenPipeError(32, "broken pipe")
        self.data += data
        return len(data)

    def read(self, most: int) -> bytes:
        """Waits for a first byte; b"" at the end."""
        self.reader.world.wait(lambda: bool(self.data) or not self.write_open, None)
        data = bytes(self.data[:most])
        del self.data[:most]
        return data

    def close(self) -> None:
        """By whoever asks."""
        if (actor := self.writer.world.current) is not None:
            self.hang_up(actor.process)

    def fileno(self) -> Pipe:
        """What `os.read` is given."""
        return self


class Port:
    """The serial port as pyserial shows it to one process."""

    def __init__(self, world: World) -> None:
        assert world.current is not None
        self._world, self.process = world, world.current.process
        self._plugging = world.plugging
        self.timeout = 0.2  # longer than the real one, which only makes threads go round
        self._open = True
        world.heard.clear()

    @property
    def _gone(self) -> bool:
        return not self._open or self._plugging != self._world.plugging or not self._world.plugged

    def _check(self) -> None:
        self._world.check()
        if self._gone:
            raise OSError(5, "[Errno 5] device reports readiness but returned no data")

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        self._check()
        return len(self._world.heard)

    def write(self, data: bytes) -> int:
        """To the board."""
        self._check()
        self._world.send(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes; fewer when the time is over."""
        self._check()
        self._world.wait(lambda: self._gone or len(self._world.heard) >= size, self.timeout)
        self._check()
        data = bytes(self._world.heard[:size])
        del self._world.heard[:size]
        return data

    def reset_output_buffer(self) -> None:
        """Everything sent has left already. Raises what pyserial lets through."""
        self._world.check()
        if self._gone:
            raise termios.error(5, "Input/output error")

    def close(self) -> None:
        """Another may open it."""
        self._open = False
        if self._world.owner is self:
            self._world.owner = None


class World:
    """Time, a board with its cable, and the processes that want to talk to it."""

    def __init__(self, board: Firmware, seed: int = 0) -> None:
        self.random = Random(seed)
        self.now = 1000.0
        self.hub = getcurrent()
        self.current: Actor | None = None
        self.processes: list[Process] = []
        self.graves: list[Actor] = []
        self.crashes: list[BaseException] = []
        self.said: list[tuple[float, str]] = []
        """What was written to people."""
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0
        self.board, self.cable = board, Cable(seed)
        board.clock = lambda: self.now
        del board.log[:-1]
        self._begin = self.now
        self.plugged, self.plugging, self.powered = True, 0, True
        self.owner: Port | None = None
        self.foreign = 0
        """How often the port hangs up while it is opened."""
        self.heard = bytearray()
        self.watch: Callable[[float], None] = lambda passed: None
        """Called with each span of time before it passes; nothing changes within it."""

    # Time.

    def wait(self, ready: Callable[[], bool], timeout: float | None) -> bool:
        """The current thread waits; True when what it waits for is there."""
        actor = self.current
        assert actor is not None
        self.check()
        actor.ready = ready
        actor.deadline = float("inf") if timeout is None else self.now + max(timeout, 0.0)
        self.hub.switch()
        self.check()
        return ready()

    def check(self) -> None:
        """Raises Killed where the current thread's process has ended."""
        if self.current is not None and not self.current.process.alive:
            raise Killed

    def sleep(self, seconds: float) -> None:
        """The current thread sleeps."""
        self.wait(lambda: False, seconds)

    def clock(self) -> float:
        """Looking at it takes a moment."""
        self.check()
        self.now += _TICK
        return self.now

    def at(self, delay: float, act: Callable[[], None]) -> None:
        """Let something happen in so many seconds."""
        self._count += 1
        heapq.heappush(self._events, (self.now + delay, self._count, act))

    def run(self, seconds: float) -> None:
        """Let time pass; called from outside of all threads."""
        end = self.now + seconds
        while True:
            self._let_run()
            step = self._next()
            if step >= end:
                self._pass(end)
                return
            self._pass(step)

    def _next(self) -> float:
        times = [self._events[0][0]] if self._events else []
        for process in self.processes:
            if not process.stopped:
                times += [a.deadline for a in process.actors if not a.held]
        if (wake := self.board.wake()) is not None and self.powered:
            times.append(self._begin + wake)
        if (arrives := self.cable.wake()) is not None:
            times.append(arrives)
        return max(min(times, default=float("inf")), self.now + _TICK)

    def _pass(self, time: float) -> None:
        self.watch(max(0.0, time - self.now))
        self.now = max(time, self.now)
        self._run_board()
        while self._events and self._events[0][0] <= self.now:
            heapq.heappop(self._events)[2]()

    def _run_board(self) -> None:
        if not self.powered:
            return
        self.board.run(self.now - self._begin)
        said = self.board.take()
        if self.plugged:
            self.cable.up(said, self.now + _WIRE)
            self.heard += self.cable.arrived(self.now)

    def _let_run(self) -> None:
        for _ in range(_MOST_STEPS):
            self._bury()
            now = self.now
            ready = [
                actor
                for process in self.processes
                if not process.stopped
                for actor in process.actors
                if not actor.held and (now >= actor.deadline or actor.ready())
            ]
            if not ready:
                return
            self._switch(ready[0] if len(ready) == 1 else self.random.choice(ready))
        raise AssertionError("threads that wait for nothing, in a circle")

    def _switch(self, actor: Actor) -> None:
        self.current = actor
        try:
            actor.light.switch()
        finally:
            self.current = None

    def _bury(self) -> None:
        """Threads of ended processes: none of what they still do has an effect."""
        while self.graves:
            actor = self.graves.pop()
            self.current = actor
            for _ in range(100):
                if actor.light.dead or not actor.light:
                    break
                actor.light.throw(Killed)
            self.current = None

    # The board and its port.

    def open_port(self, path: str, baud: int, dtr: bool, library: str = "") -> Port:
        """As `turnscan.devices._dialects.open_port`."""
        self.check()
        if not self.plugged:
            raise OSError(2, f"[Errno 2] could not open port {path}: no such file")
        if self.owner is not None:
            raise OSError(11, "Could not exclusively lock port: [Errno 11]")
        if self.foreign:
            self.foreign -= 1
            with _dialects.foreign_as_oserror():
                raise termios.error(5, "Input/output error")
        self.owner = Port(self)
        return self.owner

    def send(self, data: bytes) -> None:
        """Bytes set out for the board."""
        plugging = self.plugging

        def arrive() -> None:
            if self.plugged and plugging == self.plugging and self.powered:
                self._run_board()
                self.board.feed(self.cable.down(data))
                self._run_board()

        self.at(_WIRE, arrive)

    def unplug(self, *, powered: bool) -> None:
        """The cable is out; ``powered``: the board has a supply of its own."""
        if not self.plugged:
            return
        self.plugged, self.powered = False, powered
        self.plugging += 1
        self.owner = None
        self.cable.cut()
        if not powered:
            self.board._set_lit(frozenset())

    def plug(self) -> None:
        """The cable is in again."""
        if self.plugged:
            return
        if not self.powered:
            self.powered = True
            self.board.run(self.now - self._begin)
            self.board.power_on()
        self.board.take()
        self.plugged = True
        self.plugging += 1

    @property
    def deaf(self) -> bool:
        """Whether the board hears nothing."""
        return not self.powered or self.board._deaf_until > self.board.now

    def end(self) -> None:
        """All processes are killed."""
        for process in list(self.processes):
            process.end(-9)
        self._bury()

    def spawn_guard(self, argument: str, parent: Process, piped: bool) -> Process:
        """A guard's process, as the link starts it."""
        process = Process(self, "guard")
        if piped:
            process.stdin, process.stdout = Pipe(parent, process), Pipe(process, parent)

        def main() -> None:
            process.end(_guard.main(argument))

        def begin() -> None:
            if process.alive:
                process.start(main)

        self.at(0.05, begin)  # Python takes its time to start
        return process


__all__ = ["Actor", "Killed", "Process", "World"]
