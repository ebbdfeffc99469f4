"""MKV and WebM videos: how much of a file is missing at its end.

They hold no number of frames, but one element, the segment, has all that matters and tells how long
it is (RFC 8794 §4 to §6 and §11.2, EBML; RFC 9559 §5.1, the segment).
"""

from __future__ import annotations

from pathlib import Path

_SEGMENT = 0x18538067
_HEAD_BYTES = 4096
"""In which the segment begins: before it stands a header of some dozens of bytes."""


def bytes_missing(path: Path) -> int:
    """Bytes by which a file is shorter than its segment says; 0 where it says nothing, as a live
    stream, and for what is no such file."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    at = 0
    while at < len(head):
        name, at = _number(head, at, marked=True)
        size, at = _number(head, at, marked=False)
        if name == _SEGMENT:
            return 0 if size is None else max(at + size - path.stat().st_size, 0)
        if name is None or size is None:
            break
        at += size
    return 0


def _number(data: bytes, at: int, marked: bool) -> tuple[int | None, int]:
    """A number of variable length, and where it ends; its first set bit tells its length, and
    belongs to it where ``marked``. None where there is none, or all its bits are set: not known."""
    first = data[at] if at < len(data) else 0
    length = 9 - first.bit_length()
    end = at + length
    if first == 0 or end > len(data):
        return None, len(data)
    value = int.from_bytes(data[at:end], "big")
    if marked:
        return value, end
    value -= 1 << (7 * length)
    return (None if value == (1 << (7 * length)) - 1 else value), end
