"""How well the vertices of a merge in voxels are known: each lies between two voxels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.surface.fusion._range_surface import RangeSurface


def interpolated(noise: Floats, shared: Floats, share: Floats, correlation: Floats) -> Floats:
    """(v,) mm: sigma of what lies a ``share`` (v,) of the way from one value to another.

    ``noise`` (v, 2) mm² is the variance of each that noise makes, with the ``correlation`` (v,) of
    both; ``shared`` (v, 2) mm is what else moves both.
    """
    part = np.stack([1.0 - share, share], axis=1)
    own = part**2 * noise
    both = 2.0 * correlation * np.sqrt(own.prod(axis=1))
    return np.asarray(np.sqrt(own.sum(axis=1) + both + (part * shared).sum(axis=1) ** 2))


def correlations(parts: Sequence[RangeSurface], nearest: Longs, ways: Floats) -> Floats:
    """(v,) from 0 to 1: of the noise of two places on the surface.

    ``ways`` (v, 3) mm lead from the one to the other, ``nearest`` (v,) is the number of a measured
    vertex there, −1 for none. What is interpolated between points one step apart is as like as the
    cubic B-spline falls off, the convolution of what each point counts; on a surface in both
    directions, along the profile and across. Where one of them is not known all noise is the same.
    """
    along, across = (
        np.concatenate(every)[nearest] for every in zip(*map(_steps, parts), strict=True)
    )
    aa, cc = np.einsum("ij,ij->i", along, along), np.einsum("ij,ij->i", across, across)
    ac = np.einsum("ij,ij->i", along, across)
    a, c = np.einsum("ij,ij->i", along, ways), np.einsum("ij,ij->i", across, ways)
    with np.errstate(invalid="ignore", divide="ignore"):
        det = aa * cc - ac**2
        same = _spline((a * cc - c * ac) / det) * _spline((c * aa - a * ac) / det)
    return np.where((nearest < 0) | np.isnan(same), 1.0, same)


def _spline(x: Floats) -> Floats:
    """The cubic B-spline, 1 at 0."""
    x = np.minimum(np.abs(x), 2.0)
    return np.asarray(np.where(x < 1.0, 1.0 - 1.5 * x**2 + 0.75 * x**3, 0.25 * (2.0 - x) ** 3))


def _steps(s: RangeSurface) -> tuple[Floats, Floats]:
    """(v, 3) mm twice: from each vertex to one beside it on its profile, and to one on the same
    line of the profile beside; NaN where there is none."""
    X, p = s.mesh.vertices, s.mesh.provenance
    if p is None:
        raise TypeError("the mesh of a grid knows its steps")
    order = np.lexsort((p.line, s.ranks))
    follows = s.ranks[order[1:]] == s.ranks[order[:-1]]
    along = np.full(X.shape, np.nan)
    along[order[1:][follows]] = (X[order[1:]] - X[order[:-1]])[follows]
    along[order[:-1][follows]] = (X[order[1:]] - X[order[:-1]])[follows]
    before, after = s.neighbours
    beside = np.where(after >= 0, after, before)
    along /= 1.0 - s.alike  # what adjacent lines share reaches so many further
    return along, np.where((beside >= 0)[:, None], X[beside] - X, np.nan)
