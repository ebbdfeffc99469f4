# mypy: disable-error-code="untyped-decorator,no-any-return"
"""Numba kernels of the renderer. This module imports numba; import it inside functions only.

Frames: "camera" is the camera's, "object" the table's frame turned with the table. ``R`` (3, 3)
and ``t`` (3,) map object to camera. Image coordinates are the undistorted ones on z = 1.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.simulate._cut import FADED, reach_of, sheet_distance

Singles = npt.NDArray[np.float32]


@nb.njit(cache=True, nogil=True)
def corner_normals(
    faces: Ints, flat: Floats, angles: Floats, order: Ints, starts: Ints, crease: float
) -> Floats:
    """(f, 3, 3): neighbours' normals averaged by their angle, except across edges."""
    out = np.empty((len(faces), 3, 3))
    for f in range(len(faces)):
        for k in range(3):
            x = y = z = 0.0
            for i in range(starts[faces[f, k]], starts[faces[f, k] + 1]):
                g, j = order[i] // 3, order[i] % 3
                n = flat[g]
                if n[0] * flat[f, 0] + n[1] * flat[f, 1] + n[2] * flat[f, 2] > crease:
                    x += angles[g, j] * n[0]
                    y += angles[g, j] * n[1]
                    z += angles[g, j] * n[2]
            length = math.sqrt(x * x + y * y + z * z)
            out[f, k, 0], out[f, k, 1], out[f, k, 2] = x / length, y / length, z / length
    return out


@nb.njit(cache=True, nogil=True)
def rays(pixels: Ints, field: Floats, down: int, across: int, R: Floats) -> Singles:
    """Directions (n·down·across, 3), object frame, of a grid of rays in each pixel (n, 2).

    ``field`` (H + 1, W + 1, 2) holds the image coordinates of the pixels' outer corners.
    """
    out = np.empty((len(pixels) * down * across, 3), np.float32)
    k = 0
    for i in range(len(pixels)):
        for y in range(down):
            for x in range(across):
                p, q = _within(
                    field, pixels[i, 0], pixels[i, 1], (y + 0.5) / down, (x + 0.5) / across
                )
                for j in range(3):
                    out[k, j] = R[0, j] * p + R[1, j] * q + R[2, j]
                k += 1
    return out


@nb.njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _within(field: Floats, row: int, column: int, y: float, x: float) -> tuple[float, float]:
    # Element by element: a view in a loop over cells costs more than all of this arithmetic.
    r, c = row + 1, column + 1
    a, b = (1 - y) * (1 - x), (1 - y) * x
    d, e = y * (1 - x), y * x
    p = a * field[row, column, 0] + b * field[row, c, 0]
    p += d * field[r, column, 0] + e * field[r, c, 0]
    q = a * field[row, column, 1] + b * field[row, c, 1]
    q += d * field[r, column, 1] + e * field[r, c, 1]
    return p, q


@nb.njit(cache=True, nogil=True)
def surface(
    face: Ints,
    directions: Singles | Floats,
    origins: Floats,
    v: Floats,
    faces: Ints,
    flat: Floats,
    corners: Floats,
) -> tuple[Floats, Floats]:
    """Where rays meet their faces, and the smooth normals there: (n, 3) each.

    ``origins`` (n, 3), or (1, 3) for all. Object frame; NaN where the ray meets nothing.
    """
    points, normals = np.full((len(face), 3), np.nan), np.full((len(face), 3), np.nan)
    for i in range(len(face)):
        f = face[i]
        if f < 0:
            continue
        a, b = faces[f, 0], i if len(origins) > 1 else 0
        slope = reach = 0.0
        for k in range(3):
            slope += flat[f, k] * directions[i, k]
            reach += flat[f, k] * (v[a, k] - origins[b, k])
        if slope >= 0.0:
            continue
        for k in range(3):
            points[i, k] = origins[b, k] + directions[i, k] * (reach / slope)
        _smooth_normal(points, i, v, faces, f, corners, normals)
    return points, normals


@nb.njit(cache=True, nogil=True)
def _smooth_normal(
    points: Floats, i: int, v: Floats, faces: Ints, f: int, corners: Floats, out: Floats
) -> None:
    d11 = d12 = d22 = p = q = 0.0
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    for k in range(3):
        e1, e2, w = v[b, k] - v[a, k], v[c, k] - v[a, k], points[i, k] - v[a, k]
        d11 += e1 * e1
        d12 += e1 * e2
        d22 += e2 * e2
        p += w * e1
        q += w * e2
    det = d11 * d22 - d12 * d12
    u = min(max((d22 * p - d12 * q) / det, 0.0), 1.0)
    t = min(max((d11 * q - d12 * p) / det, 0.0), 1.0)
    length = 0.0
    for k in range(3):
        mean = (1 - u - t) * corners[f, 0, k] + u * corners[f, 1, k] + t * corners[f, 2, k]
        out[i, k] = mean
        length += mean * mean
    for k in range(3):
        out[i, k] /= math.sqrt(length)


@nb.njit(cache=True, nogil=True)
def near_sheet(
    points: Floats,
    normals: Floats,
    R: Floats,
    t: Floats,
    apex: Floats,
    sheet: Floats,
    beam: Floats,
    widened: float,
) -> Bools:
    """(n,) True where a point faces the laser and lies within reach of its sheet."""
    out = np.zeros(len(points), np.bool_)
    x = np.empty(3)
    for i in range(len(points)):
        if math.isnan(points[i, 0]):
            continue
        facing = 0.0
        for k in range(3):
            x[k] = R[k, 0] * points[i, 0] + R[k, 1] * points[i, 1] + R[k, 2] * points[i, 2] + t[k]
        for k in range(3):
            n = R[k, 0] * normals[i, 0] + R[k, 1] * normals[i, 1] + R[k, 2] * normals[i, 2]
            facing += n * (apex[k] - x[k])
        d = sheet_distance(x[0], x[1], x[2], sheet)
        out[i] = facing > 0.0 and abs(d) < widened * reach_of(x[0], x[1], x[2], apex, beam)
    return out


@nb.njit(cache=True, nogil=True, inline="always", error_model="numpy")
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


@nb.njit(cache=True, nogil=True, inline="always", error_model="numpy")
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


@nb.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def glow(
    pixels: Ints,
    field: Floats,
    blocks: tuple[int, int],
    cells: tuple[int, int],
    face: Ints,
    normals: Floats,
    lit: Bools,
    R: Floats,
    t: Floats,
    v: Floats,
    faces: Ints,
    flat: Floats,
    body: Ints,
    paints: Floats,
    apex: Floats,
    sheet: Floats,
    beam: Floats,
    fan: Floats,
    profile: Floats,
    optics: Floats,
) -> tuple[Singles, Floats]:
    """Laser light that each cell of each pixel collects, and where on the object it comes from.

    ``paints`` (bodies, 6): albedo, pattern, pitch, ratio, specular, roughness.
    ``fan``: sheet power, tan of the half angle, and the unit vector across the fan (3).
    ``profile`` (H or 1, k): share of the power per unit of s from −1 to 1.
    ``optics``: electrons per radiance, and for the blur: f/(N·pitch_x), f/(N·pitch_y),
    focal length, focus distance, and the slope (2) of the image distance over the picture.
    Returns energy (n, oy, ox) in electrons and points (n, oy, ox, 3), object frame.
    """
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
            spread = _blurred(field, row, column, y0, x0, n_flat, reach, sheet, apex, beam, optics)
            paint = paints[body[f]]
            for y in range((ky * oy + by - 1) // by, ((ky + 1) * oy + by - 1) // by):
                for x in range((kx * ox + bx - 1) // bx, ((kx + 1) * ox + bx - 1) // bx):
                    p, q = _within(field, row, column, (y + 0.5) / oy, (x + 0.5) / ox)
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
                        * _radiance(
                            p * s, q * s, s, n, albedo, paint, apex, sheet, beam, fan, table, spread
                        )
                    )
    return energy, points


@nb.njit(cache=True, nogil=True)
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


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _blurred(
    field: Floats,
    row: int,
    column: int,
    y: float,
    x: float,
    n: Floats,
    reach: float,
    sheet: Floats,
    apex: Floats,
    beam: Floats,
    optics: Floats,
) -> float:
    """How much wider defocus makes the sheet's profile on this surface (a factor, 1 in focus).

    A Gaussian sheet blurred by a Gaussian is a wider Gaussian: exact on a flat patch.
    """
    p, q = _within(field, row, column, y, x)
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
            pj, qj = _within(field, row, column, y, x + 1.0)
        elif j == 2:
            pj, qj = _within(field, row, column, y + 1.0, x)
        sj = reach / (n[0] * pj + n[1] * qj + n[2])
        at[j] = sheet_distance(pj * sj, qj * sj, sj, sheet)
    sigma = 0.5 * reach_of(p * s, q * s, s, apex, beam) / beam[3]
    du, dv = (at[1] - at[0]) * blur * optics[1], (at[2] - at[0]) * blur * optics[2]
    return math.sqrt(1.0 + (du * du + dv * dv) / (sigma * sigma))


@nb.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _radiance(
    x: float, y: float, depth: float, n: Floats, albedo: float, paint: Floats, apex: Floats,
    sheet: Floats, beam: Floats, fan: Floats, table: Floats, spread: float,
) -> float:  # fmt: skip
    """Radiance towards the camera, W/(mm² sr), times cos⁴ of the camera's field angle."""
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


@nb.njit(cache=True, nogil=True)
def paint_all(points: Floats, paint: Floats) -> Floats:
    """(n,) albedo of points (n, 3), object frame."""
    out = np.empty(len(points))
    for i in range(len(points)):
        out[i] = painted(points[i, 0], points[i, 1], points[i, 2], paint)
    return out


@nb.njit(cache=True, nogil=True)
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
