"""Adjusted lines and circles, and stretches for splines → pieces that follow each other."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes._outline_bodies import Body
from turnscan.shapes._outline_curves import Arc, Joint, Line, Outline, Piece, Rest, Spline
from turnscan.shapes._outline_places import supported
from turnscan.shapes._outline_settled import Meet, Settled, corner, derived
from turnscan.shapes._outline_sizes import box_of, sizes_of
from turnscan.shapes._outline_splines import best_controls, fit_spline, local_direction

_TANGENT = float(np.cos(np.deg2rad(12.0)))
"""A spline goes on as its neighbour does where they differ by less, and that costs little."""
_FORGIVEN = 9.0
_ABOUT = 12
"""Points on either side that tell where two splines meet, at the least."""
_NAN = float("nan")
Known = tuple[bool, ...]
_NONE = Rest(0, 0.0, 0.0)


def assemble(s: Settled) -> Outline:
    """The outline, its sizes and their uncertainties."""
    known = supported(s)
    if s.closed and len(s.bodies) == 1 and s.bodies[0].kind == "arc":
        pieces: list[Piece] = [_circle(s)]
        numbers = [0]
    else:
        meets = _meets(s)
        pieces, numbers = [], []
        for k, piece in enumerate(_pieces(s, meets, known)):
            before = s.before(k)
            if before is not None and (m := meets[k]).joint == "corner":
                gap = float(np.linalg.norm(m.end - m.start))
                if gap > 1e-3 * s.tolerance:
                    pieces.append(
                        Line(m.end, m.start, _NAN, _NAN, _NAN, _NONE, "corner", link=True)
                    )
            numbers.append(len(pieces))
            pieces.append(piece)
    box, box_sigma = box_of(s, pieces, numbers, known)
    return Outline(
        tuple(pieces), s.closed, s.tolerance, float(np.median(s.noise.point)), s.noise.known,
        box, box_sigma, sizes_of(s, pieces, numbers, known), known.count(False),
    )  # fmt: skip


def _meets(s: Settled) -> list[Meet]:
    """Where each body begins, and at last where the last one ends."""
    found = []
    free = [_free_spline(s, b) if b.kind == "spline" else None for b in s.bodies]
    for k, b in enumerate(s.bodies):
        j = s.before(k)
        if j is None and s.closed and free[k] is not None:
            j = k
        ours = free[k]
        theirs = free[j] if j is not None else None
        if ours is None and (j is None or theirs is None):
            found.append(corner(s, k))
        elif j is None:
            assert ours is not None
            found.append(Meet(ours[0][0], ours[0][0], "end"))
        elif ours is not None and theirs is not None:
            at = (ours[0][0] + theirs[0][1]) / 2
            if (joint := _smooth(theirs[1][1], ours[1][0])) == "tangent":
                at, _ = _through(s, k)
            found.append(Meet(at, at, joint))
        elif theirs is not None:
            at = b.nearest((s.data(k, end=False) + theirs[0][1]) / 2)
            found.append(Meet(at, at, _smooth(theirs[1][1], b.direction(at))))
        else:
            assert ours is not None
            a = s.bodies[j]
            at = a.nearest((s.data(j, end=True) + ours[0][0]) / 2)
            found.append(Meet(at, at, _smooth(a.direction(at), ours[1][0])))
    last, k = free[-1], len(s.bodies) - 1
    if s.closed:
        found.append(found[0])
    else:
        at = last[0][1] if last is not None else s.bodies[k].nearest(s.data(k, end=True))
        found.append(Meet(at, at, "end"))
    return found


def _smooth(before: Floats, after: Floats) -> Joint:
    return "tangent" if float(before @ after) > _TANGENT else "corner"


def _stretch(s: Settled, b: Body) -> tuple[Floats, Floats]:
    rows = slice(b.ways[0], b.ways[1] + 1)
    return s.chain.points[rows], s.scale[rows]


def _free_spline(s: Settled, b: Body) -> tuple[Floats, Floats]:
    """(2, 2) mm: the ends of a spline by itself, and (2, 2) its unit directions there."""
    p, scale = _stretch(s, b)
    controls, _ = best_controls(p, scale, _price(s))
    c = fit_spline(p, scale, controls).control
    d = np.stack([c[1] - c[0], c[-1] - c[-2]])
    return c[[0, -1]], d / np.maximum(np.linalg.norm(d, axis=1), 1e-300)[:, None]


def _price(s: Settled) -> float:
    return 1.25 * float(np.log(max(int(np.isfinite(s.scale).sum()), 8)))


def _pieces(s: Settled, meets: list[Meet], known: Known) -> list[Piece]:
    found = list[Piece]()
    for k, b in enumerate(s.bodies):
        begin, end = meets[k].start, meets[k + 1].end
        if b.kind == "spline":
            found.append(_spline(s, k, meets))
        elif b.kind == "arc":
            found.append(_arc(s, k, begin, end, meets[k].joint))
        else:
            found.append(_line(s, k, (begin, end), meets[k].joint, known))
    return found


def _rest(s: Settled, k: int) -> Rest:
    b = s.bodies[k]
    off, _ = b.residuals(s.chain, b.p)
    return Rest(len(b.rows), float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()))


def _line(s: Settled, k: int, ends: tuple[Floats, Floats], joint: Joint, known: Known) -> Line:
    """Line ``k``; its length is not known where an end lies on one that is not ``known``."""
    b = s.bodies[k]
    covariance = b.covariance
    length = np.nan
    after = (k + 1) % len(s.bodies)
    kinds = {s.bodies[j].kind for j in (k - 1, after)}
    near = {(k - 1) % len(s.bodies), k, after}
    if (
        "spline" not in kinds
        and (s.closed or 0 < k < len(s.bodies) - 1)
        and len(s.bodies) > 1
        and all(known[j] for j in near)
    ):

        def value() -> float:
            return float(np.linalg.norm(corner(s, after).end - corner(s, k).start))

        length = derived(s, value, [(k - 1) % len(s.bodies), k, after])
    sigma = float(np.sqrt(covariance[1, 1]))
    return Line(*ends, sigma, float(np.sqrt(covariance[0, 0])), length, _rest(s, k), joint)


def _sweep(s: Settled, b: Body) -> float:
    """Radians that the points turn about the centre, counter-clockwise."""
    to = s.chain.points[b.ways[0] : b.ways[1] + 1] - b.p[:2]
    angle = np.unwrap(np.arctan2(to[:, 1], to[:, 0]))
    return float(angle[-1] - angle[0])


def _arc(s: Settled, k: int, begin: Floats, end: Floats, joint: Joint) -> Arc:
    b = s.bodies[k]
    first, last = (np.arctan2(*(at - b.p[:2])[::-1]) for at in (begin, end))
    seen = _sweep(s, b)
    sweep = float(last - first)
    sweep += 2 * np.pi * round((seen - sweep) / (2 * np.pi))
    sigma = np.sqrt(np.diag(b.covariance))
    return Arc(b.p[:2], float(b.p[2]), float(first), sweep, float(sigma[2]), sigma[:2],
               _rest(s, k), joint)  # fmt: skip


def _circle(s: Settled) -> Arc:
    b = s.bodies[0]
    first = np.arctan2(*(s.data(0, end=False) - b.p[:2])[::-1])
    sigma = np.sqrt(np.diag(b.covariance))
    return Arc(b.p[:2], float(b.p[2]), float(first), b.turns * 2 * np.pi, float(sigma[2]),
               sigma[:2], _rest(s, 0), "tangent")  # fmt: skip


def _spline(s: Settled, k: int, meets: list[Meet]) -> Spline:
    """The spline of body ``k`` between its joints, in their directions where that costs little."""
    b = s.bodies[k]
    p, scale = _stretch(s, b)
    controls, _ = best_controls(p, scale, _price(s))
    controls = max(controls, 6)
    ends = (meets[k].start, meets[k + 1].end)
    held: list[Floats | None] = [_direction(s, k, meets, False), _direction(s, k, meets, True)]
    plain = fit_spline(p, scale, controls, ends)
    for i in (0, 1):
        if held[i] is not None:
            only: list[Floats | None] = [None, None]
            only[i] = held[i]
            cost = fit_spline(p, scale, controls, ends, (only[0], only[1])).chi2 - plain.chi2
            if cost > _FORGIVEN * s.noise.shared:
                held[i] = None
    made = fit_spline(p, scale, controls, ends, (held[0], held[1]))
    point = s.noise.point[b.rows]
    sigma = float(np.median(point)) * np.sqrt(
        s.noise.shared * controls / max(len(b.rows), controls)
    )
    joint: Joint = meets[k].joint
    if joint == "tangent" and held[0] is None:
        joint = "corner"
    bare = Spline(made.control, made.knots, float(sigma), _NONE, joint)
    off = bare.distances(s.chain.points[b.rows])
    rest = Rest(len(b.rows), float(np.sqrt(np.mean(off**2))), float(off.max()))
    return Spline(made.control, made.knots, float(sigma), rest, joint)


def _direction(s: Settled, k: int, meets: list[Meet], end: bool) -> Floats | None:
    """(2,) unit: which way a spline has to go at its start or end; None where it is free."""
    meet = meets[k + 1] if end else meets[k]
    if meet.joint != "tangent":
        return None
    j = (k + 1) % len(s.bodies) if end else s.before(k)
    j = k if j is None else j
    other = s.bodies[j]
    if other.kind != "spline":
        return other.direction(meet.end)
    return _through(s, j if end else k)[1]


def _through(s: Settled, k: int) -> tuple[Floats, Floats]:
    """(2,) mm and (2,) unit: where a spline begins that smoothly goes on from one before it."""
    m, at = len(s.chain.points), s.bodies[k].ways[0]
    before = s.before(k)
    other = s.bodies[k if before is None else before]
    least = min(x.ways[1] - x.ways[0] for x in (s.bodies[k], other))
    wide = min(max(_ABOUT, least // 24), least)
    rows = np.arange(at - wide, at + wide + 1)
    if s.closed:
        rows = np.where(rows < 0, rows + m - 1, rows)
        rows = np.where(rows > m - 1, rows - (m - 1), rows)
    return local_direction(s.chain.points[rows], s.scale[rows], wide)
