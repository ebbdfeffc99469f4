"""Freed memory goes back to the system."""

import ctypes
import subprocess
import sys

import pytest

from turnscan import memory


def test_giving_back_may_be_asked_at_any_time() -> None:
    for _ in range(3):
        memory.give_back()


def test_without_such_an_allocator_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: object) -> object:
        raise OSError("no such library")

    memory._of_libc.cache_clear()
    monkeypatch.setattr(memory.ctypes, "CDLL", missing)
    memory.give_back()
    assert memory._of_libc("malloc_trim") is None
    memory._of_libc.cache_clear()


def test_threads_share_few_pools() -> None:
    if not hasattr(ctypes.CDLL(None), "malloc_info"):  # another allocator, which is left alone
        assert not memory.share_pools()
        return
    code = (
        "import ctypes, threading, time; from turnscan.memory import share_pools\n"
        "assert share_pools()\n"
        "held = []\n"
        "def work(): held.append(bytearray(4096)); time.sleep(0.2)\n"
        "some = [threading.Thread(target=work) for _ in range(12)]\n"
        "[t.start() for t in some]; [t.join() for t in some]\n"
        "libc = ctypes.CDLL(None); libc.fdopen.restype = ctypes.c_void_p\n"
        "out = ctypes.c_void_p(libc.fdopen(1, b'w')); libc.malloc_info(0, out); libc.fflush(out)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.count("<heap nr=") <= 2


def test_garbage_is_looked_for_seldom_and_found() -> None:
    code = (
        "import gc, weakref\n"
        "from turnscan import cli\n"
        "import sys; sys.argv[1:] = ['--version']\n"
        "cli.main()\n"
        "class Loop: pass\n"
        "lost = Loop(); lost.self = lost; seen = weakref.ref(lost); del lost\n"
        "before = sum(s['collections'] for s in gc.get_stats())\n"
        "kept = [[] for _ in range(100_000)]\n"
        "print(sum(s['collections'] for s in gc.get_stats()) - before, seen() is None)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    times, found = said.stdout.splitlines()[-1].split()
    assert 1 <= int(times) <= 12, "every 700 objects it would be 150 times"
    assert found == "True"
