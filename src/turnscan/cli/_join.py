"""``turnscan join``: several poses of one part → one surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from turnscan import poses
from turnscan.arrays import Floats
from turnscan.cli._edit_source import history_of
from turnscan.cli._input import UNITS, read_rig_file
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_apart, check_output, format_options
from turnscan.cli._points_file import read_landmarks
from turnscan.cli._progress import progress
from turnscan.cli._range_scans import placed_scans, read_range_scan
from turnscan.cli._reconstruct_report import Section, about, check_report, finish
from turnscan.cli._settings import Limits, settings_options
from turnscan.detection import see
from turnscan.edit import is_grid_edit
from turnscan.errors import InputError
from turnscan.export import ExportOptions, exporter_for
from turnscan.findings import Finding
from turnscan.pipeline import Reconstruction, source_of, to_grids, to_mesh
from turnscan.points import RangeGrid, placed, without
from turnscan.poses import Alignment
from turnscan.rig import Pose, Rig, rig_hash
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.settings import Settings
from turnscan.stripes import StripeFlag
from turnscan.surface import range_surfaces

_path = click.Path(path_type=Path)
_CUT = 1.1
"""Radii round a marker sphere's centre that are left out: its foot belongs to it."""


@dataclass(frozen=True)
class _Source:
    """One pose, as its file holds it."""

    name: str
    grids: list[RangeGrid]
    findings: list[Finding]
    rig: Rig | None = None
    start: Pose | None = None
    """Where a .conf file puts it."""


@click.command("join")
@click.argument("sources", type=_path, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=_path,
    multiple=True,
    required=True,
    help="File to write, may be repeated; by suffix: .dxf .stl .ply .obj .3mf .glb .xyz.",
)
@click.option(
    "--points",
    "points_path",
    type=_path,
    help="Points picked in several poses: CSV `point,pose,x,y,z` or JSON, mm in each one's frame.",
)
@click.option(
    "--markers",
    "diameter",
    type=Finite(min=0, min_open=True),
    help="mm: diameter of three or more spheres fixed to the part; the result is without them.",
)
@click.option("--rig", "rig_path", type=_path, help="rig.json; without it each scan's own.")
@settings_options
@click.option(
    "--unit",
    type=click.Choice(list(UNITS)),
    default="m",
    show_default=True,
    help="Unit of range scans (.ply and .conf input); results are always mm.",
)
@click.option("--report", type=_path, help="Report to write: .html with pictures, or .json.")
@format_options
def verb(
    sources: tuple[Path, ...],
    outputs: tuple[Path, ...],
    points_path: Path | None,
    diameter: float | None,
    rig_path: Path | None,
    unit: str,
    report: Path | None,
    settings: Settings,
    limits: Limits,
    options: ExportOptions,
) -> None:
    """Bring several poses of one part together and write it as one surface.

    SOURCES are scan files (.turnscan), range scans of another scanner (.ply), or one .conf file
    that says where its range scans lie, roughly. Without --points and --markers the poses find
    each other by their shape. The first one gives the frame. Nothing is written where poses do not
    overlap, or fit in several ways.
    """
    paths = _paths(sources, unit)
    inputs = [*sources, *paths, *(p for p in (rig_path, points_path) if p is not None)]
    check_apart(outputs)
    for path in outputs:
        exporter_for(path.suffix)
        check_output(path, inputs=inputs)
    check_report(report, inputs)
    if points_path is not None and diameter is not None:
        raise InputError("--points and --markers: two ways to say the same", hint="give one")
    known = None if points_path is None else read_landmarks(points_path)
    rig = None if rig_path is None else read_rig_file(rig_path)
    names = _names(list(paths))
    read = [
        _read(name, path, start, rig, unit, settings, limits)
        for name, (path, start) in zip(names, paths.items(), strict=True)
    ]
    _check_different(read)
    views = [
        poses.view(s.name, [r for g in s.grids for r in range_surfaces(g, settings.tears)])
        for s in read
    ]
    if known is not None:
        starts = poses.from_landmarks(names, known)
    elif diameter is not None:
        balls = [poses.marker_spheres(v, diameter) for v in views]
        starts = poses.from_markers(names, balls, diameter)
        read = [_without(s, b, diameter) for s, b in zip(read, balls, strict=True)]
    elif read[0].start is not None:
        starts = [read[0].start.inverse() @ s.start for s in read if s.start is not None]
    else:
        with progress("placing poses", len(views)) as tick:
            starts = poses.place(views, tick)
    found = poses.align(views, starts)
    by_shape = known is None and diameter is None and read[0].start is None
    poses.check(found, by_shape=by_shape)
    done = _merged(read, found, settings)
    told = {**about(sources[0], None, settings), "source": " + ".join(s.name for s in sources)}
    told["rig_sha256"] = {s.name: rig_hash(s.rig) for s in read if s.rig is not None} or None
    finish(outputs, done, told, None, report, options, _sections(found))


def _paths(sources: Sequence[Path], unit: str) -> dict[Path, Pose | None]:
    """The files of the poses, and where a .conf file puts them.

    Raises InputError for one pose alone, a file given twice, a .conf among others.
    """
    confs = [p for p in sources if p.suffix.lower() == ".conf"]
    if confs and len(sources) > 1:
        raise InputError(f"{confs[0]}: a .conf stands alone", hint="give its range scans by name")
    if confs:
        return dict(placed_scans(confs[0], unit))
    if len(sources) < 2:
        raise InputError(
            f"{sources[0]}: one pose, nothing to join it to",
            hint="give two or more, or use `turnscan reconstruct`",
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
    settings: Settings,
    limits: Limits,
) -> _Source:
    """One pose in its own frame, clipped by its own volume."""
    if path.suffix.lower() == ".ply":
        grid, findings = read_range_scan(path, Pose(), unit, settings)
        return _Source(name, [grid], findings, start=start)
    with Scan.open(path) as scan:
        mine = rig_for(scan, rig)
        edits = history_of(scan).enabled
        volume = limits.volume(mine, scan)
        looks = sum(len(lit_in(n, mine)) * len(scan.steps(n)) for n in scan.plan.lasers)
        with progress(f"reading {name}", looks) as tick:
            sights = see(scan, mine, settings.stripes, volume, tick)
            grids, _, findings = to_grids(sights, settings, edits)
    idle = sum(not is_grid_edit(e.edit) for e in edits)
    if idle:
        text = (
            f"{idle} repairs of its mesh are left out: they belong to the mesh of this pose alone"
        )
        findings.append(Finding("poses.edits", "note", text, "", "repair the joined mesh"))
    return _Source(name, grids, findings, mine)


def _check_different(read: Sequence[_Source]) -> None:
    """Raise InputError where two files hold the same points."""
    for k, a in enumerate(read):
        for b in read[:k]:
            if len(a.grids) == len(b.grids) and all(
                np.array_equal(x.points, y.points, equal_nan=True)
                for x, y in zip(a.grids, b.grids, strict=True)
            ):
                raise InputError(
                    f"{b.name} and {a.name}: the same scan twice", hint="give each pose once"
                )


def _without(source: _Source, balls: Floats, diameter: float) -> _Source:
    """A pose without its marker spheres."""

    def cut(grid: RangeGrid) -> RangeGrid:
        away = np.full(grid.found.shape, np.inf)
        for ball in balls:
            away = np.fmin(away, np.linalg.norm(grid.points - ball, axis=2))
        return without(grid, away < _CUT * diameter / 2, StripeFlag.OUTSIDE)

    return replace(source, grids=[cut(g) for g in source.grids])


def _merged(read: Sequence[_Source], found: Alignment, settings: Settings) -> Reconstruction:
    """All grids where they belong, and one mesh of them; it stands on no platter any more."""
    findings = [
        replace(f, where=", ".join(filter(None, [s.name, f.where])))
        for s in read
        for f in s.findings
    ]
    pairs = list(zip(read, found.poses, strict=True))
    grids = [placed(g, p, f"{s.name} {g.laser}") for s, p in pairs for g in s.grids]
    caps = None if settings.caps is None else replace(settings.caps, floor=None, top=None)
    opened, mesh, remarks = to_mesh(grids, replace(settings, caps=caps))
    findings += poses.alignment_findings(found) + remarks
    source = replace(source_of(grids, None), moves=tuple(poses.pose_moves(found, mesh)))
    return Reconstruction(
        tuple(grids), mesh, tuple(findings), (), opened, source=source, along=settings.along
    )


def _sections(found: Alignment) -> list[Section]:
    """Tables of where the poses lie, and how they agree."""
    placed_at: list[dict[str, Any]] = []
    for i, (name, pose, fit) in enumerate(zip(found.names, found.poses, found.fits, strict=True)):
        spread = np.sqrt(np.diagonal(found.covariance[i]))
        placed_at.append(
            {
                "pose": name,
                "rotation": pose.rotation.tolist(),
                "translation_mm": pose.translation.tolist(),
                "sigma_turn_deg": float(np.rad2deg(spread[:3].max())),
                "sigma_shift_mm": float(spread[3:].max()),
                "shared": fit.shared,
                "free": [str(f) for f in found.freedoms if f.view == i],
            }
        )
    where = [
        [
            p["pose"], f"{p['sigma_turn_deg']:.4f}", f"{p['sigma_shift_mm']:.4f}",
            f"{p['shared']:.0%}", "; ".join(p["free"]) or "nothing",
        ]
        for p in placed_at
    ]  # fmt: skip
    apart = [
        [m.first, m.second, m.points, f"{m.mean:+.4f}", f"{m.rms:.4f}", f"{m.sigmas:.2f}"]
        for m in found.meetings
    ]
    return [
        Section(
            "Poses",
            ["pose", "turn, sigma °", "shift, sigma mm", "on the others", "not determined"],
            where,
            "poses",
            placed_at,
        ),
        Section(
            "Overlaps",
            ["first", "second", "places", "mean, mm", "rms, mm", "rms, sigma"],
            apart,
            "overlaps",
            [asdict(m) for m in found.meetings],
        ),
    ]
