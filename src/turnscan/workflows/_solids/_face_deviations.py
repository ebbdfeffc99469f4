"""How far the measured points lie off each face of a solid, and the colours that show it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.drawings import Colour, Facets
from turnscan.mesh import Mesh
from turnscan.shapes import deviation
from turnscan.workflows._pages._colours import DEVIATION_STEPS, GREY

TRIANGLE: Colour = (255, 255, 255)
"""A face that is a triangle of the mesh: nothing lies off it."""
_MIDDLE = len(DEVIATION_STEPS) // 2
_STEPS = (1.0, 2.0, 5.0, 10.0)
_FINEST = 1e-4
"""mm: no colour stands for less."""


@dataclass(frozen=True)
class FaceDeviation:
    """How measured points lie to a face; figures are NaN where there is none."""

    face: int
    """From 1."""
    surface: str
    points: int
    mean_mm: float
    """Positive where the points lie outside of it."""
    rms_mm: float


@dataclass(frozen=True, eq=False)
class FaceDeviations:
    """How measured points lie to the faces of a solid."""

    distance: Floats
    """(n,) mm: of every measured point on a face, positive outside."""
    faces: tuple[FaceDeviation, ...]
    width: float
    """mm: what one colour stands for."""
    facets: Facets
    triangles: tuple[int, ...] = ()
    """Numbers, from 0, of the faces that are triangles of the mesh; they are not among `faces`."""
    sigma: Floats | None = None
    """(n,) mm: standard deviation of each of these points; NaN where it is not known."""

    def quantile(self, share: float) -> float:
        """Absolute distance, mm, that ``share`` of the points stay within; NaN without points."""
        d = np.abs(self.distance)
        return float(np.quantile(d, share)) if len(d) else np.nan

    @property
    def rms(self) -> float:
        """Root mean square distance, mm; NaN without points."""
        return float(np.sqrt(np.mean(self.distance**2))) if len(self.distance) else np.nan

    @property
    def rms_over_sigma(self) -> float:
        """Root mean square distance in standard deviations of each point; NaN where none is known.

        It is about 1 where the points miss the faces by their noise, however few of them, beside
        edges, carry most of `rms`.
        """
        if self.sigma is None:
            return np.nan
        known = np.isfinite(self.sigma) & (self.sigma > 0)
        if not known.any():
            return np.nan
        return float(np.sqrt(np.mean((self.distance[known] / self.sigma[known]) ** 2)))

    @property
    def colours(self) -> dict[int, Colour]:
        """The colour of each face by its number from 0."""
        rest = dict.fromkeys(self.triangles, TRIANGLE)
        return {f.face - 1: self._colour(f) for f in self.faces} | rest

    def _colour(self, f: FaceDeviation) -> Colour:
        if not f.points:
            return GREY
        k = int(np.clip(np.rint(f.mean_mm / self.width), -_MIDDLE, _MIDDLE))
        return DEVIATION_STEPS[k + _MIDDLE][1]

    def legend(self) -> Iterator[tuple[str, str]]:
        """Each colour, and the mean deviations that it stands for."""
        for k, (name, _) in enumerate(DEVIATION_STEPS):
            low, high = ((k - _MIDDLE + h) * self.width for h in (-0.5, 0.5))
            yield name, f"{low:+.4g} to {high:+.4g} mm"
        yield "grey", "not measured"
        if self.triangles:
            yield "white", "triangle of the mesh"

    def __str__(self) -> str:
        return "mean deviation of the measured points, positive outside: " + "; ".join(
            f"{name} {what}" for name, what in self.legend()
        )

    def painted(self) -> Mesh:
        """The faces in their colours, as triangles."""
        t = self.facets.mesh.triangles
        colour = np.full((len(self.faces) + len(self.triangles), 3), GREY, dtype=np.uint8)
        for k, c in self.colours.items():
            colour[k] = c
        of = np.asarray(self.facets.order, dtype=np.int64)[self.facets.face]
        corners = np.arange(3 * len(t), dtype=np.int32).reshape(-1, 3)
        return Mesh(t.reshape(-1, 3), corners, colour=np.repeat(colour[of], 3, axis=0))

    def figures(self) -> list[dict[str, Any]]:
        """A row for each face, for a file: what is not known is None."""
        return [
            {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in asdict(f).items()}
            for f in self.faces
        ]


def nearest_faces(points: Floats, facets: Facets) -> tuple[Floats, Ints]:
    """(n,) mm that points (n, 3) lie outside of faces, by their triangles, and (n,) the
    number of the nearest face."""
    d = deviation(points, facets.mesh)
    return d.distance, np.asarray(facets.order, dtype=np.int32)[facets.face[d.face]]


def face_deviations(
    distance: Floats,
    face: Ints,
    facets: Facets,
    count: int,
    triangles: Sequence[int] = (),
    sigma: Floats | None = None,
) -> FaceDeviations:
    """How measured points lie to ``count`` faces: each by its distance (n,) mm from a face (n,);
    ``triangles`` are the faces of which nothing is to be said, ``sigma`` (n,) mm what is known of
    the points."""
    many = np.bincount(face, minlength=count)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(face, distance, count) / many
        rms = np.sqrt(np.bincount(face, distance**2, count) / many)
    names = _names(facets, count)
    left = set(triangles)
    faces = tuple(
        FaceDeviation(k + 1, names[k], int(many[k]), float(mean[k]), float(rms[k]))
        for k in range(count)
        if k not in left
    )
    width = _width(mean[many > 0])
    return FaceDeviations(distance, faces, width, facets, tuple(triangles), sigma)


def _names(facets: Facets, count: int) -> Sequence[str]:
    out = ["B-spline"] * count
    for k, s in zip(facets.order, facets.surfaces, strict=True):
        if s is not None:
            out[k] = f"{'hollow ' if s.hollow else ''}{s.kind}"
    return out


def _width(means: Floats) -> float:
    """mm: 1, 2 or 5 times a power of ten, so that all colours together hold every mean."""
    most = max(float(np.abs(means).max(initial=0.0)) / (_MIDDLE + 0.5), _FINEST)
    power = 10.0 ** np.floor(np.log10(most))
    return float(next(s * power for s in _STEPS if s * power >= most * (1 - 1e-9)))
