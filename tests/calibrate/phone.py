"""Pictures of a phone: drifting exposure, rolling shutter, gamma, JPEG, a board held by hand."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np

from tests.calibrate.world import BOARD, World, true_layout, true_rig
from turnscan.arrays import Floats
from turnscan.rig import Rig, rotation_z

BALL, RADIUS = np.array([9.0, 4.0, 24.0]), 20.0
"""mm, in the table's frame at angle 0."""
_FINE = 2
"""Places along each side of a pixel."""
_LINE = 0.5
"""mm rms: half as thick as a cheap laser's line."""
_PLATTER, _WALL = 115.0, 0.12
"""Radius of the disc, mm, and how light the wall behind it is."""


@cache
def _all_rays() -> Floats:
    camera = true_rig().camera
    u = (np.arange(_FINE * camera.width) + 0.5) / _FINE - 0.5
    v = (np.arange(_FINE * camera.height) + 0.5) / _FINE - 0.5
    return camera.rays(np.stack(np.meshgrid(u, v), axis=-1))


def _part_with(points: Floats) -> tuple[slice, slice]:
    """Rows and columns of the picture that show these points (n, 3) of the camera's frame."""
    camera = true_rig().camera
    px = camera.project(points)
    low = np.maximum(np.floor(px.min(axis=0)).astype(int) - 3, 0)
    high = np.minimum(np.ceil(px.max(axis=0)).astype(int) + 4, (camera.width, camera.height))
    return slice(low[1], high[1]), slice(low[0], high[0])


def _rays(where: tuple[slice, slice]) -> Floats:
    rows, columns = (slice(_FINE * s.start, _FINE * s.stop) for s in where)
    return _all_rays()[rows, columns]


def _taken(
    grey: Floats, line: Floats, where: tuple[slice, slice], dice: np.random.Generator
) -> np.ndarray:
    """Reflectance and laser light, both per fine pixel of a part of the picture, as the phone
    stores the whole: (h, w, 3) BGR."""
    camera, exposure = true_rig().camera, dice.uniform(0.85, 1.1)
    both = np.stack([grey, line], axis=-1)
    small = both.reshape(both.shape[0] // _FINE, _FINE, -1, _FINE, 2).mean(axis=(1, 3))
    light = np.full((camera.height, camera.width, 3), 0.42 * _WALL)
    light[where] = 0.42 * small[..., :1]
    light[where][..., 2] += 0.9 * small[..., 1]
    seen = exposure * light + dice.normal(0.0, 0.006, light.shape)
    return np.rint(255 * np.clip(seen, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def _lit(rig: Rig, points: Floats) -> Floats:
    return np.exp(-0.5 * (rig.sheets[0].distance(points) / _LINE) ** 2)


def board_pictures(count: int, laser: bool, seed: int) -> list[np.ndarray]:
    """The board held by hand: it moves while the rows are exposed one after the other."""
    world = World(true_rig(), np.random.default_rng(seed))
    rig, out = world.rig, []
    x0, y0, x1, y1 = BOARD.extent
    ends = np.array([(x, y, 0.0) for x in (x0 - 15, x1 + 15) for y in (y0 - 15, y1 + 15)])
    for T in world.board_poses(count):
        where = _part_with(T.apply(ends))
        rays = _rays(where)
        n = T.rotation[:, 2]
        points = rays * ((n @ T.translation) / (rays @ n))[..., None]
        drift = world.dice.normal(0.0, 0.1, 2)  # mm in the time of a picture
        xy = T.inverse().apply(points.reshape(-1, 3)).reshape(points.shape)[..., :2]
        xy = xy + np.linspace(0, 1, len(xy))[:, None, None] * drift
        x, y = xy[..., 0], xy[..., 1]
        squares = ((np.floor(x / BOARD.square) + np.floor(y / BOARD.square)) % 2) * 0.85 + 0.06
        inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        paper = (x > x0 - 15) & (x < x1 + 15) & (y > y0 - 15) & (y < y1 + 15)
        grey = np.where(inside, squares, np.where(paper, 0.9, _WALL))
        line = _lit(rig, points) * np.where(paper, grey, 0.0) if laser else np.zeros_like(grey)
        out.append(_taken(grey, line, where, world.dice))
    return out


@cache
def _tile(number: int) -> np.ndarray:
    d = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return np.asarray(cv2.aruco.generateImageMarker(d, number, 6)) / 255.0


def table_pictures(angles: Floats, ball: bool, seed: int) -> list[np.ndarray]:
    """The disc with its markers, empty or with a ball, at these angles (rad)."""
    rig, layout, dice = true_rig(), true_layout(), np.random.default_rng(seed)
    box = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0.0, 0.5)]) * _PLATTER
    where = _part_with(rig.T_camera_table.apply(box))
    rays = _rays(where)
    back = rig.T_camera_table.inverse()
    eye, way = back.translation, rays @ back.rotation.T
    source = back.apply(rig.light_source("laser"))
    flat = eye + way * (-eye[2] / way[..., 2])[..., None]
    on_disc = np.hypot(flat[..., 0], flat[..., 1]) < _PLATTER
    out = []
    for angle in angles:
        grey = np.where(on_disc, 0.75, _WALL)
        place = flat[..., :2] @ rotation_z(angle)[:2, :2]
        for number, (cx, cy, turn, side) in zip(layout.numbers, layout.squares, strict=True):
            c, s = np.cos(turn), np.sin(turn)
            local = (place - (cx, cy)) @ np.array([[c, -s], [s, c]]) / side + 0.5
            k = np.floor(local * 6).astype(int)
            on = ((k >= 0) & (k < 6)).all(axis=-1)
            grey[on] = 0.06 + 0.8 * _tile(int(number))[5 - k[on][:, 1], k[on][:, 0]]
        points = flat
        line = np.where(on_disc, 1.0, 0.0)
        if ball:
            centre = rotation_z(angle) @ BALL
            points, line, grey = _with_ball(eye, way, flat, centre, source, line, grey)
        seen = rig.T_camera_table.apply(points.reshape(-1, 3))
        line = line * grey * _lit(rig, seen).reshape(line.shape)
        out.append(_taken(grey, line, where, dice))
    return out


def _with_ball(
    eye: Floats,
    way: Floats,
    flat: Floats,
    centre: Floats,
    source: Floats,
    line: Floats,
    grey: Floats,
) -> tuple[Floats, Floats, Floats]:
    """What of the scene is the ball, and what lies in its shadow."""
    a, b = (way**2).sum(axis=-1), way @ (eye - centre)
    rest = b**2 - a * ((eye - centre) @ (eye - centre) - RADIUS**2)
    hit = rest > 0
    near = eye + way * ((-b - np.sqrt(np.maximum(rest, 0.0))) / a)[..., None]
    faces = ((near - centre) * (source - near)).sum(axis=-1) > 0
    to = flat - source
    along = np.clip((to @ (centre - source)) / (to**2).sum(axis=-1), 0, 1)
    shadow = np.linalg.norm(source + along[..., None] * to - centre, axis=-1) < RADIUS
    line = np.where(hit, faces * 1.0, line * ~shadow)
    return np.where(hit[..., None], near, flat), line, np.where(hit, 0.7, grey)


def save(pictures: list[np.ndarray], folder: Path) -> None:
    """As a phone names and compresses them."""
    folder.mkdir()
    for k, picture in enumerate(pictures):
        name = str(folder / f"IMG_{1001 + k}.jpg")
        cv2.imwrite(name, picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
