"""The part of all contests: turned, fluted and milled flat, measured as a turntable scan would."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.mesh import Mesh, Provenance, submesh

Floats = npt.NDArray[np.float64]

_CONTOUR = np.array(
    [(40, 0), (40, 30), (30, 30), (30, 50), (36, 56), (36, 70), (24, 82), (24, 90), (12, 90)]
)
"""(k, 2) mm: radius and height along the side; shelves, a cone, edges."""
_NOTCH = (33.0, 15.0, 0.5)
"""mm from the axis, height in mm, and slope of two planes milled into the foot of the side: their
edges run across the grid."""
NOISE = 0.005
"""mm, along the normals."""


def clean(steps: int, lines: int) -> Mesh:
    """The open side, its vertices on the true surface: ``steps`` round the axis, ``lines`` up."""
    leg = np.linalg.norm(np.diff(_CONTOUR, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(leg)])
    at = np.linspace(0.0, along[-1], lines)
    # Every corner of the contour has a line of its own: edges are edges.
    at[np.abs(along[:, None] - at).argmin(axis=1)] = along
    r, z = (np.interp(at, along, _CONTOUR[:, k]) for k in range(2))
    phi = np.arange(steps) * 2 * np.pi / steps
    flutes = 0.6 * np.cos(9 * phi)[:, None] * ((z > 50.5) & (z < 69.5))
    radius = np.broadcast_to(r, (steps, lines)) + flutes
    deep, height, slope = _NOTCH
    milled = np.where(z < 30, deep + slope * np.abs(z - height), 100.0)
    radius = np.minimum(radius, milled / np.maximum(np.cos(phi), 0.2)[:, None])
    x, y = radius * np.cos(phi)[:, None], radius * np.sin(phi)[:, None]
    points = np.stack([x, y, np.broadcast_to(z, radius.shape)], axis=-1)
    step, line = np.meshgrid(np.arange(steps), np.arange(lines - 1), indexing="ij")
    a, b = step * lines + line, (step + 1) % steps * lines + line
    faces = np.stack([a, b, b + 1, a, b + 1, a + 1], axis=-1).reshape(-1, 3)
    v = steps * lines
    each = np.arange(v, dtype=np.int32)
    known = Provenance(np.full(v, NOISE), 0 * each, each // lines, each % lines, ("L",))
    return Mesh(points.reshape(-1, 3), faces, known)


def scanned(mesh: Mesh, seed: int = 0) -> Mesh:
    """The same vertices as a scan gives them: with noise along their normals."""
    t = mesh.triangles
    across = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    normals = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(normals, mesh.faces[:, k], across)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (len(normals), 1))
    return Mesh(mesh.vertices + noise * normals, mesh.faces, mesh.provenance)


def torn(mesh: Mesh, holes: int, seed: int = 1) -> Mesh:
    """The mesh without its faces round so many places: holes of 1 to 5 mm radius, apart."""
    rng = np.random.default_rng(seed)
    middles = mesh.triangles.mean(axis=1)
    inside = (middles[:, 2] > 6) & (middles[:, 2] < 84)
    places, keep = list[Floats](), np.ones(len(middles), dtype=bool)
    while len(places) < holes:
        place = middles[rng.choice(np.flatnonzero(inside))]
        if all(np.linalg.norm(place - p) > 11.0 for p in places):
            radius = rng.uniform(1.0, 5.0)
            places.append(place)
            keep &= np.linalg.norm(middles - place, axis=1) > radius
    # A corner at which two holes touch, or a face that hangs on by one, would be another contest.
    return submesh(mesh, keep)


def closed(mesh: Mesh) -> Mesh:
    """The open side with a flat lid above and below, fans about the axis; nothing else moves."""
    v = len(mesh.vertices)
    p = mesh.provenance
    assert p is not None
    lines = int(p.line.max()) + 1
    steps = v // lines
    ends = mesh.vertices.reshape(steps, lines, 3)[:, [0, -1]].mean(axis=0)
    ends[:, :2] = 0.0
    ring = np.arange(steps) * lines
    after = np.roll(ring, -1)
    below = np.stack([after, ring, np.full(steps, v)], axis=1)
    above = np.stack([ring, after, np.full(steps, v + 1)], axis=1)
    above[:, :2] += lines - 1
    return Mesh(np.concatenate([mesh.vertices, ends]), np.concatenate([mesh.faces, below, above]))
