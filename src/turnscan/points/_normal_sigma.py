"""Sigma of points along the normal of the surface that they lie on."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.points._grid import RangeGrid
from turnscan.points._wholeness import apart_along
from turnscan.rig import rotation_z
from turnscan.threads import in_parts

_STEADY = 8.0
"""Usual sigma that a tangent is long, at least."""
_TILT, _TURNED = 0.2, 1.3
"""rad that noise makes the normals about a point differ by, over the shortest tangents; and steps
of the table by which those of a round part do: chords before and after lie a step apart there."""
_TOGETHER = 64
"""Steps whose points are computed at a time."""
_LEAST = 0.3
"""Share of a point's sigma below which none is believed: normals are not known better."""
_NOISE = 1.3
"""Usual sigmas that noise makes, at most, as the surface lies to the light. What a point claims
beyond comes from edges, creases and veils, where it is off the same way as those beside it."""
_DOUBTED = 1.3
"""The usual noise is at most so many times that of the best known quarter of the points."""
_ABOUT = 3
"""Profiles to either side over which the bends of a profile are averaged, …"""
_BENT = 4.0
"""… times what noise makes of that mean, beyond which the part has a bend there, …"""
_SHARPLY = 0.5
"""… and how much the chords to either side differ at least, as a part of their length: a round
surface bends by less over a few lines, and chords tell how it lies."""
_LAGS = 6
"""Lines to either side over which bends are looked for, at most."""
_SHEET = 2_000
"""Points that are enough to tell a laser's sheet …"""
_FLAT = 0.05
"""… which they lie in where they scatter this much less across it than along it."""


def normal_sigma(grid: RangeGrid) -> Floats:
    """(s, n) mm: standard uncertainty of each point along the surface's normal, NaN where missing.

    A stripe's centre moves its point along the laser's sheet (`RangeGrid.sigma`); of that, what
    leads along the surface is no error of the surface. Where a point or those about it claim more
    than noise makes, the plane through them is no surface, and may lie otherwise by as much. Where
    there is no plane, and beside an edge, the width of the stripe tells how it lies
    (`RangeGrid.width_share`). As it is where the camera's place or the sheet is not known, and
    where the profiles bend within the few lines that a plane is laid through: across a collar it
    leans as no face of the part does.
    """
    from turnscan.points import _normal_kernels as kernels

    found = grid.found
    sheet = _sheet_normals(grid) if grid.eyes is not None and found.sum() > 2 else None
    if sheet is None or grid.eyes is None:
        return grid.sigma
    moves, all_eyes = np.zeros_like(grid.points), grid.eyes
    turn = np.abs(np.diff(np.unwrap(grid.angles)))
    usual = float(np.median(turn)) if len(turn) else 0.0
    arc = np.nan_to_num(np.hypot(grid.points[..., 0], grid.points[..., 1]) * usual)
    arc = np.maximum(arc, 0.25 * float(np.median(arc[found])))
    known = grid.sigma[found]
    known = known[np.isfinite(known)]
    noise = usual_sigma(known)
    share, far = np.empty(found.shape), max(_STEADY * noise, 1e-9)
    limits = far, max(_TILT, _TURNED * usual)
    whole = np.nan_to_num(grid.sigma)
    doubt = np.sqrt(np.maximum(whole**2 - usual_sigma(known, most=True) ** 2, 0.0)), whole
    told = grid.width_share
    if told is None:
        told = np.full(found.shape, np.nan, np.float32)

    def part(first: int, end: int) -> None:
        there, X = found[first:end], grid.points[first:end]
        step = first + np.nonzero(there)[0]
        along = _along(sheet[step], all_eyes[step] - X[there], all_eyes[step])
        length = np.linalg.norm(along, axis=1, keepdims=True)
        moves[first:end][there] = along / np.maximum(length, 1e-12)
        span = first, end
        kernels.shares(grid.points, doubt, moves, told, arc, limits, grid.closed, span, share)

    in_parts(part, len(found), -(-len(found) // _TOGETHER))
    share[_bent(grid, moves, far)] = 1.0
    return np.asarray(grid.sigma * np.maximum(share, _LEAST))


def _bent(grid: RangeGrid, moves: Floats, far: float) -> Bools:
    """(s, n) True where profiles bend within ``far`` mm of a point, in the mean of those about it.

    A single profile bends by noise. What is turned, or stands upright, bends in all alike.
    """
    from turnscan.points import _normal_kernels as kernels

    out = np.zeros(grid.found.shape, dtype=np.bool_)
    chords = np.empty(out.shape), np.empty(out.shape)
    noise = np.asarray(grid.sigma if grid.noise is None else grid.noise, dtype=np.float64)
    lines = min(int(np.ceil(far / max(apart_along(grid.points), 1e-9))), _LAGS)
    for lag in range(1, lines + 1):

        def differences(first: int, end: int, lag: int = lag) -> None:
            kernels.seconds(grid.points, moves, lag, (first, end), chords)

        def judge(first: int, end: int) -> None:
            kernels.bent(chords, noise, _ABOUT, (_BENT, _SHARPLY), grid.closed, (first, end), out)

        in_parts(differences, len(out))
        in_parts(judge, len(out))
    return out


def usual_sigma(sigma: Floats, *, most: bool = False) -> float:
    """What noise usually makes of points of these sigma (v,), mm, or at ``most``; 0 for none.

    The median; where edges and creases make more than half of the points doubtful, a little more
    than the quarter that is known best.
    """
    if not len(sigma):
        return 0.0
    best, middle = np.quantile(sigma, (0.25, 0.5))
    return float(min(middle, _DOUBTED * best)) * (_NOISE if most else 1.0)


def _sheet_normals(grid: RangeGrid) -> Floats | None:
    """(s, 3) normal of the laser's sheet at each step; None where the points lie in no sheet.

    Turned back to where the table stood, all points of a laser lie in its sheet; those of another
    scanner do not.
    """
    step, line = np.nonzero(grid.found)
    some = np.unique(np.linspace(0, len(step) - 1, _SHEET).astype(np.intp))
    X = grid.points[step[some], line[some]]
    table = np.einsum("vij,vj->vi", rotation_z(grid.angles[step[some]]), X)
    size, axes = np.linalg.svd(table - table.mean(axis=0), full_matrices=False)[1:]
    if size[-1] >= _FLAT * size[-2]:
        return None
    return np.asarray(rotation_z(-grid.angles) @ axes[-1])


def _along(sheet: Floats, ray: Floats, eyes: Floats) -> Floats:
    """(v, 3) the way along which the error of a stripe's centre moves its point, any length.

    It stays in the laser's sheet and, in the picture, in its row of pixels, which is level in
    space: across the axis and the way to the camera.
    """
    row = np.cross(ray, np.cross((0.0, 0.0, 1.0), eyes))
    return np.asarray(np.cross(sheet, row))
