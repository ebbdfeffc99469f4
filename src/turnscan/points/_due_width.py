"""How wide a stripe is due on a surface that lies so to the light, and how it lies by its width."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats

SMOOTH = 0.08
"""Difference of two surfaces to the light, as a part, up to which they are one …"""
_SHARE = 0.25
"""… or half as much again as that of this share of all, where curvature and coarse steps make it
more, but no more than twice of it: beyond that nobody knows what is due."""
_FEW, _MANY = 50, 200_000
"""Points that are enough to know how thick the sheet is, and more than which tell no more."""
_VARIES = 0.12
"""Scatter of widths about what is due, as a part, beyond which something else makes them: a halo,
clipping. Then they tell nothing of the surface."""
_UNLIKE = 1.2
"""Squares of two slopes differ by this much where they can tell thickness from blur."""
_TWICE = 2.0
"""Times that a sheet may be thicker or thinner than the rig says, and no more: chords of coarse
steps lie otherwise to the light than the surface does, and then slopes and widths tell nothing."""
_BLUR = 0.7
"""Part of the square of a width that a blur makes, beyond which widths tell nothing of slopes."""


@dataclass(frozen=True)
class DueWidth:
    """The root of (thickness of the sheet / walk)² + (blur)², both from where a surface is smooth;
    ``walk`` is how far a pixel leads away from the sheet on it, mm."""

    thickness: float
    """mm rms of the sheet."""
    told: bool = False
    """Whether slopes distinguish it from a blur."""
    blur: float = 0.0
    """px²."""
    more: Floats | None = None
    """(2,) Chords of a curved surface lie to the light otherwise than it does, one way before and
    the other after: what is usual there is due. None where nothing can be told."""

    def __call__(self, walk: Floats) -> Floats:
        """(2, s, n) px: how wide stripes are on surfaces that lie so (2, s, n) mm to the light."""
        if self.more is None:
            return np.full(walk.shape, np.nan)
        known = np.where(np.isinf(walk), np.nan, walk)
        due = np.sqrt(self.thickness**2 / known**2 + self.blur)
        return np.asarray(self.more[:, None, None] * due)

    def walk_of(self, width: Floats) -> Floats:
        """(s, n) mm: how a surface lies to the light on which stripes are so wide (s, n) px; NaN
        where that is a blur, or is not told from one."""
        if self.more is None or not self.told:
            return np.full(width.shape, np.nan)
        square = (width / float(np.sqrt(self.more.prod()))) ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            walk = self.thickness / np.sqrt(square - self.blur)
            return np.asarray(np.where(self.blur < _BLUR * square, walk, np.nan))


def due_width(walk: Floats, width: Floats, stated: float) -> DueWidth:
    """How wide stripes are due, from their ``width`` (s, n) px on surfaces that lie so (2, s, n) mm
    to the light before and after each; the rig says that the sheet is ``stated`` mm rms thick."""
    smooth = np.nonzero(_smooth(walk, width))
    if len(smooth[0]) < _FEW:
        return DueWidth(stated)
    some = tuple(index[:: -(-len(index) // _MANY)] for index in smooth)
    on, lit = np.stack([w[some] for w in walk]), width[some]
    x, y = 1.0 / on.mean(axis=0) ** 2, lit**2
    steep = x > np.median(x)
    ends = [(float(np.median(x[k])), float(np.median(y[k]))) for k in (~steep, steep) if k.any()]
    (x0, y0), (x1, y1) = ends[0], ends[-1]
    told = x1 > x0 * _UNLIKE
    slope = min(max((y1 - y0) / (x1 - x0), 0.0), y0 / x0) if told else y0 / x0
    if stated > 0 and told and not stated / _TWICE < np.sqrt(slope) < stated * _TWICE:
        told, slope = False, min(stated**2, y0 / x0)
    blur = max(y0 - slope * x0, 0.0)
    part = np.log(lit / np.sqrt(slope / on**2 + blur))
    usual = np.median(part, axis=1)
    scatter = 1.4826 * float(np.median(np.abs(part - usual[:, None])))
    if scatter > _VARIES:
        return DueWidth(stated)
    return DueWidth(float(np.sqrt(slope)), told, blur, np.exp(usual))


def _smooth(walk: Floats, width: Floats) -> Bools:
    """(s, n) True where the profiles before and after tell the same of how the surface lies."""
    with np.errstate(invalid="ignore", divide="ignore"):
        differ = np.where(np.isnan(width), np.nan, np.abs(np.log(walk[0] / walk[1])))
    known = differ[np.isfinite(differ)]
    some = 1.5 * float(np.quantile(known, _SHARE)) if len(known) else 0.0
    return np.asarray(differ <= min(max(SMOOTH, some), 2 * SMOOTH))
