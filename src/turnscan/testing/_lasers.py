"""What every driver of lasers must do, as a check that its author can run."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from turnscan.devices import Lasers
from turnscan.errors import TurnscanError

_RENEWED = 0.4
"""s"""
_SOON = 0.5
"""s from a command to its light, and from a lease's end to dark."""


def check_lasers(
    opener: Callable[[], AbstractContextManager[Lasers]],
    *,
    burning: Callable[[], frozenset[str]] | None = None,
) -> None:
    """Run a driver of lasers through all that turnscan relies on. It lights them for moments.

    ``opener`` gives a context manager of the lasers; ``burning`` tells which really burn, by a
    channel of its own: an emulated board's log, a photodiode, a person.

    Checked are: dark after opening; exactly the lasers asked for burn; unknown names and leases
    that are none are refused and light nothing; a lease ends by itself, and not while it is
    renewed; renewing lights nothing; `off` works when dark, when lit, twice, and from another
    thread; dark after closing and after an error.

    Raises AssertionError, saying what is not as it must be.
    """

    def see(wanted: frozenset[str], when: str) -> None:
        end = time.monotonic() + _SOON
        while burning is not None and burning() != wanted:
            assert time.monotonic() < end, f"{when}: {sorted(burning())} burn, not {sorted(wanted)}"
            time.sleep(0.005)

    dark: frozenset[str] = frozenset()
    with opener() as lasers:
        assert isinstance(lasers, Lasers), "it lacks names, light or off"
        names = lasers.names
        assert names, "it has no lasers"
        assert len(set(names)) == len(names), f"a name is given twice in {names}"
        see(dark, "after opening")
        for wanted in [dark, *(frozenset({name}) for name in names), frozenset(names)]:
            lasers.light(wanted, 2.0)
            see(wanted, f"light({sorted(wanted)})")
        _check_refusals(lasers)
        lasers.off()
        see(dark, "after off")
        lasers.off()
        lasers.light(frozenset({names[0]}), 2.0)
        thread = threading.Thread(target=lasers.off)
        thread.start()
        thread.join(timeout=5.0)
        assert not thread.is_alive(), "off from another thread did not come back"
        see(dark, "after off from another thread")
        lasers.light(frozenset({names[0]}), 0.2)
        time.sleep(0.2)
        see(dark, "after a lease of 0.2 s")
        lasers.off()
        lasers.renew(1.0)
        see(dark, "after renewing what is dark")
        _check_renewal(lasers, see)
        lasers.off()
        lasers.light(frozenset({names[0]}), 2.0)
    see(dark, "after closing a lit laser")
    _check_error(opener)
    see(dark, "after an error")


def _check_renewal(lasers: Lasers, see: Callable[[frozenset[str], str], None]) -> None:
    one = frozenset({lasers.names[0]})
    lasers.light(one, _RENEWED)
    for _ in range(6):
        time.sleep(_RENEWED / 4)
        lasers.renew(_RENEWED)
    see(one, f"a lease of {_RENEWED:g} s that was renewed")
    time.sleep(_RENEWED)
    see(frozenset(), "after the last renewal ran out")


def _check_refusals(lasers: Lasers) -> None:
    name = lasers.names[0]
    bad = [(frozenset({"no such laser"}), 1.0), (frozenset({name, ""}), 1.0)]
    bad += [(frozenset({name}), lease) for lease in (0.0, -1.0, math.nan, math.inf)]
    for lit, lease in bad:
        try:
            lasers.light(lit, lease)
        except TurnscanError:
            continue
        raise AssertionError(f"light({sorted(lit)}, {lease}) was not refused")


def _check_error(opener: Callable[[], AbstractContextManager[Lasers]]) -> None:
    class _Passer(Exception):
        pass

    try:
        with opener() as lasers:
            lasers.light(frozenset(lasers.names), 2.0)
            raise _Passer
    except _Passer:
        return
    raise AssertionError("it swallows errors raised while it is open")
