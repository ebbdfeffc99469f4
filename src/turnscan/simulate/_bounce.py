"""Laser light that meets a second surface: diffuse inter-reflection and mirror ghosts.

Diffuse: the lit line becomes a row of small lamps (Keller, Instant radiosity, 1997), each of which
lights what it sees. Mirror: laser rays are reflected by glossy bodies and followed to where they
land. One bounce only; light from the first surface straight to the camera is not counted here.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.mesh import Caster
from turnscan.rig import Camera, Pose
from turnscan.simulate._beam import Beam, Lens
from turnscan.simulate._scene import Body, Triangles

Singles = npt.NDArray[np.float32]

_LAMPS = 96
_STRIDE = 8
"""Pixels between the points at which the diffuse light is computed; it varies slowly."""
_NEAREST = 1.5
"""mm: closer than this a lamp counts as this far, about the distance between two lamps."""
_FAINT = 0.05
"""Photons per pixel below which a lamp is not asked whether it is seen."""
_MIRROR_RAYS = (2048, 5)


class Bounces:
    """Second surfaces of one scene under one laser, for one pose of the object."""

    def __init__(
        self, tri: Triangles, caster: Caster, bodies: tuple[Body, ...], T: Pose, beam: Beam
    ) -> None:
        self._tri, self._caster, self._bodies = tri, caster, bodies
        self._T, self._beam = T, beam

    def diffuse(
        self,
        camera: Camera,
        seen: Ints,
        within: tuple[slice, slice],
        share: Floats,
        across: Floats,
        scale: float,
    ) -> Singles:
        """Photons (H, W) of light scattered once on its way.

        ``seen`` (H·W,): face behind each pixel; ``within``: rows and columns outside which there is
        none; ``share`` and ``across``: the fan's profile over
        (−1, 1) and its unit vector, camera frame; ``scale``: photons per radiance.
        """
        import cv2

        from turnscan.simulate import _shade

        H, W = camera.height, camera.width
        lamps, lamp_normals, flux = self._lamps(share, across)
        rows, columns = (np.minimum(np.arange(0, n, _STRIDE) + _STRIDE // 2, n - 1) for n in (H, W))
        k = (rows[:, None] * W + columns).ravel()
        there = np.flatnonzero(seen[k] >= 0)
        if not len(lamps) or not len(there):
            return np.zeros((H, W), np.float32)
        pixels = np.stack(np.divmod(k[there], W)[::-1], axis=-1)
        face = seen[k[there]]
        points, normals = self._surface(
            self._T.inverse().translation, self._T.inverse().turn(camera.rays(pixels)), face
        )
        albedo = self._albedo(face)
        weights = _shade.exchange(points, normals, lamps, lamp_normals, flux, _NEAREST)
        light = weights * (albedo * scale / math.pi)[:, None]
        i, j = np.nonzero(light > _FAINT / _LAMPS)
        clear = self._caster.visible(points[i], self._tri.flat_normals[face[i]], lamps[j])
        coarse = np.zeros(len(k), np.float32)
        np.add.at(coarse, there[i], (light[i, j] * clear).astype(np.float32))
        covered = np.zeros(len(k), np.float32)
        covered[there] = 1.0
        # Of the grid only what lies round the bodies is enlarged, with a point more on each side.
        first = [s.start // _STRIDE for s in within]
        ends = [-(-s.stop // _STRIDE) for s in within]
        around = tuple(slice(max(a - 1, 0), b + 1) for a, b in zip(first, ends, strict=True))
        grids = [a.reshape(len(rows), len(columns))[around] for a in (coarse, covered)]
        size = (grids[0].shape[1] * _STRIDE, grids[0].shape[0] * _STRIDE)
        at = [s.start * _STRIDE for s in around]
        own = tuple(slice(s.start - a, s.stop - a) for s, a in zip(within, at, strict=True))
        glow, cover = (cv2.resize(g, size, interpolation=cv2.INTER_LINEAR)[own] for g in grids)
        inside = seen.reshape(H, W)[within] >= 0
        out = np.zeros((H, W), np.float32)
        np.divide(glow, np.maximum(cover, np.float32(0.05)), out=out[within], where=inside)
        return out

    def mirrored(self, camera: Camera, lens: Lens, across: Floats, per_watt: float) -> Singles:
        """Photons (H, W) of laser light that a glossy body mirrors onto another place.

        ``per_watt``: photons per watt that reaches the sensor.
        """
        import cv2

        out = np.zeros((camera.height, camera.width), np.float32)
        gloss = np.array([b.material.specular for b in self._bodies])
        if not gloss.any():
            return out
        origin, ways, flux = self._bundle(across)
        face = self._caster.first_hits_between(origin, ways)
        k = np.flatnonzero(face >= 0)
        k = k[gloss[self._tri.body[face[k]]] > 0]
        points, normals = self._surface(origin[k], ways[k], face[k])
        met = ~np.isnan(points[:, 0])
        k, points, normals = k[met], points[met], normals[met]
        if not len(k):
            return out
        d = ways[k] / np.linalg.norm(ways[k], axis=1, keepdims=True)
        cosine = -(d * normals).sum(axis=1)
        F0 = gloss[self._tri.body[face[k]]]
        flux = flux[k] * (F0 + (1 - F0) * (1 - cosine.clip(0, 1)) ** 5)
        onward = d + 2 * cosine[:, None] * normals
        start = points + 2e-3 * self._tri.flat_normals[face[k]]
        second = self._caster.first_hits_between(start, onward)
        m = np.flatnonzero((second >= 0) & (cosine > 0))
        if not len(m):
            return out
        landed, there = self._surface(start[m], onward[m], second[m])
        met = ~np.isnan(landed[:, 0])
        m, landed, there = m[met], landed[met], there[met]
        eye = self._T.inverse().translation
        way = eye - landed
        D = np.linalg.norm(way, axis=1)
        facing = (way * there).sum(axis=1) / D
        clear = self._caster.visible(landed, self._tri.flat_normals[second[m]], eye) & (facing > 0)
        seen = self._T.apply(landed)
        aperture = math.pi / 4 * (lens.focal / lens.f_number) ** 2 * seen[:, 2] / D
        photons = flux[m] * self._albedo(second[m]) / math.pi * facing * aperture / D**2
        photons = np.where(clear, photons * per_watt, 0.0)
        uv = camera.project(seen)
        good = np.flatnonzero((photons > 0) & np.isfinite(uv).all(axis=1))
        u, v = np.rint(uv[good, 0]).astype(int), np.rint(uv[good, 1]).astype(int)
        ok = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        np.add.at(out, (v[ok], u[ok]), photons[good][ok].astype(np.float32))
        if not ok.any():
            return out
        rough = float(np.mean([b.material.roughness for b in self._bodies if b.material.specular]))
        spread = 1.0 + 40.0 * rough**2
        # Only as far round the light as the filter reaches, twice; beyond it there is none.
        far = 2 * math.ceil(4.0 * spread + 1.0)
        part = out[
            max(int(v[ok].min()) - far, 0) : int(v[ok].max()) + far + 1,
            max(int(u[ok].min()) - far, 0) : int(u[ok].max()) + far + 1,
        ]
        part[:] = cv2.GaussianBlur(part.copy(), (0, 0), spread)
        return out

    def _lamps(self, share: Floats, across: Floats) -> tuple[Floats, Floats, Floats]:
        """Where rays across the fan land: points, normals, and the power each scatters."""
        s = (np.arange(_LAMPS) + 0.5) * (2.0 / _LAMPS) - 1.0
        beam, back = self._beam, self._T.inverse()
        way = beam.aim + s[:, None] * math.tan(beam.half_angle) * across
        ways = back.turn(way)
        face = self._caster.first_hits(back.apply(beam.apex), ways)
        k = np.flatnonzero(face >= 0)
        points, normals = self._surface(back.apply(beam.apex), ways[k], face[k])
        power = beam.power * np.interp(s[k], np.linspace(-1, 1, len(share)), share) * 2.0 / _LAMPS
        flux = power * self._albedo(face[k])
        good = ~np.isnan(points[:, 0])
        return points[good], normals[good], flux[good]

    def _bundle(self, across: Floats) -> tuple[Floats, Floats, Floats]:
        """Laser rays across and through the sheet: origins, directions, watts."""
        n, layers = _MIRROR_RAYS
        beam, back = self._beam, self._T.inverse()
        s = (np.arange(n) + 0.5) * (2.0 / n) - 1.0
        share = beam.share(s, 0.0, 1.0)
        # Layers of equal power through the Gaussian thickness, parallel to the sheet.
        depth = beam.waist / 2 * np.array([-1.2816, -0.5244, 0.0, 0.5244, 1.2816])
        normal = np.cross(beam.aim, across)
        way = beam.aim + s[:, None] * math.tan(beam.half_angle) * across
        origin = beam.apex + depth[:, None, None] * normal + 0 * way
        power = np.broadcast_to(beam.power * share * (2.0 / n) / layers, (layers, n))
        ways = np.broadcast_to(back.turn(way), origin.shape)
        return back.apply(origin.reshape(-1, 3)), ways.reshape(-1, 3), power.ravel()

    def _surface(self, origins: Floats, directions: Floats, face: Ints) -> tuple[Floats, Floats]:
        """Points and smooth normals where rays from one point (3,) or many (n, 3) met faces."""
        from turnscan.simulate import _rays

        t = self._tri
        points, normals = _rays.surface(
            face, np.ascontiguousarray(directions), np.atleast_2d(origins),
            t.vertices, t.faces, t.flat_normals, t.corner_normals,
        )  # fmt: skip
        return points, normals

    def _albedo(self, face: Ints) -> Floats:
        tones = np.array([b.material.at(self._beam.wavelength) for b in self._bodies])
        return np.asarray(tones[self._tri.body[face]])
