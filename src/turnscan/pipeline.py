"""The whole story on one screen: frames → stripes → range grids → mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from turnscan import edit, points, surface
from turnscan.detection import Detection, detect_scan
from turnscan.edit import Entry
from turnscan.findings import Finding
from turnscan.mesh import Mesh, cut_touching
from turnscan.points import Along, RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan, rig_for
from turnscan.settings import Settings
from turnscan.shapes import Source
from turnscan.surface import TearLimits, clean, decimation, fusion, holes
from turnscan.surface.holes import ClosingOptions, Hole, ScanCoverage

Tick = Callable[[], None]

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

    @cached_property
    def spaced(self) -> tuple[RangeGrid, ...]:
        """The grids with the points along their profiles that were asked for."""
        return tuple(surface.thin(g, self.along, self.tears) for g in self.grids)

    @cached_property
    def holes(self) -> list[Hole]:
        """The gaps of the surface as it was measured and edited, each with its cause."""
        mesh = self.mesh if self.opened is None else self.opened
        return holes.explain(mesh, holes.holes(mesh), self.sought)


def reconstruct(
    scan: Scan,
    rig: Rig | None = None,
    settings: Settings | None = None,
    tick: Tick = lambda: None,
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
    grids, sought, findings = to_grids(seen, s, edits, progress.subrange(0, _GRIDS))
    rig = seen[0].view.rig if seen else None
    progress = progress.subrange(_GRIDS, 1)
    opened, mesh, remarks = to_mesh(grids, s, edits, progress, rig, finish=finish)
    said = (*findings, *remarks)
    return Reconstruction(
        tuple(grids),
        mesh,
        said,
        tuple(edits),
        opened,
        tuple(sought),
        s.caps if finish else None,
        along=s.along,
        tears=s.tears,
    )


def to_grids(
    seen: Sequence[Detection],
    s: Settings,
    edits: Sequence[Entry] = (),
    progress: Progress = no_progress,
) -> tuple[list[RangeGrid], list[ScanCoverage], list[Finding]]:
    """Stripes → grids, what each could have found, and what there is to know.

    ``progress`` hears of the profiles that an edit wants to be sought again, and of each grid.
    """
    grids, sought = list[RangeGrid](), list[ScanCoverage]()
    findings = edit.lost_edits(edits, [sight.view.laser for sight in seen])
    for k, sight in enumerate(seen):
        v = sight.view
        mine = progress.subrange(k / len(seen), (k + 1) / len(seen))
        mended, nothing = edit.mend_stripes(sight.stripes, edits, v, mine.subrange(0, 0.5))
        whole = points.build_grid(
            v.rig, v.laser, mended.stripes, mended.steps, mended.angles, mended.angle_sigma
        )
        turns, again = points.whole_turns(points.every(whole, s.every))
        findings += [*sight.findings, *nothing, *points.angle_findings(turns[0], again)]
        for i, turn in enumerate(turns):
            now = mine.subrange(0.5, 1).subrange(i / len(turns), (i + 1) / len(turns))
            now(0)
            seamed = edit.mend_grid(turn, edits)
            kept = points.drop_specks(points.clip(seamed, v.volume), s.shortest)
            findings += points.grid_findings(turn, kept, v.volume, str(v.settings.strategy))
            findings += points.together_findings(kept, v.rig, v.others, v.volume)
            if s.clean is not None:
                kept, taken = clean.clean(kept, s.clean)
                findings += taken
            if s.denoise is not None:
                kept = clean.denoise(kept, s.denoise, now)
            light, places = turn.amplitude, turn.points
            sought.append(
                ScanCoverage(v.rig, kept, v.volume, v.settings.orientation, light, places)
            )
            if s.between is not None:
                kept = points.respace(kept, s.between)
            grids.append(kept)
    return grids, sought, findings


def to_mesh(
    grids: Sequence[RangeGrid],
    s: Settings,
    edits: Sequence[Entry] = (),
    progress: Progress = no_progress,
    rig: Rig | None = None,
    *,
    finish: bool = True,
) -> tuple[Mesh, Mesh, list[Finding]]:
    """Grids → one sound mesh without islands, edited; the same closed and thinned as asked for.

    ``rig`` is the one that measured the grids; volumes are as uncertain as it is.
    ``progress`` hears of merging, closing and decimating. Without ``finish`` the mesh is neither
    closed nor decimated nor settled.
    """
    progress(0)
    sewn = s.caps is not None and s.caps.holes is not None
    merged, findings = fusion.merge(grids, s.tears, s.merge, s.voxel, along=s.along, sewn=sewn)
    loose, touching = cut_touching(merged)
    mesh, islands, faces = clean.drop_islands(loose, s.island)
    if islands:
        touching += clean.long_islands(loose, s.island)
    opened, mending = edit.mend_mesh(mesh, edits, lambda: source_of(grids, rig))
    mesh, closing = opened, list[Finding]()
    if finish:
        mesh, closing = finished(mesh, s, progress.subrange(0.4, 1))
    whole = clean.settled(mesh)
    if finish and mesh is opened:  # nothing was closed or decimated: there is one mesh
        opened = whole
    closed = finish and s.caps is not None
    remarks = surface.mesh_findings(whole, islands, faces, closed=closed)
    said = findings + touching + mending + closing + remarks
    return opened, whole if finish else opened, said


def finished(
    mesh: Mesh, s: Settings, progress: Progress = no_progress
) -> tuple[Mesh, list[Finding]]:
    """An edited mesh, closed and decimated as asked for; ``progress`` gets the fraction done."""
    findings = list[Finding]()
    if s.caps is not None:
        mesh, findings = holes.close(mesh, s.caps, progress.subrange(0, 1 / 3))
    if s.tolerance is not None or s.faces is not None:
        dense, thinning = mesh, progress.subrange(1 / 3, 1)
        mesh = decimation.decimate(dense, tolerance=s.tolerance, faces=s.faces, progress=thinning)
        findings += decimation.decimation_findings(dense, mesh, s.faces)
    return mesh, findings


def source_of(grids: Sequence[RangeGrid], rig: Rig | None) -> Source:
    """What the uncertainty of a volume hangs on: the grids a mesh was made from, and their rig.

    Grids that do not know where their camera stood were pasted, not merged.
    """
    there = [g for g in grids if g.found.any() and g.eyes is not None]
    merged = there if len(there) > 1 else []
    profiles = [r for g in merged for r in fusion.range_surfaces(g)]
    return Source(tuple(grids), rig, tuple(profiles))
