"""How much of what was measured a merge holds, and that the way of merging is chosen by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.surface.known_parts import scanned
from turnscan.mesh import Mesh, submesh
from turnscan.points import Along
from turnscan.surface.fusion import merge, range_surfaces
from turnscan.surface.fusion._kept import keeping, kept

NOTHING = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def surfaces():
    return [s for g in scanned("handle", 24, 2) for s in range_surfaces(g)]


def test_what_is_held_is_a_share_of_the_measured_area() -> None:
    one = surfaces()[:1]
    whole = one[0].mesh
    low = whole.triangles[:, :, 2].mean(axis=1) < 30.0
    t = whole.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    assert kept(whole, one) == pytest.approx(1.0)
    assert kept(NOTHING, one) == 0.0
    assert np.isnan(kept(whole, []))
    share = area[low].sum() / area.sum()
    assert kept(submesh(whole, low), one) == pytest.approx(share, abs=0.02)
    aside = replace(whole, vertices=whole.vertices * [1.0, 1.0, 0.0] + [0, 0, -9.0])
    assert kept(aside, one) < 0.02


@pytest.mark.parametrize(
    ("shares", "taken"),
    [((0.95, 1.0, 1.0), 0), ((0.3, 0.97, 1.0), 1), ((0.3, 0.8, 1.0), 2), ((0.8, 0.81, 0.8), 0)],
)
def test_the_first_way_is_taken_unless_another_holds_much_more(shares, taken) -> None:
    one = surfaces()[:1]
    mesh = one[0].mesh
    t = mesh.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    order = np.argsort(t[:, :, 2].mean(axis=1))
    made = []

    def way(share):
        def build(why):
            made.append(why)
            some = np.zeros(len(area), dtype=bool)
            some[order[np.cumsum(area[order]) <= share * area.sum()]] = True
            return submesh(mesh, some), []

        return build

    best, why, _ = keeping(one, [way(s) for s in shares], "by its shape")
    assert best == taken
    assert (why == "by its shape") == (taken == 0)
    # The others cost time, and are not made where the first is good.
    assert len(made) == (1 if shares[0] >= 0.9 else len(shares))


def test_a_way_that_loses_what_is_known_badly_is_not_taken() -> None:
    grids = scanned("ridge", 40, 2)
    # Two profiles of three are known ten times worse: cells of angle and height leave them out.
    rough = [
        replace(g, sigma=np.where((np.arange(40) % 3 > 0)[:, None], 10.0, 1.0) * g.sigma)
        for g in grids
    ]
    for some, word in ((grids, "several radii"), (rough, "holds")):
        mesh, found = merge(some)
        (said,) = (f for f in found if f.code == "surface.merge")
        assert word in said.message
        assert kept(mesh, [s for g in some for s in range_surfaces(g)]) > 0.9
    thinned, again = merge(rough, along=Along(5.0))
    assert [f.message.split(";")[0] for f in again][-1] == said.message.split(";")[0]
    assert len(thinned.vertices) < 0.6 * len(mesh.vertices)
