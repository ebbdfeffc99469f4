"""What a rig would see of a body, without a picture: stripes of a surface that is a formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate import Part, Sweep
from turnscan.mesh import Mesh
from turnscan.rig import Camera, LaserSheet, Pose, Rig, TableMotion

Body = Callable[[Floats], Floats]
"""Points (n, 3) of the object's frame → (n,) mm outside of it."""

_CROSSINGS = 3
"""Steps after the straight line: to a ten-thousandth of a pixel, but where the stripe ends."""
CAMERA = Camera(640, 480, 1400.0, 1400.0, 320.0, 240.0)


def two_lasers(theta_deg: float = 28.0, lasers: int = 2) -> Rig:
    """A camera 400 mm from the axis, 20° above the platter, a laser to either side of it."""
    down = np.radians(20.0)
    up = np.array([0.0, -np.cos(down), -np.sin(down)])
    x = np.array([1.0, 0.0, 0.0])
    T = Pose(np.stack([x, np.cross(up, x), up], axis=1), np.array([0.0, 30.0, 400.0]))
    sheets = []
    for name, sign in (("right", 1.0), ("left", -1.0))[:lasers]:
        a = sign * np.radians(theta_deg)
        sheets.append(
            LaserSheet(name, T.turn(np.array([np.cos(a), np.sin(a), 0.0])), T.translation)
        )
    return Rig(CAMERA, tuple(sheets), T)


def sphere(centre: tuple[float, float, float], radius: float) -> Body:
    return lambda p: np.linalg.norm(p - centre, axis=-1) - radius


def cylinder(centre: tuple[float, float], radius: float, tilt_deg: float = 0.0) -> Body:
    t = np.radians(tilt_deg)
    axis = np.array([np.sin(t), 0.0, np.cos(t)])

    def outside(p: Floats) -> Floats:
        d = p - [*centre, 0.0]
        out: Floats = np.linalg.norm(d - (d @ axis)[..., None] * axis, axis=-1) - radius
        return out

    return outside


def prism(centre: tuple[float, float], flats: float, sides: int = 6, lean_deg: float = 0.0) -> Body:
    turn = np.arange(sides) * 2 * np.pi / sides + 0.2
    lean = np.radians(lean_deg)
    normals = np.stack(
        [np.cos(turn) * np.cos(lean), np.sin(turn) * np.cos(lean), np.full(sides, np.sin(lean))],
        axis=1,
    )

    def outside(p: Floats) -> Floats:
        far: Floats = ((p - [*centre, 0.0]) @ normals.T).max(axis=-1) - flats / 2
        return far

    return outside


LOW = np.array([-16.0, 4.0, 14.0])
ALONG = np.array([0.8, 0.1, 0.59]) / np.linalg.norm([0.8, 0.1, 0.59])


def bar(points: Floats) -> Floats:
    """Two balls of 20 mm, 38 mm apart, the second one higher."""
    ends = (LOW, LOW + 38.0 * ALONG)
    away = [np.linalg.norm(points - c, axis=-1) - 10.0 for c in ends]
    nearest: Floats = np.minimum(*away)
    return nearest


def cone(points: Floats) -> Floats:
    lean = np.radians(8.0)
    axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
    d = points - [6.0, 2.0, 0.0]
    z = d @ axis
    r = np.linalg.norm(d - z[..., None] * axis, axis=-1)
    return np.asarray(r - (20.0 - z * np.tan(np.radians(12.0))))


def drawn(mesh: Mesh, lies: Pose) -> Body:
    """A mesh that lies somewhere; far from it, 50 mm."""
    form, (low, high) = Part(mesh), mesh.bounds
    middle, reach = lies.apply((low + high) / 2), float(np.linalg.norm(high - low)) / 2 + 8.0

    def outside(p: Floats) -> Floats:
        flat = p.reshape(-1, 3)
        near = np.linalg.norm(flat - middle, axis=1) < reach
        out = np.full(len(flat), 50.0)
        out[near] = form.nearest(lies.inverse().apply(flat[near]), np.ones(1))[0]
        return out.reshape(p.shape[:-1])

    return outside


def swept(
    rig: Rig,
    laser: str,
    body: Body,
    commanded: Floats,
    true: Floats,
    seed: int,
    noise: float = 0.05,
    every: int = 4,
    heights: tuple[float, float] = (2.0, 45.0),
) -> Sweep:
    """The stripe of one laser on a body, at angles that are commanded, and those that are true."""
    dice = np.random.default_rng(seed)
    v = np.arange(0.0, rig.camera.height, every)
    u = np.arange(0.0, rig.camera.width, 2.0)

    def meets(pixels: Floats) -> Floats:
        sheet, back = rig.sheet(laser), rig.T_camera_table.inverse()
        return back.apply(sheet.intersect(rig.camera.rays(pixels)))

    def outside(stands: tuple[Floats, Floats], u: Floats, v: Floats) -> Floats:
        turn, shift = stands
        return body((meets(np.stack([u, v], axis=-1)) - shift) @ turn)

    X = meets(np.stack(np.meshgrid(u, v), axis=-1))
    within = (X[..., 2] > heights[0]) & (X[..., 2] < heights[1])
    standing, f = X[within], np.full(X.shape[:2], 1e3)
    pixels, steps = [], []
    for k, angle in enumerate(true):
        turn, shift = stands = rig.turning(angle)
        f[within] = body((standing - shift) @ turn)
        into = (f[:, :-1] > 0) != (f[:, 1:] > 0)
        near = (np.abs(f[:, :-1]) < 900) & (np.abs(f[:, 1:]) < 900)
        row, col = np.nonzero(into & near)
        ends = (u[col], f[row, col]), (u[col + 1], f[row, col + 1])
        place = _crossing(partial(outside, stands), *ends, v[row])
        at = meets(np.stack([place, v[row]], axis=-1))
        order = np.lexsort((rig.T_camera_table.apply(at)[:, 2], row))
        _, first = np.unique(row[order], return_index=True)
        pick = order[first]
        pixels.append(np.stack([place[pick], v[row[pick]]], axis=1))
        steps.append(np.full(len(pick), k))
    px = np.concatenate(pixels)
    px[:, 0] += noise * dice.standard_normal(len(px))
    sigma = np.full(len(px), noise)
    return Sweep(laser, px, sigma, np.concatenate(steps).astype(np.int32), commanded)


def _crossing(
    f: Callable[[Floats, Floats], Floats],
    low: tuple[Floats, Floats],
    high: tuple[Floats, Floats],
    v: Floats,
) -> Floats:
    """Columns between two where ``f`` is zero in rows ``v``, by the Illinois method.

    A straight line between neighbouring pixels is off where the surface is seen at a grazing angle.
    """
    (a, fa), (b, fb) = low, high
    before = np.zeros(len(v))
    for _ in range(_CROSSINGS):
        place = a - fa * (b - a) / (fb - fa)
        value = f(place, v)
        left = (value > 0) == (fa > 0)
        side = np.where(left, 1.0, -1.0)
        stays = np.where(side == before, 0.5, 1.0)
        a, b = np.where(left, place, a), np.where(left, b, place)
        fa, fb = np.where(left, value, fa * stays), np.where(left, fb * stays, value)
        before = side
    return np.asarray(a - fa * (b - a) / (fb - fa))


def both(
    rig: Rig, body: Body, commanded: Floats, true: Floats, seed: int = 0, **more: float
) -> list[Sweep]:
    """All lasers of a rig on a body."""
    return [
        swept(rig, s.name, body, commanded, true, 100 * seed + k, **more)  # type: ignore[arg-type]
        for k, s in enumerate(rig.sheets)
    ]


def doubted(rig: Rig, length: float = 5.0, angle_deg: float = 2.0) -> Rig:
    """The rig as a ruler knows it."""
    sigma = dict.fromkeys(rig.parameter_names, 0.0)
    for s in rig.sheets:
        sigma |= {
            f"{s.name}.turn_along": np.radians(angle_deg),
            f"{s.name}.turn_across": np.radians(angle_deg),
            f"{s.name}.offset": length,
        }
    for axis in "xyz":
        sigma |= {f"table.turn_{axis}": np.radians(angle_deg), f"table.shift_{axis}": length}
    return replace(rig, covariance=np.diag(np.array(list(sigma.values())) ** 2))


def ruled(true: Rig, seed: int = 4, known: Rig | None = None) -> Rig:
    """The rig as a ruler knows it: every number is wrong by its whole uncertainty, 5 mm or 2°."""
    known = known or doubted(true)
    assert known.covariance is not None
    sigma = np.sqrt(np.diag(known.covariance))
    sign = np.random.default_rng(seed).choice([-1.0, 1.0], len(sigma))
    return replace(known.perturbed(sigma * sign), covariance=known.covariance)


def eccentric(start_deg: float = 0.0, backlash_deg: float = 0.0) -> TableMotion:
    """A table whose drive is 1° eccentric, with play."""
    return TableMotion(np.radians([[0.0, 1.0]]), np.radians(start_deg), np.radians(backlash_deg))
