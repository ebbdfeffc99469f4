"""Jobs: work that takes longer than a click: in threads, with progress, to be cancelled."""

from __future__ import annotations

import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from turnscan.app._hub import Hub
from turnscan.app._protocol import JobState, Remark, RemedyOption, ResultFile, ResultTable
from turnscan.errors import SafetyError, TurnscanError
from turnscan.findings import Finding
from turnscan.progress import Cancelled, Progress
from turnscan.remedy import Option, Remedy, plain_words

What = Literal["open", "edit", "export", "doctor", "calibrate", "scan", "verb", "demo"]
_TELL_EVERY = 0.1
_SOON = 0.5
"""s that a request may take before it is shown as a job."""
_SHARES = 1000
"""Steps of work whose progress is reported."""
_KEPT = 32
"""Jobs that are over and still known."""

_log = logging.getLogger("turnscan.app")


@dataclass(frozen=True)
class Result:
    """What a job came to."""

    text: str = ""
    download: str | None = None
    findings: Sequence[Finding] = ()
    files: Sequence[ResultFile] = ()
    tables: Sequence[ResultTable] = ()


class Job:
    """One piece of work; `tick` and `check` are for its own thread, `cancel` for any."""

    def __init__(
        self, hub: Hub, what: What, title: str, scan: str | None, *, shown: bool = True
    ) -> None:
        self.id = secrets.token_urlsafe(9)
        self.what, self.title, self.scan = what, title, scan
        self.on_cancel: Callable[[], None] = lambda: None
        self._hub = hub
        self._cancelled = threading.Event()
        self._done = 0
        self._total: int | None = None
        self._began = time.monotonic()
        self._told = 0.0
        self._lock = threading.Lock()
        self.over = False
        self.shown = shown
        """Whether progress is reported to anybody."""

    def steps(self, total: int | None) -> None:
        """How many ticks there will be."""
        self._total = total

    def at(self, done: int) -> None:
        """So many steps are done, reported now and then; raises nothing."""
        self._done = done
        self._tell_now_and_then()

    @property
    def progress(self) -> Progress:
        """The same as workflows report it and ask for its end."""
        return Progress(self._share, lambda: self.cancelled)

    def _share(self, fraction: float, text: str) -> None:
        self._total, self._done = _SHARES, round(_SHARES * fraction)
        self._tell_now_and_then()

    def tick(self) -> None:
        """One step further, from any thread of the work. Raises Cancelled."""
        with self._lock:
            self._done += 1
        self.check()
        self._tell_now_and_then()

    def _tell_now_and_then(self) -> None:
        if self.shown and time.monotonic() - self._told > _TELL_EVERY:
            self._told = time.monotonic()
            self.tell("running")

    @property
    def cancelled(self) -> bool:
        """Whether somebody has cancelled it."""
        return self._cancelled.is_set()

    def check(self) -> None:
        """Raise Cancelled where somebody has cancelled it."""
        if self._cancelled.is_set():
            raise Cancelled

    def wait(self, seconds: float) -> None:
        """Let time pass. Raises Cancelled as soon as somebody cancels it."""
        if self._cancelled.wait(seconds):
            raise Cancelled

    def cancel(self) -> None:
        """End it at its next tick."""
        with self._lock:
            if self.over:
                return
            self._cancelled.set()
        self.on_cancel()

    def commit(self) -> None:
        """From here on it cannot be cancelled. Raises Cancelled where it was before."""
        with self._lock:
            self.check()
            self.over = True

    def tell(
        self,
        state: Literal["running", "done", "failed", "cancelled"],
        result: Result | None = None,
        hint: str = "",
        options: Sequence[RemedyOption] = (),
    ) -> None:
        """Tell everybody how far it is."""
        result = result or Result()
        left = None
        if state == "running" and self._total and self._done:
            left = (time.monotonic() - self._began) / self._done * (self._total - self._done)
        self._hub.tell(
            JobState(
                job=self.id, what=self.what, scan=self.scan, title=self.title, state=state,
                done=self._done, total=self._total, seconds_left=None if left is None
                else max(left, 0.0), text=result.text, hint=hint, options=list(options),
                download=result.download, files=list(result.files),
                tables=list(result.tables),
                findings=remarks(result.findings, self._hub.hide),
            )
        )  # fmt: skip


class Jobs:
    """All jobs of the server."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._lock = threading.Lock()
        self._jobs: dict[str, Job] = {}
        self._threads: set[threading.Thread] = set()

    def start(
        self, what: What, title: str, work: Callable[[Job], Result], scan: str | None = None
    ) -> Job:
        """Begin a piece of work in a thread of its own."""
        job = Job(self._hub, what, title, scan)
        thread = threading.Thread(target=self._run, args=(job, work), name=f"job {what}")
        self._list(job)
        with self._lock:
            self._threads.add(thread)
        job.tell("running")
        thread.start()
        return job

    def _list(self, job: Job) -> None:
        with self._lock:
            over = [name for name, j in self._jobs.items() if j.over]
            for name in over[: max(0, len(over) - _KEPT)]:
                del self._jobs[name]
            self._jobs[job.id] = job

    @contextlib.contextmanager
    def perhaps(self, what: What, title: str, scan: str) -> Iterator[Job]:
        """A request in the caller's thread, which is shown as a job only once it takes long."""
        job = Job(self._hub, what, title, scan, shown=False)
        telling, ended = threading.Lock(), False

        def show() -> None:
            with telling:
                if not ended:
                    job.shown = True
                    self._list(job)
                    job.tell("running")

        def end(state: Literal["done", "failed", "cancelled"]) -> None:
            nonlocal ended
            job.over = True
            with telling:
                ended = True
                if job.shown:
                    job.tell(state)

        timer = threading.Timer(_SOON, show)
        timer.daemon = True
        timer.start()
        try:
            yield job
        except Cancelled:
            end("cancelled")
            raise
        except BaseException:
            end("failed")
            raise
        else:
            end("done")
        finally:
            timer.cancel()

    def cancel(self, name: str) -> bool:
        """End a job; False where there is none of that name."""
        with self._lock:
            job = self._jobs.get(name)
        if job is not None:
            job.cancel()
        return job is not None

    def close(self, seconds: float = 10.0) -> None:
        """Cancel all, and wait for their ends."""
        with self._lock:
            jobs, threads = list(self._jobs.values()), list(self._threads)
        for job in jobs:
            job.cancel()
        until = time.monotonic() + seconds
        for thread in threads:
            thread.join(max(0.0, until - time.monotonic()))

    def _run(self, job: Job, work: Callable[[Job], Result]) -> None:
        try:
            result = work(job)
        except Cancelled:
            job.tell("cancelled")
        except TurnscanError as e:
            stopped = job.cancelled and not isinstance(e, SafetyError)
            text, hint = self._hub.hide(e.message), self._hub.hide(plain_words(e.hint))
            job.tell("cancelled" if stopped else "failed", Result(text), hint, options_of(e))
        except MemoryError:
            job.tell("failed", Result("out of memory"), "close other programs, or use less")
        except Exception as e:  # noqa: BLE001 the door: whatever is left is our mistake
            _log.error("internal error (%s) in job %s", type(e).__name__, job.what)
            job.tell("failed", Result("internal error"), "please report it")
        else:
            job.tell("done", result)
        finally:
            job.over = True
            with self._lock:
                self._threads.discard(threading.current_thread())


def options_of(error: TurnscanError) -> list[RemedyOption]:
    """The options that an error is about, and those that its hint names."""
    named = () if error.option is None else (error.option,)
    return _options((*named, *_named(error.hint)))


def _named(remedy: str | Remedy) -> tuple[Option, ...]:
    return () if isinstance(remedy, str) else remedy.options


def _options(options: Sequence[Option]) -> list[RemedyOption]:
    return [
        RemedyOption(name=o.name, value=None if o.value is None else o.value_text) for o in options
    ]


def remarks(findings: Sequence[Finding], hide: Callable[[str], str]) -> list[Remark]:
    """Findings in the words of the browser; ``hide`` takes paths of this computer out of them."""
    return [
        Remark(
            code=f.code,
            severity=f.severity,
            text=hide(f.message),
            where=hide(f.where),
            remedy=hide(plain_words(f.remedy)),
            options=_options(_named(f.remedy)),
        )
        for f in findings
    ]
