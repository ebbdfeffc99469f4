"""How the points of a sweep move with the parameters of rig, table motion and poses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, cross
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.calibrate._sweeps import Sweep, turned_back
from turnscan.rig import Camera, LaserSheet, Pose, Rig, Wobble

_NUDGE = 1e-4
"""Of the parameters of a lens, whose rays have no derivative in a formula; of the focal length, in
terms of itself."""
_SHEET = 6
_AXES = np.eye(3)
_CROSS = np.cross(_AXES[None, :], _AXES[:, None])
"""(3, 3, 3): ``v @ _CROSS[k]`` is v × e_k."""

Index = npt.NDArray[np.intp]


def ray_slopes(camera: Camera, pixels: Floats, columns: Index) -> Floats:
    """(n, k, 3): derivative of the pixels' rays by the camera's parameters ``columns`` (k,)."""
    out = np.zeros((len(pixels), len(columns), 3))
    still = Rig(camera, (), Pose())
    for j, k in enumerate(columns):
        delta = np.zeros(len(still.parameter_names))
        delta[k] = _NUDGE * (camera.fx if k < 4 else 1.0)
        ends = [still.perturbed(sign * delta).camera.rays(pixels) for sign in (1.0, -1.0)]
        out[:, j] = (ends[0] - ends[1]) / (2 * delta[k])
    return out


def point_slopes(
    sweep: Sweep, rig: Rig, poses: tuple[Pose, ...], rays: Floats, lens: Floats, columns: Index
) -> Floats:
    """(m, k, 3) mm: derivative of the points that ``rays`` (m, 3) lead to; m is n, or a multiple of
    it where each pixel has several rays, one set after the other.

    ``columns`` (k,) are the wanted parameters, in ascending order: the rig's, those of its motion,
    and turn and shift of each pose. ``lens`` (m, c, 3) is the derivative of the rays by the first
    c of them, which are the camera's. Points and poses as in `turnscan.calibrate._surfaces`.
    """
    assert rig.motion is not None
    p, q = len(rig.parameter_names), len(rig.motion.names)
    T, sheet = rig.T_camera_table, rig.sheet(sweep.laser)
    X = sheet.intersect(rays)
    arm = X - T.translation
    step = np.tile(sweep.step, len(rays) // max(len(sweep.step), 1))
    angle = sweep.turned(rig)[step]
    at = sweep.righted((arm @ T.rotation).reshape(-1, len(sweep.step), 3), rig).reshape(-1, 3)
    # All others, such as those of other sheets, move no point before the table is turned.
    first = CAMERA_SIZE + _SHEET * rig.sheets.index(sheet)
    inside, wobble = columns - first, columns - (p - 6 - _wobbles(rig))
    mine = (columns < CAMERA_SIZE) | ((inside >= 0) & (inside < _SHEET)) | (wobble >= 0)
    mine &= columns < p
    out = _before_turning(sheet, rig, (rays, X), lens, columns[mine])
    # Slopes to first order in the axis's own motion.
    out = (out.reshape(-1, 3) @ T.rotation).reshape(out.shape)
    moves = columns[mine] - p + 12
    inner = np.flatnonzero((moves >= 6 - _wobbles(rig)) & (moves < 6))
    if len(inner):
        turns, shifts = (s[:, moves[inner]] for s in Wobble.slopes(angle))
        out[:, inner] = -cross(turns, at[:, None]) - shifts
    back = np.zeros((len(rays), len(columns), 3))
    back[:, mine] = turned_back(out, angle[:, None])
    spin = turned_back(_drift(rig, angle, at), angle)
    at = turned_back(at, angle)
    spin += np.stack([at[:, 1], -at[:, 0], np.zeros(len(at))], axis=1)
    inner = np.flatnonzero((columns >= p) & (columns < p + q))
    if len(inner) and sweep.moved:
        by = rig.motion.slopes(sweep.angles)[:, columns[inner] - p][step]
        back[:, inner] = by[:, :, None] * spin[:, None]
    return _laid(sweep, poses, at, back, columns - p - q)


def _before_turning(
    sheet: LaserSheet, rig: Rig, seen: tuple[Floats, Floats], lens: Floats, columns: Index
) -> Floats:
    """(m, k, 3) mm in the camera frame, about the table's origin: derivative of the points (m, 3)
    to which rays (m, 3) lead by parameters of the rig; 0 for those of the axis's own motion."""
    rays, X = seen
    p, c = len(rig.parameter_names), lens.shape[1]
    out = np.zeros((len(rays), len(columns), 3))
    gradient = sheet.gradient(X)
    steep = np.einsum("ni,ni->n", gradient, rays)
    if c:
        # X = s·ray stays on the sheet: what leads off it is taken back along the ray.
        moved = (X[:, 2] / rays[:, 2])[:, None, None] * lens
        off = np.einsum("ni,nki->nk", gradient, moved) / steep[:, None]
        out[:, :c] = moved - off[:, :, None] * rays[:, None, :]
    first = CAMERA_SIZE + _SHEET * rig.sheets.index(sheet)
    mine = np.flatnonzero((columns >= first) & (columns < first + _SHEET))
    if len(mine):
        by = _sheet_slopes(sheet, X)[:, columns[mine] - first] / steep[:, None]
        out[:, mine] = -by[:, :, None] * rays[:, None, :]
    arm = X - rig.T_camera_table.translation
    for j in np.flatnonzero(columns >= p - 6):
        axis = (columns[j] - p) % 3
        out[:, j] = arm @ _CROSS[axis] if columns[j] < p - 3 else -_AXES[axis]
    return out


def _wobbles(rig: Rig) -> int:
    """How many parameters the axis's own motion has."""
    return 0 if rig.wobble is None else len(Wobble.NAMES)


def _drift(rig: Rig, angle: Floats, at: Floats) -> Floats:
    """(m, 3) mm: how points ``at`` (m, 3) of the table frame move back with the axis's own motion,
    for each rad of the table's angle (m,)."""
    if rig.wobble is None:
        return np.zeros_like(at)
    # It is a wave of the angle: its slope is what it is a quarter of a turn on.
    turn, shift = (rig.wobble.values @ s for s in Wobble.slopes(angle + np.pi / 2))
    return np.asarray(-cross(turn, at) - shift)


def _laid(sweep: Sweep, poses: tuple[Pose, ...], at: Floats, by: Floats, columns: Index) -> Floats:
    """The slopes in the first pose's frame, with those of the sweep's own pose."""
    if not sweep.pose:
        return by
    first = 6 * (sweep.pose - 1)
    turns, shifts = (np.flatnonzero((columns >= k) & (columns < k + 3)) for k in (first, first + 3))
    for j in turns:
        by[:, j] = -at @ _CROSS[columns[j] - first]
    laid: Floats = by @ poses[sweep.pose - 1].rotation.T
    for j in shifts:
        laid[:, j] = _AXES[columns[j] - first - 3]
    return laid


def _sheet_slopes(sheet: LaserSheet, X: Floats) -> Floats:
    """(n, 6): derivative of the distance of fixed points by the sheet's parameters (`Rig.perturbed`
    says what they are)."""
    n, (e1, e2) = sheet.normal, sheet.axes
    d = X - sheet.centre
    a, b, w = d @ e1, d @ e2, d @ n
    out = np.stack([-b, a, np.full(len(X), -1.0), -a * a, -a * b, -b * b], axis=1)
    if sheet.bow.any():
        # The sheet's own axes turn with its normal, of which e₁ keeps to the picture's.
        lead = np.eye(3)[1 if abs(n[1]) < 0.7 else 0]
        tip = (lead @ n) / (lead @ e1)
        q = sheet.bow
        by_a, by_b = 2 * q[0] * a + q[1] * b, q[1] * a + 2 * q[2] * b
        out[:, 0] -= by_a * tip * b + by_b * (w - tip * a)
        out[:, 1] += by_a * w
    return out
