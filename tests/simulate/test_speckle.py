"""Speckle against the closed formulae of coherent imaging."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.simulate import _speckle as speckle_module
from turnscan.simulate import (
    cell_keys,
    cell_size,
    contrast,
    gamma_speckle,
    grain,
    oversampling,
    path_phase,
    pattern_weights,
    pixel_contrast,
    speckled,
)
from turnscan.simulate._speckle import pair_covariance
from turnscan.simulate._validate import (
    cell_places,
    flat_picture,
    line_error,
    line_error_theory,
    measured_contrast,
    motion_correlation,
    motion_theory,
    spot_error,
    spot_error_theory,
)

PAPER = (0.289, 0.236)
"""λN' of 633 nm at f/4 on pixels 9 µm high and 11 µm wide."""


@pytest.mark.parametrize(
    ("size", "published"), [(0.24, 0.24), (0.5, 0.46), (1.0, 0.71), (2.0, 0.91)]
)
def test_contrast_of_pixels(size: float, published: float) -> None:
    measured = measured_contrast((size, size), seed=1, size=320)
    assert measured == pytest.approx(published, abs=0.03)
    assert measured == pytest.approx(pixel_contrast((size, size)), rel=0.03)


def test_contrast_of_oblong_pixels_is_between_that_of_square_ones() -> None:
    measured = measured_contrast(PAPER, seed=2)
    assert measured == pytest.approx(pixel_contrast(PAPER), rel=0.03)
    assert pixel_contrast((0.236, 0.236)) < pixel_contrast(PAPER) < pixel_contrast((0.289, 0.289))


@pytest.mark.parametrize("wanted", [0.3, 0.5, 0.6, contrast(polarisation=0.0), 0.9])
def test_partial_coherence_lowers_the_contrast_as_asked(wanted: float) -> None:
    ratio = measured_contrast((1.0, 1.0), 3, 384, wanted) / pixel_contrast((1.0, 1.0))
    assert ratio == pytest.approx(wanted, rel=0.04)


@pytest.mark.parametrize("size", [0.6, 1.0])
def test_spot_centroid_wanders_by_0_225_of_the_grain(size: float) -> None:
    assert spot_error_theory(size) == pytest.approx(0.225 * size, rel=1e-3)
    one = spot_error(size, 3.0, seed=4, across=22)
    two = spot_error(size, 3.0, seed=4, across=22, contrast=math.sqrt(0.5))
    assert one == pytest.approx(spot_error_theory(size), rel=0.06)
    assert (one / two) ** 2 == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize(
    ("size", "width", "rows"), [(0.236, 1.5, 1800), (0.448, 1.5, 3600), (1.087, 2.0, 9000)]
)
@pytest.mark.parametrize("binned", [1, 3])
def test_line_centroid_error(size: float, width: float, rows: int, binned: int) -> None:
    error = line_error((size, size), width, 5, rows, binned)
    assert error == pytest.approx(line_error_theory(size, width, binned), rel=0.08)


@pytest.mark.parametrize("grains", [0.1, 0.25, 0.5, 0.75, 1.0, 1.5])
def test_speckle_moves_with_the_surface_and_decorrelates_after_a_grain(grains: float) -> None:
    theory = motion_theory(2.0, grains)
    measured = motion_correlation(2.0, grains, seed=1)
    assert measured == pytest.approx(theory, abs=0.05)
    assert (measured < 0.15) == (grains >= 1.0)


def test_speckle_of_a_whole_pixel_of_motion_is_the_same_picture_moved() -> None:
    g = (0.5, 0.5)
    still, moved = (flat_picture((64, 64), g, 1, shift=s, per_grain=4) for s in (0.0, 3.0))
    inner = np.s_[8:-8, 8:-8]
    same = np.corrcoef(still[:, :-3][inner].ravel(), moved[:, 3:][inner].ravel())[0, 1]
    assert same > 0.98


@pytest.mark.parametrize("g", [PAPER, (0.5, 0.5), (1.087, 1.087), (2.0, 2.0)])
@pytest.mark.parametrize("wanted", [1.0, 0.35])
def test_energy_is_conserved_in_the_mean(g: tuple[float, float], wanted: float) -> None:
    cells = oversampling(g)
    shape = (160, 48)
    _, x = cell_places(shape, cells)
    profile = np.exp(-((x - 24) ** 2) / (2 * 2.5**2)).astype(np.float32)
    sheet = np.broadcast_to(profile, (shape[0] * cells[0], len(x)))
    pictures = [flat_picture(shape, g, seed, sheet, contrast=wanted) for seed in range(6)]
    assert np.sum(pictures) / (6 * sheet.sum()) == pytest.approx(1.0, abs=0.025)
    assert min(p.min() for p in pictures) >= 0


def test_intensity_of_one_polarisation_is_exponential() -> None:
    picture = flat_picture((160, 160), (4.0, 4.0), 3).ravel()
    assert picture.mean() == pytest.approx(1, abs=0.1)
    assert np.mean(picture > 2 * picture.mean()) == pytest.approx(math.exp(-2), abs=0.03)


def test_windows_join_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    g = (1.0, 1.0)
    tiled = flat_picture((128, 40), g, 5)
    monkeypatch.setattr(speckle_module, "_CHUNK_ROWS", 128)
    whole = flat_picture((128, 40), g, 5)
    rows = np.array([np.corrcoef(a, b)[0, 1] for a, b in zip(tiled, whole, strict=True)])
    assert rows[8:-8].min() > 0.9
    at_joints = np.corrcoef(tiled[31:96:32].ravel(), tiled[32:97:32].ravel())[0, 1]
    assert at_joints == pytest.approx(pair_covariance(g, 1, 0) / pair_covariance(g, 0, 0), abs=0.25)


def test_far_apart_pieces_of_a_line_do_not_disturb_each_other() -> None:
    g = (1.0, 1.0)
    both = np.zeros((64, 96), np.float32).repeat(4, 0).repeat(4, 1)
    both[:, 40:80] = 1.0
    left = both.copy()
    both[:, 300:340] = 1.0
    a, b = flat_picture((64, 96), g, 1, both), flat_picture((64, 96), g, 1, left)
    assert np.array_equal(a[:, :30], b[:, :30])


def turned(angle: float, move: float = 0.0) -> np.ndarray:
    """A plate on the rotation axis seen by a lens 400 mm away, turned by ``angle`` rad."""
    n, pixel, wavelength, g = 48, 0.08, 450e-6, (1.0, 1.0)
    cells = oversampling(g, 4)
    y, x = cell_places((n, n), cells)
    place = np.zeros((len(y), len(x), 3))
    place[..., 0] = (x - n / 2) * pixel + move
    place[..., 1] = (y[:, None] - n / 2) * pixel
    place[..., 2] = 0.013
    c, s = math.cos(angle), math.sin(angle)
    into_object = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    points = place.reshape(n, cells[0], n, cells[1], 3).swapaxes(1, 2).reshape(-1, *cells, 3)
    points = points @ into_object.T
    laser, lens = into_object @ (200.0, 0, 346.0), into_object @ (0, 0, 400.0)
    size = 0.5 * pixel
    where = np.stack(np.divmod(np.arange(n * n), n), axis=-1)
    picture = speckled(
        where, np.full((n * n, *cells), 1 / 16), cell_keys(points, size), (n, n), g, 1,
        phase=path_phase(points, size, laser, lens, wavelength),
    )  # fmt: skip
    return picture[4:-4, 4:-4].ravel()


def test_turning_changes_the_speckle_even_on_the_axis() -> None:
    # The lens is λ/pixel = 5.6 mrad wide; the scattered light turns by 1.87 times the angle.
    still = turned(0.0)
    assert still.mean() == pytest.approx(1, abs=0.05)
    assert np.corrcoef(still, turned(0.0001))[0, 1] > 0.9
    assert np.corrcoef(still, turned(math.radians(0.05)))[0, 1] == pytest.approx(0.5, abs=0.2)
    # At 0.344° a lattice of scatterers would act as a grating. What correlation remains (0.1) is
    # because a scatterer keeps its strength while its phase changes.
    for degrees in (0.2, 0.344, 0.5):
        assert abs(np.corrcoef(still, turned(math.radians(degrees)))[0, 1]) < 0.22
    assert np.corrcoef(still, turned(0.0, 0.08 * 0.25))[0, 1] > 0.7


def test_cheap_model_has_the_contrast_and_correlation_of_the_wave_model() -> None:
    g = (0.45, 0.4)
    keys = cell_keys(np.stack([*np.mgrid[:300, :300], np.zeros((300, 300))], axis=-1), 0.5)
    picture = gamma_speckle(np.full((300, 300), 50.0), keys, g, 1, contrast=0.8)
    assert picture.mean() == pytest.approx(50, rel=0.005)
    assert picture.std() / picture.mean() == pytest.approx(0.8 * pixel_contrast(g), rel=0.02)
    below = np.corrcoef(picture[1:].ravel(), picture[:-1].ravel())[0, 1]
    assert below == pytest.approx(pair_covariance(g, 1, 0) / pair_covariance(g, 0, 0), abs=0.02)
    assert (gamma_speckle(picture, keys, g, 1, contrast=0.0) == picture).all()


def test_keys_belong_to_the_object() -> None:
    points = np.random.default_rng(1).uniform(-50, 50, (1000, 3))
    keys = cell_keys(points, 0.05)
    centres = (np.floor(points / 0.05) + 0.5) * 0.05
    assert (cell_keys(centres, 0.05) == keys).all()
    assert len(np.unique(keys)) > 990
    assert (cell_keys(points + 0.05, 0.05) != keys).mean() > 0.99


@settings(max_examples=50)
@given(st.floats(0, 1))
def test_shares_have_the_contrast_and_sum_to_one(wanted: float) -> None:
    plain, shares = pattern_weights(wanted)
    assert plain + sum(shares) == pytest.approx(1)
    assert math.sqrt(sum(s * s for s in shares)) == pytest.approx(wanted, abs=1e-7)
    assert min((plain, *shares)) >= -1e-12
    assert len(shares) <= 4


def test_contrast_of_sources() -> None:
    assert contrast() == 1
    assert contrast(polarisation=0.0) == pytest.approx(math.sqrt(0.5))
    assert contrast(modes=4) == pytest.approx(0.5)


def test_grain_of_the_paper_rig() -> None:
    g = grain(633e-6, 4.0, 12.5 / 487.5, (0.009, 0.011))
    assert g == pytest.approx(PAPER, abs=0.001)
    assert oversampling(g) == (7, 9)
    assert oversampling((1.087, 1.087)) == (4, 4)
    assert cell_size(g, (0.009, 0.011), 12.5 / 487.5) == pytest.approx(0.0506, abs=1e-3)


def test_a_dark_picture_stays_dark() -> None:
    nothing = np.zeros((0, 4, 4))
    assert speckled(np.zeros((0, 2)), nothing, nothing, (8, 9), (1.0, 1.0), 1).sum() == 0


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"pixels": [[9, 0]]}, "beyond the picture"),
        ({"pixels": [[0, 0, 0]]}, "pixels of shape"),
        ({"energy": np.ones((1, 1, 1))}, "at least"),
        ({"energy": -np.ones((1, 4, 4))}, "not negative"),
        ({"keys": np.ones((2, 4, 4))}, "keys of shape"),
        ({"phase": np.ones((1, 4, 5))}, "phase of shape"),
        ({"contrast": 1.5}, "contrast"),
        ({"grain": (0.0, 1.0)}, "grain"),
    ],
)
def test_bad_arguments_are_refused_by_name(change: dict[str, object], word: str) -> None:
    one = np.ones((1, 4, 4))
    good: dict[str, object] = {
        "pixels": [[0, 0]], "energy": one, "keys": one, "shape": (4, 4), "grain": (1.0, 1.0),
        "seed": 1,
    }  # fmt: skip
    with pytest.raises(ValueError, match=word):
        speckled(**{**good, **change})  # type: ignore[arg-type]


def test_the_same_pixel_twice_is_refused() -> None:
    two = np.ones((2, 4, 4))
    with pytest.raises(ValueError, match="twice"):
        speckled([[0, 0], [0, 0]], two, two, (4, 4), (1.0, 1.0), 1)


def test_a_grain_too_fine_for_waves_is_refused() -> None:
    with pytest.raises(ValueError, match="gamma_speckle"):
        oversampling((0.01, 0.01))
