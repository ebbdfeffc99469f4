"""Volumetric merge: many range surfaces → one, by signed distances along the camera's rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.errors import InputError, LimitExceeded
from turnscan.surface import _cubes
from turnscan.surface._grid_mesh import half_edges
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._paste import joined_provenance
from turnscan.surface._range_surface import RangeSurface

_GRAZING = float(np.cos(np.deg2rad(75.0)))
"""Cosine of incidence below which a face says nothing about where the surface lies."""
_BLOCKS = 400_000_000
"""Blocks of the whole box that are looked up at most (4 bytes each)."""
_POOL = 2_000_000
"""Blocks near a surface that are held at most (10 kB each)."""
_BORDER = (0.1, 0.5)
"""Weight of vertices on a border of their range surface, and of those beside it."""


def fuse(surfaces: Sequence[RangeSurface], voxel: float, ramp: float) -> Mesh:
    """One surface from several that were measured (Curless & Levoy 1996).

    Each range surface adds its signed distance, along the camera's ray and times the cosine of
    incidence, to the voxels (``voxel`` mm) within ``ramp`` mm of it, weighted by
    cos(incidence)/sigma²; near the border of a surface the weight falls to a tenth. The merged
    surface is where the mean is zero. It ends where no surface was seen. Each vertex has the
    provenance of the measured vertex nearest to it. The result does not depend on the order of
    the surfaces, up to rounding.

    Raises InputError for a ramp below two voxels, LimitExceeded where the volume is too large.
    """
    from turnscan.surface import _tsdf_kernels as kernels

    if not ramp >= 2 * voxel > 0:
        raise InputError(
            f"a ramp of {ramp:g} mm and voxels of {voxel:g} mm",
            hint="the ramp takes in at least two voxels on either side",
        )
    parts = [s for s in surfaces if len(s.mesh.faces)]
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    every = np.concatenate([s.mesh.vertices for s in parts])
    # A ray that grazes reaches further: ramp / cosine. The box and its blocks take that in.
    reach = ramp / _GRAZING
    origin = np.floor((every.min(axis=0) - reach) / voxel - 1) * voxel
    extent = (every.max(axis=0) + reach - origin) / voxel + 2
    shape = np.ceil(extent / kernels.SIDE).astype(np.int64)
    if np.prod(shape.astype(np.float64)) > _BLOCKS:
        raise LimitExceeded(
            f"a volume of {' × '.join(str(int(v)) for v in extent)} voxels of {voxel:g} mm",
            hint="give larger voxels with --voxel",
        )
    used = np.zeros(tuple(shape), dtype=np.bool_)
    for s in parts:
        kernels.mark(
            s.mesh.vertices, s.mesh.faces, s.eyes, s.cosine, origin, voxel, ramp, _GRAZING, used
        )
    blocks = np.argwhere(used)
    if len(blocks) > _POOL:
        raise LimitExceeded(
            f"{len(blocks)} blocks of voxels of {voxel:g} mm",
            hint="give larger voxels with --voxel",
        )
    index = np.full(tuple(shape), -1, dtype=np.int32)
    index[used] = np.arange(len(blocks))
    del used
    value, near, source = _filled(parts, origin, voxel, ramp, index, len(blocks))
    table, sizes = _cubes.table()
    vertices, faces, origins = kernels.march(
        index, blocks, value, near, source, _cubes.CORNERS, _cubes.EDGES, table, sizes
    )
    return Mesh(origin + voxel * vertices, faces, _provenance(parts, origins))


def _filled(
    parts: Sequence[RangeSurface],
    origin: Floats,
    voxel: float,
    ramp: float,
    index: Ints,
    blocks: int,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], Ints]:
    from turnscan.surface import _tsdf_kernels as kernels

    shape = (blocks, kernels.CELLS)
    distance, total = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    near = np.full(shape, np.inf, dtype=np.float32)
    source = np.full(shape, -1, dtype=np.int32)
    usual = float(np.median(np.concatenate([s.sigma for s in parts]))) or 1.0
    first = 0
    for s in parts:
        kernels.add(
            s.mesh.vertices, s.mesh.faces, s.eyes, s.cosine, _weights(s, usual), first,
            origin, voxel, ramp, _GRAZING, index, distance, total, near, source,
        )  # fmt: skip
        first += len(s.mesh.vertices)
    with np.errstate(invalid="ignore", divide="ignore"):
        distance /= total
    return distance, near, source


def _weights(s: RangeSurface, usual: float) -> Floats:
    """(v,) 1/sigma² in units of the usual one, from 0.01 to 100, less near the border."""
    weight = np.clip((usual / np.maximum(s.sigma, 1e-9)) ** 2, 0.01, 100.0)
    border = np.zeros(len(s.mesh.vertices), dtype=np.bool_)
    border[np.concatenate(half_edges(s.mesh.faces))] = True
    beside = np.zeros_like(border)
    beside[s.mesh.faces[border[s.mesh.faces].any(axis=1)]] = True
    return weight * np.where(border, _BORDER[0], np.where(beside, _BORDER[1], 1.0))


def _provenance(parts: Sequence[RangeSurface], origins: Ints) -> Provenance | None:
    whole = joined_provenance([s.mesh for s in parts])
    if whole is None:
        return None
    return Provenance(
        whole.sigma[origins], whole.laser[origins], whole.step[origins], whole.line[origins],
        whole.lasers,
    )  # fmt: skip
