"""Where the stripe truly is in a simulated picture, and how far speckle and noise must move it.

The part's triangles are cut with the laser sheet, in closed form; no picture is rendered and
nothing is detected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.simulate import Bench, contrast
from turnscan.simulate._render import drawn

GRAZING = 0.35
"""Cosine of the angle to the laser or to the camera below which a surface is seen too flatly."""
NEIGHBOURS = 3
"""Rows above and below that must see the same smooth surface."""
WINDOW = 2.5
"""Half the detector's window, in widths."""
WINDOW_LOSS = 1.3
"""Its excess speckle variance over the whole line (docs/explain/stripes.md)."""
FOLLOWS = 1.0 / (1.0 - 2.0 * WINDOW * math.exp(-(WINDOW**2) / 2) / math.sqrt(2.0 * math.pi))
"""By how much it amplifies camera noise as it follows its own centre."""
AIRY = 0.42
"""rms width of the Gaussian nearest to the Airy disc, in λN'."""


@dataclass(frozen=True)
class Crossings:
    """Where rows of the picture see the middle of the laser sheet on a lit surface."""

    row: Ints
    """(n,)."""
    column: Floats
    """(n,) px, exact."""
    width: Floats
    """(n,) px rms of the stripe there: the sheet's thickness and diffraction, without pixels."""
    own: Bools
    """(n,) True on the scene's first body."""
    fine: Bools
    """(n,) True where edges and grazing are far: what the theory of the error is about."""


class Exact:
    """The exact crossings of one bench."""

    def __init__(self, made: Bench) -> None:
        self._made = made
        self._tri, self._caster = drawn(made.scene.bodies)

    def crossings(self, angle: float, laser: str) -> Crossings:
        """All crossings with the table at ``angle``; a row may have several, or none."""
        made, tri = self._made, self._tri
        camera, sheet = made.rig.camera, made.rig.sheet(laser)
        beam = next(b for b in made.beams if b.name == laser)
        T = made.rig.T_camera_table @ made.motion.pose(angle)
        back = T.inverse()
        eye, apex = back.translation, back.apply(beam.apex)
        corners = T.apply(tri.vertices)
        distance = sheet.distance(corners)[tri.faces]
        k = np.flatnonzero((distance.min(axis=1) < 0) & (distance.max(axis=1) >= 0))
        start, end = _cut(corners[tri.faces[k]], distance[k])
        which, row, column = _rows(camera.project(start), camera.project(end), camera.height)
        inside = (column > -0.5) & (column < camera.width - 0.5)
        face, row, column = k[which[inside]], row[inside], column[inside]
        normal, foot = T.turn(tri.flat_normals[face]), corners[tri.faces[face, 0]]

        def on_tangent(shift: Floats) -> Floats:
            rays = camera.rays(np.stack([column + shift, row.astype(np.float64)], axis=-1))
            s = np.einsum("ij,ij->i", normal, foot) / np.einsum("ij,ij->i", normal, rays)
            return np.asarray(rays * s[:, None])

        def seen(points: Floats) -> Bools:
            at, n = back.apply(points), tri.flat_normals[face]
            return np.asarray(self._caster.visible(at, n, eye) & self._caster.visible(at, n, apex))

        still = np.zeros(len(column))
        X = on_tangent(still)
        to_eye, to_laser = -X, beam.apex - X
        cosine = np.minimum(
            np.einsum("ij,ij->i", normal, to_eye) / np.linalg.norm(to_eye, axis=1),
            np.einsum("ij,ij->i", normal, to_laser) / np.linalg.norm(to_laser, axis=1),
        )
        # Per pixel along the row, the ray walks this far away from the sheet.
        walk = sheet.distance(on_tangent(still + 0.5)) - sheet.distance(on_tangent(still - 0.5))
        thick = beam.radius((X - beam.apex) @ beam.aim) / 2.0
        with np.errstate(divide="ignore"):
            sharp = thick / np.abs(walk)
        blur = 0.0 if made.waves == "rays" else AIRY * made.grain[1]
        width = np.hypot(sharp, blur)
        lit = (cosine > 0) & seen(X)
        smooth = lit & (cosine > GRAZING)
        for side in (-WINDOW, WINDOW):
            shift = side * np.minimum(sharp, 50.0)
            beside = on_tangent(shift)
            rays = back.turn(camera.rays(np.stack([column + shift, row.astype(float)], axis=-1)))
            hit = self._caster.first_hits(eye, rays)
            there, flat = corners[tri.faces[hit, 0]], T.turn(tri.flat_normals[hit])
            off = np.einsum("ij,ij->i", beside - there, flat)
            # The surface that is seen there is this one, bent by less than a tenth of the reach.
            smooth &= (hit >= 0) & (np.abs(off) < 0.1 * WINDOW * thick) & seen(beside)
        own = tri.body[face] == 0
        fine = _among_their_like(row, column, smooth & own, camera.height)
        return Crossings(row[lit], column[lit], width[lit], own[lit], fine[lit])


def _cut(corners: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Triangles (n, 3, 3) with signed distances (n, 3) of their corners → the cut's ends (n, 3)."""
    n = np.arange(len(corners))
    below = distance < 0
    alone = np.where(below.sum(axis=1) == 1, below.argmax(axis=1), (~below).argmax(axis=1))
    ends = []
    for turn in (1, 2):
        other = (alone + turn) % 3
        a, b = distance[n, alone], distance[n, other]
        t = (a / (a - b))[:, None]
        ends.append(corners[n, alone] * (1 - t) + corners[n, other] * t)
    return ends[0], ends[1]


def _rows(start: Floats, end: Floats, height: int) -> tuple[Ints, Ints, Floats]:
    """Segments (n, 2) px → which segment meets which whole row, and in which column."""
    low = np.ceil(np.minimum(start[:, 1], end[:, 1])).astype(np.int64).clip(0, height)
    high = np.ceil(np.maximum(start[:, 1], end[:, 1])).astype(np.int64).clip(0, height)
    count = high - low
    which = np.repeat(np.arange(len(low)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + low[which]
    t = (row - start[which, 1]) / (end[which, 1] - start[which, 1])
    column = start[which, 0] + t * (end[which, 0] - start[which, 0])
    return which.astype(np.int32), row.astype(np.int32), np.asarray(column)


def _among_their_like(row: Ints, column: Floats, smooth: Bools, height: int) -> Bools:
    """True where the rows above and below continue the same smooth stripe."""
    count = np.bincount(row[smooth], minlength=height)
    at = np.full(height, np.nan)
    at[row[smooth]] = column[smooth]
    at[count != 1] = np.nan
    bend = np.full(height, np.nan)
    bend[1:-1] = np.abs(at[:-2] - 2 * at[1:-1] + at[2:])
    good = bend < 0.5
    out = good.copy()
    for k in range(1, NEIGHBOURS):
        out[k:] &= good[:-k]
        out[:-k] &= good[k:]
    return np.asarray(smooth & out[row])


def speckle_error(made: Bench, width: Floats) -> Floats:
    """rms error of the detector's window from speckle alone, px: C √(1.3 K s / (4√π))."""
    down, across = made.grain
    C = contrast(made.scene.bodies[0].material.polarisation, made.modes)
    K = 4 / math.pi * down * across / math.hypot(1.0, 1.18 * down)
    return np.asarray(C * np.sqrt(WINDOW_LOSS * K * width / (4 * math.sqrt(math.pi))))


def camera_error(made: Bench, width: Floats, amplitude: Floats) -> Floats:
    """rms error from read noise, rounding and shot noise in lit − dark, and line jitter, px.

    ``amplitude`` in grey levels of a linear picture. For a Gaussian stripe of A electrons at the
    peak: pixels of variance r² in a window of ± h give r √(2h³/3) / (A s √2π), shot noise gives
    s / √(A s √2π); both grow as the window follows its own centre.
    """
    sensor = made.sensor
    step = sensor.gain * (sensor.converter_levels - 1) / (sensor.levels - 1)
    read = 2.0 * (sensor.read_noise**2 + step**2 / 12.0)
    flux = amplitude * step * width * math.sqrt(2.0 * math.pi)
    half = WINDOW * width
    variance = (read * 2.0 / 3.0 * half**3 / flux**2 + width**2 / flux) * FOLLOWS**2
    return np.asarray(np.sqrt(variance + sensor.jitter**2))
