"""What scans of a part say of their rig: where surfaces agree, and where they are a known body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.calibrate._bodies import Body
from turnscan.calibrate._normal import Block
from turnscan.calibrate._patches import Patches
from turnscan.calibrate._prior import RigPrior, moved_by
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.rig import Pose, Rig, TableMotion, nearest_rotation, rotation_z

PRIOR_MOTION, PRIOR_SIZE, PRIOR_RIG = "prior motion", "prior size", "prior rig"
PRIOR_GAUGE = "prior gauge"
_GAUGE = 1e-3
"""mm and rad: how well a height above the platter and an angle zero that no surface shows stay."""
PRIOR_PLACE = "prior place"
_ANYWHERE = 1e3
"""mm and rad: a body stands anywhere, but one that is round stays turned as it is."""
WEAK = np.radians(3.0)
"""Standard uncertainty of an unknown error of a table, rad."""
_LEAST_SIGMA = 0.2
"""Of the usual one."""
_NUDGE_PX, _NUDGE = 0.25, 1e-6
_MOST_LINES, _SOME = 8, 200
_STEEP_PX = 3.0
"""px per scan line: a stripe that goes aside by more ends there, or is seen at a grazing angle."""


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

    def __post_init__(self) -> None:
        n = len(self.pixels)
        object.__setattr__(self, "pixels", frozen(self.pixels, (n, 2), "Sweep.pixels"))
        object.__setattr__(self, "sigma", frozen(self.sigma, (n,), "Sweep.sigma"))
        object.__setattr__(self, "step", frozen(self.step, (n,), "Sweep.step", np.int32))
        object.__setattr__(self, "angles", frozen(self.angles, (None,), "Sweep.angles"))

    def points(self, rig: Rig, rays: Floats) -> Floats:
        """(n, 3) mm in the object's frame."""
        angles = self.angles
        if self.moved and rig.motion is not None:
            angles = rig.motion.angle(angles)
        X = rig.T_camera_table.inverse().apply(rig.sheet(self.laser).intersect(rays))
        points: Floats = np.einsum("nij,nj->ni", rotation_z(-angles)[self.step], X)
        return points


@dataclass(frozen=True)
class Surfaces:
    """What is adjusted: the rig with its motion, and the bodies."""

    rig: Rig
    bodies: tuple[Body, ...] = ()

    @property
    def motion(self) -> TableMotion:
        """The table's own errors; the rig of an adjustment always has them."""
        assert self.rig.motion is not None
        return self.rig.motion


@dataclass(frozen=True)
class Pair:
    """A sweep whose points lie on patches of another one."""

    asked: int
    others: int
    patches: Patches
    by_own: Floats
    """(m,) mm: what one standard deviation of the point's own noise makes of its gap."""
    by_others: Floats
    """(m, k) mm: that of each point of the patch."""
    sigma: Floats
    """(m,) mm: what all of them make of it."""

    @property
    def kind(self) -> str:
        """The kind of its residuals."""
        return f"surface {self.asked} on {self.others}"


@dataclass(frozen=True)
class SurfaceNetwork:
    """The observations: gaps between surfaces, distances from bodies, and what was known."""

    sweeps: tuple[Sweep, ...]
    pairs: tuple[Pair, ...]
    state: Surfaces
    active: Bools
    """(p,) the parameters whose derivatives are wanted."""
    prior: RigPrior | None = None
    known_motion: TableMotion | None = None
    """The table's errors as they were known, with their covariance."""
    body_noise: tuple[tuple[Floats, ...], ...] = field(default=())
    """Per body and sweep: what one standard deviation of its points' noise makes of their
    distance, mm."""
    body_sigma: tuple[tuple[Floats, ...], ...] = field(default=())
    """Per body and sweep: standard uncertainty of that distance, mm."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the rig, of the table's motion, of the bodies."""
        bodies = (n for body in self.state.bodies for n in body.names)
        return (*self.state.rig.parameter_names, *self.state.motion.names, *bodies)

    @cached_property
    def _first(self) -> Ints:
        return np.cumsum([0, *(len(s.angles) for s in self.sweeps)]).astype(np.int32)

    @property
    def own_sizes(self) -> tuple[int, ...]:
        """No step has parameters of its own; its points have errors in common."""
        return (0,) * int(self._first[-1])

    def moved(self, state: Surfaces, common: Floats, own: Sequence[Floats]) -> Surfaces:
        """``state`` after a step of the parameters."""
        p, q = len(state.rig.parameter_names), len(state.motion.names)
        rig = state.rig.perturbed(common[:p])
        motion = TableMotion.of(state.motion.values + common[p : p + q])
        T = rig.T_camera_table
        T = Pose(nearest_rotation(T.rotation), T.translation)
        rig = replace(rig, T_camera_table=T, motion=motion)
        bodies = tuple(
            body.moved(common[part]) for body, part in zip(state.bodies, self._columns, strict=True)
        )
        return Surfaces(rig, bodies)

    @cached_property
    def _columns(self) -> list[slice]:
        """Which parameters are those of each body."""
        cuts = self._own + np.cumsum([0, *(len(b.names) for b in self.state.bodies)])
        return [slice(int(a), int(b)) for a, b in pairwise(cuts)]

    def places(self, rig: Rig) -> list[Floats]:
        """The points (n, 3) of every sweep, mm in the object's frame."""
        return [s.points(rig, r) for s, r in zip(self.sweeps, self._rays(rig), strict=True)]

    def _rays(self, rig: Rig) -> list[Floats]:
        """Of all pixels; those of a camera that does not move are found once."""
        if not self.active[:CAMERA_SIZE].any():
            return self._still
        return [rig.camera.rays(s.pixels) for s in self.sweeps]

    @cached_property
    def _still(self) -> list[Floats]:
        return [self.state.rig.camera.rays(s.pixels) for s in self.sweeps]

    def blocks(self, state: Surfaces) -> list[Block]:
        """Residuals in standard deviations of the stripe's noise, and derivatives.

        That noise is one of pixels: it grows and shrinks with the scene, or else gaps that are
        noise would be made smaller by making everything smaller.
        """
        at = self.places(state.rig)
        slopes = self._slopes(state)
        out = []
        for pair in self.pairs:
            by = np.stack(
                [pair.patches.gaps(s[pair.asked], s[pair.others]) for s in slopes], axis=1
            ) if slopes else np.zeros((len(pair.sigma), 0))  # fmt: skip
            gaps = pair.patches.gaps(at[pair.asked], at[pair.others])
            common = self._zeros(len(gaps))
            common[:, np.flatnonzero(self.active[: self._own])] = by / pair.sigma[:, None]
            step = self.sweeps[pair.asked].step[pair.patches.query]
            out += self._by_step(pair.asked, step, pair.kind, -gaps / pair.sigma, common)
        for k, body in enumerate(state.bodies):
            out += self._on_body(k, body, at, slopes)
        return [self._scaled(b, state.rig) for b in out] + self._priors(state)

    def _scaled(self, block: Block, rig: Rig) -> Block:
        """A block by the distance of the table from the camera, relative to where it was."""
        if block.view < 0:
            return block
        t = rig.T_camera_table.translation
        size = float(np.linalg.norm(t) / np.linalg.norm(self.state.rig.T_camera_table.translation))
        p = len(rig.parameter_names)
        common = block.common / size
        residual = block.residual / size
        # The prediction is minus the residual, and of that 1/size changes with the shift.
        shift = np.flatnonzero(self.active[p - 3 : p]) + p - 3
        common[:, shift] += np.outer(residual, (t / (t @ t))[shift - p + 3])
        return replace(block, residual=residual, common=common)

    @cached_property
    def _own(self) -> int:
        """Parameters of rig and motion."""
        return len(self.state.rig.parameter_names) + len(self.state.motion.names)

    def _zeros(self, rows: int) -> Floats:
        return np.zeros((rows, len(self.names)))

    def _slopes(self, state: Surfaces) -> list[list[Floats]]:
        """How all points move with each active parameter of rig and motion."""
        rig, p = state.rig, len(state.rig.parameter_names)
        rays = self._rays(rig)
        out = []
        for k in np.flatnonzero(self.active[: self._own]):
            h = _NUDGE * (rig.camera.fx if k < 4 else 1.0)
            ends = []
            for sign in (h, -h):
                delta = np.zeros(self._own)
                delta[k] = sign
                moved = replace(
                    rig.perturbed(delta[:p]),
                    motion=TableMotion.of(state.motion.values + delta[p:]),
                )
                seen = (
                    [moved.camera.rays(s.pixels) for s in self.sweeps] if k < CAMERA_SIZE else rays
                )
                ends.append([s.points(moved, r) for s, r in zip(self.sweeps, seen, strict=True)])
            out.append([(a - b) / (2 * h) for a, b in zip(*ends, strict=True)])
        return out

    def _by_step(
        self, sweep: int, step: Ints, kind: str, residual: Floats, common: Floats
    ) -> list[Block]:
        out = []
        order = np.argsort(step, kind="stable")
        cuts = np.flatnonzero(np.diff(step[order])) + 1
        for rows in np.split(order, cuts):
            if len(rows):
                view = int(self._first[sweep] + step[rows[0]])
                none = np.zeros((len(rows), 0))
                out.append(Block(view, kind, residual[rows], common[rows], none))
        return out

    def _on_body(
        self, k: int, body: Body, at: list[Floats], slopes: list[list[Floats]]
    ) -> list[Block]:
        out, columns = [], self._columns[k]
        for i, which in enumerate(body.points):
            away, unit, by = body.distance(at[i][which])
            common = self._zeros(len(which))
            for c, s in zip(np.flatnonzero(self.active[: self._own]), slopes, strict=True):
                common[:, c] = np.einsum("mi,mi->m", unit, s[i][which])
            common[:, columns] = by
            sigma = self.body_sigma[k][i]
            step = self.sweeps[i].step[which]
            out += self._by_step(i, step, body_kind(k), -away / sigma, common / sigma[:, None])
        last = columns.stop - len(body.sizes)
        for j, (size, known) in enumerate(zip(body.sizes, body.known, strict=True)):
            if known is not None:
                common = self._zeros(1)
                common[0, last + j] = 1 / known[1]
                off = np.array([(known[0] - size) / known[1]])
                out.append(Block(-1, PRIOR_SIZE, off, common, np.zeros((1, 0))))
        places = columns.stop - columns.start - len(body.sizes)
        common = self._zeros(places)
        common[np.arange(places), columns.start + np.arange(places)] = 1 / _ANYWHERE
        out.append(Block(-1, PRIOR_PLACE, np.zeros(places), common, np.zeros((places, 0))))
        return out

    def _priors(self, state: Surfaces) -> list[Block]:
        p = len(state.rig.parameter_names)
        mean, sigma = motion_known(state.motion.names, self.known_motion)
        values = state.motion.values
        common = self._zeros(len(values))
        common[np.arange(len(values)), p + np.arange(len(values))] = 1 / sigma
        none = np.zeros((len(values), 0))
        out = [Block(-1, PRIOR_MOTION, (mean - values) / sigma, common, none)]
        if self.prior is not None:
            common = self._zeros(len(self.prior.index))
            common[:, self.prior.index] = self.prior.root
            none = np.zeros((len(common), 0))
            out.append(Block(-1, PRIOR_RIG, self.prior.residual(state.rig), common, none))
            gauge = gauge_of(self.prior.rig) / _GAUGE
            common = self._zeros(2)
            common[:, : len(state.rig.parameter_names)] = gauge
            off = -gauge @ moved_by(self.prior.rig, state.rig)
            out.append(Block(-1, PRIOR_GAUGE, off, common, np.zeros((2, 0))))
        return out


def body_kind(body: int) -> str:
    """The kind of the residuals of points on a body."""
    return f"body {body + 1}"


def not_below(sigma: Floats) -> Floats:
    """A point that slides along its surface says nothing, but not with infinite weight."""
    return np.maximum(sigma, _LEAST_SIGMA * float(np.median(sigma))) if len(sigma) else sigma


def motion_known(names: Sequence[str], known: TableMotion | None) -> tuple[Floats, Floats]:
    """Values (q,) rad of the table's errors and their standard uncertainties before a scan.

    What nothing was known of is 0 ± `WEAK`.
    """
    mean, sigma = np.zeros(len(names)), np.full(len(names), WEAK)
    if known is not None and known.covariance is not None:
        own = np.sqrt(np.diag(known.covariance))
        for k, name in enumerate(names):
            if name in known.names and own[known.names.index(name)] > 0:
                mean[k] = known.values[known.names.index(name)]
                sigma[k] = own[known.names.index(name)]
    return mean, sigma


def gauge_of(rig: Rig) -> Floats:
    """(2, p): the turn of the table about its own axis and its shift along it, which move the part
    in its frame and nothing else."""
    p = len(rig.parameter_names)
    axis = rig.T_camera_table.rotation[:, 2]
    out = np.zeros((2, p))
    out[0, p - 6 : p - 3] = axis
    out[1, p - 3 :] = axis
    return out


def doubt_of(rig: Rig, sweeps: Sequence[Sweep]) -> float:
    """How far, mm rms, the rig's uncertainty puts points beside their places; 0 without one."""
    if rig.covariance is None:
        return 0.0
    far = 0.0
    for sweep in sweeps:
        some = np.unique(np.linspace(0, len(sweep.pixels) - 1, _SOME).astype(np.intp))
        few = replace(sweep, pixels=sweep.pixels[some], sigma=sweep.sigma[some],
                      step=sweep.step[some])  # fmt: skip
        rays = rig.camera.rays(few.pixels)
        at = few.points(rig, rays)
        for k in np.flatnonzero(np.diag(rig.covariance)[CAMERA_SIZE:] > 0) + CAMERA_SIZE:
            step = np.zeros(len(rig.covariance))
            step[k] = np.sqrt(rig.covariance[k, k])
            moved = few.points(rig.perturbed(step), rays) - at
            far += float(np.mean((moved**2).sum(axis=1))) / len(sweeps)
    return float(np.sqrt(far))


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


def noise_of(sweep: Sweep, rig: Rig) -> Floats:
    """(n, 3) mm in the object's frame: how one standard deviation of the stripe moves a point."""
    aside = np.zeros(2)
    aside[sweep.across] = _NUDGE_PX
    ends = [sweep.points(rig, rig.camera.rays(sweep.pixels + d)) for d in (aside, -aside)]
    moved: Floats = (ends[0] - ends[1]) / (2 * _NUDGE_PX) * sweep.sigma[:, None]
    return moved
