"""What a calibration leaves open, and the set of pictures that would help most."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import shared_columns
from turnscan.calibrate._normal import build, weight
from turnscan.calibrate._quality import measured_uncertainty, test_points
from turnscan.calibrate._rig import Calibration
from turnscan.rig import Camera, Rig

_HUBER = 2.5
_FILLS = 0.6
"""Of a picture: a board that spans less narrows so little where it is tilted that the focal length,
and the distance of all things from the camera with it, hang on few hundredths of a pixel."""
_SIDES = (("top", "middle", "bottom"), ("left", "middle", "right"))


@dataclass(frozen=True)
class Advice:
    """What is still to be done for a rig."""

    undetermined: tuple[str, ...]
    """What no pictures have determined yet, in words."""
    stage: str
    """Which pictures would help most: "camera", "table", or the name of a laser; "" for none."""
    text: str
    """The same in words, with what they would gain."""


def advice_of(rig: Rig, c: Calibration | None = None) -> Advice:
    """What is still undetermined, and the one set of pictures that would help most.

    Where all stages are calibrated, that is found by counting the observations of each set of
    pictures twice: the set whose repetition makes a measured point most certain, by first-order
    propagation at four places of the working volume.
    """
    if not rig.sheets:
        text = "pictures of the board with the laser's stripe on it, near and far"
        return Advice(rig.lacking, "laser", text)
    if not rig.table_known:
        return Advice(rig.lacking, "table", "pictures of the empty table, turned step by step")
    if c is None:
        text = "pictures of the board in varied poses: without them the lens is guessed"
        return Advice((), "camera", text)
    if c.network.trusted_side is not None:
        text = (
            "pictures of the empty table with the laser on: without its stripe the scale rests on "
            "the nominal side of the markers"
        )
        return Advice((), "table", text)
    now = _uncertainty(c, c.fit.covariance)
    if not now:
        return Advice((), "", "nothing: the sheets do not reach the working volume")
    gains = {role: _uncertainty(c, C) for role, C in _repeated(c).items()}
    best = min(gains, key=lambda role: sum(gains[role].values()), default="")
    if not best:
        return Advice((), "", "nothing is known of any pictures")
    place = max(now, key=lambda k: now[k])
    text = (
        f"{_wanted(c, best)}: as many again as there are would take a point at radius / height "
        f"{place} mm from ± {2 * now[place]:.3f} to ± {2 * gains[best][place]:.3f} mm (k = 2)"
    )
    return Advice((), best, text)


def _uncertainty(c: Calibration, covariance: Floats) -> dict[str, float]:
    """Standard uncertainty of a point, radius and height together, at each test point, mm."""
    p = len(c.rig.parameter_names)
    rig = replace(c.rig, covariance=covariance[:p, :p])
    out = {}
    for R, z in test_points(c):
        u = measured_uncertainty(rig, rig.sheets[0].name, R, z)
        if u is not None:
            out[f"{R:g} / {z:g}"] = float(np.hypot(*u))
    return out


def _repeated(c: Calibration) -> dict[str, Floats]:
    """Covariance of the shared parameters, were a set of pictures there twice; by set."""
    covariance = c.fit.covariance
    free: Bools = np.diag(covariance) > 0
    blocks = list(c.fit.blocks)
    system = build(c.network, blocks, free, c.fit.scales, _HUBER, 0.0)
    views = len(c.network.boards)
    parts: dict[str, Floats] = {}
    for b in blocks:
        if b.view < 0:
            continue
        role = "table"
        if b.view < views:
            stripes = c.network.board_stripes[b.view]
            role = stripes[0].laser if stripes else "camera"
        A = shared_columns(c.network, b, system, free)
        w = weight(b, c.fit.scales, _HUBER)
        parts[role] = parts.get(role, np.zeros((A.shape[1],) * 2)) + (A.T * w) @ A
    known = covariance[np.ix_(free, free)]
    out = {}
    for role, part in parts.items():
        # C - C (C + H⁻¹)⁻¹ C without the inverse of a part that is singular.
        gained = np.linalg.solve(np.eye(len(known)) + known @ part / c.fit.view_factor**2, known)
        whole = np.zeros_like(covariance)
        whole[np.ix_(free, free)] = (gained + gained.T) / 2
        out[role] = whole
    return out


def _wanted(c: Calibration, role: str) -> str:
    if role == "table":
        return "pictures of the empty table at angles between those there"
    if role != "camera":
        return f"pictures of the board with the stripe of laser {role!r}, near and far"
    corners = np.concatenate([v.corners for v in c.network.boards])
    camera = c.rig.camera
    cells, _, _ = np.histogram2d(
        corners[:, 1], corners[:, 0], bins=3, range=((0, camera.height), (0, camera.width))
    )
    row, column = (int(k) for k in np.unravel_index(cells.argmin(), cells.shape))
    place = " ".join(dict.fromkeys((_SIDES[0][row], _SIDES[1][column])))
    text = f"pictures of the board, tilted up to 45°, above all at the {place} of the picture"
    fills = float(np.median([_fills(v.corners, camera) for v in c.network.boards]))
    if fills < _FILLS:
        text += f", and larger than the {fills:.0%} of its width that the board fills now"
    return text


def _fills(corners: Floats, camera: Camera) -> float:
    """How much of a picture's width or height, whichever is more, a board's corners span."""
    return float((np.ptp(corners, axis=0) / (camera.width, camera.height)).max())
