"""The editor killed at any moment: what it has acknowledged is in the file."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from tests.web.running import Browser, small_scan
from turnscan import edit
from turnscan.scan import Scan

KILLS = 20
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a small scan."""
    place = tmp_path_factory.mktemp("edited")
    small_scan(place / "ball.turnscan", steps=16)
    return place


@pytest.fixture(scope="module")
def forker(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """The process that forks servers."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.crash.edit_server", str(folder)],
        cwd=HERE.parents[1], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    yield process
    assert process.stdin is not None
    process.stdin.close()
    process.wait(20)
    assert process.stdout is not None
    process.stdout.close()


def test_a_killed_editor_loses_at_most_the_last_edit(
    folder: Path, forker: subprocess.Popen[str]
) -> None:
    seed = random.SystemRandom().randrange(10**6)
    print(f"seed {seed}")
    chance = random.Random(seed)
    path = folder / "ball.turnscan"
    acknowledged = in_flight = 0
    for _ in range(KILLS):
        done, asked = _session(forker, chance)
        with Scan.open(path) as scan:
            kept = scan.edits()
        assert acknowledged + done <= len(kept) <= acknowledged + asked, f"seed {seed}"
        in_flight += asked > done
        edit.history_from_log([e.text for e in kept])
        acknowledged = len(kept)
    assert acknowledged > KILLS
    assert in_flight >= KILLS // 4, f"{in_flight} of {KILLS} kills met an edit under way"
    with Scan.resume(path) as scan:  # nobody holds it any more
        assert len(scan.edits()) == acknowledged


def _session(forker: subprocess.Popen[str], chance: random.Random) -> tuple[int, int]:
    """Some edits, then a kill: how many were acknowledged, and how many were asked for."""
    assert forker.stdin is not None
    assert forker.stdout is not None
    forker.stdin.write("serve\n")
    forker.stdin.flush()
    at = json.loads(forker.stdout.readline())
    base = f"http://127.0.0.1:{at['port']}"
    answer = httpx.post(
        f"{base}/login",
        json={"token": at["token"]},
        headers={"Origin": base, "X-Turnscan": "1"},
    )
    cookie = answer.headers["set-cookie"].split(";")[0]
    server = SimpleNamespace(base=base, port=at["port"])
    done = asked = 0
    killed = False
    with Browser(server, cookie) as one, contextlib.suppress(ConnectionClosed):  # type: ignore[arg-type]
        scan = one.hello["scans"][0]["scan"]
        revision = one.open(scan)["revision"]
        faces = chance.sample(range(300), 12)
        for k in range(chance.randrange(2, 6) + 1):
            last = k and chance.random() < 0.3
            asked += 1
            number = one.send(
                "edit", {"faces": np.array(sorted(faces[2 * k : 2 * k + 2]), "<u4")},
                scan=scan, base_revision=revision, edit={"kind": "delete"},
            )  # fmt: skip
            if last or k == 5:
                break
            reply = next(m for m in iter(one.receive, None) if m.get("id") == number)
            if reply["kind"] == "done":
                done += 1
                revision += 1
            else:  # the face is gone already: nothing is kept of that
                asked -= 1
        time.sleep(chance.random() * 0.04)
        os.kill(at["pid"], signal.SIGKILL)
        killed = True
        while True:
            reply = one.receive(10.0)
            done += reply.get("id") == number and reply["kind"] == "done" and asked > done
    assert killed
    assert forker.stdout.readline() == "gone\n"
    return done, asked
