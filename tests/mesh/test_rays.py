"""Our own tree of boxes and Embree see the same."""

from __future__ import annotations

import numpy as np
import pytest

from tests.needs import needs
from turnscan.mesh import Caster
from turnscan.mesh._ray_tree import TreeScene
from turnscan.simulate import part


@pytest.mark.parametrize("name", ["bracket", "cup"])
def test_the_tree_and_embree_agree(name: str) -> None:
    needs("Embree")
    from embreex import rtcore_scene as embree
    from embreex.mesh_construction import TriangleMesh

    mesh = part(name).mesh
    v = mesh.vertices.astype(np.float32)
    scene = embree.EmbreeScene()
    TriangleMesh(scene, v, np.ascontiguousarray(mesh.faces))
    tree = TreeScene(v.astype(np.float64), mesh.faces)
    rng = np.random.default_rng(5)
    way = np.column_stack([-np.ones(20_000), rng.normal(0, 0.08, (20_000, 2))]).astype(np.float32)
    eye = np.tile(np.float32([500, 0, 40]), (len(way), 1))
    ours, theirs = tree.run(eye, way), np.asarray(scene.run(eye, way))
    assert (theirs >= 0).mean() > 0.05
    assert (ours >= 0).tolist() == (theirs >= 0).tolist()
    assert (ours == theirs).mean() > 0.999  # a shared edge belongs to either
    near = np.full(len(way), 0.3, np.float32)
    assert (tree.run(eye, way, near, "OCCLUDED") < 0).all()


def test_a_point_sees_the_light_unless_something_stands_between() -> None:
    mesh = part("sphere").mesh
    caster = Caster(mesh.vertices, mesh.faces)
    points = np.array([[20.0, 0.0, 20.0], [-20.0, 0.0, 20.0]])
    normals = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert caster.visible(points, normals, (500.0, 0.0, 20.0)).tolist() == [True, False]
