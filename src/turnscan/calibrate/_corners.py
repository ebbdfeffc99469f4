"""Corners of a board to a few hundredths of a pixel: two edges that cross, fitted to the pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats

_BLUR = 0.5
"""px: blur of a lens that the search begins with."""
_LEAST, _MOST, _REACH = 1.5, 4.0, 0.25
"""px: standard deviation of the window about a corner, at least and at most; and as a part of the
way to the next corner, which is not in the model."""
_MARGIN = 1.0
"""px that the marker in a white square is kept clear of, as it is blurred too, but where that
leaves less than as much of the square."""
_WINDOW = 2.5
"""Standard deviations to which the window goes."""
_FAR = 1.0
"""px from the search's place from which another edge was fitted, and the search's place stays."""
_ROUNDS, _STILL = 15, 1e-3
_SOFT = (0.15, 6.0)
"""px: blur of an edge, at least and at most."""


class _Crossings(NamedTuple):
    """Parameters of n crossings."""

    place: Floats
    """(n, 2) px."""
    normals: Floats
    """(n, 2) rad: directions of the edges' normals."""
    soft: Floats
    """(n,) px: standard deviation of the edges' blur."""


def refined_corners(image: Floats, corners: Floats, places: Floats, clear: float) -> Floats:
    """Corners (n, 2) px of a board's squares in a picture (H, W), better than `cornerSubPix`.

    ``corners`` (n, 2) px were found to a fraction of a pixel, n ≥ 4; ``places`` (n, 2) are theirs
    on the board, in squares, of which the part ``clear`` beside each edge has no other edge.

    Each is the crossing of two straight edges, I = m + h E(d₁) E(d₂), fitted to the pixels about it
    by Gauss-Newton; E is an edge with the blur of the lens, taken over a pixel's area (`_edge`). A
    search by gradients (`cornerSubPix`) interpolates between pixels and is drawn to their middle by
    up to 0.08 px; along a row that leans a little against the pixels this looks like perspective,
    and made focal lengths 0.3 % too long.
    """
    import cv2

    H, _ = cv2.findHomography(places, corners, 0)
    if H is None:
        return corners
    normals, near = edge_normals(places, np.asarray(H, dtype=np.float64))
    sigma = window_of(near)
    r = int(np.ceil(_WINDOW * sigma))
    oy, ox = np.mgrid[-r : r + 1, -r : r + 1]
    middle = np.rint(corners).astype(np.int64)
    X = (middle[:, :1] + ox.ravel()).clip(0, image.shape[1] - 1)
    Y = (middle[:, 1:] + oy.ravel()).clip(0, image.shape[0] - 1)
    at = np.stack([X, Y], axis=-1).astype(np.float64)
    first = _Crossings(corners.copy(), normals, np.full(len(corners), _BLUR))
    weight = _weights(at, first, sigma, max(clear * near - _MARGIN, _MARGIN))
    found = _fitted(at, image[Y, X], weight, first)
    good = np.linalg.norm(found - corners, axis=1) < _FAR
    return np.where(good[:, None], found, corners)


def window_of(near: float) -> float:
    """px: standard deviation of the window about corners that are ``near`` px from each other."""
    return float(np.clip(_REACH * near, _LEAST, _MOST))


def edge_normals(places: Floats, H: Floats) -> tuple[Floats, float]:
    """(n, 2) rad of the normals of the board's two edges at ``places`` (n, 2), and px of a square,
    by the homography (3, 3) from squares to px."""

    def seen(at: Floats) -> Floats:
        p = np.column_stack([at, np.ones(len(at))]) @ H.T
        return np.asarray(p[:, :2] / p[:, 2:])

    step = 1e-3
    sides = [(seen(places + d) - seen(places - d)) / (2 * step) for d in np.eye(2) * step]
    angles = np.stack([np.arctan2(s[:, 0], -s[:, 1]) for s in sides], axis=-1)
    return angles, float(min(np.linalg.norm(s, axis=1).min() for s in sides))


def _weights(at: Floats, first: _Crossings, sigma: float, clear: float) -> Floats:
    """(n, m) of pixels ``at`` (n, m, 2): a bell about each crossing, and none of those further than
    ``clear`` px from both of its edges, which may lie on a marker."""
    d = at - first.place[:, None]
    c, s = np.cos(first.normals), np.sin(first.normals)
    away = np.abs(d @ np.stack([c, s], axis=1)).min(axis=-1)
    bell = np.exp(-0.5 * (d**2).sum(axis=-1) / sigma**2)
    return np.asarray(np.where(away <= clear, bell, 0.0))


def _fitted(at: Floats, light: Floats, weight: Floats, first: _Crossings) -> Floats:
    """(n, 2) px where crossings are, by pixels ``at`` (n, m, 2) with ``light`` and ``weight``
    (n, m)."""
    now = first
    level = np.zeros((len(light), 2))
    for k in range(_ROUNDS):
        shape, slopes = _model(at, now)
        if k == 0:
            level = _levels(shape, light, weight)
        height = level[:, 1, None]
        J = np.concatenate(
            [height[..., None] * slopes, shape[..., None], np.ones_like(shape)[..., None]], axis=-1
        )
        off = light - level[:, :1] - height * shape
        weighted = (J * weight[..., None]).swapaxes(1, 2)
        N = weighted @ J
        N[:, range(7), range(7)] *= 1.0 + 1e-6
        N += 1e-9 * np.eye(7)
        step = np.linalg.solve(N, weighted @ off[..., None])[..., 0]
        move = step[:, :2].clip(-1.0, 1.0)
        now = _Crossings(
            now.place + move,
            now.normals + step[:, 2:4].clip(-0.2, 0.2),
            (now.soft + step[:, 4].clip(-0.3, 0.3)).clip(*_SOFT),
        )
        level = level + step[:, [6, 5]]
        if np.abs(move).max() < _STILL:
            break
    return now.place


def _levels(shape: Floats, light: Floats, weight: Floats) -> Floats:
    """(n, 2): middle and height by which light is nearest to the model."""
    total = weight.sum(axis=1)
    middle = (weight * shape).sum(axis=1) / total
    usual = (weight * light).sum(axis=1) / total
    own = shape - middle[:, None]
    height = (weight * own * light).sum(axis=1) / np.maximum((weight * own**2).sum(axis=1), 1e-12)
    return np.stack([usual - height * middle, height], axis=-1)


def _model(at: Floats, now: _Crossings) -> tuple[Floats, Floats]:
    """Of pixels (n, m): the product of two edges, its slopes (n, m, 5) by `_Crossings`."""
    d = at - now.place[:, None]
    edges, along = [], []
    for angle in now.normals.T[..., None]:
        c, s = np.cos(angle), np.sin(angle)
        edge, slope, softer = _edge(c * d[..., 0] + s * d[..., 1], c, s, now.soft[:, None])
        edges.append(edge)
        along.append((-slope * c, -slope * s, slope * (c * d[..., 1] - s * d[..., 0]), softer))
    (a, b), (u, v) = edges, along
    slopes = np.stack(
        [u[0] * b + a * v[0], u[1] * b + a * v[1], u[2] * b, a * v[2], u[3] * b + a * v[3]], axis=-1
    )
    return a * b, slopes


def _edge(d: Floats, c: Floats, s: Floats, soft: Floats) -> tuple[Floats, Floats, Floats]:
    """Light −1 to 1 of pixels whose middles are ``d`` (n, m) px from a straight edge with normal
    (c, s), its blur's standard deviation ``soft`` (n, 1) px; and its slopes by d and by the blur.

    A pixel takes the mean over its area: across the edge, over two boxes of widths |c| and |s| one
    after the other. The wider is integrated, ∫ erf(x/√2σ) dx = x erf(x/√2σ) + √(2/π) σ
    exp(−x²/2σ²); the narrower counts as blur, σ² = soft² + narrow²/12.
    """
    from scipy.special import erf

    wide, narrow = np.maximum(abs(c), abs(s)), np.minimum(abs(c), abs(s))
    blur = np.sqrt(soft**2 + narrow**2 / 12)
    ends = []
    for x in (d + wide / 2, d - wide / 2):
        bell = np.sqrt(2 / np.pi) * np.exp(-0.5 * (x / blur) ** 2)
        step = erf(x / (np.sqrt(2) * blur))
        ends.append((x * step + blur * bell, step, bell))
    edge, slope, softer = ((one - other) / wide for one, other in zip(*ends, strict=True))
    return edge, slope, softer * soft / blur
