"""Test values of a scanner on an artefact: what each is, and its uncertainty.

The definitions follow what is published of VDI/VDE 2634 parts 2 and 3 and of ISO 10360-8 and -13
(summaries and secondary literature). The texts of these standards were not read: a value computed
here is a figure to compare a scanner with itself and with a limit of one's own, and no statement of
conformity to any standard.

=============  =====================================================================================
form           Probing error of form: largest minus smallest distance of the points of a ball from
               its unconstrained least-squares sphere, without the 0.3 % furthest off.
form95         Width of the thinnest shell, concentric with that sphere, that holds 95 % of the
               points.
size           Probing error of size: diameter of that sphere minus the diameter of the artefact.
distance       Sphere distance error: distance of two such centres minus that of the artefact.
flatness       Largest minus smallest distance of the points of a face from its least-squares plane,
               without the 0.3 % furthest off.
thickness      Distance of two opposite faces (planes of one common normal) minus the artefact's.
height         Height of a level above the first (planes of one common normal) minus the artefact's.
repeatability  Standard deviation of one of these over several scans.
=============  =====================================================================================

Three parts of the standard uncertainty are kept apart. **noise**: the scatter of the points about
the fit, enlarged where neighbours share their errors; a new scan would differ by this much.
**calibration**: how far the value moves within the uncertainty of the rig's own calibration, which
all scans with this rig have in common. **artefact**: what is not known of the artefact. Expanded by
k = 2, an error of size, distance, thickness or height that is larger is more than all that is known
explains. The uncertainty of form, form95 and flatness is that of the mean of many such scans.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot, isnan, nan, sqrt

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.shapes.verification._artefact import Artefact, Length, Test
from turnscan.shapes.verification._balls import Ball, ball_moves, find_balls
from turnscan.shapes.verification._faces import (
    Face,
    Levels,
    face_moves,
    find_faces,
    level_moves,
    levels_of,
)
from turnscan.shapes.verification._statistics import range_sigma, shell, shell_sigma, trimmed_range
from turnscan.shapes.verification._survey import Index, Survey

_SOME = 1000
"""Points of a ball or face by which the calibration's part is computed."""
_TOLERANCE, _MARGIN = 0.5, 2.0
"""mm: of a plate's faces."""


@dataclass(frozen=True)
class TestValue:
    """One test value, mm, with the parts of its standard uncertainty."""

    __test__ = False  # no test of pytest's

    test: Test
    where: str
    """Of which ball, face or level."""
    value: float
    noise: float
    calibration: float
    """NaN where the calibration of the rig is not known."""
    artefact: float
    limit: float | None
    """What the value may be at most, either way; None where not given."""
    points: int
    left_out: float
    """Share of the points found there that do not count."""

    @property
    def name(self) -> str:
        """Test and place, which name the value in a history."""
        return f"{self.test} of {self.where}"

    @property
    def sigma(self) -> float:
        """mm: standard uncertainty, of the parts that are known."""
        return hypot(
            self.noise, 0.0 if isnan(self.calibration) else self.calibration, self.artefact
        )

    @property
    def expanded(self) -> float:
        """mm: uncertainty expanded by k = 2, about 95 %."""
        return 2.0 * self.sigma

    @property
    def exceeded(self) -> bool:
        """Whether the value lies beyond its limit: the value alone decides (simple acceptance)."""
        return self.limit is not None and abs(self.value) > self.limit

    @property
    def verdict(self) -> str:
        """In words; ``barely`` where the limit lies within the expanded uncertainty."""
        if self.limit is None:
            return "no limit"
        sure = abs(abs(self.value) - self.limit) > self.expanded
        return ("fail" if self.exceeded else "pass") + ("" if sure else ", within the uncertainty")


def values_of(artefact: Artefact, survey: Survey) -> list[TestValue]:
    """All values that one scan of an artefact gives, as this module defines them.

    Raises InputError where the artefact is not to be found in the scan.
    """
    if artefact.kind in ("sphere", "ball-bar"):
        balls = find_balls(survey, [d.value for d in artefact.diameters])
        return ball_values(artefact, survey, balls)
    if artefact.kind == "plate":
        faces = find_faces(survey, _TOLERANCE, _MARGIN)
        want = [] if artefact.thickness is None else [artefact.thickness]
    else:
        want = list(artefact.heights)
        step = float(np.diff([0.0, *(h.value for h in want)]).min())
        faces = find_faces(survey, min(_TOLERANCE, step / 4), min(_MARGIN, step / 2))
    if not faces:
        raise InputError(
            f"no flat face was found among {len(survey.points)} points",
            hint="is this the artefact, and this its file?",
        )
    if not want:
        return face_values(artefact, survey, faces[:1])
    return level_values(artefact, survey, levels_of(survey, faces, [h.value for h in want]), want)


def ball_values(artefact: Artefact, survey: Survey, balls: Sequence[Ball]) -> list[TestValue]:
    """form, form95 and size of balls, and the distance of two."""
    made, centres = list[TestValue](), list[Floats]()
    for k, (ball, diameter) in enumerate(zip(balls, artefact.diameters, strict=True), start=1):
        some = _some(ball.index)
        p, bent = ball_moves(survey, ball, some)
        centres.append(p[:, :3])
        where = f"ball {k}" if len(balls) > 1 else "the ball"
        made += _form(artefact, "form", where, ball, bent, survey)
        error = 2 * ball.sphere.radius - diameter.value
        noise = 2 * sqrt(float(ball.sphere.covariance[3, 3]))
        common = 2 * _root(p[:, 3], survey)
        made.append(
            TestValue(
                "size", where, error, noise, common, diameter.sigma, artefact.limits.get("size"),
                len(ball.index), ball.left_out,
            )
        )  # fmt: skip
    if len(balls) == 2 and artefact.distance is not None:
        a, b = (ball.sphere for ball in balls)
        apart = b.centre - a.centre
        way = apart / np.linalg.norm(apart)
        both = a.covariance[:3, :3] + b.covariance[:3, :3]
        common = _root((centres[1] - centres[0]) @ way, survey)
        made.append(
            TestValue(
                "distance", "the balls", float(np.linalg.norm(apart)) - artefact.distance.value,
                sqrt(float(way @ both @ way)), common, artefact.distance.sigma,
                artefact.limits.get("distance"), a.count + b.count,
                max(ball.left_out for ball in balls),
            )
        )  # fmt: skip
    return made


def face_values(artefact: Artefact, survey: Survey, faces: Sequence[Face]) -> list[TestValue]:
    """flatness of faces."""
    made = list[TestValue]()
    for k, face in enumerate(faces, start=1):
        some = _some(face.index)
        bent = face_moves(survey, face, some, face.plane.normal)[1]
        where = f"face {k}" if len(faces) > 1 else "the face"
        made += _form(artefact, "flatness", where, face, bent, survey)
    return made


def level_values(
    artefact: Artefact, survey: Survey, levels: Levels, want: Sequence[Length]
) -> list[TestValue]:
    """flatness of the faces of levels, and their heights above the first; a plate's is its
    thickness."""
    made = face_values(artefact, survey, levels.faces)
    test: Test = "thickness" if artefact.kind == "plate" else "height"
    moved = level_moves(survey, levels, [_some(f.index) for f in levels.faces])
    for k, known in enumerate(want):
        where = "the plate" if test == "thickness" else f"level {k + 2}"
        face = levels.faces[k + 1]
        made.append(
            TestValue(
                test, where, float(levels.heights[k]) - known.value, float(levels.sigma[k]),
                _root(moved[:, k], survey), known.sigma, artefact.limits.get(test),
                len(face.index), face.left_out,
            )
        )  # fmt: skip
    return made


def repeatability(
    scans: Sequence[Sequence[TestValue]], limit: float | None = None
) -> list[TestValue]:
    """The standard deviation of each value over at least two scans, in the order of the first.

    Its own standard uncertainty is s/√(2(n − 1)), for values that scatter normally.
    """
    made = list[TestValue]()
    for first in scans[0] if len(scans) > 1 else ():
        all_of = [v.value for scan in scans for v in scan if v.name == first.name]
        if len(all_of) < 2:
            continue
        s = float(np.std(all_of, ddof=1))
        noise = s / sqrt(2 * (len(all_of) - 1))
        made.append(
            replace(
                first, test="repeatability", where=first.name, value=s, noise=noise,
                calibration=0.0, artefact=0.0, limit=limit, points=len(all_of), left_out=0.0,
            )
        )  # fmt: skip
    return made


def _form(
    artefact: Artefact, test: Test, where: str, seen: Ball | Face, bent: Floats, survey: Survey
) -> list[TestValue]:
    """The range of the residuals, and for balls their shell; both of as many as count."""
    r, n = seen.residual, len(seen.index)
    own = artefact.form / sqrt(3.0)  # anything up to its own form error
    some = r[_spread(n)]
    wide = sqrt(seen.clumping)

    def made(test: Test, width: Callable[[Floats], float], noise: float) -> TestValue:
        value, here = width(r), width(some)
        changes = [max(abs(width(some + s * b) - here) for s in (1.0, -1.0)) for b in bent]
        common = _root(np.array(changes), survey)
        limit = artefact.limits.get(test)
        return TestValue(test, where, value, noise, common, own, limit, n, seen.left_out)

    values = [made(test, trimmed_range, wide * range_sigma(r))]
    if test == "form":
        values.append(made("form95", shell, wide * shell_sigma(r)))
    return values


def _some(index: Index) -> Index:
    some: Index = index[_spread(len(index))]
    return some


def _spread(count: int) -> Index:
    return np.unique(np.linspace(0, count - 1, _SOME).astype(np.intp))


def _root(moves: Floats, survey: Survey) -> float:
    """The root of the sum of squares of independent moves; NaN where they are unknown."""
    return nan if survey.moves is None else float(np.sqrt((moves**2).sum()))
