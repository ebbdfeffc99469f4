"""Which of the stripe's candidates in a picture lie on a known plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._board import Board
from turnscan.calibrate._evidence import LaserPicture
from turnscan.calibrate._layout import MarkerLayout
from turnscan.rig import Camera, Pose, rotation_z

FEWEST_POINTS = 12
_SUPPORTS = 96
NEAR_PX = 1.5
"""From a stripe's line, within which its points are."""
_TIGHT = 4.0  # robust sigmas about the final line
_LEAST_PX = 0.3
_GAP = 0.25  # of the length: a stripe that pauses longer than this is two stripes
_DENSE = 0.4  # of the lines between its ends must show the stripe
_AT_ONCE = 32768
"""Distances of points from lines that are held at once: 256 KiB."""
_CLEAR = 1.35  # a marker's printed square and the blur around it, in sides


def on_board(
    camera: Camera, candidates: Floats, board: Board, pose: Pose, margin: float | Floats
) -> Floats:
    """Candidates (n, 2) px that form one straight stripe on a board → (k, 2) px.

    ``margin`` mm around the printed pattern (or four: left, top, right, bottom) is taken to lie in
    the board's plane. Light on other things does not continue the straight line, and is left out.
    """
    x0, y0, x1, y1 = board.extent
    around = np.broadcast_to(margin, 4)

    def inside(xy: Floats) -> Bools:
        low, high = np.array([x0, y0]) - around[:2], np.array([x1, y1]) + around[2:]
        return np.asarray(((xy > low) & (xy < high)).all(axis=1))

    return _on_plane(camera, candidates, pose, inside)


def straighter(
    camera: Camera, picture: LaserPicture, pose: Pose, margin: float | Floats
) -> tuple[LaserPicture, Floats]:
    """The picture with the light as it was found, or as it fell on the print, by which of them the
    line of the stripe on its board is known better; and that stripe, (k, 2) px.

    Where a stripe crosses the print, its light as it fell there makes it straight; a picture whose
    grey values are clipped, or go with the light in a way that the print does not show, is
    straighter as it was found.
    """
    found = on_board(camera, picture.candidates, picture.view.board, pose, margin)
    if picture.on_print is None:
        return picture, found
    printed = on_board(camera, picture.on_print, picture.view.board, pose, margin)
    if _unsureness(camera, printed) < _unsureness(camera, found):
        return picture.printed, printed
    return picture, found


def _unsureness(camera: Camera, pixels: Floats) -> float:
    """rad by which the straight line through a stripe (k, 2) may be turned, in a picture without
    distortion; infinite without a stripe.

    That is the rms of its points about the line over their rms along it, and over the root of their
    number: a stripe of which an end is lost must be straighter to be known as well.
    """
    if not len(pixels):
        return np.inf
    straight = camera.normalised(pixels) * (camera.fx, camera.fy)
    most, least = np.linalg.svd(straight - straight.mean(axis=0), compute_uv=False)
    return float(least / most / np.sqrt(len(pixels)))


def on_platter(
    camera: Camera, candidates: Floats, layout: MarkerLayout, T_table: Pose, angle: float
) -> Floats:
    """Candidates (n, 2) px that form one straight stripe on the platter between the markers.

    Only the disc out to the farthest marker corner is looked at, and black markers are left out:
    a stripe that changes from white to black is seen where it is not.
    """
    corners, _ = layout.points(layout.numbers)
    reach = float(np.linalg.norm(corners[:, :2], axis=1).max())
    back = rotation_z(-angle)[:2, :2]

    def inside(xy: Floats) -> Bools:
        free = np.asarray(np.linalg.norm(xy, axis=1) < reach)
        at_zero = xy @ back.T
        for x, y, turn, side in layout.squares:
            c, s = np.cos(turn), np.sin(turn)
            local = np.abs((at_zero - (x, y)) @ np.array([[c, -s], [s, c]]))
            free &= local.max(axis=1) > _CLEAR * side / 2
        return free

    return _on_plane(camera, candidates, T_table, inside)


def _on_plane(
    camera: Camera, candidates: Floats, plane: Pose, inside: Callable[[Floats], Bools]
) -> Floats:
    """Candidates on the plane z = 0 of ``plane`` and in a straight line there → (k, 2) px."""
    none = np.zeros((0, 2))
    flat = camera.normalised(candidates)
    fine = np.isfinite(flat).all(axis=1)
    pixels, flat = candidates[fine], flat[fine]
    rays = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    normal = plane.rotation[:, 2]
    with np.errstate(all="ignore"):
        depth = (plane.translation @ normal) / (rays @ normal)
    ahead = np.isfinite(depth) & (depth > 0)
    pixels, flat, X = pixels[ahead], flat[ahead], (rays * depth[:, None])[ahead]
    keep = inside(plane.inverse().apply(X)[:, :2])
    pixels, flat = pixels[keep], flat[keep]
    if len(pixels) < FEWEST_POINTS:
        return none
    # A plane meets a sheet in a line, and a line is straight in a picture without distortion.
    straight = flat * (camera.fx, camera.fy)
    on_line = _consensus(straight)
    count = int(np.count_nonzero(on_line))
    if count < FEWEST_POINTS or count < _DENSE * float(np.ptp(pixels[on_line], axis=0).max()):
        return none
    return pixels[on_line]


def _consensus(points: Floats) -> Bools:
    """Points (n, 2) on the straight line that has most of them, tried through pairs of them."""
    few = np.linspace(0, len(points) - 1, min(len(points), _SUPPORTS)).astype(int)
    i, j = np.triu_indices(len(few), 1)
    a, b = points[few[i]], points[few[j]]
    along = b - a
    length = np.linalg.norm(along, axis=1)
    long = length > max(0.15 * float(length.max()), 5 * NEAR_PX)
    if not long.any():
        return np.zeros(len(points), dtype=bool)
    a, along = a[long], along[long] / length[long, None]
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    keep = _most_near(points, a, across)
    for _ in range(4):
        centre = points[keep].mean(axis=0)
        axes = np.linalg.svd(points[keep] - centre, full_matrices=False)[2]
        away = np.abs((points - centre) @ axes[1])
        limit = max(_TIGHT * 1.4826 * float(np.median(away[keep])), _LEAST_PX)
        keep = away < min(limit, 2 * NEAR_PX)
        if np.count_nonzero(keep) < FEWEST_POINTS:
            break
        keep &= _longest_run((points - centre) @ axes[0], keep)
    return keep


def _most_near(points: Floats, on: Floats, across: Floats) -> Bools:
    """Points (n, 2) near that one of the lines which has most of them near, the first of several.

    The lines go through ``on`` (m, 2) with the unit normals ``across`` (m, 2). Some are tried at a
    time, as many as the processor's cache holds the distances of.
    """
    level = (across * on).sum(axis=1)
    best, most = np.zeros(len(points), dtype=bool), -1
    some = max(1, _AT_ONCE // len(points))
    for first in range(0, len(on), some):
        off = across[first : first + some] @ points.T
        off -= level[first : first + some, None]
        near = np.abs(off, out=off) < NEAR_PX
        count = np.bitwise_count(np.packbits(near, axis=1)).sum(axis=1)
        if count.max() > most:
            best, most = near[count.argmax()], int(count.max())
    return best


def _longest_run(place: Floats, keep: Bools) -> Bools:
    """Of the kept points, those of the longest piece without a wide gap."""
    order = np.flatnonzero(keep)[np.argsort(place[keep])]
    gaps = np.diff(place[order])
    limit = _GAP * float(np.ptp(place[order])) + 3.0
    cuts = np.flatnonzero(gaps > limit)
    pieces = np.split(order, cuts + 1)
    run = np.zeros(len(place), dtype=bool)
    run[max(pieces, key=len)] = True
    return run
