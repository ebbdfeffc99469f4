"""Fusion of depth pictures of a part on a turntable: one surface, where it was seen, how well."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean
from turnscan.mesh import Caster
from turnscan.points import RangeGrid
from turnscan.surface.fusion import fuse, range_surfaces

PAGE = "0030-fusion-libraries.md"
VOXEL, RAMP = 0.4, 1.6
NOISE = 0.03
"""mm along the ray."""
WIDE, HIGH, FOCAL = 480, 480, 1800.0
EYE = np.array([420.0, 0.0, 130.0])
COLUMNS = [
    "faces", "off at most, mm", "rms, mm", "bias, mm", "surface missed", "grown beyond",
    "crowded / crossing", "knows sigma",
]  # fmt: skip


def _pose(angle: float) -> tuple[Any, Any]:
    """The camera's place and its axes (columns: right, down, ahead) round the part at rest."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ahead = np.array([0.0, 0.0, 45.0]) - EYE
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return turn @ EYE, turn @ np.stack([right, np.cross(ahead, right), ahead], axis=1)


def _rays() -> Any:
    u, v = np.meshgrid(np.arange(WIDE), np.arange(HIGH))
    x, y = (u - (WIDE - 1) / 2) / FOCAL, (v - (HIGH - 1) / 2) / FOCAL
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def pictures(steps: int) -> Arrays:
    """Depth along the optical axis (n, HIGH, WIDE) mm with noise, 0 for nothing, and the angles."""
    part = clean(900, 900)
    caster = Caster(part.vertices, part.faces)
    corners = part.triangles
    rng = np.random.default_rng(0)
    angles = np.arange(steps) * 2 * np.pi / steps
    depth = np.zeros((steps, HIGH, WIDE), dtype=np.float32)
    rays = _rays().reshape(-1, 3)
    for k, angle in enumerate(angles):
        eye, axes = _pose(angle)
        way = rays @ axes.T
        face = caster.first_hits(eye, way)
        t = corners[face]
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        facing = (normal * way).sum(axis=1)
        far = ((t[:, 0] - eye) * normal).sum(axis=1) / np.where(facing == 0, 1.0, facing)
        # The side alone is the part: its inside, seen through the open top, is not.
        seen = (face >= 0) & (facing < 0)
        noisy = far + rng.normal(0.0, NOISE, len(far)) / np.linalg.norm(way, axis=1)
        depth[k] = np.where(seen, noisy, 0.0).reshape(HIGH, WIDE)
    return {"depth": depth, "angles": angles}


def do_ours(given: Arrays) -> Arrays:
    """Each picture as a range grid: its columns as profiles, seen from the one place."""
    rays = _rays()
    surfaces = []
    for k, (depth, angle) in enumerate(zip(given["depth"], given["angles"], strict=True)):
        eye, axes = _pose(float(angle))
        points = eye + (rays * depth[..., None].astype(np.float64)) @ axes.T
        points[depth == 0] = np.nan
        points = points.transpose(1, 0, 2)
        there = np.isfinite(points[..., 0])
        grid = RangeGrid(
            laser=f"view {k}",
            steps=np.arange(WIDE, dtype=np.int32),
            angles=np.zeros(WIDE),
            points=points,
            sigma=np.where(there, NOISE, np.nan),
            amplitude=np.where(there, 1.0, np.nan),
            flags=np.where(there, 0, 1).astype(np.uint16),
            closed=False,
            eyes=np.tile(eye, (WIDE, 1)),
        )
        surfaces += range_surfaces(grid)
    mesh = fuse(surfaces, VOXEL, RAMP)
    sigma = mesh.provenance.sigma if mesh.provenance is not None else np.zeros(0)
    return {"vertices": mesh.vertices, "faces": mesh.faces, "sigma": sigma}


def _extrinsic(angle: float) -> Any:
    eye, axes = _pose(angle)
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = axes.T, -axes.T @ eye
    return out


def do_voxel_blocks(given: Arrays) -> Arrays:
    import open3d

    core = open3d.core
    grid = open3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (core.float32, core.float32), ((1,), (1,)), VOXEL, 16, 60_000
    )
    lens = core.Tensor(
        np.array([[FOCAL, 0, (WIDE - 1) / 2], [0, FOCAL, (HIGH - 1) / 2], [0, 0, 1.0]])
    )
    for depth, angle in zip(given["depth"], given["angles"], strict=True):
        picture = open3d.t.geometry.Image(core.Tensor(depth))
        where = core.Tensor(_extrinsic(float(angle)))
        blocks = grid.compute_unique_block_coordinates(picture, lens, where, 1.0, 1e4, RAMP / VOXEL)
        grid.integrate(blocks, picture, lens, where, 1.0, 1e4, RAMP / VOXEL)
    mesh = grid.extract_triangle_mesh(weight_threshold=0.5)
    return {
        "vertices": mesh.vertex.positions.numpy().astype(np.float64),
        "faces": mesh.triangle.indices.numpy().astype(np.int32),
    }


def do_poisson(given: Arrays) -> Arrays:
    import open3d

    rays = _rays()
    clouds, eyes = [], []
    for depth, angle in zip(given["depth"], given["angles"], strict=True):
        eye, axes = _pose(float(angle))
        points = eye + (rays * depth[..., None].astype(np.float64)) @ axes.T
        clouds.append(points[depth > 0])
        eyes.append(np.broadcast_to(eye, clouds[-1].shape))
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.concatenate(clouds)))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(30))
    normals = np.asarray(cloud.normals)
    away = (normals * (np.concatenate(eyes) - np.concatenate(clouds))).sum(axis=1) < 0
    normals[away] *= -1
    mesh, density = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=9)
    mesh.remove_vertices_by_mask(np.asarray(density) < np.quantile(np.asarray(density), 0.02))
    return {"vertices": np.asarray(mesh.vertices), "faces": np.asarray(mesh.triangles, np.int32)}


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Against the true side: where both are, where one is missing, and what is unsound."""
    if not len(made["faces"]):
        return {"faces": "0"}
    new = judge.mesh_of(made)
    true = clean(900, 900)
    away = judge.distances(new.vertices[np.unique(new.faces)], true)
    # Beyond a millimetre it is no error of place: a surface where none was.
    near = away[away < 1.0]
    z = true.vertices[:, 2]
    seen = true.vertices[(z > 1.0) & (z < 89.0)]
    missed = (judge.distances(seen, new) > 0.5).mean()
    used = new.vertices[np.unique(new.faces)]
    plain = used[(used[:, 2] > 32) & (used[:, 2] < 48)]
    plain = plain[np.linalg.norm(plain[:, :2], axis=1) > 29]
    bias = float((np.linalg.norm(plain[:, :2], axis=1) - 30.0).mean()) if len(plain) else np.nan
    found = [
        str(len(new.faces)), f"{near.max():.2f}", f"{np.sqrt((near**2).mean()):.3f}",
        f"{bias:+.4f}", f"{missed:.2%}", f"{(away >= 1.0).mean():.2%}", judge.faults(new),
        "yes" if "sigma" in made else "no",
    ]  # fmt: skip
    return dict(zip(COLUMNS, found, strict=True))


def measure(quick: bool = False) -> list[str]:
    """The lines of the table."""
    steps = 12 if quick else 24
    given = pictures(steps)
    contenders = [
        Contender("ours", do_ours),
        Contender("Open3D VoxelBlockGrid", do_voxel_blocks, "open3d-cpu", "MIT"),
        Contender("Open3D Poisson", do_poisson, "open3d-cpu", "MIT", "depth 9, thinnest 2 % off"),
    ]
    points = int((given["depth"] > 0).sum())
    head = (
        f"{steps} depth pictures of {WIDE} × {HIGH}, {points} points with {NOISE} mm of noise, "
        f"voxels of {VOXEL} mm, ramp {RAMP} mm:"
    )
    return [head, "", *compare(contenders, given, figures, COLUMNS)]
