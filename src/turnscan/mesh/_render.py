"""A shaded picture of a mesh, for reports and the gallery: orthographic, z-buffered, no GPU."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.rig import rotation_about

Rgb = npt.NDArray[np.uint8]

_OVERSAMPLE = 2
_BACKGROUND = 255.0
_BACK_FACE = np.array([196.0, 120.0, 84.0])
_SURFACE = np.array([122.0, 158.0, 196.0])


def render(
    vertices: Floats,
    faces: Ints,
    *,
    azimuth: float = 0.6,
    elevation: float = 0.45,
    size: tuple[int, int] = (640, 480),
    colour: npt.ArrayLike | None = None,
    transparent: bool = False,
) -> Rgb:
    """Draw faces (f, 3) of vertices (v, 3), z up, fitted to the frame; no colour is plain blue.

    They are seen from ``azimuth`` and ``elevation`` (radians).

    ``size`` is (width, height) in pixels; ``colour`` is (v, 3) red, green, blue 0 to 255 per
    vertex, or None for one plain colour. Faces seen from behind are drawn in rust, so that a hole
    or a wrong orientation shows. Returns a picture (height, width, 3), or with ``transparent``
    (height, width, 4), where the last channel says how much of a pixel the part covers.
    """
    w, h = size[0] * _OVERSAMPLE, size[1] * _OVERSAMPLE
    picture = np.full((h, w, 3), 0.0 if transparent else _BACKGROUND)
    depth = np.full((h, w), np.inf)
    if len(faces):
        T = rotation_about([1, 0, 0], elevation) @ rotation_about([0, 0, 1], -azimuth)
        seen = vertices @ T.T  # x right, y away from the viewer, z up
        low, high = seen.min(axis=0), seen.max(axis=0)
        scale = 0.92 * min(w / max(high[0] - low[0], 1e-9), h / max(high[2] - low[2], 1e-9))
        x = (seen[:, 0] - (low[0] + high[0]) / 2) * scale + w / 2
        y = h / 2 - (seen[:, 2] - (low[2] + high[2]) / 2) * scale
        flat = np.stack([x, y, seen[:, 1]], axis=-1)
        paint = (
            np.broadcast_to(_SURFACE, vertices.shape)
            if colour is None
            else np.asarray(colour, dtype=np.float64)
        )
        _paint(flat, faces, np.ascontiguousarray(paint), _shade(seen, faces), picture, depth)
    small = _averaged(picture)
    if transparent:
        covered = _averaged(np.isfinite(depth)[..., None].astype(np.float64))
        small = np.concatenate([small / np.maximum(covered, 1e-9), 255.0 * covered], axis=-1)
    return np.round(small).astype(np.uint8)


def _averaged(fine: Floats) -> Floats:
    """The mean of the fine pixels of each pixel."""
    n = _OVERSAMPLE
    mean = fine[::n, ::n].copy()
    for k in range(1, n * n):  # NumPy's mean over two axes takes four times as long
        mean += fine[k // n :: n, k % n :: n]
    mean /= n * n
    return mean


def _shade(seen: Floats, faces: Ints) -> Floats:
    """Brightness per face, negative for a face seen from behind."""
    t = seen[faces]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    towards = -normal[:, 1]
    side = np.sign(towards)
    light = np.array([-0.45, -0.75, 0.48])  # over the viewer's left shoulder
    lambert = np.clip((normal * side[:, None]) @ light, 0.0, 1.0)
    brightness: Floats = side * (0.30 + 0.70 * lambert)
    return brightness


@njit(cache=True)
def _paint(
    points: Floats,
    faces: npt.NDArray[np.int32],
    paint: Floats,
    shade: Floats,
    picture: Floats,
    depth: Floats,
) -> None:
    h, w = depth.shape
    back = _BACK_FACE
    for f in range(faces.shape[0]):
        if shade[f] == 0.0:
            continue
        a, b, c = faces[f]
        xa, ya, za = points[a]
        xb, yb, zb = points[b]
        xc, yc, zc = points[c]
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        if area == 0.0:
            continue
        for v in range(max(0, int(min(ya, yb, yc))), min(h - 1, int(max(ya, yb, yc)) + 1) + 1):
            for u in range(max(0, int(min(xa, xb, xc))), min(w - 1, int(max(xa, xb, xc)) + 1) + 1):
                s = ((xb - u) * (yc - v) - (xc - u) * (yb - v)) / area
                t = ((xc - u) * (ya - v) - (xa - u) * (yc - v)) / area
                r = 1.0 - s - t
                if s < 0.0 or t < 0.0 or r < 0.0:
                    continue
                z = s * za + t * zb + r * zc
                if z >= depth[v, u]:
                    continue
                depth[v, u] = z
                for k in range(3):
                    if shade[f] > 0.0:
                        plain = s * paint[a, k] + t * paint[b, k] + r * paint[c, k]
                        picture[v, u, k] = plain * shade[f]
                    else:
                        picture[v, u, k] = -back[k] * shade[f]
