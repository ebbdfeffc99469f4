"""The command: it says where it listens, lets in once, and ends cleanly."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.web.running import PATIENCE


def _started(folder: Path, *options: str) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(
        [sys.executable, "-m", "turnscan", "app", str(folder), "--no-browser", *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    return process, process.stdout.readline()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_link_and_a_clean_end(folder: Path, number: signal.Signals) -> None:
    process, line = _started(folder)
    link = line.split()[1]
    base, token = link.split("/login#")
    assert base.startswith("http://127.0.0.1:")
    headers = {"Origin": base, "X-Turnscan": "1"}
    entered = httpx.post(f"{base}/login", json={"token": token}, headers=headers)
    assert entered.status_code == 204
    assert process.stdout is not None
    assert process.stdout.readline().startswith(f"for another browser: {base}/login#")
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert "Traceback" not in out + err
    assert token not in err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--host", "0.0.0.0"], "other computers would be able to connect"),
        (["--allow-remote-lasers"], "without --allow-remote"),
        (["--port", "99999"], "99999"),
        (["--host", "192.0.2.1", "--allow-remote"], "cannot listen there"),
    ],
)
def test_options_that_cannot_be_are_one_line(tmp_path: Path, options: list[str], said: str) -> None:
    process, _ = _started(tmp_path, *options)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("content", [b"no scan", None])
def test_edit_says_what_is_no_scan_file(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "part.turnscan"
    if content is not None:
        path.write_bytes(content)
    done = subprocess.run(
        [sys.executable, "-m", "turnscan", "edit", str(path), "--no-browser"],
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "part.turnscan" in done.stderr
