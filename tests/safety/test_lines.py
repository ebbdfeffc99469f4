"""S5: no bytes that pass the guard light a laser, as the boards' own readers see them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.devices.boards import OUTPUTS
from tests.safety.faults import DIALECTS, firmware
from turnscan.devices._dialects import DIALECTS as TABLE
from turnscan.devices._dialects import LineFilter
from turnscan.simulate.controllers import Firmware

HIDDEN = {
    "grbl": [
        b"M3 S1000\n", b"M?3 S1000\n", b"M~3 S9\n", b"M\x903 S1000\n", b"M\x0b3 S1000\n",
        b"m3s5\n", b"M(dark)3 S5\n", b"M/3 S5\n", b"M03.0 S5\n", b"M+3 S5\n", b" M 0 3 S5\n",
        b"M" + b" " * 300 + b"3 S1000\n", b"M" + b"\x01" * 300 + b"3 S1000\n", b"M8\n", b"M 7\n",
        b"G1 X1 M8\n", b"\x18M3 S5\n", b"M3 S5\r", b"S1000 M\xff4\n", b"$N0=M3 S1000\n",
        b"$J=G91 X1 F1 M8\n", b"\xa0", b"~", b"M3\xc2\xa0S5\n",
    ],
    "horus": [b"M71T1\r\n", b"m 71 T2\r\n", b"M?71T1\r\n", b"M\x0071T1\r\n", b"G1F1M71T1\r\n",
              b"M071.0T1\r\n", b"M" + b" " * 300 + b"71T1\r\n"],
    "fabscan": [b"M21\n", b"M19;\n", b"X M021\n", b"M 21\n", b"M" + b"0" * 90 + b"21\n",
                b"M65557\n", b"G02 T1 M21\n"],
    "sardauscan": [b"L 0 1\r", b"\rL 2 7\r", b"l 0 1\r", b"L\t0\t1\r", b"\x01L 0 1\r",
                   b"L 0 65537\r", b"T\rL 0 1\r"],
}  # fmt: skip
"""Lines that light a laser, and disguises of them."""
PIECES = {
    "grbl": [b"M", b"3", b"4", b"8", b" S1000", b"G1", b"X5", b"M5", b"G4 P0", b"$X", b"$N0="],
    "horus": [b"M", b"71", b"T1", b"70", b"G1", b"X5", b"F9", b"M17", b"G50"],
    "fabscan": [b"M", b"21", b"19", b"22", b"G02 T5 F9", b"M17", b";", b" "],
    "sardauscan": [b"L", b" 0", b" 1", b"T", b" A 5", b" S", b"sardauscan"],
}
ALLOWED = {
    "grbl": [b"G1 X5 F9\n", b"G4 P0\n", b"$X\n", b"G21 G90 G94\n", b"?"],
    "horus": [b"G1X5\r\n", b"M17\r\n", b"?\r\n", b"G50\r\n", b"!"],
    "fabscan": [b"G02 T21 F9\n", b"M17\n", b"M200;\n"],
    "sardauscan": [b"T A 1\r\n", b"T\r\n", b"sardauscan\r\n"],
}
NOISE = [b"\n", b"\r", b"\r\n", b"?", b"!", b"~", b"\x18", b" ", b"\t", b"\x0b", b"\x90", b"\xa0",
         b"(", b")", b";", b"/", b"\0", b" " * 70, b"+", b"0", b"."]  # fmt: skip


def lights(board: Firmware, frames: list[bytes]) -> bool:
    """Whether these bytes light a laser of a board that was in G1 with power on its mind."""
    for data in frames:
        board.feed(data)
        board.run(board.now + 2.0)
        board.take()
    return any(entry.outputs for entry in board.log)


def passed(dialect: str, frames: list[bytes]) -> list[bytes]:
    """What the guard sends on, up to the first line that it refuses."""
    guard, out = LineFilter(TABLE[dialect]), []
    for data in frames:
        try:
            out.append(guard.feed(data))
        except ValueError:
            break
    return out


@pytest.mark.parametrize("dialect", DIALECTS)
def test_disguises_are_refused_before_a_byte_of_them_goes_out(dialect: str) -> None:
    for line in HIDDEN[dialect]:
        for cut in range(len(line) + 1):
            out = passed(dialect, [line[:cut], line[cut:], b"\n"])
            assert not lights(firmware(dialect), out), (line, cut)
    # The boards do light by most of them: what refuses them is not the board.
    real = sum(lights(firmware(dialect), [line, b"\n"]) for line in HIDDEN[dialect])
    assert real > len(HIDDEN[dialect]) / 3


@pytest.mark.parametrize("dialect", DIALECTS)
def test_nothing_that_passes_lights_a_laser(dialect: str) -> None:
    piece = st.sampled_from(PIECES[dialect] + NOISE)
    frame = st.one_of(
        st.sampled_from(ALLOWED[dialect]),
        st.lists(piece, max_size=12).map(b"".join),
        st.binary(max_size=6),
        st.sampled_from(HIDDEN[dialect]),
    )
    count = {"passed": 0, "lit unfiltered": 0}

    @settings(max_examples=400)
    @given(st.lists(frame, max_size=8))
    def check(frames: list[bytes]) -> None:
        out = passed(dialect, frames)
        count["passed"] += any(out)
        count["lit unfiltered"] += lights(firmware(dialect), frames)
        assert not lights(firmware(dialect), out)

    check()
    assert count["passed"] > 40, count
    assert count["lit unfiltered"] > 40, count


@pytest.mark.parametrize("dialect", [*DIALECTS, "scpi"])
def test_what_is_cut_short_joins_no_line_to_a_lighting_one(dialect: str) -> None:
    """No line begins with a digit, so that none completes the number of another."""
    for first in b"0123456789.+- ":
        for rest in (b"", b"1", b"1 X1", b" A 1"):
            assert TABLE[dialect].lines.fullmatch(bytes([first]) + rest) is None


def test_a_filter_that_lets_all_pass_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LineFilter, "_check", lambda self, line, lit: None)
    test: Callable[[str], None] = test_disguises_are_refused_before_a_byte_of_them_goes_out
    for dialect in DIALECTS:
        with pytest.raises(AssertionError):
            test(dialect)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_no_stretch_of_the_dark_bytes_that_gets_lost_lights_a_laser(dialect: str) -> None:
    steps = TABLE[dialect].dark(OUTPUTS[dialect])
    stream = b"".join(step.send for step in steps)
    for begin in range(len(stream)):
        for end in range(begin + 1, min(begin + 24, len(stream)) + 1):
            board = firmware(dialect)
            board.power_on()
            board.run(10.0)
            board.feed(stream[:begin] + stream[end:])
            board.run(20.0)
            assert not any(entry.outputs for entry in board.log), stream[begin:end]
