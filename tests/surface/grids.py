"""Range grids made of numbers: random ones, turned parts, a noisy column."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.mesh import Mesh
from turnscan.points import RangeGrid
from turnscan.points._build import goes_round
from turnscan.surface import mesh_grid


def random_grid(seed, steps, lines, missing, closed, behind):
    rng = np.random.default_rng(seed)
    a = np.arange(steps) * (2 * np.pi / steps)
    z = np.linspace(0, 10, lines)
    r = 20 + rng.normal(0, 0.5, (steps, lines))
    points = np.stack(
        [r * np.cos(a)[:, None], r * np.sin(a)[:, None], np.broadcast_to(z, r.shape)], axis=-1
    )
    points[rng.random(r.shape) < missing] = np.nan
    if seed % 3 == 0:
        points[:, lines // 2] = points[:, 0]  # coincident points
    found = ~np.isnan(points[..., 0])
    eyes = np.stack([300 * np.cos(a), 300 * np.sin(a), 0 * a], axis=-1)
    return RangeGrid(
        "L0", np.arange(steps), a, points, np.where(found, 0.05, np.nan),
        np.where(found, 9.0, np.nan), np.where(found, 0, 1), closed, eyes,
        rng.random(r.shape) < behind if behind else None,
    )  # fmt: skip


def sheet_faces(rows: int, columns: int) -> np.ndarray:
    """(f, 3) two of each cell of a grid of vertices."""
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (k.ravel() for k in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def turned(angles, radii, sigma=0.01, eyes=True):
    """A turned part: the radius (n,) of each line, at z = 0, 0.5, 1 … mm, seen from afar."""
    n = len(radii)
    out = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    z = np.outer(0.5 * np.arange(n), [0.0, 0.0, 1.0])
    shape = (len(angles), n)
    return RangeGrid(
        "L0", np.arange(len(angles)), angles, radii[:, None] * out[:, None] + z,
        np.full(shape, sigma), np.ones(shape), np.zeros(shape, np.uint16), goes_round(angles),
        400.0 * out + [0.0, 0.0, 20.0] if eyes else None,
    )  # fmt: skip


def column(steps: int = 90, noise: float = 0.02, seed: int = 0) -> Mesh:
    """A fluted column, open at both ends, with radial noise."""
    angles = np.arange(steps) * 2 * np.pi / steps
    grid = turned(angles, np.full(80, 30.0), sigma=noise)
    rng = np.random.default_rng(seed)
    more = np.cos(5 * angles)[:, None] + rng.normal(0, noise, (steps, 80))
    out = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    return mesh_grid(replace(grid, points=grid.points + more[..., None] * out[:, None]))
