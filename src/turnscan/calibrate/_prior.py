"""What is known of a rig before its pictures are looked at, as observations of its parameters."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Floats, Ints, cross
from turnscan.rig import LaserSheet, Pose, Rig, Wobble

_LEAST_SHARE = 1e-9
"""Of the largest: a variance below it is taken for that, so that nothing is divided by 0."""
_FREE_TURN = 1e6
"""rad²: of the turn about the axis, where the pictures say again which angle is zero."""


@dataclass(frozen=True)
class RigPrior:
    """Some parameters of a rig, with the uncertainty that they had."""

    rig: Rig
    """Where they were."""
    index: Ints
    """(k,) which of its parameters."""
    root: Floats
    """(k, k): times the difference of the parameters it has the covariance 1."""

    def residual(self, now: Rig) -> Floats:
        """(k,) in standard deviations, what was known minus what is now."""
        off: Floats = -self.root @ moved_by(self.rig, now)[self.index]
        return off


def prior_of(before: Rig, now: Rig, stages: Collection[str], anew: bool = False) -> RigPrior | None:
    """What ``before`` says of some stages of ``now``: "camera", "table" and names of lasers.

    ``anew`` is whether the table's angle zero was chosen anew: how the axis moves in a turn, which
    counts from there, is then left out. None where ``before`` has no
    covariance, or none of these stages.
    """
    if before.covariance is None:
        return None
    old, names = before.parameter_names, now.parameter_names
    sigma2 = np.diag(before.covariance)
    wanted = [
        (names.index(name), k)
        for k, name in enumerate(old)
        if name.rpartition(".")[0] in stages
        and sigma2[k] > 0.0
        and name in names
        and not (anew and name in Wobble.NAMES)
    ]
    if not wanted:
        return None
    index, mine = np.array(wanted).T
    covariance = before.covariance[np.ix_(mine, mine)].copy()
    T = before.T_camera_table
    if anew and "table" in stages:
        axis = T.rotation[:, 2]
        turns = [k for k, i in enumerate(index) if names[i].startswith("table.turn")]
        which = [("table.turn_x", "table.turn_y", "table.turn_z").index(names[index[k]])
                 for k in turns]  # fmt: skip
        covariance[np.ix_(turns, turns)] += _FREE_TURN * np.outer(axis[which], axis[which])
        T = _turned_like(T, now.T_camera_table)
    sheets = tuple(before.sheet(s.name) if s.name in stages else s for s in now.sheets)
    kept = now.wobble is not None and before.wobble is not None and not anew
    wobble = before.wobble if kept else now.wobble
    rig = replace(
        now, camera=before.camera, sheets=sheets, T_camera_table=T, wobble=wobble, covariance=None
    )
    return RigPrior(rig, index.astype(np.int32), _root(covariance))


def moved_by(before: Rig, now: Rig) -> Floats:
    """The (p,) by which ``before.perturbed`` leads to ``now``, to first order."""
    a, b = before.camera, now.camera
    camera = [b.fx - a.fx, b.fy - a.fy, b.cx - a.cx, b.cy - a.cy]
    sheets = [_sheet_moved(x, y) for x, y in zip(before.sheets, now.sheets, strict=True)]
    S, T = before.T_camera_table, now.T_camera_table
    turn = T.rotation @ S.rotation.T
    small = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    wobble = np.zeros(0)
    if before.wobble is not None and now.wobble is not None:
        wobble = now.wobble.values - before.wobble.values
    return np.concatenate(
        [camera, b.distortion - a.distortion, b.tilt - a.tilt, *sheets, wobble, small / 2,
         T.translation - S.translation]
    )  # fmt: skip


def _sheet_moved(before: LaserSheet, now: LaserSheet) -> Floats:
    e1, e2 = before.axes
    turn = cross(before.normal, now.normal)
    offset = (now.centre - before.centre) @ now.normal
    return np.array([turn @ e1, turn @ e2, offset, *(now.bow - before.bow)])


def like(sheet: LaserSheet, before: LaserSheet) -> LaserSheet:
    """The same plane with its normal and its centre where they are nearest to those of another."""
    normal = sheet.normal if sheet.normal @ before.normal > 0 else -sheet.normal
    centre = before.centre - ((before.centre - sheet.centre) @ normal) * normal
    return replace(sheet, normal=normal, centre=centre)


def _turned_like(T: Pose, other: Pose) -> Pose:
    """``T`` turned about its own axis until its angle zero is nearest to that of another."""
    both = T.rotation.T @ other.rotation
    angle = np.arctan2(both[1, 0] - both[0, 1], both[0, 0] + both[1, 1])
    c, s = np.cos(angle), np.sin(angle)
    spin = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Pose(T.rotation @ spin, T.translation)


def _root(covariance: Floats) -> Floats:
    """(k, k) whose product with a difference has the covariance 1."""
    sigma = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    values = np.maximum(values, _LEAST_SHARE * values.max())
    root: Floats = (vectors / np.sqrt(values)).T / sigma
    return root
