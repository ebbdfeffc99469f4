"""Which pixels of a camera see a laser's sheet inside the working volume."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.points._triangulate import beyond_axis, side_of_axis
from turnscan.points._volume import Volume
from turnscan.rig import Rig

_BLOCK = 8
"""px between the pixels that are looked at first."""
_BATCH = 1 << 17
"""Pixels that are cast together."""

States = npt.NDArray[np.int8]


def view_mask(
    rig: Rig, laser: str, volume: Volume, *, margin: int = 0, others: Iterable[str] = ()
) -> Bools:
    """(height, width) True at the pixels that see the sheet inside the volume, at any table angle.

    Letting only these count keeps a bright wall or platter from winning over the part. ``margin``
    px are added all round (`widened`), for what must see a stripe's flanks too. ``others`` are
    lasers lit at the same time: pixels that see one of theirs on the near side of the axis do not
    count, and of this laser's own only the near side does, so that each stripe has one owner.

    Blocks of pixels far from every border, as pixels on a coarse lattice tell, are taken whole; in
    all others each pixel is cast.
    """
    rivals = tuple(others)
    height, width = rig.camera.height, rig.camera.width
    states = _blocks(rig, laser, volume, rivals)
    seen: Bools = np.repeat(np.repeat(states > 0, _BLOCK, axis=0), _BLOCK, axis=1)[:height, :width]
    seen = np.ascontiguousarray(seen)
    for v, u in _pixels_of(states == 0, height, width):
        rays = _rays(rig, u, v)
        here = _seen_by(rig, laser, volume, rays, near=bool(rivals))
        for name in rivals:
            here &= ~_seen_by(rig, name, volume, rays, near=True)
        seen[v, u] = here
    return widened(seen, margin)


def widened(seen: Bools, margin: int) -> Bools:
    """A mask (H, W) with ``margin`` px more all round."""
    if margin < 1:
        return seen
    # SciPy's filters would do it too; importing them takes longer than a small scan's mask.
    wide, width = np.pad(seen, margin), 2 * margin + 1
    for across in (False, True):
        reach = 1
        while reach < width:
            step = min(reach, width - reach)
            wide = wide[:, :-step] | wide[:, step:] if across else wide[:-step] | wide[step:]
            reach += step
    return wide


def _seen_by(rig: Rig, name: str, volume: Volume, rays: Floats, *, near: bool) -> Bools:
    X = rig.sheet(name).intersect(rays)
    inside = volume.contains(rig.T_camera_table.inverse().apply(X))
    return np.asarray(inside & ~beyond_axis(rig, name, X)) if near else inside


def _rays(rig: Rig, u: npt.NDArray[np.intp], v: npt.NDArray[np.intp]) -> Floats:
    """(n, 3) rays of pixels.

    The picture's corners go with them: what the lens model starts its search from is made for the
    farthest of the pixels that it is given, and must be the same for all.
    """
    w, h = rig.camera.width - 1, rig.camera.height - 1
    us, vs = np.append(u, (0, w, 0, w)), np.append(v, (0, 0, h, h))
    return rig.camera.rays(np.stack([us, vs], axis=-1).astype(np.float64))[:-4]


def _pixels_of(
    blocks: Bools, height: int, width: int
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    """Rows and columns of all pixels of these blocks, so many at a time."""
    rows, columns = np.nonzero(blocks)
    each = _BATCH // _BLOCK**2
    down, right = np.divmod(np.arange(_BLOCK**2), _BLOCK)
    for i in range(0, len(rows), each):
        v = (rows[i : i + each, None] * _BLOCK + down).ravel()
        u = (columns[i : i + each, None] * _BLOCK + right).ravel()
        there = (v < height) & (u < width)
        yield v[there], u[there]


def _blocks(rig: Rig, laser: str, volume: Volume, rivals: tuple[str, ...]) -> States:
    """State of each block of pixels: 1 all of it counts, -1 none of it, 0 who knows."""
    height, width = rig.camera.height, rig.camera.width
    rows, columns = -(-height // _BLOCK), -(-width // _BLOCK)
    # A lattice with one block more all round, which may lie outside of the picture.
    v = np.clip(np.arange(-1, rows + 2) * _BLOCK, 0, height - 1)
    u = np.clip(np.arange(-1, columns + 2) * _BLOCK, 0, width - 1)
    vs, us = np.meshgrid(v, u, indexing="ij")
    rays = _rays(rig, us.ravel(), vs.ravel()).reshape(*vs.shape, 3)
    own = _state(rig, laser, volume, rays, near=bool(rivals))
    theirs = [_state(rig, name, volume, rays, near=True) for name in rivals]
    states = np.minimum.reduce([own, *(-t for t in theirs)])
    return np.asarray(states, np.int8)


def _state(rig: Rig, name: str, volume: Volume, rays: Floats, *, near: bool) -> States:
    """State of each block for one sheet, from the pixels at its corners and those around them.

    What limits the volume changes smoothly from pixel to pixel: a block counts as clear of a limit
    where all sixteen pixels are farther from it than they differ from one another.
    """
    X = rig.sheet(name).intersect(rays)
    x, y, z = np.moveaxis(rig.T_camera_table.inverse().apply(X), -1, 0)
    inside = [volume.r_max - np.hypot(x, y), z - volume.z_min, volume.z_max - z]
    if near:
        inside.append(side_of_axis(rig, name, X))
    unseen = np.isnan(x)
    states = np.ones((rays.shape[0] - 3, rays.shape[1] - 3), np.int8)
    for margin in inside:
        if np.isposinf(margin[~unseen]).all():
            continue
        low, high = _around(margin, np.minimum), _around(margin, np.maximum)
        spread = high - low
        clear = np.where(low > spread, 1, np.where(high < -spread, -1, 0))  # NaN is not clear
        states = np.minimum(states, clear)
    # -1 of one limit and 0 of another: outside all the same; but NaN may hide anything.
    some, every = _around(unseen, np.logical_or), _around(unseen, np.logical_and)
    return np.where(every, -1, np.where(some, 0, states)).astype(np.int8)


def _around(values: npt.NDArray[Any], join: np.ufunc) -> npt.NDArray[Any]:
    """(r - 3, c - 3) of (r, c): each four by four of the lattice joined."""
    down = join.reduce([values[i : len(values) - 3 + i] for i in range(4)])
    joined: npt.NDArray[Any] = join.reduce([down[:, i : down.shape[1] - 3 + i] for i in range(4)])
    return joined
