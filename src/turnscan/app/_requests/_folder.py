"""Requests about the scan files in the folder, and its bin."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol import Name, Opaque
from turnscan.app._requests._base import Request


class Open(Request):
    """Open a scan: answered by ``opened``, or by ``started`` and, later, ``opened``."""

    kind: Literal["open"] = "open"
    scan: Opaque


class Rename(Request):
    """Give a scan file another name; a document of it is closed."""

    kind: Literal["rename"] = "rename"
    scan: Opaque
    name: Name


class Duplicate(Request):
    """Copy a scan file with its edits, under a new name."""

    kind: Literal["duplicate"] = "duplicate"
    scan: Opaque
    name: Name


class ToBin(Request):
    """Put a scan file into the bin of its folder; a document of it is closed."""

    kind: Literal["to_bin"] = "to_bin"
    scan: Opaque


class Restore(Request):
    """Take a scan file out of the bin, under its name or, where that is taken, a numbered one."""

    kind: Literal["restore"] = "restore"
    binned: Opaque


class EmptyBin(Request):
    """Delete for good what is in the bin."""

    kind: Literal["empty_bin"] = "empty_bin"


class ShowFolder(Request):
    """Open the folder of the scans in the file manager of the server's computer."""

    kind: Literal["show_folder"] = "show_folder"


class TryDemo(Request):
    """Scan a part with a simulated rig, as a job whose result is the scan."""

    kind: Literal["try_demo"] = "try_demo"
