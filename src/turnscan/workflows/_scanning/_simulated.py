"""One simulated turn into a scan file or a folder, for the workflows that simulate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from turnscan.acquire import Event, FirstLook, Hardware, Plan, StepDone, look, run, turn_of
from turnscan.arrays import Image
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.rig import rig_to_json
from turnscan.scan import Frame, Keep, ScanPlan, Setting, replacing_scan
from turnscan.scanner import laser_colour
from turnscan.simulate import Simulated
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._pages._png import write_png


def plan_of(devices: Simulated, seconds: float | None = None) -> Plan:
    """One whole turn with every laser. Raises InputError for an exposure that is not above 0."""
    exposure = devices.seconds if seconds is None else seconds
    turn = turn_of(devices.steps, devices.lasers.names, exposure)
    return replace(turn, blind_steps=0)  # what is simulated on purpose is no danger


def scan_into_file(
    devices: Simulated, plan: Plan, path: Path, keep: Keep, progress: Progress = no_progress
) -> None:
    """Write a scan file with the true rig in it; it appears only when it is whole.

    Raises Cancelled by ``progress``.
    """
    heard = _steps_of(plan, progress)
    hardware, first = _first_look(devices, plan, keep)
    with replacing_scan(path, first.scan_plan, devices.world.bench.rig) as scan:
        run(plan, hardware, scan, first=first, listener=heard, clock=lambda: math.nan)


def scan_into_folder(
    devices: Simulated, plan: Plan, folder: Path, progress: Progress = no_progress
) -> None:
    """Write pictures: a folder per laser and one for dark, angles.csv, rig.json.

    Raises Cancelled by ``progress``; the pictures so far stay.
    """
    hardware, first = _first_look(devices, plan, "full")
    for name in ("dark", *plan.lasers):
        (folder / name).mkdir(parents=True, exist_ok=True)
    sink = _Folder(folder, first.scan_plan)
    run(plan, hardware, sink, first=first, listener=_steps_of(plan, progress))
    rows = [f"{step},{math.degrees(plan.angle(step)):.9f}" for step in range(plan.steps)]
    text = "\n".join(["number,angle_deg", *rows, ""])
    write_atomically(folder / "angles.csv", text.encode())
    write_atomically(folder / "rig.json", rig_to_json(devices.world.bench.rig).encode())


def truth(devices: Simulated) -> Mesh:
    """The true surface of the part, in the object's frame."""
    body = devices.world.bench.scene.bodies[0]
    mesh = body.part.mesh
    return Mesh(body.T_table_part.apply(mesh.vertices), mesh.faces)


def hardware_of(devices: Simulated) -> Hardware:
    """A simulated rig as the hardware of a scan."""
    return Hardware(devices.camera, devices.turntable, devices.lasers)


def _first_look(devices: Simulated, plan: Plan, keep: Keep) -> tuple[Hardware, FirstLook]:
    hardware = hardware_of(devices)
    source = f"simulated {devices.spec.scene}, rig {devices.spec.rig}"
    return hardware, look(plan, hardware, keep=keep, source=source, weigh=laser_colour)


def _steps_of(plan: Plan, progress: Progress) -> Callable[[Event], None]:
    count = progress.counter(plan.steps)

    def listen(event: Event) -> None:
        if isinstance(event, StepDone):
            count()

    return listen


@dataclass
class _Folder:
    """A `turnscan.acquire.Sink` that writes PNG files."""

    folder: Path
    plan: ScanPlan
    _dark: set[int] = field(default_factory=set)

    def has(self, laser: str, step: int, exposure: int = 0) -> bool:
        """A new folder has nothing."""
        return False

    def has_texture(self, step: int) -> bool:
        """A new folder has nothing."""
        return False

    def add(self, frame: Frame) -> None:
        """Write the lit picture, and the dark one of a new step."""
        write_png(self.folder / frame.laser / f"step_{frame.step:04d}.png", frame.lit)
        if frame.dark is not None and frame.step not in self._dark:
            self._dark.add(frame.step)
            write_png(self.folder / "dark" / f"step_{frame.step:04d}.png", frame.dark)

    def add_missing(
        self, step: int, laser: str, cause: str, commanded: float, exposure: int = 0
    ) -> None:
        """Write nothing: a picture that is not there is missing."""

    def add_texture(
        self,
        step: int,
        picture: Image,
        commanded: float,
        time: float,
        settings: Mapping[str, Setting],
    ) -> None:
        """Write the picture."""
        (self.folder / "texture").mkdir(exist_ok=True)
        write_png(self.folder / "texture" / f"step_{step:04d}.png", picture)
