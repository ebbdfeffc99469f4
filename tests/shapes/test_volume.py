"""What the uncertainty of a volume says of the surface between its points and over its gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tests.analytic import make_rig
from tests.points.grids import plain_grid
from turnscan import shapes
from turnscan.mesh import Mesh, Provenance, boundary_loops, is_closed, submesh
from turnscan.points import RangeGrid, pixels_of, to_object
from turnscan.poses import Alignment, pose_moves
from turnscan.rig import Pose, Rig, rotation_from_vector
from turnscan.surface import mesh_grid
from turnscan.surface.fusion import RangeSurface
from turnscan.surface.holes import FillHow, fill


def swept(section: np.ndarray, radius: float, turns: int) -> Mesh:
    """A ring: a closed section (m, 2), counter-clockwise, swept about the z axis."""
    phi = np.arange(turns) * 2 * np.pi / turns
    r, z = radius + section[:, 0], section[:, 1]
    x = np.stack([np.outer(np.cos(phi), r), np.outer(np.sin(phi), r), np.tile(z, (turns, 1))], -1)
    cell = np.arange(turns * len(r)).reshape(turns, -1)
    over, on = np.roll(cell, -1, axis=0), np.roll(cell, -1, axis=1)
    both = np.roll(over, -1, axis=1)
    a, b, c, d = cell.ravel(), over.ravel(), both.ravel(), on.ravel()
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Mesh(x.reshape(-1, 3), faces.astype(np.int32))


def ball(radius: float = 20.0, n: int = 48) -> Mesh:
    """A ball whose points lie about evenly."""
    i = np.arange(n * n) + 0.5
    z = 1 - 2 * i / (n * n)
    phi = i * np.pi * (1 + 5**0.5)
    x = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], -1)
    faces = ConvexHull(x).simplices
    t = x[faces]
    inward = np.einsum("ij,ij->i", np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), t[:, 0]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(radius * x, faces.astype(np.int32))


def box(size: tuple[float, float, float], spacing: float) -> Mesh:
    """A box about the origin, of squares so wide, each cut in two."""
    half = np.array(size) / 2
    parts, faces = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        n, m = round(size[u] / spacing), round(size[v] / spacing)
        a, b = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, m + 1), indexing="ij")
        cell = np.arange(a.size).reshape(a.shape)
        c = [cell[:-1, :-1], cell[1:, :-1], cell[1:, 1:], cell[:-1, 1:]]
        two = np.concatenate(
            [np.stack([k.ravel() for k in t], -1) for t in (c[:3], [c[0], *c[2:]])]
        )
        for sign in (-1.0, 1.0):
            x = np.empty((a.size, 3))
            x[:, u], x[:, v], x[:, axis] = (
                half[u] * a.ravel(),
                half[v] * b.ravel(),
                sign * half[axis],
            )
            faces.append((two if sign > 0 else two[:, ::-1]) + sum(len(p) for p in parts))
            parts.append(x)
    every, index = np.unique(np.round(np.concatenate(parts), 9), axis=0, return_inverse=True)
    return Mesh(every, index.ravel()[np.concatenate(faces)].astype(np.int32))


def test_a_ball_holds_what_bulges_between_its_points() -> None:
    mesh = ball()
    assert is_closed(mesh)
    lost = 4 / 3 * np.pi * 20.0**3 - mesh.volume
    assert lost > 0
    assert shapes.volume_sigma(mesh).between == pytest.approx(lost, rel=0.35)
    assert shapes.mean_curvature(mesh) == pytest.approx(4 * np.pi * 20.0, rel=0.01)


def test_a_round_ring_does_and_its_inside_counts_against_it() -> None:
    turn = np.arange(40) * 2 * np.pi / 40
    mesh = swept(8.0 * np.column_stack([np.cos(turn), np.sin(turn)]), 30.0, 150)
    lost = 2 * np.pi**2 * 30.0 * 64.0 - mesh.volume
    assert shapes.volume_sigma(mesh).between == pytest.approx(lost, rel=0.35)
    hollow = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert shapes.volume_sigma(hollow).between == pytest.approx(lost, rel=0.35)


def test_sharp_edges_lost_between_points_are_in_it_on_average() -> None:
    rng = np.random.default_rng(4)
    side, spacing, radius = 12.0, 1.0, 60.0
    lost, said = [], []
    for _ in range(12):
        at = [np.arange(rng.uniform(0.05, 0.95), side, spacing) for _ in range(4)]
        way = np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
        along = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
        section = np.concatenate(
            [
                side / 2 * w + (k - side / 2)[:, None] * a
                for k, w, a in zip(at, way, along, strict=True)
            ]
        )
        mesh = swept(section, radius, 360)
        lost.append(2 * np.pi * radius * side**2 - mesh.volume)
        said.append(shapes.volume_sigma(mesh).between)
    assert min(lost) > 0
    assert 0.5 < np.mean(said) / np.mean(lost) < 1.3


@pytest.mark.parametrize("how", ["flat", "tangent"])
@pytest.mark.parametrize("high", [16.0, 18.5])
def test_a_filled_gap_is_as_uncertain_as_its_filling_is_wrong(how: FillHow, high: float) -> None:
    whole = ball(n=80)
    gone = whole.triangles[..., 2].min(axis=1) > high
    done = fill(submesh(whole, ~gone), how=how)
    wrong = abs(done.volume - whole.volume)
    said = shapes.volume_sigma(done)
    assert wrong < 2 * said.filled, "not surer than it may be"
    assert said.filled < 4 * wrong, "and not so wide that it says nothing"
    assert shapes.volume_sigma(whole).filled == 0.0


@pytest.mark.parametrize("how", ["flat", "tangent"])
@pytest.mark.parametrize("high", [14.0, 16.0, 18.5])
def test_so_is_its_area(how: FillHow, high: float) -> None:
    whole = ball(n=80)
    gone = whole.triangles[..., 2].min(axis=1) > high
    done = fill(submesh(whole, ~gone), how=how)
    zero = np.zeros(len(done.vertices), np.int32)
    sigma = np.full(len(zero), 1e-4)
    known = replace(done, provenance=Provenance(sigma, zero, zero, zero, ("left",)))
    wrong, said = abs(done.area_of() - whole.area_of()), shapes.area_base(done).filled
    assert wrong < 2 * said, "not surer than it may be"
    assert said < 4 * wrong, "and not so wide that it says nothing"
    assert said <= shapes.area(known).sigma < 1.2 * said
    below = done.triangles[..., 2].max(axis=1) < high - 5.0
    assert shapes.area_base(done, below).filled == 0.0
    assert shapes.area(known, below).sigma < 0.2 * said


def test_the_area_of_a_lid_misses_a_sample_of_the_wall() -> None:
    closed = fill(tube(), how="auto")
    both = 2 * 2 * np.pi * 20.0 * 40 / 29
    assert shapes.area_base(closed).filled == pytest.approx(both, rel=0.1)


def test_the_measured_and_the_added_part_are_told_apart() -> None:
    """A cap of height h over its border's plane: π h² (3R − h)/3."""
    whole = ball(n=80)
    gone = whole.triangles[..., 2].min(axis=1) > 16.0
    opened = submesh(whole, ~gone)
    flat, round_ = (fill(opened, how=how) for how in ("flat", "tangent"))
    lid, cap = shapes.volume_sigma(flat), shapes.volume_sigma(round_)
    rim = opened.vertices[boundary_loops(opened)[0]][:, 2].mean()
    h = 20.0 - rim
    assert lid.added == pytest.approx(0.0, abs=0.15 * np.pi * h**2 * (60 - h) / 3)
    assert cap.added == pytest.approx(np.pi * h**2 * (60 - h) / 3, rel=0.3)
    assert flat.volume - lid.added == pytest.approx(round_.volume - cap.added, rel=1e-3)


def tube(bow: float = 0.0) -> Mesh:
    """A pipe of 20 mm radius, open at both ends, 40 mm long; its points are 40/29 mm apart."""
    t = np.linspace(0.0, 1.0, 30)
    phi = 2 * np.pi * np.arange(60)[:, None] / 60
    r = 20.0 + bow * t * (1 - t) + 0 * phi
    points = np.stack([r * np.cos(phi), r * np.sin(phi), 40 * t + 0 * r], axis=-1)
    return mesh_grid(replace(plain_grid(points, phi[:, 0]), closed=True))


def test_a_lid_over_an_edge_may_lie_a_sample_too_low() -> None:
    """That it is there is a choice; where the edge is that it closes was sampled, no more."""
    closed = fill(tube(), how="auto")
    assert is_closed(closed)
    said = shapes.volume_sigma(closed)
    assert said.filled == pytest.approx(2 * np.pi * 20.0**2 * 40 / 29, rel=0.1)
    figures = shapes.volume_figures(closed.volume, said)
    assert figures["volume_measured_mm3"] == pytest.approx(closed.volume, rel=1e-3)


def test_a_side_that_nobody_saw_is_doubted_whole() -> None:
    """The end of a bar, and what is above and below: on the y sides alone the bar was measured."""
    bar = box((60.0, 20.0, 20.0), 1.0)
    x, _, z = np.moveaxis(bar.triangles.mean(axis=1), -1, 0)
    unseen = (x > 30.0 - 1e-6) | ((np.abs(z) > 10.0 - 1e-6) & (x > 0.0))
    done = replace(bar, measured=~unseen)
    # From the nearest measured side, 20 mm apart, the middle of a face lies 5 mm on average.
    said = shapes.volume_sigma(done).filled
    assert said == pytest.approx(5.0 * bar.area_of(unseen), rel=0.3)
    only_end = replace(bar, measured=x < 30.0 - 1e-6)
    lid = shapes.volume_sigma(only_end).filled
    assert lid == pytest.approx(20.0 * 20.0 * 1.0, rel=0.1), (
        "which is a lid, a sample from its edge"
    )


@pytest.mark.parametrize(("seen", "least"), [(0.45, 0.7), (0.55, 0.0)])
def test_what_fillings_hold_is_not_known_where_most_was_not_seen(seen, least) -> None:
    """Of a ball's surface the lowest part was measured, and the rest is filled as it truly is: in
    all, half of what lies above the border, and so nobody could tell that it is there."""
    whole = ball()
    low = whole.triangles[..., 2].mean(axis=1) < 20.0 * (2 * seen - 1)
    said = shapes.volume_sigma(replace(whole, measured=low))
    h = 40.0 * (1 - seen)
    assert said.added == pytest.approx(np.pi * h**2 * (60 - h) / 3, rel=0.05)
    assert least <= said.filled / said.added < least + 0.3
    half = whole.triangles[..., 0].mean(axis=1) < 0
    of_half = shapes.volume_sigma(replace(whole, measured=low), faces=half).filled
    assert of_half == pytest.approx(said.filled / 2, rel=0.02)


def test_what_lies_between_profiles_that_are_far_apart_is_in_it() -> None:
    """Faces of a scan in coarse steps are ten times as wide as high, and their width counts."""
    t = np.arange(90) * 2 * np.pi / 90
    section = 8.0 * np.column_stack([np.cos(t), np.sin(t)])
    mesh = swept(section, 30.0, 24)
    lost = 2 * np.pi**2 * 30.0 * 64.0 - mesh.volume
    assert shapes.volume_sigma(mesh).between == pytest.approx(lost, rel=0.35)


def test_what_is_known_worse_than_usual_does_not_average_out() -> None:
    whole = ball(n=40)
    v = len(whole.vertices)
    zero = np.zeros(v, np.int32)
    high = whole.vertices[:, 2] > 10.0
    sigma = np.where(high, 0.3, 0.05)
    known = replace(whole, provenance=Provenance(sigma, zero, zero, zero, ("left",)))
    said = shapes.volume_sigma(known)
    cap = 2 * np.pi * 20.0 * 10.0
    assert said.alike == pytest.approx(cap * (0.3**2 - 0.05**2) ** 0.5, rel=0.05)
    assert said.noise == pytest.approx(known.area_of() * 0.05 / v**0.5, rel=0.1)
    assert said.measured > said.alike


def test_points_that_do_not_know_their_sigma_are_not_without_noise() -> None:
    mesh = ball(n=30)
    number = np.arange(len(mesh.vertices), dtype=np.int32)

    def noise(sigma: np.ndarray) -> float:
        origin = Provenance(sigma, 0 * number, number, number, ("red",))
        return shapes.volume_sigma(replace(mesh, provenance=origin)).noise

    every = np.full(len(number), 0.05)
    assert noise(np.where(number % 2, every, np.nan)) == pytest.approx(noise(every))
    assert np.isnan(noise(np.nan * every))


def test_all_parts_are_in_the_measurement() -> None:
    whole = ball(n=30)
    v = len(whole.vertices)
    zero = np.zeros(v, np.int32)
    known = replace(whole, provenance=Provenance(np.full(v, 0.05), zero, zero, zero, ("left",)))
    said, told = shapes.volume_sigma(known), shapes.volume(known)
    assert told.sigma == pytest.approx(np.sqrt(said.noise**2 + said.between**2))
    assert said.mostly in told.text
    # Independent points: the area times sigma over the root of their number.
    assert said.noise == pytest.approx(known.area_of() * 0.05 / v**0.5, rel=0.1)
    nothing = replace(whole, measured=np.zeros(len(whole.faces), dtype=np.bool_))
    assert shapes.volume_sigma(nothing).filled == pytest.approx(whole.volume)


def known_ball(names: tuple[str, ...] = ("left",)) -> Mesh:
    """A ball whose upper vertices the last of the lasers measured, and the first one all others."""
    whole = ball(n=40)
    v = len(whole.vertices)
    laser = np.where(whole.vertices[:, 2] > 0, len(names) - 1, 0).astype(np.int32)
    zero = np.zeros(v, np.int32)
    return replace(whole, provenance=Provenance(np.full(v, 0.05), laser, zero, zero, names))


def test_what_all_points_share_does_not_average_out() -> None:
    mesh, s = known_ball(), 1e-3
    x = mesh.vertices
    larger = shapes.Source(moves=[s * x])
    assert shapes.volume_sigma(mesh, larger).shared == pytest.approx(3 * s * mesh.volume)
    several = shapes.Source(moves=[s * x, 2 * s * x])
    known = shapes.volume_sigma(mesh, several)
    assert known.shared == pytest.approx(5**0.5 * 3 * s * mesh.volume), "independent of each other"
    assert known.mostly == "the calibration"
    assert known.total > known.shared
    assert shapes.volume(mesh, several).sigma == pytest.approx(known.total)
    rigid = shapes.Source(moves=[np.ones_like(x), np.cross((0.3, 0.2, 1.0), x)])
    assert shapes.volume_sigma(mesh, rigid).shared < 1e-9 * mesh.volume


def test_a_pose_that_is_off_moves_what_it_measured() -> None:
    """A half of a ball lifted by s: a disc of its equator's area and s mm height is added."""
    mesh, s = known_ball(("one left", "two left")), 0.02
    covariance = np.zeros((2, 6, 6))
    covariance[1, 5, 5] = s**2
    here = Pose(np.eye(3), np.zeros(3))
    found = Alignment(("one", "two"), (here, here), np.zeros((2, 3)), covariance, (), (), ())
    said = shapes.volume_sigma(mesh, shapes.Source(moves=pose_moves(found, mesh))).shared
    assert said == pytest.approx(np.pi * 20.0**2 * s, rel=0.05)


def seen_ball() -> tuple[Rig, Mesh, RangeGrid]:
    """A ball each of whose points was seen where the turning table brought it into the sheet."""
    rng = np.random.default_rng(3)
    bare = make_rig(elevation=0.2, lift=25.0)
    sizes = 1e-3 * np.where(
        ["offset" in n or "shift" in n for n in bare.parameter_names], 50.0, 0.2
    )
    sizes *= np.array([not n.startswith("camera.") for n in bare.parameter_names])
    A = sizes[:, None] * rng.standard_normal((len(sizes), len(sizes)))
    rig = replace(bare, covariance=A @ A.T)
    mesh = known_ball(("L0",))
    mesh = replace(mesh, vertices=mesh.vertices + (0.0, 0.0, 25.0))
    v, x = len(mesh.vertices), mesh.vertices
    angles = brought(rig, x)
    step = np.arange(v, dtype=np.int32)
    zero = np.zeros(v, np.int32)
    mesh = replace(mesh, provenance=Provenance(np.full(v, 0.05), zero, step, zero, ("L0",)))
    one = np.ones((v, 1))
    grid = RangeGrid("L0", step, angles, x[:, None], one, one, one.astype(np.uint16), False)
    return rig, mesh, grid


def test_the_calibration_moves_a_volume_as_a_rig_that_is_off_does() -> None:
    rig, mesh, grid = seen_ball()
    x, angles = mesh.vertices, grid.angles
    said = shapes.volume_sigma(mesh, shapes.Source((grid,), rig)).shared
    pixels = pixels_of(rig, x, angles)
    true = 0.0
    values, directions = np.linalg.eigh(rig.covariance)
    for value, direction in zip(values, directions.T, strict=True):
        if value > 0:
            ends = []
            for sign in (0.01, -0.01):
                off = rig.perturbed(sign * np.sqrt(value) * direction)
                seen = off.sheet("L0").intersect(off.camera.rays(pixels))
                ends.append(replace(mesh, vertices=to_object(off, seen, angles)).volume)
            true += ((ends[0] - ends[1]) / 0.02) ** 2
    assert true > 0
    assert said == pytest.approx(true**0.5, rel=1e-3)
    bare = replace(rig, covariance=None)
    unknown = shapes.volume_sigma(mesh, shapes.Source((grid,), bare))
    assert unknown.shared == 0.0


def test_the_light_moves_a_volume_without_averaging_out() -> None:
    """Of a rig that is known exactly: every point is off outward by as much."""
    rig, mesh, grid = seen_ball()
    bare = replace(rig, covariance=None)
    outward = (mesh.vertices - (0.0, 0.0, 25.0)) / 20.0
    thick = replace(grid, light_doubt=(0.01 * outward[:, None]).astype(np.float32))
    said = shapes.volume_sigma(mesh, shapes.Source((thick,), bare)).shared
    assert said == pytest.approx(4 * np.pi * 20.0**2 * 0.01, rel=0.02)


def test_poses_that_one_rig_measured_share_its_calibration() -> None:
    rig, mesh, grid = seen_ball()
    alone = shapes.volume_sigma(mesh, shapes.Source((grid,), rig)).shared
    p = mesh.provenance
    assert p is not None
    pose = Pose(rotation_from_vector([0.7, -0.4, 1.9]), np.array([5.0, -30.0, 12.0]))
    tipped = replace(
        mesh, vertices=pose.apply(mesh.vertices), provenance=replace(p, lasers=("a L0",))
    )
    view = shapes.View(grid, rig, "a L0", pose)
    said = shapes.volume_sigma(tipped, shapes.Source(placed=(view,))).shared
    assert said == pytest.approx(alone)

    upper = (mesh.vertices[:, 2] > 25.0).astype(np.int32)
    halves = replace(mesh, provenance=replace(p, laser=upper, lasers=("a L0", "b L0")))
    views = [shapes.View(grid, rig, "a L0"), shapes.View(grid, rig, "b L0")]
    said = shapes.volume_sigma(halves, shapes.Source(placed=views)).shared
    assert said == pytest.approx(alone), "an error of the rig is in both"
    apart = [views[0], shapes.View(grid, replace(rig), "b L0")]
    said = shapes.volume_sigma(halves, shapes.Source(placed=apart)).shared
    assert 0.5 * alone < said < 0.95 * alone, "errors of two rigs average out"


def brought(rig: Rig, x: np.ndarray) -> np.ndarray:
    """(v,) table angles at which points (v, 3) of the object lie in the first sheet."""
    sheet, T = rig.sheets[0], rig.T_camera_table
    n, d = T.rotation.T @ sheet.normal, sheet.normal @ (sheet.centre - T.translation)
    a, b = n[0] * x[:, 0] + n[1] * x[:, 1], n[1] * x[:, 0] - n[0] * x[:, 1]
    angles = np.arctan2(b, a) + np.arccos(np.clip((d - n[2] * x[:, 2]) / np.hypot(a, b), -1, 1))
    return np.asarray(angles)


def test_what_a_merge_puts_between_profiles_is_doubted() -> None:
    """Between the profiles of a ball stands what a smooth surface holds more than its faces do."""
    mesh = ball(n=40)
    normals = mesh.vertices / 20.0
    coarse = RangeSurface(mesh, 100.0 * normals, normals)
    lost = 4 / 3 * np.pi * 20.0**3 - mesh.volume
    said = shapes.volume_sigma(mesh, shapes.Source(profiles=[coarse]))
    assert said.profiles == pytest.approx(lost, rel=0.1)
    flat = RangeSurface(mesh, normals, np.tile((0.0, 0.0, 1.0), (len(normals), 1)))
    assert shapes.volume_sigma(mesh, shapes.Source(profiles=[flat])).profiles == 0.0


@pytest.mark.parametrize("slope", [30.0, 45.0])
def test_the_cap_of_a_cone_is_as_uncertain_as_the_tip_that_it_cuts_off(slope: float) -> None:
    """Over a flat cap of radius a the tangent planes of its rim make a cone again: the distance of
    a place at r from the nearest of them is (a − r) sin β, over the cap π a³/3 sin β in all. The
    tip that is missing holds π a³/3 tan β."""
    a, around = 6.0, 90
    beta = np.radians(slope)
    phi = np.arange(around) * 2 * np.pi / around
    radii = np.array([6, 7, 8, 9, 10, 11, 12, 13.0, 14, 15, 16])
    ring = [np.stack([r * np.cos(phi), r * np.sin(phi), 0 * phi + (a - r) * np.tan(beta)], -1)
            for r in radii]  # fmt: skip
    cap = [np.stack([r * np.cos(phi), r * np.sin(phi), 0 * phi], -1) for r in (4.5, 3.0, 1.5)]
    low = [np.stack([r * np.cos(phi), r * np.sin(phi), 0 * phi + ring[-1][0, 2]], -1) for r in (8,)]
    rows = [*cap[::-1], *ring, *low]
    points = np.concatenate([*rows, [[0, 0, 0], [0, 0, ring[-1][0, 2]]]])
    k = np.arange(around)
    on = (k + 1) % around
    faces = []
    for m in range(len(rows) - 1):
        here, there = m * around, (m + 1) * around
        faces += [np.stack([here + k, there + k, there + on], -1)]
        faces += [np.stack([here + k, there + on, here + on], -1)]
    n = len(rows) * around
    last = (len(rows) - 1) * around
    faces += [np.stack([np.full(around, n), k, on], -1)]
    faces += [np.stack([np.full(around, n + 1), last + on, last + k], -1)]
    mesh = Mesh(points, np.concatenate(faces).astype(np.int32))
    assert is_closed(mesh)
    assert mesh.volume > 0
    middle = mesh.triangles.mean(axis=1)
    capped = (np.hypot(middle[:, 0], middle[:, 1]) < a) & (middle[:, 2] > -1e-6)
    said = shapes.volume_sigma(replace(mesh, measured=~capped)).filled
    third = np.pi * a**3 / 3
    # The normals of the rim are averaged over a few rings, the cap's too, so they lean less.
    assert 0.45 * third * np.sin(beta) < said < 1.1 * third * np.tan(beta)


@pytest.mark.parametrize("strip", [1, 3])
def test_a_lid_that_goes_on_from_a_strip_of_its_own_plane_is_known_better(strip: int) -> None:
    """Of a can's top a rim alone was measured: the edge beside it is no bulge of the lid."""
    phi = 2 * np.pi * np.arange(60)[:, None] / 60
    r = np.concatenate([np.full(30, 20.0), 20.0 - 0.5 * np.arange(1, strip + 1)])
    z = np.concatenate([np.linspace(0.0, 40.0, 30), np.full(strip, 40.0)])
    points = np.stack([r * np.cos(phi), r * np.sin(phi), z + 0 * phi], axis=-1)
    closed = fill(mesh_grid(replace(plain_grid(points, phi[:, 0]), closed=True)), how="flat")
    assert is_closed(closed)
    said, true = shapes.volume_sigma(closed), np.pi * 20.0**2 * 40.0
    assert abs(closed.volume - true) < 2 * said.total + 0.005 * true
    # Doubted by normals that lean over the edge it would be 2.6 mm thick all over.
    # The lid below is one over an edge, a sample from it.
    assert said.filled < (0.6 + 40 / 29) * np.pi * 20.0**2
