# mypy: disable-error-code="no-any-return"
"""Numba kernels of the light that the scene sends back. Import it inside functions only.

Frames as in `_rays`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit
from turnscan.simulate._cut import FADED, reach_of, sheet_distance
from turnscan.simulate._rays import Singles, within


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
    """A laser line and the camera that sees it, in the camera's frame."""

    apex: Floats
    """(3,) mm: where the light comes from."""
    sheet: Floats
    """(5, 3), as in `_cut`."""
    beam: Floats
    """(7,): waist, its distance, Rayleigh length, reach, and the unit vector of the aim."""
    fan: Floats
    """(5,): power, tan of the half angle, and the unit vector across the fan."""
    profile: Floats
    """(H or 1, k): share of the power per unit of s from −1 to 1."""
    optics: Floats
    """(7,): electrons per radiance, and for the blur f/(N·pitch_x), f/(N·pitch_y), focal length,
    focus distance, and the slope (2) of the image distance over the picture."""


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def brdf(albedo: float, specular: float, alpha: float, nl: float, nv: float, lv: float) -> float:
    """Lambert + GGX with Smith shadowing and Schlick's Fresnel term (Walter et al. 2007), 1/sr.

    ``nl``, ``nv``, ``lv``: cosines between normal, light and eye.
    """
    diffuse = albedo / math.pi
    if specular <= 0.0 or nl <= 0.0 or nv <= 0.0:
        return diffuse
    # Half vector h = (l + v)/|l + v| with |l + v|² = 2 + 2 l·v.
    length = math.sqrt(max(2.0 + 2.0 * lv, 1e-12))
    nh, vh = (nl + nv) / length, (1.0 + lv) / length
    a2 = alpha * alpha
    D = a2 / (math.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    gl = 2.0 * nl / (nl + math.sqrt(a2 + (1.0 - a2) * nl * nl))
    gv = 2.0 * nv / (nv + math.sqrt(a2 + (1.0 - a2) * nv * nv))
    F = specular + (1.0 - specular) * (1.0 - vh) ** 5
    return diffuse + D * gl * gv * F / (4.0 * nl * nv)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def painted(x: float, y: float, z: float, paint: Floats) -> float:
    """Albedo of a point in the object frame; ``paint`` is albedo, kind, pitch, ratio."""
    if paint[1] == 0.0:
        return paint[0]
    dark = False
    if paint[1] != 2.0:
        dark = math.floor(2.0 * 25.0 * math.atan2(y, x) / paint[2]) % 2 != 0
    if paint[1] != 1.0:
        dark ^= math.floor(2.0 * z / paint[2]) % 2 != 0
    return paint[0] * (paint[3] if dark else 1.0)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def glow(
    seen: Seen, blocks: tuple[int, int], cells: tuple[int, int], R: Floats, t: Floats,
    bodies: Bodies, light: Illumination,
) -> tuple[Singles, Floats]:  # fmt: skip
    """Laser light that each cell of each pixel collects, and where on the object it comes from.

    The rotation R and the translation t take the object's frame to the camera's. Returns energy
    (n, oy, ox) in electrons and points (n, oy, ox, 3), object frame.
    """
    pixels, field, face, normals, lit = seen
    v, faces, flat, body, paints = bodies
    profile, optics = light.profile, light.optics
    oy, ox = cells
    by, bx = blocks
    energy = np.zeros((len(pixels), oy, ox), np.float32)
    points = np.zeros((len(pixels), oy, ox, 3))
    n_flat, n = np.empty(3), np.empty(3)
    for i in range(len(pixels)):
        row, column = pixels[i, 0], pixels[i, 1]
        table = profile[row if len(profile) > 1 else 0]
        for block in range(by * bx):
            k = i * by * bx + block
            if not lit[k]:
                continue
            ky, kx = block // bx, block % bx
            f = face[k]
            a = faces[f, 0]
            reach = 0.0
            for j in range(3):
                n_flat[j] = R[j, 0] * flat[f, 0] + R[j, 1] * flat[f, 1] + R[j, 2] * flat[f, 2]
                n[j] = R[j, 0] * normals[k, 0] + R[j, 1] * normals[k, 1] + R[j, 2] * normals[k, 2]
                moved = R[j, 0] * v[a, 0] + R[j, 1] * v[a, 1] + R[j, 2] * v[a, 2] + t[j]
                reach += n_flat[j] * moved
            y0, x0 = (ky + 0.5) / by, (kx + 0.5) / bx
            spread = _blurred(field, row, column, y0, x0, n_flat, reach, light)
            paint = paints[body[f]]
            for y in range((ky * oy + by - 1) // by, ((ky + 1) * oy + by - 1) // by):
                for x in range((kx * ox + bx - 1) // bx, ((kx + 1) * ox + bx - 1) // bx):
                    p, q = within(field, row, column, (y + 0.5) / oy, (x + 0.5) / ox)
                    slope = n_flat[0] * p + n_flat[1] * q + n_flat[2]
                    if slope >= 0.0:
                        continue
                    s = reach / slope
                    wx, wy, wz = p * s - t[0], q * s - t[1], s - t[2]
                    for j in range(3):
                        points[i, y, x, j] = R[0, j] * wx + R[1, j] * wy + R[2, j] * wz
                    albedo = paint[0]
                    if paint[1] != 0.0:
                        albedo = painted(
                            points[i, y, x, 0], points[i, y, x, 1], points[i, y, x, 2], paint
                        )
                    energy[i, y, x] = (
                        optics[0]
                        / (oy * ox)
                        * _radiance(p * s, q * s, s, n, albedo, paint, light, table, spread)
                    )
    return energy, points


@njit(cache=True, nogil=True)
def lit_cells(energy: Singles, body: Ints, ours: Bools) -> tuple[Ints, Singles]:
    """Pixels with light on some bodies, and the energy (m, oy, ox) of their cells from these only.

    ``energy`` (n, oy, ox); ``body`` (n, by, bx) of the blocks of cells, −1 for none; ``ours``
    (bodies + 1,), the last for none.
    """
    n, oy, ox = energy.shape
    by, bx = body.shape[1], body.shape[2]
    which = np.empty(n, np.int32)
    own = np.zeros((n, oy, ox), np.float32)
    m = 0
    for i in range(n):
        any_light = False
        for y in range(oy):
            for x in range(ox):
                e = energy[i, y, x]
                if e > 0.0 and ours[body[i, y * by // oy, x * bx // ox]]:
                    own[m, y, x] = e
                    any_light = True
        if any_light:
            which[m] = i
            m += 1
    return which[:m], own[:m]


@njit(cache=True, nogil=True, error_model="numpy")
def _blurred(
    field: Floats,
    row: int,
    column: int,
    y: float,
    x: float,
    n: Floats,
    reach: float,
    light: Illumination,
) -> float:
    """How much wider defocus makes the sheet's profile on this surface (a factor, 1 in focus).

    A Gaussian sheet blurred by a Gaussian is a wider Gaussian: exact on a flat patch.
    """
    apex, sheet, beam, optics = light.apex, light.sheet, light.beam, light.optics
    p, q = within(field, row, column, y, x)
    s = reach / (n[0] * p + n[1] * q + n[2])
    v = optics[3] * optics[4] / (optics[4] - optics[3])
    v /= 1.0 + optics[5] * p + optics[6] * q
    sharp = optics[3] * s / (s - optics[3])
    blur = abs(v / sharp - 1.0) / 4.0  # rms of a disc along one axis, in apertures
    if blur * max(optics[1], optics[2]) < 0.02:
        return 1.0
    at = np.empty(3)
    for j in range(3):
        pj, qj = p, q
        if j == 1:
            pj, qj = within(field, row, column, y, x + 1.0)
        elif j == 2:
            pj, qj = within(field, row, column, y + 1.0, x)
        sj = reach / (n[0] * pj + n[1] * qj + n[2])
        at[j] = sheet_distance(pj * sj, qj * sj, sj, sheet)
    sigma = 0.5 * reach_of(p * s, q * s, s, apex, beam) / beam[3]
    du, dv = (at[1] - at[0]) * blur * optics[1], (at[2] - at[0]) * blur * optics[2]
    return math.sqrt(1.0 + (du * du + dv * dv) / (sigma * sigma))


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _radiance(
    x: float, y: float, depth: float, n: Floats, albedo: float, paint: Floats, light: Illumination,
    table: Floats, spread: float,
) -> float:  # fmt: skip
    """Radiance towards the camera, W/(mm² sr), times cos⁴ of the camera's field angle."""
    apex, sheet, beam, fan = light.apex, light.sheet, light.beam, light.fan
    wx, wy, wz = x - apex[0], y - apex[1], depth - apex[2]
    z = wx * beam[4] + wy * beam[5] + wz * beam[6]
    if z <= 0.0:
        return 0.0
    s = (wx * fan[2] + wy * fan[3] + wz * fan[4]) / (z * fan[1])
    if abs(s) >= 1.0:
        return 0.0
    far = (z - beam[1]) / beam[2]
    w = beam[0] * math.sqrt(1.0 + far * far) * spread
    d = sheet_distance(x, y, depth, sheet)
    if abs(d) > FADED * w:
        return 0.0
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    nl = -(n[0] * wx + n[1] * wy + n[2] * wz) / length
    if nl <= 0.0:
        return 0.0
    place = (s + 1.0) * 0.5 * (len(table) - 1)
    k = min(int(place), len(table) - 2)
    share = table[k] + (place - k) * (table[k + 1] - table[k])
    across = math.sqrt(2.0 / math.pi) / w * math.exp(-2.0 * d * d / (w * w))
    # Power per area of a plane square to the aim; a plane square to the ray gets it over z/length.
    irradiance = fan[0] * share / (z * fan[1]) * across * nl * length / z
    away = math.sqrt(x * x + y * y + depth * depth)
    nv = -(n[0] * x + n[1] * y + n[2] * depth) / away
    lv = (wx * x + wy * y + wz * depth) / (length * away)
    reflected = brdf(albedo, paint[4], paint[5], nl, nv, lv)
    return irradiance * reflected * (depth / away) ** 4


@njit(cache=True, nogil=True)
def paint_all(points: Floats, paint: Floats) -> Floats:
    """(n,) albedo of points (n, 3), object frame."""
    out = np.empty(len(points))
    for i in range(len(points)):
        out[i] = painted(points[i, 0], points[i, 1], points[i, 2], paint)
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
