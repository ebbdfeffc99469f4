"""Compiled kernels of the volumetric merge; imported only when they are used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Longs, Singles
from turnscan.compiled import njit
from turnscan.surface.fusion._variance_kernels import Vertices, rise, variances

SIDE = 8
"""Voxels along one side of a block."""
CELLS = SIDE**3
VALUES = 8
DISTANCE, TOTAL, SPREAD, SHARED, NEAR, BEST, HELD, GRAIN = range(VALUES)
"""What is known of a voxel: sums of weight × distance, of weights, of (weight × noise)² and
of weight × what goes beyond, the least distance, and of the strongest contribution its strength,
its distance and its variance."""
_AGREE = 3.0
"""Sigma within which two contributions to one voxel are averaged …"""
_SLANT = 0.25
"""… and part of the distance, for rays at an angle measure it along ways of their own."""
_FAINTEST = 0.01
"""Strength that a contribution keeps at the end of the ramp."""
_SLACK = 0.02
"""Part of a face by which its shadow is widened, so that rays that fan out leave no cracks."""
_APART = 0.02
"""Voxels that a vertex keeps from the vertices of its cube: the vertices on several edges at one
corner would else fall on one place in the 32-bit numbers of an STL."""


class Space(NamedTuple):
    """Where the voxels lie, and how far a surface reaches into them."""

    origin: Floats
    """(3,) mm."""
    voxel: float
    """mm."""
    ramp: float
    """mm on either side of a surface."""
    least_cos: float
    """Cosine of incidence below which a face does not count."""


class Look(NamedTuple):
    """Faces of a range surface, and along which rays they are carried into the volume."""

    faces: Ints
    """(f, 3)."""
    eyes: Floats
    """(v, 3) mm: where the ray through each vertex comes from."""
    cosines: Floats
    """(v,) of incidence."""
    weights: Floats
    """(v,) times the variance."""
    between: Floats
    """(f,) mm: how far the surface may lie off its chords to the neighbouring profile."""


class Cubes(NamedTuple):
    """The tables of marching cubes, as `_cubes` has them."""

    corners: Longs
    """(8, 3) voxels."""
    edges: Longs
    """(12, 3) the two vertices of each, and its axis."""
    table: npt.NDArray[np.int8]
    """(256, t, 3) edges whose vertices make a face, for each pattern of corners inside."""
    sizes: npt.NDArray[np.int8]
    """(256,) how many faces."""


@njit(cache=True, nogil=True)
def _reach(
    points: Floats,
    face: Ints,
    eyes: Floats,
    cosines: Floats,
    space: Space,
    e1: Floats,
    e2: Floats,
    r: Floats,
    low: Longs,
    high: Longs,
) -> float:
    """Write edges, ray (towards the camera) and box of voxels of a face; gives cos(incidence)."""
    a, b, c = face
    origin, voxel, ramp, _ = space
    length = 0.0
    for i in range(3):
        e1[i], e2[i] = points[b, i] - points[a, i], points[c, i] - points[a, i]
        middle = (points[a, i] + points[b, i] + points[c, i]) / 3.0
        r[i] = (eyes[a, i] + eyes[b, i] + eyes[c, i]) / 3.0 - middle
        length += r[i] * r[i]
    length = np.sqrt(length)
    cosine = (cosines[a] + cosines[b] + cosines[c]) / 3.0
    if not (cosine > 0.0 and length > 0.0):
        return 0.0
    for i in range(3):
        r[i] /= length
        x, y, z = points[a, i], points[b, i], points[c, i]
        d = abs(r[i]) * ramp / cosine
        low[i] = int(np.ceil((min(x, y, z) - d - origin[i]) / voxel))
        high[i] = int(np.floor((max(x, y, z) + d - origin[i]) / voxel))
    return cosine  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def mark(
    points: Floats, faces: Ints, eyes: Floats, cosines: Floats, space: Space, used: Bools
) -> None:
    """Set the blocks (bx, by, bz) of ``used`` that `add` may write to."""
    e1, e2, r = np.empty(3), np.empty(3), np.empty(3)
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for f in range(faces.shape[0]):
        cosine = _reach(points, faces[f], eyes, cosines, space, e1, e2, r, low, high)
        if not cosine > space.least_cos:
            continue
        for x in range(low[0] // SIDE, high[0] // SIDE + 1):
            for y in range(low[1] // SIDE, high[1] // SIDE + 1):
                for z in range(low[2] // SIDE, high[2] // SIDE + 1):
                    used[x, y, z] = True


@njit(cache=True, nogil=True)
def _solve(e1: Floats, e2: Floats, r: Floats, inverse: Floats) -> bool:
    """Inverse of the matrix with columns e1, e2, r; False where it is (nearly) singular."""
    c0 = e2[1] * r[2] - e2[2] * r[1]
    c1 = e2[2] * r[0] - e2[0] * r[2]
    c2 = e2[0] * r[1] - e2[1] * r[0]
    det = e1[0] * c0 + e1[1] * c1 + e1[2] * c2
    if abs(det) < 1e-12:
        return False
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = c0 / det, c1 / det, c2 / det
    inverse[1, 0] = (r[1] * e1[2] - r[2] * e1[1]) / det
    inverse[1, 1] = (r[2] * e1[0] - r[0] * e1[2]) / det
    inverse[1, 2] = (r[0] * e1[1] - r[1] * e1[0]) / det
    inverse[2, 0] = (e1[1] * e2[2] - e1[2] * e2[1]) / det
    inverse[2, 1] = (e1[2] * e2[0] - e1[0] * e2[2]) / det
    inverse[2, 2] = (e1[0] * e2[1] - e1[1] * e2[0]) / det
    return True


@njit(cache=True, nogil=True)
def add(
    vertices: Vertices,
    look: Look,
    most: float,
    first: int,
    space: Space,
    index: Ints,
    decide: bool,
    volume: Singles,
    source: Ints,
) -> None:
    """Add one range surface to the volume, or ``decide`` which surface counts in each voxel.

    Between its vertices a face bulges as these bend: profiles that are far apart would else cut a
    round part short by the sagitta. Every voxel that a face shadows, seen along the
    camera's ray through the face, within the ramp of the surface, gets its signed distance (along
    the ray, times the cosine of incidence; positive on the camera's side) with the weight of the
    vertices times that cosine, over the variance there (`variances`). A place that may be more
    than ``most`` mm off between profiles adds nothing. ``volume`` (`VALUES`, blocks,
    cells) holds the sums. First, with ``decide``, the strongest contribution of all surfaces is
    found, the nearer the stronger; then what lies within three sigma of it is averaged. ``source``
    keeps the number (from ``first``) of the vertex nearest to what was seen closest.
    """
    points = vertices.points
    bend, step = vertices.bend, vertices.step
    faces, eyes, cosines, weight, between = look
    origin, voxel, ramp, least_cos = space
    inverse = np.empty((3, 3))
    e1, e2, r = np.empty(3), np.empty(3), np.empty(3)
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for f in range(faces.shape[0]):
        a, b, c = faces[f]
        p = points[a]
        cosine = _reach(points, faces[f], eyes, cosines, space, e1, e2, r, low, high)
        if not cosine > least_cos or not _solve(e1, e2, r, inverse):
            continue
        far = ramp / cosine
        ab = rise(points, bend, step, a, b)
        bc = rise(points, bend, step, b, c)
        ca = rise(points, bend, step, c, a)
        for x in range(low[0], high[0] + 1):
            vx = origin[0] + x * voxel - p[0]
            for y in range(low[1], high[1] + 1):
                vy = origin[1] + y * voxel - p[1]
                # b1, b2 and t change evenly with z: only the stretch inside all limits is walked.
                z0, z1 = low[2], high[2]
                zo = origin[2] - p[2]
                b1 = inverse[0, 0] * vx + inverse[0, 1] * vy + inverse[0, 2] * zo
                b2 = inverse[1, 0] * vx + inverse[1, 1] * vy + inverse[1, 2] * zo
                t = inverse[2, 0] * vx + inverse[2, 1] * vy + inverse[2, 2] * zo
                s1, s2, st = (
                    inverse[0, 2] * voxel,
                    inverse[1, 2] * voxel,
                    inverse[2, 2] * voxel,
                )
                z0, z1 = _within(b1, s1, -_SLACK, 2.0, z0, z1)
                z0, z1 = _within(b2, s2, -_SLACK, 2.0, z0, z1)
                z0, z1 = _within(b1 + b2, s1 + s2, -2.0, 1.0 + _SLACK, z0, z1)
                z0, z1 = _within(t, st, -far, far, z0, z1)
                for z in range(z0, z1 + 1):
                    u, v = b1 + s1 * z, b2 + s2 * z
                    noise, own, single, gap = variances(faces[f], u, v, vertices, between[f])
                    if gap > most**2:
                        continue
                    rest = 1.0 - u - v
                    d = (t + st * z) * cosine - (rest * (u * ab + v * ca) + u * v * bc)
                    w = rest * weight[a] + u * weight[b] + v * weight[c]
                    w *= cosine / max(single + gap, 1e-12)
                    block = index[x // SIDE, y // SIDE, z // SIDE]
                    cell = ((x % SIDE) * SIDE + y % SIDE) * SIDE + z % SIDE
                    nearest = a
                    if u >= v and u >= rest:
                        nearest = b
                    elif v >= u and v >= rest:
                        nearest = c
                    if decide:
                        _decide(volume, block, cell, w, d, own, ramp, source, first + nearest)
                    elif w > 0.0:
                        _average(volume, block, cell, w, d, noise, own, own + gap)


@njit(cache=True, nogil=True)
def _decide(
    volume: Singles, block: int, cell: int, w: float, d: float, own: float, ramp: float,
    source: Ints, nearest: int,
) -> None:  # fmt: skip
    """Keep the strongest contribution to a voxel, and what was seen closest to it."""
    strong = w * max(1.0 - abs(d) / ramp, _FAINTEST) ** 2
    if strong > volume[BEST, block, cell]:
        volume[BEST, block, cell] = strong
        volume[HELD, block, cell] = d
        volume[GRAIN, block, cell] = own
    if abs(d) < volume[NEAR, block, cell]:
        volume[NEAR, block, cell] = abs(d)
        source[block, cell] = nearest


@njit(cache=True, nogil=True)
def _average(
    volume: Singles, block: int, cell: int, w: float, d: float, noise: float, own: float,
    wide: float,
) -> None:  # fmt: skip
    """Add to the sums of a voxel what agrees with the strongest contribution.

    The variance ``noise`` averages out; what goes beyond it are edges and chords, which move all
    surfaces alike.
    """
    held = volume[HELD, block, cell]
    most = _AGREE * np.sqrt(own + volume[GRAIN, block, cell]) + _SLANT * abs(held)
    if abs(d - held) <= most:
        volume[DISTANCE, block, cell] += w * d
        volume[TOTAL, block, cell] += w
        volume[SPREAD, block, cell] += w * w * noise
        volume[SHARED, block, cell] += w * np.sqrt(wide - noise)


@njit(cache=True, nogil=True)
def _within(
    start: float, slope: float, low: float, high: float, z0: int, z1: int
) -> tuple[int, int]:
    """The part of z0..z1 where low ≤ start + slope·z ≤ high."""
    if abs(slope) < 1e-12:
        return (z0, z1) if low <= start <= high else (1, 0)
    a, b = (low - start) / slope, (high - start) / slope
    if a > b:
        a, b = b, a
    return max(z0, int(np.ceil(max(a, z0 - 1.0)))), min(z1, int(np.floor(min(b, z1 + 1.0))))


@njit(cache=True, nogil=True)
def _value(index: Ints, x: int, y: int, z: int) -> tuple[int, int]:
    bx, by, bz = x // SIDE, y // SIDE, z // SIDE
    if bx >= index.shape[0] or by >= index.shape[1] or bz >= index.shape[2]:
        return -1, 0
    return index[bx, by, bz], ((x % SIDE) * SIDE + y % SIDE) * SIDE + z % SIDE


@njit(cache=True, nogil=True)
def _corners_of(
    index: Ints, value: Singles, x: int, y: int, z: int, corners: Longs, d: Floats, at: Longs
) -> int:
    """Write values and places of a cube's corners; the pattern of those inside, 0 if one lacks."""
    case = 0
    for c in range(8):
        b, k = _value(index, x + corners[c, 0], y + corners[c, 1], z + corners[c, 2])
        if b < 0 or np.isnan(value[b, k]):
            return 0
        d[c] = value[b, k]
        at[c, 0], at[c, 1] = b, k
        if d[c] < 0.0:
            case |= 1 << c
    return case


@njit(cache=True, nogil=True)
def _mean_round(index: Ints, value: Singles, x: int, y: int, z: int) -> float:
    """Mean of the known ones of the six values next to a voxel; NaN where none is."""
    total, count = 0.0, 0
    for i in range(6):
        step = 1 if i % 2 else -1
        a, b, c = x, y, z
        if i < 2:
            a += step
        elif i < 4:
            b += step
        else:
            c += step
        if min(a, b, c) < 0:
            continue
        block, cell = _value(index, a, b, c)
        if block >= 0 and not np.isnan(value[block, cell]):
            total += value[block, cell]
            count += 1
    return total / count if count else np.nan


@njit(cache=True, nogil=True)
def grow(index: Ints, blocks: Longs, value: Singles, rounds: int, sweeps: int) -> Bools:
    """Give ``value`` to voxels up to ``rounds`` away from known ones; (blocks, cells) True there.

    New values are harmonic: each the mean of those next to it, as ``sweeps`` of relaxation leave
    them. Known ones stay.
    """
    made = np.zeros(value.shape, dtype=np.bool_)
    where = np.empty((1 << 16, 5), dtype=np.int32)
    count = 0
    for _ in range(rounds):
        first = count
        for block in range(len(blocks)):
            bx, by, bz = blocks[block] * SIDE
            for cell in range(CELLS):
                if not np.isnan(value[block, cell]):
                    continue
                x, y, z = bx + cell // (SIDE * SIDE), by + cell // SIDE % SIDE, bz + cell % SIDE
                if np.isnan(_mean_round(index, value, x, y, z)):
                    continue
                if count == len(where):
                    where = np.concatenate((where, np.empty_like(where)))
                where[count, 0], where[count, 1] = block, cell
                where[count, 2], where[count, 3], where[count, 4] = x, y, z
                count += 1
        new = np.empty(count - first)
        for k in range(first, count):
            new[k - first] = _mean_round(index, value, where[k, 2], where[k, 3], where[k, 4])
        for k in range(first, count):
            value[where[k, 0], where[k, 1]] = new[k - first]
            made[where[k, 0], where[k, 1]] = True
    for _ in range(sweeps):
        for k in range(count):
            mean = _mean_round(index, value, where[k, 2], where[k, 3], where[k, 4])
            value[where[k, 0], where[k, 1]] = mean
    return made


@njit(cache=True, nogil=True)
def _seen(made: Bools, at: Longs) -> bool:
    """True where none of a cube's corners was made by `grow`."""
    count = 0
    for c in range(8):
        count += made[at[c, 0], at[c, 1]]
    return count == 0


@njit(cache=True, nogil=True)
def march(
    index: Ints,
    blocks: Longs,
    value: Singles,
    made: Bools,
    cubes: Cubes,
) -> tuple[Floats, Ints, Bools, Longs, Floats]:
    """Marching cubes over the blocks: vertices (v, 3) in voxels and faces (f, 3).

    ``value`` (blocks, cells) is the signed distance, NaN where nothing is known: no cube with such
    a corner makes a face. Then (f,) False for the faces of cubes with a corner that `grow`
    ``made``, and of each vertex the voxels at both ends of its edge (v, 2), numbered as in
    ``value``, and the share (v,) of the way from the first to the second.
    """
    corners, ends, table, sizes = cubes
    number = np.full((len(blocks), CELLS, 3), -1, dtype=np.int32)
    room = 1 << 16
    vertices = np.empty((room, 3))
    between = np.empty((room, 2), dtype=np.int64)
    shares = np.empty(room)
    faces = np.empty((room, 3), dtype=np.int32)
    known = np.empty(room, dtype=np.bool_)
    total, count = 0, 0
    d = np.empty(8)
    at = np.empty((8, 2), dtype=np.int64)
    ids = np.empty(12, dtype=np.int64)
    for block in range(len(blocks)):
        bx, by, bz = blocks[block] * SIDE
        for cell in range(CELLS):
            if np.isnan(value[block, cell]):
                continue
            x, y, z = bx + cell // (SIDE * SIDE), by + cell // SIDE % SIDE, bz + cell % SIDE
            case = _corners_of(index, value, x, y, z, corners, d, at)
            if sizes[case] == 0:
                continue
            if total + 12 > len(vertices):
                vertices = np.concatenate((vertices, np.empty_like(vertices)))
                between = np.concatenate((between, np.empty_like(between)))
                shares = np.concatenate((shares, np.empty_like(shares)))
            if count + 12 > len(faces):
                faces = np.concatenate((faces, np.empty_like(faces)))
                known = np.concatenate((known, np.empty_like(known)))
            for e in range(12):
                a, b = ends[e, 0], ends[e, 1]
                if (d[a] < 0.0) == (d[b] < 0.0):
                    continue
                axis = ends[e, 2]
                low = at[a]
                if number[low[0], low[1], axis] < 0:
                    number[low[0], low[1], axis] = total
                    vertices[total, 0] = x + corners[a, 0]
                    vertices[total, 1] = y + corners[a, 1]
                    vertices[total, 2] = z + corners[a, 2]
                    part = min(max(d[a] / (d[a] - d[b]), _APART), 1.0 - _APART)
                    vertices[total, axis] += part
                    shares[total] = part
                    between[total, 0] = low[0] * CELLS + low[1]
                    between[total, 1] = at[b, 0] * CELLS + at[b, 1]
                    total += 1
                ids[e] = number[low[0], low[1], axis]
            seen = _seen(made, at)
            for t in range(sizes[case]):
                for i in range(3):
                    faces[count, i] = ids[table[case, t, i]]
                known[count] = seen
                count += 1
    return (
        vertices[:total].copy(),
        faces[:count].copy(),
        known[:count].copy(),
        between[:total].copy(),
        shares[:total].copy(),
    )
