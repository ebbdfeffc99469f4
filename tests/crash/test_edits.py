"""kill -9 at any moment of an edit session loses at most the last edit, and no frame."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from tests.crash.conftest import Zygote
from tests.edit.surfaces import sheet
from tests.scan.small import write
from turnscan.edit import (
    Body,
    Delete,
    Document,
    Fill,
    History,
    Region,
    action_from_json,
    action_to_json,
    history_from_log,
)
from turnscan.scan import Scan

KILLS = 20
SEED = 7
EDITS = 300


@pytest.fixture(scope="module")
def log() -> list[str]:
    """A session: deletes, fills, undo and redo."""
    body = Body.of(sheet(12))
    rng = np.random.default_rng(SEED)
    history, texts = History(), []
    for number in range(EDITS):
        if number % 5 == 3:
            action = history.undo()
        elif number % 5 == 4:
            action = history.redo()
        elif number % 5 == 2:
            action = history.add(Fill())
        else:
            faces = rng.choice(len(body.alive), size=int(rng.integers(1, 60)), replace=False)
            action = history.add(Delete(Region.of(body, faces)))
        history = history.after(action)
        texts.append(action_to_json(action))
    return texts


def there(path: Path) -> list[str]:
    with Scan.open(path) as scan:
        assert [trouble for _, trouble in scan.verify() if trouble] == []
        assert len(scan) == 6
        return [entry.text for entry in scan.edits()]


def test_twenty_kills_lose_at_most_the_last_edit(zygote: Zygote, log: list[str]) -> None:
    rng = random.Random(SEED)
    inside = 0
    for number in range(KILLS):
        path = zygote.new_folder("repaired") / "a.turnscan"
        write(path)
        commit, delay = rng.randrange(1, EDITS // 2), rng.random() * 0.003
        zygote.ask("kill_edits", path=str(path), texts=log, commit=commit, delay=delay)
        kept = there(path)
        assert kept == log[: len(kept)], (SEED, number)
        # ``commit`` edits were begun when the clock started: all but that one were acknowledged.
        assert len(kept) >= commit - 1, (SEED, number, commit)
        inside += len(kept) < EDITS
        history = history_from_log(kept)
        with Scan.resume(path) as scan:
            assert scan.append_edit(action_to_json(history.add(Fill()))).number == len(kept) + 1
        assert [p.name for p in path.parent.iterdir()] == ["a.turnscan"], "nothing is left beside"
        assert there(path)[:-1] == kept
    assert inside >= 0.8 * KILLS, f"only {inside} of {KILLS} kills hit the session"


def test_what_is_left_opens_as_the_same_surface(zygote: Zygote, log: list[str]) -> None:
    path = zygote.new_folder("reopened") / "a.turnscan"
    write(path)
    zygote.ask("kill_edits", path=str(path), texts=log, commit=20, delay=0.0005)
    kept = there(path)
    mesh = sheet(12)
    document = Document.open(lambda *_: (mesh, ()))
    for text in kept:
        document, _ = document.after(action_from_json(text))
    again = Document.open(lambda *_: (mesh, ()), history_from_log(kept))
    assert again.body.digest() == document.body.digest()
    assert not document.body.alive.all()
