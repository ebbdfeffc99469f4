"""The door: help is quick because nothing heavy is imported, and errors are one line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from turnscan import cli
from turnscan.cli import _VERBS, main

HEAVY = (
    *("numpy", "scipy", "cv2", "numba", "matplotlib", "ezdxf", "pydantic", "rich"),
    *("starlette", "uvicorn", "websockets"),
)


def _run(*args: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "turnscan", *args],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=cwd,
        check=False,
    )


def test_help_names_every_verb_and_loads_nothing_heavy() -> None:
    probe = (
        "import sys\nfrom turnscan.cli import turnscan\n"
        "try: turnscan.main(['--help'])\nexcept SystemExit: pass\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.rstrip().endswith("[]"), done.stdout
    for verb in _VERBS:
        assert f"\n  {verb} " in done.stdout


@pytest.mark.parametrize("told", [None, "2"])
def test_linear_algebra_has_one_thread_unless_told_otherwise(told: str | None) -> None:
    name = "OPENBLAS_NUM_THREADS"
    probe = (
        "import os, sys\nfrom turnscan import cli\nsys.argv[1:] = ['--version']\ncli.main()\n"
        f"print(os.environ['{name}'], 'numpy' in sys.modules)"
    )
    env = {k: v for k, v in os.environ.items() if k != name} | ({name: told} if told else {})
    done = subprocess.run(
        [sys.executable, "-c", probe],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
        env=env,
    )
    assert done.stdout.split()[-2:] == [told or "1", "False"]


@pytest.mark.parametrize("verb", sorted(_VERBS))
def test_every_verb_has_help(verb: str) -> None:
    done = _run(verb, "--help")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Usage:")


@pytest.mark.parametrize(
    "words",
    [
        "calibrate -o a.json -o b.json --camera x",
        "refine a.turnscan -o b.json --report c.html --report d.html",
        "compare a.ply b.ply --picture c.png --picture d.png",
        "shapes a.ply --tolerance 0.1 --tolerance 0.2",
    ],
)
def test_a_flag_that_counts_once_is_not_given_twice(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last was taken, and the others dropped without a word."""
    monkeypatch.setattr(sys, "argv", ["turnscan", *words.split()])
    with pytest.raises(SystemExit) as stop:
        main()
    flag = next(w for w in words.split() if words.split().count(w) == 2)
    named = {"-o": "--output"}.get(flag, flag)
    err = capsys.readouterr().err
    assert (stop.value.code, err.count("\n")) == (2, 1)
    assert f"{named} is given 2 times; it counts once" in err


def test_unknown_verb_is_a_usage_error() -> None:
    done = _run("scna")
    assert done.returncode == 2
    assert "scna" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("raised", "code", "text"),
    [
        (FileNotFoundError(2, "No such file or directory", "part.turnscan"), 5, "part.turnscan"),
        (MemoryError(), 2, "memory"),
        (ZeroDivisionError("division\nby zero"), 1, "TURNSCAN_TRACEBACK"),
    ],
)
def test_foreseen_builtin_errors_become_one_line(
    raised: BaseException,
    code: int,
    text: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(**_: object) -> None:
        raise raised

    monkeypatch.setattr(cli.turnscan, "main", fail)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == code
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert text in err
