"""A chain of a section → lines, arcs and splines within a tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Longs
from turnscan.errors import InputError
from turnscan.shapes._outline_assemble import assemble
from turnscan.shapes._outline_bodies import (
    Body,
    Tangency,
    adjust,
    arc_body,
    line_body,
    tangencies,
    used,
)
from turnscan.shapes._outline_borders import count_borders
from turnscan.shapes._outline_curves import Outline
from turnscan.shapes._outline_noise import Noise, chain_noise, default_tolerance
from turnscan.shapes._outline_places import place_numbers
from turnscan.shapes._outline_rounds import rounded
from turnscan.shapes._outline_settled import Settled
from turnscan.shapes._outline_splines import Span, spline_cost, with_splines
from turnscan.shapes._section import Chain

Index = npt.NDArray[np.intp]
_MOST_BREAKS = 1500
"""Points at which pieces may begin; of longer chains every second, third … one."""
_LINE, _ARC, _SKIP = 3.0, 4.0, 12.0
"""Parameters and the place where a piece begins, times `_prices`; a point that fits nothing."""
_GAP, _WIDEST_GAP = 3.0, 0.02
"""Median steps, and share of the whole: a longer way between two pieces is a line."""
_SMOOTH = float(np.cos(np.deg2rad(20.0)))
_BRIDGED = 4.0
"""Gaps that were filled are fitted across where they are no longer than so many steps."""
_SEAMS = 3
"""Places where a closed chain is opened in turn."""
_ENOUGH, _LEAST_SHARE = 40, 0.65
"""Points whose scatter says that sigma is too large; how much of it is believed at the least."""
_FREEFORM, _TURNED, _FEWEST = 0.5, float(np.deg2rad(120.0)), 6
"""Share of an outline that is spline from which on it is freeform; radians that an arc of it turns
by at the least, to be told as one; points that make it a spline instead."""
_KNOWN, _SPLINED, _STRAIGHT = 0.25, 8, float(np.deg2rad(45.0))
"""Of its radius, that an arc's standard uncertainty is at most: its curvature is four of its own
standard deviations from none, for the search takes the best of many stretches, each of which has
three by chance. Points of another that are a spline instead of a line; radians that it turns by at
least for that."""
_FLAT = 4e-3
"""Radians that an arc turns by at the least: half a thousandth of its length is its bow then."""
_ROUND = 5
"""Places of an arc at the least: the two on either side of an edge lie on a circle by symmetry."""
_POLYGON = 0.7
"""Of its radius, what a circle's chord is long at the most of a mesh without sigma:
nine sides are round, eight are not."""
_FORGIVEN = 16.0
"""Increase of chi2 for each tie that tangency may cost."""


def fit_outlines(chains: Sequence[Chain], tolerance: float | None = None) -> list[list[Outline]]:
    """The outlines of each chain: one, or one for each stretch between fillings, or none.

    A search over all ways to cut the chain into lines and arcs finds the cheapest in the sense of
    the Bayesian information criterion (Schwarz 1978), neighbours that one B-spline says better are
    joined, pieces that touch inside the noise are made tangent, and all lines
    and arcs of an outline are adjusted together. Only measured points count.

    ``tolerance`` mm is what a misfit may be; noise beyond it is forgiven. Without one it is, for
    each outline, three standard deviations of its points, at least 1e-4 of the size of all. What
    is no longer than its own noise, or closes round no area or a circle of unknown radius, has no
    outline. Uncertainties are those from the noise of the points, independent from vertex to
    vertex of the mesh but for what these share (`Chain.together`).

    Raises InputError for a tolerance that is not positive.
    """
    if tolerance is not None and not (tolerance > 0 and np.isfinite(tolerance)):
        raise InputError(f"tolerance {tolerance:g} mm", hint="give a positive length in mm")
    stretches = [
        [
            (part, closed, _fair(part, chain_noise(part, part.measured)))
            for part, closed in _stretches(chain)
        ]
        for chain in chains
    ]
    points = [c.points for c in chains]
    size = float(np.linalg.norm(np.ptp(np.vstack(points), axis=0))) if points else 0.0
    rows = [
        [
            _outline(*stretch, tolerance or default_tolerance(size, stretch[2]))
            for stretch in row
            if _resolved(*stretch)
        ]
        for row in stretches
    ]
    return [[o for o in row if o is not None] for row in rows]


def _resolved(chain: Chain, closed: bool, noise: Noise) -> bool:
    """Whether a stretch reaches further than its noise: nothing is known of what does not."""
    return closed or float(chain.steps.sum()) > noise.tolerance


def _stretches(chain: Chain) -> list[tuple[Chain, bool]]:
    """What was measured of a chain, opened where it is closed: then it ends at its first point."""
    filled = chain.filled.copy()
    short = _BRIDGED * float(np.median(chain.steps))
    m = len(chain.points)
    for run in chain.runs(filled=True):
        if (
            len(run) < m
            and float(np.linalg.norm(np.diff(chain.points[run], axis=0), axis=1).sum()) <= short
        ):
            filled[run[:-1]] = False
    found = []
    for run in replace(chain, filled=filled).runs(filled=False):
        if len(run) >= 2:
            ways = chain.filled[run[:-1]]
            found.append((replace(chain.part(run), filled=ways), bool(run[0] == run[-1])))
    return found


def _fair(chain: Chain, noise: Noise) -> Noise:
    """The noise, with the ``share`` of it that is seen about lines and arcs."""
    use = chain.measured
    if not noise.known or int(use.sum()) < _ENOUGH:
        return noise
    scale = np.where(use, noise.scale(0.0), np.inf)
    bodies = [_body(chain, use, scale, s) for s in _spans(chain, scale, noise.known)[0]]
    off = [b.residuals(chain, b.p)[0] / noise.point[b.rows] for b in bodies if len(b.rows) > 4]
    if not off:
        return noise
    seen = float(np.sqrt(np.mean(np.clip(np.concatenate(off), -4.0, 4.0) ** 2)))
    return replace(noise, share=float(np.clip(seen, _LEAST_SHARE, 1.0)))


def _outline(chain: Chain, closed: bool, noise: Noise, tolerance: float) -> Outline | None:
    """The outline of a stretch; None where a closed one encloses nothing that is known."""
    use = chain.measured
    scale = np.where(use, noise.scale(tolerance), np.inf)
    if closed:
        whole = _circle(chain, scale, noise.known)
        chain, scale, noise = _turned(chain, scale, noise, _farthest(chain.points))
        spans, cost = _spans(chain, scale, noise.known)
        opened = (chain, scale, noise)
        for start in _seams(spans, chain):
            trial = _turned(chain, scale, noise, start)
            found, price = _spans(*trial[:2], noise.known)
            if price < cost:
                opened, spans, cost = trial, found, price
        chain, scale, noise = opened
        if whole is not None and whole <= cost:
            spans = [("arc", 0, len(chain.points) - 1)]
    else:
        spans, _ = _spans(chain, scale, noise.known)
    use = np.isfinite(scale)
    bodies, ties = _bodies(chain, use, scale, noise, spans), list[Tangency]()
    bodies = _rounded(chain, scale, noise, bodies)
    if not _is_circle(bodies, closed):
        spans = _freed(chain, scale, bodies, closed)
        if (start := spans[0][1]) and closed:
            chain, scale, noise = _turned(chain, scale, noise, start)
            spans = [(kind, i - start, j - start) for kind, i, j in spans]
        use = np.isfinite(scale)
        bodies = _bodies(chain, use, scale, noise, spans)
        if _freeform(chain, bodies):
            spans = [("spline" if _by_chance(chain, b) else b.kind, *b.ways) for b in bodies]
            bodies = _bodies(chain, use, scale, noise, spans)
        else:
            bodies = _rounded(chain, scale, noise, bodies)
        ties = _ties(chain, scale, noise, bodies, closed, tolerance)
    count_borders(chain, bodies, ties, scale, noise, closed)
    while not (_is_circle(bodies, closed) or all(_known(chain, b) for b in bodies)):
        # The next may be known by this one alone.
        spans = [(b.kind if _known(chain, b) else _plainer(chain, b), *b.ways) for b in bodies]
        bodies = _bodies(chain, use, scale, noise, spans)
        ties = _ties(chain, scale, noise, bodies, closed, tolerance)
        count_borders(chain, bodies, ties, scale, noise, closed)
    if closed and not _encloses(chain, bodies):
        return None
    return assemble(Settled(chain, closed, bodies, ties, scale, noise, tolerance))


def _known(chain: Chain, body: Body) -> bool:
    """Whether it is no arc, or one whose radius is known. That of one which hardly turns has no
    uncertainty that could be computed: its bow is lost in the digits of its radius and middle."""
    if body.kind != "arc":
        return True
    if _length(chain, body) < _FLAT * float(body.p[2]):
        return False
    return bool(np.sqrt(body.covariance[2, 2]) <= _KNOWN * body.p[2])


def _plainer(chain: Chain, body: Body) -> str:
    """What an arc of unknown radius is instead."""
    bent = _length(chain, body) > _STRAIGHT * float(body.p[2])
    return "spline" if bent and len(body.rows) >= _SPLINED else "line"


def _encloses(chain: Chain, bodies: list[Body]) -> bool:
    """Whether a closed outline has an inside: two lines have none."""
    return len(bodies) > 2 or any(b.kind != "line" and _known(chain, b) for b in bodies)


def _is_circle(bodies: list[Body], closed: bool) -> bool:
    return closed and len(bodies) == 1 and bodies[0].kind == "arc"


def _farthest(points: Floats) -> int:
    return int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))


def _turned(chain: Chain, scale: Floats, noise: Noise, start: int) -> tuple[Chain, Floats, Noise]:
    """A closed chain that begins, and ends, at another of its points."""
    m = len(chain.points) - 1
    order = np.r_[np.arange(start, m), np.arange(start), start % m]
    ways = chain.filled[order[:-1]]
    turned = replace(chain.part(order), filled=ways)
    return (
        turned,
        scale[order],
        replace(noise, vertex=noise.vertex[order], point=noise.point[order]),
    )


def _prices(scale: Floats) -> float:
    """What a parameter costs: the search looks at many places, so it is dearer than ½ log n."""
    return 1.25 * float(np.log(max(int(np.isfinite(scale).sum()), 8)))


def _circle(chain: Chain, scale: Floats, known: bool) -> float | None:
    """The cost of a closed chain as one circle; None where it is none.

    All regular polygons have their vertices on one: of a mesh that does not know its sigma those
    with few sides are polygons.
    """
    from turnscan.shapes import _outline_kernels as kernels

    x, y = (np.ascontiguousarray(c[:-1]) for c in chain.points.T)
    w, found = 1.0 / scale[:-1] ** 2, np.zeros(3)
    chi2 = kernels.circle(x, y, w, chain.bulge[:-1], found)
    count = int((w > 0).sum())
    widest = float(chain.steps.max())
    if (
        chi2 < 0
        or count < 6
        or chi2 > count + 8 * np.sqrt(2 * count) + 10
        or widest > 0.8 * found[2]
        or (not known and np.linalg.norm(chain.spans, axis=1).max() > _POLYGON * found[2])
    ):
        return None
    return float(chi2) + 3.0 * _prices(scale)


def _places(chain: Chain, known: bool) -> Longs:
    """The places of each point; of a mesh that does not know its sigma each point is one."""
    if known:
        return place_numbers(chain)
    return np.stack([np.arange(len(chain.points))] * 2, axis=1)


def _spans(chain: Chain, scale: Floats, known: bool) -> tuple[list[Span], float]:
    """The cheapest lines and arcs of an open chain, and their cost."""
    from turnscan.shapes import _outline_kernels as kernels

    x, y = (np.ascontiguousarray(c) for c in chain.points.T)
    m, price = len(x), _prices(scale)
    breaks = np.unique(np.r_[np.arange(0, m, -(-m // _MOST_BREAKS)), m - 1])
    least = 2.0 * float(np.median(scale[np.isfinite(scale)]))
    first, last = np.ascontiguousarray(_places(chain, known).T)
    points = kernels.Points(x, y, 1.0 / scale**2, first, last, np.ascontiguousarray(chain.bulge))
    prices = kernels.Prices(_LINE * price, _ARC * price, _SKIP, _ROUND if known else 4, least)
    rows, cost = kernels.pieces(points, breaks, prices, _gap(chain))
    found: list[Span] = [(("line", "arc")[int(k)], int(i), int(j)) for k, i, j in rows]
    return found or [("line", 0, m - 1)], float(cost)


def _gap(chain: Chain) -> float:
    """mm: a way between two points that is longer is a line, and nothing goes on across it."""
    return min(_GAP * float(np.median(chain.steps)), _WIDEST_GAP * chain.length)


def _alone(chain: Chain, scale: Floats, body: Body) -> float:
    r, _ = body.residuals(chain, body.p)
    return float(((r / scale[body.rows]) ** 2).sum())


def _seams(spans: list[Span], chain: Chain) -> list[int]:
    """Where to open a closed chain: at the ends of the longest of its pieces."""
    at = np.r_[0.0, np.cumsum(chain.steps)]
    inner = [s for s in spans if 0 < s[2] < len(chain.points) - 1]
    inner.sort(key=lambda s: float(at[s[1]] - at[s[2]]))
    return [s[2] for s in inner[:_SEAMS]]


def _body(chain: Chain, use: Bools, scale: Floats, span: Span) -> Body:
    kind, first, last = span
    rows = used(use, scale, first, last)
    if kind == "arc" and (arc := arc_body(chain, rows, (first, last), scale)) is not None:
        return arc
    if kind == "spline":
        return Body("spline", rows, (first, last), np.zeros(2), np.zeros(0))
    return line_body(chain, rows, (first, last), scale)


def _bodies(chain: Chain, use: Bools, scale: Floats, noise: Noise, spans: list[Span]) -> list[Body]:
    bodies = [_body(chain, use, scale, s) for s in spans if len(used(use, scale, *s[1:])) >= 2]
    for b in bodies:
        adjust(chain, [b], [], scale, noise)
    return bodies


def _rounded(chain: Chain, scale: Floats, noise: Noise, bodies: list[Body]) -> list[Body]:
    """The bodies, those at corners as arcs between their neighbours where that is likelier."""
    made = []
    for (span, circle), old in zip(
        rounded(chain, scale, bodies, _prices(scale), _places(chain, noise.known)),
        bodies,
        strict=True,
    ):
        b = old
        if circle is not None or span[1:] != old.ways:
            b = _body(chain, np.isfinite(scale), scale, span)
            if circle is not None:
                b.kind, b.p, b.origin = "arc", circle.copy(), np.zeros(2)
            adjust(chain, [b], [], scale, noise)
        if circle is not None:
            b.p = circle
        made.append(b)
    return made


def _freed(chain: Chain, scale: Floats, bodies: list[Body], closed: bool) -> list[Span]:
    """The spans of the bodies, those that a spline says better joined to one.

    A curve that waves about as much as its points scatter falls into many pieces, with corners
    between them: where some of it is a spline, one spline for all may be likelier than they are.
    Of a closed chain the last may end beyond its last point, which is its first.
    """
    price, m = _prices(scale), len(chain.points)
    spans: list[tuple[Span, float]] = [
        ((b.kind, *b.ways), _alone(chain, scale, b) + (_LINE if b.kind == "line" else _ARC) * price)
        for b in bodies
    ]
    smooth = [closed and _goes_on(bodies[-1], bodies[0], chain)]
    smooth += [_goes_on(a, b, chain) for a, b in pairwise(bodies)]

    def points(first: int, last: int) -> tuple[Floats, Floats]:
        rows = np.arange(first, last + 1)
        rows = np.where(rows > m - 1, rows - (m - 1), rows)
        return chain.points[rows], scale[rows]

    freed = with_splines(spans, smooth, points, price, m - 1 if closed else 0)
    between = (chain.steps[a.ways[1] : b.ways[0]].sum() for a, b in pairwise(bodies))
    if (
        max(between, default=0.0) <= _gap(chain)
        and len(freed) > 1
        and any(kind == "spline" for (kind, *_), _ in freed)
    ):
        whole: Span = ("spline", 0, m - 1)
        if spline_cost(*points(0, m - 1), price) < sum(cost for _, cost in freed):
            return [whole]
    return [s for s, _ in freed]


def _freeform(chain: Chain, bodies: list[Body]) -> bool:
    """Whether splines hold most of an outline: then it has no radius that somebody made."""
    free = sum(_length(chain, b) for b in bodies if b.kind == "spline")
    return free > _FREEFORM * chain.length


def _by_chance(chain: Chain, body: Body) -> bool:
    """Whether an arc of a freeform outline turns so little that any smooth stretch may be one."""
    if body.kind != "arc" or len(body.rows) < _FEWEST:
        return False
    return _length(chain, body) < _TURNED * float(body.p[2])


def _length(chain: Chain, body: Body) -> float:
    return float(chain.steps[body.ways[0] : body.ways[1]].sum())


def _goes_on(a: Body, b: Body, chain: Chain) -> bool:
    at = (chain.points[a.ways[1]] + chain.points[b.ways[0]]) / 2
    return float(a.direction(at) @ b.direction(at)) > _SMOOTH


def _ties(
    chain: Chain, scale: Floats, noise: Noise, bodies: list[Body], closed: bool, tolerance: float
) -> list[Tangency]:
    """Make neighbours tangent that touch inside the noise, but where that would cost much."""
    pairs = [(k - 1, k) for k in range(1, len(bodies))]
    if closed and len(bodies) > 2:
        pairs.append((len(bodies) - 1, 0))
    ties = tangencies(bodies, pairs, chain, tolerance)
    free = [b.p.copy() for b in bodies]
    before = adjust(chain, bodies, [], scale, noise)

    def cost(chosen: list[Tangency]) -> float:
        for b, p in zip(bodies, free, strict=True):
            b.p = p.copy()
        return (adjust(chain, bodies, chosen, scale, noise) - before) / noise.shared

    if ties and not cost(ties) <= _FORGIVEN * len(ties):
        ties = [t for t in ties if cost([t]) <= _FORGIVEN]
        if not cost(ties) <= _FORGIVEN * len(ties):
            ties = []
            cost(ties)
    return ties
