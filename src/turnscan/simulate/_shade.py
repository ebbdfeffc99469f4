# mypy: disable-error-code="no-any-return"
"""Numba kernels of the light that the scene sends back. Import it inside functions only.

Frames as in `_rays`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit
from turnscan.simulate._airy import Keys, Numbers, Singles
from turnscan.simulate._cut import FADED, reach_of, sheet_distance
from turnscan.simulate._fading import faded
from turnscan.simulate._grain_kernels import Roughness, scatterer
from turnscan.simulate._rays import within

_BATCH = 256
"""Cells that are worked out at once."""
_FIELDS = 14


class Seen(NamedTuple):
    """The pixels near a stripe; each is k blocks, and a block meets one face."""

    pixels: Ints
    """(n, 2) row and column."""
    field: Floats
    """Of view, as in `_rays`."""
    face: Ints
    """(n·k,) that each block meets."""
    normals: Floats
    """(n·k, 3) of the smooth surface there, object frame."""
    lit: Bools
    """(n·k,) False where nothing is to be added up."""


class Bodies(NamedTuple):
    """Triangles in the object's frame."""

    vertices: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3)."""
    normals: Floats
    """(f, 3)."""
    body: Ints
    """(f,) to which body each belongs."""
    paints: Floats
    """(bodies, 6): albedo, pattern, pitch, ratio, specular, roughness."""


class Illumination(NamedTuple):
    """A laser line and the camera that sees it, in the camera's frame.

    Plain numbers: arrays that are handed on for each cell would be counted there, which takes
    longer than the arithmetic.
    """

    apex: Numbers
    """(3,) mm: where the light comes from."""
    sheet: Numbers
    """(15,), as in `_cut`."""
    beam: Numbers
    """(7,): waist, its distance, Rayleigh length, reach, and the unit vector of the aim."""
    fan: Numbers
    """(5,): power, tan of the half angle, and the unit vector across the fan."""
    optics: Numbers
    """(7,): electrons per radiance, and for the blur f/(N·pitch_x), f/(N·pitch_y), focal length,
    focus distance, and the slope (2) of the image distance over the picture."""


class Collected(NamedTuple):
    """What the cells of all pixels send, one after another."""

    energy: Singles
    keys: Keys
    """With the cycles (0,) where no speckle is wanted."""
    cycles: Singles
    points: Floats
    """(n, 3) object frame; (0, 3) where not wanted."""
    pixels: int
    """That these cells belong to."""


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def brdf(albedo: float, specular: float, alpha: float, nl: float, nv: float, lv: float) -> float:
    """Lambert + GGX with Smith shadowing and Schlick's Fresnel term (Walter et al. 2007), 1/sr.

    ``nl``, ``nv``, ``lv``: cosines between normal, light and eye.
    """
    # Without a branch, so that the compiler can do several at once.
    shines = (specular > 0.0) & (nl > 0.0) & (nv > 0.0)
    # Half vector h = (l + v)/|l + v| with |l + v|² = 2 + 2 l·v.
    half = 1.0 / math.sqrt(max(2.0 + 2.0 * lv, 1e-12))
    nh, vh = (nl + nv) * half, (1.0 + lv) * half
    a2 = alpha * alpha
    shape = nh * nh * (a2 - 1.0) + 1.0
    # D = a2/(π shape²); of Smith's factors 2 n/(n + √…) the n fall out with 1/(4 nl nv).
    gl = nl + math.sqrt(a2 + (1.0 - a2) * nl * nl)
    gv = nv + math.sqrt(a2 + (1.0 - a2) * nv * nv)
    F = specular + (1.0 - specular) * (1.0 - vh) ** 5
    glossy = a2 * F / (math.pi * shape * shape * gl * gv)
    return albedo / math.pi + (glossy if shines else 0.0)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def painted(x: float, y: float, z: float, kind: float, pitch: float, ratio: float) -> float:
    """What a pattern leaves of the albedo at a point in the object frame."""
    dark = False
    if kind != 0.0 and kind != 2.0:
        dark = math.floor(2.0 * 25.0 * math.atan2(y, x) / pitch) % 2 != 0
    if kind != 0.0 and kind != 1.0:
        dark ^= math.floor(2.0 * z / pitch) % 2 != 0
    return ratio if dark else 1.0


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def glow(
    seen: Seen, blocks: tuple[int, int], cells: tuple[int, int],
    pose: tuple[Floats, Floats], bodies: Bodies, light: Illumination, profile: Floats,
    rough: Roughness, points: Floats, powers: Floats,
) -> tuple[Singles, Keys, Singles]:  # fmt: skip
    """Laser light that each cell of each pixel collects, and the scatterer that sends it.

    The rotation and translation of ``pose`` take the object's frame to the camera's; ``profile``
    (H or 1, k) is the share of the power per unit of s from −1 to 1. Returns energy (n, oy, ox) in
    electrons, and of the cells with light their scatterers' keys and path's fraction of a cycle.
    ``points`` (n, oy, ox, 3) takes the place of these cells, object frame; (0, …) where not wanted.
    ``powers`` are of `powers_of_e`.
    """
    R, t = pose
    pixels, field, face, normals, lit = seen
    v, faces, flat, body, _ = bodies
    oy, ox = cells
    by, bx = blocks
    energy = np.zeros((len(pixels), oy, ox), np.float32)
    rows = len(pixels) if rough.size > 0.0 else 0
    keys, cycles = np.zeros((rows, oy, ox), np.uint32), np.zeros((rows, oy, ox), np.float32)
    out = Collected(
        energy.ravel(), keys.ravel(), cycles.ravel(), points.reshape(-1, 3), len(pixels)
    )
    order, places, starts = _by_block(blocks, cells)
    work, which, count = np.empty(_FIELDS * _BATCH), np.empty((3, _BATCH), np.int64), 0
    for k in range(len(lit)):
        if not lit[k]:
            continue
        i, block = k // (by * bx), k % (by * bx)
        row, column = pixels[i, 0], pixels[i, 1]
        ky, kx = block // bx, block % bx
        f = face[k]
        n_flat, n = _turned(R, flat, f), _turned(R, normals, k)
        moved = _turned(R, v, faces[f, 0])
        reach = n_flat[0] * (moved[0] + t[0])
        reach += n_flat[1] * (moved[1] + t[1]) + n_flat[2] * (moved[2] + t[2])
        spread = _blurred(
            field, row, column, (ky + 0.5) / by, (kx + 0.5) / bx, n_flat, reach, light
        )
        ray = (row, column, n, n_flat, reach, spread)
        for first in range(starts[block], starts[block + 1], _BATCH):
            more = min(_BATCH, starts[block + 1] - first)
            if count + more > _BATCH:
                _emit(work, which, count, pose, bodies, light, profile, rough, powers, out)
                count = 0
            _lay(work, count, field, ray, places[first : first + more])
            for j in range(more):
                which[0, count + j] = i * (oy * ox) + order[first + j]
                which[1, count + j] = body[f]
                which[2, count + j] = row if len(profile) > 1 else 0
            count += more
    _emit(work, which, count, pose, bodies, light, profile, rough, powers, out)
    return energy, keys, cycles


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _lay(
    work: Floats, count: int, field: Floats,
    ray: tuple[int, int, tuple[float, float, float], tuple[float, float, float], float, float],
    places: Floats,
) -> None:  # fmt: skip
    """Lay cells of one block, at (n, 2) ``places`` of their pixel, into ``work`` after ``count``
    others, as `_light` takes them; of ``ray``: row, column, normal, plane and its distance, and
    widening."""
    row, column, n, n_flat, reach, spread = ray
    for j in range(len(places)):
        p, q = within(field, row, column, places[j, 0], places[j, 1])
        at = count + j
        work[at], work[at + _BATCH], work[at + 2 * _BATCH] = p, q, reach
        work[at + 3 * _BATCH], work[at + 4 * _BATCH], work[at + 5 * _BATCH] = n[0], n[1], n[2]
        work[at + 6 * _BATCH] = spread
        work[at + 9 * _BATCH], work[at + 10 * _BATCH] = n_flat[0], n_flat[1]
        work[at + 11 * _BATCH] = n_flat[2]


@njit(cache=True, nogil=True)
def _by_block(
    blocks: tuple[int, int], cells: tuple[int, int]
) -> tuple[npt.NDArray[np.int64], Floats, npt.NDArray[np.int64]]:
    """The cells of a pixel block by block, their places in it (n, 2), and where each block's start
    in these lists."""
    by, bx = blocks
    oy, ox = cells
    order, starts, m = np.empty(oy * ox, np.int64), np.zeros(by * bx + 1, np.int64), 0
    places = np.empty((oy * ox, 2))
    for ky in range(by):
        for kx in range(bx):
            for y in range((ky * oy + by - 1) // by, ((ky + 1) * oy + by - 1) // by):
                for x in range((kx * ox + bx - 1) // bx, ((kx + 1) * ox + bx - 1) // bx):
                    order[m] = y * ox + x
                    places[m, 0], places[m, 1] = (y + 0.5) / oy, (x + 0.5) / ox
                    m += 1
            starts[ky * bx + kx + 1] = m
    return order, places, starts


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _light(work: Floats, count: int, light: Illumination) -> None:
    """Where rays through cells meet the planes of their faces, and the laser's light there.

    ``work`` has `_BATCH` numbers each of the ray's p and q, the plane's distance, the normal (3),
    the widening by defocus, and as 10th to 12th the plane's normal. Their places are taken by the
    point (3), the normal, the light in the sheet's middle (0: none), and the exponent of its fall;
    the 9th becomes the place on the fan. All lie in one array, so that the compiler knows that they
    do not overlap, and does several cells with one instruction.
    """
    for j in range(count):
        p, q = work[j], work[j + _BATCH]
        slope = work[j + 9 * _BATCH] * p + work[j + 10 * _BATCH] * q + work[j + 11 * _BATCH]
        s = work[j + 2 * _BATCH] / slope
        n = work[j + 3 * _BATCH], work[j + 4 * _BATCH], work[j + 5 * _BATCH]
        place, irradiance, exponent = _irradiance(p * s, q * s, s, n, light, work[j + 6 * _BATCH])
        work[j], work[j + _BATCH], work[j + 2 * _BATCH] = p * s, q * s, s
        work[j + 6 * _BATCH] = irradiance if slope < 0.0 else 0.0
        work[j + 7 * _BATCH] = exponent
        work[j + 8 * _BATCH] = place


@njit(cache=True, nogil=True, error_model="numpy")
def _kept(work: Floats, which: npt.NDArray[np.int64], count: int, profile: Floats) -> int:
    """Move what has light to the front, times its share of the fan; how many these are."""
    kept = 0
    last = profile.shape[1] - 1
    for j in range(count):
        if work[j + 6 * _BATCH] <= 0.0:
            continue
        place = work[j + 8 * _BATCH] * last
        m = min(int(place), last - 1)
        share = profile[which[2, j], m]
        share += (place - m) * (profile[which[2, j], m + 1] - share)
        work[kept + 6 * _BATCH] = work[j + 6 * _BATCH] * share
        if kept < j:
            for field in (0, 1, 2, 3, 4, 5, 7):
                work[kept + field * _BATCH] = work[j + field * _BATCH]
            which[0, kept], which[1, kept] = which[0, j], which[1, j]
        kept += 1
    return kept


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _emit(
    work: Floats, which: npt.NDArray[np.int64], count: int, pose: tuple[Floats, Floats],
    bodies: Bodies, light: Illumination, profile: Floats, rough: Roughness, powers: Floats,
    out: Collected,
) -> None:  # fmt: skip
    """Work out many cells at once, and lay them where they belong.

    ``work`` is as `_light` takes it; ``which`` (3, `_BATCH`): the cell, its body, and its row of
    the profile.
    """
    _light(work, count, light)
    count = _kept(work, which, count, profile)
    R, t = pose
    paints, scale = bodies.paints, light.optics[0] / (out.energy.size // max(out.pixels, 1))
    a, b, c = R[0, 0], R[0, 1], R[0, 2]
    d, e, f = R[1, 0], R[1, 1], R[1, 2]
    g, h, k = R[2, 0], R[2, 1], R[2, 2]
    tx, ty, tz = t[0], t[1], t[2]
    for j in range(count):
        wx, wy, wz = work[j] - tx, work[j + _BATCH] - ty, work[j + 2 * _BATCH] - tz
        work[j + 9 * _BATCH] = a * wx + d * wy + g * wz
        work[j + 10 * _BATCH] = b * wx + e * wy + h * wz
        work[j + 11 * _BATCH] = c * wx + f * wy + k * wz
    for j in range(count):
        of = which[1, j]
        albedo = paints[of, 0]
        if paints[of, 1] != 0.0:
            albedo *= painted(
                work[j + 9 * _BATCH], work[j + 10 * _BATCH], work[j + 11 * _BATCH],
                paints[of, 1], paints[of, 2], paints[of, 3],
            )  # fmt: skip
        work[j + 12 * _BATCH] = albedo
        work[j + 13 * _BATCH] = paints[of, 4]
        work[j + 8 * _BATCH] = paints[of, 5]
    for j in range(count):
        n = work[j + 3 * _BATCH], work[j + 4 * _BATCH], work[j + 5 * _BATCH]
        back = _returned(
            work[j], work[j + _BATCH], work[j + 2 * _BATCH], n, light.apex,
            work[j + 12 * _BATCH], work[j + 13 * _BATCH], work[j + 8 * _BATCH],
        )  # fmt: skip
        work[j + 12 * _BATCH] = back
    for j in range(count):
        here = work[j + 6 * _BATCH] * faded(work[j + 7 * _BATCH], powers)
        work[j + 6 * _BATCH] = scale * (here * work[j + 12 * _BATCH])
    _sent(work, which[0], count, rough, out)


@njit(cache=True, nogil=True, error_model="numpy")
def _sent(
    work: Floats, which: npt.NDArray[np.int64], count: int, rough: Roughness, out: Collected
) -> None:
    """Lay the cells' light (7th of ``work``), places (10th to 12th) and scatterers into ``out``."""
    for j in range(count):
        out.energy[which[j]] = work[j + 6 * _BATCH]
    if len(out.points):
        for j in range(count):
            for axis in range(3):
                out.points[which[j], axis] = work[j + (9 + axis) * _BATCH]
    if len(out.keys):
        keys, cycles = np.empty(_BATCH, np.uint32), np.empty(_BATCH, np.float32)
        for j in range(count):
            keys[j], cycles[j] = scatterer(
                work[j + 9 * _BATCH], work[j + 10 * _BATCH], work[j + 11 * _BATCH], rough
            )
        for j in range(count):
            out.keys[which[j]], out.cycles[which[j]] = keys[j], cycles[j]


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _turned(R: Floats, vectors: Floats, i: int) -> tuple[float, float, float]:
    x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _blurred(
    field: Floats, row: int, column: int, y: float, x: float, n: Numbers, reach: float,
    light: Illumination,
) -> float:  # fmt: skip
    """How much wider defocus makes the sheet's profile on this surface (a factor, 1 in focus).

    A Gaussian sheet blurred by a Gaussian is a wider Gaussian: exact on a flat patch.
    """
    optics = light.optics
    p, q = within(field, row, column, y, x)
    s = reach / (n[0] * p + n[1] * q + n[2])
    v = optics[3] * optics[4] / (optics[4] - optics[3])
    v /= 1.0 + optics[5] * p + optics[6] * q
    sharp = optics[3] * s / (s - optics[3])
    blur = abs(v / sharp - 1.0) / 4.0  # rms of a disc along one axis, in apertures
    if blur * max(optics[1], optics[2]) < 0.02:
        return 1.0
    here = sheet_distance(p * s, q * s, s, light.sheet)
    sigma = 0.5 * reach_of(p * s, q * s, s, light.apex, light.beam) / light.beam[3]
    p, q = within(field, row, column, y, x + 1.0)
    s = reach / (n[0] * p + n[1] * q + n[2])
    du = (sheet_distance(p * s, q * s, s, light.sheet) - here) * blur * optics[1]
    p, q = within(field, row, column, y + 1.0, x)
    s = reach / (n[0] * p + n[1] * q + n[2])
    dv = (sheet_distance(p * s, q * s, s, light.sheet) - here) * blur * optics[2]
    return math.sqrt(1.0 + (du * du + dv * dv) / (sigma * sigma))


@njit(cache=True, nogil=True, fastmath=True, inline="always", error_model="numpy")
def _irradiance(
    x: float, y: float, depth: float, n: Numbers, light: Illumination, spread: float
) -> tuple[float, float, float]:
    """Where on the fan, 0 to 1 (its ends), and of the W/mm² for a share of 1 per unit of s those in
    the sheet's middle (0 where no light comes), and x where exp(−x) is left of them.
    """
    apex, beam, fan = light.apex, light.beam, light.fan
    wx, wy, wz = x - apex[0], y - apex[1], depth - apex[2]
    z = wx * beam[4] + wy * beam[5] + wz * beam[6]
    s = (wx * fan[2] + wy * fan[3] + wz * fan[4]) / fan[1]
    far = (z - beam[1]) / beam[2]
    w = beam[0] * math.sqrt(1.0 + far * far) * spread
    d = sheet_distance(x, y, depth, light.sheet)
    facing = -(n[0] * wx + n[1] * wy + n[2] * wz)
    onward, thick = 1.0 / z, 1.0 / w
    across = math.sqrt(2.0 / math.pi) * thick
    # Power per area of a plane square to the aim; a plane square to the ray gets it over z/length,
    # and the surface times the cosine, which is facing/length.
    middle = fan[0] / fan[1] * across * facing * onward * onward
    # Beside the fan or behind the laser (|s| ≥ z), beyond the sheet, or turned away it is dark.
    lit = (abs(s) < z) & (abs(d) <= FADED * w) & (facing > 0.0)
    return (s * onward + 1.0) * 0.5, (middle if lit else 0.0), 2.0 * (d * thick) * (d * thick)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _returned(
    x: float, y: float, depth: float, n: Numbers, apex: Numbers, albedo: float, specular: float,
    alpha: float,
) -> float:  # fmt: skip
    """Share of the irradiance that goes to the camera, 1/sr, times cos⁴ of its field angle."""
    wx, wy, wz = x - apex[0], y - apex[1], depth - apex[2]
    way = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
    back = 1.0 / math.sqrt(x * x + y * y + depth * depth)
    nl = -(n[0] * wx + n[1] * wy + n[2] * wz) * way
    nv = -(n[0] * x + n[1] * y + n[2] * depth) * back
    lv = (wx * x + wy * y + wz * depth) * (way * back)
    cosine = depth * back
    return brdf(albedo, specular, alpha, nl, nv, lv) * (cosine * cosine) * (cosine * cosine)


@njit(cache=True, nogil=True)
def paint_all(points: Floats, paint: Floats) -> Floats:
    """(n,) albedo of points (n, 3), object frame; ``paint`` is albedo, kind, pitch, ratio."""
    out = np.empty(len(points))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        out[i] = paint[0] * painted(x, y, z, paint[1], paint[2], paint[3])
    return out


@njit(cache=True, nogil=True)
def exchange(
    points: Floats, normals: Floats, lamps: Floats, lamp_normals: Floats, flux: Floats, least: float
) -> Floats:
    """(n, m) irradiance at points from Lambertian lamps of some flux, as if nothing stood between.

    Distances below ``least`` count as that.
    """
    out = np.zeros((len(points), len(lamps)))
    for i in range(len(points)):
        for j in range(len(lamps)):
            x, y, z = (
                lamps[j, 0] - points[i, 0],
                lamps[j, 1] - points[i, 1],
                lamps[j, 2] - points[i, 2],
            )
            here = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
            there = -(x * lamp_normals[j, 0] + y * lamp_normals[j, 1] + z * lamp_normals[j, 2])
            if here > 0.0 and there > 0.0:
                r2 = x * x + y * y + z * z
                out[i, j] = flux[j] / math.pi * here * there / (r2 * max(r2, least * least))
    return out
