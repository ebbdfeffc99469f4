"""Space-time refinement: each surface element is measured while the laser sheet sweeps over it.

In one picture a step of brightness pulls the stripe's centre aside, and at an edge half of the
stripe is missing. As the table turns, each element of the surface crosses the sheet, and its light
rises and falls with the sheet's own profile, whatever the element's brightness (Curless & Levoy
1995, for translation). A centre is moved along its line until the light of the element under it,
followed through the pictures, balances on the sheet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.points._build import goes_round
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import Light, Orientation, Stripe, StripeFlag, scattered

_PITCH = 8
"""px between the places where paths are computed; they change slowly in between."""
_MOST = 16
"""Frames to either side that an element is followed through; near the axis that is not enough."""
_CHUNK = 16
"""Frames that are refined at once."""
_PROBES, _ROUNDS = 5, 4
"""Frames by which the thickness of the sheet is measured, and rounds of that."""
_START = 1.5
"""Thickness to begin with, in that of the stripe: next to brightness steps it looks thinner."""
_SURE, _FAR = 1.5, 3.0
"""Sigmas of its own by which a centre of more noise must differ to count, and sigmas of the
ordinary one by which it must to make that less certain."""
_MANY = 200
"""Bends that must be there to tell how the pictures are blurred."""
_FINE = 0.05
"""px to which bends are weighed."""
_TRIMS, _TRIM = 8, 4.5
"""Rounds, and median departures from which a bend is that of an edge."""
_CERTAIN = 3.0
"""Standard deviations by which there must be a blur."""
_BESIDE = 0.8
"""Part of a blur's pull on the frames beside that a centre is uncertain by."""
_DOUBT = 0.5
"""Widths that a centre is uncertain by at least where its element is not one of a surface."""


class Each(Protocol):
    """``map``, or that of a pool of threads."""

    def __call__(self, do: Callable[[int], Any], numbers: Iterable[int], /) -> Iterable[Any]: ...


@dataclass(frozen=True, eq=False)
class Swept:
    """What became of the stripes of one laser."""

    stripes: tuple[Stripe, ...]
    followed: Bools
    """(s, n) True for the centres whose element was followed through the whole sheet."""
    refined: Bools
    """(s, n) True for those of them that were refined."""
    thickness: float
    """mm rms of the sheet, blur included; where the steps are too large to see it, as wide as the
    stripe in the pictures. NaN without a stripe."""
    arc: float
    """mm by which a step moves the surface through the sheet, median of the points; NaN without."""
    most: float
    """mm by which it may; NaN without a stripe."""


def refine(
    rig: Rig,
    laser: str,
    stripes: Sequence[Stripe],
    angles: npt.ArrayLike,
    look: Callable[[int], Light],
    each: Each = map,
) -> Swept:
    """Stripes of successive frames → the same, refined with the light of the frames around each.

    ``angles`` (s,) are the table's, rad, in scan order; ``look(k)`` gives the light of frame k, and
    may be called several times for a frame. ``each`` maps, in threads if that is wanted.

    A centre is refined where its surface element is followed from one side of the sheet to the
    other in steps of at most 1.5 thicknesses, which sets the largest step of the table; the others
    stay as they are. A centre whose element proves not to be lit as a surface would be, as beyond
    a depth edge, keeps its place with a larger sigma. Raises what ``look`` raises.
    """
    from turnscan.points import _sweep_kernels as kernels

    shape = (len(stripes), len(stripes[0].position) if stripes else 0)
    none = np.zeros(shape, np.bool_)
    places = _Places.of(rig, laser, stripes, np.asarray(angles, np.float64))
    if places is None:
        return Swept(tuple(stripes), none, none, np.nan, np.nan, np.nan)
    job = _Job(places, look, each)
    thickness = job.thickness(_START * places.width)
    if np.isnan(thickness):
        most = kernels.GAP * places.width
        return Swept(tuple(stripes), none, none, places.width, places.arc, most)
    found = np.empty((len(stripes), 6, shape[1]))
    for first in range(0, len(stripes), _CHUNK):
        some = range(first, min(first + _CHUNK, len(stripes)))
        found[some.start : some.stop] = job.refined(some, thickness)
    apart = max(round(kernels.HALF * thickness / max(places.arc, 1e-9)), 1)
    blur = _blur(found[:, 0], found[:, 1], found[:, 5], apart)
    found[:, 2] += (_BESIDE * blur * _pulled_beside(found[:, 5])) ** 2
    done, refined = list[Stripe](), none.copy()
    for k, stripe in enumerate(stripes):
        new, refined[k] = _combined(stripe, found[k], blur)
        done.append(new)
    followed = ~np.isnan(found[:, 4])
    most = kernels.GAP * thickness
    return Swept(tuple(done), followed, refined, thickness, places.arc, most)


def _blur(centre: Floats, noise: Floats, pull: Floats, apart: int) -> float:
    """Half the variance of the pictures' blur, px²; 0 where it is not known.

    A blur mixes the light of neighbours, and pulls each centre by ``pull`` (s, n) px per px² of
    it. A smooth surface bends little over ``apart`` frames, or lines, beyond the sheet to both
    sides; so what the centres (s, n), of variances ``noise`` (s, n), bend as the pull does is the
    blur's. Edges bend otherwise, and are left out.
    """
    from turnscan.points import _sweep_kernels as kernels

    bent, pulled = (_bends(a, apart) for a in (centre, pull))
    spread = np.maximum(_bends(noise, apart, 4.0), _FINE**2)
    with np.errstate(invalid="ignore"):
        known = ~np.isnan(bent) & ((kernels.BLUR * pulled) ** 2 > spread)
    if np.count_nonzero(known) < _MANY:
        return 0.0
    bent, pulled, spread = bent[known], pulled[known], spread[known]
    half = _middle(bent / pulled, np.abs(pulled) / np.sqrt(spread))
    for _ in range(_TRIMS):
        left = np.abs(bent - half * pulled) / np.sqrt(spread)
        weight = np.where(left <= _TRIM * np.median(left), pulled / spread, 0.0)
        half = float(np.sum(weight * bent) / np.sum(weight * pulled))
    off = np.sqrt(np.sum((weight * (bent - half * pulled)) ** 2)) / np.sum(weight * pulled)
    # More than any lens makes is an edge's.
    return half if _CERTAIN * off < half < kernels.BLUR else 0.0


def _pulled_beside(pull: Floats) -> Floats:
    """(s, n) px per px²: by what a blur pulls the same line in the frames beside, at most.

    Where the pull changes its sign its own value says nothing of terms of higher order.
    """
    size = np.nan_to_num(np.abs(pull))
    return np.asarray(np.maximum(np.roll(size, 1, axis=0), np.roll(size, -1, axis=0)))


def _bends(values: Floats, apart: int, middle: float = -2.0) -> Floats:
    """Sums of two of values (s, n) ``apart`` and ``middle`` times the one between them: first those
    of frames, then those of lines."""
    return np.concatenate(
        [
            (a[: -2 * apart] + middle * a[apart:-apart] + a[2 * apart :]).ravel()
            for a in (values, values.T)
            if len(a) > 2 * apart
        ]
        or [np.zeros(0)]
    )


def _middle(values: Floats, weights: Floats) -> float:
    """The median of values (n,) that have weights (n,)."""
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(share, 0.5 * share[-1])]])


def _combined(old: Stripe, found: Floats, blur: float) -> tuple[Stripe, Bools]:
    """The ordinary stripe with what `_sweep_kernels.refine_lines` found, (6, n); where that is new.

    What a ``blur`` (`_blur`) pulls is put back. An ordinary centre of less noise stays where the
    new one does not contradict it. Where it is far off for its own sigma, or its element has no
    light that balances, that makes it uncertain.
    """
    centre, noise, doubt, _, off, pull = found
    centre = centre - blur * pull
    there = ~np.isnan(centre)
    gap = np.where(there, 0.0, np.nan)
    alone = replace(
        old,
        position=centre,
        sigma=np.sqrt(noise),
        amplitude=old.amplitude + gap,
        width=old.width + gap,
    )
    sigma = scattered(alone)
    whole = np.sqrt(sigma**2 + doubt)
    shift = np.abs(centre - old.position)
    with np.errstate(invalid="ignore"):
        new = there & ((sigma <= old.sigma) | (shift > _SURE * sigma))
        kept = there & ~new & (shift > _FAR * old.sigma)
    failed = ~there & ~np.isnan(off)
    lost = np.where(failed, np.maximum(off, _DOUBT * old.width), np.where(kept, shift, 0.0))
    stripe = replace(
        old,
        position=np.where(new, centre, old.position),
        sigma=np.where(new, whole, np.hypot(old.sigma, lost)),
        flags=old.flags | np.where(new, np.uint16(StripeFlag.REFINED), np.uint16(0)),
    )
    return stripe, np.asarray(new)


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the stripe of one laser is in its frames, and how elements run through them."""

    position: Floats
    """(s, n) px, NaN where missing."""
    found: Bools
    """(s, n)."""
    turns: Floats
    """(s,) rad."""
    closed: bool
    paths: Floats
    """See `paths_of`."""
    width: float
    """mm rms of the sheet, as wide as the stripe looks; median."""
    arc: float
    """mm through the sheet in a step, median."""
    slow: float
    """The same, 5 % quantile: elements near the axis, which stay in the light for longest."""
    top: int
    """First line of the pieces of pictures that are needed: where the stripe is, and as far beside
    it as an element runs while it is lit."""
    starts: npt.NDArray[np.int64]
    """(s,) their first columns."""
    shape: tuple[int, int]
    """Lines and columns of a piece."""

    @classmethod
    def of(cls, rig: Rig, laser: str, stripes: Sequence[Stripe], angles: Floats) -> _Places | None:
        """None where there are fewer than three frames, or no centre."""
        if len(stripes) < 3 or not any(s.found.any() for s in stripes):
            return None
        position = np.stack([s.position for s in stripes])
        found: Bools = ~np.isnan(position)
        paths = paths_of(rig, laser, stripes[0].orientation)
        _, line = np.nonzero(found)
        column = np.clip(position[found] // _PITCH, 0, paths.shape[1] - 1).astype(np.intp)
        _, across, away = np.moveaxis(paths[line // _PITCH, column, :, 0], -1, 0)
        with np.errstate(all="ignore"):
            pixel = np.abs(away / across)
        width = float(np.nanmedian(np.stack([s.width for s in stripes])[found] * pixel))
        turns = np.unwrap(angles)
        arcs = np.abs(away) * float(np.median(np.abs(np.diff(turns))))
        beside = int(4.0 * width / float(np.nanmedian(pixel))) + 4
        some: Bools = np.asarray(found.any(axis=1))
        low, high = np.zeros(len(some)), np.zeros(len(some))
        low[some] = np.nanmin(position[some], axis=1) - beside
        high[some] = np.nanmax(position[some], axis=1) + beside
        top = max(int(line.min()) - 1, 0)
        return cls(
            position,
            found,
            turns,
            goes_round(angles),
            paths,
            width,
            float(np.nanmedian(arcs)),
            float(np.nanquantile(arcs, 0.05)),
            top,
            np.floor(low).astype(np.int64),
            (int(line.max()) + 2 - top, int((high - low).max()) + 2),
        )


class _Job:
    """The frames of one laser, looked at a few at a time."""

    def __init__(self, places: _Places, look: Callable[[int], Light], each: Each) -> None:
        self._places, self._look, self._each = places, look, each
        self._pieces: dict[int, tuple[npt.NDArray[np.float32], float, float]] = {}

    def thickness(self, guess: float) -> float:
        """mm rms of the sheet: over what distance the light of elements rises and falls.

        NaN where no element is followed through the sheet.
        """
        last = len(self._places.turns) - 1
        probes = np.unique(np.linspace(0, last, _PROBES + 2).round().astype(int)[1:-1])
        seen = list[float]()
        for k in probes.tolist():
            now = guess
            for _ in range(_ROUNDS):
                wide = self.refined(range(k, k + 1), now)[0][3]
                wide = wide[~np.isnan(wide)]
                now = now * float(np.median(wide)) if len(wide) else np.nan
                if np.isnan(now):
                    break
            seen.append(now)
        return float(np.nanmedian(seen)) if not np.isnan(seen).all() else np.nan

    def refined(self, some: range, thickness: float) -> list[Floats]:
        """What `_sweep_kernels.refine_lines` finds in these successive frames, (6, n) each."""
        from turnscan.points import _sweep_kernels as kernels

        places, n = self._places, len(self._places.turns)
        reach = int(kernels.HALF * thickness / max(places.slow, 1e-9)) + 2
        reach = min(reach, _MOST, (n - 1) // 2)
        around = range(some.start - reach, some.stop + reach)
        frames = [k % n for k in around if places.closed or 0 <= k < n]
        first = around.start if places.closed else max(around.start, 0)
        self._load(frames)
        light = np.stack([self._pieces[k][0] for k in frames])
        starts, turns = places.starts[frames], places.turns[frames]

        def one(k: int) -> Floats:
            near = slice(max(k - first - reach, 0), k - first + reach + 1)
            away = np.mod(turns[near] - places.turns[k] + np.pi, 2 * np.pi) - np.pi
            seen = (light[near], places.top, starts[near], away)
            sweep, terms = (places.paths, float(_PITCH)), (thickness, *self._pieces[k][1:])
            out = np.empty((6, places.position.shape[1]))
            kernels.refine_lines(seen, sweep, places.position[k], terms, out)
            return out

        return list(self._each(one, some))

    def _load(self, frames: Sequence[int]) -> None:
        """Have the pieces of these frames, and of no others."""
        self._pieces = {k: piece for k, piece in self._pieces.items() if k in frames}
        missing = [k for k in dict.fromkeys(frames) if k not in self._pieces]
        self._pieces |= dict(zip(missing, self._each(self._piece, missing), strict=True))

    def _piece(self, k: int) -> tuple[npt.NDArray[np.float32], float, float]:
        places, light = self._places, self._look(k)
        piece = light.piece((places.top, int(places.starts[k])), places.shape)
        return piece, light.noise, light.per_level


def paths_of(rig: Rig, laser: str, orientation: Orientation) -> Floats:
    """How points of a laser's sheet run through the picture as the table turns.

    (rows, columns, 3, 3), every `_PITCH` px along and across the stripe (image rows and columns for
    a vertical one): by what a point that is seen there in the sheet moves along (px) and across
    (px) the stripe and away from the sheet (mm), as factors of the powers 1, 2, 3 of the turn in
    rad. NaN where there is no sheet. Raises KeyError for a laser that the rig does not have.
    """
    from turnscan.points._sweep_kernels import TERMS, TURN

    camera, sheet, T = rig.camera, rig.sheet(laser), rig.T_camera_table
    vertical = orientation == "vertical"
    shape = (camera.height, camera.width) if vertical else (camera.width, camera.height)
    places = (np.arange(0.0, n + _PITCH, _PITCH) for n in shape)
    lattice = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    pixels = lattice[..., ::-1] if vertical else lattice
    at = T.inverse().apply(sheet.intersect(camera.rays(pixels)))
    turns = TURN * np.cos(np.pi * (np.arange(8) + 0.5) / 8)
    moved = np.empty((len(turns), *lattice.shape[:2], 3))
    for k, turn in enumerate(turns):
        X = T.apply(at @ rotation_z(turn).T)
        gone = camera.project(X) - pixels
        moved[k, ..., :2] = gone[..., ::-1] if vertical else gone
        moved[k, ..., 2] = sheet.distance(X)
    powers = np.linalg.pinv(turns[:, None] ** np.arange(1, TERMS + 1))
    return np.ascontiguousarray(np.einsum("pk,kijc->ijcp", powers, moved))
