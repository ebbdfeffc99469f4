"""Features of a reference: the planes, cylinders and spheres that it is drawn of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import DidNotConverge, InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, opposite_half_edges, vector_areas
from turnscan.progress import Progress
from turnscan.shapes import fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes.primitives import Kind, Shape
from turnscan.workflows._files._reading import read_step_file, step_findings
from turnscan.workflows._options._units import STEP_SUFFIXES
from turnscan.workflows._surface._loading import Source, load

_FLAT = np.deg2rad(0.05)
"""Between facets of one plane."""
_SMOOTH = np.deg2rad(30.0)
"""Between facets of one curved face."""
_WIDER = 3.0
"""A plane that goes over into curved faces is so much larger than each facet of those."""
_EXACT = 1e-4
"""Of its size: how far the vertices of a curved face may be off the shape it is drawn as."""
_LARGE = 1e-3
"""Of the area: smaller faces are no features."""
_FEW = 4
"""Facets of a smooth face of no shape, at most, that are planes with a blunt angle between them."""
_MOST = 500
"""Curved faces that a shape is looked for in."""


@dataclass(frozen=True, eq=False)
class Nominal:
    """A reference, with what it is drawn of."""

    name: str
    mesh: Mesh
    shapes: tuple[Shape, ...]
    """The largest first."""
    label: Ints
    """(f,) index of the shape of each face; −1 for freeform."""
    findings: tuple[Finding, ...] = ()
    """What is odd about its file."""


def nominal(source: Source, unit: str, progress: Progress) -> Nominal:
    """A reference with its features: those of a STEP file are exact, those of a mesh are found from
    how its facets meet: planes, cylinders and spheres.

    Raises InputError where there is no surface.
    """
    if isinstance(source, str | Path) and Path(source).suffix.lower() in STEP_SUFFIXES:
        part = read_step_file(Path(source))
        odd = step_findings(part, Path(source))
        return Nominal(str(source), part.mesh, part.shapes, part.label, odd)
    loaded = load(source, unit, progress)
    return Nominal(loaded.name, loaded.mesh, (), np.full(len(loaded.mesh.faces), -1, np.int32))


def with_features(found: Nominal) -> Nominal:
    """The same with the features that the facets of its mesh show, where it has none yet."""
    if found.shapes or not len(found.mesh.faces):
        return found
    shapes, label = _features(found.mesh)
    return replace(found, shapes=shapes, label=label)


def _features(mesh: Mesh) -> tuple[tuple[Shape, ...], Ints]:
    vectors = vector_areas(mesh.triangles)
    area = np.linalg.norm(vectors, axis=1)
    normal = vectors / np.maximum(area, 1e-300)[:, None]
    a, b, bend = _meetings(mesh, normal)
    flat = _grouped(a, b, bend < _FLAT, len(area))
    size = np.bincount(flat, area)
    smooth = (bend >= _FLAT) & (bend < _SMOOTH)
    beside = np.zeros(len(size))
    np.maximum.at(beside, flat[a[smooth]], size[flat[b[smooth]]])
    np.maximum.at(beside, flat[b[smooth]], size[flat[a[smooth]]])
    plane = size > _WIDER * beside
    curved = ~plane[flat]
    patch = _grouped(a, b, (bend < _SMOOTH) & curved[a] & curved[b], len(area))
    least = _LARGE * float(area.sum())
    out: list[tuple[Shape, Bools]] = []
    for one in np.flatnonzero(plane & (size >= least)):
        out.append((_plane(mesh, flat == one, normal), flat == one))
    extent = np.bincount(patch, np.where(curved, area, 0.0))
    for one in np.argsort(-extent)[:_MOST]:
        if extent[one] >= least:
            own = (patch == one) & curved
            out += _curved(mesh, own, flat, normal, least)
    out.sort(key=lambda one: -one[0].area)
    label = np.full(len(area), -1, dtype=np.int32)
    for k, (_, own) in enumerate(out):
        label[own] = k
    return tuple(s for s, _ in out), label


def _meetings(mesh: Mesh, normal: Floats) -> tuple[Ints, Ints, Floats]:
    """Pairs of faces that share a side, and the angle between their normals, radians.

    A face without area, as STL files have them where a side is met by two, has no direction: it
    joins nothing.
    """
    twin = opposite_half_edges(mesh.faces)
    here = np.flatnonzero(twin > np.arange(len(twin)))
    a, b = (here // 3).astype(np.int32), (twin[here] // 3).astype(np.int32)
    cross = np.linalg.norm(np.cross(normal[a], normal[b]), axis=1)
    bend = np.arctan2(cross, np.einsum("ij,ij->i", normal[a], normal[b]))
    bend[~(normal[a].any(axis=1) & normal[b].any(axis=1))] = np.pi
    return a, b, bend


def _grouped(a: Ints, b: Ints, joined: Bools, count: int) -> Ints:
    """(count,) number of the group of each face, joined along those sides."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    link = coo_matrix((np.ones(int(joined.sum())), (a[joined], b[joined])), shape=(count, count))
    number: Ints = connected_components(link, directed=False)[1].astype(np.int32)
    return number


def _plane(mesh: Mesh, own: Bools, normal: Floats) -> Shape:
    X = mesh.vertices[np.unique(mesh.faces[own])]
    area = mesh.area_of(own)
    mean = (normal[own] * mesh_areas(mesh, own)[:, None]).sum(axis=0)
    axis = mean / np.linalg.norm(mean)
    if len(X) > 3:
        fitted = fit_plane(X).normal
        axis = fitted * np.sign(fitted @ axis)
    return _shape("plane", X.mean(axis=0), axis, 0.0, False, area, 0.0)


def mesh_areas(mesh: Mesh, own: Bools) -> Floats:
    """(n,) mm² of the faces where ``own`` (f,) is True."""
    area: Floats = np.linalg.norm(vector_areas(mesh.triangles[own]), axis=1)
    return area


def _shape(
    kind: Kind, point: Floats, axis: Floats, radius: float, hollow: bool, area: float, length: float
) -> Shape:
    return Shape(
        kind, point, axis, radius, 0.0, hollow, np.zeros((7, 7)), 0, area, 0.0, length
    )  # fmt: skip


def _curved(
    mesh: Mesh, own: Bools, flat: Ints, normal: Floats, least: float
) -> Iterator[tuple[Shape, Bools]]:
    """The cylinder or sphere of a curved face; else the large planes in it."""
    X = mesh.vertices[np.unique(mesh.faces[own])]
    limit = _EXACT * float(np.linalg.norm(np.ptp(X, axis=0)))
    middle = mesh.triangles[own].mean(axis=1)
    area = mesh.area_of(own)
    try:
        c = fit_cylinder(X)
        if np.abs(c.distances(X)).max() <= limit:
            along = (X - c.point) @ c.axis
            out = (middle - c.point) - ((middle - c.point) @ c.axis)[:, None] * c.axis
            hollow = bool(np.einsum("ij,ij->", out, normal[own]) < 0)
            made = _shape("cylinder", c.point, c.axis, c.radius, hollow, area, float(np.ptp(along)))
            yield made, own
            return
    except (InputError, DidNotConverge, np.linalg.LinAlgError):
        pass
    try:
        s = fit_sphere(X)
        if np.abs(s.distances(X)).max() <= limit:
            hollow = bool(np.einsum("ij,ij->", middle - s.centre, normal[own]) < 0)
            up = np.array([0.0, 0.0, 1.0])
            yield _shape("sphere", s.centre, up, s.radius, hollow, area, 0.0), own
            return
    except (InputError, DidNotConverge, np.linalg.LinAlgError):
        pass
    groups, where = np.unique(flat[own], return_inverse=True)
    size = np.bincount(where.reshape(-1), mesh_areas(mesh, own))
    for k in groups[size >= least] if len(groups) <= _FEW else ():
        yield _plane(mesh, flat == k, normal), flat == k
