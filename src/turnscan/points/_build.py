"""Stripes of one laser at many table angles → RangeGrid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Flags, Floats, Singles, handed_over
from turnscan.errors import InputError
from turnscan.points._curvature import curvature_shift, thin_doubt
from turnscan.points._grid import RangeGrid, lines_about
from turnscan.points._lit_points import LitPoints
from turnscan.points._scatter import pooled_sigma
from turnscan.points._straight import straight_on
from turnscan.points._triangulate import beyond_axis, to_object, triangulate
from turnscan.points._volume import without
from turnscan.points._wholeness import wholeness
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import Stripe, StripeFlag
from turnscan.threads import in_parts

_GAP = 2.5
"""The turn is closed when the gap from last to first is at most this many usual steps."""
_CLAIMED = 0.15
"""Part of the usual variance for its width below which a frame's own is not believed."""
_TOGETHER = 64
"""Steps whose points are computed at a time."""
_ODD = 1.5
"""Times a point's sigma by which profiles on both sides of it are doubted, and it as much as they:
what cuts stripes along an edge cuts those between them too, which by chance look well."""
_ALIKE = 8
"""Lines to either side on a profile whose usual doubt a point has at least: an edge along the
profile cuts them all alike."""
_CURVED = 0.15
"""Part of what a thick sheet shifts that is doubted, one standard deviation. The thickness is known
to a twentieth, and the shift is its square: 0.10. How a surface sends light back, and how a sheet's
profile differs from a Gaussian: 0.10. The formula itself (`curvature_shift`): 0.03."""


def build_grid(
    rig: Rig,
    laser: str,
    stripes: Sequence[Stripe],
    steps: npt.ArrayLike,
    angles: npt.ArrayLike,
    angle_sigma: npt.ArrayLike | None = None,
) -> RangeGrid:
    """All stripes of one laser → its range grid in the object's frame.

    ``steps`` (s,) are step numbers and ``angles`` (s,) table angles in radians, one per stripe,
    in scan order; ``angle_sigma`` (s,) rad their standard uncertainties, NaN or None where
    unknown. A centre whose ray does not meet the sheet is missing, flagged OUTSIDE. Sigma is the
    root of the sum of squares of the stripe's own, with the scatter of the pictures about it
    (`pooled_sigma`), of what its width says (`wholeness`; nothing
    where it was refined), of what a thick sheet does on a curved surface (`curvature_shift`, which
    is taken off), and of how far the angle's uncertainty carries the point off its surface; where
    profiles on both sides are doubted by much more, that of the better one, and no less than most
    of those beside it on its profile are doubted.
    Stripes that something cuts where what is seen ends are flagged EDGE.

    Raises InputError where counts or lengths do not fit, KeyError for an unknown laser.
    """
    turns = np.asarray(angles, dtype=np.float64)
    if not stripes:
        raise InputError(
            f"laser {laser}: no frame with a picture and a table angle",
            hint=Remedy("import the pictures again with ", Option("angles")),
        )
    if not (len(stripes) == turns.size == np.size(steps)):
        raise InputError(
            f"laser {laser}: {len(stripes)} stripes, {np.size(steps)} steps, {turns.size} angles",
            hint="give one step number and one angle for each stripe",
        )
    shapes = {(len(s.position), s.orientation) for s in stripes}
    if len(shapes) > 1:
        raise InputError(
            f"laser {laser}: stripes of different lengths or directions: {sorted(shapes)}",
            hint="all pictures of a scan must have one size",
        )
    vertical = stripes[0].orientation == "vertical"
    light, flags = np.stack([s.amplitude for s in stripes]), np.stack([s.flags for s in stripes])
    # Lines before the first one with a point and after the last tell nothing of any other.
    lines = lines_about(np.stack([s.found for s in stripes]))
    position, sigma, width = (
        np.stack([getattr(s, name)[lines] for s in stripes])
        for name in ("position", "sigma", "width")
    )
    nothing = np.full(len(stripes[0].position), np.nan)
    skew = np.stack([(nothing if s.skew is None else s.skew)[lines] for s in stripes])
    points, scale, behind = _met(rig, laser, position, lines.start, turns, vertical)
    lost = ~np.isnan(position) & np.isnan(points[..., 0])
    eye = rig.T_camera_table.inverse().translation
    scale[lost] = np.nan
    closed = goes_round(turns)
    sigma, alike = pooled_sigma(stripes, sigma, width, flags[:, lines], turns, closed)
    sigma = _believable(sigma, width, light[:, lines], flags[:, lines])
    grid = RangeGrid(
        laser=laser,
        steps=np.asarray(steps, dtype=np.int32),
        angles=turns,
        points=handed_over(points, nan=True),
        sigma=handed_over(sigma * scale, nan=True),
        amplitude=handed_over(np.where(lost, np.nan, light[:, lines]), nan=True),
        flags=handed_over(np.where(lost, np.uint16(StripeFlag.OUTSIDE), flags[:, lines])),
        closed=closed,
        eyes=np.einsum("sij,j->si", rotation_z(-turns), eye),
        behind=handed_over(behind & ~lost),
        halo=_moved_by_halo(stripes, lines, scale),
        noise=handed_over((sigma * scale).astype(np.float32), nan=True),
        alike=alike,
    )
    shaky = np.zeros(len(turns)) if angle_sigma is None else np.nan_to_num(angle_sigma)
    if len(turns) > 1 and grid.found.any():
        grid = _judged(grid, rig, (width, skew), scale, shaky, vertical)
    return grid.among(lines, light, flags)


def _met(
    rig: Rig, laser: str, position: Floats, first: int, turns: Floats, vertical: bool
) -> tuple[Floats, Floats, Bools]:
    """Where stripes at ``position`` (s, n) px in the lines from ``first`` on meet the sheet:
    points (s, n, 3), mm for each px of a centre (s, n), and True (s, n) beyond the axis.

    NaN where there is no centre, or where its ray does not meet the sheet.
    """
    points, scale = np.empty((*position.shape, 3)), np.empty(position.shape)
    behind = np.zeros(position.shape, dtype=np.bool_)

    def part(a: int, b: int) -> None:
        # Here, and not before: touching new memory takes longer than what is computed.
        points[a:b], scale[a:b] = np.nan, np.nan
        there = ~np.isnan(position[a:b])
        step, line = np.nonzero(there)
        pair = (position[a:b][there], (line + first).astype(np.float64))
        pixels = np.stack(pair if vertical else pair[::-1], axis=-1)
        ones, across = np.ones(len(pixels)), 0 if vertical else 1
        camera, scale[a:b][there] = triangulate(rig, laser, pixels, ones, across=across)
        points[a:b][there] = to_object(rig, camera, turns[a:b][step])
        behind[a:b][there] = beyond_axis(rig, laser, camera)

    in_parts(part, len(position), _blocks(len(position)))
    return points, scale, behind


def _moved_by_halo(stripes: Sequence[Stripe], lines: slice, scale: Floats) -> Singles | None:
    """(s, n) mm by which halos move the points of these ``lines``, NaN where nothing tells; None
    where no stripe tells any. ``scale`` (s, n) is mm for each px of a centre."""
    out = np.full(scale.shape, np.nan, np.float32)
    for row, stripe, worth in zip(out, stripes, scale, strict=True):
        if stripe.halo is not None:
            row[:] = np.abs(stripe.halo[lines]) * worth
    return None if np.isnan(out).all() else handed_over(out, nan=True)


def _blocks(steps: int) -> int:
    """Parts of the steps whose arrays stay in a processor's cache."""
    return -(-steps // _TOGETHER)


def _believable(sigma: Floats, width: Floats, light: Floats, flags: Flags) -> Floats:
    """(s, n) px: the stripes' sigma, raised where one frame claims what no other one does.

    Speckle moves a centre by as much in every frame, for its width. A frame of few whole lines
    cannot tell how much (`stripes.scattered`); it has the usual of all. Frames are judged as wholes
    and at their brightness: that a bright stripe is known better where photons decide is true.
    """
    single = (flags & StripeFlag.REFINED) == 0
    known = single & ~np.isnan(sigma) & (width > 0) & (light > 0)
    if not known.any():
        return sigma
    share = np.where(known, sigma**2 / np.where(known, width, 1.0), np.nan)
    usual, bright = float(np.median(share[known])), float(np.median(light[known]))
    short = np.zeros(len(sigma), dtype=np.bool_)

    def judge(a: int, b: int) -> None:
        part = np.sort(share[a:b] * np.maximum(light[a:b] / bright, 1.0), axis=1)  # NaN last
        count = known[a:b].sum(axis=1)
        middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2], axis=-1)
        middle = np.minimum(middle, part.shape[1] - 1)
        own = np.take_along_axis(part, middle, axis=1).mean(axis=1)
        short[a:b] = (count > 0) & (own < _CLAIMED * usual)

    in_parts(judge, len(sigma))
    return np.where(short[:, None] & known, np.sqrt(sigma**2 + usual * width), sigma)


def _judged(
    grid: RangeGrid,
    rig: Rig,
    light: tuple[Floats, Floats],
    scale: Floats,
    shaky: Floats,
    vertical: bool,
) -> RangeGrid:
    """The grid with what the stripes' width and skew, ``light`` (s, n) px and (s, n), and the
    angles' uncertainty ``shaky`` (s,) rad add to sigma; ``scale`` (s, n) is mm for each px of a
    stripe's centre."""
    seen = _lit_points(grid, rig, light, vertical)
    whole = wholeness(seen)
    # A centre that was refined by its own surface element does not depend on the stripe's width.
    single = (grid.flags & StripeFlag.REFINED) == 0
    glow = whole.glow & single
    if glow.any():
        # What was taken for a surface there misled the judgement of all about it.
        grid = without(grid, glow, StripeFlag.DARK)
        if not grid.found.any():
            return grid
        seen = _lit_points(grid, rig, light, vertical)
        whole = wholeness(seen)
    whole = replace(whole, doubt=straight_on(seen, whole.doubt, whole.shift))
    # Where all of a part slopes alike its stripes do not tell; then what the rig knows counts.
    thick = whole.thickness or rig.sheet(grid.laser).thickness or 0.0
    bent = curvature_shift(seen, thick) if thick > 0 else np.zeros(scale.shape)
    bent = np.where(whole.shift != 0.0, 0.0, bent)  # what is cut has its own
    thin = thin_doubt(seen, thick) * (bent == 0.0) if thick > 0 else np.zeros(scale.shape)
    points = np.empty_like(grid.points)
    sigma, more = np.empty_like(grid.sigma), np.empty_like(grid.sigma)
    common = np.zeros(grid.points.shape, np.float32) if thick > 0 else None

    def part(a: int, b: int) -> None:
        along, X = seen.along[a:b], grid.points[a:b]
        carried = np.hypot(X[..., 0], X[..., 1]) * shaky[a:b, None] * whole.slide[a:b]
        doubt = np.hypot(whole.doubt[a:b], _CURVED * bent[a:b])
        points[a:b] = X - along * ((whole.shift[a:b] + bent[a:b]) * single[a:b])[..., None]
        more[a:b] = np.hypot(doubt * scale[a:b], thin[a:b]) * single[a:b]
        sigma[a:b] = np.sqrt(grid.sigma[a:b] ** 2 + more[a:b] ** 2 + carried**2)
        if common is not None:
            shift = _CURVED * bent[a:b] * single[a:b]
            common[a:b] = np.nan_to_num(along * shift[..., None])

    in_parts(part, len(points), _blocks(len(points)))
    sigma = np.where(single, _doubted_alike(sigma, more, whole.near, grid.closed), sigma)
    edge = np.where(whole.tail & single, np.uint16(StripeFlag.EDGE), np.uint16(0))
    return replace(
        grid,
        points=handed_over(points, nan=True),
        sigma=handed_over(sigma, nan=True),
        flags=handed_over(grid.flags | edge),
        thickness=whole.thickness,
        light_doubt=None if common is None else handed_over(common),
        width_share=handed_over(whole.share.astype(np.float32), nan=True),
    )


def _doubted_alike(sigma: Floats, doubt: Floats, near: Bools, closed: bool) -> Floats:
    """(s, n) mm: ``sigma`` (s, n), but not below what the ``doubt`` (s, n) of points beside is, of
    which most are cut by the same edge: of profiles on both sides where the sheet's light reaches
    over a step (``near``), and of most points beside on the same profile. NaN where none is."""
    from turnscan.points import _wholeness_kernels as kernels

    beside = _both_sides(np.where(near, doubt, np.nan), closed)
    sigma = np.where(beside > _ODD * sigma, beside, sigma)
    usual = in_parts(lambda a, b: kernels.usual(doubt[a:b], _ALIKE), len(doubt))
    return np.maximum(sigma, np.concatenate(usual))


def _both_sides(doubt: Floats, closed: bool) -> Floats:
    """(s, n) mm: by how much, at least, profiles on both sides are doubted on each line, where no
    more than one other lies on the face between them; NaN where the next is missing."""
    none = np.full((2, doubt.shape[1]), np.nan)
    rows = np.concatenate([doubt[-2:], doubt, doubt[:2]] if closed else [none, doubt, none])
    before, after = rows[1:-3], rows[3:-1]
    beside = np.minimum(before, after)
    for near, far in ((before, rows[4:]), (after, rows[:-4])):
        beside = np.where(np.isnan(beside), np.nan, np.fmax(beside, np.minimum(near, far)))
    return np.asarray(beside)


def _lit_points(
    grid: RangeGrid, rig: Rig, light: tuple[Floats, Floats], vertical: bool
) -> LitPoints:
    """What is known of the ``light`` of a grid, of its width and skew, that knows where its camera
    stood."""
    assert grid.eyes is not None
    T, sheet = rig.T_camera_table, rig.sheet(grid.laser)
    found, turn = grid.found, rotation_z(grid.angles)
    aside, sheets = np.empty(grid.points.shape), np.empty(grid.points.shape)

    def part(a: int, b: int) -> None:
        aside[a:b], sheets[a:b] = np.nan, np.nan
        there = found[a:b]
        camera = T.apply(np.einsum("sij,snj->sni", turn[a:b], grid.points[a:b])[there])
        next_ray = np.zeros((len(camera), 3))
        slopes = rig.camera.ray_derivatives(camera[:, :2] / camera[:, 2:])
        next_ray[:, :2] = slopes[:, :, 0 if vertical else 1] * camera[:, 2:]
        for vectors, out in ((next_ray, aside), (sheet.gradient(camera), sheets)):
            out[a:b][there] = vectors @ T.rotation
            out[a:b] = np.einsum("sji,snj->sni", turn[a:b], out[a:b])

    in_parts(part, len(found), _blocks(len(found)))
    return LitPoints(
        grid.points, grid.eyes, aside, sheets, light[0], grid.amplitude, grid.angles, grid.closed,
        float(np.median(grid.sigma[found])), sheet.thickness or 0.0, light[1],
    )  # fmt: skip


def goes_round(angles: npt.ArrayLike) -> bool:
    """Whether table angles (s,) in scan order close a whole turn.

    True when they run one way only and the gap that is left from last to first is no wider than
    2.5 usual steps, so a turn also closes where 360° is not a whole number of steps.
    """
    a = np.unwrap(np.asarray(angles, dtype=np.float64))
    if len(a) < 3:
        return False
    moves = np.diff(a)
    usual = float(np.median(np.abs(moves)))
    one_way = bool((moves > 0).all() or (moves < 0).all())
    return bool(one_way and usual > 0 and 2 * np.pi - abs(a[-1] - a[0]) <= _GAP * usual)


def whole_turns(grid: RangeGrid) -> tuple[list[RangeGrid], int]:
    """The grid as one grid a turn, and how many profiles beyond the last whole one are left out.

    A turn ends where a step comes within half a usual step of its first one or passes it. The first
    one stays however little of it there is.
    """
    a = np.unwrap(grid.angles)
    if len(a) < 3:
        return [grid], 0
    usual = float(np.median(np.abs(np.diff(a))))
    turn = ((np.abs(a - a[0]) + 0.5 * usual) // (2 * np.pi)).astype(np.intp)
    if not turn.any():
        return [grid], 0
    parts = [take_steps(grid, np.flatnonzero(turn == k)) for k in np.unique(turn)]
    whole = [part for k, part in enumerate(parts) if k == 0 or part.closed]
    return whole, len(a) - sum(len(part.steps) for part in whole)


def every(grid: RangeGrid, n: int) -> RangeGrid:
    """Every ``n``-th profile of the grid. Raises InputError for ``n`` below 1."""
    if n < 1:
        raise InputError(f"every {n} steps", hint="take every 1st, 2nd, 3rd … profile")
    return grid if n == 1 else take_steps(grid, np.arange(0, len(grid.steps), n))


def take_steps(grid: RangeGrid, index: npt.NDArray[np.intp]) -> RangeGrid:
    """The grid of those profiles; whether it is closed is decided again from their angles."""
    return RangeGrid(
        laser=grid.laser,
        steps=grid.steps[index],
        angles=grid.angles[index],
        points=grid.points[index],
        sigma=grid.sigma[index],
        amplitude=grid.amplitude[index],
        flags=grid.flags[index],
        closed=goes_round(grid.angles[index]),
        eyes=None if grid.eyes is None else grid.eyes[index],
        behind=None if grid.behind is None else grid.behind[index],
        light_doubt=None if grid.light_doubt is None else grid.light_doubt[index],
        halo=None if grid.halo is None else grid.halo[index],
        noise=None if grid.noise is None else grid.noise[index],
        width_share=None if grid.width_share is None else grid.width_share[index],
        thickness=grid.thickness,
        alike=grid.alike,
    )
