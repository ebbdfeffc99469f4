"""Refine: a rig made better by what scans of a part show, without a board."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from turnscan import points, poses
from turnscan.calibrate import Measured, Refined, RefineSettings, Sweep
from turnscan.calibrate import refine as adjust_rig
from turnscan.detection import Detection, detect_scan
from turnscan.errors import CalibrationError, InputError
from turnscan.findings import Finding
from turnscan.gridding import to_grids
from turnscan.points import RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option
from turnscan.rig import Pose, Rig, rig_hash, rig_to_json
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.settings import Settings
from turnscan.surface.clean import drop_uncertain
from turnscan.surface.fusion import RangeSurface, range_surfaces
from turnscan.workflows._calibration._refine_body import Body, body_of
from turnscan.workflows._files._kept_options import kept_options
from turnscan.workflows._files._reading import read_rig_file
from turnscan.workflows._files._writing import check_output, write_atomically
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._refine import RefineOptions

_DETECTION, _PLACED = 0.6, 0.65
"""Of the work, until all stripes are found, and until it is known how the part lay."""
_BENT = (0.0, 0.1, 0.2, 0.3)
"""Of the distance by which a rig may put points beside their places: how much of it bends shapes,
instead of moving them as a whole."""
_MOST_WAYS = 12
"""In which a part that is alike from several sides may have been laid down, that are tried."""
_TRIALS, _QUICK_ROUNDS = 0.6, 4
"""Of the work, until it is known which of these ways is best; rounds of each."""
_AS_WELL, _UNLIKE = 1.15, 5.0
"""Times the best way's gaps: another way that explains the scans as well. Standard uncertainties:
rigs farther apart are different ones."""
_TABLE = math.radians(3.0)
"""By which a table may be off its angles, where nothing is known of that."""
_QUICK = RefineSettings(geometry=False, rounds=1, queries=1500)


@dataclass(frozen=True)
class RefinedRig:
    """A rig file, and what a scan changed in it."""

    path: Path
    refined: Refined

    def __fspath__(self) -> str:
        """Its path: it stands for the rig file wherever one is wanted."""
        return fspath(self.path)

    def __str__(self) -> str:
        r = self.refined
        lines = [
            f"{r.places} places where surfaces meet: {r.gap_before:.3f} mm rms apart before, "
            f"{r.gap_after:.3f} mm after; {r.gap_noise:.3f} mm is noise"
        ]
        if r.shape_before > 0:
            lines.append(
                f"what the rig measures may be bent by {r.shape_after:.3f} mm (rms), "
                f"{r.shape_before:.3f} mm before"
            )
        lines += [f"  {what}: {amount}" for what, amount, _ in r.worded]
        if r.dropped:
            lines.append(f"not asked for by the scan: {r.left_out}")
        if r.held:
            lines.append(f"the scan says little or nothing of: {'; '.join(r.advice.undetermined)}")
        if "scale" in r.held:
            lines.append(
                "shapes and angles are right up to scale: all lengths may be off by one factor, "
                "until one length of the part is given"
            )
        lines.append(f"what would help most: {r.advice.text}")
        return "\n".join([*lines, f"{self.path}: written"])

    def figures(self) -> str:
        """All of it as JSON, unrounded; mm and radians."""
        r = self.refined
        return json.dumps(
            {
                "places": r.places,
                "gap_before_mm": r.gap_before,
                "gap_after_mm": r.gap_after,
                "gap_noise_mm": r.gap_noise,
                "shape_before_mm": r.shape_before,
                "shape_after_mm": r.shape_after,
                "estimated": {n: [m.value, m.sigma] for n, m in r.estimated.items()},
                "dropped": r.dropped,
                "held": r.held,
                "would_help": r.advice.text,
            },
            indent=1,
        )


def refine(
    scan: str | PathLike[str] | Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    options: RefineOptions | None = None,
    *,
    rig: Rig | str | PathLike[str] | None = None,
    artefact: str | PathLike[str] | None = None,
    report: str | PathLike[str] | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> RefinedRig:
    """Improve a rig by scans of any part, from two lasers, turns or poses, or of a known body.

    What two lasers see of one part is one surface: sheets and axis move within their uncertainty,
    and the table's own errors (harmonics of its turn, play) are estimated where the scan demands
    them, until the surfaces agree. Of a part that was laid down again between two scans, one laser
    says as much: how it lay is found. A body whose form is known (sphere, ball bar, tilted cylinder
    or cone, drawn part) must come out as it is; its known lengths give the scale.

    Parameters
    ----------
    scan
        The scan file, or several of one part in different poses (`turnscan.join`). The part should
        not be round about the table's axis.
    output
        The rig file to write, ``….json``.
    options
        What may move, and what is known of the part.
    rig
        The rig to begin with; None takes the one in the scan. A rig without uncertainties keeps
        sheets and axis as they are.
    artefact
        File of a measured sphere or ball bar, as `verify` takes it, or of a drawn part (STL, STEP).
    report
        HTML report to write, ``….html``.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``sphere=40.0``.

    Returns
    -------
    RefinedRig
        What was estimated, with uncertainties, and what the scan says nothing of.

    Raises
    ------
    InputError
        Where no such file, or scan and rig do not fit, or this scan refined the rig before, or a
        scan is given twice, or poses do not overlap.
    CalibrationError
        Degenerate where no surfaces overlap, DidNotConverge.

    >>> import turnscan as ts
    >>> ts.refine("none.turnscan", "better.json")
    Traceback (most recent call last):
    turnscan.errors.InputError: none.turnscan: no such file → check the name
    """
    paths = [Path(one) for one in ([scan] if isinstance(scan, str | PathLike) else scan)]
    output = Path(output)
    wanted = chosen(RefineOptions, options, changes)
    body = _checked(paths, output, wanted, artefact)
    page = _page_checked(report, [*paths, output], artefact)
    begin = rig if rig is None or isinstance(rig, Rig) else read_rig_file(rig)
    seen = list[_Seen]()
    for k, path in enumerate(paths):
        part = progress.subrange(_DETECTION * k / len(paths), _DETECTION * (k + 1) / len(paths))
        seen.append(_seen(path, begin, seen, part))
    first = seen[0].rig
    lies = _placed(seen, progress.subrange(_DETECTION, _PLACED))
    sweeps = [replace(w, pose=k) for k, one in enumerate(seen) for w in one.sweeps]
    limits = RefineSettings(wanted.camera, not wanted.table_only, body)
    part = progress.subrange(_PLACED, 1, "fitting the surfaces")
    done = _adjusted(first, sweeps, limits, lies, part)
    evidence = (*first.evidence, *(one.evidence for one in seen))
    done = replace(done, rig=replace(done.rig, evidence=evidence))
    if page is not None:
        _write_report(page, done, [p.name for p in paths])
    write_atomically(output, rig_to_json(done.rig).encode())
    return RefinedRig(output, done)


def _write_report(page: Path, done: Refined, names: Sequence[str]) -> None:
    from turnscan.workflows._calibration._refine_report import refine_html

    write_atomically(page, refine_html(done, names).encode())


def _page_checked(
    report: str | PathLike[str] | None,
    others: Sequence[Path],
    artefact: str | PathLike[str] | None,
) -> Path | None:
    """The path of the report, which is none of the files that are read or written."""
    if report is None:
        return None
    page = Path(report)
    check_output(page, (".html",), [*others, *([Path(artefact)] if artefact is not None else [])])
    return page


@dataclass(frozen=True)
class _Seen:
    """One scan, as observations of its rig."""

    rig: Rig
    evidence: str
    sweeps: list[Sweep]
    name: str
    surfaces: list[RangeSurface]
    """What the search for how the part lay goes by."""


def _checked(
    paths: Sequence[Path],
    output: Path,
    wanted: RefineOptions,
    artefact: str | PathLike[str] | None,
) -> Body | None:
    """What the part is; raises InputError for what can be seen before a scan is read."""
    if not paths:
        raise InputError("no scan", hint="give one, or several of one part in different poses")
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: no such file", hint="check the name")
    check_output(output, (".json",), [*paths, *([Path(artefact)] if artefact is not None else [])])
    body = body_of(wanted, artefact)
    if body is not None and len(paths) > 1:
        raise InputError(
            f"{len(paths)} scans, and a body of known form",
            hint="a known body needs no second pose: refine by one scan, then by the next",
        )
    return body


def _seen(path: Path, rig: Rig | None, before: Sequence[_Seen], progress: Progress) -> _Seen:
    """Raises InputError for a scan that counted before, or that another rig made."""
    with Scan.open(path) as opened:
        begin = rig_for(opened, rig)
        evidence = opened.digest
        if evidence in begin.evidence:
            raise InputError(
                f"{path}: this rig was refined by this scan before, and it would count twice",
                hint="begin with the rig as it was before, or take another scan",
            )
        if any(one.evidence == evidence for one in before):
            raise InputError(
                f"{path}: the same scan is given twice", hint="give each pose of the part once"
            )
        if before and rig_hash(before[0].rig) != rig_hash(begin):
            raise InputError(
                f"{path}: it was made with another rig than the first scan",
                hint="give the rig of both",
                option=Option("rig"),
            )
        settings = kept_options(opened).settings(begin, opened)
        looks = sum(len(lit_in(n, begin)) * len(opened.steps(n)) for n in opened.plan.lasers)
        tick = progress.subrange(0, 1, f"finding the stripes of {path.name}").counter(looks)
        # Its angles are wanted as they were told: the motion that is known comes on top again.
        still = replace(begin, motion=None)
        found = detect_scan(opened, still, settings.stripes, settings.volume, tick)
    whole = to_grids(found, settings).grids
    grids = [drop_uncertain(grid, settings.largest_sigma)[0] for grid in whole]
    surfaces = [one for g in grids for one in range_surfaces(g, settings.tears)]
    return _Seen(begin, evidence, _sweeps(found, grids, settings), path.name, surfaces)


def _placed(seen: Sequence[_Seen], progress: Progress) -> list[tuple[Pose, ...]]:
    """Where the part lay in the second pose and those that follow, by the shape that was seen; of
    two scans of a part that is alike from several sides, each way.

    The surfaces are as wrong as the rig, and agree no better. How much of its uncertainty bends
    shapes is not known: little at first, and more where they fit nowhere, or fit in several ways.
    """
    if len(seen) < 2:
        return [()]
    doubt = [max(_doubt(sweep, one.rig) for sweep in one.sweeps) for one in seen]
    plain = [poses.view(one.name, one.surfaces) for one in seen]
    refused: InputError | None = None
    several: list[tuple[Pose, ...]] = []
    for k, share in enumerate(_BENT):
        part = progress.subrange(k / len(_BENT), (k + 1) / len(_BENT), "placing the poses")
        views = [
            replace(v, sigma=np.hypot(v.sigma, share * d))
            for v, d in zip(plain, doubt, strict=True)
        ]
        if len(views) == 2:
            found = [[Pose(), way] for way in poses.ways(*views)]
            done = [tuple(poses.align(views, one).poses[1:]) for one in found[:_MOST_WAYS]]
            part(1.0)
            if len(done) == 1:
                return done
            several = several or done
            continue
        try:
            placed = poses.place(views, part.counter(len(views)))
            return [tuple(poses.align(views, placed).poses[1:])]
        except InputError as error:
            refused = refused or error
    if several:
        return several
    raise refused or InputError(
        f"{seen[1].name}: no place where its surface agrees with {seen[0].name}",
        hint="scan poses that overlap by a third, of a part with a shape that fits in few ways",
    )


def _adjusted(
    rig: Rig,
    sweeps: Sequence[Sweep],
    limits: RefineSettings,
    lies: Sequence[tuple[Pose, ...]],
    progress: Progress,
) -> Refined:
    """The rig by the way of laying the part down whose surfaces agree best.

    Raises InputError where another way says as well that the rig is another one.
    """
    if len(lies) == 1:
        return adjust_rig(rig, sweeps, replace(limits, poses=lies[0]), progress)
    tried, failed = list[tuple[Refined, tuple[Pose, ...]]](), list[CalibrationError]()
    tick = progress.subrange(0, _TRIALS).counter(len(lies))
    for way in lies:
        quick = replace(limits, poses=way, rounds=_QUICK_ROUNDS, queries=_QUICK.queries)
        try:
            tried.append((adjust_rig(rig, sweeps, quick), way))
        except CalibrationError as error:
            failed.append(error)
        tick()
    if not tried:
        raise failed[0]
    best, way = min(tried, key=lambda one: one[0].gap_after / one[0].gap_noise)
    for other, _ in tried:
        if other.gap_after < _AS_WELL * best.gap_after and _differ(best, other):
            raise InputError(
                "the part may have been laid down in several ways, and they say that the rig is a "
                "different one",
                hint="take a part with a shape that fits in one way",
            )
    part = progress.subrange(_TRIALS, 1)
    return adjust_rig(rig, sweeps, replace(limits, poses=way), part)


def _differ(one: Refined, other: Refined) -> bool:
    """Whether two rigs are farther apart than their uncertainties explain."""
    unknown = Measured(0.0, 0.0)
    for name in {*one.estimated, *other.estimated}:
        a, b = (r.estimated.get(name, unknown) for r in (one, other))
        if abs(a.value - b.value) > _UNLIKE * math.hypot(a.sigma, b.sigma):
            return True
    return False


def _doubt(sweep: Sweep, rig: Rig) -> float:
    """mm rms by which a rig, and a table that nothing measured, may put points aside."""
    off = sweep.doubt(rig)
    if not sweep.moved or rig.motion is not None or not len(sweep.pixels):
        return off
    at = sweep.points(rig, rig.camera.rays(sweep.pixels))
    return math.hypot(off, _TABLE * float(np.median(np.hypot(at[:, 0], at[:, 1]))))


def _sweeps(
    seen: Sequence[Detection], grids: Sequence[RangeGrid], settings: Settings
) -> list[Sweep]:
    told = {
        d.view.laser: d.stripes.angle_sigma is None or bool(np.isnan(d.stripes.angle_sigma).all())
        for d in seen
    }
    across = 0 if settings.stripes.orientation == "vertical" else 1
    rigs = {d.view.laser: d.view.rig for d in seen}
    return [_sweep(g, rigs[g.laser], told[g.laser], across) for g in grids if g.found.any()]


def _sweep(grid: RangeGrid, rig: Rig, told: bool, across: int) -> Sweep:
    step, line = np.nonzero(grid.found)
    at = grid.points[step, line]
    pixels = points.pixels_of(rig, at, grid.angles[step])
    _, scale = points.triangulate(rig, grid.laser, pixels, np.ones(len(at)), across=across)
    sigma = grid.sigma[step, line] / scale
    good = np.isfinite(pixels).all(axis=1) & np.isfinite(sigma) & (sigma > 0)
    return Sweep(
        grid.laser, pixels[good], sigma[good], step[good].astype(np.int32), grid.angles,
        told, across,
    )  # fmt: skip


def table_findings(seen: Sequence[Detection], grids: Sequence[RangeGrid]) -> list[Finding]:
    """Whether two lasers contradict the angles that were commanded, nothing having seen them.

    One quick round of `turnscan.calibrate.refine`, of the table's errors alone.
    """
    known = {d.view.laser: d for d in seen}
    told = [
        d for d in seen if d.stripes.angle_sigma is None or np.isnan(d.stripes.angle_sigma).all()
    ]
    if len(told) < 2 or any(d.view.rig.motion is not None for d in told):
        return []
    some = [g for g in grids if g.laser in known and g.found.sum() > 100]
    if len({g.laser for g in some}) < 2:
        return []
    across = 0 if seen[0].view.settings.orientation == "vertical" else 1
    sweeps = [_sweep(g, known[g.laser].view.rig, True, across) for g in some]
    try:
        quick = adjust_rig(known[some[0].laser].view.rig, sweeps, _QUICK)
    except CalibrationError:
        return []
    motion = quick.rig.motion
    if motion is None or not np.any(motion.values):
        return []
    turn = np.linspace(0.0, 2 * np.pi, 361)
    off = motion.angle(turn) - turn
    return [
        Finding(
            "scan.table-uneven",
            "warning",
            f"two lasers see the part turned against itself: the table is up to "
            f"{math.degrees(float(np.ptp(off)) / 2):.2f}° off the commanded angles "
            f"(surfaces {quick.gap_before:.3f} mm apart, {quick.gap_noise:.3f} mm is noise)",
            where=", ".join(dict.fromkeys(g.laser for g in some)),
            remedy="estimate the table's errors with turnscan refine, and reconstruct with the rig "
            "that it writes",
        )
    ]
