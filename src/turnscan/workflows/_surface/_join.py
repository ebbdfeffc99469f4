"""Join: several poses of one part → one surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from turnscan import poses
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.edit import needs_rebuild
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh
from turnscan.meshing import source_of, to_mesh
from turnscan.pipeline import Reconstruction
from turnscan.points import RangeGrid, placed, without
from turnscan.poses import Alignment
from turnscan.progress import Progress, no_progress
from turnscan.rig import Pose, Rig, rig_hash
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.settings import Settings
from turnscan.shapes import View
from turnscan.stripes import StripeFlag
from turnscan.surface import TearLimits
from turnscan.surface.clean import drop_uncertain
from turnscan.surface.fusion import RangeSurface, range_surfaces
from turnscan.workflows._files._history import history_of
from turnscan.workflows._files._kept_options import kept_options
from turnscan.workflows._importing._range_scans import placed_scans, read_range_scan
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._surface._aligning import reference_view
from turnscan.workflows._surface._joined_report import joined_tables
from turnscan.workflows._surface._landmarks import read_landmarks
from turnscan.workflows._surface._loading import load
from turnscan.workflows._surface._report import about
from turnscan.workflows._surface._result import ReconstructResult
from turnscan.workflows._surface._texture import PosedFile, coloured_by_files

_CUT = 1.1
"""Radii round a marker sphere's centre that are left out: its foot belongs to it."""
_READ, _PLACED = 0.6, 0.8
"""Of the work, until the poses are read, and until they are placed."""
_JOINED = 0.8
"""Of the rest, until there is a surface."""
Landmarks = Mapping[str, Mapping[str, Floats]]
"""Name of a point → name of a pose → (3,) mm in the frame of that pose."""


@dataclass(frozen=True)
class _Source:
    """One pose, as its file holds it."""

    name: str
    grids: list[RangeGrid]
    findings: list[Finding]
    rig: Rig | None = None
    start: Pose | None = None
    """Where a .conf file puts it."""
    options: ReconstructOptions | None = None
    """What its points were made with."""
    path: Path | None = None
    """Of a scan file, which may hold texture pictures."""

    def surfaces(self, tears: TearLimits) -> list[RangeSurface]:
        """Those by which it is placed: without the points that its own settings leave out."""
        limit = None if self.options is None else self.options.largest_sigma
        sure = [drop_uncertain(grid, limit)[0] for grid in self.grids]
        return [surface for grid in sure for surface in range_surfaces(grid, tears)]


def join(
    sources: Sequence[str | PathLike[str]],
    options: ReconstructOptions | None = None,
    *,
    points: str | PathLike[str] | Landmarks | None = None,
    markers: float | None = None,
    reference: str | PathLike[str] | Mesh | None = None,
    rig: Rig | None = None,
    unit: str = "m",
    progress: Progress = no_progress,
    **changes: Any,
) -> ReconstructResult:
    """Bring several poses of one part together as one surface.

    Without ``points``, ``markers`` and ``reference`` the poses find each other by their shape. The
    first one gives the frame, or the reference. What the points of each pose were made with, and
    the joined surface, stands in every file that is written of it.

    Parameters
    ----------
    sources
        Scan files (.turnscan), range scans of another scanner (.ply), or one .conf file that says
        where its range scans lie, roughly.
    options
        How points become a surface, for all poses alike; None takes the usual ones for the joined
        surface, but the smallest ``largest_sigma`` of all scans, and for the points of each pose
        those of its scan (see `reconstruct`).
    points
        Points picked in several poses: a CSV or JSON file, or a mapping of them.
    markers
        Diameter of three or more marker spheres fixed to the part, mm; they are removed from the
        result.
    reference
        The part as it is drawn, a mesh file in mm or STEP: each pose is brought onto it by shape,
        so that they need not overlap. Nothing of it becomes part of the surface.
    rig
        The rig of all scans; None takes the one in each scan file.
    unit
        Unit of range scans: mm, cm, m or inch; results are always mm.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``close=True``, for the poses and for the joined surface.

    Returns
    -------
    ReconstructResult
        The joined surface; where the poses lie is in its report.

    Raises
    ------
    InputError
        Where poses do not overlap, or fit in several ways, or one file is given twice.

    >>> import turnscan as ts
    >>> ts.join(["cup.turnscan", "cup.turnscan"])
    Traceback (most recent call last):
    turnscan.errors.InputError: cup.turnscan: given twice → give each pose once
    """
    wanted = chosen(ReconstructOptions, options, changes)
    ways = {"points": points, "markers": markers, "reference": reference}
    if len(given := [name for name, value in ways.items() if value is not None]) > 1:
        raise InputError(f"{' and '.join(given)}: mutually exclusive", hint="give one of them")
    drawn = None if reference is None else _reference(reference)
    files = [Path(source) for source in sources]
    own = _OwnOptions(options, changes)
    read = _read_all(_paths(files, unit), rig, unit, own, progress.subrange(0, _READ))
    wanted = _limited(wanted, read)
    settings = wanted.settings()
    placing = progress.subrange(_READ, _PLACED, "placing poses")
    found, read = _aligned(read, settings, points, markers, drawn, placing)
    done = _coloured(read, found, wanted, progress.subrange(_PLACED, 1))
    told = {**about(files[0], None, settings), "source": " + ".join(p.name for p in files)}
    told |= {} if drawn is None else {"reference": drawn.name}
    told["rig_sha256"] = {s.name: rig_hash(s.rig) for s in read if s.rig is not None} or None
    told["settings"] = {
        "joined": dict(wanted.changed()),
        "poses": {s.name: dict((s.options or wanted).changed()) for s in read},
    }
    return ReconstructResult(done, told, tables=joined_tables(found), options=wanted)


@dataclass(frozen=True)
class _OwnOptions:
    """What the points of each pose are made with."""

    options: ReconstructOptions | None
    """For all alike; None: those of each scan."""
    changes: Mapping[str, Any]

    def of(self, scan: Scan | None) -> ReconstructOptions:
        """Those of one scan; None for range scans, which keep none."""
        own = None if scan is None else kept_options(scan)
        return chosen(ReconstructOptions, self.options or own, self.changes)


def _read_all(
    paths: Mapping[Path, Pose | None],
    rig: Rig | None,
    unit: str,
    own: _OwnOptions,
    progress: Progress,
) -> list[_Source]:
    read = []
    for k, (name, (path, start)) in enumerate(zip(_names(list(paths)), paths.items(), strict=True)):
        mine = progress.subrange(k / len(paths), (k + 1) / len(paths), f"reading {name}")
        read.append(_read(name, path, start, rig, unit, own, mine))
    _check_different(read)
    return read


def _reference(reference: str | PathLike[str] | Mesh) -> poses.View:
    """What the poses are brought onto; raises InputError where it has no surface."""
    loaded = load(reference)
    if not len(loaded.mesh.faces):
        raise InputError(f"{loaded.name}: no faces", hint="give a mesh or a STEP file")
    return reference_view(loaded.mesh, Path(loaded.name).name)


def _aligned(
    read: list[_Source],
    settings: Settings,
    points: str | PathLike[str] | Landmarks | None,
    markers: float | None,
    reference: poses.View | None,
    progress: Progress,
) -> tuple[Alignment, list[_Source]]:
    """Where the poses lie, and the poses without their marker spheres."""
    names = [s.name for s in read]
    views = [poses.view(s.name, s.surfaces(settings.tears)) for s in read]
    if reference is not None:
        found = poses.onto_all(reference, views)
        poses.check(found)
        return found, read
    if points is not None:
        known = read_landmarks(Path(points)) if isinstance(points, str | PathLike) else points
        starts = poses.from_landmarks(names, {k: dict(v) for k, v in known.items()})
    elif markers is not None:
        balls = [poses.marker_spheres(v, markers) for v in views]
        starts = poses.from_markers(names, balls, markers)
        read = [_without(s, b, markers) for s, b in zip(read, balls, strict=True)]
    elif read[0].start is not None:
        starts = [read[0].start.inverse() @ s.start for s in read if s.start is not None]
    else:
        starts = poses.place(views, progress.counter(len(views)))
    found = poses.align(views, starts)
    by_shape = points is None and markers is None and read[0].start is None
    poses.check(found, by_shape=by_shape)
    return found, read


def _paths(sources: Sequence[Path], unit: str) -> dict[Path, Pose | None]:
    """The files of the poses, and where a .conf file puts them.

    Raises InputError for one pose alone, a file given twice, a .conf among others.
    """
    confs = [p for p in sources if p.suffix.lower() == ".conf"]
    if confs and len(sources) > 1:
        raise InputError(
            f"{confs[0]}: a .conf must be the only source", hint="give its range scans by name"
        )
    if confs:
        return dict(placed_scans(confs[0], unit))
    if len(sources) < 2:
        raise InputError(
            f"{sources[0]}: only one pose; at least two are needed",
            hint="give two or more, or reconstruct it",
        )
    seen: dict[Path, Path] = {}
    for path in sources:
        if path.resolve() in seen:
            raise InputError(f"{path}: given twice", hint="give each pose once")
        seen[path.resolve()] = path
    return dict.fromkeys(sources)


def _names(paths: Sequence[Path]) -> list[str]:
    """File names without suffix; with their folder where two are the same."""
    stems = [p.stem for p in paths]
    return [s if stems.count(s) == 1 else str(p) for s, p in zip(stems, paths, strict=True)]


def _read(
    name: str,
    path: Path,
    start: Pose | None,
    rig: Rig | None,
    unit: str,
    own: _OwnOptions,
    progress: Progress,
) -> _Source:
    """One pose in its own frame, clipped by its own volume."""
    if path.suffix.lower() == ".ply":
        options = own.of(None)
        grid, findings = read_range_scan(path, Pose(), unit, options.settings())
        return _Source(name, [grid], findings, start=start, options=options)
    with Scan.open(path) as scan:
        mine = rig_for(scan, rig)
        edits = history_of(scan).enabled
        options = own.of(scan)
        settings = options.settings(mine, scan)
        looks = sum(len(lit_in(n, mine)) * len(scan.steps(n)) for n in scan.plan.lasers)
        tick = progress.subrange(0, 0.8).counter(looks)
        sights = detect_scan(scan, mine, settings.stripes, settings.volume, tick)
        grids, _, findings = to_grids(sights, settings, edits, progress.subrange(0.8, 1))
    idle = sum(not needs_rebuild(e.edit) for e in edits)
    if idle:
        text = (
            f"{idle} edits of its mesh are not applied: they belong to the mesh of this pose alone"
        )
        findings.append(Finding("poses.edits", "note", text, "", "repair the joined mesh"))
    if own.options is None and options != own.of(None):
        said = ", ".join(f"{k} {v}" for k, v in options.changed().items())
        text = f"its points are made with the settings of its scan: {said}"
        findings.append(Finding("poses.settings", "note", text))
    return _Source(name, grids, findings, mine, options=options, path=path)


def _check_different(read: Sequence[_Source]) -> None:
    """Raise InputError where two files hold the same points."""
    for k, a in enumerate(read):
        for b in read[:k]:
            if len(a.grids) == len(b.grids) and all(
                np.array_equal(x.points, y.points, equal_nan=True)
                for x, y in zip(a.grids, b.grids, strict=True)
            ):
                raise InputError(
                    f"{b.name} and {a.name}: the same scan is given twice",
                    hint="give each pose once",
                )


def _without(source: _Source, balls: Floats, diameter: float) -> _Source:
    """A pose without its marker spheres."""

    def cut(grid: RangeGrid) -> RangeGrid:
        away = np.full(grid.found.shape, np.inf)
        for ball in balls:
            away = np.fmin(away, np.linalg.norm(grid.points - ball, axis=2))
        return without(grid, away < _CUT * diameter / 2, StripeFlag.OUTSIDE)

    return replace(source, grids=[cut(g) for g in source.grids])


def _merged(
    read: Sequence[_Source], found: Alignment, settings: Settings, progress: Progress
) -> Reconstruction:
    """All grids where they belong, and one mesh of them; it stands on no platter any more."""
    findings = [
        replace(f, where=", ".join(filter(None, [s.name, f.where])))
        for s in read
        for f in s.findings
    ]
    pairs = list(zip(read, found.poses, strict=True))
    grids = [placed(g, p, f"{s.name} {g.laser}") for s, p in pairs for g in s.grids]
    caps = None if settings.caps is None else replace(settings.caps, floor=None, top=None)
    made = to_mesh(grids, replace(settings, caps=caps), progress=progress)
    mesh, left = made.mesh, made.grids
    findings += poses.alignment_findings(found) + made.findings
    source = replace(
        source_of(left, None, made.merged),
        moves=tuple(poses.pose_moves(found, mesh)),
        placed=_views(pairs),
    )
    return Reconstruction(
        tuple(left), mesh, tuple(findings), (), made.opened, source=source, along=settings.along,
        lost=made.lost,
    )  # fmt: skip


def _limited(wanted: ReconstructOptions, read: Sequence[_Source]) -> ReconstructOptions:
    """With the smallest largest sigma that is kept with the poses, where none was asked for."""
    limits = (s.options.largest_sigma for s in read if s.options is not None)
    kept = [limit for limit in limits if limit is not None]
    if wanted.largest_sigma is not None or not kept:
        return wanted
    return replace(wanted, largest_sigma=min(kept))


def _coloured(
    read: Sequence[_Source], found: Alignment, wanted: ReconstructOptions, progress: Progress
) -> Reconstruction:
    """The joined surface, in the colours that the texture pictures of all poses show."""
    joining = progress.subrange(0, _JOINED, "building the surface")
    done = _merged(read, found, wanted.settings(), joining)
    if wanted.no_colour:
        return done
    pairs = zip(read, found.poses, strict=True)
    files = [
        PosedFile(s.path, s.rig, p) for s, p in pairs if s.path is not None and s.rig is not None
    ]
    told = progress.subrange(_JOINED, 1, "colouring")
    mesh, said = coloured_by_files(done.mesh, files, told)
    return replace(done, mesh=mesh, findings=(*done.findings, *said))


def _views(pairs: Sequence[tuple[_Source, Pose]]) -> list[View]:
    """Each grid with the rig that measured it: one for all scans that hold the same rig."""
    rigs = {rig_hash(s.rig): s.rig for s, _ in pairs if s.rig is not None}
    return [
        View(grid, rigs[rig_hash(s.rig)], f"{s.name} {grid.laser}", pose)
        for s, pose in pairs
        if s.rig is not None
        for grid in s.grids
    ]
