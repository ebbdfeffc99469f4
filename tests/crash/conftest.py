"""The forking process that the crash tests share, plain or on a disk that can fail."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.needs import needs

HERE = Path(__file__).parent


class Zygote:
    """Asks `tests.crash.zygote`."""

    def __init__(self, folder: Path, library: Path | None = None) -> None:
        self.folder = folder
        environment = {**os.environ, "DISK_DIR": str(folder)}
        if library is not None:
            environment |= {"LD_PRELOAD": str(library), "DISK_LIBRARY": str(library)}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.crash.zygote"], cwd=HERE.parents[1], env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def ask(self, do: str, **more: Any) -> dict[str, Any]:
        """One request, one answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"do": do, **more}) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, "the process is gone"
        return dict(json.loads(line))

    def new_folder(self, name: str) -> Path:
        """An empty one, in the folder that the disk minds."""
        path = self.folder / name
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir()
        return path

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(30)
        finally:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()


@pytest.fixture(scope="module")
def quick_folder() -> Iterator[Path]:
    """In memory where there is such a thing: a killed process does not care for the disk."""
    shm = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shm if os.access(shm, os.W_OK) else None) as folder:
        yield Path(folder)


@pytest.fixture(scope="module")
def zygote(quick_folder: Path) -> Iterator[Zygote]:
    needs("POSIX")
    made = Zygote(quick_folder)
    yield made
    made.close()


@pytest.fixture(scope="module")
def failing_disk(quick_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Zygote]:
    needs("Linux", "C compiler")
    library = tmp_path_factory.mktemp("disk") / "disk.so"
    subprocess.run(
        ["cc", "-O1", "-shared", "-fPIC", "-o", library, HERE / "disk.c", "-ldl", "-lpthread"],
        check=True,
    )
    made = Zygote(quick_folder, library)
    yield made
    made.close()
