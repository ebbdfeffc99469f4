"""The emulated boards answer the lines that were recorded from the real firmwares as those did."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from turnscan.simulate.controllers import (
    FabScanFirmware,
    Firmware,
    GrblFirmware,
    HorusFirmware,
    SardauscanFirmware,
    SardauscanHorusFirmware,
)

ROWS = {"fabscanpi-20200624": 20, "grbl-1.1h": 54, "horus-0.2": 27, "sardauscan-as-horus": 16}


def _board(name: str) -> Firmware:
    if name.startswith("fabscan"):
        return FabScanFirmware()
    if name.startswith("grbl"):
        return GrblFirmware(blank_eeprom=True)
    return HorusFirmware(blank_eeprom=True) if name == "horus-0.2" else SardauscanHorusFirmware()


def _listen(board: Firmware, seconds: float, want: int) -> tuple[bytes, float]:
    """What comes within so many board seconds, or until as much came as was recorded."""
    said, begin = b"", board.now
    while board.now < begin + seconds and (len(said) < want or want == 0):
        board.run(board.now + 0.001)
        said += board.take()
    return said, board.now - begin


def _window(sent: str) -> float:
    """The recorder's silence: long after hold and resume, short while a move was to go on."""
    return {"!": 2.4, "~": 2.5, "G1X180\r\n": 0.1}.get(sent, 0.42)


PLACE = re.compile(r"MPos:(-?\d+\.\d+)")


def _same(expected: str, got: str) -> bool:
    """Equal but for where exactly a table that was turning stood."""
    a, b = PLACE.findall(expected), PLACE.findall(got)
    for x, y in zip(a, b, strict=False):
        if abs(float(x) - float(y)) > max(0.02, 0.35 * abs(float(x))):
            return False
    bare = [re.sub(r"(MPos|WPos):-?\d+\.\d+|FS:\d+", r"\1", t) for t in (expected, got)]
    return bare[0] == bare[1]


@pytest.mark.parametrize("name", ROWS)
def test_every_row_as_the_real_board(name: str, shared_data: Path) -> None:
    rows = (shared_data / "board-transcripts" / f"{name}.jsonl").read_text().splitlines()
    board, wrong = _board(name), []
    for line in rows[1:]:
        row = json.loads(line)
        expected, sent = row["received"].replace("|Pn:X", ""), row.get("sent", "")
        board.feed(sent.encode("latin-1"))
        limit = 20.0 if expected else _window(sent)
        got, took = _listen(board, limit, len(expected))
        if not expected:
            took = 0.0
        more, _ = _listen(board, 0.35 if sent == "?" else 0.1, 0)  # the recorder's silence
        text = (got + more).decode("latin-1")
        late = (row["last_ms"] or 0) / 1000
        if not _same(expected, text) or not late * 0.5 - 0.15 <= took <= late * 1.5 + 0.15:
            wrong.append((sent, expected, text, late, took))
    assert len(rows) == ROWS[name]
    assert not wrong, "\n".join(map(repr, wrong))


SECOND = {
    "fabscanpi-20200624-2": 33, "grbl-1.1h-2": 81, "horus-0.2-2": 63, "sardauscan-0.1a": 39,
    "sardauscan-as-horus-2": 28,
}  # fmt: skip
"""Conversations without times, one after another from a reset on."""


def _second_board(name: str) -> Firmware:
    if name.startswith("grbl"):
        return GrblFirmware({"100": 80, "110": 6000, "120": 800})
    if name == "sardauscan-0.1a":
        return SardauscanFirmware()
    board = _board(name.removesuffix("-2"))
    if isinstance(board, HorusFirmware):
        board.feed(b"$120=200\r\n")
    return board


@pytest.mark.parametrize("name", SECOND)
def test_every_row_of_the_second_series(name: str, shared_data: Path) -> None:
    path = shared_data / "board-transcripts" / f"{name}.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows = [row for row in rows if "sent" in row]
    board, expected, got = _second_board(name), "", ""
    board.run(0.1)
    board.take()
    for row in rows:
        board.feed(row["sent"].encode("latin-1"))
        want, end = row["received"], board.now + (4.0 if row["received"] else 0.5)
        said = ""
        while board.now < end and not _whole(said, want):
            board.run(board.now + 0.001)
            said += board.take().decode("latin-1")
        said += _listen(board, 0.2, 0)[0].decode("latin-1")
        got, expected = got + said, expected + want
    assert len(rows) == SECOND[name]
    lines = list(zip(expected.split("\r\n"), got.split("\r\n"), strict=False))
    wrong = [pair for pair in lines if not _same_but_for_the_place(*pair)]
    assert not wrong, "\n".join(map(repr, wrong[:5]))
    assert expected.count("\r\n") == got.count("\r\n")


def _whole(said: str, want: str) -> bool:
    """Whether as much came; a place may be told with more or fewer digits."""
    return bool(want) and said.count("\n") >= want.count("\n") and len(said) > 0.9 * len(want)


def _same_but_for_the_place(expected: str, got: str) -> bool:
    bare = [re.sub(r"(MPos|WPos|WCO):-?\d+\.\d+|FS:\d+", r"\1", t) for t in (expected, got)]
    return bare[0] == bare[1]


def test_a_row_told_wrong_is_seen() -> None:
    assert not _same("ok\r\n", "ok\r\nok\r\n")
    assert not _same("<Idle|MPos:90.000,0|FS:0,0>", "<Idle|MPos:20.000,0|FS:0,0>")


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        ("sardauscan", "yes"), ("T", "Position 0"), ("T S", "REVOLUTION STEPS  => 1018"),
        ("T A 100", "ABSOLUTE ROTATION 100 => 100"), ("t r -40", "RELATIVE ROTATION :-40 => 60"),
        ("T C", "RESET CUTTENT POSITION  => 0"), ("T x", "Unknown Table command :X"),
        ("L", "LASER_COUNT: 4"), ("L 1 1", "SET_LASER: 1(16) = 1"),
        ("L 1", "LASER_STATE: 1(16) = 1"),
        ("L 9 1", "SET_LASER: 9(-1) = -1"), ("foo", "Hun?"),
    ],
)  # fmt: skip
def test_sardauscans_own_words(sent: str, said: str) -> None:
    board = SardauscanFirmware()
    lead = ["T A 100"] if sent == "t r -40" else ["L 1 1"] if sent == "L 1" else []
    for text in [*lead, sent]:
        board.take()
        board.feed(f"{text}\r\n".encode())
        board.run(board.now + 10.0)
    assert board.take().decode() == said + "\r\n"


def test_a_full_turn_of_a_sardauscan_takes_eleven_seconds() -> None:
    board = SardauscanFirmware()
    board.feed(b"T A 1018\r")
    _, took = _listen(board, 20.0, len(board.banner) + len("ABSOLUTE ROTATION 1018 => 1018\r\n"))
    assert 10.0 < took < 12.0


def test_horus_puts_its_lasers_out_after_255_s_in_silence() -> None:
    board = HorusFirmware()
    board.feed(b"M71T1\r\n")
    board.run(250.0)
    assert board.lit == {"1"}
    board.take()
    board.run(256.0)
    assert not board.lit
    assert board.take() == b""
