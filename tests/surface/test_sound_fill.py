"""What the automatic filling takes at edges and on round parts, and what is not filled at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.mesh.open_meshes import ball, opened, same_measured
from turnscan.arrays import Bools, Ints
from turnscan.mesh import Mesh, is_closed, join, soundness
from turnscan.surface.holes import (
    ClosingOptions,
    FillHow,
    Hole,
    _close,
    close,
    closings,
    fill,
    fill_soundly,
    holes,
)
from turnscan.surface.holes._self_intersections import Repaired

SPACING = 0.5
"""mm between the points of the tubes."""


def tube(section: np.ndarray, height: float = 10.0) -> Mesh:
    """The wall over a section (m, 2), counter-clockwise, its rims every other corner jagged."""
    m, rows = len(section), round(height / SPACING) + 1
    z = np.linspace(0.0, height, rows)
    grid = np.concatenate(
        [np.repeat(section[None], rows, axis=0), np.repeat(z[:, None, None], m, axis=1)], axis=-1
    )
    grid[0, ::2, 2] += SPACING / 2
    grid[-1, ::2, 2] -= SPACING / 2
    cell = np.arange(rows * m).reshape(rows, m)
    a, b = cell[:-1].ravel(), np.roll(cell, -1, axis=1)[:-1].ravel()
    c, d = np.roll(cell, -1, axis=1)[1:].ravel(), cell[1:].ravel()
    return Mesh(
        grid.reshape(-1, 3), np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    )


def circle(radius: float = 8.0) -> np.ndarray:
    turn = np.arange(0, 2 * np.pi, SPACING / radius)
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def square(side: float = 14.0) -> np.ndarray:
    along = np.arange(0, side, SPACING) - side / 2
    one = np.column_stack([along, np.full_like(along, -side / 2)])
    return np.concatenate([one @ np.array([[c, s], [-s, c]]) for c, s in TURNS])


TURNS = ((1, 0), (0, 1), (-1, 0), (0, -1))


@pytest.mark.parametrize("section", [circle(), square()], ids=["cylinder", "cube"])
def test_what_ends_in_an_edge_is_closed_flat(section: np.ndarray) -> None:
    """The jags are all that is known of where the edge lies, so that far the lid may be off."""
    wall = tube(section)
    done = fill(wall)
    assert is_closed(done)
    assert soundness(done) == []
    assert same_measured(wall, done)
    new = done.triangles[~done.measured]
    top = new[new[..., 2].mean(axis=1) > 5.0]
    assert top[..., 2].max() <= 10.0
    assert top[..., 2].min() >= 10.0 - SPACING / 2
    bulging = fill(wall, how="tangent")
    assert bulging.bounds[1, 2] > 12.0, "what it would do else"


def test_a_round_cap_stays_round() -> None:
    """A ball that lacks less than a quarter; the plate's own error over a cap of 0.7 radians."""
    lacking = opened(ball(40), [0.3, 0.2, 1.0], 0.7)
    done, plate = fill(lacking), fill(lacking, how="tangent")
    assert done.vertices.tobytes() == plate.vertices.tobytes()
    new = done.triangles[~done.measured].mean(axis=1)
    low = np.linalg.norm(new, axis=1).min()
    assert low > 10.0 * np.cos(0.7) + 0.8 * 10.0 * (1 - np.cos(0.7)), "most of its rise"


def test_more_than_a_quarter_of_a_ball_is_not_invented() -> None:
    half = opened(ball(40), [0.0, 0.0, 1.0], np.pi / 2)
    done = fill(half)
    spacing = np.pi * 10.0 / 40
    assert done.bounds[1, 2] < half.bounds[1, 2] + 1e-9
    new = done.triangles[~done.measured]
    assert new[..., 2].min() > half.bounds[1, 2] - spacing


def test_a_hole_across_an_edge_goes_on_on_both_sides() -> None:
    """Half of its border is on either side, at 45° to its best plane: no edge runs round it."""
    wall = tube(square())
    middle = wall.triangles.mean(axis=1)
    gone = np.linalg.norm(middle - (7.0, 7.0, 5.0), axis=1) < 2.5
    torn = Mesh(wall.vertices, wall.faces[~gone])
    small = min(holes(torn), key=lambda h: h.size)
    assert np.array_equal(fill(torn, [small]).vertices, fill(torn, [small], how="tangent").vertices)


def needled() -> tuple[Mesh, Hole, Hole]:
    """A ball with a mouth that needles stand in, and a small hole below; both holes."""
    mouth = opened(opened(ball(24), (0, 0, 1), 0.8), (0, 0, -1), 0.2)
    x, y = np.mgrid[-5.5:6, -5.5:6].reshape(2, -1)
    places = np.stack([x, y, 0 * x + 7.5], axis=-1)[np.hypot(x, y) < 6]
    needles = [Mesh(p + 0.02 * ball(3).vertices * (1, 1, 12), ball(3).faces) for p in places]
    mesh = join([mouth, *needles])
    one, other = sorted(holes(mesh), key=lambda h: h.size)
    return mesh, other, one


@pytest.mark.parametrize("how", ["auto", "flat", "membrane", "tangent", "curvature"])
def test_what_would_cut_the_surface_is_not_filled(how: FillHow) -> None:
    mesh, mouth, small = needled()
    done = fill_soundly(mesh, [mouth, small], how)
    assert [h.size for h in done.left] == [mouth.size]
    assert soundness(done.mesh) == []
    assert same_measured(mesh, done.mesh)
    assert [h.size for h in holes(done.mesh)] == [mouth.size]


def test_one_face_that_cuts_is_enough() -> None:
    """No share of the patch and no number of faces: a single needle through a lid of no middle."""
    wall = tube(circle())
    needle = Mesh((0.3, 0.2, 9.9) + 0.02 * ball(3).vertices * (1, 1, 12), ball(3).faces)
    mesh = join([wall, needle])
    top = max(holes(mesh), key=lambda h: h.centre[2])
    assert [h.size for h in fill_soundly(mesh, [top], "flat").left] == [top.size]
    assert fill_soundly(wall, [max(holes(wall), key=lambda h: h.centre[2])], "flat").left == []


def test_of_two_patches_that_meet_one_stays() -> None:
    """Two bowls, one over the other: their lids are at one height."""
    lower = opened(ball(24), (0, 0, 1), 0.9)
    upper = opened(ball(24), (0, 0, -1), 0.7)
    edge = float(lower.vertices[holes(lower)[0].loop, 2].mean())
    rim = float(upper.vertices[holes(upper)[0].loop, 2].mean())
    raised = Mesh(upper.vertices * (0.4, 0.4, 1.0) + (0, 0, edge - rim + 0.3), upper.faces)
    mesh = join([lower, raised])
    assert soundness(fill(mesh, how="tangent")) != []
    done = fill_soundly(mesh, holes(mesh), "tangent")
    assert len(done.left) == 1
    assert soundness(done.mesh) == []


def test_a_top_that_would_cut_the_surface_stays_open_too() -> None:
    mesh, _, _ = needled()
    done, said = close(mesh, ClosingOptions(floor=None, top="plane"))
    assert len(holes(done)) == 1
    assert [f.code for f in said if f.severity == "warning"] == ["surface.unfilled"]


@pytest.mark.parametrize(
    ("caps", "left"),
    [
        (ClosingOptions(), []),
        (ClosingOptions(bottom="open"), [0.0]),
        (ClosingOptions(top="open"), [10.0]),
        (ClosingOptions(bottom="open", top="open"), [0.0, 10.0]),
        (ClosingOptions(floor=None, top=None), []),
        (ClosingOptions(floor=None, top=None, holes=None), [0.0, 10.0]),
    ],
)
def test_floor_and_top_are_closed_or_left_each_by_itself(
    caps: ClosingOptions, left: list[float]
) -> None:
    wall = tube(circle())
    done, _ = close(wall, caps)
    found = sorted(holes(done), key=lambda h: h.centre[2])
    assert [h.centre[2] for h in found] == pytest.approx(left, abs=SPACING / 2)
    words = closings(wall, holes(wall), caps, done)
    assert sorted(words).count("open") == len(left)


def test_nothing_is_filled_below_what_the_part_stands_on() -> None:
    """A ball whose lowest third was not seen; a hand holds its border above the platter."""
    mesh = opened(ball(40), [0, 0, -1], np.deg2rad(60))
    free = close(mesh, ClosingOptions(floor=None, holes="curvature"))[0]
    assert free.vertices[:, 2].min() < -8.0
    stood = close(mesh, ClosingOptions(floor=-7.0, reach=1.0, holes="curvature"))[0]
    assert stood.vertices[:, 2].min() == -7.0
    assert is_closed(stood)
    assert soundness(stood) == []
    assert same_measured(mesh, stood)
    # Where something measured hangs below the platter's edge, that much is free.
    hung = close(mesh, ClosingOptions(floor=0.0, reach=1.0, holes="curvature"))[0]
    assert hung.vertices[:, 2].min() == mesh.vertices[:, 2].min()
    assert soundness(hung) == []


def ring_taken_out(rows: slice) -> tuple[Mesh, Mesh]:
    """A tube of 41 rings of 24 corners, and the same without the faces between some of them."""
    rings, around = 41, 24
    turn = 2 * np.pi * np.arange(around) / around
    z = np.repeat(np.arange(rings), around)
    corners = np.column_stack([np.tile(np.cos(turn), rings), np.tile(np.sin(turn), rings), z])
    here = np.arange((rings - 1) * around).reshape(-1, around)
    after = np.roll(here, -1, axis=1)
    sides = np.stack(
        [
            np.stack([here, after, after + around], -1),
            np.stack([here, after + around, here + around], -1),
        ],
        axis=2,
    )
    keep = np.ones(rings - 1, dtype=bool)
    keep[rows] = False
    faces = sides.astype(np.int32)
    return Mesh(corners, faces.reshape(-1, 3)), Mesh(corners, faces[keep].reshape(-1, 3))


@pytest.mark.parametrize(
    ("rows", "parted"), [(slice(20, 22), True), (slice(0, 2), False), (slice(40, 41), False)]
)
def test_a_surface_without_a_ring_of_faces_is_in_two_pieces(rows: slice, parted: bool) -> None:
    assert _close._parted(*ring_taken_out(rows)) is parted


@pytest.mark.parametrize(
    ("taken", "lost"), [(slice(0, 11), True), (slice(0, 4), False), (slice(0, 0), False)]
)
def test_a_piece_that_gives_way_is_lost(taken: slice, lost: bool) -> None:
    """The far end of a plate was cut off whole once, and the rest closed with a fifth of its
    volume; what goes of the rim of a piece may go."""
    _, rings = ring_taken_out(slice(11, 12))
    before, _ = ring_taken_out(slice(0, 0))
    two = replace(before, faces=rings.faces)
    gone = np.zeros(len(two.faces), dtype=bool)
    gone[48 * taken.start : 48 * taken.stop] = True
    assert _close._parted(two, replace(two, faces=two.faces[~gone])) is lost


def test_a_crumb_may_give_way() -> None:
    tube, _ = ring_taken_out(slice(0, 0))
    apart = np.arange(3, dtype=np.int32) + len(tube.vertices)
    corners = np.vstack([tube.vertices, [[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.0, 1.0]]])
    both = replace(tube, vertices=corners, faces=np.vstack([tube.faces, apart[None]]))
    assert not _close._parted(both, replace(both, faces=tube.faces))


def test_a_repair_that_cuts_the_surface_in_two_leaves_the_largest_gap_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A shaft that lay was closed in two halves once, 6 mm apart, with half of its volume."""
    both = opened(opened(ball(24), (0.0, 0.0, 1.0), 0.5), (0.0, 0.0, -1.0), 0.8)
    large, small = sorted(holes(both), key=lambda h: -h.size)
    real, first = _close.repair_self_intersections, iter([True, False])

    def repaired(mesh: Mesh, owner: Ints, flat: Bools, *, hold: bool) -> Repaired:
        return replace(real(mesh, owner, flat, hold=hold), replaced=1)

    monkeypatch.setattr(_close, "repair_self_intersections", repaired)
    monkeypatch.setattr(_close, "_parted", lambda *_: next(first))
    done, said = close(both, ClosingOptions(floor=None, top=None))
    (left,) = [f for f in said if f.code == "surface.unfilled"]
    assert left.message.startswith("1 gap(s)")
    (still,) = holes(done)
    assert still.size == pytest.approx(large.size)
    assert small.size < large.size
