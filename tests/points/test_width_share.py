"""How a surface lies, as the width of the stripe on it tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from turnscan.arrays import Floats
from turnscan.points import _width_share
from turnscan.points._due_width import DueWidth, due_width
from turnscan.points._lit_points import LitPoints
from turnscan.points._width_share import share_by_width


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v))


def lit(normal: Floats, sheet: Floats, lines: int = 9) -> tuple[LitPoints, Floats, Floats]:
    """A profile where a plane of this normal meets a sheet, seen from 300 mm away; how far a pixel
    leads away from the sheet on it, (1, n) mm, and the cosine (1, n) between the way along which
    centres err and its normal."""
    eye = np.array([300.0, 20.0, 40.0])
    up = _unit(np.cross(normal, sheet))
    points = (0.4 * (np.arange(lines) - lines // 2))[:, None] * up
    ray, move = points - eye, np.tile([0.0, 0.3, 0.0], (lines, 1))
    gone = move - ray * ((move @ normal) / (ray @ normal))[:, None]
    along = move - ray * ((move @ sheet) / (ray @ sheet))[:, None]
    share = np.abs(along @ normal) / np.linalg.norm(along, axis=1)
    seen = LitPoints(
        points[None],
        eye[None],
        move[None],
        np.tile(sheet, (1, lines, 1)),
        np.ones((1, lines)),
        np.full((1, lines), 100.0),
        np.zeros(1),
        False,
    )
    return seen, np.abs(gone @ sheet)[None], share[None]


def _other(normal: Floats, light: LitPoints, walk: Floats) -> Floats:
    """The normal of the other surface through the profile on which the middle stripe is as wide."""
    sheet, up = light.sheets[0, 0], light.points[0, -1] - light.points[0, 0]
    ray, move = light.points[0, 4] - light.eyes[0], light.moves[0, 4]
    own = (move @ normal) / (ray @ normal)
    both = [(move @ sheet + part * walk[0, 4]) / (ray @ sheet) for part in (1.0, -1.0)]
    far = max(both, key=lambda q: abs(q - own))
    return _unit(np.cross(up, move - far * ray))


ANGLES = st.floats(-1.2, 1.2)


@given(ANGLES, ANGLES, st.floats(0.2, 1.3))
def test_it_is_that_of_the_surface_or_of_the_other_one_on_which_it_is_as_wide(turn, tilt, sheet):
    normal = np.array([np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)])
    plane = np.array([-np.sin(sheet), np.cos(sheet), 0.0])
    assume(np.linalg.norm(np.cross(normal, plane)) > 0.1)
    light, walk, share = lit(normal, plane)
    assume((walk > 1e-4).all())
    told, share = share_by_width(light, walk)[:, 1:-1], share[:, 1:-1]
    assert (told >= share - 1e-6).all(), "never less"
    assert (told >= _width_share._LEAST).all()
    assert (told <= 1.0).all()


@given(st.floats(-0.9, 0.9), st.floats(0.3, 1.2))
def test_without_allowance_it_is_the_larger_one_of_both(turn, sheet):
    normal = _unit(np.array([np.cos(turn), np.sin(turn), 0.1]))
    light, walk, share = lit(normal, np.array([-np.sin(sheet), np.cos(sheet), 0.0]))
    assume((walk > 1e-3).all())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_width_share, "_WIDER", 1.0)
        patch.setattr(_width_share, "_LEAST", 0.0)
        told = share_by_width(light, walk)[0, 4]
    other = lit(_other(normal, light, walk), light.sheets[0, 0])
    assert other[1][0, 4] == pytest.approx(walk[0, 4], rel=1e-6), "it is as wide there"
    assert told == pytest.approx(max(share[0, 4], other[2][0, 4]), abs=1e-6)


def test_nothing_is_told_of_a_point_by_itself_nor_without_a_width():
    light, walk, _ = lit(np.array([0.8, 0.6, 0.0]), np.array([0.0, 1.0, 0.0]), lines=1)
    assert np.isnan(share_by_width(light, walk)).all()
    light, walk, _ = lit(np.array([0.8, 0.6, 0.0]), np.array([0.0, 1.0, 0.0]))
    walk[0, 3] = np.nan
    assert np.isnan(share_by_width(light, walk)[0, 3])
    assert not np.isnan(share_by_width(light, walk)[0, 4])


def test_nothing_is_told_at_the_ends_of_a_run_nor_where_a_profile_jumps():
    light, walk, _ = lit(np.array([0.8, 0.6, 0.0]), np.array([0.0, 1.0, 0.0]), lines=21)
    told = share_by_width(light, walk)[0]
    assert np.isnan(told[[0, -1]]).all()
    assert not np.isnan(told[1:-1]).any()
    points = light.points.copy()
    points[0, 10:] += [9.0, 0.0, 0.0]  # along the sheet, more than the run is long
    jumps = share_by_width(replace(light, points=points), walk)[0]
    assert np.isnan(jumps[[8, 9, 10, 11]]).all()


@given(st.floats(0.02, 0.5), st.floats(0.0, 0.5), st.floats(0.05, 2.0))
def test_how_a_surface_lies_is_the_inverse_of_how_wide_a_stripe_is_due(thick, blur, walk):
    due = DueWidth(thick, True, blur, np.array([1.05, 0.95]))
    both = due(np.full((2, 1, 1), walk))
    width = np.sqrt(both.prod(axis=0))
    found = due.walk_of(width)
    if blur < 0.7 * (width / np.sqrt(1.05 * 0.95)) ** 2:
        assert found == pytest.approx(walk, rel=1e-6)
    else:
        assert np.isnan(found).all(), "a blur tells nothing of how a surface lies"


def test_widths_that_slopes_do_not_tell_from_a_blur_tell_nothing_of_slopes():
    rng = np.random.default_rng(1)
    alike = np.full((2, 20, 40), 0.2)
    width = 0.1 / alike[0] * np.exp(rng.normal(0.0, 0.03, alike[0].shape))
    due = due_width(alike, width, 0.0)
    assert not due.told
    assert np.isnan(due.walk_of(width)).all()
    unlike = alike * np.exp(rng.uniform(-1, 1, alike[0].shape))
    width = 0.1 / unlike[0] * np.exp(rng.normal(0.0, 0.03, alike[0].shape))
    due = due_width(unlike, width, 0.0)
    assert due.told
    assert due.thickness == pytest.approx(0.1, rel=0.05)
    assert np.nanmedian(due.walk_of(width) / unlike[0]) == pytest.approx(1.0, abs=0.03)
    assert np.isnan(due_width(unlike[:, :2, :3], width[:2, :3], 0.0).walk_of(width)).all(), "few"
