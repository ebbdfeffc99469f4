"""Workers of a batch: processes of this machine, or those of a Dask cluster.

Both yield an outcome for every task, in the order in which they come. A worker that dies or takes
too long costs the others nothing: its task is tried again, and after some tries it is an outcome
with a problem.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import queue
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from turnscan.detection import Known
from turnscan.errors import DeviceTimeout, InputError, PluginError, TurnscanError
from turnscan.threads import thread_count
from turnscan.workflows._batch._task import (
    Outcome,
    Task,
    blocks_of,
    look_at_block,
    quiet_worker,
    run_task,
)

_LOOK = 0.2
"""s between two looks at a cluster."""
_TASKS_PER_PROCESS = 200
"""Then a new process takes the place of a worker, so that nothing can grow without end."""


Done = TypeVar("Done")


@dataclass(frozen=True)
class Patience:
    """How long and how often a task is tried."""

    tries: int = 3
    seconds: float = 3600.0
    """For one try."""
    cluster: float = 60.0
    """s without the cluster's scheduler, until the batch ends."""


@dataclass
class _Slot:
    """One worker process after another, with one task at a time."""

    threads: int
    patience: Patience
    pool: ProcessPoolExecutor | None = None
    ended: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, task: Task) -> Outcome:
        problem = ""
        for _ in range(self.patience.tries):
            pool = self._pool()
            if pool is None:
                break
            try:
                return pool.submit(run_task, task).result(self.patience.seconds)
            except BrokenProcessPool:
                problem = "its worker ended without an answer"
                self.end(for_good=False)
            except TimeoutError:
                problem = f"not done within {self.patience.seconds:g} s"
                self.end(for_good=False)
        return Outcome(task.source, "error", problem=f"{problem} ({self.patience.tries} tries)")

    def _pool(self) -> ProcessPoolExecutor | None:
        with self.lock:
            if self.pool is None and not self.ended:
                self.pool = ProcessPoolExecutor(
                    1, multiprocessing.get_context("spawn"), quiet_worker, (self.threads,),
                    max_tasks_per_child=_TASKS_PER_PROCESS,
                )  # fmt: skip
            return self.pool

    def end(self, *, for_good: bool = True) -> None:
        """End the process at once."""
        with self.lock:
            pool, self.pool = self.pool, None
            self.ended = self.ended or for_good
        if pool is None:
            return
        for process in list((getattr(pool, "_processes", None) or {}).values()):
            process.kill()
        pool.shutdown(wait=True, cancel_futures=True)


def on_this_machine(
    tasks: Sequence[Task], workers: int, patience: Patience
) -> Generator[Outcome, None, None]:
    """Run the tasks in processes of this machine; they end with the iterator.

    Raises what a task raises that is not the scan's fault, as ExportError.
    """
    waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
    for task in tasks:
        waiting.put(task)
    came: queue.SimpleQueue[Outcome | BaseException] = queue.SimpleQueue()
    workers = max(1, min(workers, len(tasks)))
    share = max(1, thread_count() // workers)
    slots = [_Slot(share, patience) for _ in range(workers)]

    def serve(slot: _Slot) -> None:
        try:
            while not slot.ended:
                came.put(slot.run(waiting.get_nowait()))
        except queue.Empty:
            pass
        except BaseException as e:  # noqa: BLE001 (raised again where the outcomes are taken)
            came.put(e)

    threads = [threading.Thread(target=serve, args=(slot,), daemon=True) for slot in slots]
    for thread in threads:
        thread.start()
    try:
        for _ in tasks:
            outcome = came.get()
            if isinstance(outcome, BaseException):
                raise outcome
            yield outcome
    finally:
        for slot in slots:
            slot.end()
        for thread in threads:
            thread.join()


def on_cluster(
    tasks: Sequence[Task], address: str, patience: Patience
) -> Generator[Outcome, None, None]:
    """Run the tasks on the Dask cluster whose scheduler is at ``address``.

    Its workers see the same folders, or the batch is on object storage. What a scheduler or a
    worker forgets is asked for again; what is there is not made again. A task that takes too long
    is not tried again: it would take another of the cluster's processors. The frames of a huge
    scan are looked through in blocks, by as many workers as there are.

    Raises PluginError where Dask is absent, InputError for an address that is none, DeviceTimeout
    where there is no scheduler.
    """
    pending = dict(enumerate(tasks))
    tries = dict.fromkeys(pending, 0)
    while pending:
        with _connected(address, patience.cluster) as client:
            futures = {
                _submitted(client, task, patience, in_blocks=not tries[number]): number
                for number, task in pending.items()
            }
            for number, came in _as_they_come(client, futures):
                if came is None:  # forgotten, or its worker died
                    tries[number] += 1
                    if tries[number] < patience.tries:
                        continue
                    problem = f"its worker ended without an answer ({patience.tries} tries)"
                    came = Outcome(pending[number].source, "error", problem=problem)
                del pending[number]
                yield came


def _submitted(client: Any, task: Task, patience: Patience, *, in_blocks: bool) -> Any:
    """The future of a task. A block that is lost makes it lost, too: then it goes on alone."""
    submit = partial(client.submit, pure=False, retries=0)
    blocks = blocks_of(task) if in_blocks else 1
    looked = [
        submit(look_within, task, patience.seconds, block, blocks)
        for block in range(blocks if blocks > 1 else 0)
    ]
    return submit(run_within, task, patience.seconds, looked)


def run_within(task: Task, seconds: float, looked: Sequence[Sequence[Known]] = ()) -> Outcome:
    """`run_task` on a worker of a cluster, which goes on to other tasks after so long.

    Should it end after all, its result is there for a batch that is begun again.
    """
    late = Outcome(task.source, "error", problem=f"not done within {seconds:g} s (1 try)")
    return _within(seconds, lambda: run_task(task, looked), late)


def look_within(task: Task, seconds: float, block: int, blocks: int) -> tuple[Known, ...]:
    """`look_at_block` on a worker of a cluster; nothing where it takes longer."""
    return _within(seconds, lambda: look_at_block(task, block, blocks), ())


def _within(seconds: float, work: Callable[[], Done], late: Done) -> Done:
    """What the work comes to, or ``late``; raises what it raises.

    Nothing can end a thread, and the process is the cluster's: what takes too long is left behind.
    """
    came: queue.SimpleQueue[tuple[Done] | BaseException] = queue.SimpleQueue()

    def run() -> None:
        try:
            came.put((work(),))
        except BaseException as e:  # noqa: BLE001 (raised again below)
            came.put(e)

    threading.Thread(target=run, daemon=True, name="task").start()
    try:
        done = came.get(timeout=seconds)
    except queue.Empty:
        return late
    if isinstance(done, BaseException):
        raise done
    return done[0]


def _as_they_come(client: Any, futures: dict[Any, int]) -> Iterator[tuple[int, Outcome | None]]:
    """The outcomes of all futures, None where one is lost; ends when the client lost them all."""
    while futures:
        came = [future for future in futures if future.status != "pending"]
        for future in came:
            number = futures.pop(future)
            if future.status == "finished":
                yield number, _result(future)
            elif future.status == "error" and isinstance(
                error := future.exception(), TurnscanError
            ):
                raise error
            else:
                yield number, None
        if not came:
            if client.status not in ("running", "connecting"):
                return
            time.sleep(_LOOK)


def _result(future: Any) -> Outcome | None:
    """What a future holds; None where the worker that has it, or the scheduler, has ended."""
    with contextlib.suppress(OSError, TimeoutError, CancelledError):
        outcome = future.result(timeout=30)
        assert isinstance(outcome, Outcome)
        return outcome
    return None


@contextlib.contextmanager
def _connected(address: str, patience: float) -> Iterator[Any]:
    try:
        import distributed
    except ImportError:
        raise PluginError(
            f"{address}: a cluster needs Dask", hint="pip install 'turnscan[farm]'"
        ) from None
    connect: Any = distributed.Client
    end = time.monotonic() + patience
    while True:
        try:
            client = connect(address, timeout=min(10.0, patience), set_as_default=False)
            break
        except ValueError as e:
            raise InputError(f"{address}: {e}", hint="give an address like tcp://host:8786") from e
        except (OSError, TimeoutError) as e:
            if time.monotonic() > end:
                raise DeviceTimeout(
                    f"{address}: no scheduler of a Dask cluster answered within {patience:g} s",
                    hint="start it, and repeat the command: what is done is not done again",
                ) from e
            time.sleep(_LOOK)
    try:
        yield client
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.close(timeout=5)
