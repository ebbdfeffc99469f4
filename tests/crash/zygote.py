"""A process that has everything in memory and forks: scans that are killed, raced and starved.

Started as ``python -m tests.crash.zygote``; one JSON request a line on stdin, one JSON answer a
line on stdout. Each request forks a child: a hundred killed scans cost no hundred starts.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import random
import select
import signal
import sqlite3
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from tests.acquire import rig as rigs
from turnscan.acquire import FirstLook, Stored, look, run
from turnscan.errors import TurnscanError
from turnscan.scan import Scan
from turnscan.scan import _database as database
from turnscan.scan import _file as files

STEPS = 400
WAITING: list[None] = []
rigs.picture_of = cache(rigs.picture_of)  # the simulated camera is not what is tested


def plan(steps: int) -> Any:
    return rigs.plan_of(steps, lasers=("left",), dark_every=4, blind_steps=0)


def scan(
    path: Path, steps: int, said: int = -1, mutant: bool = False, rest: float = 0.0
) -> dict[str, Any]:
    """Scan or resume, resting for ``rest`` s at each step; a byte to ``said`` at each commit."""
    rig = rigs.Rig()
    disk = _disk()
    insert = database.insert

    def told(*args: Any) -> int:
        with contextlib.suppress(BlockingIOError):
            os.write(said, b".")
        return insert(*args)

    def heard(event: object) -> None:
        if isinstance(event, Stored):
            time.sleep(rest)
            if disk:
                disk.disk_mark(event.step)

    if said >= 0:
        database.insert = told
    out: dict[str, Any] = {"error": "", "named": True, "halted": True}
    try:
        first: FirstLook | None = None
        if not path.exists():
            first = look(plan(steps), rig.hardware)
            Scan.create(path, first.scan_plan).close()
        with Scan.resume(path) as opened:
            if mutant:
                opened._db.execute("PRAGMA synchronous = OFF")
            out["halted"] = False
            try:
                run(
                    plan(steps),
                    rig.hardware,
                    opened,
                    first=first,
                    clock=lambda: 5.0,
                    listener=heard,
                )
                out["halted"] = True
            finally:
                out["halted"] |= rig.said[-2:] == ["off", "stop"]
    except Exception as e:
        out["error"] = type(e).__name__
        out["named"] = isinstance(e, TurnscanError)
        out["text"] = str(e)
        if not out["named"]:
            traceback.print_exc()
    out["lit"] = bool(rig.lit)
    return out


def fork(work: Any) -> tuple[int, int]:
    """Run ``work`` in a child; its answer comes through the descriptor."""
    read, write = os.pipe()
    pid = os.fork()
    if pid:
        os.close(write)
        return pid, read
    try:
        os.close(read)
        os.write(write, json.dumps(work()).encode())
    finally:
        os._exit(0)


def answer(pid: int, read: int) -> Any:
    said = b""
    while more := os.read(read, 65536):
        said += more
    os.close(read)
    os.waitpid(pid, 0)
    return json.loads(said) if said else None


def repair(path: Path, texts: list[str], said: int = -1) -> None:
    """Append edits to a scan file; a byte to ``said`` before each."""
    with Scan.resume(path) as opened:
        for text in texts:
            os.write(said, b".")
            opened.append_edit(text, 5.0)


def kill_edits(ask: dict[str, Any]) -> dict[str, Any]:
    """Kill an edit session ``delay`` s after the beginning of edit ``commit``."""
    return _killed(ask, lambda said: repair(Path(ask["path"]), ask["texts"], said))


def kill(ask: dict[str, Any]) -> dict[str, Any]:
    """Kill a scan ``delay`` s after the beginning of commit ``commit``, or of the scan where 0."""

    def work(said: int) -> Any:
        if ask.get("mutant"):
            files.transaction = by_tens  # type: ignore[attr-defined]
        return scan(Path(ask["path"]), ask["steps"], said)

    return _killed(ask, work)


@contextlib.contextmanager
def by_tens(db: sqlite3.Connection) -> Iterator[None]:
    """The mutant: ten frames in one transaction."""
    if not db.in_transaction:
        db.execute("BEGIN IMMEDIATE")
    yield
    WAITING.append(None)
    if len(WAITING) % 10 == 0:
        db.execute("COMMIT")


def _killed(ask: dict[str, Any], work: Callable[[int], Any]) -> dict[str, Any]:
    told, said = os.pipe()
    os.set_blocking(said, False)
    path = Path(ask["path"])
    pid, read = fork(lambda: work(said))
    os.close(said)
    seen = 0
    while seen < ask["commit"] and (more := os.read(told, ask["commit"] - seen)):
        seen += len(more)
    end = time.perf_counter() + ask["delay"]
    while time.perf_counter() < end:
        pass
    os.kill(pid, signal.SIGKILL)
    done = answer(pid, read)
    os.close(told)
    return {"done": done is not None, "beside": sorted(p.name for p in path.parent.iterdir())}


def whole(ask: dict[str, Any]) -> dict[str, Any]:
    """Scan, or resume, to the end, with a rest at each step where one is asked for."""
    began = time.perf_counter()
    done = answer(*fork(lambda: scan(Path(ask["path"]), ask["steps"], rest=ask.get("rest", 0.0))))
    return {**done, "seconds": time.perf_counter() - began}


def race(ask: dict[str, Any]) -> dict[str, Any]:
    """Two processes open the same scan at the same time; who gets it writes one frame."""
    path = Path(ask["path"])
    gate, go = os.pipe()
    hold, let = os.pipe()

    def enter() -> str:
        os.close(go)
        os.close(let)
        select.select([gate], [], [])
        try:
            with Scan.resume(path):
                select.select([hold], [], [])
                return "got it"
        except TurnscanError as e:
            return type(e).__name__

    children = [fork(enter) for _ in range(2)]
    os.close(go)
    readable, _, _ = select.select([read for _, read in children], [], [], 10.0)
    os.close(let)
    results = sorted(answer(*child) for child in children)
    os.close(gate)
    os.close(hold)
    return {"results": results, "first": len(readable)}


def starve(ask: dict[str, Any]) -> dict[str, Any]:
    """A scan whose n-th call to the disk fails; then, on a sound disk, the rest of it."""
    path = Path(ask["path"])

    def work() -> dict[str, Any]:
        disk = _disk()
        if ask.get("mutant"):  # errors of the database come out as they are
            files.storage = database.storage = contextlib.nullcontext  # type: ignore[assignment]
        disk.disk_fail(ask["n"], ask["errno"], int(ask["lasting"]))
        out = scan(path, ask["steps"])
        out["calls"] = disk.disk_calls()
        return out

    out = answer(*fork(work)) or {"error": "died", "named": False}
    out["there"] = path.exists()
    out["after"] = answer(*fork(lambda: scan(path, ask["steps"])))
    out["beside"] = sorted(p.name for p in path.parent.iterdir())
    return out


def logged(ask: dict[str, Any]) -> dict[str, Any]:
    """A whole scan whose writes and syncs are logged."""

    def work() -> dict[str, Any]:
        fd = os.open(ask["log"], os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
        _disk().disk_log(fd)
        return scan(Path(ask["path"]), ask["steps"], mutant=ask["mutant"])

    return answer(*fork(work))


def children(ask: dict[str, Any]) -> dict[str, Any]:
    """Processes that are left of all this."""
    try:
        pid, _ = os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        pid = 0
    return {"children": pid, "descriptors": len(os.listdir("/proc/self/fd"))}


@cache
def _disk() -> Any:
    library = os.environ.get("DISK_LIBRARY")
    return ctypes.CDLL(library) if library else None


def main() -> None:
    random.seed(0)
    with tempfile.TemporaryDirectory() as folder:
        # What a first scan loads, and the pictures: every child would do that for itself.
        scan(Path(folder) / "first.turnscan", STEPS)
    gc.collect()
    gc.freeze()
    verbs = {f.__name__: f for f in (kill, kill_edits, whole, race, starve, logged, children)}
    for line in sys.stdin:
        ask = json.loads(line)
        print(json.dumps(verbs[ask["do"]](ask)), flush=True)


if __name__ == "__main__":
    main()
