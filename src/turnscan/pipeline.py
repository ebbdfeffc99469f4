"""The whole story on one screen: frames → stripes → range grids → mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from turnscan.arrays import Floats
from turnscan.detection import Detection, detect_scan
from turnscan.edit import Entry
from turnscan.findings import Finding
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh
from turnscan.meshing import to_mesh
from turnscan.points import Along, RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan, rig_for
from turnscan.settings import Settings
from turnscan.shapes import Source
from turnscan.surface import TearLimits, holes, thin
from turnscan.surface.holes import ClosingOptions, Hole, LeftOut, ScanCoverage

_GRIDS = 0.7
"""Of the work of a reconstruction, until there are grids."""


@dataclass(frozen=True)
class Reconstruction:
    """What became of a scan."""

    grids: tuple[RangeGrid, ...]
    mesh: Mesh
    findings: tuple[Finding, ...]
    edits: tuple[Entry, ...] = ()
    """What was done by hand."""
    opened: Mesh | None = None
    """The mesh before its gaps were closed and it was thinned; None when it is the same."""
    sought: tuple[ScanCoverage, ...] = ()
    """What each laser's scan could have found; empty for scans of other scanners."""
    caps: ClosingOptions | None = None
    """How its gaps were closed; None where they were not."""
    source: Source | None = None
    """What the uncertainty of its volume hangs on; None: on its grids and their rig alone."""
    along: Along | None = None
    """Which points of the profiles were asked for; None for all."""
    tears: TearLimits | None = None
    """Where profiles do not hang together; None is the default."""
    cut: Floats | None = None
    """(k, 3) mm: vertices of the mesh before closing that lost faces by hand; None for none."""
    lost: LeftOut | None = None
    """Faces that were left out as too uncertain; None for none."""
    merged: Mesh | None = None
    """The mesh with its islands, before anything was edited; None where it is not known."""

    @cached_property
    def spaced(self) -> tuple[RangeGrid, ...]:
        """The grids with the points along their profiles that were asked for."""
        return tuple(thin(g, self.along, self.tears) for g in self.grids)

    @cached_property
    def holes(self) -> list[Hole]:
        """The gaps of the surface as it was measured and edited, each with its cause."""
        mesh = self.mesh if self.opened is None else self.opened
        return holes.explain(mesh, holes.holes(mesh), self.sought, self.cut, self.lost)


def reconstruct(
    scan: Scan,
    rig: Rig | None = None,
    settings: Settings | None = None,
    tick: Callable[[], None] = lambda: None,
    edits: Sequence[Entry] = (),
) -> Reconstruction:
    """All frames of a scan → range grids of its lasers and one mesh in the object's frame.

    ``rig`` None takes the one in the scan file; ``tick`` is called after each frame; ``edits`` are
    done in their order. Raises InputError where rig and scan do not fit or no angle is known,
    ScanCorrupt naming a frame.
    """
    s = settings or Settings()
    return build(detect_scan(scan, rig_for(scan, rig), s.stripes, s.volume, tick), s, edits)


def build(
    seen: Sequence[Detection],
    s: Settings,
    edits: Sequence[Entry] = (),
    progress: Progress = no_progress,
    *,
    finish: bool = True,
) -> Reconstruction:
    """Stripes → grids → mesh, with these edits. Raises InputError where no angle is known.

    ``progress`` hears how much of it is done; without ``finish`` the mesh is neither closed nor
    decimated, so that more edits can be made on it.
    """
    gridded = to_grids(seen, s, edits, progress.subrange(0, _GRIDS))
    rig = seen[0].view.rig if seen else None
    made = to_mesh(gridded.grids, s, edits, progress.subrange(_GRIDS, 1), rig, finish=finish)
    return Reconstruction(
        tuple(made.grids), made.mesh, (*gridded.findings, *made.findings), tuple(edits),
        opened=made.opened, sought=tuple(gridded.sought), caps=s.caps if finish else None,
        along=s.along, tears=s.tears, cut=made.cut, lost=made.lost,
        merged=made.merged,
    )  # fmt: skip
