"""The emulated boards read bytes as the firmwares' sources do, also where that is odd or unsafe."""

from __future__ import annotations

import pytest

from turnscan.simulate.controllers import (
    FabScanFirmware,
    Firmware,
    GrblFirmware,
    HorusFirmware,
    SardauscanFirmware,
)


def say(board: Firmware, *parts: bytes | float) -> bytes:
    """Bytes go in, and times pass; what comes out."""
    board.run(board.now + 0.1)
    board.take()
    said = b""
    for part in parts:
        if isinstance(part, bytes):
            board.feed(part)
        board.run(board.now + (part if isinstance(part, float) else 0.05))
        said += board.take()
    return said


LIGHTS = {
    b"M3 S1000\n": "m3", b"m3s1\n": "m3", b"M03 S5\n": "m3", b"M+3S5\n": "m3", b"M3.0S5\n": "m3",
    b"M3.001 S5\n": "m3",  # less than half a hundredth
    b"M?3 S5\n": "m3", b"M~3 S5\n": "m3", b"M\x903 S5\n": "m3",  # real-time bytes in a word
    b"M\xff3 S5\n": "m3",  # a byte above 0x7F that means nothing
    b"M\x0b3\x00S5\n": "m3", b"M\t3 S5\n": "m3", b"M/3S5\n": "m3", b"M(a)3S5\n": "m3",
    b"M(a\xa0b": "m8",  # even in a comment
    b"M16387S5\n": "m3",  # a byte and 16 bits wrap around
    b"M-16381S5\n": "m3", b"M8\n": "m8", b"\xa0": "m8", b"G1 X\xa0": "m8",
    b"(" + b"x" * 500 + b")M8\n": "m8", b" " * 500 + b"M8\n": "m8",  # blanks are not counted
    b"$N0=M8\n": "m8",  # a startup line is run when it is stored
    b"G4P0M8\n": "m8", b"N7 T2 M4 S9\n": "m3", b"M3\nS5\n": "m3", b"$30=0\nM3 S0\n": "m3",
    b"M8\r": "m8", b";x\nM8\n": "m8", b"M3 S5\nM5\nM8\n": "m8",
    b"M8\n\x84~": "m8",  # what a door put out comes back
}  # fmt: skip
DARK = [
    b"M3 S0\n", b"M3\n", b"M259 S5\n", b"M000000003 S5\n", b"M3 M5 S5\n", b"M3 S-5\n", b"M8",
    b";M8\n", b"(M8\n", b"M3S5M3\n", b"M8(\nM9\n", b"M7\n", b"M3 S5 Q1\n", b"M3 S5 S6\n", b"M8M9\n",
    b"x" * 79 + b"M8\n", b"\xa1", b"$C\nM8\nM3 S5\n", b"$C\n\xa0", b"M3.1 S5\n", b"G0 G1 M8\n",
    b"M8\n\x18", b"M3 S5\n\x18M\n", b"M8\n\x84", b"$32=1\nM3 S5\n", b"$32=1\nG1 F9 M4 S5\n",
    b"M8\nM2\n", b"M3 S9\nM30\n", b"$J=X1 F9 M8\n", b"$SLP\n\xa0",
]  # fmt: skip


@pytest.mark.parametrize("line", LIGHTS)
def test_what_lights_a_grbl(line: bytes) -> None:
    board = GrblFirmware({"100": 80})
    say(board, line, 2.0)
    assert board.lit == {LIGHTS[line]}


@pytest.mark.parametrize("line", DARK)
def test_what_leaves_a_grbl_dark(line: bytes) -> None:
    board = GrblFirmware({"100": 80})
    say(board, line, 2.0)
    assert not board.lit


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"%\n", 1), (b"FOO\n", 2), (b"X\n", 2), (b"$999=1\n", 3), (b"$100\n", 3),
        (b"$100=-1\n", 4), (b"G1 X1 F-1\n", 4), (b"$H\n", 5), (b"$0=2\n", 6), (b"$20=1\n", 10),
        (b"A" * 80 + b"\n", 11), (b"$J=X1 F9 M8\n", 16), (b"M7\n", 20), (b"G5\n", 20),
        (b"M99\n", 20), (b"G90 G91\n", 21), (b"M3 M4\n", 21), (b"G1 X1\n", 22), (b"G1.5 X1\n", 23),
        (b"M3.5\n", 23), (b"G0 G1\n", 24), (b"X1 X2\n", 25), (b"G92\n", 26), (b"N99999999\n", 27),
        (b"G4\n", 28), (b"G10 L20 P9 X0\n", 29), (b"G80 X1\n", 31), (b"G2 X1 F9\n", 35),
        (b"G1 F9 P1\n", 36), (b"T256\n", 38),
    ],
)  # fmt: skip
def test_grbls_numbered_refusals(line: bytes, code: int) -> None:
    assert say(GrblFirmware(), line) == b"error:%d\r\n" % code


@pytest.mark.parametrize("setting", ["100", "110", "120"])
def test_a_board_that_was_set_to_zero_ends_no_emulator(setting: str) -> None:
    board = GrblFirmware({"100": 80, setting: 0})
    assert say(board, b"G1 X1 F100\n", 60.0) == b"ok\r\n"
    assert say(board, b"?").startswith(b"<")


def test_startup_lines_are_run_at_every_start_also_after_a_reset() -> None:
    board = GrblFirmware()
    assert say(board, b"$N1=M8\n", b"$N\n").endswith(b"$N0=\r\n$N1=M8\r\nok\r\n")
    assert say(board, b"M9\n") == b"ok\r\n"
    assert not board.lit
    assert say(board, b"\x18") == GrblFirmware.banner + b">M8:ok\r\n"
    assert board.lit == {"m8"}
    board.power_on()
    assert say(board, 1.0) == b""
    assert board.lit == {"m8"}


def test_a_reset_in_motion_is_deaf_for_half_a_second_and_locks() -> None:
    board = GrblFirmware({"100": 80})
    say(board, b"G1 X90 F400\nG4 P0\n", 0.5)
    assert say(board, b"\x18", b"?\n\x18M5\n", 0.3) == b"ALARM:3\r\n"
    assert say(board, 0.5).startswith(b"ok\r\n" + GrblFirmware.banner)
    assert b"<Alarm|" in say(board, b"?")
    assert say(board, b"M3 S5\n", b"M5\n") == b"error:9\r\nerror:9\r\n"


def test_a_hold_slows_down_and_goes_on_to_the_target() -> None:
    board = GrblFirmware({"100": 80, "110": 6000, "120": 100})
    say(board, b"G1 X500 F6000\n", 1.2)
    assert b"<Hold:1|" in say(board, b"!", b"?")
    stands = 0.0
    while board.rate:
        stands = board.place
        say(board, 0.01)
    assert board.place - stands < 80
    assert b"<Hold:0|" in say(board, b"?")
    assert say(board, b"M5\n", 0.5) == b""  # lines wait
    assert say(board, b"~", 9.0) == b"ok\r\n"
    assert board.steps == 40000


def test_laser_mode_is_dark_while_held_and_between_moves_of_m4() -> None:
    board = GrblFirmware({"100": 80, "32": 1})
    say(board, b"G1 F300 M3 S9\n")
    assert board.lit == {"m3"}
    say(board, b"!")
    assert not board.lit
    say(board, b"~\x18", b"G1 F300 M4 S9 X2\n")
    assert board.lit == {"m3"}
    say(board, 3.0)
    assert not board.lit


def test_bytes_beyond_the_receive_buffer_are_lost() -> None:
    board = GrblFirmware({"100": 80})
    say(board, b"G1 X3 F100\nG4 P0\n")
    said = say(board, b"M8\n" + b"\n" * 200 + b"M9\n", 9.0)
    assert board.lit == {"m8"}  # the M9 did not get in
    assert said.count(b"ok") == 1 + 1 + 125


def test_a_jog_can_be_cancelled() -> None:
    board = GrblFirmware({"100": 80})
    assert say(board, b"$J=G91 X40 F400\n", b"?").count(b"<Jog|") == 1
    assert say(board, b"M5\n") == b"error:9\r\n"
    assert b"<Idle|" in say(board, b"\x85", 2.0, b"?")
    assert 0 < board.steps < 3200


def test_reports_in_inches_and_of_the_work_position() -> None:
    board = GrblFirmware({"100": 80, "13": 1, "10": 0, "110": 60000})
    said = say(board, b"G1 X25.4 F60000\n", 9.0, b"G92 X0\n", b"?")
    assert b"<Idle|WPos:0.0000,0.0000,0.0000|FS:0,0|WCO:1.0000,0.0000,0.0000>" in said


def test_a_limit_switch_leaves_the_board_deaf_to_all_but_a_reset() -> None:
    board = GrblFirmware({"22": 1})
    assert b"<Alarm|" in say(board, b"?")
    assert say(board, b"$X\n") == b"[MSG:Caution: Unlocked]\r\nok\r\n"
    board._alarm(1)
    assert board.take() == b"ALARM:1\r\n"
    assert say(board, b"?", b"$X\n", 1.0) == b"[MSG:Reset to continue]\r\n"
    assert say(board, b"\x18").endswith(b"to unlock]\r\n")


@pytest.mark.parametrize(
    ("line", "lit"),
    [
        (b"M71T1\r\n", "1"), (b"m 71 t2\r\n", "2"), (b"M327T257\r\n", "1"), (b"M?71T1\r\n", "1"),
        (b"M\x0171T1\n", "1"), (b"M(x)71T3\n", "3"), (b"G" + b"1" * 69 + b"M71T4\n", "4"),
        (b"M71\nM50T2\n", "2"),  # the sensor's line puts on what was last put on
        (b"$N0=M71T1\n", "1"), (b"M71T5\n", ""), (b"M70T1\n", ""), (b"M71T1M70T2\n", ""),
        (b"M71T1\n\x18", ""), (b"M71.5T1\n", ""), (b"(M71T1)\n", ""), (b"M71T1\nM2\n", ""),
    ],
)  # fmt: skip
def test_what_lights_a_horus(line: bytes, lit: str) -> None:
    board = HorusFirmware()
    say(board, line, 1.0)
    assert board.lit == ({lit} if lit else set())


def test_horus_own_words() -> None:
    board = HorusFirmware()
    assert say(board, b"G1X9\r\n") == b"error: Undefined feed rate\r\n"
    long = b"A" * 100 + b"\r\n"
    assert say(board, long) == b"error: Line overflow\r\nerror: Bad number format\r\n"
    assert say(board, b"G1F10X90\r\n", b"!", 1.0, b"?").startswith(b"<Queue,")
    assert say(board, b"~", 30.0) == b"ok\r\n"
    assert board.steps == 800
    assert say(board, b"M2\r\n") == b"ok\r\n" + HorusFirmware.banner
    assert say(board, b"$C\r\n", b"M71T1\r\n") == b"[Enabled]\r\nok\r\nok\r\n"
    assert not board.lit


def test_a_sardauscan_starts_anew_when_it_is_asked_for_a_fifth_laser() -> None:
    board = SardauscanFirmware()
    assert say(board, b"L 0 1\r", b"T A 40\r", 3.0).count(b"= 1") == 1
    assert say(board, b"L 4 1\r") == b"SETSardauscan V0.1a\r\n"
    assert not board.lit
    assert (board.place, board.steps) == (0, 40)
    assert say(board, b"L 0 2\r") == b"SET_LASER: 0(15) = 0\r\n"


def test_a_fabscan_takes_numbers_into_sixteen_bits() -> None:
    board = FabScanFirmware()
    say(board, b"M65557\n")
    assert board.lit == {"right"}
