"""The laser sheet: a plane of light, or one that a cheap line lens has slightly bent."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, cross, frozen, handed_over

THICKEST = 0.01
"""Of a sheet's distance from the camera."""


@dataclass(frozen=True)
class LaserSheet:
    """A laser sheet in the camera frame.

    A point X lies on it where ``n·(X − c) = q_aa a² + q_ab a b + q_bb b²`` with
    ``a = e₁·(X − c)`` and ``b = e₂·(X − c)``, the in-sheet coordinates along the stripe and
    across it (`axes`).
    """

    name: str
    normal: Floats
    """(3,) unit normal n, camera frame."""
    centre: Floats
    """(3,) mm: a point c of the sheet, best in the middle of the working volume."""
    bow: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) 1/mm: q_aa, q_ab, q_bb; all zero for a plane."""
    source: Floats | None = None
    """(3,) mm: where the light comes from; None when not known (`Rig.light_source` then assumes).
    """
    thickness: float | None = None
    """mm rms of the light across the sheet, in the working volume; None when not known."""

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("LaserSheet.name: empty")
        n = frozen(self.normal, (3,), "LaserSheet.normal")
        length = float(np.linalg.norm(n))
        if length < 1e-9:
            raise ValueError("LaserSheet.normal: zero length")
        # A normal that is already unit stays as it is, to the bit: a rig survives its own file.
        unit = n if abs(length - 1.0) < 1e-12 else n / length
        object.__setattr__(self, "normal", frozen(unit, (3,), "LaserSheet.normal"))
        object.__setattr__(self, "centre", frozen(self.centre, (3,), "LaserSheet.centre"))
        object.__setattr__(self, "bow", frozen(self.bow, (3,), "LaserSheet.bow"))
        if self.thickness is not None and not (
            math.isfinite(self.thickness) and self.thickness > 0
        ):
            raise ValueError(f"LaserSheet.thickness: {self.thickness}, expected more than 0 mm")
        if self.source is not None:
            object.__setattr__(self, "source", frozen(self.source, (3,), "LaserSheet.source"))

    @property
    def thickest(self) -> float:
        """mm rms: what is thicker so far from the camera is no line."""
        return THICKEST * float(np.linalg.norm(self.centre))

    @cached_property
    def axes(self) -> tuple[Floats, Floats]:
        """Unit in-sheet directions e₁ (along the stripe) and e₂ = n × e₁, each (3,).

        e₁ is the picture's vertical laid into the sheet, or its horizontal where the sheet's
        normal is nearer to the vertical.
        """
        lead = np.array([0.0, 1.0, 0.0] if abs(self.normal[1]) < 0.7 else [1.0, 0.0, 0.0])
        e1 = lead - (lead @ self.normal) * self.normal
        e1 /= np.linalg.norm(e1)
        return handed_over(e1), handed_over(cross(self.normal, e1))

    def distance(self, points: npt.ArrayLike) -> Floats:
        """Signed distance (...,) mm of points (..., 3) from the sheet, measured along n."""
        d = np.asarray(points, dtype=np.float64) - self.centre
        away: Floats = d @ self.normal
        if not self.bow.any():
            return away
        e1, e2 = self.axes
        a, b = d @ e1, d @ e2
        bent: Floats = away - (self.bow[0] * a * a + self.bow[1] * a * b + self.bow[2] * b * b)
        return bent

    def gradient(self, points: npt.ArrayLike) -> Floats:
        """Gradient (..., 3) of `distance` at points (..., 3), the sheet's local normal."""
        d = np.asarray(points, dtype=np.float64) - self.centre
        slope = np.broadcast_to(self.normal, d.shape).copy()
        if self.bow.any():
            e1, e2 = self.axes
            a, b = (d @ e1)[..., None], (d @ e2)[..., None]
            q = self.bow
            slope -= (2 * q[0] * a + q[1] * b) * e1 + (q[1] * a + 2 * q[2] * b) * e2
        return slope

    def intersect(self, rays: npt.ArrayLike) -> Floats:
        """Rays (..., 3) from the camera centre → points (..., 3) mm where they meet the sheet.

        NaN where the ray runs along the sheet, meets it behind the camera or, when it is bent,
        misses it.
        """
        d = np.asarray(rays, dtype=np.float64)
        with np.errstate(all="ignore"):
            t = self._range(d)
            t = np.where((t > 0) & np.isfinite(t), t, np.nan)
        points: Floats = t[..., None] * d
        return points

    def _range(self, d: Floats) -> Floats:
        """How many times d reaches from the camera to the sheet.

        Along a ray the bent sheet is a quadratic A t² + B t + C = 0; of its two roots this is the
        one that becomes the plane's, −C/B, as the bow vanishes. NaN where the ray misses.
        """
        B, C = d @ self.normal, -(self.centre @ self.normal)
        if not self.bow.any():
            return np.asarray(-C / B)
        e1, e2 = self.axes
        da, db, a, b = d @ e1, d @ e2, -(self.centre @ e1), -(self.centre @ e2)
        q_aa, q_ab, q_bb = self.bow
        A = -(q_aa * da * da + q_ab * da * db + q_bb * db * db)
        B = B - (2 * q_aa * a * da + q_ab * (a * db + b * da) + 2 * q_bb * b * db)
        C = C - (q_aa * a * a + q_ab * a * b + q_bb * b * b)
        return np.asarray(-2 * C / (B + np.copysign(np.sqrt(B * B - 4 * A * C), B)))
