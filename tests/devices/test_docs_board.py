"""The commands of docs/how-to/try-a-board.md, as they stand there: real ports, real packets."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.devices.boards import DIALECTS
from turnscan.cli import turnscan
from turnscan.formats import read_mesh
from turnscan.scan import Scan
from turnscan.shapes import deviation

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "try-a-board.md"
STEPS = 12
FLOOR, CEILING = 0.01, 0.06
"""mm rms. The stripe's noise is 0.04 mm; an angle wrong by 0.5° would give more than 0.1 mm."""


def commands(dialect: str) -> tuple[list[str], list[list[str]]]:
    """What the page types in the one terminal and then in the other."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(), re.S)
    at = next(i for i, b in enumerate(blocks) if b.startswith(f"turnscan emulate {dialect} "))
    (first,) = blocks[at].splitlines()
    return shlex.split(first)[1:], [shlex.split(line)[1:] for line in blocks[at + 1].splitlines()]


def emulate(words: list[str]) -> subprocess.Popen[str]:
    """The first terminal; returns when it says that it is ready."""
    code = "from turnscan.cli import main; main()"
    child = subprocess.Popen([sys.executable, "-u", "-c", code, *words],
                             stdout=subprocess.PIPE, text=True)  # fmt: skip
    assert child.stdout is not None
    for line in child.stdout:
        if line.startswith("ready"):
            return child
    raise AssertionError(f"turnscan {' '.join(words)} ended with {child.wait(5.0)}")


@pytest.mark.usefixtures("aravis")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_commands_of_the_page(
    dialect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    first, then = commands(dialect)
    child = emulate(first)
    try:
        for words in then:
            done = CliRunner().invoke(turnscan, words)
            # 1 is a finding, such as the open borders of twelve profiles.
            assert done.exit_code in (0, 1), (words, done.output, done.exception)
            assert (done.exit_code == 0) or words[0] == "reconstruct"
            if words[0] == "devices":
                assert f"board: {dialect}:board" in done.output
        child.send_signal(signal.SIGINT if dialect == "grbl" else signal.SIGTERM)
        said, _ = child.communicate(timeout=20.0)
    finally:
        child.kill()
        child.communicate()
    assert child.returncode == 0
    assert not (tmp_path / "board").is_symlink()
    # The board's own log: lit for each exposure alone, and dark at the end.
    found = re.search(r"lit (\d+) times, .* ([\d.]+) s at most; dark at the end", said)
    assert found is not None, said
    assert int(found[1]) == STEPS
    assert 0.04 < float(found[2]) < 2.0
    with Scan.open(tmp_path / f"{dialect}.turnscan") as scan:
        assert scan.complete
        assert len(scan) == STEPS

    mesh = read_mesh((tmp_path / f"{dialect}.stl").read_bytes(), ".stl")
    truth = read_mesh((tmp_path / "truth.stl").read_bytes(), ".stl")
    apart = deviation(mesh.vertices, truth)
    assert len(mesh.vertices) > 1500
    assert FLOOR < apart.rms < CEILING
    assert abs(apart.mean) < 0.5 * CEILING
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(truth.vertices, axis=0), abs=4.0)


def test_a_port_is_given_back_and_time_runs_out(tmp_path: Path) -> None:
    port = tmp_path / "board"
    port.symlink_to(tmp_path / "gone")  # as one that was killed leaves it
    begun = time.monotonic()
    done = CliRunner().invoke(
        turnscan, ["emulate", "horus", "--no-camera", "--port", str(port), "--seconds", "0.3"]
    )
    assert done.exit_code == 0, done.exception
    assert time.monotonic() - begun > 0.3
    assert not port.is_symlink()
    assert f"horus:{port}?lasers=right" in done.output
    assert "aravis" not in done.output


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["gryphon"], "no board 'gryphon'"),
        (["grbl", "sim:cup?perfect=1"], "without noise"),
        (["grbl", "sim:cup?drop=0.1"], "drop"),
        (["grbl", "--hurry", "0"], "0 times as fast"),
        (["grbl", "--port", "there"], "there: already exists"),
        (["grbl", "--port", "no/board"], "no such folder"),
        (["grbl", "--no-camera", "--rig", "no/rig.json"], "there is no folder"),
    ],
)
def test_what_cannot_be_emulated_is_one_line(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").write_text("precious")
    done = CliRunner().invoke(turnscan, ["emulate", *words])
    assert says in str(done.exception)
    assert [p.name for p in tmp_path.iterdir()] == ["there"]
