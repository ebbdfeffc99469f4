"""Camera pictures of a scene under a laser sheet, rendered forwards with physical units.

For each pixel near the stripe, rays run from the lens into the scene; where they meet a surface the
laser's irradiance, its shadow and the surface's reflectance give the light that comes back
(irradiance of a Gaussian sheet, GGX, thin lens: docs/explain/simulator.md). Nothing here
inverts what `turnscan.stripes` or `turnscan.points` do.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Bools, Floats, Image, Ints
from turnscan.errors import InputError
from turnscan.mesh import Caster
from turnscan.rig import LaserSheet, Pose
from turnscan.simulate import _speckle as speckle
from turnscan.simulate._airy import Keys, Numbers, Singles
from turnscan.simulate._beam import Beam
from turnscan.simulate._bench import PLANCK_C, Bench
from turnscan.simulate._bounce import Bounces
from turnscan.simulate._exposure import expose
from turnscan.simulate._random import seed64
from turnscan.simulate._scene import PATTERNS, Body, Triangles, triangles
from turnscan.simulate._view import View

if TYPE_CHECKING:
    from turnscan.simulate._grain_kernels import Cells, Roughness

_REACH = 2.2
"""Radii of the sheet within which its light is rendered (4.4 σ: 6e-5 of the peak)."""
_RAY_CELLS = (4, 8)
_RAY_BLOCKS = (2, 2)
_PROFILE_BINS = 2048


class _Standing:
    """Bodies, equal where their triangles are the same and stand in the same places."""

    def __init__(self, bodies: tuple[Body, ...]) -> None:
        self.bodies = bodies
        digest = hashlib.blake2b(repr(len(bodies)).encode())
        for body in bodies:
            mesh, T = body.part.mesh, body.T_table_part
            for array in (mesh.vertices, mesh.faces, T.rotation, T.translation):
                digest.update(repr((array.shape, array.dtype.str)).encode())
                digest.update(array.tobytes())
        self._digest = digest.digest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Standing) and self._digest == other._digest

    def __hash__(self) -> int:
        return hash(self._digest)


@lru_cache(maxsize=2)
def _drawn(standing: _Standing) -> tuple[Triangles, Caster]:
    """Triangles for ray casting. The last ones are kept: they take a second or two, and a
    simulated device is opened again and again with the same part."""
    tri = triangles(standing.bodies)
    caster = Caster(tri.vertices, tri.faces)
    # The first ray builds the tree: two devices may send theirs at once.
    caster.first_hits(np.zeros(3), np.ones((1, 3)))
    return tri, caster


def drawn(bodies: tuple[Body, ...]) -> tuple[Triangles, Caster]:
    """The triangles of bodies and what casts rays at them, as a `Renderer` of them has them."""
    return _drawn(_Standing(bodies))


class Renderer:
    """Renders the pictures of one bench. Holds nothing but what the bench implies."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self._tri, self._caster = drawn(bench.scene.bodies)
        self.view = View(bench, self._tri, self._caster)

    def electrons(
        self, angle: float, lit: Iterable[str], seconds: float, start: float = 0.0
    ) -> Singles:
        """Expected photo-electrons (H, W), or (H, W, 3) behind a Bayer filter.

        ``angle`` is the table's true angle, ``start`` the time at which the shutter opens.
        Raises InputError for an exposure that is not above 0 s.
        """
        if not 0.0 < seconds < math.inf:
            raise InputError(
                f"exposure {seconds:g} s", hint="give an exposure above 0 s, for instance 0.02"
            )
        T = self.bench.rig.T_camera_table @ self.bench.motion.pose(angle)
        colours = 3 if self.bench.sensor.bayer else 1
        total = self.view.room_light(T) * np.float32(seconds)
        for name in sorted(lit):
            beam = next(b for b in self.bench.beams if b.name == name)
            light = self.laser_light(T, beam, seconds, start)
            response = self.bench.sensor.response(beam.wavelength).astype(np.float32)
            for colour in range(colours):
                total[..., colour] += light if response[colour] == 1 else light * response[colour]
        return total if colours == 3 else np.ascontiguousarray(total[..., 0])

    def picture(
        self,
        angle: float,
        lit: Iterable[str],
        seconds: float,
        *,
        gain: float = 1.0,
        start: float = 0.0,
        shot: int = 0,
    ) -> Image:
        """One camera picture; the same arguments always give the same picture."""
        lit = frozenset(lit)
        light = self.electrons(angle, lit, seconds, start)
        sensor = self.bench.sensor if gain == 1.0 else self.bench.sensor.amplified(gain)
        names = sorted(lit)
        which = sum(1 << i for i, b in enumerate(self.bench.beams) if b.name in names)
        seed = seed64(self.bench.seed, round(angle * 1e9), which, shot)
        if not self.bench.noise:
            whole = np.clip(light / sensor.saturation, 0.0, 1.0) * (sensor.levels - 1) + 0.5
            if sensor.bits == 8:
                return np.asarray(whole, dtype=np.uint8)
            return np.asarray(whole, dtype=np.uint16)
        return expose(light, sensor, int(seed), seconds)

    # ---- the laser ---------------------------------------------------------------------------

    def laser_light(self, T: Pose, beam: Beam, seconds: float, start: float = 0.0) -> Singles:
        """Photons (H, W) of one laser at each pixel; ``T`` is T_camera_object."""
        from turnscan.simulate._grain_kernels import Cells

        pixels, cells, body = self._cells(T, beam, seconds, start)
        camera = self.bench.rig.camera
        shape = (camera.height, camera.width)
        out = np.zeros(shape, np.float32)
        if not len(pixels):
            return out
        whose = np.zeros(len(self.bench.scene.bodies) + 1, np.bool_)  # the last: no body, −1
        for contrast, halo, members in self._groups():
            whose[:] = False
            whose[members] = True
            direct = self._imaged(pixels, Cells(*cells, whose[body]), contrast, beam)
            out += direct if halo is None else self._spread(direct, halo, T)
        if self.bench.bounces:
            out += self._bounced(T, beam, seconds, start)
        return out

    def _bounced(self, T: Pose, beam: Beam, seconds: float, start: float) -> Singles:
        """Light that met a second surface on its way, photons (H, W)."""
        bench, camera = self.bench, self.bench.rig.camera
        two = Bounces(self._tri, self._caster, bench.scene.bodies, T, beam)
        across = np.cross(bench.rig.sheet(beam.name).normal, beam.aim)
        share = self._profile(beam, seconds, start)[0]
        scale = bench.electrons_per_radiance(beam.wavelength, seconds)
        per_watt = bench.lens.transmission * seconds * beam.wavelength / PLANCK_C
        glow = two.diffuse(camera, self.view.seen(T), self.view.within(T), share, across, scale)
        if any(b.material.specular for b in bench.scene.bodies):
            glow += two.mirrored(camera, bench.lens, across, per_watt)
        return glow

    def _groups(self) -> list[tuple[float, tuple[float, float] | None, list[int]]]:
        """Bodies that share (speckle contrast, (halo share, halo length))."""
        groups: dict[tuple[float, tuple[float, float] | None], list[int]] = {}
        for i, b in enumerate(self.bench.scene.bodies):
            m = b.material
            halo = (m.halo, m.halo_length) if m.halo > 0 else None
            contrast = speckle.contrast(m.polarisation, self.bench.modes)
            groups.setdefault((contrast, halo), []).append(i)
        return [(c, h, members) for (c, h), members in groups.items()]

    def _imaged(self, pixels: Ints, cells: Cells, contrast: float, beam: Beam) -> Singles:
        """The cells through the lens: photons (H, W)."""
        bench = self.bench
        shape = (bench.rig.camera.height, bench.rig.camera.width)
        if bench.waves == "rays":
            out = np.zeros(shape, np.float32)
            _, oy, ox = cells.energy.shape
            _, by, bx = cells.wanted.shape
            wanted = cells.wanted[:, np.arange(oy) * by // oy][:, :, np.arange(ox) * bx // ox]
            out[pixels[:, 0], pixels[:, 1]] = (cells.energy * wanted).sum(axis=(1, 2))
            return out
        seen = contrast if bench.waves == "speckle" else 0.0
        seed = int(seed64(bench.seed, bench.beams.index(beam)))
        return speckle.imaged(pixels, cells, shape, bench.grain, seed, seen)

    def _cells(
        self, T: Pose, beam: Beam, seconds: float, start: float
    ) -> tuple[Ints, tuple[Singles, Keys, Singles], Ints]:
        """Pixels (n, 2) near the stripe, of their cells what `Cells` has first, and the bodies that
        the blocks (n, by, bx) of cells see.
        """
        from turnscan.simulate import _rays, _shade
        from turnscan.simulate._fading import powers_of_e

        bench, tri = self.bench, self._tri
        sheet = sheet_numbers(bench.rig.sheet(beam.name))
        shape_of = (beam.waist, beam.waist_distance, beam.rayleigh, _REACH, *beam.aim.tolist())
        R, t = T.rotation, T.translation
        numbers = np.flatnonzero(self._band(T, beam, sheet, shape_of)).astype(np.int32)
        pixels = np.stack(np.divmod(numbers, np.int32(bench.rig.camera.width)), axis=-1)
        cells = _RAY_CELLS if bench.waves == "rays" else speckle.oversampling(bench.grain)
        blocks = (min(_RAY_BLOCKS[0], cells[0]), min(_RAY_BLOCKS[1], cells[1]))
        directions = _rays.rays(numbers, self.view.field, *blocks, R, False)
        eye, apex = T.inverse().translation, T.inverse().apply(beam.apex)
        face = self._caster.first_hits(eye, directions)
        points, normals = _rays.surface(
            face, directions, eye[None],
            tri.vertices, tri.faces, tri.flat_normals, tri.corner_normals,
        )  # fmt: skip
        source = tuple(beam.apex.tolist())
        near = _rays.near_sheet(points, normals, R, t, source, sheet, shape_of, 1.5)
        k = np.flatnonzero(near)
        lit = np.zeros(len(face), np.bool_)
        lit[k] = self._caster.visible(points[k], tri.flat_normals[face[k]], apex)
        printed = any(b.texture is not None for b in bench.scene.bodies)
        spots = np.empty((len(pixels) if printed else 0, *cells, 3))
        energy, keys, cycles = _shade.glow(
            _shade.Seen(pixels, self.view.field, face, normals, lit), blocks, cells, (R, t),
            _shade.Bodies(
                tri.vertices, tri.faces, tri.flat_normals, tri.body, self._paints(beam)
            ),
            _shade.Illumination(
                source, sheet, shape_of, self._fan(beam), self._optics(beam, seconds),
            ),
            self._profile(beam, seconds, start), self._roughness(beam, apex, eye), spots,
            powers_of_e(),
        )  # fmt: skip
        body = np.where(face >= 0, tri.body[face], -1).reshape(-1, *blocks)
        for i, b in enumerate(bench.scene.bodies):
            if b.texture is not None:
                whose = body[:, np.arange(cells[0]) * blocks[0] // cells[0]]
                whose = whose[:, :, np.arange(cells[1]) * blocks[1] // cells[1]]
                own = (whose == i) & (energy > 0)
                energy[own] *= b.texture.at(b.T_table_part.inverse().apply(spots[own]))
        return pixels, (energy, keys, cycles), body

    def _roughness(self, beam: Beam, laser: Floats, lens: Floats) -> Roughness:
        from turnscan.simulate._grain_kernels import Roughness

        bench = self.bench
        pitch = (bench.sensor.pitch_y, bench.sensor.pitch_x)
        size = speckle.cell_size(bench.grain, pitch, bench.lens.magnification)
        wanted = size if bench.waves == "speckle" else 0.0
        places = tuple(laser.tolist()), tuple(lens.tolist())
        return Roughness(wanted, *places, 1.0 / beam.wavelength)

    def _band(self, T: Pose, beam: Beam, sheet: Numbers, shape_of: Numbers) -> Bools:
        """(H, W) True near the stripe: where the sheet meets triangles that face laser and eye."""
        from turnscan.simulate import _cut

        camera = self.bench.rig.camera
        tri = self._tri
        corners, starts = _cut.sheet_polygons(
            tri.corners, tri.flat_normals, tri.boxes, T.rotation, T.translation,
            tuple(beam.apex.tolist()), sheet, shape_of,
        )  # fmt: skip
        mask = np.zeros((camera.height, camera.width), np.bool_)
        if len(corners):
            pad = 1.0 if self.bench.waves == "rays" else 1.0 + max(self.bench.grain)
            _cut.fill(camera.project(corners), starts, pad + self._defocus(corners), mask)
        return mask

    def _defocus(self, points: Floats) -> float:
        """Largest radius of the blur circle over the points (n, 3), camera frame, pixels."""
        lens = self.bench.lens
        z = points[:, 2]
        blur = np.abs(lens.magnification * (lens.focus / z - 1.0)) * lens.focal / lens.f_number
        pitch = min(self.bench.sensor.pitch_x, self.bench.sensor.pitch_y)
        if self.bench.rig.camera.tilt.any():
            return 3.0
        return float(blur.max()) / (2.0 * pitch)

    def _paints(self, beam: Beam) -> Floats:
        return np.array(
            [
                [m.at(beam.wavelength), PATTERNS.index(m.pattern), m.pitch, m.pattern_ratio]
                + [m.specular, m.roughness]
                for m in (b.material for b in self.bench.scene.bodies)
            ],
            dtype=np.float64,
        )

    def _fan(self, beam: Beam) -> Numbers:
        across = np.cross(self.bench.rig.sheet(beam.name).normal, beam.aim)
        return (beam.power, math.tan(beam.half_angle), *across.tolist())

    def _profile(self, beam: Beam, seconds: float, start: float) -> Floats:
        s = np.linspace(-1.0, 1.0, _PROFILE_BINS + 1)
        line = self.bench.sensor.line_time
        if beam.profile != "galvo" or not line:
            return np.atleast_2d(beam.share(s, start, seconds))
        opened = start + line * np.arange(self.bench.rig.camera.height)[:, None]
        return beam.share(s, opened, seconds)

    def _optics(self, beam: Beam, seconds: float) -> Numbers:
        bench, lens = self.bench, self.bench.lens
        scale = bench.electrons_per_radiance(beam.wavelength, seconds)
        tx, ty = bench.rig.camera.tilt
        # Image distance over the picture: the sensor is the plane r·x = r_z v with r the last row
        # of the camera's tilt rotation R_y(τy) R_x(τx).
        slopes = (math.tan(ty) / math.cos(tx), -math.tan(tx))
        wide = lens.focal / lens.f_number
        sensor = bench.sensor
        blur = (wide / sensor.pitch_x, wide / sensor.pitch_y)
        return (scale, *blur, lens.focal, lens.focus, *slopes)

    def _spread(self, light: Singles, halo: tuple[float, float], T: Pose) -> Singles:
        """Let a share of the light come out of the body elsewhere: an exponential halo."""
        import cv2

        share, length = halo
        camera = self.bench.rig.camera
        scale = length / float(T.translation[2])
        ax, ay = scale * camera.fx, scale * camera.fy
        rx, ry = math.ceil(5 * ax), math.ceil(5 * ay)
        x, y = np.arange(-rx, rx + 1) / ax, np.arange(-ry, ry + 1) / ay
        kernel = np.exp(-np.hypot(x[None], y[:, None]))
        kernel /= kernel.sum()
        out = np.zeros_like(light)
        reached = _around(light, ry, rx)  # elsewhere it stays dark: a stripe is a small part
        near = light[reached]
        around = cv2.filter2D(near, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT)
        around = np.maximum(around, 0.0) * (self.view.seen(T) >= 0).reshape(light.shape)[reached]
        out[reached] = (1 - share) * near + share * around
        return out


def _around(light: Singles, rows: int, columns: int) -> tuple[slice, slice]:
    """The part of a picture (H, W) that is lit, and so many pixels beyond it."""
    lit = [np.flatnonzero(light.any(axis=axis)) for axis in (1, 0)]
    ends = [(int(k[0]), int(k[-1]) + 1) if len(k) else (0, 0) for k in lit]
    (r0, r1), (c0, c1) = ends
    return slice(max(r0 - rows, 0), r1 + rows), slice(max(c0 - columns, 0), c1 + columns)


def sheet_numbers(sheet: LaserSheet) -> Numbers:
    """(15,): normal, centre, the two axes in the sheet, the bow; as the kernels take them."""
    rows = np.stack([sheet.normal, sheet.centre, *sheet.axes, sheet.bow])
    return tuple(rows.ravel().tolist())
