"""Bytes of a link into lines, with a deadline and a measure."""

from __future__ import annotations

import time
from typing import Protocol

from turnscan.devices._replies import (
    LOCKED,
    Kind,
    door_open,
    locked,
    look_and_acknowledge,
    lost_place,
    sentence,
)
from turnscan.errors import (
    DeviceAlarm,
    DeviceGarbled,
    DeviceRefused,
    DeviceRestarted,
    DeviceTimeout,
    TurnscanError,
)

_REST = 0.3
"""s to wait for the end of an unrequested line, so that it can be understood."""


class Readable(Protocol):
    """Where bytes come from: the link to the guard."""

    def read(self, timeout: float) -> bytes:
        """What has come; waits up to ``timeout`` s for a first byte, b"" where none came."""
        ...


class Lines:
    """Bytes of a link into lines; never more than ``longest`` bytes of one."""

    def __init__(self, link: Readable, port: str, longest: int = 256) -> None:
        self._link, self._port, self._longest = link, port, longest
        self._bytes = bytearray()

    def clear(self) -> None:
        """Forget what came."""
        self._bytes.clear()
        while self._link.read(0.0):
            pass

    def expect_nothing(self) -> None:
        """Raises what it means that an unrequested line came; else DeviceGarbled."""
        while data := self._link.read(0.0):
            self._bytes += data[: self._longest]
        end = time.monotonic() + _REST
        while self._bytes and not self._bytes.endswith(b"\n") and time.monotonic() < end:
            self._bytes += self._link.read(end - time.monotonic())[: self._longest]
        left = bytes(self._bytes).strip()
        self._bytes.clear()
        if left:
            raise unasked(self._port, left)

    def next(self, end: float, what: str) -> bytes:
        """The next line that is not empty, without its end.

        Raises DeviceTimeout at the time ``end``, DeviceGarbled for noise or a line beyond measure.
        """
        while True:
            cut = self._bytes.find(b"\n")
            if cut >= 0:
                line = bytes(self._bytes[:cut]).strip(b"\r\n")
                del self._bytes[: cut + 1]
                if line:
                    return line
                continue
            if len(self._bytes) > self._longest:
                self._bytes.clear()
                raise DeviceGarbled(f"{self._port}: an endless line in answer to {what}")
            left = end - time.monotonic()
            data = self._link.read(max(left, 0.0))
            if not data and left <= 0:
                if any(byte > 126 for byte in self._bytes):
                    raise DeviceGarbled(f"{self._port}: noise in answer to {what}")
                rest = f"; it said {shown(bytes(self._bytes))}" if self._bytes else ""
                raise DeviceTimeout(f"{self._port}: no answer to {what} in time{rest}")
            self._bytes += data

    def echo(self, expected: bytes, end: float, what: str) -> None:
        """Take exactly these bytes, which no line end follows.

        Raises DeviceTimeout at the time ``end``, DeviceGarbled where others come.
        """
        while len(self._bytes) < len(expected):
            left = end - time.monotonic()
            data = self._link.read(max(left, 0.0))
            if not data and left <= 0:
                raise DeviceTimeout(f"{self._port}: no answer to {what} in time")
            self._bytes += data[: self._longest]
        heard = bytes(self._bytes[: len(expected)])
        del self._bytes[: len(expected)]
        if heard != expected:
            raise DeviceGarbled(f"{self._port}: echoed {shown(heard)} for {what}")

    def poll(self, wait: float, end: float, what: str) -> bytes | None:
        """As `next`, but None where nothing came within ``wait`` s and it is not yet ``end``."""
        try:
            return self.next(min(time.monotonic() + wait, end), what)
        except DeviceTimeout:
            if time.monotonic() >= end:
                raise
            return None


def unasked(port: str, data: bytes) -> TurnscanError:
    """What an unrequested line means."""
    for line in data.splitlines():
        try:
            if not line.strip():
                continue
            said = sentence(line)
            if said.is_door or said.kind in (Kind.ALARM, Kind.BANNER):
                return said.as_error(port)
        except DeviceGarbled:
            continue
    return DeviceGarbled(f"{port}: said {shown(data)} without being asked")


def objection(port: str, heard: bytes) -> TurnscanError:
    """The error that a board's words amount to."""
    if not heard.strip():
        return DeviceTimeout(f"{port}: no answer to a laser command")
    if b"Door" in heard:
        return door_open(port)
    if b"ALARM" in heard:
        return DeviceAlarm(f"{port}: {shown(heard)}", hint=look_and_acknowledge(port))
    if b"Grbl " in heard or b"Horus " in heard or b"Sardauscan V" in heard:
        return DeviceRestarted(
            f"{port}: the controller restarted ({shown(heard)})",
            hint=lost_place(port),
        )
    for said in LOCKED:
        if said.encode() in heard.splitlines():
            return locked(port, said)
    if b"error" in heard:
        return DeviceRefused(f"{port}: the controller refused to switch a laser: {shown(heard)}")
    return DeviceGarbled(f"{port}: answered a laser command with {shown(heard)}")


def shown(data: bytes) -> str:
    """The end of what was heard, printable, at most 60 characters."""
    text = " ".join(data.decode("latin-1").split())
    return repr(text[-60:])
