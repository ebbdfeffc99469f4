"""Clean-up of range grids: strays, spikes and the ends of the light go, surfaces stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.meshing import to_mesh
from turnscan.points import RangeGrid
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.stripes import StripeFlag
from turnscan.surface import mesh_grid
from turnscan.surface.clean import Clean, clean, drop_uncertain, part_uncertain, uncertain_findings
from turnscan.surface.fusion import merge


def wall(steps: int = 40, lines: int = 50, noise: float = 0.01, seed: int = 0) -> RangeGrid:
    """A tube of radius 30 mm scanned all round, seen from 400 mm away, with radial noise."""
    rng = np.random.default_rng(seed)
    phi = np.arange(steps) * 2 * np.pi / steps
    r = 30.0 + rng.normal(0.0, noise, (steps, lines))
    z = np.broadcast_to(5.0 + 0.5 * np.arange(lines), (steps, lines))
    out = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    points = r[..., None] * out[:, None] + z[..., None] * [0.0, 0.0, 1.0]
    return RangeGrid(
        laser="L0",
        steps=np.arange(steps),
        angles=phi,
        points=points,
        sigma=np.full((steps, lines), noise),
        amplitude=np.ones((steps, lines)),
        flags=np.zeros((steps, lines), dtype=np.uint16),
        closed=True,
        eyes=400.0 * out + [0.0, 0.0, 40.0],
    )


def moved(grid: RangeGrid, where: object, depth: float) -> RangeGrid:
    points = grid.points.copy()
    ray = grid.eyes[:, None] - points
    ray /= np.linalg.norm(ray, axis=2, keepdims=True)
    points[where] += depth * ray[where]
    return replace(grid, points=points)


def test_a_clean_surface_loses_nothing():
    grid = wall()
    out, findings = clean(grid)
    assert np.array_equal(out.found, grid.found)
    assert findings == []


@pytest.mark.parametrize("depth", [-12.0, 12.0])
def test_single_strays_go_and_their_neighbours_stay(depth):
    grid = wall(120)
    stray = np.zeros(grid.flags.shape, dtype=bool)
    stray[5::9, 7::11] = True
    out, findings = clean(moved(grid, stray, depth), Clean(edge=0))
    assert not out.found[stray].any()
    assert out.found[~stray].all()
    assert (out.flags[stray] == StripeFlag.AMBIGUOUS).all()
    assert [f.code for f in findings] == ["surface.strays"]
    assert findings[0].message.startswith(str(int(stray.sum())))


def test_a_spike_one_line_wide_goes():
    grid = wall(120)
    spike = np.zeros(grid.flags.shape, dtype=bool)
    spike[10:16, 20] = True
    out, _ = clean(moved(grid, spike, 15.0), Clean(edge=0))
    assert not out.found[spike].any()
    assert out.found[~spike].all()


def doubted(grid: RangeGrid, where: object, sigma: float) -> RangeGrid:
    """The grid with that sigma at some points."""
    out = grid.sigma.copy()
    out[where] = sigma
    return replace(grid, sigma=out)


def test_points_above_the_uncertainty_that_is_wanted_go_and_no_others():
    grid = doubted(wall(120), (slice(10, 40), slice(20, 30)), 0.3)
    unknown = doubted(grid, (slice(60, 70), slice(20, 30)), np.nan)
    assert uncertain_findings(unknown) == [], "300 of 5900 are not many"
    kept, (said,) = drop_uncertain(unknown, 0.299)
    assert (~kept.found).sum() == 300
    assert (kept.flags[10:40, 20:30] == StripeFlag.EDGE).all()
    assert said.message.startswith("300 points of a standard uncertainty above 0.299 mm")
    for limit in (0.3, None):
        kept, none = drop_uncertain(unknown, limit)
        assert kept.found.all()
        assert none == [], "as much as is wanted, and no more"


@pytest.mark.parametrize(("rows", "named"), [(4, False), (7, True)])
def test_many_points_of_a_large_sigma_are_named(rows, named):
    """From a tenth of the points on, with a limit that leaves the usual ones."""
    grid = doubted(wall(60), (slice(None), slice(0, rows)), 0.3)
    findings = uncertain_findings(grid)
    assert [f.code for f in findings] == ["surface.uncertain"] * named
    for said in findings:
        assert said.message.startswith("14% of the points")
        (option,) = said.remedy.options
        assert (option.name, option.value) == ("largest_sigma", 0.05)
        assert drop_uncertain(grid, option.value)[0].found.sum() == 60 * (50 - rows)


def test_faces_at_vertices_above_the_uncertainty_that_is_wanted_go():
    mesh = mesh_grid(wall(60))
    p = mesh.provenance
    assert p is not None
    sigma = p.sigma.copy()
    sigma[::7] = 0.3
    sigma[3::7] = np.nan
    doubtful = replace(mesh, provenance=replace(p, sigma=sigma))
    left, lost, (said,) = part_uncertain(doubtful, 0.2)
    wanted = ~(sigma > 0.2)[mesh.faces].any(axis=1)
    assert len(left.faces) == wanted.sum() > 0
    assert len(lost.faces) == (~wanted).sum() > 0
    assert not (left.provenance.sigma > 0.2).any()
    assert np.isnan(left.provenance.sigma).any(), "what states no sigma stays"
    assert f"{(sigma > 0.2).sum()} merged vertices" in said.message
    silent = replace(mesh, provenance=None)
    for one, limit in ((doubtful, None), (doubtful, 0.3), (silent, 0.0)):
        same, lost, said = part_uncertain(one, limit)
        assert len(same.faces) == len(mesh.faces)
        assert not len(lost.faces)
        assert said == []


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    limit=st.floats(0.05, 0.5),
    how=st.sampled_from(["grid", "tsdf", "paste"]),
)
def test_all_points_make_the_surface_before_uncertain_ones_are_left_out(seed, limit, how):
    """Faces that stay are those of the merged surface: none goes straight past what went.

    Of that itself a few go that touch others in a vertex alone; what went before leaves them.
    """
    rng = np.random.default_rng(seed)
    grids = [doubted(wall(noise=0.05, seed=seed % 2**31 + k), ..., 0.05) for k in range(2)]
    for k, one in enumerate(grids):
        bent = rng.random(one.found.shape) < 0.2
        grids[k] = doubted(moved(replace(one, laser=f"L{k}"), bent, 1.0), bent, 0.6)
    wanted = Settings(merge=how, voxel=3.0, island=0)
    whole, _ = merge(grids, how=how, voxel=3.0)
    left = to_mesh(grids, replace(wanted, largest_sigma=limit))
    for some, all_of_it in zip(left.grids, grids, strict=True):
        assert np.array_equal(some.found, all_of_it.found & (all_of_it.sigma <= limit))
    if not len(left.mesh.faces):
        return
    assert left.mesh.provenance.sigma.max() <= limit
    middles = left.mesh.vertices[left.mesh.faces].mean(axis=1)
    assert np.abs(deviation(middles, whole).distance).max() < 1e-3


def test_a_limit_below_every_sigma_is_what_leaves_no_face():
    grid = wall(60)
    assert len(to_mesh([grid], Settings(largest_sigma=0.01)).mesh.faces), "what they state stays"
    said = to_mesh([grid], Settings(largest_sigma=0.009)).findings
    (none,) = [f for f in said if f.severity == "error"]
    assert none.code == "surface.none"
    assert [o.name for o in none.remedy.options] == ["largest_sigma"]


def test_mixed_pixels_go_where_the_light_ends_one_sidedly():
    grid = wall()
    points, flags = grid.points.copy(), grid.flags.copy()
    points[:, 30:33] = np.nan
    flags[:, 29] = StripeFlag.EDGE
    out, findings = clean(replace(grid, points=points, flags=flags))
    assert not out.found[:, 29].any()
    # The light of line 33 was whole. Of the ends themselves chance takes one now and then.
    assert out.found[:, [28, 33]].sum() >= 78
    assert findings[0].code == "surface.edges"
    kept, none = clean(replace(grid, points=points, flags=flags), Clean(edge=0))
    assert kept.found[:, 29].all()
    assert none == []


def test_a_step_in_depth_loses_one_point_on_either_side():
    grid = wall()
    upper = np.zeros(grid.flags.shape, dtype=bool)
    upper[:, 25:] = True
    out, _ = clean(moved(grid, upper, 8.0))
    assert not out.found[:, 24:26].any()
    assert out.found[:, :24].all()
    assert out.found[:, 26:].all()


def test_a_patch_that_floats_goes_and_a_large_one_stays():
    grid = wall(lines=60)
    points = grid.points.copy()
    points[:, 40:] = np.nan
    points[4:6, 45:47] = grid.points[4:6, 45:47]
    small, _ = clean(replace(grid, points=points))
    assert not small.found[:, 40:].any()
    points[4:14, 45:55] = grid.points[4:14, 45:55]
    large, _ = clean(replace(grid, points=points))
    assert large.found[4:14, 45:55].all()


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_nothing_is_moved_or_invented_and_the_rest_is_stable(seed, share):
    grid = wall(12, 14, 0.02, 1)
    gone = np.random.default_rng(seed).random(grid.flags.shape) < share
    holed = replace(grid, points=np.where(gone[..., None], np.nan, grid.points))
    settings = Clean(edge=0)
    once, _ = clean(holed, settings)
    assert not (once.found & gone).any()
    assert np.array_equal(once.points[once.found], grid.points[once.found])
    again, _ = clean(once, settings)
    assert np.array_equal(again.found, once.found)


def test_a_single_profile_stays_as_it_is():
    grid = wall(1, 20)
    out, findings = clean(replace(grid, closed=False))
    assert out.found.all()
    assert findings == []


@pytest.mark.parametrize("wrong", [{"edge": -1}, {"support": 9}, {"stretch": 1.0}])
def test_settings_without_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="Clean"):
        Clean(**wrong)


def _ending(shape: str) -> RangeGrid:
    """The tube, whose light fades over the last four lines: of every third profile alone, which
    slide off by up to 1 mm (``slides``) or stay (``stays``), or of all, as where it rounds off."""
    grid = wall(60)
    points, light = grid.points.copy(), 100.0 * grid.amplitude
    outward = points * [1.0, 1.0, 0.0] / 30.0
    which = np.zeros(60, bool)
    which[:: 1 if shape == "rounds off" else 3] = True
    fading = np.array([0.7, 0.5, 0.35, 0.2])
    light[which, -4:] *= fading
    if shape != "stays":
        sign = -1.0 if shape == "rounds off" else 1.0
        points[which, -4:] += sign * np.array([0.3, 0.6, 0.9, 1.2])[:, None] * outward[which, -4:]
    return replace(grid, points=points, amplitude=light)


@pytest.mark.parametrize(("shape", "lost"), [("slides", 4), ("stays", 0), ("rounds off", 0)])
def test_a_stripe_that_slides_off_the_end_of_the_surface_loses_its_last_points(shape, lost):
    grid = _ending(shape)
    out, _ = clean(grid)
    assert int((~out.found[::3, -4:]).sum()) == lost * 20
    assert out.found[:, :-4].all()
    assert out.found[1::3].all()
    assert (out.flags[~out.found] == StripeFlag.EDGE).all()


@pytest.mark.parametrize(("sigma", "stays"), [(1.0, True), (5.0, False)])
def test_a_point_by_itself_beside_a_gap_stays_if_it_is_known_well(sigma, stays):
    grid = wall(60)
    points, own = grid.points.copy(), grid.sigma.copy()
    points[20:23] = np.nan
    points[23, 10:41] = np.nan
    points[23, 25] = grid.points[23, 25]
    own[23, 25] *= sigma
    out, _ = clean(replace(grid, points=points, sigma=own), Clean(support=0, piece=0.0))
    assert out.found[23, 25] == stays
    assert out.found[24:].all()


def test_points_far_off_the_line_of_their_profile_go_and_grooves_stay():
    """The last of a run by 0.4 mm, and one within it by 0.15: too little for a stray."""
    grid = wall(120, 60, noise=0.02)
    points, flags = grid.points.copy(), grid.flags.copy()
    points[30, 40:], flags[30, 40:] = np.nan, StripeFlag.DARK
    grid = replace(grid, points=points, flags=flags)
    lone = np.zeros(flags.shape, dtype=bool)
    lone[30, 39] = lone[80, 20] = True
    # A groove of one line, all round but for a part.
    groove = np.zeros_like(lone)
    groove[40:70, 10] = True
    rough = moved(moved(moved(grid, (30, 39), 0.4), (80, 20), -0.15), groove, -0.3)
    out, findings = clean(rough)
    assert not out.found[lone].any()
    assert out.found[groove].all()
    assert (grid.found & ~out.found).sum() <= 4
    assert (out.flags[lone] & StripeFlag.EDGE).all()
    assert [f.code for f in findings if f.code == "surface.spikes"]
    assert clean(rough, Clean(edge=0))[0].found[lone].all()
    flags = rough.flags.copy()
    flags[lone] |= np.uint16(StripeFlag.HAND)
    assert clean(replace(rough, flags=flags))[0].found[80, 20], "set by a person"


@pytest.mark.parametrize("apart", [1, 2, 3, 6])
def test_two_strays_in_a_run_do_not_hide_each_other(apart):
    """Coarse steps: eight millimetres are no farther than from profile to profile. The laser's
    sheet goes through the axis, and the camera looks at it aslant."""
    grid = wall(24, 80, noise=0.1)
    seen_from = grid.angles + 0.4
    eyes = 400.0 * np.stack([np.cos(seen_from), np.sin(seen_from), 0.1 + 0 * seen_from], axis=-1)
    strays = np.zeros(grid.flags.shape, dtype=bool)
    strays[[5, 5, 11, 11], [40, 40 + apart, 20, 20 + apart]] = True
    points = grid.points.copy()
    points[strays, :2] *= 38.8 / 30.5
    rough = replace(grid, points=points, eyes=eyes)
    out, _ = clean(rough)
    assert not out.found[strays].any()
    assert (grid.found & ~out.found & ~strays).sum() <= 2
    assert (out.flags[strays] & (StripeFlag.EDGE | StripeFlag.AMBIGUOUS)).all()
    # What says itself that it may lie so far off is no stray.
    known = replace(rough, sigma=np.where(strays, 4.0, grid.sigma))
    assert clean(known)[0].found[strays].all()


def test_a_step_along_all_profiles_and_a_thin_rib_on_one_stay():
    """What the profiles beside have too is no stray, nor are four lines of one profile."""
    grid = wall(60, 80, noise=0.02)
    shape = np.zeros(grid.flags.shape, dtype=bool)
    shape[:, 30:33] = True  # a ring of three lines
    shape[20, 50:54] = True
    out, _ = clean(moved(grid, shape, -0.5))
    assert out.found[shape].all()


@pytest.mark.parametrize(("one_sided", "left"), [(True, 0.3), (True, 0.8), (False, 0.3)])
def test_the_spent_light_of_runs_that_end_is_not_believed_for_those_beside(one_sided, left):
    """Where a handle meets a body, the last light of one profile after the other lies on both."""
    grid = wall(120, 60, noise=0.1)
    points, flags, light = grid.points.copy(), grid.flags.copy(), grid.amplitude.copy()
    points[30:34, 40:], flags[30:34, 40:] = np.nan, StripeFlag.DARK
    # The point before it goes first, as the last of its run; then this one is the last.
    flags[30:34, 38] = flags[30:34, 39] = StripeFlag.EDGE if one_sided else 0
    last = np.zeros(flags.shape, dtype=bool)
    last[30:34, 38] = True
    light[last] = left
    part = replace(grid, points=points, flags=flags, amplitude=light)
    out, _ = clean(moved(part, last, 0.7))
    assert out.found[last].any() == (not one_sided or left > 0.5)
    assert out.found[30:34, :37].all()


def test_the_last_point_of_a_run_is_believed_less_than_one_within_it():
    """Both lie four sigma off; where a run ends the light may lie on two surfaces."""
    grid = wall(120, 60, noise=0.02)
    points, flags = grid.points.copy(), grid.flags.copy()
    points[30, 40:], flags[30, 40:] = np.nan, StripeFlag.DARK
    # Without noise of their own, so that they lie off by what is said here.
    for step, lines in ((30, slice(31, 40)), (80, slice(13, 28))):
        r = np.hypot(*points[step, lines, :2].T)
        points[step, lines, :2] *= (30.0 / r)[:, None]
    grid = replace(grid, points=points, flags=flags)
    end = 4.0 * 0.02 * np.sqrt(1.0 + 1.0 / 7.0 + 25.0 / 28.0)
    within = 4.0 * 0.02 * np.sqrt(1.0 + 1.0 / 14.0)
    out, _ = clean(moved(moved(grid, (30, 39), end), (80, 20), within))
    assert not out.found[30, 39]
    assert out.found[30, 38]
    assert out.found[80, 20]
