"""Several grids → one mesh, and what is removed from it: double cover and islands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import components, join
from turnscan.points import Along, RangeGrid
from turnscan.surface._grid_mesh import TearLimits, mesh_grid, thin
from turnscan.surface.fusion._stitch import trimmed, zip_up


def paste(
    grids: Iterable[RangeGrid],
    tears: TearLimits | None = None,
    along: Along | None = None,
    *,
    keep_double: bool = False,
) -> Mesh:
    """Mesh every grid and join them as one mesh with the provenance of each vertex.

    What was measured twice is kept once: grids come in their order, what the sheet met beyond the
    rotation axis comes last, and faces that lie on a surface already there are left out
    (`trimmed`). The pieces that are left are joined across narrow gaps (`zip_up`); measurements of
    two lasers are not averaged. ``along`` chooses the points along each profile. ``keep_double``
    keeps all, side by side.
    """
    fronts, backs = [], []
    for grid in grids:
        behind = np.zeros(grid.flags.shape, bool) if grid.behind is None else grid.behind
        fronts.append(_part(grid, ~behind, tears, along))
        if behind.any():
            backs.append(_part(grid, behind, tears, along))
    parts = [m for m in fronts + backs if len(m.faces)]
    if not parts:
        return fronts[0] if fronts else Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    if keep_double or len(parts) == 1:
        return join(parts)
    mesh = join(trimmed(parts))
    piece = np.zeros(len(mesh.vertices), dtype=np.int32)
    piece[mesh.faces] = components(mesh)[:, None]
    return zip_up(mesh, piece)


def _part(grid: RangeGrid, keep: Bools, tears: TearLimits | None, along: Along | None) -> Mesh:
    if not keep.all():
        grid = replace(grid, points=np.where(keep[..., None], grid.points, np.nan))
    return mesh_grid(thin(grid, along, tears), tears)
