"""What `import turnscan as ts` promises: names, speed, examples that run."""

from __future__ import annotations

import doctest
import inspect
import pkgutil
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import turnscan as ts
from tests.workflows.scans import write_can

TOP = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_can(tmp_path_factory.mktemp("package") / "cup.turnscan")


@pytest.fixture
def desk(scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a scan in it."""
    shutil.copy(scan, tmp_path / "cup.turnscan")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_names_are_few_all_there_and_no_rooms() -> None:
    assert 25 <= len(ts.__all__) <= 40
    assert sorted(ts.__all__) == sorted(ts._HOMES)
    for name in ts.__all__:
        assert getattr(ts, name).__doc__, name
    rooms = {m.name for m in pkgutil.iter_modules(ts.__path__)}
    assert not rooms & set(ts.__all__), "a room that is imported would hide the name"
    assert set(ts.__all__) < set(dir(ts))
    with pytest.raises(AttributeError, match="has no attribute 'scna'"):
        _ = ts.scna


def test_every_function_says_what_it_takes_returns_and_raises() -> None:
    for name in ts.__all__:
        thing = getattr(ts, name)
        if inspect.isfunction(thing) and thing.__module__.startswith("turnscan.workflows"):
            for section in ("Parameters\n", "Returns\n", "Raises\n", ">>> "):
                assert section in thing.__doc__, f"{name}: {section}"
            for parameter in inspect.signature(thing).parameters:
                assert re.search(rf"\b{parameter}\b", thing.__doc__), f"{name}: {parameter}"


@pytest.mark.parametrize("name", ["turnscan", *ts.__all__])
def test_the_examples_run(name: str, desk: Path) -> None:
    thing = ts if name == "turnscan" else getattr(ts, name)
    if name != "turnscan" and not thing.__module__.startswith("turnscan.workflows"):
        return
    finder = doctest.DocTestFinder(recurse=False)
    members = vars(thing).values() if inspect.isclass(thing) else ()
    for part in (thing, *(m for m in members if inspect.isfunction(m))):
        for example in finder.find(part, name, globs={}):
            result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example)
            assert result.failed == 0


def test_importing_it_loads_nothing_and_takes_no_time() -> None:
    probe = (
        "import sys, time\nbefore = set(sys.modules)\nstart = time.process_time()\n"
        "import turnscan\nprint(time.process_time() - start)\n"
        "print(sorted(m for m in set(sys.modules) - before))"
    )
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True
    )
    seconds, loaded = done.stdout.splitlines()
    assert time.perf_counter() - begin < 30
    assert loaded in ("['turnscan']", "['__future__', 'turnscan']")
    assert float(seconds) < 0.03


def test_ten_lines_lead_from_a_scan_to_a_dxf(desk: Path) -> None:
    """The code of the how-to page, as it stands there."""
    page = (TOP / "docs" / "how-to" / "python.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len([line for line in code.splitlines() if line and "import" not in line]) <= 10
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "24 frames of ('L0',) (240, 320)" in done.stdout
    assert (desk / "cup.dxf").stat().st_size > 10_000
    assert (desk / "cup.stl").is_file()


def test_points_and_mesh_go_to_other_libraries(desk: Path) -> None:
    import trimesh

    part = ts.reconstruct("cup.turnscan", ts.ReconstructOptions(close=True))
    points = part.points
    assert points.dtype.names == ("x", "y", "z", "sigma", "laser", "step", "row")
    (grid,) = part.grids
    assert len(points) == grid.found.sum()
    at = points[len(points) // 2]
    row = int(np.flatnonzero(grid.steps == at["step"])[0])
    assert grid.points[row, at["row"]].tolist() == [at["x"], at["y"], at["z"]]
    mesh = part.mesh.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(part.mesh.volume, rel=1e-9)
    assert len(mesh.vertex_attributes["sigma"]) == len(part.mesh.vertices)
    assert (mesh.face_attributes["measured"] == part.mesh.measured).all()
