"""What the camera sees besides the laser: which surface each pixel shows, and the room's light."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Caster
from turnscan.rig import Pose
from turnscan.simulate._bench import Bench
from turnscan.simulate._scene import PATTERNS, Triangles

Singles = npt.NDArray[np.float32]

_VISIBLE_LIGHT = 550e-6
_PRINT_SAMPLES = 4
"""Rays per pixel and direction where a print is seen. Their grid is sheared: an upright one moved
edges along the pixels' rows by up to 0.02 px (three each way), in all pictures of a board alike."""
_STRIP = 64
_SHADOW_CELLS = 128
"""Cells of the grid of shadows along its longer side."""
_NO_SHADOWS = (np.zeros((3, 3)), (0.0, 0.0), 0.0, np.zeros((0, 0), np.float32))
"""Where there is no lamp."""
_AIRY_SIGMA = 0.42
"""rms width of the Gaussian nearest to the Airy disc, in λN'."""


class View:
    """The pixels of one camera and the surfaces behind them; the last pose is held."""

    def __init__(self, bench: Bench, tri: Triangles, caster: Caster) -> None:
        self.bench, self._tri, self._caster = bench, tri, caster
        self._ambient: tuple[bytes, Singles] | None = None
        self._last: tuple[bytes, Ints] | None = None
        self._shadow: tuple[bytes, Shadows] | None = None

    @cached_property
    def field(self) -> Floats:
        """(H + 1, W + 1, 2): undistorted image coordinates of the pixels' outer corners."""
        camera = self.bench.rig.camera
        u = np.arange(camera.width + 1) - 0.5
        rows = [
            camera.normalised(np.stack([u, np.full_like(u, v - 0.5)], axis=-1))
            for v in range(camera.height + 1)
        ]
        return np.stack(rows)

    def seen(self, T: Pose) -> Ints:
        """(H·W,) the face that each pixel's middle sees, −1 for none; held for the next frame."""
        from turnscan.simulate import _rays

        key = T.rotation.tobytes() + T.translation.tobytes()
        if self._last is None or self._last[0] != key:
            camera, bounds = self.bench.rig.camera, self.within(T)
            face = np.full((camera.height, camera.width), -1, np.int32)
            numbers = np.arange(face.size, dtype=np.int32).reshape(face.shape)[bounds]
            seen = np.full(numbers.shape, -1, np.int32)
            unsure = np.flatnonzero(self._drawn(T, (bounds[0].start, bounds[1].start), seen))
            eye, strip = T.inverse().translation, _STRIP * camera.width
            for start in range(0, len(unsure), strip):
                k = unsure[start : start + strip]
                directions = _rays.rays(numbers.ravel()[k], self.field, 1, 1, T.rotation, False)
                seen.ravel()[k] = self._caster.first_hits(eye, directions)
            face[bounds] = seen
            self._last = (key, face.ravel())
        return self._last[1]

    def _drawn(self, T: Pose, place: tuple[int, int], seen: Ints) -> Bools:
        """Fill ``seen`` (h, w), which begins at a row and column, with the triangles that a pinhole
        sees; True where only a ray can tell."""
        from turnscan.simulate import _raster

        camera, tri = self.bench.rig.camera, self._tri
        at = np.empty(tri.vertices.shape, np.float32)
        lens = (camera.fx, camera.fy, camera.cx, camera.cy)
        bent = bool(camera.distortion.any() or camera.tilt.any())
        if bent or not _raster.projected(tri.vertices, T.rotation, T.translation, lens, at):
            return np.ones(seen.shape, np.bool_)
        margin = _raster.NEAR * max(camera.fx, camera.fy)
        eye = tuple(T.inverse().translation.tolist())
        return _raster.nearest(at, tri.faces, tri.boxes[0], eye, tri.closed, place, margin, seen)

    def within(self, T: Pose) -> tuple[slice, slice]:
        """Rows and columns of the rectangle round all bodies."""
        camera = self.bench.rig.camera
        uv = camera.project(T.apply(self._box))
        size = np.array([camera.width, camera.height])
        if np.isnan(uv).any():
            first, last = np.zeros(2, int), size
        else:
            first = np.clip(np.floor(uv.min(axis=0)) - 2, 0, size).astype(int)
            last = np.clip(np.ceil(uv.max(axis=0)) + 3, 0, size).astype(int)
        return slice(first[1], last[1]), slice(first[0], last[0])

    @cached_property
    def _box(self) -> Floats:
        """(125, 3) points in and on the box round all bodies, object frame."""
        v = self._tri.vertices
        low, high = v.min(axis=0), v.max(axis=0)
        t = np.linspace(0.0, 1.0, 5)
        unit = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3)
        return np.asarray(unit * (high - low) + low)

    def room_light(self, T: Pose) -> Singles:
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
        places = np.flatnonzero(self.seen(T) >= 0)
        strip = _STRIP * camera.width
        body, points = np.empty(len(places), np.int32), np.empty((len(places), 3))
        for start in range(0, len(places), strip):
            rows = slice(start, start + strip)
            k = places[rows]
            out[k], body[rows], points[rows] = self._lamp_pixels(T, k, 1)
        detailed = self._detailed(places, body, points, out[places, 0])
        for start in range(0, len(detailed), strip):
            k = detailed[start : start + strip]
            out[k] = self._lamp_pixels(T, k, _PRINT_SAMPLES)[0]
        picture = out.reshape(shape)
        if bench.waves != "rays":
            soft = [max(_AIRY_SIGMA * g, 0.05) for g in bench.grain]
            picture = cv2.GaussianBlur(picture, (0, 0), soft[1], sigmaY=soft[0]).reshape(shape)
        return picture

    def _detailed(
        self, places: npt.NDArray[np.intp], body: Ints, points: Floats, light: Singles
    ) -> npt.NDArray[np.intp]:
        """Those of the pixels ``places`` that see a print whose tone or light changes there."""
        from turnscan.simulate._print import plain

        camera, out = self.bench.rig.camera, [places[:0]]
        for i, b in enumerate(self.bench.scene.bodies):
            if b.texture is not None:
                own = np.flatnonzero(body == i)
                there = b.T_table_part.inverse().apply(points[own])
                size = (camera.height, camera.width)
                alike = plain(b.texture, there, places[own], light[own], size)
                out.append(places[own[~alike]])
        return np.concatenate(out)

    def _lamp_pixels(
        self, T: Pose, k: npt.NDArray[np.intp], fine: int
    ) -> tuple[Singles, Ints, Floats]:
        """Electrons per second of some pixels, ``fine`` × ``fine`` rays each, and the body and the
        point that the first ray of each meets."""
        from turnscan.simulate import _rays

        bench, tri = self.bench, self._tri
        colours = 3 if bench.sensor.bayer else 1
        directions = _rays.rays(k.astype(np.int32), self.field, fine, fine, T.rotation, fine > 1)
        eye = T.inverse().translation
        face = self.seen(T)[k] if fine == 1 else self._caster.first_hits(eye, directions)
        points, normals = _rays.surface(
            face, directions, eye[None],
            tri.vertices, tri.faces, tri.flat_normals, tri.corner_normals,
        )  # fmt: skip
        scene = bench.scene
        light = self._irradiance(face, points, normals, T)
        dim = scene.background * scene.sky / math.pi
        body = np.where(face >= 0, tri.body[face], -1)
        radiance = light[:, None] * self._albedo(points, body, colours) / math.pi
        radiance = np.where(np.isnan(points[:, :1]), np.float32(dim), radiance.astype(np.float32))
        # With z = 1 in the camera the cosine of the field angle is 1 over the ray's length.
        field4 = np.einsum("ij,ij->i", directions, directions) ** -2
        scale = bench.electrons_per_radiance(_VISIBLE_LIGHT, 1.0) * bench.sensor.efficiency
        radiance *= np.float32(scale) * field4[:, None]
        if fine > 1:
            radiance = radiance.reshape(len(k), fine * fine, colours).mean(axis=1)
        each = slice(None, None, fine * fine)
        return np.asarray(radiance, dtype=np.float32), body[each], points[each]

    def _irradiance(self, face: Ints, points: Floats, normals: Floats, T: Pose) -> Floats:
        """W/mm² of sky and lamp on points of faces, object frame; 0 where there is no face."""
        from turnscan.simulate import _raster

        scene = self.bench.scene
        table_to_object = T.inverse() @ self.bench.rig.T_camera_table
        lamp = table_to_object.turn(scene.lamp_from) if scene.lamp > 0 else np.zeros(3)
        up = table_to_object.turn((0.0, 0.0, 1.0))
        shadows = self._shadows(lamp).heights if scene.lamp > 0 else _NO_SHADOWS
        sky, facing, asked = _raster.lamp_light(
            face, points, normals, tuple(up.tolist()), tuple(lamp.tolist()), shadows
        )
        at = np.flatnonzero(asked)
        if len(at):
            own = points[at]
            facing[at] *= self._caster.visible(
                own, self._tri.flat_normals[face[at]], own + 2000.0 * lamp
            )
        return np.asarray(scene.sky * sky + scene.lamp * facing)

    def _shadows(self, lamp: Floats) -> Shadows:
        """Where shadows may fall in the light from a direction (3,), held for the next call."""
        key = lamp.tobytes()
        if self._shadow is None or self._shadow[0] != key:
            self._shadow = (key, Shadows(self._tri, self._box, lamp))
        return self._shadow[1]

    def _albedo(self, points: Floats, body: Ints, colours: int) -> Floats:
        """(n, 1 or 3) reflectance of points (n, 3), object frame."""
        from turnscan.simulate import _shade

        bodies = self.bench.scene.bodies
        full = np.array([b.material.albedo for b in bodies] + [(0.0, 0.0, 0.0)])
        shown = (full if colours == 3 else full.mean(axis=1, keepdims=True))[body]
        for i, b in enumerate(bodies):
            m = b.material
            if m.pattern == "none" and b.texture is None:
                continue
            own = np.flatnonzero((body == i) & ~np.isnan(points[:, 0]))
            if m.pattern != "none":
                paint = np.array([1.0, PATTERNS.index(m.pattern), m.pitch, m.pattern_ratio])
                shown[own] *= _shade.paint_all(points[own], paint)[:, None]
            if b.texture is not None:
                tone = b.texture.at(b.T_table_part.inverse().apply(points[own]))
                shown[own] *= tone[:, None]
        return np.asarray(shown)


class Shadows:
    """Where a body may keep a far lamp's light off, by a grid across the light."""

    def __init__(self, tri: Triangles, box: Floats, lamp: Floats) -> None:
        """``box`` (n, 3) points round all bodies; ``lamp`` (3,) unit vector; object frame."""
        from turnscan.simulate import _raster

        across = np.cross(lamp, np.eye(3)[np.argmin(np.abs(lamp))])
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(lamp, across), lamp])
        ends = box @ axes[:2].T
        low, size = ends.min(axis=0) - 1.0, np.ptp(ends, axis=0) + 2.0
        # Only of closed bodies is it known that nothing else can stand on the way.
        least = -np.inf if tri.closed else np.inf
        per_mm = _SHADOW_CELLS / float(size.max())
        heights = np.full(np.ceil(size * per_mm).astype(int) + 1, least, np.float32)
        self.heights = (axes, (float(low[0]), float(low[1])), per_mm, heights)
        """As `_raster.lamp_light` takes them: of points outside all bodies."""
        if tri.closed:
            _raster.shadow_heights(
                tri.vertices, tri.faces, tri.flat_normals, tri.boxes[0], *self.heights
            )
