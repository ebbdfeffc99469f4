"""Stripes on two surfaces that meet under the sheet, by integration of a Gaussian sheet."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from turnscan.arrays import Floats
from turnscan.points import _wholeness_kernels as kernels
from turnscan.points._creased import Widths, creased

D = np.linspace(-6, 6, 20_001)


def on_two(k: float, wide: float, v: float) -> tuple[float, float, float]:
    """How far the centre is off that of the sheet's middle, the width, and all of the light, where
    one pixel's walk changes k thicknesses beside the middle; the second surface is wider and v
    times as bright."""
    light = norm.pdf(D) * np.where(k > D, 1.0, v)
    at = np.where(k > D, D - k, wide * (D - k))  # the picture is continuous where they meet
    mean = np.average(at, weights=light)
    own = np.sqrt(np.average((at - mean) ** 2, weights=light))
    middle = -k if k > 0 else -wide * k
    return float(mean - middle), float(own), float(light.sum() * (D[1] - D[0]))


def stripes(k: float, wide: float, v: float, arc: float = 3.0) -> tuple[Widths, float]:
    """Five profiles of three lines, the third on the crease; and its centre's shift."""
    mean, own, light = on_two(k, wide, v)
    width = np.tile(np.array([1.0, 1.0, own, wide, wide])[:, None], (1, 3))
    flux = np.tile(np.array([1.0, 1.0, light, v, v])[:, None], (1, 3))
    walk, side = np.ones((2, 5, 3)), np.ones((2, 5, 3))
    walk[0, -1] = walk[1, 0] = np.nan
    side[1] = -1.0  # the profile before lies on the side of lower pixels, and is the narrower
    return Widths(width, flux / width, walk, side, np.full((5, 3), arc)), mean


def unknown(far: int) -> Floats:
    return np.full((5, 3), np.nan)


def planes(mean: float = np.nan, wider: float = 1.0, lighter: float = 1.0):
    """What the surfaces beside say: the shift, and how the table turns that after to the light."""

    def folded(far: int, first: int, end: int) -> Floats:
        out = np.ones((5, end - first, 3))
        out[0], out[1], out[3] = mean, wider, lighter
        return out

    return folded


@pytest.mark.parametrize("k", [-1.2, -0.6, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("wide", [1.5, 3.0])
@pytest.mark.parametrize("v", [0.7, 1.0, 2.5])
def test_the_centre_is_put_back_by_what_widths_and_planes_say(k, wide, v):
    seen, mean = stripes(k, wide, v)
    told = creased(seen, 1.0, unknown, planes(mean))
    assert told is not None
    off, doubt = told.shift[2, 1], told.doubt[2, 1]
    if told.settled[2, 1]:
        # A twentieth of the narrower width is what speckle hides.
        assert abs(mean - off) < 0.25 * abs(mean) + 0.05
        assert abs(mean - off) < 1.5 * doubt + 0.01
        assert doubt < 0.6 * abs(mean) + 0.1
        wrong = creased(seen, 1.0, unknown, planes(mean - 0.6))
        assert wrong is not None
        assert wrong.shift[2, 1] == pytest.approx(off - 0.3)
        assert wrong.doubt[2, 1] > 0.25, "what the two tell differs by 0.6 px"
    else:
        assert abs(mean) < 0.1 + 0.1 * abs(k) * wide


def test_where_the_surfaces_beside_are_not_known_a_centre_is_doubted_and_not_moved():
    seen, mean = stripes(0.3, 2.0, 1.0)
    told = creased(seen, 1.0, unknown, planes())
    assert told is not None
    assert not told.shift.any()
    assert not told.settled.any()
    assert 0.5 * abs(mean) < told.doubt[2, 1] < 2.0 * abs(mean)


def test_on_which_side_the_wider_surface_lies_is_where_the_centre_is_pulled():
    seen, mean = stripes(0.3, 2.0, 1.5)
    other = Widths(seen.width, seen.bright, seen.walk, -seen.side, seen.arcs)
    one, two = (creased(of, 1.0, unknown, planes(to)) for of, to in ((seen, mean), (other, -mean)))
    assert one is not None
    assert two is not None
    assert one.shift[2, 1] == pytest.approx(mean, abs=0.05)
    assert two.shift[2, 1] == pytest.approx(-one.shift[2, 1])


def test_a_border_and_one_plane_that_the_table_turns_are_no_crease():
    seen, mean = stripes(0.0, 2.0, 1.0)
    torn = seen.walk.copy()
    torn[0, 2] = np.nan
    border = Widths(seen.width, seen.bright, torn, seen.side, seen.arcs)
    for of, apart, beside in (
        (border, unknown, planes(mean)),
        (seen, lambda far: np.zeros((5, 3)), planes(mean)),
        # In the light of the point's own step both sides are as wide as each other.
        (seen, unknown, planes(mean, 0.5)),
    ):
        told = creased(of, 1.0, apart, beside)
        assert told is not None
        assert not told.shift[2].any()


@pytest.mark.parametrize(
    ("last", "arc", "moved"), [(3.0, 3.0, False), (3.0, 1.0, True), (2.2, 3.0, True)]
)
def test_beside_surfaces_that_are_no_plane_a_centre_is_doubted_and_not_moved(last, arc, moved):
    """The width goes on to change beyond the profiles next to it: they lie on other faces still,
    where a step is longer than the sheet reaches."""
    width = np.tile(np.array([1.0, 1.0, 1.0, 1.7, 2.2, last, last])[:, None], (1, 3))
    walk, side = np.ones((2, 7, 3)), np.ones((2, 7, 3))
    walk[0, -1] = walk[1, 0] = np.nan
    side[1] = -1.0
    nothing = np.full(width.shape, np.nan)
    of = Widths(width, np.ones(width.shape), walk, side, np.full(width.shape, arc))
    thickness = 0.6 if arc == 1.0 else 1.0
    told = creased(of, thickness, lambda far: nothing, planes(0.3))
    assert told is not None
    assert (told.shift[3, 1] > 0.1) == moved
    assert told.doubt[3, 1] > 0.1


@pytest.mark.parametrize("k", [-1.5, -0.4, 0.0, 0.7, 2.0])
@pytest.mark.parametrize(("wide", "v"), [(1.3, 1.0), (2.5, 0.5), (4.0, 3.0)])
def test_a_sheet_on_two_lines_has_the_centre_and_the_width_of_its_integral(k, wide, v):
    mean, own, _ = on_two(k, wide, v)
    told = kernels.crease(k, (wide, -wide * k, v), (1.0, -k, 1.0))
    assert told == pytest.approx((mean, own), abs=1e-3)
    back = kernels.told_by_width(*(np.array([x]) for x in (1.0, wide, v, own)))
    # Two places may have one width; either is as wide as this.
    near = np.linspace(-3.0, 3.0, 601)
    alike = [m for m, w, _ in (on_two(float(x), wide, v) for x in near) if abs(w - own) < 0.05]
    assert np.min(np.abs(np.array(alike) - back)) < 0.02


@pytest.mark.parametrize(("bends", "moved"), [
    ((0.0, 0.0, 0.3, 0.5, 0.3, 0.0, 0.0), True),
    ((0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3), False),  # round, and goes on to bend
    ((0.0, 0.05, 0.3, 0.5, 0.3, 0.4, 0.0), True),  # another crease on one side
    ((0.0, 0.2, 0.1, 0.2, 0.1, -0.2, 0.0), False),
])  # fmt: skip
def test_what_goes_on_to_bend_beyond_the_sheet_is_no_crease(bends, moved):
    width = np.tile(np.array([1.0, 1.0, 1.0, 1.5, 2.0, 2.0, 2.0])[:, None], (1, 3))
    walk, side = np.ones((2, 7, 3)), np.ones((2, 7, 3))
    walk[0] = np.exp(bends)[:, None]
    side[1] = -1.0
    of = Widths(width, np.ones(width.shape), walk, side, np.full(width.shape, 3.0))
    told = creased(of, 1.0, lambda far: np.full(width.shape, np.nan), planes(0.3))
    assert told is not None
    assert (told.shift[3, 1] > 0.1) == moved
    assert told.doubt[3, 1] > 0.1, "it may still lie on two surfaces"


@pytest.mark.parametrize("edge", [-0.5, 0.0, 0.4])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_planes_beside_say_what_a_sheet_on_both_does_to_the_centre(edge, sign):
    """A roof of two planes that meet at x = 0, met by a sheet x = ``edge`` of one thickness, far
    from a camera that looks along (−1, 0, −1): the profiles lie three apart."""
    thick, slopes = 1.0, (0.3 * sign, -0.8 * sign)

    def roof(x: Floats) -> Floats:
        return np.where(x < 0, slopes[0] * x, slopes[1] * x)

    far = 1e6
    x = edge + 3.0 * np.arange(-3.0, 4.0)
    y = np.arange(3.0)
    points = np.stack(np.broadcast_arrays(x[:, None], y, roof(x)[:, None]), axis=-1)
    towards = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    pixel = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    light = norm.pdf(D)
    at = np.stack([edge + D, 0 * D, roof(edge + D)], axis=-1)
    normals = np.stack([-np.where(edge + D < 0, *slopes), 0 * D, 1 + 0 * D], axis=-1)
    weight = light * (normals @ towards)  # a pixel across the sheet is as bright as it faces it
    weight /= np.linalg.norm(normals, axis=1)
    u = at @ pixel
    mean = np.average(u, weights=weight)
    middle = np.array([edge, 0.0, float(roof(np.array(edge)))]) @ pixel
    # The point is where the ray of that centre meets the sheet.
    points[3] += ((mean - middle) / pixel[2]) * np.array([0.0, 0.0, 1.0])
    eyes = points[:, 1] + far * towards
    moves, sheets = np.tile(pixel, (7, 3, 1)), np.tile(np.array([1.0, 0.0, 0.0]), (7, 3, 1))
    out = np.full((5, 7, 3), np.nan)
    arcs = np.full((7, 3), 8.0)
    kernels.folded(points, eyes, moves, sheets, arcs, 0.0, False, (0, 7), out, (thick, 1))
    assert out[0, 3, 1] == pytest.approx(mean - middle, abs=0.01)
    assert out[1:, 3, 1] == pytest.approx(1.0, abs=1e-6), "nothing turns"
    assert np.isnan(out[:, [0, 1, 5, 6]]).all(), "there are no two profiles beside"
