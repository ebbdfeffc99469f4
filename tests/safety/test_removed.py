"""Each protection removed in turn: the test of its goal must fail; docs/explain/goals.md lists all.

Where a protection lies in the guard's process, its mutant stands beside its test.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.acquire import test_angle, test_bad_pictures
from tests.devices import test_camera_steady, test_protocol
from tests.scan import test_damage
from turnscan.devices import _validated_camera
from turnscan.devices._board import Board
from turnscan.devices._grbl import GrblBoard
from turnscan.devices._replies import Kind, Sentence
from turnscan.errors import TurnscanError
from turnscan.scan import _database

Patch = pytest.MonkeyPatch
Mutant = Callable[[Patch], None]


def trusts_payloads(patch: Patch) -> None:
    def credulous(payload: bytes, row: _database.Row, path: Path) -> bytes:
        return payload

    patch.setattr(_database, "check_payload", credulous)


def believes_any_angle(patch: Patch) -> None:
    patch.setattr(test_angle, "check_angle", lambda plan, scan, table: None)


def decodes_before_it_looks(patch: Patch) -> None:
    def naive(line: bytes) -> Sentence:
        return Sentence(Kind.OK, line.decode("ascii"))

    patch.setattr(test_protocol, "sentence", naive)


def takes_what_lies_in_the_buffer(patch: Patch) -> None:
    patch.setattr(_validated_camera, "_EARLY", -1.0)


def finds_nothing_wrong(patch: Patch) -> None:
    patch.setattr(_validated_camera, "fault_of", lambda *_: None)


def forgets_the_alarm(patch: Patch) -> None:
    patch.setattr(Board, "_lose", lambda self, error: None)


def does_not_wait(patch: Patch) -> None:
    """The next command goes out before the move was answered."""
    inner = GrblBoard._ask

    def hasty(self: GrblBoard, text: str, *args: Any, **named: Any) -> Sentence:
        if not text.startswith("G1"):
            return inner(self, text, *args, **named)
        self._link.write(text.encode())
        return Sentence(Kind.OK, "ok")

    patch.setattr(GrblBoard, "_ask", hasty)


@pytest.mark.parametrize(
    ("remove", "test"),
    [
        pytest.param(trusts_payloads, test_damage.test_mutations_never_give_a_wrong_frame, id="C7"),
        pytest.param(
            believes_any_angle, test_angle.test_after_a_reboot_at_any_step_the_angle_is_lost,
            id="C13",
        ),
        pytest.param(
            decodes_before_it_looks, lambda _: test_protocol.test_a_hundred_thousand_lines(),
            id="D3",
        ),
        pytest.param(
            takes_what_lies_in_the_buffer,
            lambda _: test_camera_steady.test_no_picture_that_was_waiting_in_a_buffer_gets_through(
                4
            ),
            id="D4",
        ),
        pytest.param(
            finds_nothing_wrong,
            lambda path: test_bad_pictures.test_what_is_stored_is_what_the_camera_saw_there(
                path, 0.12, 1, 0
            ),
            id="D5",
        ),
        pytest.param(
            forgets_the_alarm,
            lambda _: (
                test_protocol.test_after_an_alarm_nothing_is_sent_until_a_person_acknowledges(
                    "grbl"
                )
            ),
            id="D8 alarm",
        ),
        pytest.param(
            does_not_wait, lambda _: test_protocol.test_one_command_in_flight("grbl"),
            id="D8 one command",
        ),
    ],
)  # fmt: skip
def test_without_the_protection_its_test_fails(
    remove: Mutant, test: Callable[[Path], None], tmp_path: Path, monkeypatch: Patch
) -> None:
    remove(monkeypatch)
    failures = (AssertionError, pytest.fail.Exception, UnicodeDecodeError, TurnscanError)
    with pytest.raises(failures):
        test(tmp_path)
