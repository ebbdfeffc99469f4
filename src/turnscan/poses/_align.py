"""Views brought together: the final refinement of all poses, its uncertainty and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, frozen
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.poses._fit import AGREE, LEAST, THROUGH, Fit, fit
from turnscan.poses._free_space import empty
from turnscan.poses._links import Links
from turnscan.poses._observability import (
    UndeterminedMotion,
    covariance,
    freedoms,
    held_motions,
    shifting,
)
from turnscan.poses._refine import (
    Asked,
    Equations,
    all_links,
    both_ways,
    equations,
    middles_of,
    near_ones,
    refine,
    samples_of,
)
from turnscan.poses._view import View, coarse
from turnscan.remedy import Option, Remedy
from turnscan.rig import Pose
from turnscan.threads import in_parts

_SAMPLES = 12_000
"""Points of each view that the final refinement uses at most."""
_ROUNDS = 15
"""Rounds of it; it starts from a solution already."""
_AWAY = 2.0
"""Lengths of the last links within which a point must lie when it begins, to take part in it."""
_WORTH = 200
"""Places that an overlap must have to be named."""
_LAST = 3.0
"""Length of the last links in usual spacings, …"""
_SIGMAS = 10.0
"""… and in usual sigmas, whichever is more."""


@dataclass(frozen=True)
class Meeting:
    """How two views lie to each other where both were measured."""

    first: str
    second: str
    points: int
    """Places compared."""
    mean: float
    """mm: how far the first lies outside the second."""
    rms: float
    """mm."""
    sigmas: float
    """The rms in combined sigma."""


@dataclass(frozen=True)
class Alignment:
    """Where each view belongs, in the frame of the first."""

    names: tuple[str, ...]
    poses: tuple[Pose, ...]
    """View's frame → frame of the first view."""
    middles: Floats
    """(n, 3) mm, common frame: the middle of each view, which its covariance is about."""
    covariance: Floats
    """(n, 6, 6) of each pose: turn (radians), shift (mm) of the middle, common frame; zero for the
    first, and along ``freedoms``. From the points' sigma and scatter, as if independent from point
    to point; an error of calibration is not in it."""
    freedoms: tuple[UndeterminedMotion, ...]
    """Motions that the surface does not determine; they are as the start left them."""
    meetings: tuple[Meeting, ...]
    """The overlaps."""
    fits: tuple[Fit, ...]
    """How each view lies on all the others."""

    def __post_init__(self) -> None:
        n = len(self.names)
        object.__setattr__(self, "middles", frozen(self.middles, (n, 3), "Alignment.middles"))
        cov = frozen(self.covariance, (n, 6, 6), "Alignment.covariance")
        object.__setattr__(self, "covariance", cov)

    def sigma(self, i: int, points: Floats, directions: Floats) -> Floats:
        """(k,) mm: standard uncertainty that the pose of view i gives points (k, 3) of the common
        frame along unit directions (k, 3)."""
        J = np.concatenate([np.cross(points - self.middles[i], directions), directions], axis=1)
        sigma: Floats = np.sqrt(np.einsum("ka,ab,kb->k", J, self.covariance[i], J))
        return sigma


def align(views: Sequence[View], starts: Sequence[Pose]) -> Alignment:
    """Bring views together from where they nearly are: all poses at once, the first stays.

    Point-to-plane over all overlaps (`refine`), each point weighted by its sigma. Motions that
    the surface does not determine stay as ``starts`` has them and are reported.

    Where a view does not belong, ``fits`` shows it; `check` makes an error of it.
    """
    step = coarse(views)
    rough = samples_of(views, step / 2, _SAMPLES // 8)
    usual = float(np.median(np.concatenate([v.sigma for v in views])))
    last = max(_LAST * max(v.spacing for v in views), _SIGMAS * usual)
    asked = both_ways(rough)
    poses = refine(views, starts, asked, (step, last))
    _, e, middles = _state(views, poses, asked, last)
    loose = freedoms(e, middles)
    held = held_motions(loose, len(views))
    if loose:  # noise has moved them meanwhile: again, without
        poses = refine(views, starts, asked, (step, last), held)
    fine = both_ways(samples_of(views, last / _LAST, _SAMPLES))
    fine = near_ones(views, poses, fine, _AWAY * last)
    poses = refine(views, poses, fine, (last, last), held, rounds=_ROUNDS)
    links, e, middles = _state(views, poses, fine, last)
    C = covariance(e, held)
    n = range(len(views))
    spaces = in_parts(lambda k, _: empty(views[k], step), len(views), len(views))
    fits = [fit(views, poses, spaces, rough, i, [j for j in n if j != i], step) for i in n]
    return Alignment(
        tuple(v.name for v in views),
        tuple(poses),
        middles,
        np.stack([C[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] for i in n]),
        tuple(loose),
        tuple(_meetings(views, links)),
        tuple(fits),
    )


def _state(
    views: Sequence[View], poses: Sequence[Pose], asked: Asked, reach: float
) -> tuple[list[Links], Equations, Floats]:
    links = all_links(views, poses, asked, reach)
    middles = middles_of(views, poses)
    return links, equations(links, middles), middles


def _meetings(views: Sequence[View], links: Sequence[Links]) -> list[Meeting]:
    """Both directions of each pair as one."""
    out = []
    for i, j in sorted({(min(k.i, k.j), max(k.i, k.j)) for k in links}):
        mine = [k for k in links if {k.i, k.j} == {i, j}]
        off = np.concatenate([k.offsets * (1 if k.i == i else -1) for k in mine])
        ratio = off / np.concatenate([k.sigma for k in mine])
        rms = [float(np.sqrt((x**2).mean())) for x in (off, ratio)]
        names = views[i].name, views[j].name
        out.append(Meeting(*names, len(off), float(off.mean()), *rms))
    return out


def check(found: Alignment, *, by_shape: bool = False) -> None:
    """Raise InputError for a view that does not lie on the others as noise allows.

    ``by_shape``: nothing but the surfaces told where the views belong, so that one that could be
    shifted along the others is refused too.
    """
    for i, (name, f) in enumerate(zip(found.names, found.fits, strict=True)):
        if by_shape and shifting(found.freedoms, i):
            loose = next(str(k) for k in found.freedoms if k.view == i)
            raise InputError(
                f"{name}: its overlap with the other poses has too little relief: {loose} is open",
                hint=Remedy(
                    "scan poses that overlap in more than flat or round sides, "
                    "or pick point pairs (",
                    Option("points"),
                    ")",
                ),
            )
        if f.shared < LEAST:
            raise InputError(
                f"{name}: {f.shared:.0%} of it lies on the other poses, at least {LEAST:.0%} must",
                hint="scan poses that overlap, or give better point pairs",
            )
        if f.agree < AGREE:
            raise InputError(
                f"{name}: only {f.agree:.0%} of its overlap agrees with the other poses",
                hint="this may be another part, or it moved during the scan; give better point "
                "pairs",
            )
        if f.through > THROUGH:
            raise InputError(
                f"{name}: {f.through:.0%} stands where another pose saw empty space",
                hint="this may be another part, or a wrong registration; give better point pairs",
            )


def alignment_findings(found: Alignment) -> list[Finding]:
    """What a person should know about poses brought together."""
    out = []
    for m in found.meetings:
        if m.points >= _WORTH:
            text = (
                f"{m.points} places measured in both lie {m.rms:.3f} mm rms apart "
                f"({m.sigmas:.1f} sigma), {m.mean:+.3f} mm on average"
            )
            out.append(Finding("poses.overlap", "note", text, f"{m.first} and {m.second}"))
    for f in found.freedoms:
        text = f"{f} is not determined: the surfaces can slide on each other"
        remedy = "if it matters, give point pairs or marker spheres"
        out.append(Finding("poses.free", "warning", text, found.names[f.view], remedy))
    return out
