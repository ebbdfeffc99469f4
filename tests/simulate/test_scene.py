"""The triangles of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh
from turnscan.rig import Pose
from turnscan.simulate import Body, Part, Renderer, SimulationSpec, _cut, _raster, bench, part
from turnscan.simulate._render import sheet_numbers
from turnscan.simulate._scene import triangles
from turnscan.simulate._view import Shadows


def test_every_triangle_lies_in_the_boxes_of_its_cluster() -> None:
    """A box too small would make pieces of the stripe vanish."""
    tri = triangles([Body(part("hexagon"))])
    small, large = tri.boxes
    assert np.array_equal(tri.corners, tri.vertices[tri.faces])
    assert len(large) > 1
    box = small[np.arange(len(tri.faces)) // _cut.CLUSTER]
    assert (tri.corners >= box[:, None, 0:3]).all()
    assert (tri.corners <= box[:, None, 3:6]).all()
    assert (tri.flat_normals >= box[:, 6:9]).all()
    assert (tri.flat_normals <= box[:, 9:12]).all()
    around = large[np.arange(len(small)) // _cut.CLUSTER]
    assert (small[:, [0, 1, 2, 6, 7, 8]] >= around[:, [0, 1, 2, 6, 7, 8]]).all()
    assert (small[:, [3, 4, 5, 9, 10, 11]] <= around[:, [3, 4, 5, 9, 10, 11]]).all()


@pytest.mark.parametrize("bow", [0.0, 2e-4])
def test_what_the_boxes_leave_out_would_give_no_polygon(bow: float) -> None:
    """The stripe is the same where every triangle is looked at."""
    made = bench(SimulationSpec("hexagon", lasers=1))
    beam, line = made.beams[0], made.rig.sheet(made.beams[0].name)
    sheet = (*sheet_numbers(line)[:12], bow, -bow, bow)
    shape = (beam.waist, beam.waist_distance, beam.rayleigh, 2.2, *beam.aim.tolist())
    tri = triangles(made.scene.bodies)
    everywhere = [[-1e4] * 3 + [1e4] * 3 + [-1.0] * 3 + [1.0] * 3]
    all_boxes = tuple(np.tile(everywhere, (len(boxes), 1)) for boxes in tri.boxes)
    for angle in (0.0, 0.7, 2.1):
        T = made.rig.T_camera_table @ made.motion.pose(angle)
        light = (T.rotation, T.translation, tuple(beam.apex.tolist()), sheet, shape)
        some = _cut.sheet_polygons(tri.corners, tri.flat_normals, tri.boxes, *light)
        every = _cut.sheet_polygons(tri.corners, tri.flat_normals, all_boxes, *light)
        assert len(every[1]) > 50
        for few, all_ in zip(some, every, strict=True):
            assert np.array_equal(few, all_)


@pytest.mark.parametrize("scene", ["bracket", "grooves"])
def test_what_is_drawn_is_what_rays_meet(scene: str) -> None:
    renderer = Renderer(bench(SimulationSpec(scene, "paper", lean=(0.03, 0.02))))
    rig, view, tri = renderer.bench.rig, renderer.view, renderer._tri
    T = rig.T_camera_table @ renderer.bench.motion.pose(0.7)
    pixels = np.stack(np.mgrid[: rig.camera.height, : rig.camera.width][::-1], axis=-1)
    ways = T.inverse().turn(rig.camera.rays(pixels.reshape(-1, 2)))
    met = renderer._caster.first_hits(T.inverse().translation, ways)
    seen = view.seen(T)
    rows, _ = view.within(T)
    assert (np.flatnonzero(met >= 0) // rig.camera.width >= rows.start).all()
    assert (seen >= 0).sum() > 10_000
    assert np.array_equal(seen, met)
    unsure = view._drawn(T, (0, 0), np.full((480, 640), -1, np.int32))
    assert 0 < unsure.mean() < 0.05, "most pixels are to be had without a ray"
    assert tri.closed == (scene != "grooves")  # whose cuts meet edges within an edge


def test_nothing_is_in_a_shadow_where_none_may_fall() -> None:
    renderer = Renderer(bench(SimulationSpec("mug", "paper")))
    tri = renderer._tri
    middle, flat = tri.vertices[tri.faces].mean(axis=1), tri.flat_normals
    # Places that a camera sees lie outside all bodies; the handle begins inside the wall.
    eye = renderer.bench.rig.T_camera_table.inverse().translation
    outside = renderer._caster.visible(middle, flat, eye)
    for lamp in ([0.7, -0.5, 0.5], [-0.9, 0.1, 0.2]):
        way = np.array(lamp) / np.linalg.norm(lamp)
        k = np.flatnonzero(outside & (flat @ way > 0))
        may = _may_be_dark(Shadows(tri, renderer.view._box, way), middle[k], flat[k], way)
        lit = renderer._caster.visible(middle[k], flat[k], middle[k] + 2000.0 * way)
        assert lit[~may].all()
        assert (~may).sum() > 0.5 * lit.sum(), "most places are known to be lit"
        assert not lit.all()


def test_what_rays_meet_of_a_body_that_is_inside_out_is_drawn() -> None:
    good = bench(SimulationSpec("cup", "paper"))
    cup = good.scene.bodies[0]
    mesh = cup.part.mesh
    turned = Part("cup", Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    scene = replace(good.scene, bodies=(replace(cup, part=turned), *good.scene.bodies[1:]))
    renderer = Renderer(replace(good, scene=scene))
    assert Renderer(good)._tri.closed
    assert not renderer._tri.closed
    camera, T = good.rig.camera, good.rig.T_camera_table
    pixels = np.stack(np.mgrid[: camera.height, : camera.width][::-1], axis=-1).reshape(-1, 2)
    ways = T.inverse().turn(camera.rays(pixels))
    met = renderer._caster.first_hits(T.inverse().translation, ways)
    assert np.array_equal(renderer.view.seen(T), met)


def test_of_an_open_body_no_place_is_known_to_be_lit() -> None:
    made = part("bracket").mesh
    half = Part("half", Mesh(made.vertices, made.faces[: len(made.faces) // 2]))
    tri = triangles([Body(half)])
    assert not tri.closed
    up = np.array([0.0, 0.0, 1.0])
    facing = np.broadcast_to(up, tri.vertices.shape)
    assert _may_be_dark(Shadows(tri, tri.vertices, up), tri.vertices, facing, up).all()


def _may_be_dark(shadows: Shadows, points: Floats, normals: Floats, lamp: Floats) -> Bools:
    """(n,) of points (n, 3) that face a lamp: whether something may stand between."""
    ways = (0.0, 0.0, 1.0), tuple(lamp.tolist())
    face = np.zeros(len(points), np.int32)
    _, facing, asked = _raster.lamp_light(
        face, points, np.ascontiguousarray(normals), *ways, shadows.heights
    )
    assert (facing > 0).all()
    return asked


def test_what_stands_the_same_is_drawn_once_and_what_does_not_is_drawn_anew() -> None:
    first, again = (Renderer(bench(SimulationSpec("hexagon", "paper"))) for _ in range(2))
    assert again._tri is first._tri
    made = first.bench
    body, *others = made.scene.bodies

    def with_body(other: Body) -> Renderer:
        return Renderer(replace(made, scene=replace(made.scene, bodies=(other, *others))))

    # What a body is made of is no matter of its triangles.
    shiny = with_body(replace(body, material=replace(body.material, specular=0.5)))
    assert shiny._tri is first._tri
    assert shiny.bench.scene.bodies[0].material.specular == 0.5
    moved = replace(body, T_table_part=Pose(translation=np.array([1.0, 0.0, 0.0])))
    larger = replace(body.part.mesh, vertices=1.01 * body.part.mesh.vertices)
    for other in (moved, replace(body, part=replace(body.part, mesh=larger))):
        assert np.abs(with_body(other)._tri.vertices - first._tri.vertices).max() > 0.1
