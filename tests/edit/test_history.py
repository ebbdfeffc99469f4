"""Branches: an edit made after stepping back loses nothing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.edit import (
    Branch,
    CloseSeam,
    History,
    Name,
    action_from_json,
    action_to_json,
    history_from_json,
    history_from_log,
    history_to_json,
)
from turnscan.edit._history import Action
from turnscan.errors import FormatError, InputError

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
    with pytest.raises(InputError, match="neither the history nor a branch has an edit 7"):
        history.to(7)


def test_any_edit_of_the_tree_is_gone_to() -> None:
    history, _ = made(4)
    history = history.after(history.to(2))
    history = history.after(history.add(EDIT))  # 5 after 2
    history = history.after(history.to(1))
    history = history.after(history.add(EDIT))  # 6 after 1
    assert [(f.after, ids(f.entries)) for f in history.forks] == [(1, [2, 5]), (2, [3, 4])]
    for edit, path in ((3, [1, 2, 3]), (5, [1, 2, 5]), (6, [1, 6]), (2, [1, 2]), (0, [])):
        there = history.after(history.to(edit))
        assert ids(there.enabled) == path
        assert {e.id for f in there.forks for e in f.entries} | set(ids(there.entries)) == set(
            range(1, 7)
        )
    inside = history.to(3)
    assert '"version":4' in action_to_json(inside)
    assert '"cursor":3' in action_to_json(inside)
    with pytest.raises(InputError, match="has 4 edits, so none after 9"):
        history.after(Branch(4, 9))


def test_names_of_edits_are_kept_on_every_branch_and_in_files() -> None:
    history, _ = made(3)
    history = history.after(history.to(1))
    history = history.after(history.add(EDIT))
    named = history
    for edit, name in ((1, " first "), (3, "other way"), (4, "now")):
        named = named.after(named.naming(edit, name))
    assert [e.name for e in named.entries] == ["first", "now"]
    assert [[e.name for e in path] for path in named.branches] == [["first", "", "other way"]]
    again = history_from_json(history_to_json(named))
    assert [(e.id, e.name) for e in again.entries] == [(1, "first"), (4, "now")]
    assert '"version":1' in history_to_json(history)
    assert named.after(Name(1, "")).entries[0].name == ""
    for edit, name, why in (
        (9, "x", "no edit 9"),
        (1, "a\nb", "no name"),
        (1, "x" * 81, "no name"),
    ):
        with pytest.raises(InputError, match=why):
            named.naming(edit, name)
    with pytest.raises(InputError, match="no edit 9"):
        history.after(Name(9, "x"))
    text = history_to_json(named).replace('"first"', "7")
    with pytest.raises(FormatError, match="name: not a text"):
        history_from_json(text)


def test_older_programs_read_all_logs_without_a_branch() -> None:
    history, log = made(2)
    assert all('"version":1' in action_to_json(a) for a in log)
    history = history.after(history.undo())
    history = history.after(history.add(EDIT))
    assert '"version":2' in action_to_json(history.branch(2))


@given(st.lists(st.integers(0, 12), max_size=40))
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
            elif choice == 6:
                log.append(history.naming(history.next_id // 2, "a name"))
            elif choice > 6:
                log.append(history.to(choice - 7))
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
