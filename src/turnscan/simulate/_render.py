"""Camera pictures of a scene under a laser sheet, rendered forwards with physical units.

For each pixel near the stripe, rays run from the lens into the scene; where they meet a surface the
laser's irradiance, its shadow and the surface's reflectance give the light that comes back
(ALGORITHMS: irradiance of a Gaussian sheet, GGX, thin lens). Nothing here inverts what
`turnscan.stripes` or `turnscan.points` do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Image, Ints
from turnscan.errors import InputError
from turnscan.rig import LaserSheet, Pose, Rig
from turnscan.simulate import _speckle as speckle
from turnscan.simulate._beam import Beam, Lens
from turnscan.simulate._cast import Caster
from turnscan.simulate._motion import Motion
from turnscan.simulate._random import seed64
from turnscan.simulate._scene import PATTERNS, Scene, Triangles, triangles
from turnscan.simulate._sensor import Sensor, expose

Singles = npt.NDArray[np.float32]
Waves = Literal["speckle", "diffraction", "rays"]

_PLANCK_C = 6.62607015e-34 * 2.99792458e11
"""J mm: energy of a photon times its wavelength."""
_REACH = 2.2
"""Radii of the sheet within which its light is rendered (4.4 σ: 6e-5 of the peak)."""
_RAY_CELLS = (4, 8)
_RAY_BLOCKS = (2, 2)
_PROFILE_BINS = 2048
_VISIBLE_LIGHT = 550e-6
_PRINT_SAMPLES = 3
"""Rays per pixel and direction where a print is seen."""
_STRIP = 64
_AIRY_SIGMA = 0.42
"""rms width of the Gaussian nearest to the Airy disc, in λN'."""


@dataclass(frozen=True)
class Bench:
    """A rig that isn't there: its true geometry, its light, its camera, and what stands on it."""

    rig: Rig
    """The truth; a calibration may find something else."""
    beams: tuple[Beam, ...]
    """One per laser sheet of the rig, of the same name."""
    lens: Lens
    sensor: Sensor
    scene: Scene
    motion: Motion = field(default_factory=Motion)
    waves: Waves = "speckle"
    """speckle: wave-true; diffraction: the lens's blur without speckle; rays: neither."""
    modes: float = 1.0
    """Mutually incoherent wavelengths of the laser: they average the speckle."""
    noise: bool = True
    """False: the sensor counts without noise, dark current or fixed pattern, and only rounds."""
    seed: int = 0

    def __post_init__(self) -> None:
        for b in self.beams:
            sheet = self.rig.sheet(b.name)
            if abs(float(sheet.normal @ b.aim)) > 1e-6:
                raise ValueError(f"Bench.beams: {b.name} does not aim along its sheet")

    @property
    def grain(self) -> tuple[float, float]:
        """Speckle grain λN' in pixel heights and widths, of the first laser."""
        pitch = (self.sensor.pitch_y, self.sensor.pitch_x)
        w = self.beams[0].wavelength
        return speckle.grain(w, self.lens.f_number, self.lens.magnification, pitch)

    def electrons_per_radiance(self, wavelength: float, seconds: float) -> float:
        """Photons that a pixel on the axis collects per radiance, W/(mm² sr)."""
        n, m = self.lens.f_number, self.lens.magnification
        area = self.sensor.pitch_x * self.sensor.pitch_y
        power = math.pi / (4.0 * n * n * (1.0 + m) ** 2) * area * self.lens.transmission
        return power * seconds * wavelength / _PLANCK_C


class Renderer:
    """Renders the pictures of one bench. Holds nothing but what the bench implies."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self._tri: Triangles = triangles(bench.scene.bodies)
        self._caster = Caster(self._tri.vertices, self._tri.faces)
        self._ambient: tuple[bytes, Singles] | None = None
        self._view: tuple[bytes, Ints] | None = None

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
        total = self._lamp_light(T) * np.float32(seconds)
        for name in sorted(lit):
            beam = next(b for b in self.bench.beams if b.name == name)
            light = self.laser_light(T, beam, seconds, start)
            response = self.bench.sensor.response(beam.wavelength).astype(np.float32)
            total = total + light[..., None] * response
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
        pixels, energy, points, body = self._cells(T, beam, seconds, start)
        camera = self.bench.rig.camera
        shape = (camera.height, camera.width)
        out = np.zeros(shape, np.float32)
        if not len(pixels):
            return out
        for contrast, halo, members in self._groups():
            ours = np.zeros(len(self.bench.scene.bodies) + 1, np.float32)  # the last: no body, −1
            ours[members] = 1.0
            own = energy * ours[body]
            lit = np.flatnonzero(own.any(axis=(1, 2)))
            if not len(lit):
                continue
            direct = self._imaged(pixels[lit], own[lit], points[lit], contrast, beam, T)
            out += direct if halo is None else self._spread(direct, halo, T)
        return out

    def _groups(self) -> list[tuple[float, tuple[float, float] | None, list[int]]]:
        """Bodies that share (speckle contrast, (halo share, halo length))."""
        groups: dict[tuple[float, tuple[float, float] | None], list[int]] = {}
        for i, b in enumerate(self.bench.scene.bodies):
            m = b.material
            halo = (m.halo, m.halo_length) if m.halo > 0 else None
            contrast = speckle.contrast(m.polarisation, self.bench.modes)
            groups.setdefault((contrast, halo), []).append(i)
        return [(c, h, members) for (c, h), members in groups.items()]

    def _imaged(
        self, pixels: Ints, energy: Singles, points: Floats, contrast: float, beam: Beam, T: Pose
    ) -> Singles:
        """The cells through the lens: photons (H, W)."""
        bench = self.bench
        shape = (bench.rig.camera.height, bench.rig.camera.width)
        if bench.waves == "rays":
            out = np.zeros(shape, np.float32)
            out[pixels[:, 0], pixels[:, 1]] = energy.sum(axis=(1, 2))
            return out
        pitch = (bench.sensor.pitch_y, bench.sensor.pitch_x)
        size = speckle.cell_size(bench.grain, pitch, bench.lens.magnification)
        keys = speckle.cell_keys(points, size)
        phase = None
        if bench.waves == "speckle":
            back = T.inverse()
            laser, lens = back.apply(beam.apex), back.translation
            phase = speckle.path_phase(points, size, laser, lens, beam.wavelength)
        seen = contrast if bench.waves == "speckle" else 0.0
        seed = int(seed64(bench.seed, bench.beams.index(beam)))
        return speckle.speckled(
            pixels, energy, keys, shape, bench.grain, seed, contrast=seen, phase=phase
        )

    def _cells(
        self, T: Pose, beam: Beam, seconds: float, start: float
    ) -> tuple[Ints, Singles, Floats, Ints]:
        """Lit pixels (n, 2), photons of their cells (n, oy, ox), the cells' points and bodies."""
        from turnscan.simulate import _shade

        bench, tri = self.bench, self._tri
        sheet = sheet_rows(bench.rig.sheet(beam.name))
        shape_of = np.array(
            [beam.waist, beam.waist_distance, beam.rayleigh, _REACH, *beam.aim], dtype=np.float64
        )
        R, t = T.rotation, T.translation
        pixels = np.argwhere(self._band(T, beam, sheet, shape_of)).astype(np.int32)
        cells = _RAY_CELLS if bench.waves == "rays" else speckle.oversampling(bench.grain)
        blocks = (min(_RAY_BLOCKS[0], cells[0]), min(_RAY_BLOCKS[1], cells[1]))
        directions = _shade.rays(pixels, self._field, *blocks, R)
        eye = T.inverse().translation
        face = self._caster.first_hits(eye, directions)
        points, normals = _shade.surface(
            face, directions, eye, tri.vertices, tri.faces, tri.flat_normals, tri.corner_normals
        )
        near = _shade.near_sheet(points, normals, R, t, beam.apex, sheet, shape_of, 1.5)
        k = np.flatnonzero(near)
        lit = np.zeros(len(face), np.bool_)
        apex = T.inverse().apply(beam.apex)
        lit[k] = self._caster.visible(points[k], tri.flat_normals[face[k]], apex)
        energy, spots = _shade.glow(
            pixels, self._field, blocks, cells, face, normals, lit, R, t,
            tri.vertices, tri.faces, tri.flat_normals, tri.body, self._paints(beam),
            beam.apex, sheet, shape_of, self._fan(beam, sheet),
            self._profile(beam, seconds, start), self._optics(beam, seconds),
        )  # fmt: skip
        body = np.where(face >= 0, tri.body[face], -1).reshape(-1, *blocks)
        body = body[:, np.arange(cells[0]) * blocks[0] // cells[0]]
        body = body[:, :, np.arange(cells[1]) * blocks[1] // cells[1]]
        for i, b in enumerate(bench.scene.bodies):
            if b.texture is not None:
                own = (body == i) & (energy > 0)
                energy[own] *= b.texture.at(b.T_table_part.inverse().apply(spots[own]))
        return pixels, energy, spots, body

    def _band(self, T: Pose, beam: Beam, sheet: Floats, shape_of: Floats) -> Bools:
        """(H, W) True near the stripe: where the sheet meets triangles that face laser and eye."""
        from turnscan.simulate import _shade

        camera = self.bench.rig.camera
        corners, starts = _shade.sheet_polygons(
            self._tri.vertices, self._tri.faces, self._tri.flat_normals,
            T.rotation, T.translation, beam.apex, sheet, shape_of,
        )  # fmt: skip
        mask = np.zeros((camera.height, camera.width), np.bool_)
        if len(corners):
            pad = 1.0 if self.bench.waves == "rays" else 1.0 + max(self.bench.grain)
            _shade.fill(camera.project(corners), starts, pad + self._defocus(corners), mask)
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

    @cached_property
    def _field(self) -> Floats:
        """(H + 1, W + 1, 2): undistorted image coordinates of the pixels' outer corners."""
        camera = self.bench.rig.camera
        u = np.arange(camera.width + 1) - 0.5
        rows = [
            camera.normalised(np.stack([u, np.full_like(u, v - 0.5)], axis=-1))
            for v in range(camera.height + 1)
        ]
        return np.stack(rows)

    def _paints(self, beam: Beam) -> Floats:
        return np.array(
            [
                [m.at(beam.wavelength), PATTERNS.index(m.pattern), m.pitch, m.pattern_ratio]
                + [m.specular, m.roughness]
                for m in (b.material for b in self.bench.scene.bodies)
            ],
            dtype=np.float64,
        )

    def _fan(self, beam: Beam, sheet: Floats) -> Floats:
        across = np.cross(sheet[0], beam.aim)
        return np.array([beam.power, math.tan(beam.half_angle), *across])

    def _profile(self, beam: Beam, seconds: float, start: float) -> Floats:
        s = np.linspace(-1.0, 1.0, _PROFILE_BINS + 1)
        line = self.bench.sensor.line_time
        if beam.profile != "galvo" or not line:
            return np.atleast_2d(beam.share(s, start, seconds))
        opened = start + line * np.arange(self.bench.rig.camera.height)[:, None]
        return beam.share(s, opened, seconds)

    def _optics(self, beam: Beam, seconds: float) -> Floats:
        bench, lens = self.bench, self.bench.lens
        scale = bench.electrons_per_radiance(beam.wavelength, seconds)
        tx, ty = bench.rig.camera.tilt
        # Image distance over the picture: the sensor is the plane r·x = r_z v with r the last row
        # of the camera's tilt rotation R_y(τy) R_x(τx).
        slopes = (math.tan(ty) / math.cos(tx), -math.tan(tx))
        wide = lens.focal / lens.f_number
        sensor = bench.sensor
        return np.array(
            [scale, wide / sensor.pitch_x, wide / sensor.pitch_y, lens.focal, lens.focus, *slopes]
        )

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
        around = cv2.filter2D(light, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT)
        around = np.maximum(around, 0.0) * (self._seen(T) >= 0).reshape(light.shape)
        return np.asarray((1 - share) * light + share * around, dtype=np.float32)

    # ---- other light -------------------------------------------------------------------------

    def _seen(self, T: Pose) -> Ints:
        """(H·W,) the face that each pixel's middle sees, −1 for none; held for the next frame."""
        from turnscan.simulate import _shade

        key = T.rotation.tobytes() + T.translation.tobytes()
        if self._view is None or self._view[0] != key:
            camera = self.bench.rig.camera
            face = np.full(camera.height * camera.width, -1, np.int32)
            places = self._within_view(T)
            strip = _STRIP * camera.width
            for start in range(0, len(places), strip):
                k = places[start : start + strip]
                directions = _shade.rays(self._places(k), self._field, 1, 1, T.rotation)
                face[k] = self._caster.first_hits(T.inverse().translation, directions)
            self._view = (key, face)
        return self._view[1]

    def _within_view(self, T: Pose) -> npt.NDArray[np.intp]:
        """Numbers of the pixels in the rectangle round all bodies."""
        camera = self.bench.rig.camera
        v = self._tri.vertices
        low, high = v.min(axis=0), v.max(axis=0)
        t = np.linspace(0.0, 1.0, 5)
        box = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3) * (high - low) + low
        uv = camera.project(T.apply(box))
        size = np.array([camera.width, camera.height])
        if np.isnan(uv).any():
            first, last = np.zeros(2, int), size
        else:
            first = np.clip(np.floor(uv.min(axis=0)) - 2, 0, size).astype(int)
            last = np.clip(np.ceil(uv.max(axis=0)) + 3, 0, size).astype(int)
        rows, columns = np.arange(first[1], last[1]), np.arange(first[0], last[0])
        return (rows[:, None] * camera.width + columns).ravel()

    def _places(self, k: npt.NDArray[np.intp]) -> Ints:
        """(n, 2) row and column of pixels given by number."""
        return np.stack(np.divmod(k, self.bench.rig.camera.width), axis=-1).astype(np.int32)

    def _lamp_light(self, T: Pose) -> Singles:
        """Electrons per second (H, W, 1 or 3) of the room's light, held for the next frame."""
        scene = self.bench.scene
        camera = self.bench.rig.camera
        colours = 3 if self.bench.sensor.bayer else 1
        if scene.sky <= 0 and scene.lamp <= 0:
            return np.zeros((camera.height, camera.width, colours), np.float32)
        key = T.rotation.tobytes() + T.translation.tobytes()
        if self._ambient is None or self._ambient[0] != key:
            self._ambient = (key, self._lamp_picture(T))
        return self._ambient[1]

    def _lamp_picture(self, T: Pose) -> Singles:
        import cv2

        camera, bench = self.bench.rig.camera, self.bench
        shape = (camera.height, camera.width, 3 if bench.sensor.bayer else 1)
        dim = bench.scene.background * bench.scene.sky / math.pi
        scale = bench.electrons_per_radiance(_VISIBLE_LIGHT, 1.0) * bench.sensor.efficiency
        out = np.full((shape[0] * shape[1], shape[2]), dim * scale, np.float32)
        printed = [i for i, b in enumerate(bench.scene.bodies) if b.texture is not None]
        places = np.flatnonzero(self._seen(T) >= 0)
        strip = _STRIP * camera.width
        for start in range(0, len(places), strip):
            k = places[start : start + strip]
            out[k], body = self._lamp_pixels(T, k, 1)
            if printed:
                # A print has detail finer than a pixel.
                k = k[np.isin(body, printed)]
                out[k], _ = self._lamp_pixels(T, k, _PRINT_SAMPLES)
        picture = out.reshape(shape)
        if bench.waves != "rays":
            soft = [max(_AIRY_SIGMA * g, 0.05) for g in bench.grain]
            picture = cv2.GaussianBlur(picture, (0, 0), soft[1], sigmaY=soft[0]).reshape(shape)
        return picture

    def _lamp_pixels(self, T: Pose, k: npt.NDArray[np.intp], fine: int) -> tuple[Singles, Ints]:
        """Electrons per second of some pixels, ``fine`` × ``fine`` rays each, and their bodies."""
        from turnscan.simulate import _shade

        bench, tri = self.bench, self._tri
        colours = 3 if bench.sensor.bayer else 1
        directions = _shade.rays(self._places(k), self._field, fine, fine, T.rotation)
        eye = T.inverse().translation
        face = self._seen(T)[k] if fine == 1 else self._caster.first_hits(eye, directions)
        hit = np.flatnonzero(face >= 0)
        points, normals = _shade.surface(
            face[hit], directions[hit], eye,
            tri.vertices, tri.faces, tri.flat_normals, tri.corner_normals,
        )  # fmt: skip
        seen = ~np.isnan(points[:, 0])
        hit, points, normals = hit[seen], points[seen], normals[seen]
        body = tri.body[face[hit]]
        light = self._irradiance(points, normals, tri.flat_normals[face[hit]], T)
        dim = bench.scene.background * bench.scene.sky / math.pi
        radiance = np.full((len(face), colours), dim, np.float32)
        shown = self._albedo(points, body, colours)
        radiance[hit] = light[:, None] * shown / math.pi
        # With z = 1 in the camera the cosine of the field angle is 1 over the ray's length.
        field4 = np.einsum("ij,ij->i", directions, directions) ** -2
        scale = bench.electrons_per_radiance(_VISIBLE_LIGHT, 1.0) * bench.sensor.efficiency
        radiance *= np.float32(scale) * field4[:, None]
        owner = np.where(face >= 0, tri.body[face], -1)[:: fine * fine]
        return radiance.reshape(len(k), fine * fine, colours).mean(axis=1), owner

    def _irradiance(self, points: Floats, normals: Floats, flat: Floats, T: Pose) -> Floats:
        """W/mm² of sky and lamp on points, object frame."""
        scene = self.bench.scene
        table_to_object = T.inverse() @ self.bench.rig.T_camera_table
        lamp = table_to_object.turn(scene.lamp_from)
        up = table_to_object.turn((0.0, 0.0, 1.0))
        light = scene.sky * (0.6 + 0.4 * (normals @ up))
        facing = normals @ lamp
        k = np.flatnonzero(facing > 0) if scene.lamp > 0 else np.empty(0, np.intp)
        if len(k):
            sees = self._caster.visible(points[k], flat[k], points[k] + 2000.0 * lamp)
            light[k] += scene.lamp * facing[k] * sees
        return np.asarray(light)

    def _albedo(self, points: Floats, body: Ints, colours: int) -> Floats:
        """(n, 1 or 3) reflectance of points (n, 3), object frame."""
        from turnscan.simulate import _shade

        out = np.zeros((len(points), colours))
        for i, b in enumerate(self.bench.scene.bodies):
            own = np.flatnonzero(body == i)
            m = b.material
            tone = np.ones(len(own))
            if m.pattern != "none":
                paint = np.array([1.0, PATTERNS.index(m.pattern), m.pitch, m.pattern_ratio])
                tone = _shade.paint_all(points[own], paint)
            if b.texture is not None:
                tone = tone * b.texture.at(b.T_table_part.inverse().apply(points[own]))
            full = np.array(m.albedo) if colours == 3 else np.array([np.mean(m.albedo)])
            out[own] = tone[:, None] * full
        return out


def sheet_rows(sheet: LaserSheet) -> Floats:
    """(5, 3): normal, centre, the two axes in the sheet, the bow; as the kernels take them."""
    e1, e2 = sheet.axes
    return np.stack([sheet.normal, sheet.centre, e1, e2, sheet.bow])
