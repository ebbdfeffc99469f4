"""What the axis leaves unknown of a profile, and what moves all points alike: its wall is where it
is only as these are.

Where a wall is seen all round, a moved axis blurs its profile and does not move it; where it is
seen in part, the profile moves with the axis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.shapes._outline_curves import Arc, Line, Outline, Piece
from turnscan.shapes.revolved._axis import Turned

_LEAST = 3
"""Points beside a piece that say how it moves."""
_SIGMAS = 3.0
"""Points further beyond the end of a profile are no noise: the part goes on there."""
_BESIDE = 1.5
"""Steps of the mesh beside an open end, where an edge may bend stripes."""


def axis_counted(outline: Outline, turned: Turned) -> Outline:
    """The outline, the standard uncertainties of its pieces and its box with the share of the axis
    and of common causes.

    Sizes between two pieces stay as they are, for both move alike.
    """
    pieces = tuple(_counted(p, turned) for p in outline.pieces)
    box = outline.box_sigma.copy()
    for axis, of in enumerate((turned.r, turned.z)):
        for k in range(2):
            some = turned.on & (np.abs(of - outline.box[k, axis]) <= turned.spacing)
            if not outline.closed:  # a closed one ends nowhere
                end, sign = float(outline.box[k, axis]), -1.0 if k == 0 else 1.0
                beyond = _beyond(of[turned.on], end, sign) - _SIGMAS * turned.sigma
                box[k, axis] = np.hypot(box[k, axis], max(beyond, 0.0))
            if int(some.sum()) >= _LEAST:
                moves = _moves(turned, some, np.eye(2)[axis]).mean(axis=0)
                box[k, axis] = np.hypot(box[k, axis], _sigma(turned, moves))
    box[1, 0] = np.hypot(box[1, 0], 0.0 if outline.closed else _bent(outline, turned))
    return replace(outline, pieces=pieces, box_sigma=box)


def _bent(outline: Outline, turned: Turned) -> float:
    """mm that the wall would reach further from the axis, did it end as straight as it comes there:
    what bends inward within a step of the mesh is the part's rim, or a stripe that an edge bends.
    """
    way = outline.sampled(turned.spacing / 4)
    wide, out = _BESIDE * turned.spacing, 0.0
    for line in (way, way[::-1]):
        back = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        near, far = np.interp([wide, 2 * wide], back, line[:, 0])
        if back[-1] > 2 * wide:
            out = max(out, float(2 * near - far) - float(outline.box[1, 0]))
    return out


def _beyond(of: Floats, end: float, sign: float) -> float:
    """mm that points were measured beyond the end of the profile."""
    return max(float((sign * of).max()) - sign * end, 0.0)


def _counted(piece: Piece, turned: Turned) -> Piece:
    at = np.column_stack([turned.r, turned.z])
    beside = np.abs(piece.distances(at)) <= turned.spacing / 2 + 6 * turned.sigma
    some = turned.on & beside & _within(piece, at, turned.spacing)
    if int(some.sum()) < _LEAST:
        return piece
    if isinstance(piece, Line):
        d = (piece.end - piece.start) / max(piece.length, 1e-300)
        moves = _moves(turned, some, np.array([d[1], -d[0]]))
        along = at[some] @ d
        along -= (piece.start + piece.end) @ d / 2
        place, turn = _fitted(np.column_stack([np.ones(len(along)), along]), moves)
        return replace(
            piece,
            sigma=float(np.hypot(piece.sigma, _sigma(turned, place))),
            angle_sigma=float(np.hypot(piece.angle_sigma, _sigma(turned, turn))),
        )
    if isinstance(piece, Arc):
        out = (at[some] - piece.centre) / piece.radius
        out /= np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
        moves = _moves(turned, some, out)
        radius, *centre = _fitted(np.column_stack([np.ones(len(out)), out]), moves)
        own = [_sigma(turned, c) for c in centre]
        return replace(
            piece,
            radius_sigma=float(np.hypot(piece.radius_sigma, _sigma(turned, radius))),
            centre_sigma=np.hypot(piece.centre_sigma, own),
        )
    moves = _moves(turned, some, turned.normal[some]).mean(axis=0)
    return replace(piece, sigma=float(np.hypot(piece.sigma, _sigma(turned, moves))))


def _within(piece: Piece, at: Floats, spacing: float) -> Bools:
    """(v,) which points are beside the piece itself, not beside what it would go on to."""
    way = piece.sampled(spacing / 4)
    low, high = way.min(axis=0) - spacing / 2, way.max(axis=0) + spacing / 2
    return np.asarray(((at >= low) & (at <= high)).all(axis=1))


def _moves(turned: Turned, some: Bools, out: Floats) -> Floats:
    """(n, 4 + f) how far points move along ``out`` (2,) or (n, 2) of the half-plane, when the axis
    tilts and shifts as its covariance counts it, and with each common cause (`Turned.moves`)."""
    c, s = np.cos(turned.angle[some]), np.sin(turned.angle[some])
    r, z = turned.r[some], turned.z[some]
    mr, mz = np.broadcast_to(out, (len(r), 2)).T
    common = [mr * f[some, 0] + mz * f[some, 1] for f in turned.moves]
    own = [-mr * z * c + mz * r * c, -mr * z * s + mz * r * s, -mr * c, -mr * s]
    return np.column_stack([*own, *common])


def _fitted(A: Floats, moves: Floats) -> Floats:
    """(k, 4 + f) what the parameters of a piece do."""
    return np.asarray(np.linalg.lstsq(A, moves, rcond=1e-9)[0])


def _sigma(turned: Turned, moves: Floats) -> float:
    axis, common = moves[:4], moves[4:]
    return float(np.sqrt(axis @ turned.axis.covariance @ axis + common @ common))
