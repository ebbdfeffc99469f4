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
from turnscan.surface.fusion import RangeSurface, range_surfaces
from turnscan.workflows._declare import chosen
from turnscan.workflows._files import check_output, write_atomically
from turnscan.workflows._kept_options import kept_options
from turnscan.workflows._reading import read_rig_file
from turnscan.workflows._refine_body import Body, body_of
from turnscan.workflows._refine_options import RefineOptions

_DETECTION, _PLACED = 0.6, 0.65
"""Of the work, until all stripes are found, and until it is known how the part lay."""
_BENT = (0.0, 0.1, 0.2, 0.3)
"""Of the distance by which a rig may put points beside their places: how much of it bends shapes,
instead of moving them as a whole."""
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
        lines += [f"  {name}: {_worded(name, m)}" for name, m in r.estimated.items()]
        if r.dropped:
            lines.append(f"not asked for by the scan: {', '.join(r.dropped)}")
        if r.held:
            lines.append(f"the scan says little or nothing of: {', '.join(r.held)}")
        if "scale" in r.held:
            lines.append(
                "shapes and angles are right up to scale: all lengths may be off by one factor, "
                "until one length of the part is given"
            )
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
                "estimated": {n: [m.value, m.sigma] for n, m in r.estimated.items()},
                "dropped": r.dropped,
                "held": r.held,
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
    begin = rig if rig is None or isinstance(rig, Rig) else read_rig_file(rig)
    seen = list[_Seen]()
    for k, path in enumerate(paths):
        part = progress.subrange(_DETECTION * k / len(paths), _DETECTION * (k + 1) / len(paths))
        seen.append(_seen(path, begin, seen, part))
    first = seen[0].rig
    lies = _placed(seen, progress.subrange(_DETECTION, _PLACED))
    sweeps = [replace(w, pose=k) for k, one in enumerate(seen) for w in one.sweeps]
    limits = RefineSettings(wanted.camera, not wanted.table_only, body, poses=lies)
    part = progress.subrange(_PLACED, 1, "fitting the surfaces")
    done = adjust_rig(first, sweeps, limits, part)
    evidence = (*first.evidence, *(one.evidence for one in seen))
    done = replace(done, rig=replace(done.rig, evidence=evidence))
    write_atomically(output, rig_to_json(done.rig).encode())
    return RefinedRig(output, done)


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
    grids = to_grids(found, settings).grids
    surfaces = [one for g in grids for one in range_surfaces(g, settings.tears)]
    return _Seen(begin, evidence, _sweeps(found, grids, settings), path.name, surfaces)


def _placed(seen: Sequence[_Seen], progress: Progress) -> tuple[Pose, ...]:
    """Where the part lay in the second pose and those that follow, by the shape that was seen.

    The surfaces are as wrong as the rig, and agree no better. How much of its uncertainty bends
    shapes is not known: little at first, and more where they fit nowhere, or fit in several ways.
    """
    if len(seen) < 2:
        return ()
    doubt = [max(sweep.doubt(one.rig) for sweep in one.sweeps) for one in seen]
    plain = [poses.view(one.name, one.surfaces) for one in seen]
    refused: InputError | None = None
    for k, share in enumerate(_BENT):
        part = progress.subrange(k / len(_BENT), (k + 1) / len(_BENT), "placing the poses")
        views = [
            replace(v, sigma=np.hypot(v.sigma, share * d))
            for v, d in zip(plain, doubt, strict=True)
        ]
        try:
            found = poses.place(views, part.counter(len(views)))
            return tuple(poses.align(views, found).poses[1:])
        except InputError as error:
            refused = refused or error
    assert refused is not None
    raise refused


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


def _worded(name: str, m: Measured) -> str:
    angle = name.startswith("motion.") or ".turn_" in name or name.endswith("angle")
    unit = "°" if angle else " mm"
    value, sigma = (math.degrees(m.value), math.degrees(m.sigma)) if angle else (m.value, m.sigma)
    return f"{value:+.4f} ± {sigma:.4f}{unit}"
