"""Where a body of known form stands in a scan to begin with, and which points lie on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._bodies import Balls, Body, Form, Known, Round
from turnscan.calibrate._part import Part
from turnscan.calibrate._sweeps import Sweep
from turnscan.errors import Degenerate
from turnscan.rig import Pose, Rig

_ROUNDS, _STEPS = 20, 12
_OFF = 3.0
"""Times the usual distance: a point farther off lies on something else."""
_LEAST = 0.3
"""Of the points of the scan: fewer on the body, and something else was scanned."""
_ALIKE, _SURE = 0.2, 3.0
"""Of a size that is known, and of what is uncertain of it: one that differs by more is of something
else."""
_WALL = 0.9
"""Of the points, on a cylinder or cone: edges beside its wall would bend it."""
_MOST = 0.5
"""Of the points, on a drawn part: of another one some faces fit as well."""
_TIMES = 8.0
"""By which a drawn part may be larger than what the scan shows, or smaller."""
_NEAR = 0.1
"""Of its radius: what is nearer to a ball lies on it."""
_FEW = 4000
_LEANS = np.radians(np.arange(0.0, 91.0, 15.0))


def find_body(
    form: Form,
    known: Sequence[Known | None],
    sweeps: Sequence[Sweep],
    rig: Rig,
    doubt: float = 0.0,
) -> Body:
    """The body of that form that most of the points lie on.

    ``doubt`` mm is how far the rig may put a point beside its place: so far a size may be off.

    Raises Degenerate where there is none of about the sizes that are known.
    """
    at = [s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps]
    # What one sweep sees is one body, also where two lasers do not agree yet.
    each = [_found(form, a, known) for a in at]
    body, inside = max(each, key=lambda one: np.count_nonzero(one[1]))
    share = np.count_nonzero(inside) / len(inside)
    if share < _LEAST or not _alike(form, body.sizes, known, doubt):
        names = form.size_names
        wanted = ", ".join(
            _worded(n, k[0]) for n, k in zip(names, known, strict=True) if k is not None
        )
        found = ", ".join(_worded(n, float(v)) for n, v in zip(names, body.sizes, strict=True))
        raise Degenerate(
            f"the points lie on no {form.name} of {wanted or 'any size'}: one of {found} takes "
            f"{share:.0%} of them",
            hint=f"scan the {form.name} alone, and give its sizes",
        )
    return replace(body, points=tuple(np.flatnonzero(e[1]) for e in each))


def _worded(name: str, value: float) -> str:
    if name.endswith("angle"):
        return f"{np.degrees(value):.1f}°"
    radius = name.startswith("radius")
    return f"{2 * value if radius else value:.4g} mm"


def again(body: Body, at: Sequence[Floats]) -> Body:
    """The same body, with those of the points of each sweep that lie on it now."""
    away = np.concatenate([body.distance(a)[0] for a in at])
    inside = _inside(away)
    cuts = np.cumsum([len(a) for a in at])[:-1]
    return replace(body, points=tuple(np.flatnonzero(p) for p in np.split(inside, cuts)))


def refuse_other_unit(part: Part, points: Floats, doubt: float) -> None:
    """Raises Degenerate where a drawn part is not nearly as large as what was scanned."""
    drawn = float(np.linalg.norm(np.ptp(part.mesh.vertices[part.mesh.faces.ravel()], axis=0)))
    low, high = np.quantile(points, (0.02, 0.98), axis=0)
    seen = float(np.linalg.norm(high - low))
    if seen > _TIMES * drawn + 2 * doubt or drawn > _TIMES * (seen + 2 * doubt):
        raise Degenerate(
            f"the drawn part has a diagonal of {drawn:.3g} mm, what was scanned one of about "
            f"{seen:.3g} mm",
            hint="give the part that was scanned, with lengths in mm",
        )


def refuse_ends(body: Body, count: int) -> None:
    """Raises Degenerate where a cylinder or cone is not all that the ``count`` points lie on, or a
    drawn part not what most of them do."""
    share = sum(len(p) for p in body.points) / count
    if isinstance(body.form, Part) and share < _MOST:
        raise Degenerate(
            f"only {share:.0%} of the points lie on the drawn part: it, or something beside it, is "
            "not what was scanned",
            hint="give the part that was scanned, and scan it alone",
        )
    if isinstance(body.form, Round) and share < _WALL:
        raise Degenerate(
            f"{share:.0%} of the points lie on the {body.form.name}: its ends or other things were "
            "seen, too",
            hint=f"scan the wall of the {body.form.name} alone, with its ends out of sight",
        )


def _inside(away: Floats) -> Bools:
    """Those points (n,) of a form that are near to it, whatever else was scanned beside it."""
    off = np.abs(away)
    near = off[off <= 12 * np.quantile(off, 0.2)]  # all of them, or some on it and others not
    for _ in range(_ROUNDS):
        limit = max(_OFF * 1.4826 * float(np.median(near)), 1e-6)
        closer = off[off < limit]
        if len(closer) == len(near) or len(closer) < 10:
            break
        near = closer
    return off < limit


def _found(form: Form, points: Floats, known: Sequence[Known | None]) -> tuple[Body, Bools]:
    """The body as one sweep sees it, and which of its points (n, 3) lie on it."""
    some = points[np.unique(np.linspace(0, len(points) - 1, _FEW).astype(np.intp))]
    body = _begin(form, some, known)
    keep = _inside(body.distance(some)[0])
    for _ in range(_ROUNDS):
        before = keep
        for _ in range(_STEPS):
            away, _, by = body.distance(some[keep])
            step: Floats = np.linalg.lstsq(by, -away, rcond=1e-9)[0].astype(np.float64)
            body = body.moved(step)
            if np.abs(step).max(initial=0.0) < 1e-6:
                break
        keep = _inside(body.distance(some)[0])
        if (keep == before).all():
            break
    return body, _inside(body.distance(points)[0])


def _alike(form: Form, sizes: Floats, known: Sequence[Known | None], doubt: float) -> bool:
    """Whether sizes are about those that are known, for a rig that puts points ``doubt`` mm off."""
    for name, size, one in zip(form.size_names, sizes, known, strict=True):
        if one is None:
            continue
        rig = doubt / max(float(sizes[0]), 1e-9) if name.endswith("angle") else doubt
        if abs(size - one[0]) > max(_ALIKE * one[0], _SURE * float(np.hypot(one[1], rig))):
            return False
    return True


def _sphere(points: Floats) -> tuple[Floats, float]:
    """Centre and radius by |P|² = 2 c·P + (r² - c²), linear in c and r² - c²."""
    middle = points.mean(axis=0)
    P = points - middle
    design = np.concatenate([2 * P, np.ones((len(P), 1))], axis=1)
    solved = np.linalg.lstsq(design, (P**2).sum(axis=1), rcond=None)[0]
    centre = solved[:3]
    return centre + middle, float(np.sqrt(max(solved[3] + centre @ centre, 0.0)))


def _begin(form: Form, points: Floats, known: Sequence[Known | None]) -> Body:
    if isinstance(form, Balls):
        return _balls(form, points, known)
    assert isinstance(form, Round)  # a drawn part is placed by its own search
    return _round(form, points, known)


def _balls(form: Balls, points: Floats, known: Sequence[Known | None]) -> Body:
    """One ball by all points; of two, the patches are tried around some points, and the pair taken
    on whose balls most points lie. The first stands lower."""
    if form.count == 1:
        centre, radius = _sphere(points)
        return Body(form, Pose(np.eye(3), centre), np.array([radius]), tuple(known))
    usual = np.mean([k[0] for k in known[: form.count] if k is not None])
    found = []
    for seed in points[:: max(1, len(points) // 150)]:
        patch = points[np.linalg.norm(points - seed, axis=1) < usual]
        if len(patch) < 12:
            continue
        centre, radius = _sphere(patch)
        if abs(radius / usual - 1) < 2 * _ALIKE:
            near = np.abs(np.linalg.norm(points - centre, axis=1) - radius) < _NEAR * usual
            found.append((int(near.sum()), centre, radius))
    if not found:
        raise Degenerate(
            f"the points lie on no balls of about {2 * usual:.4g} mm",
            hint="scan the ball bar alone, and give its sizes",
        )
    found.sort(key=lambda one: -one[0])
    _, first, one = found[0]
    rest = [f for f in found if np.linalg.norm(f[1] - first) > usual]
    if not rest:
        raise Degenerate(
            "the points lie on one ball, where a bar has two",
            hint="set the bar up so that both of its balls are seen",
        )
    _, second, other = rest[0]
    if first[2] > second[2]:
        first, second, one, other = second, first, other, one
    along = second - first
    length = float(np.linalg.norm(along))
    return Body(form, Pose(_frame(along / length), first), np.array([one, other, length]),
                tuple(known))  # fmt: skip


def _frame(z: Floats) -> Floats:
    """(3, 3) a rotation whose third column is ``z``."""
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _round(form: Round, points: Floats, known: Sequence[Known | None]) -> Body:
    """The axis of those tried, 15° apart, about which a circle (growing along it) fits best."""
    some = points[:: max(1, len(points) // 800)]
    middle = some.mean(axis=0)
    best, body = np.inf, None
    for lean in _LEANS:
        turns = np.arange(0.0, 2 * np.pi, np.radians(15.0) / max(np.sin(lean), 0.26))
        for turn in turns if lean else (0.0,):
            z = np.array([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)])
            R = _frame(z)
            P = (some - middle) @ R
            columns = [2 * P[:, 0], 2 * P[:, 1], np.ones(len(P))]
            if form.conical:
                columns += [P[:, 2], P[:, 2] ** 2]
            solved = np.linalg.lstsq(
                np.stack(columns, axis=1), (P[:, :2] ** 2).sum(axis=1), rcond=None
            )[0]
            radius = float(np.sqrt(max(solved[2] + solved[0] ** 2 + solved[1] ** 2, 1e-12)))
            sizes = [radius]
            if form.conical:
                grows = solved[3] / (2 * radius)
                if grows < 0:
                    R = R @ np.diag([1.0, -1.0, -1.0])
                    solved[1] = -solved[1]
                sizes.append(float(np.arctan(abs(grows))))
            centre = middle + R[:, :2] @ solved[:2]
            tried = Body(form, Pose(R, centre), np.array(sizes), tuple(known))
            off = float(np.median(np.abs(tried.distance(some)[0])))
            if off < best:
                best, body = off, tried
    assert body is not None
    return body
