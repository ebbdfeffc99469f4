"""The best views of each vertex: which pictures show it, how squarely, and in what colour."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Singles
from turnscan.mesh import Mesh, longest_sides, vertex_normals
from turnscan.texture._picture import TexturePicture

KEPT = 8
"""Views that a vertex keeps: noise of a third, and memory that does not grow with the pictures."""
_GRAZING = float(np.cos(np.deg2rad(75.0)))
"""Cosine of incidence below which a picture says nothing of a vertex."""
_MIXED = 2
"""px over which lens and colour filter mix what lies beside each other."""
_STEEP = 8.0
"""mm of depth for a mm across, beyond which neighbouring pixels lie on two surfaces."""
_BLEND = 5.0
"""px over which a view gains its full weight, from where an edge in depth mixes in no more."""
_FAR = 1e6
"""mm: where nothing is."""
_SPACING, _SIGMAS = 0.25, 3.0
"""Of the longest side at a vertex, and of its sigma, that it may lie behind what hides it."""


@dataclass(frozen=True, eq=False)
class Views:
    """Up to `KEPT` views of each vertex, in no order."""

    weight: Singles
    """(v, k): 0 where there is none."""
    colour: Singles
    """(v, k, 1 or 3): share of the grey scale."""
    picture: Ints
    """(v, k)."""
    normals: Floats
    """(v, 3) of the mesh, object's frame."""
    rotations: Floats
    """(p, 3, 3): object's frame → that of each picture's camera."""
    glimpsed: Bools
    """(v,) True where a picture shows the vertex, if only mixed with what lies beside it."""


def best_views(mesh: Mesh, pictures: Iterable[TexturePicture], channels: int) -> Views:
    """Look at the mesh through each picture, one at a time.

    A grey picture among coloured ones counts as grey in all ``channels``.
    """
    from turnscan.texture import _view_kernels as kernels

    n = len(mesh.vertices)
    weight, picture = np.zeros((n, KEPT), np.float32), np.full((n, KEPT), -1, np.int32)
    colour, glimpsed = np.zeros((n, KEPT, channels), np.float32), np.zeros(n, np.bool_)
    normals = np.nan_to_num(vertex_normals(mesh))
    base = _SPACING * longest_sides(mesh)
    if mesh.provenance is not None:
        base += _SIGMAS * np.nan_to_num(mesh.provenance.sigma)
    rotations = []
    for number, shot in enumerate(pictures):
        rotations.append(shot.T_camera_object.rotation)
        X = shot.T_camera_object.apply(mesh.vertices)
        uv, z = shot.camera.project(X), np.ascontiguousarray(X[:, 2])
        away = np.linalg.norm(X, axis=1)
        turned = normals @ shot.T_camera_object.rotation.T
        cosine = -np.einsum("ij,ij->i", turned, X) / np.maximum(away, 1e-9)
        cosine = np.where(cosine > _GRAZING, cosine, np.nan)
        near = np.zeros((shot.camera.height, shot.camera.width), np.float32)
        kernels.draw_nearness(uv, z, mesh.faces, near)
        cover, margin = _edges(near, shot, float(np.median(base)))
        # Some pixels aside the surface itself lies nearer, by as much as it slopes.
        side = z / min(shot.camera.fx, shot.camera.fy)
        slack = base + (_MIXED + 0.5) * side * np.minimum(1.5 / cosine, _STEEP)
        pixels = np.atleast_3d(shot.pixels).astype(np.uint16)
        pixels = np.ascontiguousarray(np.broadcast_to(pixels, (*near.shape, channels)))
        views = (weight, colour, picture, glimpsed)
        kernels.keep_best_views(
            number, uv, z, cosine, slack, pixels, float(shot.white), cover, margin, views
        )
    turned_by = np.array(rotations).reshape(-1, 3, 3)
    return Views(weight, colour, picture, normals, turned_by, glimpsed)


def _edges(near: Singles, shot: TexturePicture, base: float) -> tuple[Singles, Singles]:
    """Of each pixel (H, W) the nearest depth within `_MIXED` px of it, mm, and a weight of 0 to 1
    that rises with the distance from the next edge in depth, beyond `_MIXED` px.
    """
    import cv2

    depth = np.where(near > 0.0, 1.0 / np.maximum(near, 1.0 / _FAR), _FAR).astype(np.float32)
    wide, around = np.ones((2 * _MIXED + 1,) * 2, np.uint8), np.ones((3, 3), np.uint8)
    nearest = np.asarray(cv2.erode(depth, around), dtype=np.float32)
    farthest = np.asarray(cv2.dilate(depth, around), dtype=np.float32)
    across = 2.0 * _STEEP / min(shot.camera.fx, shot.camera.fy)
    edge = farthest - nearest > across * nearest + base
    distance = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, 3)
    cover = np.asarray(cv2.erode(depth, wide), dtype=np.float32)
    return cover, np.clip((distance - _MIXED) / _BLEND, 0.0, 1.0).astype(np.float32)
