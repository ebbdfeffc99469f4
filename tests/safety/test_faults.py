"""The table of docs/safety.md: after each fault it is dark in the time that is stated."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tests.metronome import Metronome
from tests.safety.faults import CASES, HANGS, SCALE, Case, Hang, firmware, hanging_cameras
from turnscan.acquire import Exposure, Plan, Shooter
from turnscan.scanner import Addresses, opened
from turnscan.simulate.controllers import Socket


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_dark_in_time(case: Case, metronome: Metronome) -> None:
    """Judged strictly, each time, by the time in which the machine had a processor to spare."""
    spans = case.spans()
    print(f"{case.fault}: {max(s.seconds for s in spans) * 1e3:.0f} ms")
    for dialect, span in zip(case.dialects, spans, strict=True):
        assert metronome.served(span.begin, span.dark) < case.limit, dialect


def pictured(nth: int, seconds: float) -> tuple[bool, list[tuple[float, bool]]]:
    """Whether a picture came, and when the laser was lit for it and when dark; the first may hang.

    The camera that hangs comes back when the lease of its light, of 2 s, is over.
    """
    with Socket(firmware("grbl"), scale=SCALE) as socket, hanging_cameras():
        board = f"grbl:{socket.path}?lasers=left"
        at = Addresses("hang:one", board, board)
        HANGS[at.camera] = Hang(socket.firmware, nth, lasts=2.3)
        with opened(at) as bench:
            exposure = Exposure(seconds, 1.0)
            shooter = Shooter(Plan(Fraction(0), 1, ("left",), (exposure,)), bench.hardware)
            shooter.configure(exposure)
            assert shooter.picture(frozenset())[0] is not None
            before = len(socket.firmware.log)
            picture, _ = shooter.picture(frozenset({"left"}))
            log = [(entry.time, bool(entry.outputs)) for entry in socket.firmware.log[before:]]
            return picture is not None, log


def test_a_picture_exposed_for_longer_than_a_lease_is_lit_throughout(metronome: Metronome) -> None:
    came, log = pictured(0, 2.6)
    assert came
    (begin, lit), (end, dark) = log
    assert (lit, dark) == (True, False)
    assert end - begin >= 2.6
    assert metronome.served(begin, end) < 3.6


def test_a_picture_that_did_not_come_is_taken_again_in_new_light(metronome: Metronome) -> None:
    came, log = pictured(1, 0.02)
    assert came
    assert [lit for _, lit in log] == [True, False, True, False]
    begin, end = log[0][0], log[1][0]
    assert end - begin > 1.8
    assert metronome.served(begin, end) < 2.5
