"""One task of a batch: a scan, or a folder of pictures, becomes a folder with its result.

It runs in a process of its own, on this machine or another, and is idempotent: the folder is named
by the content of the scan, the recipe and the version of turnscan, and what is there is not made
again. What goes wrong with a scan is its outcome, not the end of the batch.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

from turnscan import __version__, threads
from turnscan.detection import Known
from turnscan.errors import (
    CalibrationError,
    ExportError,
    FormatError,
    InputError,
    ScanCorrupt,
    ScanNewer,
    TurnscanError,
)
from turnscan.findings import record
from turnscan.json_text import strict_json
from turnscan.workflows._batch import _storage as storage
from turnscan.workflows._batch._recipe import Recipe
from turnscan.workflows._batch._scratch import scratch
from turnscan.workflows._files._reading import read_rig_file
from turnscan.workflows._importing._pictures import import_pictures
from turnscan.workflows._inspection._compare import compare
from turnscan.workflows._options._units import check_step
from turnscan.workflows._surface._loading import load
from turnscan.workflows._surface._reconstruct import Order
from turnscan.workflows._surface._result import ReconstructResult

State = Literal["done", "pass", "fail", "error"]
THUMBNAIL = "thumbnail.png"
_FORMAT, _VERSION = "turnscan-outcome", 1
_BLOCK = 128 << 20
"""Bytes of a scan file that one worker looks through: some 2 000 frames of 5 megapixels."""
_LASTING = (InputError, CalibrationError, ScanCorrupt, ScanNewer)
"""Errors that a scan has for ever, with this recipe: kept as its result. Others may pass."""


@dataclass(frozen=True)
class Task:
    """A scan of a batch, and what is to become of it."""

    source: str
    """Scan file or folder of pictures, by its absolute name or its address."""
    recipe: Recipe
    output: str
    """Folder of the batch, by its absolute name or its address."""
    again: bool = False
    """Make it also where it is there."""


@dataclass(frozen=True)
class Outcome:
    """What became of a scan of a batch."""

    source: str
    state: State
    """``error``: there is no result; ``pass``, ``fail``: of the comparison; else ``done``."""
    folder: str = ""
    """Name of its folder in that of the batch; empty where it has none."""
    problem: str = ""
    """Why there is no result, in one line."""
    seconds: float = 0.0
    """That it took when it was made."""
    figures: Mapping[str, Any] = field(default_factory=dict)
    """Of the surface, by name with the unit at its end."""
    comparison: Mapping[str, Any] = field(default_factory=dict)
    """With the reference of the recipe."""
    findings: tuple[Mapping[str, str], ...] = ()
    files: tuple[str, ...] = ()
    """Names of the files in its folder."""
    reused: bool = False
    """Whether it was there already."""

    def to_json(self) -> str:
        """As a JSON object; `outcome_from_json` reads it. A figure that is not known is null."""
        body = {"format": _FORMAT, "version": _VERSION, **asdict(self)}
        del body["reused"]
        return json.dumps(_with_nulls(body), indent=2, allow_nan=False)


def _with_nulls(value: Any) -> Any:
    """The same with None for NaN and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _with_nulls(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_with_nulls(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def outcome_from_json(text: str, where: str, *, reused: bool = False) -> Outcome:
    """Read an outcome. Raises FormatError."""
    body = strict_json(text, where)
    if not isinstance(body, dict) or (body.pop("format", 0), body.pop("version", 0)) != (
        _FORMAT, _VERSION,
    ):  # fmt: skip
        raise FormatError(f"{where}: not an outcome of a batch")
    try:
        body["findings"], body["files"] = tuple(body["findings"]), tuple(body["files"])
        out = Outcome(**body, reused=reused)
    except (KeyError, TypeError) as e:
        raise FormatError(f"{where}: {e}") from None
    if out.state not in get_args(State):
        raise FormatError(f"{where}: state {out.state!r}")
    return out


def blocks_of(task: Task) -> int:
    """How many blocks of frames a task is worth: one but for a huge scan file on a shared disk
    that is still to be made. Each worker would copy all of a file from object storage."""
    path = Path(task.source)
    if storage.is_address(task.source) or not path.is_file():
        return 1
    blocks = -(-path.stat().st_size // _BLOCK)
    if blocks > 1 and not task.again:
        place = storage.join(task.output, _folder_name(task, path))
        if _outcome_at(place, task.source) is not None:
            return 1
    return blocks


def look_at_block(task: Task, block: int, blocks: int) -> tuple[Known, ...]:
    """What one of so many blocks of a task's frames shows, for `run_task`; nothing where it cannot
    be said: then the task looks itself, and says why."""
    try:
        return _order(task.recipe, Path(task.source)).block(block, blocks)
    except Exception:  # noqa: BLE001 (whatever it is, the task comes to it and makes it its outcome)
        return ()


def run_task(task: Task, looked: Sequence[Sequence[Known]] = ()) -> Outcome:
    """Make what is not there of a task, and say what became of it.

    What blocks of its frames show is not looked for again. Raises ExportError where the result
    cannot be written: that is not the scan's fault.
    """
    with scratch(None if storage.is_address(task.output) else Path(task.output)) as work:
        try:
            # What this machine lacks is no fault of the scan's, and not kept as its result.
            check_step([Path(f"part.{suffix}") for suffix in task.recipe.formats])
            source = storage.fetched(task.source, work)
            name = _folder_name(task, source)
        except Exception as e:  # noqa: BLE001 (of this scan alone: the others go on)
            return Outcome(task.source, "error", problem=_line(e))
        place = storage.join(task.output, name)
        if not task.again and (there := _outcome_at(place, task.source)) is not None:
            return there
        made = work / "result"
        made.mkdir()
        begin = time.monotonic()
        try:
            outcome = _make(task, source, work, made, _together(looked))
        except ExportError:
            raise
        except _LASTING as e:
            shutil.rmtree(made)
            made.mkdir()
            outcome = Outcome(task.source, "error", problem=_line(e))
        except Exception as e:  # noqa: BLE001 (of this scan alone, and perhaps of this hour)
            return Outcome(task.source, "error", problem=_line(e))
        outcome = _named(outcome, name, made, time.monotonic() - begin)
        (made / storage.OUTCOME).write_text(outcome.to_json(), encoding="utf-8")
        storage.publish(made, place)
    return outcome


def _outcome_at(place: str, source: str) -> Outcome | None:
    """A result that is there, whatever its scan was called then; None where none can be read."""
    data = storage.outcome_at(place)
    if data is None:
        return None
    try:
        there = outcome_from_json(data.decode(), place, reused=True)
    except ValueError:
        return None
    return replace(there, source=source)


def _order(recipe: Recipe, scan: Path) -> Order:
    return Order(scan, recipe.options, str(recipe.edits), recipe.settings)


def _together(looked: Sequence[Sequence[Known]]) -> list[Known]:
    """For each laser, what all blocks show."""
    told = [block for block in looked if block]
    return [
        {step: shown for known in of_laser for step, shown in known.items()}
        for of_laser in zip(*told, strict=True)
    ]


def _make(task: Task, source: Path, work: Path, made: Path, known: Sequence[Known]) -> Outcome:
    recipe, name = task.recipe, storage.stem(task.source)
    scan = _imported(recipe, source, work, name) if source.is_dir() else source
    result = _order(recipe, scan).carried_out(known)
    findings = tuple(record(f) for f in result.findings)
    if result.failed:
        problem = next(f.message for f in result.findings if f.severity == "error")
        return Outcome(task.source, "error", problem=problem, findings=findings)
    remarks = result.save(*(made / f"{name}.{suffix}" for suffix in recipe.formats))
    if recipe.report:
        result.save_report(made / f"{name}.html")
    result.mesh.show(size=(320, 240)).save(made / THUMBNAIL)
    state, comparison = _compared(recipe, result)
    findings += tuple(record(f) for f in remarks)
    return Outcome(
        task.source, state, figures=result.figures(), comparison=comparison, findings=findings
    )


def _imported(recipe: Recipe, source: Path, work: Path, name: str) -> Path:
    how = recipe.pictures
    if how is None:
        raise InputError(
            f"{source}: a folder without scan files",
            hint="give scan files, or say in the recipe's table pictures how it is imported",
        )
    scan, rig = work / f"{name}.turnscan", read_rig_file(how.rig)
    lasers = [sheet.name for sheet in rig.sheets]
    lit = {laser: source / laser for laser in lasers if (source / laser).is_dir()}
    if not lit and len(lasers) > 1:
        raise InputError(
            f"{source}: no folder is named like a laser of the rig ({', '.join(lasers)})",
            hint="put the pictures of each laser into a folder with its name",
        )
    dark = source / "dark" if (source / "dark").is_dir() else ()
    done = import_pictures(
        lit or {lasers[0]: source}, scan, how.angles, dark=dark, rig=rig, options=how.options
    )
    return done.path


def _compared(recipe: Recipe, result: ReconstructResult) -> tuple[State, dict[str, Any]]:
    wanted = recipe.reference
    if wanted is None:
        return "done", {}
    reference = load(wanted.path, wanted.unit).mesh
    figures = compare(result, reference).figures()
    if wanted.within is None:
        return "done", figures
    return "pass" if figures["p95_mm"] <= wanted.within else "fail", figures


def _folder_name(task: Task, source: Path) -> str:
    """Readable, and as long the same as what decides the result is."""

    def content(value: object) -> str:
        return storage.digest(value) if isinstance(value, Path) else str(value)

    wanted = [__version__, storage.digest(source), asdict(task.recipe)]
    decides = json.dumps(wanted, default=content, sort_keys=True)
    key = hashlib.blake2b(decides.encode(), digest_size=6).hexdigest()
    return f"{storage.stem(task.source)}-{key}"


def _named(outcome: Outcome, name: str, made: Path, seconds: float) -> Outcome:
    files = tuple(sorted(path.name for path in made.iterdir()))
    return replace(outcome, folder=name, files=files, seconds=round(seconds, 3))


def _line(error: BaseException) -> str:
    text = error.message if isinstance(error, TurnscanError) else f"{error}"
    return " ".join(text.split()) or type(error).__name__


def quiet_worker(jobs: int) -> None:
    """Prepare a process for tasks: its share of the processors, and no life after its parent.

    Interrupts are for the parent, which ends its workers.
    """
    import signal
    import threading

    os.environ[threads.VARIABLE] = str(jobs)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="parent").start()
