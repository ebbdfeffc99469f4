"""Scan and resume: a plan, devices, a scan file."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from turnscan.acquire import Control as ScanControl
from turnscan.acquire import (
    Event,
    FirstLook,
    Hardware,
    Listener,
    Missing,
    Plan,
    StepDone,
    run,
)
from turnscan.devices import Steady
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.scanner import (
    Addresses,
    Opened,
    acquisition_of,
    check_space,
    forget_bad,
    hardware_to_resume,
    opened,
    prepare,
    steps_left,
)
from turnscan.workflows._files._reading import read_rig_file
from turnscan.workflows._files._writing import check_output
from turnscan.workflows._options._device import DeviceOptions
from turnscan.workflows._options._scan import ScanOptions


@dataclass(frozen=True)
class PlannedScan:
    """What is known before the first step is taken."""

    path: Path
    plan: Plan
    left: int
    """Steps to take."""
    scan: Scan
    """The file, open; what is taken goes into it."""
    rig: Rig | None
    threshold_reason: str = ""
    """How the threshold was chosen."""
    exposure_reason: str = ""
    """How the exposure was chosen, where it was found."""
    simulated: str = ""
    """Address of the simulated rig that takes it; empty for real devices."""
    size_bytes: int = 0
    """Of the file, about."""
    retaken: int = 0
    """Damaged or missing frames that will be taken again."""


@dataclass(frozen=True)
class TakenScan:
    """A scan file, and what the run added to it."""

    path: Path
    steps: int
    """Of the plan."""
    left: int
    """Steps that were to be taken; 0 where the file was complete already."""
    frames: int
    missing: int
    """Frames recorded as missing."""
    complete: bool
    """False where somebody aborted it."""
    camera: str = ""
    """What the camera made to be taken again; empty for nothing."""
    simulated: str = ""
    """Address of the simulated rig that took it; empty for real devices."""


@dataclass(frozen=True)
class ScanLeft:
    """How far an interrupted scan is."""

    done: int
    """Steps that are stored."""
    steps: int
    """Of the plan."""


def _ignore(planned: PlannedScan) -> None:
    """Show nothing."""


def _silent(text: str) -> None:
    """Say nothing."""


def _hear_nothing(event: Event) -> None:
    """Hear nothing."""


def scan(
    path: str | Path,
    options: ScanOptions | None = None,
    *,
    devices: DeviceOptions | Opened | None = None,
    rig: Rig | str | Path | None = None,
    planned: Callable[[PlannedScan], None] = _ignore,
    missing: Callable[[str], None] = _silent,
    listener: Listener = _hear_nothing,
    control: ScanControl | None = None,
    progress: Progress = no_progress,
) -> TakenScan:
    """Take a scan with what is connected, or with a simulated rig.

    Parameters
    ----------
    path
        The scan file (.turnscan) to write; it must not exist.
    options
        How it is taken; None leaves all to the devices.
    devices
        Their addresses, or devices that are open; None takes a simulated rig.
    rig
        The rig to store with it, or its file; None takes that of a simulated rig.
    planned
        Called once before the first step, with the file open.
    missing
        Told each frame that is recorded as missing, in words.
    listener
        Told each event of the run (`turnscan.acquire`), from its thread.
    control
        Pauses and ends the run from another thread.
    progress
        Told how far it is; where it cancels, what was taken stays, and can be resumed.

    Returns
    -------
    TakenScan
        What was taken.

    Raises
    ------
    InputError
        Where the file exists, and where options, devices and rig do not go together.
    DeviceError, SafetyError
        As the devices do; the lasers are dark then, and what was taken is kept.
    ScanError
        Where the file cannot be written.
    """
    path = Path(path)
    check_output(path, (".turnscan",))
    if path.exists():
        hint = "choose another name, or turnscan resume it"
        raise InputError(f"{path}: already exists", hint=hint)
    wanted = (options or ScanOptions()).request()
    name = str(rig) if isinstance(rig, str | Path) else "the rig"
    held = read_rig_file(Path(rig)) if isinstance(rig, str | Path) else rig
    with opened_devices(devices) as bench:
        ready = prepare(bench, wanted, held, name)
        how = ready.first.threshold_reason
        if wanted.threshold is not None:
            how = f"threshold {wanted.threshold:g}"
        with ready.create(path) as file:
            plan = ready.plan
            left, why = steps_left(plan, file), ready.exposure_reason
            at = bench.at.camera if bench.at.camera.startswith("sim:") else ""
            planned(PlannedScan(path, plan, left, file, ready.rig, how, why, at, ready.size))
            hear = _Hearing(listener, missing, progress)
            return _take(plan, bench.hardware, file, hear, ready.first, control)


def resume(
    path: str | Path,
    *,
    devices: DeviceOptions | Opened | None = None,
    at_deg: float | None = None,
    retake: bool = False,
    planned: Callable[[PlannedScan], None] = _ignore,
    missing: Callable[[str], None] = _silent,
    listener: Listener = _hear_nothing,
    control: ScanControl | None = None,
    progress: Progress = no_progress,
) -> TakenScan:
    """Take what an interrupted scan is missing, with the same plan.

    Parameters
    ----------
    path
        The scan file.
    devices
        Addresses that have changed since, or devices that are open; None takes those of the scan.
    at_deg
        Current table angle in the scan, degrees, set by the operator; None trusts the table.
    retake
        Also frames that are damaged or recorded as missing.
    planned, missing, listener, control, progress
        As in `scan`.

    Returns
    -------
    TakenScan
        What was taken; ``left`` is 0 where the file was complete already.

    Raises
    ------
    InputError
        Where the file was not made by a scan.
    AngleLost
        Where the controller of the table has restarted, and no angle is given.
    DeviceError, SafetyError, ScanError
        As in `scan`.
    """
    with Scan.resume(path) as file:
        how = acquisition_of(file)
        again = forget_bad(file) if retake else 0
        left = steps_left(how.plan, file)
        if not left:
            return TakenScan(
                file.path, how.plan.steps, 0, 0, 0, True, simulated=file.plan.simulated
            )
        check_space(file, how.plan, left)
        known = Addresses(how.camera, how.turntable, how.lasers)
        with opened_devices(devices, known) as bench:
            at = None if at_deg is None else math.radians(at_deg)
            hardware = hardware_to_resume(how.plan, file, bench.hardware, at)
            planned(PlannedScan(file.path, how.plan, left, file, file.rig, retaken=again))
            return _take(
                how.plan, hardware, file, _Hearing(listener, missing, progress), None, control
            )


def scan_left(path: str | Path) -> ScanLeft:
    """How far an interrupted scan is. Raises InputError for one that cannot be resumed."""
    with Scan.open(path) as file:
        return left_in(file)


def left_in(file: Scan) -> ScanLeft:
    """The same of a scan that is open. Raises as `scan_left`."""
    plan = acquisition_of(file).plan
    return ScanLeft(plan.steps - steps_left(plan, file), plan.steps)


@dataclass(frozen=True)
class _Hearing:
    """Who receives reports."""

    listener: Listener
    missing: Callable[[str], None]
    progress: Progress

    def __call__(self, event: Event) -> None:
        self.listener(event)
        if isinstance(event, Missing):
            self.missing(f"step {event.step} of laser {event.laser}: missing: {event.cause}")
        if isinstance(event, StepDone):
            text = f"{event.done} of {event.total} steps"
            self.progress(event.done / event.total, text)


def opened_devices(
    devices: DeviceOptions | Opened | None, known: Addresses | None = None
) -> AbstractContextManager[Opened]:
    """The devices for a block of work; those that are open already stay so after it."""
    if isinstance(devices, Opened):
        return nullcontext(devices)
    return opened((devices or DeviceOptions()).addresses(known))


def _take(
    plan: Plan,
    hardware: Hardware,
    file: Scan,
    hear: _Hearing,
    first: FirstLook | None,
    control: ScanControl | None,
) -> TakenScan:
    left = steps_left(plan, file)
    outcome = run(plan, hardware, file, first=first, listener=hear, control=control)
    camera = hardware.camera.retaken if isinstance(hardware.camera, Steady) else ""
    return TakenScan(
        file.path, plan.steps, left, outcome.frames, outcome.missing, outcome.complete, camera,
        file.plan.simulated,
    )  # fmt: skip
