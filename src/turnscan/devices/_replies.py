"""Lines of GRBL and its kin: any bytes are a sentence, or DeviceGarbled."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum

from turnscan.errors import (
    DeviceAlarm,
    DeviceGarbled,
    DeviceRefused,
    DeviceRestarted,
    InterlockOpen,
    TurnscanError,
)
from turnscan.remedy import Option, Remedy

LONGEST_LINE = 256


class Kind(Enum):
    """What a line is."""

    OK = "ok"
    ERROR = "error"
    ALARM = "alarm"
    BANNER = "banner"
    STATUS = "status"
    SETTING = "setting"
    MESSAGE = "message"
    NUMBER = "number"


@dataclass(frozen=True)
class Sentence:
    """One line of a board."""

    kind: Kind
    text: str
    fields: dict[str, str] = field(default_factory=dict)
    """Of a status: ``state``, ``MPos``, …; of a setting: its number and value."""

    @property
    def is_door(self) -> bool:
        """Whether it says that the door or the interlock is open."""
        return "Check Door" in self.text or self.fields.get("state") == "Door"

    def as_error(self, port: str) -> TurnscanError:
        """The error that this sentence is, where another was expected."""
        if self.is_door:
            return door_open(port)
        if self.kind is Kind.ALARM:
            return DeviceAlarm(f"{port}: {self.text}", hint=look_and_acknowledge(port))
        if self.kind is Kind.BANNER:
            return DeviceRestarted(
                f"{port}: the controller restarted ({self.text})",
                hint=lost_place(port),
            )
        if self.text in LOCKED:
            return locked(port, self.text)
        if self.kind is Kind.ERROR:
            return DeviceRefused(f"{port}: the controller answered {self.text!r}")
        return DeviceGarbled(f"{port}: said {self.text!r}, which is no reply to a request")


LOCKED = ("error:9", "error: Alarm lock")
"""What a board answers to everything while it waits in an alarm."""


def locked(port: str, said: str) -> DeviceAlarm:
    """The error that such an answer is; the alarm itself may have been missed."""
    return DeviceAlarm(
        f"{port}: the controller is in an alarm state ({said})", hint=look_and_acknowledge(port)
    )


def look_and_acknowledge(port: str) -> Remedy:
    """What a person does about an alarm."""
    return Remedy("inspect the machine, then ", *_acknowledge(port))


def _acknowledge(port: str) -> tuple[str, Option]:
    """The command that ends an alarm; a program that has the port open is in its way."""
    words = f"disconnect whatever uses its port, in a browser too, and run turnscan devices {port} "
    return words, Option("acknowledge")


def lost_place(port: str) -> Remedy:
    """What a person does about a table whose angle is unknown."""
    return Remedy(
        "its position is lost: ",
        *_acknowledge(port),
        ", then start a new scan, or turn the table to a mark and resume with ",
        Option("at_deg"),
    )


def door_open(port: str) -> InterlockOpen:
    """What a door that opens means: it never goes on by itself."""
    return InterlockOpen(
        f"{port}: the door or the interlock is open",
        hint=Remedy("close it, ", *look_and_acknowledge(port).parts),
    )


_BANNER = re.compile(r"(?:Grbl|Horus) \d+\.\d+\w* \['\$' for help\]|Sardauscan V\d+\.\d+\w{0,8}")
_SETTING = re.compile(r"(\$\d{1,3})=(-?\d{1,9}(?:\.\d{1,9})?)(?: \(.*\))?")
_NUMBER = re.compile(r"-?\d{1,9}")
_STATUS = re.compile(r"<([A-Z][A-Za-z]{2,8})(?::\d)?((?:[|,][^<>]*)?)>")
_OLD = re.compile(r"([A-Z][A-Za-z]*):((?:-?\d{1,7}\.\d{1,4},?){1,6})")


def sentence(line: bytes) -> Sentence:
    """The sentence a line is. Raises DeviceGarbled, and nothing else, for any other bytes."""
    if len(line) > LONGEST_LINE or any(b < 32 or b > 126 for b in line.strip(b"\r\n")):
        raise DeviceGarbled(f"unrecognised controller line: {line[:40]!r}")
    text = line.decode("ascii").strip()
    if text == "ok":
        return Sentence(Kind.OK, text)
    if re.fullmatch(r"error: ?\S.{0,80}", text):
        return Sentence(Kind.ERROR, text)
    if re.fullmatch(r"ALARM: ?\S.{0,80}", text):
        return Sentence(Kind.ALARM, text)
    if _BANNER.fullmatch(text):
        return Sentence(Kind.BANNER, text)
    if found := _SETTING.fullmatch(text):
        return Sentence(Kind.SETTING, text, {found[1]: found[2]})
    if re.fullmatch(r"\[[^\[\]]*\]|\['\$H'\|'\$X' to unlock\]", text):
        return Sentence(Kind.MESSAGE, text)
    if _NUMBER.fullmatch(text):
        return Sentence(Kind.NUMBER, text)
    if (found := _STATUS.fullmatch(text)) and (fields := _fields(found[2])) is not None:
        return Sentence(Kind.STATUS, text, {"state": found[1], **fields})
    raise DeviceGarbled(f"unrecognised controller reply: {text[:60]!r}")


def _fields(text: str) -> dict[str, str] | None:
    """``|MPos:1.000,0.000,0.000|FS:0,0`` (1.1) or ``,MPos:1.000,…,WPos:…`` (0.9) by key."""
    if text.startswith("|"):
        pairs = [part.partition(":") for part in text[1:].split("|")]
        if any(not key.isalpha() or not colon for key, colon, _ in pairs):
            return None
        fields = {key: value for key, _, value in pairs}
    else:
        fields = {key: value.rstrip(",") for key, value in _OLD.findall(text)}
    position = fields.get("MPos", fields.get("WPos", "0.0"))
    return fields if re.match(r"-?\d{1,7}\.\d{1,4}(?:,|$)", position) else None
