"""Lines, arcs and splines of a drawing, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen

Joint = Literal["tangent", "corner", "end"]
"""How a piece begins: in the direction of the one before, at an angle to it, or free."""


@dataclass(frozen=True)
class Rest:
    """What a piece rests on."""

    count: int
    """Points that were measured."""
    rms: float
    """mm: root mean square distance of the points."""
    worst: float
    """mm: the largest distance of a point."""


@dataclass(frozen=True)
class Line:
    """A straight piece."""

    start: Floats
    """(2,) mm."""
    end: Floats
    """(2,) mm."""
    sigma: float
    """mm: standard uncertainty of its place across itself, in its middle."""
    angle_sigma: float
    """Standard uncertainty of its direction, radians."""
    length_sigma: float
    """mm; NaN where an end is free."""
    rest: Rest
    joint: Joint = "end"
    link: bool = False
    """True where it only joins two neighbours that do not meet; then nothing is known of it."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (2,), "Line.start"))
        object.__setattr__(self, "end", frozen(self.end, (2,), "Line.end"))

    @property
    def length(self) -> float:
        """mm."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def angle(self) -> float:
        """Direction from start to end, radians from the drawing's x, −π to π."""
        d = self.end - self.start
        return float(np.arctan2(d[1], d[0]))

    def sampled(self, tolerance: float) -> Floats:
        """(2, 2) mm: its ends."""
        return np.stack([self.start, self.end])

    def distances(self, points: npt.ArrayLike) -> Floats:
        """(n,) mm of points (n, 2) from the line, wherever along it."""
        d = (self.end - self.start) / max(self.length, 1e-300)
        to = np.asarray(points) - self.start
        return np.asarray(to @ np.array([-d[1], d[0]]))


@dataclass(frozen=True)
class Arc:
    """A circular arc, or a full circle."""

    centre: Floats
    """(2,) mm."""
    radius: float
    """mm."""
    begin: float
    """Radians from the drawing's x, where the arc begins."""
    sweep: float
    """Radians, counter-clockwise; negative for clockwise, ±2π for a full circle."""
    radius_sigma: float
    """mm: standard uncertainty of the radius."""
    centre_sigma: Floats
    """(2,) mm: standard uncertainties of the centre."""
    rest: Rest
    joint: Joint = "end"

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "centre", frozen(self.centre, (2,), "Arc.centre"))
        put(self, "centre_sigma", frozen(self.centre_sigma, (2,), "Arc.centre_sigma"))

    @property
    def full(self) -> bool:
        """Whether it is a whole circle."""
        return abs(self.sweep) >= 2 * np.pi - 1e-9

    @property
    def length(self) -> float:
        """mm along the arc."""
        return abs(self.sweep) * self.radius

    @property
    def start(self) -> Floats:
        """(2,) mm."""
        return np.asarray(self._at(np.array([self.begin]))[0])

    @property
    def end(self) -> Floats:
        """(2,) mm."""
        return np.asarray(self._at(np.array([self.begin + self.sweep]))[0])

    def _at(self, angles: Floats) -> Floats:
        on = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.asarray(self.centre + self.radius * on)

    def sampled(self, tolerance: float) -> Floats:
        """(n, 2) mm: points on it whose chords lie within ``tolerance`` mm of it."""
        turn = 2 * np.arccos(np.clip(1.0 - tolerance / self.radius, 0.0, 1.0))
        n = max(int(np.ceil(abs(self.sweep) / max(turn, 0.01))), 3)
        return self._at(self.begin + self.sweep * np.linspace(0.0, 1.0, n + 1))

    def distances(self, points: npt.ArrayLike) -> Floats:
        """(n,) mm of points (n, 2) from the circle, positive outside."""
        return np.asarray(np.linalg.norm(np.asarray(points) - self.centre, axis=1) - self.radius)


@dataclass(frozen=True)
class Spline:
    """A cubic B-spline, clamped at both ends."""

    control: Floats
    """(k, 2) mm."""
    knots: Floats
    """(k + 4,), from 0 to 1."""
    sigma: float
    """mm: standard uncertainty of its place across itself, on average."""
    rest: Rest
    joint: Joint = "end"

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "control", frozen(self.control, (None, 2), "Spline.control"))
        put(self, "knots", frozen(self.knots, (len(self.control) + 4,), "Spline.knots"))

    @property
    def start(self) -> Floats:
        """(2,) mm."""
        return np.asarray(self.control[0])

    @property
    def end(self) -> Floats:
        """(2,) mm."""
        return np.asarray(self.control[-1])

    @property
    def length(self) -> float:
        """mm along the spline."""
        return float(np.linalg.norm(np.diff(self.sampled(1e-3), axis=0), axis=1).sum())

    def sampled(self, tolerance: float) -> Floats:
        """(n, 2) mm: points on it, sixteen between two knots."""
        from scipy.interpolate import BSpline

        t = np.linspace(0.0, 1.0, 16 * (len(self.control) - 3) + 1)
        return np.asarray(BSpline(self.knots, self.control, 3)(t))

    def distances(self, points: npt.ArrayLike) -> Floats:
        """(n,) mm of points (n, 2) from the spline."""
        from scipy.spatial import cKDTree

        curve = self.sampled(1e-3)
        p = np.asarray(points, dtype=np.float64)
        near = cKDTree(curve).query(p, k=3)[1]
        away = np.full(len(p), np.inf)
        for k in np.clip(np.concatenate([near - 1, near], axis=1), 0, len(curve) - 2).T:
            a, d = curve[k], curve[k + 1] - curve[k]
            t = np.einsum("ij,ij->i", p - a, d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)
            off = p - a - np.clip(t, 0.0, 1.0)[:, None] * d
            away = np.minimum(away, np.linalg.norm(off, axis=1))
        return away


Piece: TypeAlias = Line | Arc | Spline


@dataclass(frozen=True)
class Size:
    """A size between two straight pieces of an outline."""

    kind: Literal["distance", "angle"]
    """Between parallel lines that look at each other, mm; of a corner, radians."""
    value: float
    sigma: float
    """Standard uncertainty."""
    between: tuple[int, int]
    """Numbers of the two pieces."""
    places: Floats
    """(2, 2) mm: a distance goes from the first place to the second; of an angle both are the
    corner."""
    off_parallel: float = 0.0
    """Radians between the two lines of a distance."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "places", frozen(self.places, (2, 2), "Size.places"))


@dataclass(frozen=True)
class Outline:
    """Lines, arcs and splines that follow each other, fitted to a chain or a part of one."""

    pieces: tuple[Piece, ...]
    closed: bool
    tolerance: float
    """mm: what a misfit may be; noise beyond it is forgiven."""
    noise: float
    """mm: median standard deviation of the points across the outline."""
    known: bool
    """Whether the noise is that of the mesh's sigma; otherwise it is the points' own scatter."""
    box: Floats
    """(2, 2) mm: its least and its largest x and y."""
    box_sigma: Floats
    """(2, 2) mm: their standard uncertainties."""
    sizes: tuple[Size, ...] = ()
    chords: int = 0
    """Lines that rest on fewer than three measured places: they have no sizes."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "box", frozen(self.box, (2, 2), "Outline.box"))
        put = frozen(self.box_sigma, (2, 2), "Outline.box_sigma")
        object.__setattr__(self, "box_sigma", put)

    def sampled(self, tolerance: float) -> Floats:
        """(n, 2) mm: a polyline within ``tolerance`` mm; of a closed one the first point last."""
        rows = [p.sampled(tolerance) for p in self.pieces]
        return np.concatenate([rows[0], *(r[1:] for r in rows[1:])])
