"""Corners that the sites of a colour filter draw, by how much found from the boards themselves.

Behind a Bayer filter red and blue are each seen at every second pixel. What demosaicing and JPEG
make of that draws an edge that lies along the pixels' rows or columns to the sites, with periods of
two pixels and of one; an edge aslant crosses sites of either kind, and is not drawn. Boards held
freely show the pattern. On a table, where rows of corners lie along rows of pixels in all pictures,
it would look like perspective.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._corners import edge_normals, window_of
from turnscan.calibrate._evidence import LaserPicture, TablePicture

_RATES = (np.pi, 2 * np.pi)
"""rad per px: periods of two pixels and of one."""
_TERMS = 4 * len(_RATES)
"""Sine and cosine of each, along u and along v."""
_LEAST_CORNERS = 12
_HUBER, _ROUNDS = 2.5, 5
_RIDGE = 1e-9


@dataclass(frozen=True)
class SitePattern:
    """By how much corners of one camera are drawn."""

    amplitudes: Floats
    """(8,) px: along u, then along v, sine and cosine of each period for edges along the pixels."""

    def without(self, view: BoardView) -> BoardView:
        """The view with its corners where they were without it."""
        if view.failure or len(view.corners) < _LEAST_CORNERS:
            return view
        terms = _terms(view.corners, *_on_board(view))
        return replace(view, corners=view.corners - terms @ self.amplitudes)

    def without_in(self, pictures: Sequence[LaserPicture]) -> list[LaserPicture]:
        """Pictures of boards under a laser, with their corners where they were without it."""
        return [replace(p, view=self.without(p.view)) for p in pictures]

    def without_on_table(self, pictures: Sequence[TablePicture]) -> list[TablePicture]:
        """Pictures of a board on the table, likewise; of markers as they are."""
        return [
            replace(p, seen=self.without(p.seen)) if isinstance(p.seen, BoardView) else p
            for p in pictures
        ]


def site_pattern(views: Iterable[BoardView]) -> SitePattern | None:
    """The pattern in the corners of boards of one camera; None where they show none.

    What no homography of a board explains is compared with the pattern, by least squares with Huber
    weights, and Bayes' information criterion decides: 8 · ln n of n coordinates is asked of χ².
    """
    off, terms = list[Floats](), list[Floats]()
    for view in views:
        if view.failure or len(view.corners) < _LEAST_CORNERS:
            continue
        X, J, residual = _seen(view)
        Q = np.linalg.qr(J / np.linalg.norm(J, axis=0))[0]
        flat = X.reshape(-1, _TERMS)
        off.append(residual - Q @ (Q.T @ residual))
        terms.append(flat - Q @ (Q.T @ flat))
    if not off:
        return None
    r = np.concatenate(off)
    a, information = _fitted(r, np.concatenate(terms))
    gained = float(a @ information @ a)
    return SitePattern(a) if gained > _TERMS * np.log(len(r)) else None


def _fitted(r: Floats, X: Floats) -> tuple[Floats, Floats]:
    """Amplitudes (8,) by residuals (m,) and their terms (m, 8), and their inverse covariance."""
    weight: Floats = np.ones(len(r))
    a: Floats = np.zeros(_TERMS)
    N, scale = np.eye(_TERMS), 1.0
    for _ in range(_ROUNDS):
        N = (X * weight[:, None]).T @ X + _RIDGE * np.eye(_TERMS)
        a = np.asarray(np.linalg.solve(N, X.T @ (weight * r)), dtype=np.float64)
        left = np.abs(r - X @ a)
        scale = max(1.4826 * float(np.median(left)), 1e-9)
        weight = 1 / np.maximum(left / (_HUBER * scale), 1.0)
    return a, N / scale**2


def _on_board(view: BoardView) -> tuple[Floats, Floats]:
    """Of a view's corners the places (n, 2) on the board, in squares, and the homography (3, 3)
    from there to px."""
    import cv2

    places = view.points[:, :2] / view.board.square
    H = np.asarray(cv2.findHomography(places, view.corners, 0)[0], dtype=np.float64)
    return places, H / H[2, 2]


def _seen(view: BoardView) -> tuple[Floats, Floats, Floats]:
    """Of a view's n corners: the pattern's terms (n, 2, 8), the slopes (2n, 8) of places by the
    board's homography, and (2n,) px by which the corners are off that."""
    places, H = _on_board(view)
    homogeneous = np.column_stack([places, np.ones(len(places))])
    p = homogeneous @ H.T
    at, scale = p[:, :2] / p[:, 2:], p[:, 2:]
    J = np.zeros((len(at), 2, 8))
    for axis in (0, 1):
        J[:, axis, 3 * axis : 3 * axis + 3] = homogeneous / scale
        J[:, axis, 6:] = -at[:, axis, None] * places / scale
    return _terms(view.corners, places, H), J.reshape(-1, 8), (view.corners - at).ravel()


def _terms(corners: Floats, places: Floats, H: Floats) -> Floats:
    """(n, 2, 8) px of each corner for 1 px of each amplitude.

    An edge that leans by the slope t against the pixels' lines is averaged along the window of the
    corner's fit, σ px: exp(−(ω t σ)²/2) of the pattern is left.
    """
    normals, near = edge_normals(places, H)
    lean = np.abs(np.stack([np.tan(normals), 1 / np.tan(normals)], axis=-1)).min(axis=1)
    sigma = window_of(near)
    out = np.zeros((len(corners), 2, _TERMS))
    for axis in (0, 1):
        for k, rate in enumerate(_RATES):
            left = np.exp(-0.5 * (rate * lean[:, axis] * sigma) ** 2)
            first = axis * _TERMS // 2 + 2 * k
            out[:, axis, first] = left * np.sin(rate * corners[:, axis])
            out[:, axis, first + 1] = left * np.cos(rate * corners[:, axis])
    return out
