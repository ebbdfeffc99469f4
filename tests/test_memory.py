"""Freed memory goes back to the system."""

import pytest

from turnscan import memory


def test_giving_back_may_be_asked_at_any_time() -> None:
    for _ in range(3):
        memory.give_back()


def test_without_such_an_allocator_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: object) -> object:
        raise OSError("no such library")

    memory._trim.cache_clear()
    monkeypatch.setattr(memory.ctypes, "CDLL", missing)
    memory.give_back()
    assert memory._trim() is None
    memory._trim.cache_clear()
