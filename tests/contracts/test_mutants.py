"""The faults that `make mutants` puts into the sources can be put there, and are what they say."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import pytest
from bench.mutants._named import named
from bench.mutants._operators import mutants_of
from bench.mutants._rooms import ROOMS

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "src" / "turnscan"


@pytest.mark.parametrize("room", ROOMS)
def test_what_is_written_by_hand_fits_the_sources_and_its_tests_are_there(room: str) -> None:
    for mutant in named(room, SOURCES):
        text = (SOURCES / mutant.path).read_text()
        assert mutant.applied(text) != text
        ast.parse(mutant.applied(text))
        assert any(fnmatch(mutant.path, pattern) for pattern in ROOMS[room].modules)
        assert ROOMS[room].suites_of(mutant.path), mutant.key
    for suite in ROOMS[room].suites:
        for test in suite.tests:
            assert not test.endswith(".py") or (ROOT / "tests" / test).is_file(), test


def test_a_mutant_is_run_in_a_copy_and_killed() -> None:
    """The command that the page names, though `bench` itself loads a part of turnscan."""
    words = ["--rooms", "surface", "--named", "--only", "a second difference"]
    done = subprocess.run(
        [sys.executable, "-m", "bench.mutants", *words],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
        env={k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert "| surface | 1 | 1 | 0 |" in done.stdout


SOURCE = '''
"""Words."""
LIMIT = 2.5

def area(a: float, b: float = 1.0) -> float:
    """More words, 7 of them."""
    if a < 0 or not b:
        raise ValueError(f"{a + 1} is less than {0}")
    wide = values[:, None, 1]
    return -a * b + min(a, LIMIT) if flag else True
'''


def test_operators_change_what_a_test_could_see_and_nothing_else() -> None:
    made = mutants_of("room", "file.py", SOURCE)
    changes = {(m.where, m.change) for m in made}
    assert len({m.key for m in made}) == len(made)
    for mutant in made:
        ast.parse(mutant.applied(SOURCE))
    for wanted in (
        ("LIMIT", "2.5 → (5.0)"),
        ("area", "1.0 → (2.0)"),
        ("area", "a < 0 → (a >= 0)"),
        ("area", "a < 0 or not b → (a < 0 and (not b))"),
        ("area", "not b → (b)"),
        ("area", "1 → (2)"),
        ("area", "-a → (a)"),
        ("area", "-a * b → (-a / b)"),
        ("area", "-a * b → (-a)"),
        ("area", "-a * b + min(a, LIMIT) → (-a * b - min(a, LIMIT))"),
        ("area", "min(a, LIMIT) → (max(a, LIMIT))"),
        ("area", "flag → (not flag)"),
        ("area", "True → (False)"),
    ):
        assert wanted in changes, wanted
    assert not [m for m in made if "7" in m.old or "is less" in m.old or "None" in m.old]


@pytest.mark.parametrize("path", ["stripes/_measure.py", "shapes/_volume.py", "devices/_lit.py"])
def test_mutants_of_real_sources_are_python(path: str) -> None:
    text = (SOURCES / path).read_text()
    made = mutants_of("room", path, text)
    assert len(made) > 20
    assert len({m.key for m in made}) == len(made)
    for mutant in made[::5]:
        ast.parse(mutant.applied(text))
