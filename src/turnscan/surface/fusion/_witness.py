"""Witness: what a merge made is checked against the surfaces that were measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.points import usual_sigma
from turnscan.surface.fusion._range_surface import RangeSurface

_SIGMAS = 3.0
"""Combined sigma that a merged vertex may lie off a surface that confirms it."""
_ROUNDED = 0.1
"""Voxels by which a merge rounds its vertices, and carries them on over a border."""
_LINEAR = 0.008
"""Voxels, rms, that are left of a surface in the linear interpolation between voxels."""
_EDGES = 0.99
"""Of what confirms at most: so far an edge between two profiles may carry a surface off them."""
_ON = 0.3
"""Voxels from every measured vertex beyond which a merged one stands beside it, …"""
_CHORD = 1.5
"""… usual sigma by which it may lie off what was measured there, …"""
_CLOSE, _VAGUE = 0.5, 3.0
"""… and voxels further than which it may not have so many usual sigma itself."""
_AFAR, _UNKNOWN = 1.5, 4.0
"""Voxels from every measured point beyond which nothing was measured, however flat the chords, and
the part of that way by which the surface may lie elsewhere."""
_AT_END = 1 / 3
"""Of how far the surface may lie off a chord to a last profile, one standard deviation."""
_BY_CHANCE = 2.0
"""Of its own sigma, by which a merged vertex may lie beside all surfaces that it is the mean of."""
_BESIDE = 2.0
"""Usual sigma that any may lie off every measured surface."""


class Witness(NamedTuple):
    """What the measured surfaces say of the vertices of a merged mesh."""

    confirmed: Bools
    """(v,) True where one of them passes by."""
    sigma: Floats
    """(v,) mm: of those that are confirmed."""
    guessed: Bools
    """(v,) True where no measured vertex is near, and the surface may lie elsewhere: between
    profiles, or beyond the end of one."""
    loose: Bools
    """(v,) True for others that stand beside a measured vertex and are known badly."""
    afar: Bools
    """(v,) True for others that stand far from all that was measured, on chords without a bend."""


def witnessed(mesh: Mesh, surfaces: Sequence[RangeSurface], voxel: float, most: float) -> Witness:
    """What the measured surfaces say of a merged mesh's vertices.

    A surface passes by no further off than three combined sigma, ``most`` mm of them at most, and
    what is explained: what the surface may do between its profiles there, and a tenth of ``voxel``
    mm, which the merge itself rounds off. Sigma is no less than how far from the nearest such
    surface a vertex lies beyond what is explained, and takes in how far the merge put it beside
    all of them, what the nearest may do between two lines (`RangeSurface.between_lines`), and what
    each that passes by may do before a last profile (`RangeSurface.at_ends`).
    Guessed is a vertex that lies two usual sigma beside every surface; one that stands beside all
    points that were measured and lies one and a half beside the surfaces, what they may do between
    their profiles included; and, further than half a voxel from those points, one that has a sigma
    of three. Loose is another of such a sigma, of what noise makes, that stands beside
    its nearest measured point. Afar is any other that stands one and a half voxels from all of
    them: a groove may be narrower than the step, of which no chord tells. Its sigma takes in a
    quarter of that way.
    """
    import igl

    p = mesh.provenance
    own = np.zeros(len(mesh.vertices)) if p is None else np.nan_to_num(p.sigma)
    every = np.concatenate([s.sigma for s in surfaces])
    usual, sure = float(np.median(every)), usual_sigma(every)
    out = np.zeros(len(mesh.vertices), dtype=np.bool_)
    away, least, doubt, reach = np.full((4, len(mesh.vertices)), np.inf)
    lines, at_end = np.zeros(len(mesh.vertices)), np.full(len(mesh.vertices), np.inf)
    for s in surfaces:
        # What one surface confirms only from afar, another may confirm from nearby.
        far = (doubt > _CHORD * usual) & (reach > _CLOSE * voxel) | (own > _VAGUE * usual)
        far |= (lines > 0) | (at_end > 0) & np.isfinite(at_end)
        asked = np.flatnonzero(~out | (away > own) | (least > own) | far)
        if not len(asked) or not len(s.mesh.faces):
            continue
        X = np.array(mesh.vertices[asked])
        squared, face, foot = igl.point_mesh_squared_distance(
            X, np.array(s.mesh.vertices), s.mesh.faces.astype(np.int64)
        )
        corners = s.mesh.faces[face]
        between = s.between(_EDGES * most, slight=True)[face]
        noise = np.hypot(own[asked], s.sigma[corners].mean(axis=1))
        explained = between + _ROUNDED * voxel
        off = np.sqrt(squared)
        near = off <= np.minimum(_SIGMAS * noise, most) + explained
        out[asked[near]] = True
        beyond = np.maximum(off - explained, 0.0)[near]
        away[asked[near]] = np.minimum(away[asked[near]], beyond)
        ends = s.mesh.vertices[corners]
        share = _shares(foot, ends)
        nearest = off < least[asked]
        # Voxels round a step off on all of the face that spans it.
        lines[asked[nearest]] = s.between_lines[corners].max(axis=1)[nearest]
        least[asked] = np.minimum(least[asked], off)
        closest = np.linalg.norm(ends - X[:, None], axis=2).min(axis=1)
        # No place is further off than from a measured point.
        end = np.minimum(_at_end(s, corners, share), closest)
        on = near & (off <= noise + _ROUNDED * voxel)
        at_end[asked[on]] = np.minimum(at_end[asked[on]], end[on])
        chord = between * _half_way(share, s.ranks[corners])
        doubt[asked] = np.minimum(doubt[asked], chord + off)
        reach[asked] = np.minimum(reach[asked], closest)
    # The mean of several lies its sigma beside each of them, and by chance twice of it.
    beside = np.sqrt(np.maximum(least**2 - (_BY_CHANCE * own) ** 2, 0.0))
    chord = doubt > _CHORD * usual
    guessed = chord & (reach > _ON * voxel) | (least > _BESIDE * sure)
    guessed |= (own > _VAGUE * usual) & (reach > _CLOSE * voxel)
    afar = (reach > _AFAR * voxel) & ~guessed
    loose = (own > _VAGUE * sure) & (reach > _ON * voxel) & ~guessed & ~afar
    sigma = np.maximum(np.hypot(own, beside), away)
    at_end[np.isinf(at_end)] = 0.0
    sigma = np.sqrt(sigma**2 + lines**2 + (_AT_END * at_end) ** 2 + (_LINEAR * voxel) ** 2)
    sigma[afar] = np.hypot(sigma[afar], reach[afar] / _UNKNOWN)
    return Witness(out, sigma, guessed, loose, afar)


def _shares(places: Floats, ends: Floats) -> Floats:
    """(m, 3) how much of each vertex counts at ``places`` (m, 3) in faces (m, 3, 3); 0 of all in
    faces without area."""
    import igl

    a, b, c = (np.ascontiguousarray(ends[:, k]) for k in range(3))
    shares = igl.barycentric_coordinates(np.ascontiguousarray(places), a, b, c)
    return np.asarray(np.nan_to_num(shares))


def _at_end(s: RangeSurface, corners: Ints, shares: Floats) -> Floats:
    """(m,) mm: how far the surface may lie off faces to a last profile (`RangeSurface.at_ends`), at
    places of these ``shares`` (m, 3) of their vertices, ``corners`` (m, 3)."""
    parts = _parts_of_profiles(shares, s.ranks[corners])
    return np.asarray((parts * s.at_ends[corners]).max(axis=1))


def _half_way(shares: Floats, ranks: Ints) -> Floats:
    """(m,) how much of what a surface may do between two profiles counts at places of these
    ``shares`` (m, 3) of vertices on the profiles ``ranks`` (m, 3): 0 on them, 1 half-way."""
    part = _parts_of_profiles(shares, ranks)[:, 0]
    return np.asarray(4.0 * part * (1.0 - part))


def _parts_of_profiles(shares: Floats, ranks: Ints) -> Floats:
    """(m, 3) from 0 to 1: what of the ``shares`` (m, 3) of vertices on the profiles ``ranks`` (m,
    3) is on the profile of each."""
    same = ranks[:, :, None] == ranks[:, None, :]
    return np.asarray(np.clip((shares[:, None, :] * same).sum(axis=2), 0.0, 1.0))
