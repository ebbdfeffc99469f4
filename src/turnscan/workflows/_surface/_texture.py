"""Texture pictures of scans → colours of a surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from turnscan.detection import moved
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.progress import Progress
from turnscan.rig import Pose, Rig
from turnscan.scan import Scan
from turnscan.texture import Colours, TexturePicture, colours_of, texture_findings

T = TypeVar("T")
_LOOKED_AT = 5
"""Pictures of each kind whose brightest pixel tells how many bits the camera has."""


@dataclass(frozen=True)
class TextureSource:
    """A scan whose texture pictures show a surface, and where it lies."""

    scan: Scan
    rig: Rig
    pose: Pose = field(default_factory=Pose)
    """The scan's own object frame → that of the surface."""


@dataclass(frozen=True)
class PosedFile:
    """The same, of a scan that is not open."""

    path: Path
    rig: Rig
    pose: Pose


def coloured(
    mesh: Mesh, sources: Sequence[TextureSource], progress: Progress
) -> tuple[Mesh, list[Finding]]:
    """A surface in the colours of all texture pictures of its scans; as it is where there is none.

    Raises ScanCorrupt naming a picture, Cancelled.
    """
    found, left = colours(mesh, sources, progress)
    if found is None:
        return mesh, left
    return replace(mesh, colour=found.colour), [*texture_findings(mesh, found), *left]


def coloured_by_files(
    mesh: Mesh, files: Iterable[PosedFile], progress: Progress
) -> tuple[Mesh, list[Finding]]:
    """As `coloured`, of scan files that are opened for it."""
    with ExitStack() as open_files:
        sources = [
            TextureSource(open_files.enter_context(Scan.open(f.path)), f.rig, f.pose) for f in files
        ]
        return coloured(mesh, sources, progress)


def colours(
    mesh: Mesh, sources: Sequence[TextureSource], progress: Progress
) -> tuple[Colours | None, list[Finding]]:
    """Colours of the vertices, None without a picture; and which pictures could not be used."""
    known = {k: _angles(s) for k, s in enumerate(sources)}
    steps = {
        k: [step for step, angle in known[k].items() if not math.isnan(angle)]
        for k, s in enumerate(sources)
    }
    left = [f for k, s in enumerate(sources) for f in _without_angle(s.scan, steps[k])]
    total = sum(map(len, steps.values()))
    if not total or not len(mesh.faces):
        return None, left
    tick = progress.counter(total)

    def pictures() -> Iterator[TexturePicture]:
        for k, s in enumerate(sources):
            white = _white(s.scan, steps[k])
            for step in steps[k]:
                table = s.rig.T_camera_table @ Pose(*s.rig.turning(known[k][step]))
                seen = s.scan.texture(step).lit
                yield TexturePicture(seen, s.rig.camera, table @ s.pose.inverse(), white)
                tick()

    channels = max(s.scan.plan.channels for k, s in enumerate(sources) if steps[k])
    return colours_of(mesh, pictures(), channels), left


def _angles(source: TextureSource) -> dict[int, float]:
    """rad, the table's angle of each texture picture, NaN where not known: that of the step's own
    frames where there is one, with the table's own errors as in the points of these frames."""
    angle = source.scan.texture_angles
    pictures, sigma = list(angle), dict.fromkeys(angle, math.nan)
    for shot in source.scan.stored():
        if not math.isnan(shot.angle):
            angle[shot.row.step], sigma[shot.row.step] = shot.angle, shot.row.sigma
    steps = sorted(step for step in angle if not math.isnan(angle[step]))
    if source.rig.motion is not None and steps:
        told, sure = (np.array([of[step] for step in steps]) for of in (angle, sigma))
        true, _ = moved(source.rig.motion, told, sure, np.isnan(sure))
        angle.update(zip(steps, true.tolist(), strict=True))
    return {step: angle[step] for step in pictures}


def _without_angle(scan: Scan, used: Sequence[int]) -> list[Finding]:
    lost = len(scan.texture_angles) - len(used)
    if not lost:
        return []
    text = f"{lost} texture pictures of {scan.path.name} give no colour: their angle is not known"
    return [Finding("texture.no-angle", "warning", text)]


def _white(scan: Scan, steps: Sequence[int]) -> float:
    """The grey level of a full pixel. Of more than 8 bits it is the top of the least camera that
    can show both these pictures and the stripes, which tell where the pictures are dark."""
    if scan.plan.dtype == "uint8":
        return 255.0
    shown = [scan.texture(step).lit for step in _few(steps)]
    shown += [stripe.decode().lit for stripe in _few(list(scan.stored()))]
    most = max((int(picture.max()) for picture in shown), default=0)
    return next(2.0**bits - 1 for bits in (10, 12, 14, 16) if most < 2**bits)


def _few(every: Sequence[T]) -> Sequence[T]:
    """Some of them, spread evenly."""
    return every[:: max(1, len(every) // _LOOKED_AT)]
