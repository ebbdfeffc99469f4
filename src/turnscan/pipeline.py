"""The whole story on one screen: frames → stripes → range grids → mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np

from turnscan import points, surface
from turnscan.arrays import Bools
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.points import RangeGrid, Spacing, Volume
from turnscan.rig import Rig
from turnscan.scan import Frame, Scan, Stored, lit_in, rig_for
from turnscan.stripes import Exposed, Signal, Stripe, StripeSettings
from turnscan.surface import Caps, Clean, How, Mesh, Tears

Tick = Callable[[], None]
FLANKS = 24
"""px beyond the working volume in which a stripe is still seen, but does not count."""


@dataclass(frozen=True)
class Settings:
    """Everything a user may choose about a reconstruction."""

    stripes: StripeSettings = field(default_factory=StripeSettings)
    volume: Volume | None = None
    """What to keep; None takes what the rig can measure above the platter."""
    shortest: int = 3
    """Runs of fewer points in a profile are specks."""
    every: int = 1
    """Use every n-th profile."""
    spacing: float | None = None
    """mm between points along a profile; None keeps one point per image line."""
    spacing_by: Spacing = "height"
    """arc is for the profiles alone: the mesh then keeps the points as measured."""
    clean: Clean | None = field(default_factory=Clean)
    """What is taken away before points become a surface; None keeps all."""
    tears: Tears = field(default_factory=Tears)
    merge: How = "auto"
    """How several lasers become one surface."""
    voxel: float | None = None
    """mm: voxels of the volumetric merge; None takes the usual spacing of the points."""
    island: int | None = None
    """Loose pieces of fewer faces are taken away; None takes 1 % of the largest piece."""
    caps: Caps | None = None
    """How to close the surface; None leaves its borders open."""


@dataclass(frozen=True)
class Reconstruction:
    """What became of a scan."""

    grids: tuple[RangeGrid, ...]
    mesh: Mesh
    findings: tuple[Finding, ...]


def reconstruct(
    scan: Scan, rig: Rig | None = None, settings: Settings | None = None, tick: Tick = lambda: None
) -> Reconstruction:
    """All frames of a scan → range grids of its lasers and one mesh in the object's frame.

    ``rig`` None takes the one in the scan file; ``tick`` is called after each frame. Raises
    InputError where rig and scan do not fit or no angle is known, ScanCorrupt naming a frame.
    """
    s, rig = settings or Settings(), rig_for(scan, rig)
    grids, meshed, findings = [], list[RangeGrid](), list[Finding]()
    lasers = [(lit, name) for lit in scan.plan.lasers for name in lit_in(lit, rig)]
    for lit, laser in lasers:
        volume = s.volume or points.working_volume(rig, laser)
        others = set(lit_in(lit, rig)) - {laser}
        inside = points.view_mask(rig, laser, volume, others=others)
        mask = points.view_mask(rig, laser, volume, others=others, margin=FLANKS)
        look = replace(s.stripes, orientation=scan.plan.orientation, mask=mask)
        whole, found = _grid(scan, lit, laser, rig, look, inside, tick)
        turns, again = points.whole_turns(points.every(whole, s.every))
        findings += found + points.angle_findings(turns[0], again)
        for turn in turns:
            kept = points.drop_specks(points.clip(turn, volume), s.shortest)
            findings += points.grid_findings(turn, kept, volume)
            if s.clean is not None:
                kept, taken = surface.clean(kept, s.clean)
                findings += taken
            grids.append(points.resample(kept, s.spacing, s.spacing_by) if s.spacing else kept)
            # Points at equal arc length have no neighbours at the same place of the next profile.
            meshed.append(kept if s.spacing_by == "arc" else grids[-1])
    mesh, remarks = to_mesh(meshed, s)
    return Reconstruction(tuple(grids), mesh, tuple(findings + remarks))


def to_mesh(grids: Sequence[RangeGrid], s: Settings) -> tuple[Mesh, list[Finding]]:
    """Grids → one mesh: merged, without islands, its gaps closed where that is asked for."""
    merged, findings = surface.merge(grids, s.tears, s.merge, s.voxel)
    mesh, islands, faces = surface.drop_islands(surface.split_touching(merged), s.island)
    gaps = None
    if s.caps is not None:
        mesh, gaps = surface.close(mesh, s.caps)
    return mesh, findings + surface.mesh_findings(mesh, islands, faces, gaps)


def _grid(
    scan: Scan, lit: str, laser: str, rig: Rig, look: StripeSettings, inside: Bools, tick: Tick
) -> tuple[RangeGrid, list[Finding]]:
    """The grid of a laser from the frames called ``lit``, in which it may not be alone."""
    signal = Signal(scan.plan.weights, scan.plan.dtype)

    def find(shots: list[Stored]) -> tuple[int, float, Stripe]:
        frames = [stored.decode() for stored in shots]
        for _ in frames:
            tick()
        first = frames[0]
        if scan.plan.exposures == 1:
            stripe = signal.detect(first.lit, first.dark, look, first.level, first.noise, inside)
        else:
            stripe = signal.detect_bracket([_exposed(f) for f in frames], look, inside)
        return first.step, first.angle, stripe

    # A bracket tells what is clipped by the colours as they were taken.
    stored = scan.stored(lit, signal.project if scan.plan.exposures == 1 else None)
    with ThreadPoolExecutor() as pool:
        brackets = [list(shots) for _, shots in groupby(stored, key=lambda shot: shot.row.step)]
        done = list(pool.map(find, brackets))
    good = [d for d in done if not np.isnan(d[1])]
    findings = points.lost_frames(lit, scan.missing(lit), len(done) - len(good))
    steps, angles, found = [d[0] for d in good], [d[1] for d in good], [d[2] for d in good]
    return points.build_grid(rig, laser, found, steps, angles), findings


def _exposed(frame: Frame) -> Exposed:
    seconds, gain = frame.settings.get("seconds"), frame.settings.get("gain", 1.0)
    if not isinstance(seconds, int | float) or not isinstance(gain, int | float):
        raise InputError(
            f"step {frame.step} of laser {frame.laser!r}: exposure {frame.exposure} does not tell "
            "how long it was, so it cannot be fused with the others"
        )
    return Exposed(frame.lit, frame.dark, seconds * gain, frame.level, frame.noise)
