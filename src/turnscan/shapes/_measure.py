"""Measurements on a surface: a value and its standard uncertainty.

The uncertainty is that of the points' own noise, and for volumes also of what lies between the
points, was filled, and is common to all of them (`Source`). For the others, what the calibration of
the rig leaves open comes on top (`turnscan.points.systematic_sigma`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, frozen
from turnscan.errors import DidNotConverge, InputError
from turnscan.mesh import Mesh, is_closed, measured_vertices, sections, vector_areas
from turnscan.shapes._added import filled_area_sigma
from turnscan.shapes._area import smooth_area, smooth_normals
from turnscan.shapes._fit import fit_circle, fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes._forms import Plane
from turnscan.shapes._outline_together import held_together
from turnscan.shapes._section import crossed, plane_cut
from turnscan.shapes._shared import Source
from turnscan.shapes._volume import volume_sigma

Unit = Literal["mm", "mm²", "mm³", "rad"]
_SHARED = 2.0
"""Each vertex counts for about this many points of a section, which are so not independent."""
_IN_LINE = 1e-3
"""rad: an angle nearer to 0 or π than this says nothing of the plane that it lies in."""


@dataclass(frozen=True)
class Measured:
    """What was measured, and how well."""

    value: float
    unit: Unit
    sigma: float
    """Standard uncertainty from the points' noise, in the unit; NaN where nothing is known."""
    places: Floats
    """(k, 3) mm: where to show it."""
    text: str
    """How it came about, in words."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "places", frozen(self.places, (None, 3), "Measured.places"))

    def __str__(self) -> str:
        """For people: the value with its standard uncertainty, angles in degrees."""
        scale, unit = (np.degrees(1.0), "°") if self.unit == "rad" else (1.0, f" {self.unit}")
        known = "" if np.isnan(self.sigma) else f" ± {scale * self.sigma:.3g}"
        return f"{scale * self.value:.4f}{known}{unit}, {self.text}"


@dataclass(frozen=True)
class Spot:
    """A point on a surface, and how well it is known."""

    at: Floats
    """(3,) mm."""
    sigma: float = np.nan
    """mm, across the surface; NaN where not known."""
    across: Floats = field(default_factory=lambda: np.eye(3))
    """(3, 3) how much of the variance there is in each direction (`_across`): along the
    surface a point that was picked is another point of it, and not off it."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", frozen(self.at, (3,), "Spot.at"))
        object.__setattr__(self, "across", frozen(self.across, (3, 3), "Spot.across"))

    @classmethod
    def on(cls, mesh: Mesh, vertex: int, at: Floats) -> Spot:
        """A place (3,) mm on a mesh, as well known as the vertex nearest to it."""
        p = mesh.provenance
        about = mesh.faces[(mesh.faces == vertex).any(axis=1)]
        sigma = np.nan if p is None else float(p.sigma[vertex])
        return cls(at, sigma, _across(mesh.vertices[about]))

    def variance(self, slope: Floats) -> float:
        """What its noise adds to the variance of a value that changes by ``slope`` (3,) a mm."""
        return float(self.sigma**2 * (slope @ self.across @ slope))


def _across(triangles: Floats) -> Floats:
    """(3, 3) `Spot.across` of a place on triangles (f, 3, 3).

    One along the normal of a flat surface and 0 along it; at an edge, one across either face. What
    noise tilts counts as it is, so that nothing is said to be known better than the faces show.
    """
    vectors = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    sizes = np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)
    every = np.einsum("fi,fj->ij", vectors / sizes[:, None], vectors)
    largest = float(np.linalg.eigvalsh(every)[-1])
    return np.asarray(every / largest) if largest > 0 else np.eye(3)


def distance(a: Spot, b: Spot) -> Measured:
    """Between two points."""
    value = float(np.linalg.norm(b.at - a.at))
    if value > 0:
        along = (b.at - a.at) / value
        sigma = float(np.sqrt(a.variance(along) + b.variance(along)))
    else:
        sigma = float(np.hypot(a.sigma, b.sigma))
    return Measured(value, "mm", sigma, np.stack([a.at, b.at]), "from point to point")


def to_plane(point: Spot, plane: Plane) -> Measured:
    """From a point to a plane, along the plane's normal; positive on the side it points to."""
    value = float(plane.distances(point.at))
    foot = point.at - value * plane.normal
    # Tilts are about the principal directions of the plane's points, through their centre.
    lever = float(np.linalg.norm(foot - plane.centre)) * plane.normal_sigma
    own = point.variance(plane.normal)
    sigma = float(np.sqrt(own + plane.covariance[2, 2] + lever**2))
    text = f"from a point to a plane of {plane.count} points, rms {plane.rms:.3f} mm"
    return Measured(value, "mm", sigma, np.stack([point.at, foot]), text)


def corner_angle(a: Spot, corner: Spot, b: Spot) -> Measured:
    """The angle at ``corner`` between the directions to two other points."""
    p, q = a.at - corner.at, b.at - corner.at
    lengths = float(np.linalg.norm(p)), float(np.linalg.norm(q))
    if min(lengths) == 0:
        raise InputError("an angle between points that coincide", hint="choose three points")
    value = float(np.arctan2(np.linalg.norm(np.cross(p, q)), p @ q))
    cross = np.cross(p, q)
    if np.linalg.norm(cross) > _IN_LINE * lengths[0] * lengths[1]:
        to_a, to_b = (
            -aside / np.linalg.norm(aside) / length
            for aside, length in zip((np.cross(cross, p), np.cross(q, cross)), lengths, strict=True)
        )
        parts = a.variance(to_a) + b.variance(to_b) + corner.variance(to_a + to_b)
        sigma = float(np.sqrt(parts))
    else:  # whichever way a point moves across the line, the angle changes
        ends = np.hypot(a.sigma / lengths[0], b.sigma / lengths[1])
        at_corner = corner.sigma * np.linalg.norm(p - q) / (lengths[0] * lengths[1])
        sigma = float(np.hypot(ends, at_corner))
    return Measured(value, "rad", sigma, np.stack([a.at, corner.at, b.at]), "at a vertex")


def planes_angle(first: Plane, second: Plane) -> Measured:
    """The angle between the normals of two planes, 0 to π."""
    cross = float(np.linalg.norm(np.cross(first.normal, second.normal)))
    value = float(np.arctan2(cross, first.normal @ second.normal))
    sigma = float(np.hypot(first.normal_sigma, second.normal_sigma))
    text = f"between planes of {first.count} and {second.count} points"
    return Measured(value, "rad", sigma, np.stack([first.centre, second.centre]), text)


def plane_of(mesh: Mesh, faces: Bools, *, value_alone: bool = False) -> Plane:
    """The plane of the faces (f,) chosen, its normal outward. Raises InputError for too few.

    For its ``value_alone`` nothing is asked of what its points share: its covariance is too small.
    """
    points, sigma, wide = _corners(mesh, faces)
    plane = fit_plane(points, sigma, None if value_alone else wide)
    t = mesh.triangles[faces]
    outward = vector_areas(t).sum(axis=0)
    if outward @ plane.normal >= 0:
        return plane
    return Plane(
        -plane.normal, -plane.distance, plane.centre, plane.rms, plane.covariance, plane.count
    )


def region_diameter(mesh: Mesh, faces: Bools, *, value_alone: bool = False) -> Measured:
    """The diameter of the cylinder or sphere that the chosen faces (f,) are part of.

    Both are fitted to their measured corners; the better one counts. ``value_alone`` as for
    `plane_of`. Raises InputError for too few points, DidNotConverge where neither fits.
    """
    points, sigma, area = _corners(mesh, faces)
    wide = None if value_alone else area
    found = []
    try:
        c = fit_cylinder(points, sigma, wide)
        found.append((c.rms, c.radius, float(c.covariance[4, 4]), c.point, "cylinder"))
    except (InputError, DidNotConverge):
        pass
    try:
        s = fit_sphere(points, sigma, wide)
        found.append((s.rms, s.radius, float(s.covariance[3, 3]), s.centre, "sphere"))
    except (InputError, DidNotConverge):
        pass
    if not found:
        raise DidNotConverge("neither a cylinder nor a sphere fits", hint="choose a rounder region")
    rms, radius, variance, centre, what = min(found, key=lambda f: f[0])
    text = f"{what} through {len(points)} points, rms {rms:.3f} mm"
    return Measured(2 * radius, "mm", 2 * float(np.sqrt(variance)), centre[None], text)


def section_base(mesh: Mesh, normal: npt.ArrayLike, distance: float) -> float:
    """How far noise hangs together along a section (`held_together`), the same while its vertices
    move little; 1 where nothing is known of it."""
    if mesh.provenance is None or not len(mesh.faces):
        return 1.0
    cut = plane_cut(normal, distance)
    return held_together(mesh, cut, crossed(mesh, cut))


def section_diameter(
    mesh: Mesh,
    normal: npt.ArrayLike,
    distance: float,
    near: npt.ArrayLike | None = None,
    base: float | None = None,
) -> Measured:
    """The diameter of a circle through the section of a mesh with the plane n·x = ``distance``.

    Of several loops the one that comes nearest to ``near`` (3,) counts, or the longest; points
    that nobody measured are left out. ``base`` (`section_base`) where it is known. Raises
    InputError where the plane does not meet the mesh.
    """
    loops = sections(mesh, normal, distance)
    if not loops:
        raise InputError(
            "the plane does not meet the surface", hint="move it so that it cuts the part"
        )
    loop = loops[0]
    if near is not None:
        at = np.asarray(near, dtype=np.float64)
        loop = min(loops, key=lambda s: float(np.linalg.norm(s.points - at, axis=1).min()))
    seen = loop.measured
    points, bulge = loop.points[seen], loop.bulge[seen]
    sigma = sigma_of(mesh, loop.near[seen])
    wide = None
    if sigma is not None:
        together = section_base(mesh, normal, distance) if base is None else base
        wide = sigma * np.sqrt(_SHARED * together)
    c = fit_circle(points, normal, wide)
    for _ in range(2):
        # The points lie on chords of the circle that the vertices are on: move them out to it.
        out = points - c.centre
        out -= np.outer(out @ c.normal, c.normal)
        apart = np.maximum((out**2).sum(axis=1), 1e-12)
        c = fit_circle(points + out * (np.sqrt(1.0 + bulge / apart) - 1.0)[:, None], normal, wide)
    shared = 1.0 if sigma is not None else _SHARED
    text = f"circle at z = {c.centre[2]:.2f} mm through {c.count} points, rms {c.rms:.3f} mm"
    return Measured(
        2 * c.radius, "mm", 2 * float(np.sqrt(shared * c.covariance[2, 2])), c.centre[None], text
    )


class AreaBase(NamedTuple):
    """What an area rests on beside the places of its vertices, the same while these move little."""

    normals: Floats | None
    """(f, 3) of the smooth surface (`smooth_normals`)."""
    filled: float
    """mm²: what the faces that were not measured may be wrong by (`filled_area_sigma`)."""


def area_base(mesh: Mesh, faces: Bools | None = None) -> AreaBase:
    """Of the area of a mesh, or of the faces (f,) chosen."""
    return AreaBase(smooth_normals(mesh), filled_area_sigma(mesh, faces))


def area(mesh: Mesh, faces: Bools | None = None, base: AreaBase | None = None) -> Measured:
    """The area of the smooth surface of a mesh, or of the faces (f,) chosen: noise adds nothing.

    ``base`` where it is known. A mesh whose points have no sigma is taken as it is.
    """
    chosen = np.ones(len(mesh.faces), dtype=np.bool_) if faces is None else faces
    normals, filled = area_base(mesh, faces) if base is None else base
    found, sigma = smooth_area(mesh, chosen, normals)
    sigma = float(np.hypot(sigma, filled))
    t = mesh.triangles[chosen]
    each = np.linalg.norm(vector_areas(t), axis=1)
    text = f"of {int(chosen.sum())} faces" + _unmeasured(mesh, chosen, each)
    if not np.isnan(sigma):
        text += f"; {max(float(each.sum()) - found, 0.0):.1f} mm² of roughness by noise taken off"
    return Measured(found, "mm²", sigma, _middle(t), text)


def volume(mesh: Mesh, source: Source | None = None) -> Measured:
    """The volume within a closed mesh, with the parts of its uncertainty that `volume_sigma` knows.

    Raises InputError for an open one.
    """
    if not is_closed(mesh):
        raise InputError("the surface is open, so it has no volume", hint="close it first")
    t = mesh.triangles
    each = np.linalg.norm(vector_areas(t), axis=1)
    known = volume_sigma(mesh, source)
    text = "within the surface" + _unmeasured(mesh, np.ones(len(t), dtype=np.bool_), each)
    if known.added or known.unmeasured:
        text += f"; {mesh.volume - known.added:.0f} ± {known.measured:.3g} mm³ of it measured, "
        text += f"{known.added:.0f} ± {known.unmeasured:.3g} filled"
    if not np.isnan(known.total):
        text += f"; the uncertainty is mostly {known.mostly}"
    return Measured(mesh.volume, "mm³", known.total, _middle(t), text)


def _corners(mesh: Mesh, faces: Bools) -> tuple[Floats, Floats | None, float]:
    """The measured vertices of the chosen faces, their sigma where all have one, and the mm² that
    the measured faces are wide."""
    known = faces if mesh.measured is None else faces & mesh.measured
    chosen = np.zeros(len(mesh.vertices), dtype=np.bool_)
    chosen[mesh.faces[known]] = True
    used = np.flatnonzero(chosen & measured_vertices(mesh))
    if not len(used):
        raise InputError("no measured faces are selected", hint="select measured faces")
    return mesh.vertices[used], sigma_of(mesh, used), mesh.area_of(known)


def measured_points(mesh: Mesh) -> tuple[Floats, Floats | None]:
    """(n, 3) mm: the vertices that were measured, and their sigma (n,) mm where all have one.

    Raises InputError where there are none.
    """
    used = np.flatnonzero(measured_vertices(mesh))
    if not len(used):
        raise InputError("none of it was measured", hint="select measured faces, not fillings")
    return mesh.vertices[used], sigma_of(mesh, used)


def sigma_of(mesh: Mesh, vertices: npt.NDArray[np.integer]) -> Floats | None:
    """(n,) mm: standard uncertainties of those vertices; None unless all have one."""
    if mesh.provenance is None:
        return None
    sigma = mesh.provenance.sigma[vertices]
    return sigma if bool((sigma > 0).all()) else None


def _unmeasured(mesh: Mesh, chosen: Bools, each: Floats) -> str:
    if mesh.measured is None or mesh.measured[chosen].all():
        return ""
    share = float(each[~mesh.measured[chosen]].sum() / each.sum())
    return f"; {share:.1%} of its area was not measured"


def _middle(t: Floats) -> Floats:
    return t.reshape(-1, 3).mean(axis=0)[None] if len(t) else np.zeros((0, 3))
