"""What it means that a serial port does not open, or goes away."""

from __future__ import annotations

import errno
import os
import stat

from turnscan.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceRefused


def port_error(port: str, word: str, text: str) -> DeviceError:
    """The error that ``busy``, ``absent`` or ``gone`` amounts to; ``text`` is the system's."""
    if word == "busy":
        return DeviceRefused(f"{port}: in use by another program", hint="close that program")
    if word == "absent" and ("[Errno 13]" in text or "Permission denied" in text):
        return DeviceRefused(f"{port}: no permission to open it", hint=who_may_open(port))
    if word == "absent":
        # pyserial says it twice, with the name of the port: the end says why.
        why = "no such port" if "[Errno 2]" in text else text
        return DeviceNotFound(
            f"{port}: cannot be opened: {why}", hint="check the cable and the port's name"
        )
    return DeviceDisconnected(f"{port}: disconnected: {text}", hint="plug it in again, then resume")


def word_for(error: Exception) -> str:
    """``busy`` or ``absent``, for a port that did not open."""
    return "busy" if getattr(error, "errno", 0) in (errno.EAGAIN, errno.EBUSY) else "absent"


def who_may_open(port: str) -> str:
    """What a person does who may not open a port: the group that may, where there is one."""
    nobody = "ask the administrator of this computer for permission to read and write it"
    try:
        node = os.stat(port)
    except OSError:
        return nobody
    if not node.st_mode & stat.S_IRGRP or not node.st_mode & stat.S_IWGRP:
        return nobody
    group = _group(node.st_gid)
    return f"join the group {group} (sudo usermod -aG {group} $USER), then log out and in again"


def _group(number: int) -> str:
    try:
        import grp

        return grp.getgrgid(number).gr_name
    except (ImportError, KeyError):
        return str(number)
