"""Pure rooms, scan and cli on every other Python that this machine has: `make test-interpreters`.

Each gets an environment of its own (``.interpreters/3.N``). None is passed over silently: what is
there is run, and what is not there is named.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).parents[1]
FIRST, LAST = 11, 14
ROOMS = (
    "rig", "stripes", "calibrate", "points", "surface", "shapes", "poses", "edit", "export",
    "scan", "cli",
)  # fmt: skip


def found(minor: int) -> Path | None:
    """The newest Python 3.``minor`` that starts: on the path, of pyenv, or of the system."""
    name = f"python3.{minor}"
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    tried = [*sorted(pyenv.glob(f"3.{minor}.*/bin/{name}"), reverse=True), Path(f"/usr/bin/{name}")]
    if on_path := shutil.which(name):
        tried.append(Path(on_path))
    for path in tried:
        asked = [path, "-c", "import sys; print(sys.version_info[1])"]
        if path.exists():
            said = subprocess.run(asked, capture_output=True, text=True, check=False)
            if said.stdout.strip() == str(minor):
                return path
    return None


def tested(python: Path, minor: int, words: list[str]) -> bool:
    """Whether the rooms pass on it."""
    home = TOP / ".interpreters" / f"3.{minor}"
    own, ready = home / "bin" / "python", home / ".ready"
    wanted = max((TOP / n).stat().st_mtime for n in ("pyproject.toml", "constraints.txt"))
    if not ready.exists() or ready.stat().st_mtime < wanted:
        subprocess.run([python, "-m", "venv", "--clear", home], check=True)
        install = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*install, "-c", "constraints.txt", "-e", ".[dev]"], cwd=TOP, check=True)
        ready.touch()
    run = [own, "-m", "pytest", "-q", "-n", "2", "--dist", "loadscope", "-m", "not slow"]
    where = words or [f"tests/{room}" for room in ROOMS]
    return subprocess.run([*run, *where], cwd=TOP, check=False).returncode == 0


def main(words: list[str]) -> int:
    """Run all; returns the exit code. ``words`` are tests to run in place of the rooms."""
    failed = []
    for minor in range(FIRST, LAST + 1):
        python = found(minor)
        if minor == sys.version_info.minor:
            print(f"Python 3.{minor}: make test runs on it", flush=True)
        elif python is None:
            print(f"Python 3.{minor}: not on this machine", flush=True)
        else:
            print(f"Python 3.{minor}: {python}", flush=True)
            if not tested(python, minor, words):
                failed.append(f"3.{minor}")
    if failed:
        print(f"failed on Python {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
