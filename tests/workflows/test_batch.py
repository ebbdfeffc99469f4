"""Many scans by one recipe: on this machine and on a cluster, with workers that die on the way."""

from __future__ import annotations

import csv
import gc
import math
import multiprocessing
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.once import once
from tests.workflows.scans import write_can, write_pictures
from turnscan import workflows
from turnscan.errors import DeviceTimeout, ExportError, FormatError, InputError, StorageFull
from turnscan.progress import Cancelled, Progress
from turnscan.workflows._batch import _scratch as _batch_scratch
from turnscan.workflows._batch import _task as _batch_task
from turnscan.workflows._batch import _workers as _batch_workers
from turnscan.workflows._batch._outcomes import Outcomes, PackedOutcome
from turnscan.workflows._batch._recipe import recipe_from_text
from turnscan.workflows._batch._scratch import scratch
from turnscan.workflows._batch._table import write_tables
from turnscan.workflows._batch._task import Outcome, outcome_from_json
from turnscan.workflows._batch._workers import Patience, on_this_machine

RECIPE = '[reconstruct]\nstrategy = "centroid"\n[output]\nformats = ["stl"]\nreport = false\n'
PATIENT = Patience(tries=3, seconds=300.0, cluster=60.0)


@pytest.fixture(scope="session")
def cans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of four scans of one can, under four names, and the can's pictures."""

    def make(folder: Path) -> None:
        scan = write_can(folder / "can0.turnscan")
        for k in (1, 2, 3):
            (folder / f"can{k}.turnscan").write_bytes(scan.read_bytes())
        (folder / "taken").mkdir()
        write_pictures(scan, folder / "taken")
        (folder / "taken" / "pictures").rename(folder / "taken" / "L0")

    return once(tmp_path_factory, "cans", make)


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "recipe.toml"
    path.write_text(RECIPE)
    return path


def sources(cans: Path, count: int) -> list[Path]:
    return [cans / f"can{k}.turnscan" for k in range(count)]


def test_results_are_those_of_single_runs_and_are_not_made_twice(
    cans: Path, recipe: Path, tmp_path: Path
) -> None:
    damaged = tmp_path / "damaged.turnscan"
    damaged.write_bytes(b"nothing of the kind")
    out = tmp_path / "out"
    done = workflows.batch([*sources(cans, 2), damaged], recipe, out, workers=2)
    assert [outcome.state for outcome in done.outcomes] == ["done", "done", "error"]
    assert "not a scan file" in done.outcomes[2].problem
    assert done.failed

    single = workflows.reconstruct(cans / "can0.turnscan", strategy="centroid")
    single.save(tmp_path / "can0.stl")
    made = out / done.outcomes[0].folder
    assert (made / "can0.stl").read_bytes() == (tmp_path / "can0.stl").read_bytes()
    assert (made / "thumbnail.png").read_bytes().startswith(b"\x89PNG")
    assert done.outcomes[0].figures["faces"] == len(single.mesh.faces)

    written = (made / "outcome.json").stat().st_mtime_ns
    for file in (out / done.outcomes[1].folder).iterdir():
        file.unlink()
    (out / done.outcomes[1].folder).rmdir()
    again = workflows.batch([*sources(cans, 2), damaged], recipe, out, workers=1)
    assert [outcome.reused for outcome in again.outcomes] == [True, False, True]
    assert (made / "outcome.json").stat().st_mtime_ns == written
    assert {path.name for path in out.iterdir() if path.is_dir()} == {
        outcome.folder for outcome in done.outcomes
    }

    with (out / "batch.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows] == ["done", "done", "error"]
    assert int(rows[0]["faces"]) == len(single.mesh.faces)
    with closing(sqlite3.connect(out / "batch.sqlite")) as db:
        runs = db.execute("SELECT run, count(*) FROM results GROUP BY run").fetchall()
    assert [count for _, count in runs] == [3, 3]
    page = (out / "index.html").read_text()
    assert f'src="{done.outcomes[0].folder}/thumbnail.png"' in page
    assert "1 without a result" in page


def test_a_scan_that_moved_is_known_and_troubles_that_pass_are_not_kept(
    cans: Path, recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    odd = tmp_path / os.fsdecode(b"tasse gr\xfc\xdf #2%25.turnscan")
    (tmp_path / "other").mkdir()
    moved = tmp_path / "other" / odd.name
    for path in (odd, moved):
        path.write_bytes((cans / "can0.turnscan").read_bytes())
    out = tmp_path / "out"
    out.mkdir()
    told = workflows.read_recipe(recipe)
    tasks = [workflows.Task(str(path), told, str(out)) for path in (odd, moved)]

    def full(*_: object) -> None:
        raise StorageFull("disk full")

    with monkeypatch.context() as patched:
        patched.setattr(_batch_task, "_make", full)
        assert _batch_task.run_task(tasks[0]).problem == "disk full"
    assert not any(out.iterdir())
    first, second = map(_batch_task.run_task, tasks)
    assert (first.state, first.reused, second.reused) == ("done", False, True)
    assert [first.source, second.source] == [str(odd), str(moved)]
    write_tables(out, [first, second])
    assert "%23" in (out / "index.html").read_text()
    (out / first.folder / "outcome.json").write_text("")
    assert not _batch_task.run_task(tasks[0]).reused


def test_outcomes_of_a_batch_are_packed_and_the_same() -> None:
    findings = tuple(
        {
            "code": f"points.volume{k}",
            "severity": "note",
            "message": f"{k} points kept",
            "where": "",
        }
        for k in range(5)
    )
    figures = {"faces": 1656, "volume_mm3": None, "bounds_mm": [[-18.6, -18.5, 2.1]]}
    told = [
        Outcome(f"/in/part{k}", "done", f"part{k}", "", k / 3, {**figures, "points": k},
                findings=findings, files=("a.stl",), reused=k % 2 == 0)
        for k in range(300)
    ]  # fmt: skip
    tracemalloc.start()
    try:
        first = PackedOutcome(told[0])
        kept = Outcomes([PackedOutcome(outcome, first) for outcome in told])
        gc.collect()  # what packing leaves in circles is not kept
        each = tracemalloc.get_traced_memory()[0] / len(told)
    finally:
        tracemalloc.stop()
    assert each < 1000, "of 4 kB each"
    assert list(kept) == told
    assert (kept[-1], list(kept[:2]), len(kept)) == (told[-1], told[:2], 300)
    assert kept == Outcomes(kept._packed)
    assert kept != told


def test_a_figure_that_is_not_known_is_null_in_an_outcome() -> None:
    told = Outcome("/in/a", "done", "a", "", 1.0, {"area_mm2": math.nan, "box": [math.inf, 2.0]})
    assert PackedOutcome(told).outcome().figures == {"area_mm2": None, "box": [None, 2.0]}


def test_pictures_compared_with_a_reference_pass_or_fail(cans: Path, tmp_path: Path) -> None:
    workflows.reconstruct(cans / "can0.turnscan").save(tmp_path / "truth.ply")
    states = []
    for within in (0.5, 0.000001):
        text = (
            f'[pictures]\nrig = "{cans}/taken/rig.json"\nangles = "step:15"\n'
            f'[compare]\nreference = "truth.ply"\nwithin_mm = {within:f}\n'
            "[output]\nformats = []\nreport = false\n"
        )
        recipe = recipe_from_text(text, tmp_path, "here")
        done = workflows.batch([cans / "taken"], recipe, tmp_path / "out", workers=1)
        assert done.outcomes[0].problem == ""
        states.append(done.outcomes[0].state)
        assert done.outcomes[0].comparison["p95_mm"] < 0.5
    assert states == ["pass", "fail"]


def test_a_worker_that_is_killed_costs_nothing_but_time(
    cans: Path, recipe: Path, tmp_path: Path
) -> None:
    tasks = [
        workflows.Task(str(scan), workflows.read_recipe(recipe), str(tmp_path))
        for scan in sources(cans, 2)
    ]
    before = set(multiprocessing.active_children())

    def kill() -> None:
        while not (born := set(multiprocessing.active_children()) - before):
            time.sleep(0.01)
        os.kill(born.pop().pid or 0, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    outcomes = list(on_this_machine(tasks, 1, PATIENT))
    killer.join()
    assert sorted(outcome.state for outcome in outcomes) == ["done", "done"]
    assert set(multiprocessing.active_children()) <= before
    assert not any(path.name.startswith(".") for path in tmp_path.iterdir())


def test_what_a_dead_process_left_is_removed_and_no_scratch_that_is_in_use(tmp_path: Path) -> None:
    with scratch(tmp_path) as living:
        dead = living.with_name(f"{living.name}-dead")
        machine = living.name.partition(".")[0]
        elsewhere = {living.with_name(name) for name in ("another_machine.x", f"{machine}-1.x")}
        for folder in (dead, *elsewhere):
            folder.mkdir()
            (folder / "held").touch()
        with scratch(tmp_path) as second:
            assert {living, second, *elsewhere} == set(living.parent.iterdir())
    assert set(living.parent.iterdir()) == elsewhere


def test_scratch_that_is_taken_for_dead_before_it_is_locked_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the lock of what removes it and the removal."""
    doomed: list[Path] = []
    monkeypatch.setattr(
        _batch_scratch, "shutil", SimpleNamespace(rmtree=lambda f, **_: doomed.append(f))
    )
    true_take, swept = _batch_scratch.take, []

    def take(held: int) -> bool:
        if not swept:  # the first to come is the owner
            swept.append(True)
            _batch_scratch.swept(tmp_path)
        return true_take(held)

    monkeypatch.setattr(_batch_scratch, "take", take)
    with scratch(tmp_path) as folder:
        assert doomed
        assert folder not in doomed
        assert (folder / "held").is_file()


def test_scratch_whose_place_another_takes_away_at_every_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, raced = Path.mkdir, []

    def gone(self: Path, pattern: str) -> Iterator[Path]:
        raise FileNotFoundError(f"{self}: between two looks")

    def there_and_gone(self: Path, mode: int = 0o777) -> None:
        if not raced:
            raced.append(self)
            raise FileExistsError(f"{self}: and gone")
        make(self, mode)

    monkeypatch.setattr(Path, "glob", gone)
    monkeypatch.setattr(Path, "mkdir", there_and_gone)
    with scratch(tmp_path) as folder:
        assert folder.is_dir()
    assert raced
    assert not list(tmp_path.iterdir())


def test_scratch_on_a_disk_without_locks_or_without_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_batch_scratch, "take", lambda fd: False)
    with scratch(tmp_path) as one, scratch(tmp_path) as other:
        assert {one, other} == set(one.parent.iterdir())
    assert not list(tmp_path.iterdir())
    with pytest.raises(ExportError, match="cannot be written"), scratch(tmp_path / "none"):
        raise AssertionError
    # A link to a disk that is not there: it is neither made nor taken away by others.
    (tmp_path / ".turnscan").symlink_to(tmp_path / "unplugged")
    with pytest.raises(ExportError, match="cannot be written"), scratch(tmp_path):
        raise AssertionError


def test_a_cluster_leaves_a_scan_behind_that_takes_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    enough = threading.Event()

    def endless(task: workflows.Task, looked: object) -> Outcome:
        enough.wait()
        raise StorageFull("the disk is full")

    monkeypatch.setattr(_batch_workers, "run_task", endless)
    task = workflows.Task("cup.turnscan", workflows.Recipe(), str(tmp_path))
    late = _batch_workers.run_within(task, 0.01)
    assert (late.state, late.problem) == ("error", "not done within 0.01 s (1 try)")
    enough.set()
    with pytest.raises(StorageFull, match="the disk is full"):
        _batch_workers.run_within(task, 300.0)


def test_a_scan_that_takes_too_long_is_told_and_its_worker_ended(
    cans: Path, recipe: Path, tmp_path: Path
) -> None:
    patience = Patience(tries=1, seconds=0.01)
    done = workflows.batch(sources(cans, 1), recipe, tmp_path / "out", workers=1, patience=patience)
    assert done.outcomes[0].problem == "not done within 0.01 s (1 tries)"


def test_what_is_done_stays_when_it_is_cancelled(cans: Path, recipe: Path, tmp_path: Path) -> None:
    came = []

    def cancelled() -> bool:
        return len(came) > 1

    progress = Progress(lambda fraction, text: came.append(text), cancelled)
    with pytest.raises(Cancelled):
        workflows.batch(sources(cans, 3), recipe, tmp_path / "out", workers=1, progress=progress)
    there = [p for p in (tmp_path / "out").iterdir() if (p / "outcome.json").is_file()]
    assert 1 <= len(there) <= 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[reconstruct]\nstratgy = 'centroid'", "no option 'stratgy'"),
        ("[reconstruct]\nstrategy = 'best'", "reconstruct.strategy: 'best' is not one of"),
        ("[reconstruct]\nspacing = -1", "reconstruct.spacing: -1 is not more than 0"),
        ("reconstruct = 3", "reconstruct is not a table"),
        ("[output]\nformats = 'stl'", "output.formats 'stl' is not a list"),
        ("[output]\nformats = ['dwg']", "output.formats: files ending '.dwg' are not known"),
        ("[output]\nformats = ['igs']", "output.formats: files ending '.igs' are not known"),
        ("[output]\nreport = 1", "output.report 1 is not true or false"),
        ("[compare]\nwithin_mm = 0.1", "compare has no reference"),
        ("[compare]\nreference = 'a.stl'\nwithin_mm = 0", "compare.within_mm 0 is not a length"),
        ("[compare]\nreference = 'a.stl'\nunit = 'foot'", "compare.unit 'foot' is not one of"),
        ("[pictures]\nrig = 'rig.json'", "pictures has no angles"),
        ("[pictures]\nrig = 'r.json'\nangles = 'step:0'", "pictures.angles: not a step"),
        ("settings = ''", "settings '' is not a text"),
        ("settings = 'fine'\n[reconstruct]\nclose = true", "both reconstruct and settings"),
        ("colour = 'red'", "no key 'colour'"),
        ("[", "not TOML"),
    ],
)
def test_a_wrong_recipe_is_refused_by_its_key(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError) as refused:
        recipe_from_text(text, tmp_path, "recipe.toml")
    assert str(refused.value).startswith("recipe.toml: ")
    assert said in str(refused.value)


def test_wrong_inputs_are_refused_before_any_work(cans: Path, recipe: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        workflows.batch([tmp_path / "none.turnscan"], recipe, tmp_path / "out")
    with pytest.raises(InputError, match="0 workers"):
        workflows.batch(sources(cans, 1), recipe, tmp_path / "out", workers=0)
    (tmp_path / "other.toml").write_text('[compare]\nreference = "absent.stl"\n')
    with pytest.raises(InputError, match=r"there is no file .*absent\.stl"):
        workflows.batch(sources(cans, 1), tmp_path / "other.toml", tmp_path / "out")
    with pytest.raises(DeviceTimeout, match="no scheduler"):
        workflows.batch(
            sources(cans, 1), recipe, tmp_path / "out",
            dask="tcp://127.0.0.1:9", patience=Patience(cluster=0.2),
        )  # fmt: skip
    with pytest.raises(FormatError):
        outcome_from_json('{"format": "turnscan-outcome", "version": 2}', "there")


@contextmanager
def started(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A program of the cluster, ended with the block."""
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}
    process = subprocess.Popen(
        [sys.executable, "-m", *command],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait(timeout=30)


def test_a_cluster_that_loses_a_worker_and_its_scheduler_loses_no_scan(
    cans: Path, recipe: Path, tmp_path: Path
) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    scheduler = (
        "distributed.cli.dask_scheduler",
        "--host", "127.0.0.1", "--port", str(port), "--no-dashboard",
    )  # fmt: skip
    worker = (
        "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard",
        "--nthreads", "1", "--local-directory", str(tmp_path / "scratch"),
    )  # fmt: skip
    done: list[workflows.Batch] = []
    came = threading.Event()

    def run() -> None:
        progress = Progress(lambda fraction, text: came.set() if fraction > 0 else None)
        done.append(workflows.batch(
            sources(cans, 4), recipe, tmp_path / "out",
            dask=address, patience=PATIENT, progress=progress,
        ))  # fmt: skip

    batch = threading.Thread(target=run)
    with started(*scheduler), started(*worker) as first, started(*worker):
        batch.start()
        assert came.wait(200.0)
        first.kill()
        time.sleep(0.2)
    with started(*scheduler), started(*worker):
        batch.join(200.0)
    assert not batch.is_alive()
    assert [outcome.state for outcome in done[0].outcomes] == ["done"] * 4
    assert len({(tmp_path / "out" / o.folder / f"can{k}.stl").read_bytes()
                for k, o in enumerate(done[0].outcomes)}) == 1  # fmt: skip


def test_object_storage_by_its_address(cans: Path, recipe: Path, tmp_path: Path) -> None:
    done = workflows.batch(
        [f"file://{cans}/can[01].turnscan"], recipe, f"file://{tmp_path}/there", workers=1
    )
    assert [outcome.state for outcome in done.outcomes] == ["done", "done"]
    folder = tmp_path / "there" / done.outcomes[0].folder
    assert {path.name for path in folder.iterdir()} == {
        "can0.stl", "outcome.json", "thumbnail.png",
    }  # fmt: skip
    assert (tmp_path / "there" / "index.html").is_file()
    again = workflows.batch(
        [f"file://{cans}/can[01].turnscan"], recipe, f"file://{tmp_path}/there", workers=1
    )
    assert all(outcome.reused for outcome in again.outcomes)
