"""A huge scan in blocks of frames: the same result, to the byte, whatever becomes of a block."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.once import once
from tests.workflows.scans import write_can
from turnscan import detection, workflows
from turnscan.detection import detect_scan, look_in_block
from turnscan.scan import Scan, rig_for
from turnscan.stripes import Stripe, StripeSettings
from turnscan.workflows._batch import _task as _batch_task
from turnscan.workflows._batch import _workers as _batch_workers
from turnscan.workflows._batch._task import blocks_of, look_at_block, run_task
from turnscan.workflows._batch._workers import Patience

OPTIONS = workflows.ReconstructOptions(strategy="centroid")


@pytest.fixture(scope="session")
def can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(folder: Path) -> None:
        write_can(folder / "can.turnscan")

    return once(tmp_path_factory, "can", make) / "can.turnscan"


@pytest.fixture
def task(can: Path, tmp_path: Path) -> workflows.Task:
    recipe = workflows.Recipe(OPTIONS, formats=("stl",), report=False)
    return workflows.Task(str(can), recipe, str(tmp_path))


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The steps whose frames are searched."""
    steps: list[int] = []
    look = detection._Search._look

    def counted(search: detection._Search, shots: list[detection.Stored]) -> detection.Looked:
        steps.append(shots[0].row.step)
        return look(search, shots)

    monkeypatch.setattr(detection._Search, "_look", counted)
    return steps


def arrays(stripe: Stripe) -> dict[str, np.ndarray]:
    return {name: a for name, a in vars(stripe).items() if isinstance(a, np.ndarray)}


@pytest.mark.parametrize("blocks", [1, 3, 40])
@pytest.mark.parametrize("refine", ["none", "spacetime"])
def test_blocks_hold_what_the_whole_scan_shows(
    can: Path, blocks: int, refine: str, searched: list[int]
) -> None:
    stripes = StripeSettings(refine=refine)  # type: ignore[arg-type]
    with Scan.open(can) as scan:
        rig = rig_for(scan, None)
        (whole,) = detect_scan(scan, rig, stripes)
        count = len(searched)
        each = [look_in_block(scan, rig, stripes, None, k, blocks) for k in range(blocks)]
        assert sorted(searched[count:]) == sorted(searched[:count]) == sorted(scan.steps("L0"))
        known = {step: seen for (block,) in each for step, seen in block.items()}
        (again,) = detect_scan(scan, rig, stripes, known=[known])
        assert len(searched) == 2 * count
    assert again.findings == whole.findings
    assert again.stripes.steps == whole.stripes.steps
    for one, other in zip(again.stripes.stripes, whole.stripes.stripes, strict=True):
        for name, values in arrays(one).items():
            assert np.array_equal(
                values, getattr(other, name), equal_nan=values.dtype.kind == "f"
            ), name


def stl(task: workflows.Task, outcome: workflows.Outcome) -> bytes:
    return (Path(task.output) / outcome.folder / "can.stl").read_bytes()


def test_a_block_that_fails_is_looked_at_by_the_task(
    task: workflows.Task, tmp_path: Path, searched: list[int]
) -> None:
    looked = [look_at_block(task, k, 4) for k in range(4)]
    assert all(looked)
    first = run_task(task, looked)
    by_blocks = stl(task, first)
    del searched[:]
    again = workflows.Task(task.source, task.recipe, task.output, again=True)
    second = run_task(again, [looked[0], (), looked[2], looked[3]])
    assert set(searched) == set(looked[1][0])
    assert second.figures == first.figures
    assert stl(task, second) == stl(task, run_task(again)) == by_blocks

    lost = tmp_path / "lost.turnscan"
    lost.write_bytes(b"nothing of the kind")
    broken = workflows.Task(str(lost), task.recipe, task.output)
    assert look_at_block(broken, 0, 2) == ()
    assert "not a scan file" in run_task(broken, [(), ()]).problem


def test_only_a_huge_scan_that_is_still_to_be_made_comes_in_blocks(
    task: workflows.Task, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = Path(task.source).stat().st_size
    assert blocks_of(task) == 1
    monkeypatch.setattr(_batch_task, "_BLOCK", size // 3 + 1)
    assert blocks_of(task) == 3
    assert blocks_of(workflows.Task(f"file://{task.source}", task.recipe, task.output)) == 1
    assert blocks_of(workflows.Task(str(tmp_path), task.recipe, task.output)) == 1
    assert blocks_of(workflows.Task(str(tmp_path / "none"), task.recipe, task.output)) == 1
    run_task(task)
    assert blocks_of(task) == 1
    assert blocks_of(workflows.Task(task.source, task.recipe, task.output, again=True)) == 3


@pytest.mark.parametrize("lost", [None, 2])
def test_a_cluster_takes_a_huge_scan_in_blocks(
    can: Path,
    task: workflows.Task,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    searched: list[int],
    lost: int | None,
) -> None:
    from distributed import LocalCluster

    asked: list[tuple[int, int]] = []
    look = _batch_workers.look_at_block

    def noted(task: workflows.Task, block: int, blocks: int) -> object:
        asked.append((block, blocks))
        if block == lost:
            raise MemoryError  # the task is lost with it, and tried again
        return look(task, block, blocks)

    monkeypatch.setattr(_batch_workers, "look_at_block", noted)
    monkeypatch.setattr(_batch_task, "_BLOCK", can.stat().st_size // 3 + 1)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0",
        host="127.0.0.1", protocol="tcp",
    ) as cluster:  # fmt: skip
        done = workflows.batch(
            [can], task.recipe, tmp_path / "out", dask=cluster.scheduler_address,
            patience=Patience(tries=2, seconds=300.0, cluster=30.0),
        )  # fmt: skip
    assert {(lost or 2, 3)} <= set(asked) <= {(0, 3), (1, 3), (2, 3)}
    assert len(asked) <= 3  # the second try goes without
    with Scan.open(can) as scan:
        steps = sorted(scan.steps("L0"))
    assert lost is not None or sorted(searched) == steps
    (outcome,) = done.outcomes
    assert outcome.state == "done", outcome.problem
    single = stl(task, run_task(task))
    assert (tmp_path / "out" / outcome.folder / "can.stl").read_bytes() == single
