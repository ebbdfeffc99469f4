"""Decimation: as near as asked, as few as asked, whole as before, out of measured vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mesh.checks import check_sound, cube, euler
from tests.mesh.open_meshes import ball
from tests.reports import into
from tests.surface.grids import column, random_grid, sheet_faces
from turnscan.errors import InputError
from turnscan.mesh import (
    Mesh,
    boundary_loops,
    components,
    crossings,
    cut_touching,
    is_closed,
    sample_surface,
    soundness,
)
from turnscan.progress import Progress
from turnscan.shapes import deviation
from turnscan.surface import mesh_grid
from turnscan.surface.decimation import _collapse_kernels as kernels
from turnscan.surface.decimation import decimate, decimation_findings, dissolve
from turnscan.surface.decimation._bucket_kernels import SIZE
from turnscan.surface.decimation._decimate import _net
from turnscan.surface.decimation._net_kernels import FOLLOW, HEAD, WAITS
from turnscan.surface.holes import close

TOLERANCE = 0.05


def apart(one: Mesh, two: Mesh) -> float:
    """mm: the largest distance of either surface from the other, by dense samples."""
    return max(
        float(np.abs(deviation(sample_surface(a, 60_000)[0], b).distance).max())
        for a, b in ((one, two), (two, one))
    )


def normals(mesh: Mesh) -> np.ndarray:
    t = mesh.triangles
    n = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(3))
def test_no_surface_lies_further_from_the_other_than_the_tolerance(seed: int) -> None:
    mesh = column(seed=seed)
    less = decimate(mesh, tolerance=TOLERANCE)
    check_sound(less)
    assert euler(less) == 0
    off = apart(mesh, less)
    # The floor: with noise of 0.02 mm and flutes half the tolerance is surely made use of.
    assert TOLERANCE / 2 < off <= TOLERANCE
    assert len(less.faces) < 0.5 * len(mesh.faces)
    assert len(decimate(mesh, tolerance=4 * TOLERANCE).faces) < 0.3 * len(less.faces)


def test_flat_sides_become_few_faces_and_edges_and_corners_stay() -> None:
    mesh = cube()
    less = decimate(mesh, tolerance=0.01)
    assert len(less.faces) < 60 < len(mesh.faces)
    assert is_closed(less)
    assert less.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert apart(mesh, less) < 1e-9
    corners = {tuple(v) for v in less.vertices.tolist()}
    assert corners >= {(x, y, z) for x in (0.0, 10.0) for y in (0.0, 10.0) for z in (0.0, 10.0)}


def test_a_noisy_cube_keeps_its_edges() -> None:
    mesh = cube()
    rng = np.random.default_rng(1)
    rough = replace(mesh, vertices=mesh.vertices + rng.normal(0, 0.01, mesh.vertices.shape))
    less = decimate(rough, faces=400)
    assert len(less.faces) == 400
    assert is_closed(less)
    # A cut edge would lie far inside; five sigma of three coordinates is 0.09 mm.
    assert np.abs(deviation(mesh.vertices, less).distance).max() < 0.09


def test_no_face_turns_over() -> None:
    mesh = column()
    less = decimate(mesh, faces=1000)
    near = deviation(less.triangles.mean(axis=1), mesh).face
    assert (np.einsum("ij,ij->i", normals(less), normals(mesh)[near]) > 0).all()


def thin_wall() -> tuple[Mesh, float]:
    """Two balls, the one 0.995 of the other, and their radius."""
    outside = ball(24)
    n, size = len(outside.vertices), float(np.linalg.norm(outside.vertices[0]))
    wall = Mesh(
        np.concatenate([outside.vertices, 0.995 * outside.vertices]),
        np.concatenate([outside.faces, outside.faces[:, ::-1] + n]),
    )
    return wall, size


def test_sides_of_a_thin_wall_do_not_cut_through_each_other() -> None:
    """The tolerance, three times the wall, would let them: 550 pairs of faces did."""
    wall, size = thin_wall()
    less = decimate(wall, tolerance=0.015 * size)
    assert len(less.faces) < 0.75 * len(wall.faces)
    assert not len(crossings(less))


@pytest.mark.parametrize("faces", [200, 1000])
def test_a_number_of_faces_that_a_thin_wall_does_not_stand_is_not_reached(faces: int) -> None:
    """208 and 472 pairs of faces cut through each other."""
    wall, _ = thin_wall()
    less = decimate(wall, faces=faces)
    assert faces < len(less.faces) < 0.75 * len(wall.faces)
    assert not soundness(less)
    told, warned = decimation_findings(wall, less, faces=faces)
    assert told.message == f"{len(less.faces)} of {len(wall.faces)} faces are left"
    assert (warned.severity, str(faces) in warned.message) == ("warning", True)
    assert str(warned.remedy).endswith(f": decimate={len(less.faces)}"), "which every door has"
    assert len(decimation_findings(wall, less, faces=len(less.faces))) == 1


def test_a_tolerance_as_large_as_the_part_is_said() -> None:
    """The middle one of its sides: neither a plate nor a rod is taken for a large part."""
    bar = replace(cube(4), vertices=cube(4).vertices * (10.0, 1.0, 0.1))  # 100 × 10 × 1 mm
    for tolerance in (0.5, 1.0):
        assert len(decimation_findings(bar, bar, tolerance=tolerance)) == 1
    for tolerance in (1.01, 500.0):
        _, warned = decimation_findings(bar, bar, tolerance=tolerance)
        said = f"a tolerance of {tolerance:g} mm is more than a tenth of the part, which is 10.0 mm"
        assert (warned.severity, said in warned.message) == ("warning", True)


def test_what_cut_through_itself_before_hides_nothing_new() -> None:
    wall, size = thin_wall()
    one = ball(24)
    places = [one.vertices + [size * x, 0.0, 0.0] for x in (10.0, 10.7)]
    n, m = len(wall.vertices), len(one.vertices)
    whole = Mesh(
        np.concatenate([wall.vertices, *places]),
        np.concatenate([wall.faces, one.faces + n, one.faces + n + m]),
    )
    assert len(crossings(whole))
    less = decimate(whole, tolerance=0.015 * size)
    there = less.vertices[less.faces[crossings(less)]][..., 0]
    assert there.min() > 5.0 * size, "nothing in the wall"


def test_vertices_that_are_left_stand_where_they_were_measured() -> None:
    mesh = column()
    p = mesh.provenance
    assert p is not None
    place = {(s, n): v for s, n, v in zip(p.step, p.line, mesh.vertices.tolist(), strict=True)}
    coloured = replace(mesh, colour=np.arange(3 * len(mesh.vertices)).reshape(-1, 3) % 251)
    less = decimate(coloured, faces=2000)
    q = less.provenance
    assert q is not None
    assert less.vertices.tolist() == [place[s, n] for s, n in zip(q.step, q.line, strict=True)]
    assert less.colour is not None
    assert q.lasers == p.lasers


def test_borders_stay_where_they_are() -> None:
    mesh = column()
    less = decimate(mesh, tolerance=TOLERANCE)
    loops = [mesh.vertices[k] for k in boundary_loops(mesh)]
    assert len(boundary_loops(less)) == len(loops) == 2
    for loop in boundary_loops(less):
        ring = less.vertices[loop]
        old = min(loops, key=lambda k: abs(k[:, 2].mean() - ring[:, 2].mean()))
        a, b = ring, np.roll(ring, -1, axis=0)
        t = np.einsum("pi,pij->pj", old, (b - a).T[None]) - np.einsum("ij,ij->i", a, b - a)
        t = np.clip(t / np.einsum("ij,ij->i", b - a, b - a), 0, 1)
        off = np.linalg.norm(a + t[..., None] * (b - a) - old[:, None], axis=2).min(axis=1)
        assert off.max() <= TOLERANCE


def test_what_was_not_measured_stays_marked_and_its_border_in_place() -> None:
    closed, _ = close(column())
    assert is_closed(closed)
    less = decimate(closed, faces=1500)
    assert is_closed(less)
    assert less.measured is not None
    for mesh in (closed, less):
        t = mesh.triangles
        size = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2
        added = size[~mesh.measured].sum()
        if mesh is closed:
            before = added
    assert added == pytest.approx(before, rel=0.01)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    missing=st.floats(0, 0.6),
    wanted=st.integers(4, 60),
    by_length=st.booleans(),
)
def test_whatever_is_missing_it_hangs_together_as_before(seed, missing, wanted, by_length) -> None:
    mesh = cut_touching(mesh_grid(random_grid(seed, 12, 12, missing, True, 0.0)))[0]
    less = decimate(mesh, tolerance=1.0) if by_length else decimate(mesh, faces=wanted)
    check_sound(less)
    assert euler(less) == euler(mesh)
    assert len(boundary_loops(less)) == len(boundary_loops(mesh))
    if len(mesh.faces):
        assert components(less).max() == components(mesh).max()


def test_vertices_that_coincide_and_faces_without_area_end_nothing() -> None:
    """Their faces have no inside to divide by: so do those that a box and Delete leave behind."""
    mesh = mesh_grid(random_grid(1, 24, 24, 0.1, True, 0.3))
    rng = np.random.default_rng(3)
    vertices = mesh.vertices.copy()
    pairs = mesh.faces[rng.integers(0, len(mesh.faces), 20)]
    vertices[pairs[:, 0]] = vertices[pairs[:, 1]]
    faces = mesh.faces[rng.random(len(mesh.faces)) > 0.2]
    before = Mesh(vertices, faces)
    for tolerance in (1e-3, 0.3, 100.0):
        after = decimate(before, tolerance=tolerance)
        assert 0 < len(after.faces) <= len(before.faces)
        assert {tuple(v) for v in after.vertices} <= {tuple(v) for v in vertices}


def test_the_same_input_gives_the_same_bytes_and_little_stays_as_it_is() -> None:
    mesh = column()
    one, two = decimate(mesh, faces=3000), decimate(mesh, faces=3000)
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert one.faces.tobytes() == two.faces.tobytes()
    assert decimate(mesh, faces=len(mesh.faces)) is mesh


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "neither a tolerance"),
        ({"tolerance": 0.0}, "tolerance of 0.0"),
        ({"tolerance": float("nan")}, "tolerance of nan"),
        ({"faces": 3}, "3 faces"),
    ],
)
def test_options_that_cannot_be_are_refused(options, words) -> None:
    with pytest.raises(InputError, match=words):
        decimate(cube(2), **options)


@pytest.mark.parametrize(("moves", "share"), [(1, 0), (40, 0), (700, 0.01), (4000, 0.3)])
def test_who_waits_waits_once_and_where_it_would_if_all_were_looked_at_anew(
    moves: int, share: float
) -> None:
    # After a move nobody who waits is priced anew: when it is its turn, it is asked again.
    mesh = mesh_grid(random_grid(3, 60, 70, 0.05, True, 0.0))
    net = _net(mesh, np.inf)
    ends, state = kernels.queue(net)
    left = kernels.collapse(net, ends, state, len(mesh.faces), 4, moves)
    assert left < len(mesh.faces)
    place = waiting(net, ends)
    assert len(place) == state[SIZE] == (net.ids[:, WAITS] == 1).sum() > 50
    assert (net.ids[list(place), HEAD] >= 0).all()
    anew = waiting(net, kernels.queue(net)[0])
    # Few have too many neighbours by now. What moves cost grows, but with a new neighbour.
    assert len(place.keys() - anew.keys()) < 0.01 * len(place) + 1
    late = sum(place[v] > anew[v] for v in place.keys() & anew.keys())
    assert late <= share * len(place)


def waiting(net, ends) -> dict[int, int]:
    """Who waits, and in which bucket. Fails where one waits twice."""
    found = dict[int, int]()
    for bucket in np.flatnonzero(ends[0] >= 0).tolist():
        v = int(ends[0, bucket])
        while v >= 0:
            assert v not in found
            found[v] = bucket
            v = int(net.ids[v, FOLLOW])
    return found


def test_the_share_done_is_told_and_the_result_is_the_same_however_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = column()
    for options in ({"tolerance": TOLERANCE}, {"faces": 2000}, {"tolerance": 0.2, "faces": 800}):
        shares = list[float]()
        monkeypatch.undo()
        once = decimate(mesh, **options)  # type: ignore[arg-type]
        monkeypatch.setattr("turnscan.surface.decimation._decimate._AT_A_TIME", 97)
        often = decimate(mesh, **options, progress=into(shares))  # type: ignore[arg-type]
        assert np.array_equal(once.vertices, often.vertices)
        assert np.array_equal(once.faces, often.faces)
        assert len(shares) > 20
        assert shares == sorted(shares)
        assert shares[0] == 0
        assert 0.8 < shares[-1] < 1


def test_it_ends_where_who_is_told_wants_that(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turnscan.surface.decimation._decimate._AT_A_TIME", 97)
    heard = list[float]()

    def end(share: float, _: str) -> None:
        heard.append(share)
        if share > 0.5:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        decimate(column(), tolerance=TOLERANCE, progress=Progress(end))
    assert [share > 0.5 for share in heard].count(True) == 1


def test_dissolved_vertices_go_and_all_others_stay_in_place() -> None:
    mesh = column(seed=4)
    which = np.random.default_rng(5).random(len(mesh.vertices)) < 0.3
    less, left = dissolve(mesh, which)
    check_sound(less)
    assert euler(less) == euler(mesh)
    stays = {tuple(v) for v in mesh.vertices[~which].tolist()}
    now = {tuple(v) for v in less.vertices.tolist()}
    assert stays <= now
    # Few are hemmed in by what may not turn over, and those are named.
    assert np.array_equal(less.vertices, mesh.vertices[left])
    assert (left & which).sum() == len(now - stays)
    assert (left & which).sum() < 0.05 * which.sum()
    assert apart(mesh, less) < 1.0, "faces grow, the surface stays"


@given(st.integers(0, 10_000), st.floats(0.3, 0.8), st.floats(0.06, 0.2))
@settings(max_examples=30)
def test_what_is_dissolved_makes_no_faces_that_cut_through_each_other(seed, share, gap) -> None:
    """Two bent sheets, no further from each other than chords leave them."""
    rng = np.random.default_rng(seed)
    angle, height = np.meshgrid(np.arange(20) * 0.05, np.arange(16) * 0.5, indexing="ij")
    radius = 10 + rng.uniform(-0.04, 0.04, angle.shape)
    faces = sheet_faces(*angle.shape)
    X = np.concatenate([
        np.stack([r * np.cos(angle), r * np.sin(angle), height], axis=-1).reshape(-1, 3)
        for r in (radius, radius + gap)
    ])  # fmt: skip
    mesh = Mesh(X, np.concatenate([faces, faces + angle.size]))
    assume(not len(crossings(mesh)))
    which = rng.random(len(X)) < share
    less, left = dissolve(mesh, which)
    assert not len(crossings(less))
    assert np.array_equal(less.vertices, mesh.vertices[left])
    assert left[~which].all()
    assert (left & which).sum() < 0.3 * which.sum()


@pytest.mark.parametrize("mesh", [column(seed=4), Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))])
def test_where_nothing_is_dissolved_nothing_changes(mesh: Mesh) -> None:
    less, left = dissolve(mesh, np.zeros(len(mesh.vertices), dtype=np.bool_))
    assert left.all()
    assert np.array_equal(less.faces, mesh.faces)
    assert np.array_equal(less.vertices, mesh.vertices)


@pytest.mark.parametrize("power", [-20, 20])
def test_the_unit_of_length_changes_nothing(power: int) -> None:
    mesh = mesh_grid(random_grid(3, 40, 48, 0.05, True, 0.0))
    same = Mesh(mesh.vertices * 2.0**power, mesh.faces)
    less = decimate(mesh, faces=1000)
    assert np.array_equal(decimate(same, faces=1000).faces, less.faces)
