"""The cause of a hole: from the frame's flags where it could be seen, else from what hides it."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from tests.analytic import cylinder, full_turn, make_rig, scan_shape, sphere
from tests.surface.bars import leaning_bar
from turnscan import points
from turnscan.edit import by_cause
from turnscan.mesh import Mesh, cut_touching, join, submesh
from turnscan.points import RangeGrid, Volume
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import StripeFlag
from turnscan.surface import mesh_grid
from turnscan.surface.clean import drop_islands
from turnscan.surface.holes import CAUSE_WORDS, Cause, ScanCoverage, _hole_places, explain, holes
from turnscan.surface.holes import _causes as causes
from turnscan.surface.holes._hole_places import places_in

STEPS = 60


@pytest.fixture(scope="module")
def scanned() -> tuple[Rig, RangeGrid]:
    rig = make_rig(elevation=0.1, lift=20.0)
    stripes = scan_shape(rig, cylinder(25, 0, 40), full_turn(STEPS))
    return rig, points.build_grid(rig, "L0", stripes, np.arange(STEPS), full_turn(STEPS))


def _cause(rig: Rig, grid: RangeGrid, volume: Volume, more: Mesh | None = None) -> Cause | None:
    """Of the hole that looks sideways."""
    mesh = mesh_grid(grid)
    whole = mesh if more is None else join([mesh, more])
    found = holes(mesh)
    named = explain(whole, found, [ScanCoverage(rig, grid, volume)])
    return next(h.cause for h in named if h.size < 40)


def _window(grid: RangeGrid, flag: StripeFlag) -> RangeGrid:
    """A window in the wall, five steps wide, missing for that reason."""
    gone = np.zeros(grid.flags.shape, dtype=np.bool_)
    lines = np.flatnonzero(grid.found[20])
    gone[20:25, lines[len(lines) // 3] : lines[2 * len(lines) // 3]] = True
    return points.without(grid, gone & grid.found, flag)


@pytest.mark.parametrize(
    ("flag", "cause"),
    [
        (StripeFlag.DARK, "dark"),
        (StripeFlag.DARK | StripeFlag.AMBIGUOUS, "ambiguous"),
        (StripeFlag.AMBIGUOUS, "removed"),
        (StripeFlag.EDGE, "removed"),
        (StripeFlag.HAND, "deleted"),
        (StripeFlag.SATURATED, "saturated"),
    ],
)
def test_what_was_lit_and_seen_is_explained_by_the_frame(
    scanned: tuple[Rig, RangeGrid], flag: StripeFlag, cause: Cause
) -> None:
    rig, grid = scanned
    assert _cause(rig, _window(grid, flag), Volume()) == cause


def test_where_profiles_were_switched_off_by_hand_the_hole_was_deleted() -> None:
    rig, turn = make_rig(elevation=0.1, lift=20.0), full_turn(STEPS)
    stripes = scan_shape(rig, sphere(20, (0.0, 0.0, 20.0)), turn)
    gone = np.arange(20, 24)
    on = np.delete(np.arange(STEPS), gone)
    grid = points.build_grid(rig, "L0", [stripes[k] for k in on], on, turn[on])
    mesh = drop_islands(cut_touching(mesh_grid(grid))[0])[0]
    found = holes(mesh)
    for off, named in ((turn[gone], {"deleted"}), (turn[:0], {"laser", "camera"})):
        view = ScanCoverage(rig, grid, Volume(), off=off)
        largest = max(explain(mesh, found, [view]), key=lambda h: h.size)
        assert largest.size > 35
        assert largest.cause in named


def test_what_the_volume_leaves_out_is_outside(scanned: tuple[Rig, RangeGrid]) -> None:
    rig, grid = scanned
    low, high = Volume(z_min=5.0), holes(mesh_grid(grid))
    cut = points.clip(grid, low)
    mesh = mesh_grid(cut)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, cut, low)])
    foot = min(named, key=lambda h: h.centre[2])
    assert foot.cause == "outside"
    assert len(high) == len(named)


@pytest.mark.parametrize("hider", ["laser", "camera"])
def test_a_screen_before_one_of_them_hides_the_window(
    scanned: tuple[Rig, RangeGrid], hider: Cause
) -> None:
    """A screen turns with the part and stands between the window and the laser or the camera."""
    rig, grid = scanned
    missing, middle, way = _before(rig, grid, hider)
    assert _cause(rig, missing, Volume(), _screen(middle, way, 14.0)) == hider


@pytest.mark.parametrize(
    ("hider", "apart", "named"),
    [("laser", 2.0, "laser"), ("camera", 2.0, "camera"), ("laser", 60.0, "dark")],
)
def test_a_screen_whose_points_were_removed_hides_the_window_too(
    scanned: tuple[Rig, RangeGrid], hider: Cause, apart: float, named: Cause
) -> None:
    """Its points so many mm apart: a stray that stands alone hides nothing."""
    rig, grid = scanned
    missing, middle, way = _before(rig, grid, hider)
    lines = np.arange(-14.0, 14.0, apart)
    y, z = (a.ravel() for a in np.meshgrid(lines + 14.0 * (apart > 28), lines))
    across = np.cross(way, [0.0, 0.0, 1.0]) / np.linalg.norm(way[:2])
    up = np.cross(across, way) / np.linalg.norm(way)
    taken = np.where(missing.found[..., None], missing.points, np.nan)
    free = np.argwhere(~missing.found)[-len(y) :]
    taken[free[:, 0], free[:, 1]] = middle + y[:, None] * across + z[:, None] * up
    mesh = mesh_grid(missing)
    view = ScanCoverage(rig, missing, Volume(), taken=taken)
    causes_found = explain(mesh, holes(mesh), [view])
    assert next(h.cause for h in causes_found if h.size < 40) == named


def _before(rig: Rig, grid: RangeGrid, hider: Cause) -> tuple[RangeGrid, np.ndarray, np.ndarray]:
    """A window, a place before it, and the way on from there to the laser or the camera."""
    missing = _window(grid, StripeFlag.DARK)
    window = min(holes(mesh_grid(missing)), key=lambda h: h.size)
    T = rig.T_camera_table.inverse()
    there = T.translation if hider == "camera" else T.apply(rig.light_source("L0"))
    # The table angle at which the window passes the sheet, and the screen half way to there.
    off = [
        rig.sheet("L0").distance(rig.T_camera_table.apply(rotation_z(a) @ window.centre))
        for a in grid.angles
    ]
    outward = [float((rotation_z(a) @ window.centre)[:2] @ T.translation[:2]) for a in grid.angles]
    step = min((k for k in range(STEPS) if outward[k] > 0), key=lambda k: abs(off[k]))
    end = rotation_z(-grid.angles[step]) @ there
    middle = window.centre + 0.1 * (end - window.centre)
    return missing, middle, end - middle


def _screen(at: np.ndarray, facing: np.ndarray, half: float) -> Mesh:
    n = facing / np.linalg.norm(facing)
    e1 = np.cross(n, [0.0, 0.0, 1.0])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(n, e1)
    corners = [at + half * (a * e1 + b * e2) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def test_without_a_rig_no_cause_is_named(scanned: tuple[Rig, RangeGrid]) -> None:
    mesh = mesh_grid(scanned[1])
    found = holes(mesh)
    assert explain(mesh, found, []) == found
    assert all(h.cause is None for h in found)


def test_an_open_turn_leaves_what_never_passed_the_sheet_outside(
    scanned: tuple[Rig, RangeGrid],
) -> None:
    rig, grid = scanned
    stripes = scan_shape(rig, cylinder(25, 0, 40), full_turn(STEPS)[: STEPS // 2])
    half = points.build_grid(rig, "L0", stripes, np.arange(STEPS // 2), grid.angles[: STEPS // 2])
    mesh = mesh_grid(half)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, half, Volume())])
    assert [h.cause for h in named] == ["outside"]
    assert named[0].loop.tolist() == holes(mesh)[0].loop.tolist()


def test_what_is_missing_beside_the_dark_is_missing_for_the_dark(
    scanned: tuple[Rig, RangeGrid],
) -> None:
    """The clean-up takes the last points round a dark patch, be they most of the hole."""
    rig, grid = scanned
    lines = np.flatnonzero(grid.found[20])
    middle = lines[len(lines) // 2]
    gone, dark = np.zeros((2, *grid.flags.shape), dtype=np.bool_)
    gone[19:26, middle - 4 : middle + 5] = True
    dark[20:25, middle - 3 : middle + 4 : 2] = True
    cut = points.without(grid, gone & ~dark & grid.found, StripeFlag.EDGE)
    assert gone.sum() > 2 * dark.sum()
    assert _cause(rig, cut, Volume()) == "removed"
    assert _cause(rig, points.without(cut, dark, StripeFlag.DARK), Volume()) == "dark"


def test_the_border_of_an_island_is_explained_by_what_is_about_it(
    scanned: tuple[Rig, RangeGrid],
) -> None:
    rig, grid = scanned
    lines = np.flatnonzero(grid.found[20])
    low, high = lines[len(lines) // 4], lines[3 * len(lines) // 4]
    ring = np.zeros(grid.flags.shape, dtype=np.bool_)
    ring[12:36, low:high] = True
    ring[19:29, low + 15 : high - 15] = False
    ringed = points.without(grid, ring & grid.found, StripeFlag.DARK)
    mesh = mesh_grid(ringed)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, ringed, Volume())])
    assert len(named) == 4  # both ends, and the ring's two sides
    island = min(named, key=lambda h: h.perimeter)
    assert island.cause == "dark"


def test_the_same_holes_get_the_same_causes(scanned: tuple[Rig, RangeGrid]) -> None:
    rig, grid = scanned
    missing = _window(grid, StripeFlag.DARK)
    mesh = mesh_grid(missing)
    found = holes(mesh)
    first, second = (explain(mesh, found, [ScanCoverage(rig, missing, Volume())]) for _ in range(2))
    assert [h.cause for h in first] == [h.cause for h in second]


@pytest.mark.parametrize(("wide", "cause"), [(1, "removed"), (5, "dark")])
def test_a_slit_no_wider_than_a_face_lacks_no_sample(
    scanned: tuple[Rig, RangeGrid], wide: int, cause: Cause
) -> None:
    """The dark about a slit at an edge is what lies beside the part, and not a dark patch."""
    rig, grid = scanned
    whole = mesh_grid(grid)
    corners = whole.vertices[whole.faces]
    turn = np.angle(np.exp(1j * (np.arctan2(corners[..., 1], corners[..., 0]) - 1.0)))
    high = np.abs(corners[..., 2] - 20.0) < 12.0
    step = 2 * np.pi / STEPS
    start = turn[turn > 0].min()
    strip = (turn > start - 1e-6) & (turn < start + (wide + 1e-3) * step) & high
    mesh = submesh(whole, ~strip.all(axis=1))
    lines = np.zeros(grid.found.shape, dtype=np.bool_)
    lines |= np.abs(grid.points[..., 2] - 20.0) < 13.0
    dark = points.without(grid, lines & grid.found, StripeFlag.DARK)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, dark, Volume())])
    assert next(h.cause for h in named if h.size < 40) == cause


@pytest.mark.parametrize(("light", "cause"), [(3.0, "dark"), (0.3, "removed")])
def test_what_hardly_showed_before_it_was_taken_away_is_dark(
    scanned: tuple[Rig, RangeGrid], light: float, cause: Cause
) -> None:
    """Speckle lifts a dark place over the threshold here and there; the clean-up takes it away.

    ``light`` is in the faintest light of the scan in the first case, in the usual in the second.
    """
    rig, grid = scanned
    window = _window(grid, StripeFlag.AMBIGUOUS)
    gone = grid.found & ~window.found
    usual = float(np.median(grid.amplitude[grid.found]))
    amplitude = np.where(grid.found, usual, np.nan)
    amplitude[0, np.flatnonzero(grid.found[0])[0]] = least = usual / 50
    amplitude[gone] = light * (least if cause == "dark" else usual)
    mesh = mesh_grid(window)
    sought = ScanCoverage(rig, window, Volume(), light=amplitude)
    named = explain(mesh, holes(mesh), [sought])
    assert next(h.cause for h in named if h.size < 40) == cause


def test_a_sample_of_one_laser_outweighs_the_dark_of_another(
    scanned: tuple[Rig, RangeGrid],
) -> None:
    """The mesh lacks a face there; the second scan found the place, the first did not."""
    rig, grid = scanned
    missing = _window(grid, StripeFlag.DARK)
    mesh = mesh_grid(missing)
    views = [ScanCoverage(rig, missing, Volume()), ScanCoverage(rig, grid, Volume())]
    named = explain(mesh, holes(mesh), views)
    assert next(h.cause for h in named if h.size < 40) == "removed"


@pytest.mark.parametrize(("bored", "causes"), [(False, {"dark"}), (True, {"laser", "camera"})])
def test_two_holes_that_one_looks_through_are_a_bore_and_not_dark(
    scanned: tuple[Rig, RangeGrid], bored: bool, causes: set[Cause]
) -> None:
    rig, grid = scanned
    gone = np.zeros(grid.flags.shape, dtype=np.bool_)
    lines = np.flatnonzero(grid.found[20])
    gone[20:25, lines[len(lines) // 3] : lines[2 * len(lines) // 3]] = True
    if bored:
        low, high = np.sort(grid.points[gone & grid.found][:, 2])[[0, -1]]
        z = grid.points[50:55, :, 2]
        gone[50:55] = (z >= low) & (z <= high)
    missing = points.without(grid, gone & grid.found, StripeFlag.DARK)
    mesh = mesh_grid(missing)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, missing, Volume())])
    small = [h for h in named if h.size < 40]
    assert len(small) == 1 + bored
    assert {h.cause for h in small} <= causes


def test_a_slender_hole_looks_where_its_border_does() -> None:
    """A steep riser is missing between two floors: what lies beside it looks another way."""
    x = np.array([-12.0, -8.0, -4.0, 0.0, 2.0, 6.0, 10.0, 14.0])
    y = np.where(x <= 0.0, 0.0, -10.0)
    z = np.arange(-160.0, 161.0, 4.0)
    vertices = np.stack([np.tile(x, len(z)), np.tile(y, len(z)), np.repeat(z, len(x))], axis=-1)
    i, j = np.meshgrid(np.arange(len(x) - 1), np.arange(len(z) - 1))
    i, j = i.ravel(), j.ravel()
    open_ = (i == 3) & (np.abs(z[j] + 2.0) < 120.0)
    a = (j * len(x) + i)[~open_]
    b, c, d = a + 1, a + 1 + len(x), a + len(x)
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([a, d, c], -1)]).astype(np.int32)
    mesh = Mesh(vertices, faces)
    hole = min(holes(mesh), key=lambda h: h.size)
    assert not places_in(mesh, [hole]).wide[0]
    normals = places_in(mesh, [hole]).normal
    riser = np.array([10.0, 2.0, 0.0]) / np.hypot(10.0, 2.0)
    assert np.abs(normals @ riser).min() > 0.99


@pytest.mark.parametrize(("off", "cause"), [(0.0, "removed"), (12.0, "dark")])
def test_only_points_that_were_taken_away_there_leave_a_hole_by_that(
    scanned: tuple[Rig, RangeGrid], off: float, cause: Cause
) -> None:
    """A stray on the same line of the picture, far from the place, says that here was no light."""
    rig, grid = scanned
    window = _window(grid, StripeFlag.AMBIGUOUS)
    taken = np.where(window.found[..., None], grid.points, grid.points + [0.0, 0.0, off])
    mesh = mesh_grid(window)
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, window, Volume(), taken=taken)])
    assert next(h.cause for h in named if h.size < 40) == cause


def _leaning_box(p: np.ndarray) -> np.ndarray:
    q = p - np.array([0.0, 0.0, 27.0])
    c, s = np.cos(np.deg2rad(40.0)), np.sin(np.deg2rad(40.0))
    x, y, z = c * q[..., 0] + s * q[..., 2], q[..., 1], c * q[..., 2] - s * q[..., 0]
    off = np.abs(np.stack([x, y, z], axis=-1)) - (20.0, 14.0, 8.0)
    return np.linalg.norm(np.maximum(off, 0.0), axis=-1) + np.minimum(off.max(axis=-1), 0.0)


def test_what_turns_away_at_an_edge_is_hidden_and_not_dark() -> None:
    """Flat patches over the gaps of a leaning box lie off it, in free sight of lamp and lens."""
    rig = make_rig(elevation=0.1, lift=20.0, lasers=(-0.4, 0.4))
    turn = full_turn(STEPS)
    stripes = scan_shape(rig, _leaning_box, turn)
    grid = points.build_grid(rig, "L0", stripes, np.arange(STEPS), turn)
    mesh = cut_touching(mesh_grid(grid))[0]
    mesh = drop_islands(mesh)[0]
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, grid, Volume())])
    assert sum(h.area > 100 for h in named) >= 3
    assert {h.cause for h in named if h.area > 100} <= {"laser", "camera"}


def _recessed_box(p: np.ndarray) -> np.ndarray:
    """A box of 40 mm with a recess of 12 × 12 mm, 30 mm deep, in one flank."""
    q = p - np.array([0.0, 0.0, 20.0])
    box, recess = np.abs(q) - 20.0, np.abs(q - (20.0, 0.0, 2.0)) - (30.0, 6.0, 6.0)
    off = [
        np.linalg.norm(np.maximum(o, 0.0), axis=-1) + np.minimum(o.max(axis=-1), 0.0)
        for o in (box, recess)
    ]
    return np.asarray(np.maximum(off[0], -off[1]))


def test_a_recess_whose_wall_shows_is_hidden_and_not_dark(monkeypatch: pytest.MonkeyPatch) -> None:
    """A smooth surface could span it, in free sight of lamp and lens: only the upper part of a wall
    says that none does."""
    rig = make_rig(elevation=0.1, lift=20.0, lasers=(-0.4, 0.4))
    turn = full_turn(90)
    stripes = scan_shape(rig, _recessed_box, turn)
    grid = points.build_grid(rig, "L0", stripes, np.arange(90), turn)
    mesh = drop_islands(cut_touching(mesh_grid(grid))[0])[0]

    def named() -> Cause | None:
        found = explain(mesh, holes(mesh), [ScanCoverage(rig, grid, Volume())])
        return next(h.cause for h in found if h.centre[0] > 15.0 and h.area > 100)

    assert named() in ("laser", "camera")
    monkeypatch.setattr(_hole_places, "_WALLED", 1.0)
    assert named() == "dark"


@pytest.mark.parametrize(
    ("turned", "guessed", "name"),
    [
        (60.0, False, "measurable"),
        (92.0, False, "grazing"),
        (110.0, False, "hidden"),
        (92.0, True, "hidden"),
    ],
)
def test_what_light_and_look_come_to_too_flatly_is_grazing(
    scanned: tuple[Rig, RangeGrid], turned: float, guessed: bool, name: str
) -> None:
    """A place before the wall, turned up from facing them: camera and light stand 6° above it."""
    rig, grid = scanned
    mesh = mesh_grid(grid)
    a = np.deg2rad(turned)
    one = places_in(mesh, holes(mesh)[:1]).part(slice(0, 1))
    one = replace(
        one,
        at=np.array([[30.0, 0.0, 20.0]]),
        normal=np.array([[np.cos(a), 0.0, np.sin(a)]]),
        bent=np.array([guessed]),
    )
    scene = causes._Scene.of(mesh, [])
    found = causes._reachable(one, [ScanCoverage(rig, grid, Volume())], scene)
    assert found.both[0] == (name == "measurable")
    assert (found.hider[0] == causes._FLAT_TO_BOTH) == (name == "grazing")


@pytest.mark.parametrize(
    ("votes", "name"),
    [
        ({"grazing": 3.0, "laser": 0.5, "camera": 0.2}, "grazing"),
        ({"flat to the laser": 3.0, "camera": 0.7, "dark": 2.0}, "grazing"),
        ({"flat to the laser": 9.0, "flat to the camera": 9.0, "hidden from both": 6.0}, "laser"),
        (
            {"flat to the laser": 5.0, "flat to the camera": 5.0, "camera": 3.0, "dark": 9.0},
            "camera",
        ),
        ({"flat to the laser": 5.0, "flat to the camera": 5.0, "dark": 9.0}, "grazing"),
        ({"flat to the laser": 3.0, "laser": 1.0, "dark": 3.5}, "laser"),
        ({"flat to the camera": 3.0, "laser": 4.0, "camera": 1.5}, "camera"),
        ({"hidden from both": 2.0, "laser": 1.0, "outside": 2.5}, "laser"),
        ({"hidden from both": 2.0, "outside": 2.5}, "outside"),
        ({"flat to both": 2.0, "flat to the laser": 1.0, "outside": 2.9}, "grazing"),
    ],
)
def test_what_is_too_flat_counts_for_what_it_is_all_but_hidden_from(
    votes: dict[str, float], name: Cause
) -> None:
    words = {word: k for k, word in enumerate(get_args(Cause))} | {
        "hidden from both": causes._BOTH,
        "flat to the laser": causes._FLAT_TO_LASER,
        "flat to the camera": causes._FLAT_TO_CAMERA,
        "flat to both": causes._FLAT_TO_BOTH,
    }
    count = np.zeros((1, len(words)))
    for word, weight in votes.items():
        count[0, words[word]] = weight
    assert get_args(Cause)[causes._most(count)[0]] == name


@pytest.mark.parametrize(
    ("sure", "first"), [(0.0, "laser"), (0.4, "laser"), (0.6, "outside"), (1.0, "outside")]
)
def test_a_patch_says_less_the_more_is_known_of_the_faces_beyond_its_border(
    sure: float, first: Cause
) -> None:
    """Places on the patch are hidden, and three fifths of the faces are outside."""
    patch, beyond = np.zeros((2, 1, causes._FLAT_TO_BOTH + 1))
    patch[0, causes.LASER] = 30.0
    beyond[0, [causes.OUTSIDE, causes.LASER]] = 0.6, 0.4
    votes = causes._weighed(patch, beyond, np.array([sure]))
    assert get_args(Cause)[causes._most(votes)[0]] == first


def test_a_slanting_island_has_the_cause_of_the_hole_about_it() -> None:
    """The crown of a ball that leaves camera and laser at a slant, parted from the rest by a gap:
    the ball turns off there, and its tangent planes run on in free sight of both."""
    rig = make_rig(elevation=0.1, lift=20.0)
    turn = full_turn(STEPS)
    grid = points.build_grid(
        rig, "L0", scan_shape(rig, sphere(25, (0.0, 0.0, 30.0)), turn), np.arange(STEPS), turn
    )
    rise = np.rad2deg(np.arcsin(np.clip((grid.points[..., 2] - 30.0) / 25.0, -1.0, 1.0)))
    ring = grid.found & (rise > 58.0) & (rise < 64.0)
    cut = points.without(grid, ring, StripeFlag.DARK)
    mesh = mesh_grid(cut)
    found = holes(mesh)
    places = places_in(mesh, found)
    view = ScanCoverage(rig, cut, Volume())
    slants = [k for k in range(len(found)) if places.island[k] and places.smooth[k]]
    assert slants
    about = np.flatnonzero(~places.island)
    best = np.full(len(found), causes.DARK, dtype=np.int32)
    best[about] = causes.LASER
    named = causes._as_about(mesh, found, places, [view], best)
    assert (named[slants] == causes.LASER).all()
    away = places.at * (1.0, 1.0, 0.0)
    level = away / np.linalg.norm(away, axis=1, keepdims=True)
    upright = replace(places, normal=level)
    assert (causes._as_about(mesh, found, upright, [view], best)[slants] == causes.DARK).all()


def test_the_foot_of_a_part_that_lies_is_outside() -> None:
    """Where the volume ends the part goes on down, and stands on a face: there is more of that
    than of what the flanks above it hide."""
    rig = make_rig(elevation=0.1, lift=20.0, lasers=(-0.4, 0.4))
    turn, low = full_turn(STEPS), Volume(z_min=4.0)
    stripes = scan_shape(rig, _lying_bar, turn)
    grid = points.clip(points.build_grid(rig, "L0", stripes, np.arange(STEPS), turn), low)
    mesh = drop_islands(cut_touching(mesh_grid(grid))[0])[0]
    named = explain(mesh, holes(mesh), [ScanCoverage(rig, grid, low)])
    foot = min((h for h in named if h.area > 100), key=lambda h: h.centre[2])
    assert foot.cause == "outside"
    # That face is known by its rim.
    view = ScanCoverage(rig, grid, low)
    places, scene = places_in(mesh, [foot]), causes._Scene.of(mesh, [view])
    assert causes._beyond(mesh, [foot], places, [view], scene)[2][0] > 0.5


@pytest.mark.parametrize(
    ("votes", "first", "second"),
    [
        ({causes.OUTSIDE: 3.0, causes._BOTH: 2.8}, causes.OUTSIDE, causes.LASER),
        ({causes._BOTH: 3.0, causes.OUTSIDE: 2.8}, causes.LASER, causes.OUTSIDE),
        ({causes.OUTSIDE: 3.0, causes._FLAT_TO_BOTH: 1.4}, causes.OUTSIDE, -1),
        ({causes.OUTSIDE: 3.0, causes._FLAT_TO_BOTH: 1.6}, causes.OUTSIDE, causes.FLAT),
        # What counts for the first one, too, leaves nothing to be said.
        ({causes.LASER: 3.0, causes._BOTH: 3.0}, causes.LASER, -1),
        # Whatever is not beside the foot, or is not its shadow, is a guess.
        ({causes._FLAT_TO_LASER: 4.0, causes.DARK: 3.0}, causes.FLAT, -1),
        ({causes.OUTSIDE: 3.0, causes.REMOVED: 3.0}, causes.OUTSIDE, -1),
    ],
)
def test_a_second_cause_is_that_of_the_shadow_beside_a_foot_or_of_that_foot(
    votes: dict[int, float], first: int, second: int
) -> None:
    count = np.zeros((1, causes._FLAT_TO_BOTH + 1))
    for k, many in votes.items():
        count[0, k] = many
    best = causes._most(count)
    assert (best[0], causes._second(count, best)[0]) == (first, second)


def test_a_border_about_a_foot_and_a_shadow_has_both_causes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh, view = leaning_bar()
    named = explain(mesh, holes(mesh), [view])
    large = sorted((h for h in named if h.area > 100), key=lambda h: h.centre[2])
    under, *above = large
    assert under.cause == "outside"
    assert under.also in ("laser", "camera")
    assert under.reason == f"{CAUSE_WORDS['outside']}; in part {CAUSE_WORDS[under.also]}"
    beside = [by_cause(mesh, [under], {name}) for name in (under.cause, under.also)]
    assert beside[0].any()
    assert np.array_equal(*beside), "found by either name"
    assert {h.also for h in above} == {None}
    # What lacks no place of the part has no second cause, whatever the votes say.
    monkeypatch.setattr(causes, "_whole", lambda found, places, idle: np.ones(len(found), bool))
    whole = explain(mesh, named, [view])
    assert {(h.cause, h.also) for h in whole} == {("removed", None)}
    by_hand = explain(mesh, named, [], cut=mesh.vertices[under.loop])
    assert next((h.cause, h.also) for h in by_hand if h.cause == "deleted") == ("deleted", None)


def _lying_bar(p: np.ndarray) -> np.ndarray:
    q = p - np.array([0.0, 0.0, 15.0])
    off = np.abs(q) - (30.0, 14.0, 15.0)
    return np.linalg.norm(np.maximum(off, 0.0), axis=-1) + np.minimum(off.max(axis=-1), 0.0)
