"""Simulate: pictures or a scan file of a part, made by a simulated rig."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from turnscan.acquire import Exposure, Texture
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.simulate import simulated, spec_of
from turnscan.workflows._files._history import refuse_over_repairs
from turnscan.workflows._files._writing import check_output
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._scan import check_texture
from turnscan.workflows._options._simulate import SimulateOptions
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file, scan_into_folder


@dataclass(frozen=True)
class SimulatedScan:
    """A scan file or a folder of pictures that a simulated rig took."""

    path: Path
    scene: str
    rig: str
    """Name of the design preset."""
    steps: int
    lasers: tuple[str, ...]
    exposure: float
    """s."""

    def __fspath__(self) -> str:
        """Its path: it stands for its file wherever a file is wanted."""
        return fspath(self.path)


def simulate(
    scene: str,
    output: str | PathLike[str],
    options: SimulateOptions | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> SimulatedScan:
    """Scan a part with a simulated rig. The same arguments always give the same pictures.

    Parameters
    ----------
    scene
        A part (cup, head, bust, sphere, shaft, …), a board (charuco, chessboard), a mesh file, or
        an address like ``sim:cup?galvo=105&backlash_deg=0.2`` with everything the simulator knows.
    output
        A scan file (``….turnscan``), which holds the true rig; or a new or empty folder for
        pictures, angles.csv and rig.json.
    options
        How it is scanned; None: as the scene's address says.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``steps=50``.

    Returns
    -------
    SimulatedScan
        What was taken; it stands for the file or folder wherever one is wanted.

    Raises
    ------
    InputError
        What cannot be simulated, before anything is written; a folder that holds something.
    ScanError, ExportError
        The output cannot be written.
    Cancelled
        By ``progress``. No scan file is written then; a folder keeps the pictures so far.

    >>> import turnscan as ts
    >>> few = ts.SimulateOptions(rig="ciclop", lasers=1, no_speckle=True)
    >>> done = ts.simulate("sphere", "sphere.turnscan", few, steps=1)
    >>> done.steps, done.lasers
    (1, ('right',))
    """
    output, wanted = Path(output), chosen(SimulateOptions, options, changes)
    check_texture(wanted.texture, wanted.texture_every)
    into_file = output.suffix == ".turnscan"
    if into_file:
        check_output(output)
        refuse_over_repairs(output)
    elif output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise InputError(f"{output}: exists and is not an empty folder", hint="name a new folder")
    spec, faults = spec_of(scene if scene.startswith("sim:") else f"sim:{scene}")
    spec = replace(spec, **wanted.changes())
    devices = simulated(spec, faults)
    plan = plan_of(devices, wanted.exposure)
    if wanted.texture is not None:
        plan = replace(plan, texture=Texture(Exposure(wanted.texture), wanted.texture_every))
    scanning = progress.subrange(0, 1, "scanning")
    if into_file:
        scan_into_file(devices, plan, output, wanted.keep, scanning)
    else:
        scan_into_folder(devices, plan, output, scanning)
    seconds = plan.exposures[0].seconds
    return SimulatedScan(output, spec.scene, spec.rig, plan.steps, tuple(plan.lasers), seconds)
