"""What one laser saw of a part in one turn of the table, and how well the rig places it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Floats, Ints, frozen
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.rig import Rig

NUDGE_PX = 0.25
"""Beside a stripe, to see how its noise moves a point."""
_MOST_LINES, _SOME = 8, 200
_WHOLE = 1e-6
"""rad: a turn that ends where it began is over."""
_FEWEST_STEPS = 12
"""Of a turn that counts by itself."""
_STEEP_PX = 3.0
"""px per scan line: a stripe that goes aside by more ends there, or is seen at a grazing angle."""


def turned_back(directions: Floats, angle: Floats) -> Floats:
    """Directions (..., 3), each turned by -``angle`` about z, which goes with their first axes."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = directions[..., 0], directions[..., 1]
    out = np.empty(np.broadcast_shapes(directions.shape, (*c.shape, 3)))
    np.add(c * x, s * y, out=out[..., 0])
    np.subtract(c * y, s * x, out=out[..., 1])
    out[..., 2] = directions[..., 2]
    return out


@dataclass(frozen=True)
class Sweep:
    """The stripe of one laser on a part, in one turn of the table."""

    laser: str
    pixels: Floats
    """(n, 2) px."""
    sigma: Floats
    """(n,) px, in the direction `across`."""
    step: Ints
    """(n,) which of `angles`."""
    angles: Floats
    """(s,) rad: of the table, in scan order."""
    moved: bool = True
    """Whether these angles are the commanded ones, so that its own errors come on top."""
    across: int = 0
    """The pixel coordinate in which the stripe was located."""
    pose: int = 0
    """Which pose of the part on the table: 0, or another one after it was laid down again."""

    def __post_init__(self) -> None:
        n = len(self.pixels)
        object.__setattr__(self, "pixels", frozen(self.pixels, (n, 2), "Sweep.pixels"))
        object.__setattr__(self, "sigma", frozen(self.sigma, (n,), "Sweep.sigma"))
        object.__setattr__(self, "step", frozen(self.step, (n,), "Sweep.step", np.int32))
        object.__setattr__(self, "angles", frozen(self.angles, (None,), "Sweep.angles"))

    def turned(self, rig: Rig) -> Floats:
        """(s,) rad: where the table is in truth, by the rig's model of its errors."""
        return rig.motion.angle(self.angles) if self.moved and rig.motion else self.angles

    def points(self, rig: Rig, rays: Floats) -> Floats:
        """(n, 3) mm in the object's frame, as the part lay there; rays (n, 3), or several of each
        pixel, (k, n, 3), for points (k, n, 3)."""
        T, angles = rig.T_camera_table, self.turned(rig)
        X = (rig.sheet(self.laser).intersect(rays) - T.translation) @ T.rotation
        return turned_back(self.righted(X, rig), angles[self.step])

    def righted(self, points: Floats, rig: Rig) -> Floats:
        """Points (..., n, 3) mm in the table frame at rest without the axis's own motion."""
        if rig.wobble is None:
            return points
        tilt, shift = rig.wobble.motion(self.turned(rig)[self.step])
        back: Floats = np.einsum("nji,...nj->...ni", tilt, points - shift)
        return back

    def doubt(self, rig: Rig) -> float:
        """How far, mm rms, the rig's uncertainty puts its points beside their places; 0 without."""
        if rig.covariance is None:
            return 0.0
        some = np.unique(np.linspace(0, len(self.pixels) - 1, _SOME).astype(np.intp))
        few = replace(self, pixels=self.pixels[some], sigma=self.sigma[some],
                      step=self.step[some])  # fmt: skip
        rays = rig.camera.rays(few.pixels)
        at, far = few.points(rig, rays), 0.0
        for k in np.flatnonzero(np.diag(rig.covariance)[CAMERA_SIZE:] > 0) + CAMERA_SIZE:
            step = np.zeros(len(rig.covariance))
            step[k] = np.sqrt(rig.covariance[k, k])
            far += float(np.mean(((few.points(rig.perturbed(step), rays) - at) ** 2).sum(axis=1)))
        return float(np.sqrt(far))


def doubt_of(rig: Rig, sweeps: Sequence[Sweep]) -> float:
    """How far, mm rms, the rig's uncertainty puts points beside their places; 0 without one."""
    return float(np.sqrt(np.mean([sweep.doubt(rig) ** 2 for sweep in sweeps])))


def thinned(sweep: Sweep, rig: Rig) -> Sweep:
    """The sweep with neighbouring scan lines averaged, so that its points are about as far apart
    along a stripe as from one stripe to the next; what is torn or steep within that is left out."""
    at = sweep.points(rig, rig.camera.rays(sweep.pixels))
    line = sweep.pixels[:, 1 - sweep.across]
    lines = np.abs(np.diff(line))
    beside = (np.diff(sweep.step) == 0) & (lines > 0)
    apart = np.linalg.norm(np.diff(at, axis=0), axis=1)[beside] / lines[beside]
    if not len(apart) or len(sweep.angles) < 2:
        return sweep
    along = float(np.median(apart))
    turn = float(np.median(np.abs(np.diff(sweep.angles))))
    between = turn * float(np.median(np.hypot(at[:, 0], at[:, 1])))
    count = int(np.clip(between / max(along, 1e-9) / 2, 1, _MOST_LINES))
    if count < 2 * np.median(lines[beside]):
        return sweep
    block = sweep.step.astype(np.int64) * 10**7 + (line // count).astype(np.int64)
    _, first, member, size = np.unique(
        block, return_index=True, return_inverse=True, return_counts=True
    )
    sums = [np.bincount(member, column) for column in (*sweep.pixels.T, sweep.sigma**2)]
    pixels = np.stack(sums[:2], axis=1) / size[:, None]
    place = sweep.pixels[:, sweep.across]
    low, high = np.full(len(size), np.inf), np.full(len(size), -np.inf)
    np.minimum.at(low, member, place)
    np.maximum.at(high, member, place)
    usual = count / float(np.median(lines[beside]))
    good = (2 * size >= usual) & (high - low < _STEEP_PX * count)
    return replace(
        sweep,
        pixels=pixels[good],
        sigma=(np.sqrt(sums[2]) / size)[good],
        step=sweep.step[first][good],
    )


def turns_of(sweep: Sweep) -> list[Sweep]:
    """What was seen in each whole turn, and each way, by itself; all of them with all angles, as
    the table's play depends on how it came there.

    A part of a turn that is left over at the end, with few steps, goes to the turn before it.
    """
    told = np.unwrap(sweep.angles)
    if len(told) < 2:
        return [sweep]
    way = np.concatenate([[0.0], np.sign(np.diff(told))])
    moves = np.flatnonzero(way)
    if not len(moves):
        return [sweep]
    # A step that stands still goes with the one after it.
    way = way[moves[np.minimum(np.searchsorted(moves, np.arange(len(way))), len(moves) - 1)]]
    turn = np.zeros(len(told), dtype=np.intp)
    begin = 0
    for k in range(1, len(told)):
        new = way[k] * way[k - 1] < 0 or abs(told[k] - told[begin]) > 2 * np.pi - _WHOLE
        turn[k] = turn[k - 1] + new
        begin = k if new else begin
    few = np.bincount(turn)[-1] < _FEWEST_STEPS
    if few and turn[-1] > 0:
        turn[turn == turn[-1]] -= 1
    out = []
    for k in range(int(turn[-1]) + 1):
        mine = turn[sweep.step] == k
        if mine.any():
            out.append(
                replace(sweep, pixels=sweep.pixels[mine], sigma=sweep.sigma[mine],
                        step=sweep.step[mine])
            )  # fmt: skip
    return out
