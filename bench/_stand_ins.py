"""What stands in for threads, queues and processes in a `bench.virtual.World`."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from typing import Any
from unittest import mock

from bench.virtual import Pipe, Process, World
from turnscan.devices import _dialects, _guard


@contextmanager
def installed(world: World) -> Iterator[None]:
    """The drivers, the link and the guard see this world instead of the real one."""
    fakes = {
        "time": SimpleNamespace(monotonic=world.clock, sleep=world.sleep),
        "threading": Threading(world), "queue": Queues(world),
        "os": Os(world), "subprocess": Subprocess(world),
    }  # fmt: skip

    def own_signals(guard: _guard.Guard) -> None:
        assert world.current is not None
        world.current.process.guard = guard

    with ExitStack() as stack:
        for name, module in list(sys.modules.items()):
            if not name.startswith("turnscan.devices._"):
                continue
            for attribute, fake in fakes.items():
                if getattr(module, attribute, None) is sys.modules[attribute]:
                    stack.enter_context(mock.patch.object(module, attribute, fake))
        for module in (_guard, _dialects):
            stack.enter_context(mock.patch.object(module, "open_port", world.open_port))
        stack.enter_context(mock.patch.object(_guard, "_own_signals", own_signals))
        yield


class Threading:
    def __init__(self, world: World) -> None:
        self._world = world

    def Thread(  # noqa: N802 (stands for a class)
        self, *, target: Callable[..., object], args: tuple[Any, ...] = (), daemon: bool = True,
        name: str = "",
    ) -> _Thread:  # fmt: skip
        return _Thread(self._world, lambda: target(*args))

    def Lock(self) -> _Lock:  # noqa: N802
        return _Lock(self._world)

    def RLock(self) -> _OwnedLock:  # noqa: N802
        return _OwnedLock(self._world)

    def Event(self) -> _Event:  # noqa: N802
        return _Event(self._world)


class _Thread:
    def __init__(self, world: World, target: Callable[[], object]) -> None:
        self._world, self._target, self._over = world, target, False
        self._started = False

    def start(self) -> None:
        assert self._world.current is not None
        self._world.check()
        self._started = True
        self._world.current.process.start(self._run)

    def _run(self) -> None:
        try:
            self._target()
        finally:
            self._over = True

    def is_alive(self) -> bool:
        return self._started and not self._over

    def join(self, timeout: float | None = None) -> None:
        self._world.wait(lambda: self._over, timeout)


class _Lock:
    def __init__(self, world: World) -> None:
        self._world, self._taken = world, False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        if self._taken:
            patience = (None if timeout < 0 else timeout) if blocking else 0.0
            if not self._world.wait(lambda: not self._taken, patience):
                return False
        self._taken = True
        return True

    def release(self) -> None:
        self._taken = False

    def locked(self) -> bool:
        return self._taken

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class _OwnedLock(_Lock):
    """Only who has taken it lets go of it; nobody here takes it twice."""

    _owner: object = None

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        got = super().acquire(blocking, timeout)
        if got:
            self._owner = self._world.current
        return got

    def release(self) -> None:
        if not self._taken or self._owner is not self._world.current:
            raise RuntimeError("cannot release un-acquired lock")
        super().release()


class _Event:
    def __init__(self, world: World) -> None:
        self._world, self._is_set = world, False

    def set(self) -> None:
        self._is_set = True

    def clear(self) -> None:
        self._is_set = False

    def is_set(self) -> bool:
        return self._is_set

    def wait(self, timeout: float | None = None) -> bool:
        return self._is_set or self._world.wait(self.is_set, timeout)


class Queues:
    Empty, Full = queue.Empty, queue.Full

    def __init__(self, world: World) -> None:
        self._world = world

    def Queue(self, maxsize: int = 0) -> _Queue:  # noqa: N802
        return _Queue(self._world, maxsize)

    def SimpleQueue(self) -> _Queue:  # noqa: N802
        return _Queue(self._world, 0)


class _Queue:
    def __init__(self, world: World, maxsize: int) -> None:
        self._world, self._most = world, maxsize or 1 << 30
        self._items: deque[Any] = deque()
        self.unfinished_tasks = 0

    def put(self, item: Any) -> None:
        if len(self._items) >= self._most:
            self._world.wait(lambda: len(self._items) < self._most, None)
        self._add(item)

    def put_nowait(self, item: Any) -> None:
        self._world.check()
        if len(self._items) >= self._most:
            raise queue.Full
        self._add(item)

    def _add(self, item: Any) -> None:
        self._items.append(item)
        self.unfinished_tasks += 1

    def get(self, timeout: float | None = None) -> Any:
        if not self._items and not self._world.wait(lambda: bool(self._items), timeout):
            raise queue.Empty
        return self._items.popleft()

    def get_nowait(self) -> Any:
        if not self._items:
            raise queue.Empty
        return self._items.popleft()

    def task_done(self) -> None:
        self.unfinished_tasks -= 1


class Os:
    """Standard input and output are the process's pipes; what goes to 2 is for people."""

    def __init__(self, world: World) -> None:
        self._world = world

    def read(self, file: int | Pipe, most: int) -> bytes:
        if not isinstance(file, int):
            return file.read(most)
        process = self._process()
        assert process.stdin is not None
        return process.stdin.read(most)

    def write(self, file: int, data: bytes) -> int:
        process = self._process()
        if file == 2:
            self._world.check()
            self._world.said.append((self._world.now, data.decode()))
        elif process.stdout is not None:
            return process.stdout.write(data)
        return len(data)

    def _process(self) -> Process:
        assert self._world.current is not None
        return self._world.current.process

    def isatty(self, file: int) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)


class Subprocess:
    PIPE, DEVNULL = subprocess.PIPE, subprocess.DEVNULL
    TimeoutExpired = subprocess.TimeoutExpired

    def __init__(self, world: World) -> None:
        self._world = world

    def Popen(self, command: list[str], *, stdin: int, **_: Any) -> _Popen:  # noqa: N802
        return _Popen(self._world, command[-1], stdin == subprocess.PIPE)


class _Popen:
    def __init__(self, world: World, argument: str, piped: bool) -> None:
        assert world.current is not None
        world.check()
        self._world = world
        self.process = world.spawn_guard(argument, world.current.process, piped)
        self.stdin, self.stdout = self.process.stdin, self.process.stdout
        self.pid = id(self.process)

    def kill(self) -> None:
        self._world.check()
        self.process.end(-9)

    def poll(self) -> int | None:
        return self.process.code

    def wait(self, timeout: float | None = None) -> int:
        if not self._world.wait(lambda: self.process.code is not None, timeout):
            raise subprocess.TimeoutExpired("guard", timeout or 0.0)
        assert self.process.code is not None
        return self.process.code
