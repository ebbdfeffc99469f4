"""Flat faces in a survey, cut free of their edges, and planes of one direction through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.shapes._fit import fit_plane
from turnscan.shapes._forms import Plane
from turnscan.shapes.verification._statistics import kept, own_residual
from turnscan.shapes.verification._survey import Index, Survey

_LOOK = 20_000
_TRIES = 300
_MOST = 14
"""Faces that are looked for, at most."""
_SMALLEST = 0.015
"""Share of all points that a face has at least."""
_FEWEST = 200
_PIXELS = 48
"""Cells across the longer side of a face, in which its outline is searched."""
_PARALLEL = np.cos(np.radians(3.0))


@dataclass(frozen=True)
class Face:
    """A flat face as it was measured."""

    index: Index
    """(n,) points of the survey that count; the plane goes through all but 0.3 % of them."""
    plane: Plane
    """Its covariance holds the points' noise and, by `clumping`, what neighbours share of what the
    calibration has not bent (`own_residual`)."""
    residual: Floats
    """(n,) mm: distance of each point from the plane."""
    left_out: float
    """Share of the face's points that do not count: near its edges."""
    clumping: float


@dataclass(frozen=True)
class Levels:
    """Faces with one common normal, at their heights above the first."""

    faces: tuple[Face, ...]
    normal: Floats
    """(3,) unit, from the first towards the others."""
    heights: Floats
    """(k,) mm of the further ones."""
    sigma: Floats
    """(k,) mm: standard uncertainty of `heights` from the points."""


def find_faces(survey: Survey, tolerance: float, margin: float) -> list[Face]:
    """The flat faces of a survey, those of most points first.

    ``tolerance`` mm: points that far off still belong to a face, good or bad; ``margin`` mm: what
    lies nearer to its edges does not count. Points of other surfaces that happen to lie in its
    plane are not connected with it and do not count either.
    """
    X = survey.points
    left = np.arange(len(X), dtype=np.intp)
    found = list[Face]()
    dice = np.random.default_rng(0)  # a search, always the same
    while len(found) < _MOST and len(left) > max(_SMALLEST * len(X), _FEWEST):
        at = _sought(X[left], tolerance, dice)
        if at is None:
            break
        normal, distance = at
        near = np.abs(X[left] @ normal - distance) < tolerance
        if near.sum() < max(_SMALLEST * len(X), _FEWEST):
            break
        face = face_of(survey, left[near], margin)
        if face is not None:
            found.append(face)
        left = left[~near]
    return sorted(found, key=lambda f: -len(f.index))


def face_of(survey: Survey, near: Index, margin: float) -> Face | None:
    """The face among points (k,) of about one plane, without its edges; None if too small."""
    X = survey.points[near]
    plane = fit_plane(X)
    good = near[_inner(X, plane, margin)]
    if len(good) < _FEWEST:
        return None
    X = survey.points[good]
    fit = fit_plane(X[kept(fit_plane(X).distances(X))])
    residual = fit.distances(X)
    bends = _moves(survey, fit.centre, good, fit.normal)[1]
    shared = own_residual(residual, bends, _tile(X, fit), 3)[1]
    plane = Plane(fit.normal, fit.distance, fit.centre, fit.rms, fit.covariance * shared, fit.count)
    return Face(good, plane, residual, 1.0 - len(good) / len(near), shared)


def levels_of(survey: Survey, faces: Sequence[Face], heights: Sequence[float]) -> Levels:
    """Of the faces, those that lie at these heights (k,) mm above one of them, with one normal.

    Raises InputError where no such set agrees within a fifth of the smallest step.
    """
    want = np.array([0.0, *heights])
    reach = 0.2 * float(np.diff(want).min())
    best, least = None, np.inf
    for lead in faces:
        alike = [f for f in faces if abs(f.plane.normal @ lead.plane.normal) > _PARALLEL]
        at = np.array([f.plane.centre @ lead.plane.normal for f in alike])
        for chosen in combinations(range(len(alike)), len(want)):
            for sign in (1.0, -1.0):
                order = sorted(chosen, key=lambda k: sign * at[k])
                off = sign * at[order] - want
                worst = float(np.abs(off - off.mean()).max())
                if worst < least:
                    best, least = [alike[k] for k in order], worst
    if best is None or least > reach:
        steps = ", ".join(f"{h:g}" for h in heights)
        near = "" if best is None else f"; the nearest set is {least:.3f} mm off"
        raise InputError(
            f"no parallel faces {steps} mm above one among {len(faces)} flat faces{near}",
            hint="is this the artefact, are its levels visible, and is this the right file?",
        )
    return joint(survey, best)


def joint(survey: Survey, faces: Sequence[Face]) -> Levels:
    """Planes of one common normal through faces, by least squares over all their points.

    Each face weighs by its own scatter, enlarged by its `clumping`.
    """
    lead = faces[0].plane
    toward = faces[-1].plane.centre - lead.centre
    normal = lead.normal if lead.normal @ toward > 0 else -lead.normal
    k = len(faces)
    for _ in range(4):
        e1, e2 = _across(normal)
        N, b = np.zeros((k + 2, k + 2)), np.zeros(k + 2)
        for j, f in enumerate(faces):
            d = survey.points[f.index] - lead.centre
            A = np.zeros((len(d), k + 2))
            A[:, 0], A[:, 1], A[:, 2 + j] = -(d @ e1), -(d @ e2), 1.0
            w = 1.0 / (max(f.plane.rms, 1e-9) ** 2 * f.clumping)
            N += w * A.T @ A
            b += w * A.T @ (d @ normal)
        C = np.linalg.inv(N)
        p = C @ b
        normal = normal + p[0] * e1 + p[1] * e2
        normal /= np.linalg.norm(normal)
    up = np.zeros((k - 1, k + 2))
    up[:, 2], up[:, 3:] = -1.0, np.eye(k - 1)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", up, C, up))
    return Levels(tuple(faces), normal, up @ p, sigma)


def face_moves(survey: Survey, face: Face, some: Index, normal: Floats) -> tuple[Floats, Floats]:
    """How the calibration moves a face: (m, 3) mm and rad, shift at its centre and tilts about the
    principal directions; (m, k) mm its residuals. By the points ``some`` (k,), as `ball_moves`.
    """
    return _moves(survey, face.plane.centre, some, normal)


def _moves(survey: Survey, centre: Floats, some: Index, normal: Floats) -> tuple[Floats, Floats]:
    """As `face_moves`, of the plane through ``some`` about a ``centre`` (3,) mm."""
    e1, e2 = _across(normal)
    d = survey.points[some] - centre
    J = np.column_stack([np.ones(len(d)), d @ e1, d @ e2])
    pushed = survey.pushed(some, normal)
    p = pushed @ np.linalg.pinv(J).T
    return p, pushed - p @ J.T


def level_moves(survey: Survey, levels: Levels, some: Sequence[Index]) -> Floats:
    """(m, k) mm: how the calibration moves the heights of levels; as `ball_moves`."""
    e1, e2 = _across(levels.normal)
    lead = levels.faces[0].plane.centre
    k = len(levels.faces)
    rows, pushed = [], []
    for j, index in enumerate(some):
        d = survey.points[index] - lead
        A = np.zeros((len(d), k + 2))
        A[:, 0], A[:, 1], A[:, 2 + j] = -(d @ e1), -(d @ e2), 1.0
        rows.append(A)
        pushed.append(survey.pushed(index, levels.normal))
    p = np.concatenate(pushed, axis=1) @ np.linalg.pinv(np.concatenate(rows)).T
    moved: Floats = p[:, 3:] - p[:, 2:3]
    return moved


def _sought(X: Floats, tolerance: float, dice: np.random.Generator) -> tuple[Floats, float] | None:
    """Normal and distance of the plane that most points lie on, from triples of neighbours."""
    from scipy.spatial import cKDTree

    look = X[:: max(len(X) // _LOOK, 1)]
    reach = 0.12 * float(np.linalg.norm(np.ptp(look, axis=0)))
    tree = cKDTree(look)
    best, most = None, 0
    for seed in dice.integers(0, len(look), _TRIES):
        near = look[tree.query_ball_point(look[seed], reach)]
        if len(near) < 10:
            continue
        a, b, c = near[dice.integers(0, len(near), 3)]
        normal = np.cross(b - a, c - a)
        size = float(np.linalg.norm(normal))
        if size < 0.02 * reach**2:
            continue
        normal = normal / size
        on = np.abs((look - a) @ normal) < tolerance / 2
        if on.sum() > most:
            best, most = on, int(on.sum())
    if best is None:
        return None
    for _ in range(4):
        if best.sum() < 10:
            return None
        plane = fit_plane(look[best])
        best = np.abs(plane.distances(look)) < tolerance / 2
    return plane.normal, plane.distance


def _inner(X: Floats, plane: Plane, margin: float) -> np.ndarray:
    """(n,) True for points of the largest patch, further than ``margin`` from its edges."""
    from scipy import ndimage

    e1, e2 = _across(plane.normal)
    flat = np.stack([(X - plane.centre) @ e1, (X - plane.centre) @ e2], axis=1)
    low, size = flat.min(axis=0), np.ptp(flat, axis=0)
    cell = max(float(size.max()) / _PIXELS, 1e-9)
    at = np.minimum((flat - low) / cell, _PIXELS).astype(np.intp) + 3
    there = np.zeros((_PIXELS + 7, _PIXELS + 7), dtype=np.bool_)
    there[at[:, 0], at[:, 1]] = True
    whole = ndimage.binary_fill_holes(ndimage.binary_closing(there, iterations=2))
    number, _ = ndimage.label(whole)
    count = np.bincount(number[at[:, 0], at[:, 1]], minlength=2)
    count[0] = 0
    inside = ndimage.distance_transform_edt(number == int(count.argmax())) * cell
    return np.asarray(inside[at[:, 0], at[:, 1]] > margin)


def _tile(X: Floats, plane: Plane) -> Index:
    """(n,) number of the tile, of 8 × 8, in which each point lies."""
    e1, e2 = _across(plane.normal)
    flat = np.stack([X @ e1, X @ e2], axis=1)
    low, size = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), 1e-9)
    at = np.minimum((flat - low) / size * 8, 7).astype(np.intp)
    tile: Index = at[:, 0] * 8 + at[:, 1]
    return tile


def _across(normal: Floats) -> tuple[Floats, Floats]:
    lead = np.eye(3)[int(np.argmin(np.abs(normal)))]
    e1 = np.cross(normal, lead)
    e1 /= np.linalg.norm(e1)
    return e1, np.cross(normal, e1)
