"""Volumetric merge: many range surfaces → one, by signed distances along the camera's rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.errors import InputError, LimitExceeded
from turnscan.mesh._fair import fair
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._parts import components, joined_provenance, submesh
from turnscan.mesh._topology import half_edges
from turnscan.points import usual_sigma
from turnscan.remedy import Option, Remedy
from turnscan.surface.decimation import dissolve
from turnscan.surface.fusion import _marching_cubes as _cubes
from turnscan.surface.fusion._range_surface import RangeSurface
from turnscan.surface.fusion._vertex_sigma import correlations, interpolated

if TYPE_CHECKING:
    from turnscan.surface.fusion._tsdf_kernels import Space

_GRAZING = float(np.cos(np.deg2rad(75.0)))
"""Cosine of incidence below which a face says nothing about where the surface lies."""
_MOST_SIGMA = 10.0
"""Usual sigma: a point that is known worse counts as if it had this."""
_BLOCKS = 400_000_000
"""Blocks of the whole box that are looked up at most (4 bytes each)."""
_POOL = 2_000_000
"""Blocks near a surface that are held at most (10 kB each)."""
_EDGES = 0.99
"""Of the most that a place may be off between profiles: an edge alone takes none out."""
_BORDER = (0.1, 0.5)
"""Weight of vertices on a border of their range surface, and of those beside it."""
_RIM = 6
"""Rings of faces along a border that count along their normals, too."""
_FAINT = 0.01
"""Weight of that: it decides only where nothing else is known."""
_RELAXED = 8
"""Sweeps of relaxation for each voxel that a surface is carried on by."""
_SHORT = 0.15
"""Voxels: of two vertices no further from each other one is left."""

Singles = npt.NDArray[np.float32]


def fuse(
    surfaces: Sequence[RangeSurface],
    voxel: float,
    ramp: float,
    seam: int = 0,
    most: float = np.inf,
) -> Mesh:
    """One surface from several that were measured (Curless & Levoy 1996).

    Each range surface adds its signed distance, along the camera's ray and times the cosine of
    incidence, to the voxels (``voxel`` mm) within ``ramp`` mm of it, weighted by
    cos(incidence)/sigma²; near the border of a surface the weight falls to a tenth. Sigma includes
    the points' own and what the surface may do between its profiles; where that alone may be more
    than ``most`` mm a surface does not count. What lies beyond three sigma of the strongest
    contribution to a voxel is not averaged with it. The merged surface is where the mean is zero.
    It ends where no surface was seen. Of vertices that stand next to each other at a voxel's corner
    one is left. Each vertex has the provenance of the measured vertex nearest
    to it, and the sigma of the mean. The result does not depend on the order of the surfaces, up to
    rounding.

    ``seam``: gaps between surfaces of up to twice so many voxels are closed by carrying the
    distances on (volumetric diffusion; Davis et al., Filling holes in complex surfaces, 2002);
    faces there are not ``measured``, and lie as a membrane does. What meets nothing is removed
    again. Rays at an angle would part from a surface before its border: along it, faces then count
    along their normals, too.

    Raises InputError for a ramp below two voxels, LimitExceeded where the volume is too large.
    """
    from turnscan.surface.fusion import _tsdf_kernels as kernels

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
            hint=Remedy("give larger voxels with ", Option("voxel")),
        )
    used = np.zeros(tuple(shape), dtype=np.bool_)
    looks = [(_look(s), _rim(s)) if seam else (_look(s),) for s in parts]
    space = kernels.Space(origin, voxel, ramp, _GRAZING)
    for s, both in zip(parts, looks, strict=True):
        for k in both:
            kernels.mark(s.mesh.vertices, s.mesh.faces[k.faces], k.eyes, k.cosine, space, used)
    if seam:
        used = _dilated(used)
    blocks = np.argwhere(used)
    if len(blocks) > _POOL:
        raise LimitExceeded(
            f"{len(blocks)} blocks of voxels of {voxel:g} mm",
            hint=Remedy("give larger voxels with ", Option("voxel")),
        )
    index = np.full(tuple(shape), -1, dtype=np.int32)
    index[used] = np.arange(len(blocks))
    del used
    held = _filled(parts, looks, space, index, len(blocks), most)
    made = kernels.grow(index, blocks, held.value, seam, _RELAXED * seam)
    cubes = kernels.Cubes(_cubes.CORNERS, _cubes.EDGES, *_cubes.table())
    vertices, faces, known, ends, share = kernels.march(index, blocks, held.value, made, cubes)
    nearest = held.nearest(ends)
    sigma = held.sigma(parts, voxel * _ways(blocks, ends), ends, share, nearest)
    mesh = Mesh(origin + voxel * vertices, faces, _provenance(parts, nearest, sigma))
    if not known.all():
        mesh = _taut(_without_flaps(replace(mesh, measured=known), seam))
    return without_slivers(mesh, _SHORT * voxel)


@dataclass(frozen=True)
class _Volume:
    """What is known of each voxel, (blocks, cells)."""

    value: Singles
    """mm: signed distance; NaN where nothing is known."""
    near: Singles
    """mm: the least distance of what was seen."""
    noise: Singles
    """mm²: variance of the distance that noise makes."""
    shared: Singles
    """mm: sigma of what else moves it."""
    source: Ints
    """The number of the vertex nearest to what was seen closest."""

    def nearest(self, ends: Longs) -> Longs:
        """(v,) the source of the nearer one of two voxels (v, 2)."""
        near = self.near.ravel()[ends]
        closer = np.where(near[:, 0] <= near[:, 1], ends[:, 0], ends[:, 1])
        return self.source.ravel()[closer].astype(np.int64)

    def sigma(
        self, parts: Sequence[RangeSurface], ways: Floats, ends: Longs, share: Floats,
        nearest: Longs,
    ) -> Floats:  # fmt: skip
        """(v,) mm: of places a ``share`` of the ``ways`` (v, 3) mm between two voxels (v, 2)."""
        normals = np.concatenate([s.normals for s in parts])[nearest]
        value, noise, shared = (
            k.ravel()[ends].astype(np.float64) for k in (self.value, self.noise, self.shared)
        )
        # The places on the surface for which both speak: below them.
        ways = ways - normals * np.diff(value, axis=1)
        return interpolated(noise, shared, share, correlations(parts, nearest, ways))


def _ways(blocks: Longs, ends: Longs) -> Floats:
    """(v, 3) voxels: from the first to the second of two (v, 2), numbered as in the volume."""
    from turnscan.surface.fusion._tsdf_kernels import CELLS, SIDE

    cell = np.stack(np.unravel_index(ends % CELLS, (SIDE,) * 3), axis=-1)
    return np.diff(blocks[ends // CELLS] * SIDE + cell, axis=1)[:, 0].astype(np.float64)


@dataclass(frozen=True)
class _Look:
    """How faces of a range surface are carried into the volume."""

    faces: Bools
    """(f,) True for those."""
    eyes: Floats
    cosine: Floats
    weight: float


def _look(s: RangeSurface) -> _Look:
    """All of them, along the camera's rays."""
    return _Look(np.ones(len(s.mesh.faces), dtype=np.bool_), s.eyes, s.cosine, 1.0)


def _rim(s: RangeSurface) -> _Look:
    """Those near a border, along their normals."""
    near = _rings(s, _RIM)[s.mesh.faces].any(axis=1)
    near &= s.cosine[s.mesh.faces].mean(axis=1) > _GRAZING
    known = np.linalg.norm(s.normals, axis=1) > 0.5
    return _Look(near, s.mesh.vertices + s.normals, known.astype(np.float64), _FAINT)


def _rings(s: RangeSurface, count: int) -> Bools:
    """(v,) True for vertices no further than so many sides from a border of their surface."""
    near = np.zeros(len(s.mesh.vertices), dtype=np.bool_)
    near[np.concatenate(half_edges(s.mesh.faces))] = True
    for _ in range(count):
        near[s.mesh.faces[near[s.mesh.faces].any(axis=1)]] = True
    return near


def _dilated(used: Bools) -> Bools:
    """The blocks used, and all next to them."""
    from scipy.ndimage import binary_dilation

    wide: Bools = binary_dilation(used, np.ones((3, 3, 3), dtype=np.bool_))
    return wide


def _without_flaps(mesh: Mesh, seam: int) -> Mesh:
    """The mesh without what was carried on from a border and met nothing."""
    if mesh.measured is None:
        return mesh
    faces, known = mesh.faces, mesh.measured
    for _ in range(seam + 1):
        border = np.zeros(len(mesh.vertices), dtype=np.bool_)
        border[np.concatenate(half_edges(faces))] = True
        keep = known | ~border[faces].any(axis=1)
        faces, known = faces[keep], known[keep]
    left = replace(mesh, faces=faces, measured=known)
    label = components(left)
    return submesh(left, np.bincount(label, known)[label] > 0)


def _taut(mesh: Mesh) -> Mesh:
    """The mesh with its seams spanned as membranes between what was measured.

    What is carried on takes the noise of a ragged border with it, and stands off like coral.
    """
    if mesh.measured is None:
        return mesh
    free = np.ones(len(mesh.vertices), dtype=np.bool_)
    free[mesh.faces[mesh.measured]] = False
    return replace(mesh, vertices=fair(mesh.vertices, mesh.faces, free, 1, np.ones(len(free))))


def without_slivers(mesh: Mesh, apart: float) -> Mesh:
    """The mesh with one vertex left of two that stand less than ``apart`` mm from each other: the
    better known one.

    Where the surface passes close by a corner of a voxel, marching cubes puts a vertex on each of
    its edges; of one place they know no more than one.
    """
    one, other = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    near = np.linalg.norm(mesh.vertices[one] - mesh.vertices[other], axis=1) < apart
    one, other = one[near], other[near]
    p = mesh.provenance
    sigma = np.zeros(len(mesh.vertices)) if p is None else np.nan_to_num(p.sigma, nan=np.inf)
    spare = np.zeros(len(sigma), dtype=np.bool_)
    worse = sigma[one] > sigma[other]
    worse |= (sigma[one] == sigma[other]) & (one > other)
    spare[one[worse]] = True
    return dissolve(mesh, spare)[0]


def _filled(
    parts: Sequence[RangeSurface],
    looks: Sequence[tuple[_Look, ...]],
    space: Space,
    index: Ints,
    blocks: int,
    most: float,
) -> _Volume:
    """The volume with all surfaces added."""
    from turnscan.surface.fusion import _tsdf_kernels as kernels
    from turnscan.surface.fusion._variance_kernels import Vertices

    volume = np.zeros((kernels.VALUES, blocks, kernels.CELLS), dtype=np.float32)
    volume[kernels.NEAR] = np.inf
    source = np.full(volume.shape[1:], -1, dtype=np.int32)
    every = np.concatenate([s.sigma for s in parts])
    usual, noise = usual_sigma(every) or 1.0, usual_sigma(every, most=True) or 1.0
    between = [s.between(_EDGES * most, slight=True, ends=True) for s in parts]
    known = [
        (Vertices(
            s.mesh.vertices, _limited(s.sigma, usual), s.ranks, s.noise(noise), s.bend, s.alike
         ), _border_weights(s, usual))
        for s in parts
    ]  # fmt: skip
    for decide in (True, False):
        first = 0
        for s, off, (vertices, weight), both in zip(parts, between, known, looks, strict=True):
            for k in both:
                look = kernels.Look(
                    s.mesh.faces[k.faces], k.eyes, k.cosine, k.weight * weight, off[k.faces]
                )
                kernels.add(vertices, look, most, first, space, index, decide, volume, source)
            first += len(vertices.points)
    total = volume[kernels.TOTAL]
    with np.errstate(invalid="ignore", divide="ignore"):
        value, shared = volume[kernels.DISTANCE] / total, volume[kernels.SHARED] / total
        noise = volume[kernels.SPREAD] / total**2
    return _Volume(value, volume[kernels.NEAR], noise, shared, source)


def _limited(sigma: Floats, usual: float) -> Floats:
    """Sigma, limited to a tenth and ten times the usual one: no point decides alone, and each
    counts for something."""
    return np.asarray(np.clip(sigma, 0.1 * usual, _MOST_SIGMA * usual))


def _unlimited(sigma: Floats, parts: Sequence[RangeSurface], origins: Longs) -> Floats:
    """The ``sigma`` (v,) of merged vertices where the points of their ``origins`` are known worse
    than `_limited` lets them count: as many times larger."""
    every = np.concatenate([s.sigma for s in parts])
    most = _MOST_SIGMA * (usual_sigma(every) or 1.0)
    times = np.maximum(every / most, 1.0)[np.maximum(origins, 0)]
    return np.asarray(np.where(origins < 0, sigma, sigma * times))


def _border_weights(s: RangeSurface, usual: float) -> Floats:
    """(v,) the weight of each vertex times its variance: usual sigma², less near the border."""
    border = np.zeros(len(s.mesh.vertices), dtype=np.bool_)
    border[np.concatenate(half_edges(s.mesh.faces))] = True
    beside = np.zeros_like(border)
    beside[s.mesh.faces[border[s.mesh.faces].any(axis=1)]] = True
    return usual**2 * np.where(border, _BORDER[0], np.where(beside, _BORDER[1], 1.0))


def _provenance(parts: Sequence[RangeSurface], origins: Longs, sigma: Floats) -> Provenance | None:
    whole = joined_provenance([s.mesh for s in parts])
    if whole is None:
        return None
    none = origins < 0
    laser, step, line = (
        np.where(none, -1, k[origins]) for k in (whole.laser, whole.step, whole.line)
    )
    known = ~none & ~np.isnan(whole.sigma[origins])
    sigma = _unlimited(sigma, parts, origins)
    return Provenance(np.where(known, sigma, np.nan), laser, step, line, whole.lasers)
