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
from turnscan.calibrate._point_slopes import point_slopes, ray_slopes
from turnscan.calibrate._prior import RigPrior, moved_by
from turnscan.calibrate._residuals import CAMERA_SIZE
from turnscan.calibrate._sweeps import NUDGE_PX, Sweep
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
class Scale:
    """Standard uncertainties of gaps, mm, as they are in one state of a rig."""

    own: Floats
    """(m,) mm, by the stripes' noise alone."""
    least: float
    """A point that slides along its surface says nothing, but not with infinite weight."""
    coarse: float
    """What a gap says less, where surfaces are still far apart."""

    @cached_property
    def sigma(self) -> Floats:
        """(m,) mm."""
        out: Floats = np.hypot(np.maximum(self.own, self.least), self.coarse)
        return out

    def now(self, own: Floats, size: float) -> Scale:
        """In another state, in which the scene is ``size`` times as large."""
        return Scale(own, size * self.least, size * self.coarse)

    def change(self, own: Floats, size: Floats) -> Floats:
        """(m, k) by which `sigma` changes, where noise changes by ``own`` (m, k) and the size by
        ``size`` (k,) times itself."""
        mine = self.own[:, None]
        noise = np.where(mine > self.least, mine * own, self.least**2 * size)
        out: Floats = (noise + self.coarse**2 * size) / self.sigma[:, None]
        return out


def scale_of(own: Floats, coarse: float) -> Scale:
    """That of gaps whose noise is ``own`` (m,) mm."""
    return Scale(own, _LEAST_SIGMA * float(np.median(own)) if len(own) else 0.0, coarse)


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
    scale: Scale
    """Of what all of them make of it, where the state is the network's."""

    @property
    def sigma(self) -> Floats:
        """(m,) mm: what all of them make of it."""
        return self.scale.sigma

    @property
    def kind(self) -> str:
        """The kind of its residuals."""
        return f"surface {self.asked} on {self.others}"

    def noise(self, by: Sequence[Floats]) -> tuple[Floats, Floats]:
        """(m, …) mm each: what moving the points of each sweep by (n, …, 3) mm makes of the gaps,
        by those asked, and by all of the patch, which move as its nearest does."""
        p = self.patches
        own = np.einsum("mi,m...i->m...", p.normal, by[self.asked][p.query])
        nearest = np.einsum("mi,m...i->m...", p.normal, by[self.others][p.near[:, 0]])
        return own, (nearest.T * self.spread).T

    @cached_property
    def spread(self) -> Floats:
        """(m,): noise of a patch where it stands under the point, in terms of one point's."""
        return np.asarray(np.sqrt((self.patches.weights**2).sum(axis=1)))


def pair_of(
    asked: int, others: int, patches: Patches, noise: Sequence[Floats], coarse: float
) -> Pair:
    """Of two sweeps, whose points one standard deviation of noise moves by (n, 3) mm; ``coarse`` mm
    is how little a gap says besides."""
    own = np.einsum("mi,mi->m", patches.normal, noise[asked][patches.query])
    theirs = np.einsum("mi,mki->mk", patches.normal, noise[others][patches.near])
    none = Scale(np.zeros(0), 0.0, 0.0)
    pair = Pair(asked, others, patches, own, -patches.weights * theirs, none)
    return replace(pair, scale=scale_of(np.hypot(*pair.noise(noise)), coarse))


@dataclass(frozen=True)
class _Seen:
    """Points of all sweeps (n, 3) mm, what one standard deviation of noise moves them by, mm, and
    how large the scene is; or how these change with k parameters: (n, k, 3) and (k,)."""

    at: list[Floats]
    noise: list[Floats]
    size: Floats


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
    loose_frame: bool = True
    """Whether nothing but a convention says where the table's frame is along and about its axis."""
    body_noise: tuple[tuple[Floats, ...], ...] = field(default=())
    """Per body and sweep: what one standard deviation of its points' noise makes of their
    distance, mm."""
    body_scale: tuple[tuple[Scale, ...], ...] = field(default=())
    """Per body and sweep: standard uncertainty of that distance."""

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

    def own_words(self, view: int) -> str:
        """Of the step ``view``, which has none."""
        return f"nothing of step {view}"

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
        laid = (Pose(), *state.poses)
        return [
            laid[s.pose].apply(s.points(state.rig, rays[0]))
            for s, rays in zip(self.sweeps, self._rays(state.rig), strict=True)
        ]

    def noise(self, state: Surfaces) -> list[Floats]:
        """(n, 3) mm per sweep: how one standard deviation of the stripe moves each point."""
        return self._seen(state).noise

    def _rays(self, rig: Rig) -> list[Floats]:
        """(2, n, 3) per sweep, of its pixels and of places `NUDGE_PX` beside them; those of a
        camera that does not move are found once."""
        return _rays_of(rig, self.sweeps) if self.active[:CAMERA_SIZE].any() else self._still

    @cached_property
    def _still(self) -> list[Floats]:
        return _rays_of(self.state.rig, self.sweeps)

    def blocks(self, state: Surfaces) -> list[Block]:
        """Residuals in standard deviations of the stripe's noise, and derivatives.

        That noise is one of pixels. What it makes of a gap is taken anew in each state (Sampson's
        distance): with that of another state, rigs would be preferred that turn noise out of the
        gaps, or that make everything smaller.
        """
        seen = self._seen(state)
        slopes = self._slopes(state)
        size = float(seen.size)
        columns = np.flatnonzero(self.active[: self._own])
        out = []
        for pair in self.pairs:
            own, under = pair.noise(seen.noise)
            scale = pair.scale.now(np.hypot(own, under), size)
            gaps = pair.patches.gaps(seen.at[pair.asked], seen.at[pair.others])
            by = pair.patches.gaps(slopes.at[pair.asked], slopes.at[pair.others])
            mine, theirs = pair.noise(slopes.noise)
            noise = own[:, None] * mine + under[:, None] * theirs
            wider = scale.change(noise / np.maximum(scale.own, 1e-300)[:, None], slopes.size)
            common = self._zeros(len(gaps))
            common[:, columns] = _in_sigmas(by, gaps, wider, scale)
            step = self.sweeps[pair.asked].step[pair.patches.query]
            out.append(self._block(pair.asked, step, pair.kind, -gaps / scale.sigma, common))
        for k, body in enumerate(state.bodies):
            out += self._on_body(k, body, seen, slopes)
        return out + self._priors(state)

    @cached_property
    def _own(self) -> int:
        """Parameters of rig, motion and poses."""
        state = self.state
        return len(state.rig.parameter_names) + len(state.motion.names) + 6 * len(state.poses)

    def _zeros(self, rows: int) -> Floats:
        return np.zeros((rows, len(self.names)))

    def _seen(self, state: Surfaces) -> _Seen:
        """All points, and what one standard deviation of their stripes' noise moves them by."""
        laid = (Pose(), *state.poses)
        at, noise = list[Floats](), list[Floats]()
        for sweep, rays in zip(self.sweeps, self._rays(state.rig), strict=True):
            ends = laid[sweep.pose].apply(sweep.points(state.rig, rays))
            at.append(ends[0])
            noise.append(self._per_sigma(sweep, ends))
        before = np.linalg.norm(self.state.rig.T_camera_table.translation)
        size = np.linalg.norm(state.rig.T_camera_table.translation) / before
        return _Seen(at, noise, np.asarray(size))

    @staticmethod
    def _per_sigma(sweep: Sweep, ends: Floats) -> Floats:
        """What one standard deviation of noise makes of points (or slopes) and those beside."""
        share = sweep.sigma / NUDGE_PX
        off: Floats = (ends[1] - ends[0]) * share.reshape(-1, *(1,) * (ends[0].ndim - 1))
        return off

    def _slopes(self, state: Surfaces) -> _Seen:
        """How points, their noise and the scene's size (relative to itself) change with the active
        parameters of rig, motion and poses."""
        rig = state.rig
        columns = np.flatnonzero(self.active[: self._own])
        lens = columns[columns < CAMERA_SIZE]
        at, noise = list[Floats](), list[Floats]()
        for sweep, rays in zip(self.sweeps, self._rays(rig), strict=True):
            by_lens = ray_slopes(rig.camera, _beside(sweep).reshape(-1, 2), lens)
            both = point_slopes(sweep, rig, state.poses, rays.reshape(-1, 3), by_lens, columns)
            ends = both.reshape(2, len(sweep.pixels), *both.shape[1:])
            at.append(ends[0])
            noise.append(self._per_sigma(sweep, ends))
        T = rig.T_camera_table.translation
        sizes = np.zeros(self._own)
        p = len(rig.parameter_names)
        sizes[p - 3 : p] = T / (T @ T)
        return _Seen(at, noise, sizes[columns])

    def _block(self, sweep: int, step: Ints, kind: str, residual: Floats, common: Floats) -> Block:
        none = np.zeros((len(residual), 0))
        return Block(-1, kind, residual, common, none, self._first[sweep] + step)

    def _on_body(self, k: int, body: Body, seen: _Seen, slopes: _Seen) -> list[Block]:
        out, columns = [], self._columns[k]
        active = np.flatnonzero(self.active[: self._own])
        for i, which in enumerate(body.points):
            away, unit, by = body.distance(seen.at[i][which])
            own = np.einsum("mi,mi->m", unit, seen.noise[i][which])
            scale = self.body_scale[k][i].now(np.abs(own), float(seen.size))
            slope, noise = (
                np.einsum("mi,mki->mk", unit, s[i][which]) for s in (slopes.at, slopes.noise)
            )
            wider = scale.change(np.sign(own)[:, None] * noise, slopes.size)
            common = self._zeros(len(which))
            common[:, active] = _in_sigmas(slope, away, wider, scale)
            common[:, columns] = by / scale.sigma[:, None]
            step = self.sweeps[i].step[which]
            out.append(self._block(i, step, body_kind(k), -away / scale.sigma, common))
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
            if self.loose_frame:
                gauge = gauge_of(self.prior.rig) / _GAUGE
                common = self._zeros(2)
                common[:, : len(state.rig.parameter_names)] = gauge
                off = -gauge @ moved_by(self.prior.rig, state.rig)
                out.append(Block(-1, PRIOR_GAUGE, off, common, np.zeros((2, 0))))
        return out


def _beside(sweep: Sweep) -> Floats:
    """(2, n, 2) px: the pixels of a sweep, and places beside them."""
    return np.stack([sweep.pixels, sweep.pixels + NUDGE_PX * np.eye(2)[sweep.across]])


def _rays_of(rig: Rig, sweeps: Sequence[Sweep]) -> list[Floats]:
    return [rig.camera.rays(_beside(sweep)) for sweep in sweeps]


def _in_sigmas(by: Floats, off: Floats, wider: Floats, scale: Scale) -> Floats:
    """(m, k): derivative of ``off`` (m,) mm in standard deviations, where it and they change by
    ``by`` and ``wider`` (m, k)."""
    sigma = scale.sigma[:, None]
    slopes: Floats = (by - off[:, None] * wider / sigma) / sigma
    return slopes


def body_kind(body: int) -> str:
    """The kind of the residuals of points on a body."""
    return f"body {body + 1}"


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


def known_together(rig: Rig) -> bool:
    """Whether the camera is known together with sheets or table, as from pictures of boards: what
    moves these without it contradicts the pictures."""
    C, k = rig.covariance, CAMERA_SIZE
    return C is not None and bool(np.any(C[:k, k:] != 0.0))


def gauge_of(rig: Rig) -> Floats:
    """(2, p): the turn of the table about its own axis and its shift along it, which move the part
    in its frame and nothing else."""
    p = len(rig.parameter_names)
    axis = rig.T_camera_table.rotation[:, 2]
    out = np.zeros((2, p))
    out[0, p - 6 : p - 3] = axis
    out[1, p - 3 :] = axis
    return out
