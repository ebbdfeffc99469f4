"""Grids joined without double cover, islands taken away, gaps closed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic import box, cylinder, full_turn, make_rig, scan_shape, sphere, with_noise
from turnscan.mesh import (
    Mesh,
    components,
    crossings,
    cut_touching,
    is_closed,
    join,
    soundness,
    submesh,
)
from turnscan.points import (
    RangeGrid,
    RangeScan,
    Volume,
    build_grid,
    clip,
    placements_from_conf,
    range_scan_from_ply,
)
from turnscan.remedy import Option, Remedy
from turnscan.rig import Pose, rotation_about
from turnscan.shapes import volume_sigma
from turnscan.surface import mesh_findings
from turnscan.surface.clean import drop_islands, long_islands
from turnscan.surface.fusion import paste
from turnscan.surface.holes import ClosingOptions, close, holes


def grids(lasers, shape, steps, noise=0.02, **rig):
    made = make_rig(lasers=lasers, **rig)
    angles = full_turn(steps)
    out = []
    for k in range(len(lasers)):
        stripes = with_noise(scan_shape(made, shape, angles, f"L{k}"), noise, k)
        out.append(clip(build_grid(made, f"L{k}", stripes, range(steps), angles), Volume(60, 2)))
    return out


def area(mesh: Mesh) -> float:
    t = mesh.triangles
    return float(np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2)


def assert_sound_and_measured(mesh: Mesh, of: list[RangeGrid]) -> None:
    """Manifold but for corners that touch, oriented, nothing cuts through; no vertex was moved."""
    assert {f.code for f in soundness(mesh)} <= {"surface.touching"}
    measured = {tuple(p) for g in of for p in g.points[g.found]}
    assert {tuple(v) for v in mesh.vertices} <= measured


def test_two_lasers_on_one_surface_are_kept_once():
    one, two = grids((0.4, -0.4), cylinder(25.0, 0.0, 40.0), 48, lift=20.0, elevation=0.1)
    single, both = paste([one]), paste([one, two])
    double = paste([one, two], keep_double=True)
    assert both.provenance.lasers[0] == "L0"
    assert area(double) == pytest.approx(2 * area(single), rel=0.05)
    assert area(both) == pytest.approx(area(single), rel=0.02)
    assert_sound_and_measured(both, [one, two])


def test_a_second_laser_fills_what_the_first_did_not_see():
    one, two = grids((0.4, -0.4), cylinder(25.0, 0.0, 40.0), 48, lift=20.0, elevation=0.1)
    points = one.points.copy()
    points[8:14] = np.nan
    torn = replace(one, points=points)
    whole, both = paste([one]), paste([torn, two])
    assert area(paste([torn])) < 0.95 * area(whole)
    assert area(both) == pytest.approx(area(whole), rel=0.02)
    assert_sound_and_measured(both, [torn, two])
    assert components(both).max() == 0, "joined across the gap between the patches"
    p = both.provenance
    assert set(p.laser[p.laser >= 0]) == {0, 1}
    assert p.lasers == ("L0", "L1")


def test_the_top_seen_before_and_beyond_the_axis_is_there_once():
    (grid,) = grids((0.4,), box((20, 15, 15), (2, 1, 15), 0.3), 48, lift=15.0, elevation=0.5)
    assert grid.behind[grid.found].any()
    mesh = paste([grid])
    assert_sound_and_measured(mesh, [grid])
    assert np.bincount(components(mesh)).max() > 0.99 * len(mesh.faces), "front and back are joined"
    top = np.abs(mesh.vertices[mesh.faces][..., 2] - 30.0).max(axis=1) < 0.2
    # Faces that cross the top's edges are not counted.
    assert 0.85 * 40 * 30 < area(submesh(mesh, top)) < 1.02 * 40 * 30
    t = mesh.triangles[top]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    assert (normal[:, 2] > 0).mean() > 0.99


def test_islands_go_by_their_size():
    (grid,) = grids((0.4,), cylinder(25.0, 0.0, 40.0), 24, lift=20.0)
    mesh = paste([grid])
    speck = Mesh(np.eye(3) * 100, [[0, 1, 2]])
    both = join([Mesh(mesh.vertices, mesh.faces), speck])
    assert components(both).max() == 1
    left, pieces, faces = drop_islands(both, 10)
    assert (pieces, faces) == (1, 1)
    assert len(left.faces) == len(mesh.faces)
    assert drop_islands(both, 0)[0] is both
    found = mesh_findings(left, pieces, faces)
    assert [f.code for f in found] == ["surface.islands", "surface.open"]
    none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert mesh_findings(none, 0, 0)[0].severity == "error"


def test_a_piece_that_hung_on_the_part_in_its_grid_needs_a_quarter_of_the_faces():
    (grid,) = grids((0.4,), cylinder(25.0, 0.0, 40.0), 24, lift=20.0)
    whole = paste([grid])
    assert whole.provenance is not None
    # Apart from the rest: two patches, of 0.4 to 0.8 % of the faces and of 0.1 %.
    step, line = whole.provenance.step[whole.faces], whole.provenance.line[whole.faces]
    first = int(np.median(line))
    size = max(2, round(0.006 * len(whole.faces) / 4))
    inside = ((step >= 3) & (step <= 5) & (line >= first) & (line <= first + size)).all(axis=1)
    about = ((step >= 3) & (step <= 5) & (line >= first) & (line <= first + size)).any(axis=1)
    speck = np.flatnonzero((step == 12).any(axis=1) & (line == first).any(axis=1))[:1]
    beside = np.isin(whole.faces, whole.faces[speck]).any(axis=1)
    beside[speck] = False
    torn = submesh(whole, ~(about & ~inside) & ~beside)
    share = np.sort(np.bincount(components(torn)))[::-1] / len(torn.faces)
    assert len(share) == 3
    assert 0.0025 < share[1] < 0.0095
    assert share[2] < 0.0025
    assert drop_islands(torn)[1] == 2, "without the grid nothing tells it from a glint"
    left, pieces, _ = drop_islands(torn, None, [grid])
    assert pieces == 1, "the speck"
    assert np.bincount(components(left)).min() == int(inside.sum())
    assert drop_islands(torn, 10**6, [grid])[1] == 3, "who names a size gets it"
    # The same patch, but apart in its grid as well, is an island as before.
    alone = np.array(grid.points)
    ring = alone[2:7, first - 1 : first + size + 2].copy()
    ring[0], ring[-1], ring[:, 0], ring[:, -1] = np.nan, np.nan, np.nan, np.nan
    alone[2:7, first - 1 : first + size + 2] = ring
    assert drop_islands(torn, None, [replace(grid, points=alone)])[1] == 2


def test_an_island_that_is_long_is_named_with_its_place():
    (grid,) = grids((0.4,), cylinder(25.0, 0.0, 40.0), 24, lift=20.0)
    body = paste([grid])
    body = Mesh(body.vertices, body.faces)
    k = np.arange(80)
    ribbon = np.stack([40.0 + k % 2, 0.0 * k, 0.25 * k], axis=-1)
    strip = Mesh(ribbon, np.stack([k[:-2], k[1:-1], k[2:]], axis=-1))
    short = Mesh(ribbon * 0.1 - 60.0, strip.faces)
    both = join([body, strip, short])
    assert long_islands(both, 30) == [], "both are kept"
    (said,) = long_islands(both, 100)
    assert (said.code, said.severity) == ("surface.island-long", "warning")
    assert "78 faces" in said.message
    assert "1 × 0 × 20 mm" in said.message
    assert said.where == "(40, 0, 10) mm"
    assert said.remedy == Remedy("keep it with ", Option("island", 78))
    assert drop_islands(both, 78)[1] == 0, "as advised, it stays"
    wisp = Mesh(ribbon * 2.0, strip.faces[:40])
    assert long_islands(join([body, wisp]), 100) == [], "few faces are strays"


def test_a_box_closes_to_its_volume():
    (grid,) = grids((0.4,), box((20, 15, 15), (2, 1, 15), 0.3), 120, 0.01, lift=15.0, elevation=0.4)
    open_mesh, _ = cut_touching(drop_islands(paste([grid]), 50)[0])
    assert not is_closed(open_mesh)
    mesh, said = close(open_mesh)
    assert is_closed(mesh)
    # Steps of 3° cut the corners: a little less than the truth, never more than noise allows.
    assert 0.97 * 40 * 30 * 30 < mesh.volume < 1.002 * 40 * 30 * 30
    assert mesh.bounds[0, 2] == 0.0
    # What was measured before and beyond the axis is joined: nothing has to be repaired.
    assert [f.code for f in said] == ["surface.caps", "surface.floor"]
    new = mesh.provenance.step == -1
    there = {tuple(v) for v in open_mesh.vertices.tolist()}
    assert all(tuple(v) in there for v in mesh.vertices[~new].tolist()), "nothing moved"
    assert mesh.measured.sum() > 0.94 * len(open_mesh.faces)
    floor = (mesh.triangles[..., 2] == 0.0).all(axis=1)
    assert 0.95 * 40 * 30 < mesh.area_of(floor) < 1201
    assert mesh.measured[floor].all(), "the platter is known"
    assert not mesh.measured[new[mesh.faces].any(axis=1) & ~floor].any()
    assert not mesh_findings(mesh, 0, 0, closed=True)


def test_the_bottom_of_a_part_that_leans_is_not_known():
    (grid,) = grids((0.4,), box((20, 15, 15), (2, 1, 15), 0.3), 120, 0.01, lift=15.0, elevation=0.4)
    upright, _ = cut_touching(drop_islands(paste([grid]), 50)[0])
    for tilt, severity in ((0.0, "note"), (8.0, "warning")):
        a = np.radians(tilt)
        turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        V = upright.vertices @ turn.T
        V[:, 2] -= V[:, 2].min() - upright.vertices[:, 2].min()
        mesh, said = close(replace(upright, vertices=V))
        assert is_closed(mesh)
        (floor,) = (f for f in said if f.code == "surface.floor")
        assert floor.severity == severity
        assert ("tilted by 8°" in floor.message) == bool(tilt)
        level = (mesh.triangles[..., 2] == 0.0).all(axis=1)
        assert mesh.measured[level].all() == (not tilt)
        # Filled down to the platter, a part that leans has a wedge too much.
        off, known = mesh.volume - 40 * 30 * 30, volume_sigma(mesh)
        assert abs(off) < 2.5 * known.total
        assert off > 1000 if tilt else off < 100


def test_flat_cap_without_a_floor():
    (grid,) = grids((0.4,), cylinder(25.0, 0.0, 40.0), 48, 0.0, lift=20.0)
    mesh, _ = close(paste([grid]), ClosingOptions(floor=None, holes="flat"))
    assert is_closed(mesh)
    height = np.ptp(mesh.vertices[:, 2])
    polygon = 24 * 25.0**2 * np.sin(2 * np.pi / 48)
    assert mesh.volume == pytest.approx(polygon * height, rel=0.02)
    opened, _ = close(paste([grid]), ClosingOptions(floor=None, top="open", largest=10.0))
    assert len(holes(opened)) == 2


def test_hole_borders_of_any_shape_close():
    """A ball with ragged holes, some touching themselves."""
    (grid,) = grids((0.4,), sphere(20.0, (0, 0, 22)), 36, 0.0, lift=22.0)
    rng = np.random.default_rng(4)
    for share in (0.02, 0.2, 0.5):
        points = grid.points.copy()
        points[rng.random(points.shape[:2]) < share] = np.nan
        torn = paste([replace(grid, points=points)])
        mesh, found = close(torn, ClosingOptions(floor=None))
        assert not len(crossings(mesh))
        assert is_closed(mesh) or "surface.unfilled" in [f.code for f in found]
        if share < 0.3:  # of half a ball in tatters more may stay open
            assert is_closed(mesh)
            assert len(mesh.faces) > len(torn.faces)
        if share < 0.1:
            whole, _, _ = drop_islands(mesh, 200)
            assert is_closed(whole)
            assert whole.volume == pytest.approx(4 / 3 * np.pi * 20**3, rel=0.06)


def bump_scan(name: str, pose: Pose) -> RangeScan:
    """A bump on a plane, seen along its own z, of which the world frame is T_world_scan = pose."""
    x, y = np.meshgrid(np.arange(0, 40.0), np.arange(0, 30.0))
    points = np.stack([x, y, 3 * np.exp(-((x - 20) ** 2 + (y - 15) ** 2) / 40)], -1).reshape(-1, 3)
    return RangeScan(name, pose.inverse().apply(points), np.arange(1200).reshape(30, 40))


def test_range_scans_come_together():
    small = Pose(rotation_about([1, 2, 0], 0.05), [1.0, 2.0, 3.0])
    scans = [bump_scan("a", Pose()), bump_scan("b", small)]
    mesh = paste([scans[0].range_grid(), scans[1].range_grid(small)])
    assert area(mesh) < 1.25 * area(paste([scans[0].range_grid()])), "not twice"
    t = mesh.triangles
    assert (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 2] > 0).all(), "towards the scanner"


def test_real_range_scans(shared_data):
    """Two of the ten scans: where they overlap they agree, which they do only if placed right."""
    from scipy.spatial import cKDTree

    folder = shared_data / "bunny-range"
    placed = placements_from_conf((folder / "bun.conf").read_text(), scale=1000.0)
    assert len(placed) == 10
    names = ["bun000.ply", "bun045.ply"]
    scans = [range_scan_from_ply((folder / n).read_bytes(), n, scale=1000.0) for n in names]
    assert sum(len(s.points) for s in scans) == 80353
    world = [placed[s.name].apply(s.points) for s in scans]
    near = cKDTree(world[0]).query(world[1])[0]
    assert np.median(near) < 0.35, "spacing is 0.5 mm"
    grids = [s.range_grid(placed[s.name]) for s in scans]
    mesh = paste(grids)
    alone = [area(paste([g])) for g in grids]
    assert max(alone) < area(mesh) < 0.85 * sum(alone)
    size = np.bincount(components(mesh))
    assert size.max() > 60_000


def test_the_foot_goes_on_as_it_comes_down():
    """A ball on the platter, seen from 3 mm up: its foot is led under it, not straight down."""
    (grid,) = grids((0.4,), sphere(20.0, (0, 0, 20)), 90, 0.01, lift=20.0, elevation=0.2)
    seen = np.where(grid.points[..., 2:] > 3.0, grid.points, np.nan)
    mesh, said = close(paste([replace(grid, points=seen)]), ClosingOptions(holes="curvature"))
    assert is_closed(mesh)
    assert soundness(mesh) == []
    true = 4 / 3 * np.pi * 20**3
    straight = np.pi * 3 * (20**2 - 17**2) - np.pi * 9 * 57 / 3  # what a straight foot adds: 509
    assert abs(mesh.volume - true) < 0.4 * straight
    floor = mesh.area_of((mesh.triangles[..., 2] == 0.0).all(axis=1))
    assert floor < 0.5 * np.pi * (20**2 - 17**2)
    assert (
        f"{floor:.0f} mm² at 0.0 mm" in next(f for f in said if f.code == "surface.floor").message
    )
