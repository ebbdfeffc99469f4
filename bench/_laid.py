"""Surfaces that a calibrated rig measured, laid onto the true part, and what its calibration is
worth there.

A calibration chooses the table's frame itself: where its first picture stood is angle 0, and its
height comes from the board. A surface is therefore laid onto the part before it is judged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench._hole_truth import made_mesh
from turnscan import shapes
from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.points import RangeGrid
from turnscan.rig import Pose, Rig, rotation_from_vector
from turnscan.simulate import Bench

_ROUNDS, _SOME = 24, 5000
"""Of the fit, and vertices that it takes, about."""
_FAR = 4.0
"""Usual distances beyond which a vertex does not pull."""
_FIRST, _LESS = 4.0, 0.7
"""mm up to which all pull in the first round, by which both rigs may say that the table stands
elsewhere; and how much of that is left from round to round."""


def laid(mesh: Mesh, grids: list[RangeGrid], believed: Rig, made: Bench) -> tuple[Mesh, Floats]:
    """Lay a surface that the ``believed`` rig measured onto the part as it stands on the bench.

    First by where both rigs say that the table stands, then by least squares along the part's
    normals, each vertex for what it states: what says that it may be a millimetre off, as the gaps
    of a gear in coarse steps do, would turn the whole. Comes with how far the calibration's
    covariance moves each vertex (v,) along the normal, mm, one sigma, the six freedoms of the fit
    taken out of that, too.
    """
    pose = made.rig.T_camera_table.inverse() @ believed.T_camera_table
    part = made_mesh(made)
    p = mesh.provenance
    sure = 1.0 / p.sigma if p is not None else np.ones(len(mesh.vertices))
    few = np.arange(0, len(mesh.vertices), max(1, len(mesh.vertices) // _SOME))
    for k in range(_ROUNDS):
        X = pose.apply(mesh.vertices[few])
        off, normal = _against(X, part)
        near = np.abs(off) <= max(_FAR * np.median(np.abs(off)), _FIRST * _LESS**k)
        modes = _modes(X[near], normal[near])
        weight = sure[few][near]
        v = np.linalg.lstsq(modes * weight[:, None], -off[near] * weight, rcond=None)[0]
        pose = Pose(rotation_from_vector(v[:3]), v[3:]) @ pose
    there = pose.apply(mesh.vertices)
    normal = _against(there, part)[1]
    modes = _modes(there, normal)
    total = np.zeros(len(there))
    for move in shapes.calibration_moves(mesh, shapes.Source(tuple(grids), believed)):
        along = np.einsum("ij,ij->i", pose.turn(move), normal)
        total += (along - modes @ np.linalg.lstsq(modes, along, rcond=None)[0]) ** 2
    return replace(mesh, vertices=there), np.sqrt(total)


def _against(X: Floats, part: Mesh) -> tuple[Floats, Floats]:
    """Signed distances (v,) mm of places (v, 3) from the part, and its normals (v, 3) there, of no
    length where a face of the part has no area."""
    found = shapes.deviation(X, part)
    t = part.triangles[found.face]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return found.distance, normal / np.where(size > 0, size, 1.0)


def _modes(X: Floats, normal: Floats) -> Floats:
    """(v, 6) how places X (v, 3) move along normals (v, 3) with a small turn and a shift."""
    return np.hstack([np.cross(X, normal), normal])
