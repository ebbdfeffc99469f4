"""Requests of every kind with any values: each is done or refused in words, none is a mistake.

``TURNSCAN_FUZZ=10000 pytest tests/web/test_fuzz.py`` asks for more, ``TURNSCAN_FUZZ=500:SEED`` for
those of a run that failed.
"""

from __future__ import annotations

import os
import random
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from turnscan.app import Library, Workshop
from turnscan.app import _protocol as protocol
from turnscan.app._envelope import Array
from turnscan.app._hub import Client
from turnscan.app._jobs import Job
from turnscan.app._requests import REQUESTS
from turnscan.app._workshop import Call

ROUNDS, _, SEED = os.environ.get("TURNSCAN_FUZZ", "500").partition(":")
HANGS = 120.0
"""s that no request may take, on however slow a machine."""
SCHEMAS = {m["const"]: d["properties"] for d in REQUESTS.json_schema()["$defs"].values()
           if (m := d.get("properties", {}).get("kind"))}  # fmt: skip
EDITS = (
    *("delete", "fill", "close", "cut", "decimate", "smooth", "despike", "set_point"),
    *("delete_points", "pick_candidate", "profile_off", "redetect", "close_seam", "measure_area"),
    *("measure_distance", "measure_volume", "no_such"),
)


class _Told:
    """A hub that remembers what it is told."""

    def __init__(self, workshop: Workshop) -> None:
        self.messages: list[protocol.Model] = []
        self.client = Client(remote=False, browser="")
        workshop.hub.join(self.client)
        workshop.hub.tell = self.tell  # type: ignore[method-assign]

    def tell(
        self, message: protocol.Model, arrays: Mapping[str, Array] | None = None, to: Any = None
    ) -> None:
        self.messages.append(message)


def _value(chance: random.Random, scan: str, depth: int = 0) -> Any:
    pool = [
        0, 1, 3, -1, 10**6, 0.5, -2.5, 1e300, True, None, "", "x", scan, "sphere", "left", "flat",
        "mm", [], {}, [0, 0, 0], [1.0, 2.0, 3.0], [0, 5], "chessboard:8x6:20", "\u202e<b>",
    ]  # fmt: skip
    if depth < 2 and chance.random() < 0.2:
        return [_value(chance, scan, depth + 1) for _ in range(chance.randrange(4))]
    return chance.choice(pool)


def _request(chance: random.Random, scan: str, laser: str, revision: int) -> dict[str, Any]:
    kind = chance.choice(sorted(SCHEMAS))
    body: dict[str, Any] = {"kind": kind, "id": 1}
    for key, about in SCHEMAS[kind].items():
        if key in body:
            continue
        if key == "scan" and chance.random() < 0.9:
            body[key] = scan
        elif key == "base_revision":
            body[key] = revision
        elif "enum" in about:
            body[key] = chance.choice(about["enum"])
        elif key == "edit" and kind == "edit":
            names = ("laser", "step", "steps", "line", "lines", "position", "how", "holes", "a",
                     "b", "point", "normal", "distance", "faces", "strength", "rounds")  # fmt: skip
            body[key] = {"kind": chance.choice(EDITS)}
            for name in chance.sample(names, chance.randrange(5)):
                body[key][name] = laser if name == "laser" else _value(chance, scan)
        elif about.get("type") in ("integer", "number"):
            body[key] = chance.choice([0, 1, 2, 5, 400])
        elif about.get("type") == "boolean":
            body[key] = chance.random() < 0.5
        else:
            body[key] = _value(chance, scan)
    return body


def test_no_request_is_a_mistake(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    seed = int(SEED) if SEED else random.SystemRandom().randrange(10**6)
    print(f"seed {seed}")
    chance = random.Random(seed)
    workshop = Workshop(Library(folder))
    monkeypatch.setattr(workshop.rig, "connect", lambda *_: None)
    monkeypatch.setattr("turnscan.app._start_session.FILE_MANAGER", "true")
    told = _Told(workshop)
    scan = next(iter(workshop.library.paths()))
    workshop._load(Job(workshop.hub, "open", "", scan), scan, workshop.library.path(scan), None)
    opened = workshop.opened(scan)
    laser = opened.now.grids[0].laser
    valid, slowest = 0, 0.0
    for _ in range(int(ROUNDS)):
        body = _request(chance, scan, laser, opened.now.revision)
        try:
            request = REQUESTS.validate_python(body)
        except ValidationError:
            continue
        if request.kind in ("ack", "find_devices", "release_control"):
            continue
        valid += 1
        arrays = {"faces": np.array([chance.randrange(10**4)], "<u4")}
        told.messages.clear()
        began = time.monotonic()
        workshop._answer(Call(told.client, request, arrays if chance.random() < 0.5 else {}))
        slowest = max(slowest, time.monotonic() - began)
        assert slowest < HANGS, (seed, body)
        answers = [m for m in told.messages if getattr(m, "id", None) == 1]
        assert len(answers) == 1, (seed, body, told.messages)
        assert getattr(answers[0], "code", "") != "mistake", (seed, body, caplog.text)
    print(f"{valid} of {ROUNDS} were valid, the slowest took {slowest:.1f} s")
    assert valid > int(ROUNDS) / 4
    workshop.close()
