"""Texture pictures of scans → colours of a surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.progress import Progress
from turnscan.rig import Pose, Rig, rotation_z
from turnscan.scan import Scan
from turnscan.texture import Colours, TexturePicture, colours_of, texture_findings

_LOOKED_AT = 5
"""Pictures whose brightest pixel tells how many bits the camera has."""


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
    known = {k: _angles(s.scan) for k, s in enumerate(sources)}
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
                table = s.rig.T_camera_table @ Pose(rotation_z(known[k][step]), np.zeros(3))
                seen = s.scan.texture(step).lit
                yield TexturePicture(seen, s.rig.camera, table @ s.pose.inverse(), white)
                tick()

    channels = max(s.scan.plan.channels for k, s in enumerate(sources) if steps[k])
    return colours_of(mesh, pictures(), channels), left


def _angles(scan: Scan) -> dict[int, float]:
    """rad, the table's angle of each texture picture: that of the step's own frames if measured."""
    turned = scan.texture_angles
    for step, angle in zip(scan.steps(), scan.angles(), strict=True):
        if step in turned and not math.isnan(angle):
            turned[step] = float(angle)
    return turned


def _without_angle(scan: Scan, used: Sequence[int]) -> list[Finding]:
    lost = len(scan.texture_angles) - len(used)
    if not lost:
        return []
    text = f"{lost} texture pictures of {scan.path.name} give no colour: their angle is not known"
    return [Finding("texture.no-angle", "warning", text)]


def _white(scan: Scan, steps: Sequence[int]) -> float:
    """The grey level of a full pixel; of more than 8 bits, the least camera that can show these."""
    if scan.plan.dtype == "uint8":
        return 255.0
    some = steps[:: max(1, len(steps) // _LOOKED_AT)]
    most = max((int(scan.texture(step).lit.max()) for step in some), default=0)
    return next(2.0**bits - 1 for bits in (10, 12, 14, 16) if most < 2**bits)
