"""Does a rig belong to a scan?"""

from __future__ import annotations

from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan._file import Scan


def lit_in(name: str, rig: Rig) -> tuple[str, ...]:
    """The lasers that are lit in the frames of this name: itself, or those it joins with +."""
    return (name,) if any(s.name == name for s in rig.sheets) else tuple(name.split("+"))


def rig_for(scan: Scan, rig: Rig | None = None) -> Rig:
    """The rig given, or else the one in the scan file.

    Raises InputError where there is none, or where it has not the scan's lasers or picture size.
    """
    used = rig or scan.rig
    if used is None:
        raise InputError(f"{scan.path}: no rig in it", hint=Remedy("give one with ", Option("rig")))
    missing = {n for name in scan.plan.lasers for n in lit_in(name, used)} - {
        s.name for s in used.sheets
    }
    if missing:
        raise InputError(
            f"{scan.path}: the rig has no laser {', '.join(sorted(missing))}; it has "
            + (", ".join(s.name for s in used.sheets) or "none"),
            hint="import with the laser's name as it is in the rig",
        )
    have = (used.camera.width, used.camera.height)
    want = (scan.plan.width, scan.plan.height)
    if have != want:
        raise InputError(
            f"{scan.path}: pictures of {want[0]} × {want[1]}, but the rig's camera gives "
            f"{have[0]} × {have[1]}",
            hint="give the rig that belongs to this camera",
        )
    return used
