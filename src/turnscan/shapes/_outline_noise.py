"""How well the points of a chain are known, and how they hang together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.shapes._section import Chain

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_HALF = 4
"""Points on either side of one, whose parabola says where it should lie."""
_RELATIVE = 1e-4
"""The tolerance is no finer than this part of the section's size where none is given."""
SIGMAS = 3.0
"""The tolerance is so many standard deviations where none is given."""


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of a chain's points, across it."""

    vertex: csr_array
    """(m, v) mm: what a standard deviation of each vertex of the mesh does to each point. Points
    that lie beside each other share a vertex, so they are not independent; what vertices share
    (`Chain.together`) is counted to each."""
    point: Floats
    """(m,) mm: standard deviation of each point by itself."""
    known: bool
    """Whether the mesh says its sigma; otherwise the scatter of the points does."""
    overlap: float
    """So many times the variance of independent points has a sum over the chain, since they share
    vertices."""
    together: float
    """So many times more it has since vertices share measurements (`Chain.together`)."""
    share: float = 1.0
    """Of ``point``, what is seen: sigma may be careful. Uncertainties do not hang on it."""

    @property
    def shared(self) -> float:
        """So many times the variance of independent points has a sum over the chain."""
        return min(max(self.overlap, 1.0), 4.0) * self.together

    def scale(self, tolerance: float) -> Floats:
        """(m,) mm: standard deviations that count as one when pieces are compared."""
        scale: Floats = np.maximum(self._wide(self.point), tolerance / SIGMAS)
        return scale

    @property
    def tolerance(self) -> float:
        """mm that points may lie off a piece for noise alone."""
        return SIGMAS * float(np.median(self._wide(self.point)))

    def _wide(self, point: Floats) -> Floats:
        return np.asarray(point * self.share * np.sqrt(self.shared))


def chain_noise(chain: Chain, use: Bools) -> Noise:
    """The noise of a chain: its sigma, or its scatter about local parabolas where that is larger.

    ``use`` (m,) tells which points were measured; there must be some.
    """
    from scipy.sparse import csr_array, diags_array

    m = len(chain.points)
    vertices, column = np.unique(chain.ends, return_inverse=True)
    index = (np.repeat(np.arange(m), 2), column.ravel())
    rows = csr_array((chain.shares.ravel(), index), shape=(m, len(vertices)))
    known = bool(np.isfinite(chain.sigma[use]).mean() > 0.5)
    factor = np.ones(m)
    if known:
        middle = np.nanmedian(chain.sigma[use])
        fair = np.where(np.isfinite(chain.sigma), chain.sigma, middle)
        factor = np.maximum(fair, 1e-12) / _lengths(rows)
    rows = csr_array(diags_array(factor) @ rows)
    scatter = _scatter(chain.points[use], chain.bulge[use], rows[np.flatnonzero(use)])
    rows = csr_array(rows * (max(scatter, 1.0) if known else max(scatter, 1e-12)))
    point = _lengths(rows)
    whole: Floats = np.asarray(rows[np.flatnonzero(use)].sum(axis=0))
    overlap = float((whole**2).sum() / (point[use] ** 2).sum())
    rows = csr_array(rows * np.sqrt(chain.together))
    return Noise(rows, point, known, overlap, chain.together)


def default_tolerance(size: float, noise: Noise) -> float:
    """mm: three standard deviations of the noise, and no less than 1e-4 of the ``size`` mm."""
    return max(_RELATIVE * size, noise.tolerance)


def _lengths(rows: csr_array) -> Floats:
    return np.asarray(np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel()))


def _scatter(p: Floats, bulge: Floats, rows: csr_array) -> float:
    """How many times larger than ``rows`` say points (m, 2) scatter that lie on chords.

    The smaller of two estimates: about parabolas through the four points on either side, which
    corners disturb, and about the line through the two beside each, which bends disturb.
    """
    if len(p) < 2 * (2 * _HALF + 1):
        return 0.0
    about_parabola = np.quantile(_off(p, bulge, rows, _HALF, 3), 0.5) / 0.6745
    about_line = np.quantile(_off(p, bulge, rows, 1, 2), 0.3) / 0.3853
    return float(min(about_parabola, about_line))


def _off(p: Floats, bulge: Floats, rows: csr_array, half: int, powers: int) -> Floats:
    """|Distance| of each point from a polynomial through its neighbours, per what ``rows`` say.

    A point on a chord of a curve lies off it as if x² were larger by its ``bulge`` (m,) mm².
    """
    from scipy.sparse import csr_array

    m, wide = len(p), 2 * half + 1
    window = np.arange(m - wide + 1)[:, None] + np.arange(wide)
    q = p[window]
    along = q[:, -1] - q[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    along /= length[:, None]
    to = q - q[:, :1]
    at = np.einsum("kij,kj->ki", to, along) / length[:, None] - 0.5
    across = along[:, None, 0] * to[:, :, 1] - along[:, None, 1] * to[:, :, 0]
    design = at[:, :, None] ** np.arange(powers)
    design[:, :, 2:] += (bulge[window] / length[:, None] ** 2)[:, :, None]
    value = design[:, half].copy()
    design[:, half] = 0.0
    weights = -np.einsum("kj,kji->ki", value, np.linalg.pinv(design))
    weights[:, half] = 1.0
    off = np.einsum("ki,ki->k", weights, across)
    index = (np.repeat(np.arange(len(window)), wide), window.ravel())
    look = csr_array((weights.ravel(), index), shape=(len(window), m))
    due = _lengths(csr_array(look @ rows))
    return np.asarray(np.abs(off) / np.maximum(due, 1e-300))
