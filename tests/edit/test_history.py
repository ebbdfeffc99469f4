"""Branches: an edit made after stepping back loses nothing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.edit import (
    CloseSeam,
    History,
    action_from_json,
    action_to_json,
    history_from_log,
)
from turnscan.edit._history import Action
from turnscan.errors import InputError

EDIT = CloseSeam("right")


def ids(entries) -> list[int]:
    return [e.id for e in entries]


def made(count: int) -> tuple[History, list[Action]]:
    history, log = History(), list[Action]()
    for _ in range(count):
        log.append(history.add(EDIT))
        history = history.after(log[-1])
    return history, log


def test_what_was_undone_before_an_edit_is_a_branch() -> None:
    history, _ = made(4)
    history = history.after(history.undo())
    history = history.after(history.undo())
    assert not history.branches
    history = history.after(history.add(EDIT))
    assert ids(history.entries) == [1, 2, 5]
    assert [ids(path) for path in history.branches] == [[1, 2, 3, 4]]


def test_a_branch_is_taken_up_and_the_history_becomes_one() -> None:
    history, _ = made(3)
    history = history.after(history.undo())
    history = history.after(history.add(EDIT))
    back = history.after(history.branch(3))
    assert ids(back.entries) == [1, 2, 3]
    assert back.cursor == 3
    assert [ids(path) for path in back.branches] == [[1, 2, 4]]
    assert back.after(back.branch(4)) == history
    with pytest.raises(InputError, match="no branch of the history ends with edit 2"):
        history.branch(2)


def test_older_programs_read_all_logs_without_a_branch() -> None:
    history, log = made(2)
    assert all('"version":1' in action_to_json(a) for a in log)
    history = history.after(history.undo())
    history = history.after(history.add(EDIT))
    assert '"version":2' in action_to_json(history.branch(2))


@given(st.lists(st.integers(0, 5), max_size=40))
def test_no_edit_is_ever_lost(choices: list[int]) -> None:
    history, log = History(), list[Action]()
    for choice in choices:
        try:
            if choice < 2:
                log.append(history.add(EDIT))
            elif choice == 2:
                log.append(history.undo())
            elif choice == 3:
                log.append(history.redo())
            else:
                some = history.branches[choice % len(history.branches)] if history.branches else ()
                log.append(history.branch(some[-1].id if some else 0))
        except InputError:
            continue
        history = history.after(log[-1])
        reachable = {e.id for path in (history.entries, *history.branches) for e in path}
        assert reachable == set(range(1, history.next_id))
        tips = [path[-1].id for path in history.branches]
        assert len(set(tips)) == len(tips)
        assert not {e.id for e in history.entries} & set(tips)
    texts = [action_to_json(a) for a in log]
    assert history_from_log(texts) == history
    assert [action_from_json(t) for t in texts] == log
