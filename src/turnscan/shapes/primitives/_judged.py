"""Whether a region of a mesh is a shape: by its size, its width, and what it misses its surface by.

A smooth freeform patch fits any flexible surface as far as its tolerance reaches, and then its
misfit is larger than the noise that neighbours have among themselves, and has a pattern: the means
of small cells stand off by a good part of the tolerance. A true surface ends at an edge, and what
its points miss it by is noise. A region counts where both, `excess` and `pattern`, are small.
"""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import LIMIT, Ground, Index
from turnscan.shapes.primitives._region import FIT
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE

PATTERN = 0.15
"""Share of the tolerance that the means of cells may stand off the surface."""
_EXCESS = 0.22
"""Share of the tolerance by which points may miss their surface beyond what their neighbours say
is noise, root mean square. Freeform has 0.25 to 0.45, shapes of scans less than 0.17."""
WAVY = 0.2
"""The same for the means along stripes: shapes of scans have up to 0.12, freeform 0.27 and more."""
LEAST = (60, 400, 200, 400, 500)
"""Vertices that a region of each kind must have."""
SPAN = float(np.radians(20.0))
"""Angle that the normals of a curved region span at the least: less of it says no radius."""
_CELL = 9
"""Vertices of a cell, about."""
_TELLING = (20, 30)
"""Cells that a plane and a curved surface must have then: few large ones fit anything."""
HOPELESS = (0.26, 0.38)
"""Excess beyond which a region that grows is given up: its surface is that through its points, and
some hundred of them tell the excess to 0.02; and the same where neighbours are off together, all
of whose noise counts as excess: one standard deviation of it is a third."""
_POOR, _FEW, _MANY = 1.8, 8, 4
"""Usual sigmas from which a region is known badly, and the stripes that it then needs: bands of
three to five of them stand beside edges of scans where nothing is, up to 2 mm off the part. A scan
of less than four times as many stripes has no more of them on a whole face."""
_WIDE = 5.0
"""Times three standard deviations that a region must be wide: narrower bands lie on anything. Bands
of edges that are known to a millimetre have up to 3.3, shapes of scans 20 and more."""
_ROWS = (3.5, 4.5)
"""Rows of vertices side by side that a plane must have, and a round across its curve, where no
sigma tells which of them an edge has bent: three lie on a hollow round over each gap of a gear."""
_WRAPPED = 0.5
"""Length of the mean normal of a round that goes so far about its axis that its rows are many."""
_FIRM = 0.65
"""Share of a region's points that must not be doubtful: stripes that an edge bends lie on smooth
bands, too, across the corners of keyways and beside silhouettes. Those have up to 0.55 of them."""
_FIRM_ELSEWHERE = 0.5
"""The same share where a surface was found elsewhere already: such bands lie on none of these."""


def enough(g: Ground, kind: int, q: Floats, member: Index, least: float) -> bool:
    """Whether members are as many, as much of the surface (``least`` mm²), and as round as a shape
    must be."""
    if len(member) < LEAST[kind] or float(g.area[member].sum()) < least:
        return False
    return kind == PLANE or span_of(g, kind, q, member) >= SPAN


def fair(g: Ground, kind: int, q: Floats, member: Index) -> bool:
    """Whether firm members are enough, in number and share, and miss the surface by noise."""
    enough = max(LEAST[kind], _FIRM * len(member))
    if int(g.firm[member].sum()) < enough or bent(g, member):
        return False
    if g.blind and rows(g, kind, q, member) < (_ROWS[0] if kind == PLANE else _ROWS[1]):
        return False
    return close(g, kind, q, member)


def continues(g: Ground, kind: int, q: Floats, member: Index) -> bool:
    """Whether members are more of a surface that was found elsewhere, so that they need not say
    alone what it is."""
    firm = int(g.firm[member].sum())
    return (
        firm >= _FIRM_ELSEWHERE * len(member) and not bent(g, member) and close(g, kind, q, member)
    )


def rows(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """How many rows of vertices lie side by side across a region: of a plane where it is narrowest,
    of a cylinder or cone round its axis, which tells the radius; infinite for the others."""
    X = g.vertices[member]
    if kind == PLANE:
        across = np.linalg.eigh(np.cov(X.T))[1][:, 1:]
        along = (X - X.mean(axis=0)) @ across
    elif kind in (CYLINDER, CONE):
        n = surface.distances(kind, q, X)[1]
        turn = np.cross(q[3:6], n.mean(axis=0))
        if np.linalg.norm(n.mean(axis=0)) < _WRAPPED:
            return math.inf
        along = ((X - q[:3]) @ (turn / np.linalg.norm(turn)))[:, None]
    else:
        return math.inf
    at = np.full((len(g.vertices), along.shape[1]), np.nan)
    at[member] = along
    some = surface.some_of(member, FIT)
    most = np.zeros((len(some), along.shape[1]))
    first, many = g.start[some], g.start[some + 1] - g.start[some]
    for k in range(int(many.max(initial=0))):
        near = g.near[first + np.minimum(k, many - 1)]
        most = np.fmax(most, np.abs(at[near] - at[some]))
    wide = np.quantile(along, 0.98, axis=0) - np.quantile(along, 0.02, axis=0)
    return float((wide / np.maximum(np.median(most, axis=0), 1e-9)).min()) + 1.0


def bent(g: Ground, member: Index) -> bool:
    """Whether members are a few stripes that are known badly, as beside edges: what bends a stripe
    there does so alike all along it, and a band of such stripes is as smooth as a face."""
    if g.stripe is None or not poor(g, member):
        return False
    many = np.unique(g.stripe[member], return_counts=True)[1].astype(float)
    # A stripe of which a point or two lie at the end of the band is no stripe of it.
    full = float(many.sum()) ** 2 / float((many**2).sum())
    return full < _FEW <= g.stripes / _MANY


def poor(g: Ground, member: Index) -> bool:
    """Whether members are known worse than most of the part."""
    return float(np.median(g.scale[member])) > _POOR * g.usual


def wide(g: Ground, member: Index) -> bool:
    """Whether members cover a band that is much wider than what each is known to."""
    X = g.vertices[member]
    long = math.sqrt(12.0 * float(np.linalg.eigvalsh(np.cov(X.T))[-1]))
    return float(g.area[member].sum()) >= _WIDE * LIMIT * float(np.median(g.scale[member])) * long


def close(g: Ground, kind: int, q: Floats, member: Index) -> bool:
    """Whether what firm members miss the surface by is noise: that of each, or of neighbours that
    are off together. Cones, spheres and tori bend to too much of a freeform wall for the latter."""
    firm = member[g.firm[member]]
    if not len(firm):
        return False
    plain, together = excess(g, kind, q, firm), together_on(g, kind)
    if plain <= _EXCESS and pattern(g, kind, q, firm) <= PATTERN:
        return True
    return (
        together > 1.0
        and plain <= HOPELESS[1]
        and excess(g, kind, q, firm, together=together) <= _EXCESS
        and pattern(g, kind, q, firm, together) <= PATTERN
    )


def together_on(g: Ground, kind: int) -> float:
    return g.together if kind in (PLANE, CYLINDER) else 1.0


def excess(
    g: Ground, kind: int, q: Floats, member: Index, most: int = FIT, together: float = 1.0
) -> float:
    """How far members miss the surface beyond their own noise, each over its own tolerance.

    The noise is what each stands off its neighbours by, half of them less and half of them more;
    where so many are off ``together``, what each stands off the mean of its cell by.
    """
    some = surface.some_of(member, most)
    d = surface.distances(kind, q, g.vertices[some])[0] / g.limit[some]
    noise = 1.4826 * float(np.median(np.abs(g.off[some] / g.limit[some])))
    if together > 1.0:
        cell = cells(g, some, together)
        count = np.bincount(cell)
        mean = np.bincount(cell, d) / np.maximum(count, 1)
        free = max(len(some) - int((count > 0).sum()), 1)
        noise = max(noise, float(np.sqrt(((d - mean[cell]) ** 2).sum() / free)))
    return float(np.sqrt(max(float(np.mean(d * d)) - noise**2, 0.0)))


def pattern(g: Ground, kind: int, q: Floats, member: Index, together: float = 1.0) -> float:
    """How far the means of cells stand off the surface, root mean square, over its tolerance.

    What independent noise gives them is taken off, and the worst tenth, which lies at edges. Where
    so many points are off ``together``, fewer cells than tell anything say that it is no surface.
    """
    d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
    off = _means_off(
        d, cells(g, member, together), 6 if together == 1.0 else _TELLING[kind != PLANE]
    )
    if off is not None:
        return off
    return 0.0 if kind == PLANE and together == 1.0 else float("inf")


def waves(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """The same of the means of `_CELL` neighbours on one stripe; 0 where stripes are not known.

    Where stripes stand further apart than the points on them, a cell of space averages the waves
    out that a freeform surface makes along each stripe.
    """
    if g.stripe is None or g.along is None:
        return 0.0
    member = member[np.argsort(g.along[member])]
    d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
    first = np.diff(g.stripe[member], prepend=-1) != 0
    number = np.arange(len(member))
    run = (number - np.maximum.accumulate(np.where(first, number, 0))) // _CELL
    off = _means_off(d, np.cumsum(first | (np.diff(run, prepend=0) != 0)) - 1)
    return 0.0 if off is None else off


def _means_off(d: Floats, cell: Index, least: int = 6) -> float | None:
    """Root mean square of the means of values over cells; None where there are too few."""
    count = np.bincount(cell)
    good = count >= 4
    if good.sum() < least:
        return None
    mean = np.bincount(cell, d)[good] / count[good]
    spread = np.bincount(cell, d * d)[good] / count[good] - mean**2
    keep = np.abs(mean) <= np.quantile(np.abs(mean), 0.9)
    noise = float((spread / (count[good] - 1))[keep].mean())
    return float(np.sqrt(max(float((mean[keep] ** 2).mean()) - noise, 0.0)))


def cells(g: Ground, member: Index, together: float = 1.0) -> Index:
    """(n,) number of the cell of space that each member is in; about `_CELL` share one, or so many
    times as many as are off ``together``."""
    side = max(g.spacing * np.sqrt(_CELL * together), 1e-9)
    at = np.floor((g.vertices[member] - g.vertices[member].min(axis=0)) / side).astype(np.int64)
    wide = at.max(axis=0) + 1
    keys = (at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2]
    return np.unique(keys, return_inverse=True)[1].astype(np.int64)


def span_of(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """Radians between normals of the surface over a region."""
    return spanned(surface.distances(kind, q, g.vertices[surface.some_of(member, 500)])[1])


def spanned(normals: Floats) -> float:
    """Radians between normals (n, 3): twice the widest from their mean; π where they go round."""
    mean = normals.mean(axis=0)
    long = float(np.linalg.norm(mean))
    if long < 0.5:
        return float(np.pi)
    return 2 * float(np.arccos(np.clip(np.quantile(normals @ (mean / long), 0.02), -1, 1)))
