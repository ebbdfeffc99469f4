"""How a measured surface is brought onto its reference: by shape, by datum features, or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, sample_surface, smoothed_normals, vector_areas
from turnscan.poses import Onto, View, onto, plain_view
from turnscan.remedy import Option, Remedy
from turnscan.rig import Pose, rotation_from_vector
from turnscan.shapes import deviation
from turnscan.shapes.primitives import Shape
from turnscan.workflows._options._compare import Way
from turnscan.workflows._options._units import STEP_SUFFIXES, UNITS
from turnscan.workflows._surface._nominal import Nominal

_SAMPLES = 40_000
"""On the reference, for alignment."""
_FEW = 2_000
_UNLIKE = 1.5
"""Factor between the sizes of a part and of what was measured of it, at most."""
_FAR = 0.01
"""Of the size: surfaces that lie further apart (rms) are hardly in one frame."""
_ROUNDS = 8
_NEAR = 4.0
"""Robust standard deviations within which points count for a datum."""
_LEAST = 30
_SYMMETRIC = "compare.symmetric"
_OPEN = 0.02
"""A motion along which a datum's surface rises by less than this part of it is left to the next."""
_ADRIFT = 0.1
"""The same part for a feature that an undetermined motion carries off its place; five times what
may rise at all where a motion counts as undetermined."""


@dataclass(frozen=True, eq=False)
class LooseMotion:
    """A motion in the frame of the reference that nothing determines, of 1 mm on the average."""

    middle: Floats
    """(3,) mm: what ``turn`` is about."""
    turn: Floats
    """(3,) radians."""
    shift: Floats
    """(3,) mm, with it."""


@dataclass(frozen=True)
class Placement:
    """How the measured surface was brought into the frame of its reference."""

    way: Way
    pose: Pose
    """Frame of the measured surface → frame of the reference."""
    text: str
    """In a line."""
    findings: tuple[Finding, ...] = ()
    figures: dict[str, Any] = field(default_factory=dict)
    loose: tuple[LooseMotion, ...] = ()
    """Along which the pose is one of many."""


def placed_by(way: Way, mesh: Mesh, name: str, reference: Nominal, datums: Sequence[int]) -> (
    Placement
):  # fmt: skip
    """Bring a mesh onto its reference.

    Raises InputError where it belongs nowhere on it, and for datums that are no features of it or
    were not measured.
    """
    if way == "none":
        return _as_they_are(mesh, reference)
    chosen = _datums(reference, datums) if way == "datums" else []
    by_shape = _by_shape(mesh, name, reference)
    return by_shape if way == "shape" else _by_datums(mesh, reference, chosen, by_shape)


def _as_they_are(mesh: Mesh, reference: Nominal) -> Placement:
    off = deviation(mesh.vertices[:: max(1, len(mesh.vertices) // 5000)], reference.mesh)
    size = float(np.linalg.norm(np.ptp(reference.mesh.vertices, axis=0)))
    found: tuple[Finding, ...] = ()
    rms = off.covered().rms
    unit = _other_unit(mesh, reference)
    if unit is not None:
        remedy = Remedy("if so, say ", unit)
        found = (Finding("compare.unit", "warning", _unlike(reference, unit), remedy=remedy),)
    elif not rms <= _FAR * size:
        text = f"the surfaces lie {off.rms:.3g} mm (rms) apart: they may not be in one frame"
        remedy = Remedy("bring them together by ", Option("align", "shape"))
        found = (Finding("compare.frames", "warning", text, remedy=remedy),)
    return Placement("none", Pose(), "not aligned: both are taken to be in one frame", found)


def reference_view(mesh: Mesh, name: str) -> View:
    """Samples of a drawn surface with the normals of its faces, for alignment."""
    points = sample_surface(mesh, _SAMPLES)[0]
    t = mesh.triangles[deviation(points, mesh).face]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    spacing = float(np.sqrt(mesh.area_of() / _SAMPLES))
    return plain_view(name, points, normal, spacing)


def _by_shape(mesh: Mesh, name: str, reference: Nominal) -> Placement:
    area = 2 * np.linalg.norm(vector_areas(mesh.triangles), axis=1)
    spacing = float(np.median(np.sqrt(area[area > 0]))) if (area > 0).any() else 1.0
    sigma = _sigma(mesh)
    measured = plain_view(name, mesh.vertices, smoothed_normals(mesh), spacing, sigma)
    _check_unit(mesh, reference)
    return _told(onto(reference_view(reference.mesh, reference.name), measured), mesh)


def _sigma(mesh: Mesh) -> Floats:
    """(v,) mm, the median where a vertex does not know its own; where none does a ten-thousandth of
    the size, which `align` raises to their scatter."""
    sigma = np.full(len(mesh.vertices), np.nan)
    if mesh.provenance is not None:
        sigma = mesh.provenance.sigma
    good = sigma > 0
    usual = float(np.median(sigma[good])) if good.any() else 1e-4 * _size(mesh)
    return np.where(good, sigma, usual)


def _size(mesh: Mesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def _check_unit(measured: Mesh, reference: Nominal) -> None:
    """Raises InputError, which proposes the unit, where sizes are as far apart as two units: such
    a reference need not be tried, for a part has no place on what is so much smaller."""
    unit = _other_unit(measured, reference)
    if unit is not None:
        raise InputError(_unlike(reference, unit), hint=Remedy("if so, say ", unit))


def _unlike(reference: Nominal, unit: Option) -> str:
    name = Path(reference.name).name
    return f"{name} is too small for the part: it may be drawn in another unit ({unit.value_text})"


def _other_unit(measured: Mesh, reference: Nominal) -> Option | None:
    """The unit in which a reference has the size of the part; None where it may be in mm, and for
    STEP, which says its unit."""
    if Path(reference.name).suffix.lower() in STEP_SUFFIXES:
        return None
    spread = [sample_surface(m, _FEW)[0].std(axis=0) for m in (measured, reference.mesh)]
    ratio = float(np.linalg.norm(spread[0]) / max(float(np.linalg.norm(spread[1])), 1e-300))
    for unit, scale in UNITS.items():
        if unit != "mm" and abs(np.log(ratio / scale)) < np.log(_UNLIKE):
            return Option("reference_unit", unit)
    return None


def _told(found: Onto, mesh: Mesh) -> Placement:
    pose, a = found.pose, found.alignment
    moved, turned = _motion(pose, mesh)
    findings = []
    if found.rivals:
        text = f"it fits in {found.rivals} other ways as well, the best is taken"
        findings.append(Finding(_SYMMETRIC, "note", text))
    for free in a.freedoms:
        text = f"{free} is not determined by the shape"
        findings.append(Finding("compare.free", "note", text))
    loose = tuple(LooseMotion(m.middle, m.turn, m.shift) for m in a.freedoms)
    sigma = np.sqrt(np.diagonal(a.covariance[1]))
    figures = {
        "turned_deg": turned,
        "moved_mm": moved,
        "turn_sigma_deg": np.rad2deg(sigma[:3]).tolist(),
        "shift_sigma_mm": sigma[3:].tolist(),
        "other_ways": found.rivals,
        "undetermined": [str(f) for f in a.freedoms],
    }
    text = f"aligned by shape: turned {turned:.3f}° and moved {moved:.3f} mm"
    return Placement("shape", pose, text, tuple(findings), figures, loose)


def adrift(reference: Nominal, loose: Sequence[LooseMotion]) -> set[int]:
    """Features, by index, that an undetermined motion carries off their places: how far points lie
    from these is chance."""
    out = set[int]()
    for k, shape in enumerate(reference.shapes):
        X = reference.mesh.vertices[np.unique(reference.mesh.faces[reference.label == k])]
        n = _normals(shape, X, shape.distances(X))
        for m in loose:
            rise = np.einsum("ij,ij->i", n, m.shift + np.cross(m.turn, X - m.middle))
            if len(X) and float(np.sqrt(np.mean(rise**2))) > _ADRIFT:
                out.add(k)
    return out


def _motion(pose: Pose, mesh: Mesh) -> tuple[float, float]:
    """mm that the middle of a mesh moves by, and the angle it turns by, degrees."""
    middle = mesh.vertices.mean(axis=0)
    moved = float(np.linalg.norm(pose.apply(middle[None])[0] - middle))
    cosine = np.clip((np.trace(pose.rotation) - 1) / 2, -1, 1)
    return moved, float(np.rad2deg(np.arccos(cosine)))


def _by_datums(
    mesh: Mesh, reference: Nominal, chosen: Sequence[int], start: Placement
) -> Placement:
    """The datum features, by index, in their order: each takes what those before it leave open.

    Each is associated by least squares of its points, whose scatter trims them (ISO 5459 has the
    contacting plane in place of that, which noise makes unsure).
    """
    pose = start.pose
    datums = [k + 1 for k in chosen]
    every = deviation(pose.apply(mesh.vertices), reference.mesh)
    label = reference.label[every.face]
    rows = [np.flatnonzero((label == k) & ~every.beyond) for k in chosen]
    for number, own in zip(datums, rows, strict=True):
        if len(own) < _LEAST:
            raise InputError(
                f"datum {number}: {len(own)} measured points on it, at least {_LEAST} are needed",
                hint="choose another feature",
                option=Option("datums"),
            )
    middle = reference.mesh.vertices.mean(axis=0)
    lever = _size(reference.mesh) / 2
    taken: list[int] = []
    for _ in range(_ROUNDS):
        basis = np.eye(6)
        taken.clear()
        for k, own in zip(chosen, rows, strict=True):
            points = pose.apply(mesh.vertices[own])
            shape = reference.shapes[k]
            pose, basis, count = _held(pose, shape, points, basis, middle, lever)
            taken.append(count)
    moved, turned = _motion(pose, mesh)
    text = (
        f"aligned by datums {', '.join(map(str, datums))} (least squares, in this order): turned "
        f"{turned:.3f}° and moved {moved:.3f} mm"
    )
    left = 6 - sum(taken)
    # Datums hold the place that the shape found: which of several it is they do not tell.
    findings = tuple(f for f in start.findings if left or f.code == _SYMMETRIC)
    if left:
        said = f"the datums leave {left} of six freedoms open; there the alignment is that by shape"
        findings = (*findings, Finding("compare.datums", "note", said))
    figures = {
        "turned_deg": turned,
        "moved_mm": moved,
        "freedoms_taken": list(taken),
        "other_ways": start.figures["other_ways"],
    }
    loose = tuple(m for m in start.loose if not adrift(reference, [m]) & set(chosen))
    return Placement("datums", pose, text, findings, figures, loose)


def _datums(reference: Nominal, datums: Sequence[int]) -> list[int]:
    if not datums:
        raise InputError(
            "no datum is given", hint="give the numbers of features", option=Option("datums")
        )
    if len(set(datums)) != len(datums) or max(datums) > len(reference.shapes):
        what = f"the reference has features 1 to {len(reference.shapes)}"
        if not reference.shapes:
            what = "the reference has no planes, cylinders or spheres"
        raise InputError(
            f"datums {', '.join(map(str, datums))}: {what}",
            hint="give each once, in the order of precedence",
            option=Option("datums"),
        )
    return [number - 1 for number in datums]


def _held(
    pose: Pose, shape: Shape, points: Floats, basis: Floats, middle: Floats, lever: float
) -> tuple[Pose, Floats, int]:
    """A step of the pose within ``basis`` (6, m), what it leaves of that, and how much it took.

    Turns are about ``middle`` and in units of ``lever`` mm.
    """
    if not basis.shape[1]:
        return pose, basis, 0
    r = shape.distances(points)
    n = _normals(shape, points, r)
    scatter = 1.4826 * float(np.median(np.abs(r - np.median(r)))) + 1e-12
    keep: Bools = np.abs(r - np.median(r)) <= _NEAR * scatter
    J = np.concatenate([np.cross(points - middle, n) / lever, n], axis=1)[keep] @ basis
    values, vectors = np.linalg.eigh(J.T @ J / len(J))
    firm = values > _OPEN**2
    if not firm.any():
        return pose, basis, 0
    V = vectors[:, firm]
    step = basis @ V @ np.linalg.lstsq(J @ V, -r[keep], rcond=None)[0]
    turn = rotation_from_vector(step[:3] / lever)
    there = Pose(turn, middle - turn @ middle + step[3:])
    return there @ pose, basis @ vectors[:, ~firm], int(firm.sum())


def _normals(shape: Shape, points: Floats, off: Floats) -> Floats:
    """(n, 3) how the distance from a shape rises, by differences."""
    h = 1e-4
    rise = [shape.distances(points + h * e) - off for e in np.eye(3)]
    return np.asarray(np.stack(rise, axis=1) / h)


def labels_of(reference: Nominal, face: Ints, beyond: Bools) -> Ints:
    """(n,) index of the feature of each point by its nearest face; −1 for none."""
    label = reference.label[face].copy()
    label[beyond] = -1
    return label
