"""What scans of a part say of their rig: where surfaces agree, and where they are a known body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.calibrate._bodies import Body
from turnscan.calibrate._normal import Block
from turnscan.calibrate._patches import Patches
from turnscan.calibrate._prior import RigPrior, moved_by
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.calibrate._sweeps import Sweep
from turnscan.rig import Pose, Rig, TableMotion, nearest_rotation, rotation_from_vector

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
_MOVES = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")
_NEAR_TURN, _NEAR_SHIFT = 0.2, 20.0
"""rad and mm: how far the part may be turned and shifted at most from where a step begins."""
_NUDGE = 1e-6


@dataclass(frozen=True)
class Surfaces:
    """What is adjusted: the rig with its motion, how the part was laid down, and the bodies."""

    rig: Rig
    bodies: tuple[Body, ...] = ()
    poses: tuple[Pose, ...] = ()
    """Of the part's second pose and those that follow: its object's frame → the first one's, in
    which bodies stand."""

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
        """Of the rig, of the table's motion, of how the part was laid down, of the bodies."""
        bodies = (n for body in self.state.bodies for n in body.names)
        laid = (f"pose{k + 2}.{n}" for k in range(len(self.state.poses)) for n in _MOVES)
        return (*self.state.rig.parameter_names, *self.state.motion.names, *laid, *bodies)

    @cached_property
    def _first(self) -> Ints:
        return np.cumsum([0, *(len(s.angles) for s in self.sweeps)]).astype(np.int32)

    @property
    def own_sizes(self) -> tuple[int, ...]:
        """No step has parameters of its own; its points have errors in common."""
        return (0,) * int(self._first[-1])

    def moved(self, state: Surfaces, common: Floats, own: Sequence[Floats]) -> Surfaces:
        """``state`` after a step of the parameters."""
        loose = self._nudged(state, common)
        rig, motion = loose.rig, loose.motion
        T = rig.T_camera_table
        T = Pose(nearest_rotation(T.rotation), T.translation)
        rig = replace(rig, T_camera_table=T, motion=motion)
        bodies = tuple(
            body.moved(common[part]) for body, part in zip(state.bodies, self._columns, strict=True)
        )
        poses = tuple(
            Pose(nearest_rotation(pose.rotation), pose.translation) for pose in loose.poses
        )
        return Surfaces(rig, bodies, poses)

    @staticmethod
    def _nudged(state: Surfaces, common: Floats) -> Surfaces:
        """Rig and poses after a step of the first parameters; bodies stay."""
        p, q = len(state.rig.parameter_names), len(state.motion.names)
        motion = TableMotion.of(state.motion.values + common[p : p + q])
        rig = replace(state.rig.perturbed(common[:p]), motion=motion)
        laid = common[p + q : p + q + 6 * len(state.poses)]
        poses = tuple(
            Pose(pose.rotation @ rotation_from_vector(w[:3]), pose.translation + w[3:])
            for pose, w in zip(state.poses, laid.reshape(-1, 6), strict=True)
        )
        return replace(state, rig=rig, poses=poses)

    @cached_property
    def _columns(self) -> list[slice]:
        """Which parameters are those of each body."""
        cuts = self._own + np.cumsum([0, *(len(b.names) for b in self.state.bodies)])
        return [slice(int(a), int(b)) for a, b in pairwise(cuts)]

    def places(self, state: Surfaces) -> list[Floats]:
        """The points (n, 3) of every sweep, mm in the object's frame of the first pose."""
        return self._places(state, self._rays(state.rig))

    def _places(self, state: Surfaces, rays: list[Floats]) -> list[Floats]:
        laid = (Pose(), *state.poses)
        return [
            laid[s.pose].apply(s.points(state.rig, r))
            for s, r in zip(self.sweeps, rays, strict=True)
        ]

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
        at = self.places(state)
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
        """Parameters of rig, motion and poses."""
        state = self.state
        return len(state.rig.parameter_names) + len(state.motion.names) + 6 * len(state.poses)

    def _zeros(self, rows: int) -> Floats:
        return np.zeros((rows, len(self.names)))

    def _slopes(self, state: Surfaces) -> list[list[Floats]]:
        """How all points move with each active parameter of rig, motion and poses."""
        rig = state.rig
        rays = self._rays(rig)
        out = []
        for k in np.flatnonzero(self.active[: self._own]):
            h = _NUDGE * (rig.camera.fx if k < 4 else 1.0)
            ends = []
            for sign in (h, -h):
                delta = np.zeros(self._own)
                delta[k] = sign
                moved = self._nudged(state, delta)
                seen = self._rays(moved.rig) if k < CAMERA_SIZE else rays
                ends.append(self._places(moved, seen))
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
        laid = 6 * len(state.poses)
        if laid:
            common = self._zeros(laid)
            near = np.tile(np.repeat([_NEAR_TURN, _NEAR_SHIFT], 3), len(state.poses))
            common[np.arange(laid), self._own - laid + np.arange(laid)] = 1 / near
            out.append(Block(-1, PRIOR_PLACE, np.zeros(laid), common, np.zeros((laid, 0))))
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
