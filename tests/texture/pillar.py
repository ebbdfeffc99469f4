"""A painted pillar with a ball before it, its pictures, and what its colours are in truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt

from tests.simulate.benches import SECONDS, bench
from turnscan.arrays import Floats, Image
from turnscan.mesh import Mesh, join, vertex_normals
from turnscan.rig import Pose, rotation_z
from turnscan.simulate import Bench, Body, Material, Part, Renderer, Scene, Sensor
from turnscan.texture import Colours, TexturePicture

TURN = 14
ANGLES = np.arange(TURN) * 2 * np.pi / TURN
DRIFT = np.linspace(0.9, 1.1, TURN)
LEVELS = 4095.0
SKY = 0.85


def lathe(radii: Floats, heights: Floats, around: int) -> Mesh:
    """A surface of revolution about z, without lids."""
    turn = np.arange(around) * 2 * np.pi / around
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    v = [
        np.column_stack([r * ring, np.full(around, z)]) for r, z in zip(radii, heights, strict=True)
    ]
    a = np.arange(around)
    p = (np.arange(len(radii) - 1)[:, None] * around + a).ravel()
    q = (np.arange(len(radii) - 1)[:, None] * around + (a + 1) % around).ravel()
    f = np.concatenate(
        [np.stack([p, q, q + around], -1), np.stack([p, q + around, p + around], -1)]
    )
    return Mesh(np.concatenate(v), f)


PILLAR = lathe(np.full(31, 25.0), np.linspace(0, 60, 31), 96)
BALL = lathe(6 * np.cos(t := np.linspace(-1.5, 1.5, 21)), 6 * np.sin(t), 40)
AT = np.array([36.0, 0.0, 30.0])
PART = join([PILLAR, Mesh(BALL.vertices + AT, BALL.faces)])
NOSE = np.arange(len(PART.vertices)) >= len(PILLAR.vertices)


@cache
def world(lamp: float = 0.0) -> tuple[Bench, Renderer]:
    """A checked pillar with a red ball before it, seen by a noisy colour camera of 12 bits."""
    paint = Material((0.7, 0.6, 0.4), pattern="checks", pitch=16.0, pattern_ratio=0.5)
    red = Material((0.6, 0.1, 0.1))
    bodies = (
        Body(Part("pillar", PILLAR), paint),
        Body(Part("ball", BALL), red, Pose(np.eye(3), AT)),
    )
    made = bench(bodies[0], height=30.0)
    pitch = made.sensor.pitch_x, made.sensor.pitch_y
    sensor = Sensor(*pitch, full_well=LEVELS * 3, gain=3.0, read_noise=5.0, bits=12, bayer="RGGB")
    white = made.electrons_per_radiance(550e-6, SECONDS) * sensor.efficiency / math.pi
    full = sensor.saturation / white
    scene = Scene(bodies, sky=SKY * full, lamp=lamp * full)
    made = replace(made, sensor=sensor, scene=scene)
    return made, Renderer(made)


@cache
def taken(lamp: float = 0.0, drift: bool = False) -> tuple[Image, ...]:
    """Pictures of one turn, with exposures that drift by a fifth or are the same."""
    _, renderer = world(lamp)
    seconds = SECONDS * (DRIFT if drift else np.ones(TURN))
    return tuple(renderer.picture(a, (), float(s)) for a, s in zip(ANGLES, seconds, strict=True))


def shots(
    pictures: Sequence[Image], which: Sequence[int] | range = range(TURN)
) -> Iterator[TexturePicture]:
    """Some of the pictures with their places."""
    made, _ = world()
    for k in which:
        T = made.rig.T_camera_table @ Pose(rotation_z(ANGLES[k]), np.zeros(3))
        yield TexturePicture(pictures[k], made.rig.camera, T, LEVELS)


def truth() -> Floats:
    """(v, 3) shares of the grey scale: paint under the sky alone."""
    _, renderer = world()
    body = NOSE.astype(np.int32)
    albedo = renderer.view._albedo(PART.vertices, body, 3)
    up = vertex_normals(PART)[:, 2:]
    return np.asarray(albedo * SKY * (0.6 + 0.4 * up))


def plain(least: float = 2.0) -> npt.NDArray[np.bool_]:
    """(v,) True on the pillar's wall where the paint is one all round, ``least`` mm away."""
    _, renderer = world()
    body = np.zeros(len(PART.vertices), np.int32)
    here = renderer.view._albedo(PART.vertices, body, 1)
    same = ~NOSE & (np.abs(PART.vertices[:, 2] - 30) < 27)
    for shift in (-least, least):
        turned = PART.vertices @ rotation_z(shift / 25.0).T
        lifted = PART.vertices + (0.0, 0.0, shift)
        for near in (turned, lifted):
            same &= np.isclose(renderer.view._albedo(near, body, 1), here)[:, 0]
    return same


def off(found: Colours) -> Floats:
    """(v,) how far the worst channel is from the truth, share of the grey scale."""
    return np.asarray(np.abs(found.colour / 255.0 - truth()).max(axis=1))
