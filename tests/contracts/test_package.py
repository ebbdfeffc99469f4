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
from typing import Any

import numpy as np
import pytest

import turnscan as ts
from tests.workflows.scans import write_can, write_pictures

TOP = Path(__file__).parents[2]


VERBS = {"calibrate", "design", "export", "import_pictures", "open_scan", "reconstruct", "simulate"}
"""Verbs that a program counts on."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan, and the pictures and the rig that it is made of."""
    folder = tmp_path_factory.mktemp("package")
    write_can(folder / "cup.turnscan")
    write_pictures(folder / "cup.turnscan", folder)
    return folder


@pytest.fixture
def desk(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a scan in it, its pictures and its rig."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    (tmp_path / "recipe.toml").write_text("[output]\nreport = false\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_names_are_few_and_all_there() -> None:
    assert 25 <= len(ts.__all__) <= 40
    assert sorted(ts.__all__) == sorted(ts._HOMES)
    for name in ts.__all__:
        assert getattr(ts, name).__doc__, name
    assert set(ts.__all__) < set(dir(ts))
    assert set(ts.__all__) > VERBS
    with pytest.raises(AttributeError, match="has no attribute 'scna'"):
        _ = ts.scna


ROOMS_AND_VERBS = sorted({m.name for m in pkgutil.iter_modules(ts.__path__)} & set(ts.__all__))


@pytest.mark.parametrize("first", ["room", "verb"])
def test_a_verb_keeps_its_name_whichever_is_imported_first(first: str) -> None:
    """A room of the same name, once imported, is bound to the package by Python."""
    assert {"calibrate", "simulate"} <= set(ROOMS_AND_VERBS)
    room = "import turnscan.{0}; from turnscan.{0} import __all__ as names; assert names"
    verb = "assert turnscan.{0} is turnscan.workflows.{0}, turnscan.{0}"
    after = "from turnscan import {0}; assert {0} is sys.modules['turnscan'].{0}"
    parts = [room, verb, after] if first == "room" else [verb, room, verb, after]
    code = [part.format(name) for part in parts for name in ROOMS_AND_VERBS]
    text = "\n".join(["import sys, turnscan, turnscan.workflows", *code])
    subprocess.run([sys.executable, "-c", text], check=True, timeout=60)


def test_what_is_no_public_name_can_be_set_on_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ts, "__version__", "none")
    assert ts.__version__ == "none"
    monkeypatch.setattr(ts, "reconstruct", len)
    assert ts.reconstruct is len


def _methods(kind: type) -> list[object]:
    """The public methods of a class that take arguments."""
    methods = [m for name, m in vars(kind).items() if inspect.isfunction(m) and name[0] != "_"]
    return [m for m in methods if len(inspect.signature(m).parameters) > 1]


DOCUMENTED = [f for name in ts.__all__ if inspect.isfunction(f := getattr(ts, name))]
DOCUMENTED += [*_methods(ts.OpenScan), *_methods(ts.ReconstructResult)]


@pytest.mark.parametrize("function", DOCUMENTED, ids=lambda f: f.__qualname__)
def test_every_function_says_what_it_takes_returns_and_raises(function: Any) -> None:
    doc, signature = inspect.getdoc(function) or "", inspect.signature(function)
    headings = ["Parameters\n---", "Raises\n---", ">>> "]
    if signature.return_annotation != "None":
        headings.append("Returns\n---")
    for heading in headings:
        assert heading in doc, heading
    described = doc[: doc.index("Raises\n---")]
    for parameter in set(signature.parameters) - {"self"}:
        assert re.search(rf"^[\w, ]*\b{parameter}\b[\w, ]*\n    ", described, re.M), parameter


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

    part = ts.reconstruct("cup.turnscan", close=True)
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
