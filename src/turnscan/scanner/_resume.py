"""Resuming a scan that was interrupted."""

from __future__ import annotations

from dataclasses import replace

from turnscan.acquire import (
    Acquisition,
    Hardware,
    Plan,
    Shifted,
    acquisition_from_json,
    acquisition_to_json,
    check_angle,
    check_room,
    counting_of,
    reindexed,
)
from turnscan.errors import InputError
from turnscan.scan import Scan


def acquisition_of(scan: Scan) -> Acquisition:
    """How a scan was being taken. Raises InputError for one that was imported."""
    if not scan.acquisition:
        raise InputError(
            f"{scan.path}: was not made by turnscan scan, so it cannot be resumed",
            hint="resume works for scans, not for imported pictures",
        )
    return acquisition_from_json(scan.acquisition, f"{scan.path}: acquisition")


def steps_left(plan: Plan, scan: Scan) -> int:
    """Steps that something is still to be taken at."""
    return sum(_wanted(plan, scan, step) for step in range(plan.steps))


def _wanted(plan: Plan, scan: Scan, step: int) -> bool:
    frames = (scan.has(name, step, k) for name in plan.sets for k in range(len(plan.exposures)))
    return not all(frames) or (plan.has_texture(step) and not scan.has_texture(step))


def forget_bad(scan: Scan) -> int:
    """Take away what is damaged or recorded as missing, so that it is taken again; how much."""
    gone = scan.damaged()
    for laser in scan.plan.lasers:
        gone += [(laser, step, 0) for step in scan.missing(laser) if scan.has(laser, step)]
    for laser, step, exposure in gone:
        scan.forget(laser, step, exposure)
    return len(gone)


def check_space(scan: Scan, plan: Plan, left: int) -> None:
    """Raise StorageFull where the steps that are left do not fit, as those that are there do."""
    if len(scan):
        check_room(scan.path, int(scan.path.stat().st_size * left / plan.steps))


def hardware_to_resume(
    plan: Plan, scan: Scan, hardware: Hardware, at: float | None = None
) -> Hardware:
    """The devices, their table counting as the scan does.

    ``at`` is the angle of the scan, rad, at which the table stands now, as a person says, which is
    kept in the scan; without it the table's own count has to be that of the scan. Raises AngleLost
    where it is not.
    """
    how = acquisition_of(scan)
    if at is None:
        check_angle(plan, scan, hardware.turntable, how.counting, how.at)
        if not how.at:
            return hardware
        return replace(hardware, turntable=Shifted(hardware.turntable, how.at))
    shifted = reindexed(hardware.turntable, at)
    counting = counting_of(hardware.turntable)
    scan.keep_acquisition(
        acquisition_to_json(replace(how, counting=counting, at=shifted.at if counting else 0.0))
    )
    return replace(hardware, turntable=shifted)
