"""A design's figures against the worked numbers, and its refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.rig import PRESET_NAMES, Design, design_preset, limits


def _paper(theta_deg: float) -> Design:
    return replace(design_preset("paper"), theta=math.radians(theta_deg))


def _two_megapixels() -> Design:
    return replace(
        design_preset("modern"),
        pixel_width=5.86e-3,
        pixel_height=5.86e-3,
        columns=1920,
        rows=1200,
        f_number=5.6,
        stripe_sigma=1.5,
        electrons=20_000.0,
        read_noise=7.0,
        step=math.radians(0.45),
    )


# Five rigs, worked by hand from the formulas: mm, except where a name says otherwise.
WORKED: dict[str, tuple[str, str, str, str, str]] = {
    "pixel across": ("0.44", "0.44", "0.44", "0.09", "0.15"),
    "pixel up": ("0.360", "0.360", "0.360", "0.086", "0.147"),
    "ΔR axis": ("1.155", "2.534", "0.508", "0.173", "0.293"),
    "ΔR rim": ("0.408", "0.376", "0.376", "0.081", "0.113"),
    "R_max": ("220", "312", "140", "145", "175"),
    "height at axis": ("173", "173", "173", "177", "176"),
    "camera px": ("0.0085", "0.0085", "0.0085", "0.0100", "0.0055"),
    "camera µm": ("9.8", "21.5", "4.3", "1.7", "1.6"),
    "Dorsch µm": ("85", "186", "37", "57", "40"),
    "speckle px": ("0.132", "0.132", "0.132", "0.511", "0.219"),
    "speckle µm": ("152", "334", "67", "88", "64"),
    "3 rows µm": ("64", "140", "28", "44", "28"),
    "arc 50": ("1.57", "1.57", "1.57", "0.20", "0.39"),
    "arc rim": ("6.90", "9.81", "4.39", "0.57", "1.37"),
    "sagitta": ("0.0271", "0.0385", "0.0173", "0.0003", "0.0013"),
    "corner": ("3.4", "4.9", "2.2", "0.3", "0.7"),
    "corner rms": ("2.38", "3.38", "1.52", "0.20", "0.47"),
    "step error": ("0.345", "0.490", "0.220", "0.028", "0.069"),
    "focus": ("69", "69", "69", "17", "20"),
    "decorrelation": ("0.101", "0.101", "0.101", "0.090", "0.063"),
}


def _worked(d: Design) -> dict[str, str]:
    um = float(d.delta_r()) * 1e3
    depolarised = replace(d, speckle_contrast=math.sqrt(0.5))
    return {
        "pixel across": f"{d.pixel_width * d.distance / d.focal:.2f}",
        "pixel up": f"{float(d.delta_z()):.3f}",
        "ΔR axis": f"{float(d.delta_r()) + 1e-9:.3f}",
        "ΔR rim": f"{d.delta_r_rim:.3f}",
        "R_max": f"{d.r_max:.0f}",
        "height at axis": f"{float(d.visible_height(0)):.0f}",
        "camera px": f"{d.camera_noise:.4f}",
        "camera µm": f"{d.camera_noise * um:.1f}",
        "Dorsch µm": f"{d.dorsch_limit * 1e3:.0f}",
        "speckle px": f"{d.speckle_noise():.3f}",
        "speckle µm": f"{d.speckle_noise() * um:.0f}",
        "3 rows µm": f"{depolarised.speckle_noise(3) * um:.0f}",
        "arc 50": f"{50 * d.step:.2f}",
        "arc rim": f"{d.r_max * d.step:.2f}",
        "sagitta": f"{float(d.sagitta(d.r_max)):.4f}",
        "corner": f"{float(d.corner_cut(d.r_max)):.1f}",
        "corner rms": f"{float(d.corner_cut_rms(d.r_max)):.2f}",
        "step error": f"{float(d.step_error(d.r_max)):.3f}",
        "focus": f"{d.depth_of_field:.0f}",
        "decorrelation": f"{d.decorrelation_step:.3f}",
    }


def test_worked_numbers() -> None:
    rigs = [_paper(22.4), _paper(10), _paper(60), design_preset("modern"), _two_megapixels()]
    got = [_worked(d) for d in rigs]
    assert {k: tuple(g[k] for g in got) for k in WORKED} == WORKED


@pytest.mark.parametrize(
    ("blur", "contrast"), [(0.24, 0.24), (0.5, 0.46), (1.0, 0.71), (2.0, 0.91)]
)
def test_speckle_contrast_in_a_pixel(blur: float, contrast: float) -> None:
    assert limits.pixel_speckle_contrast(blur, 1.0, 1.0) == pytest.approx(contrast, abs=0.03)


def test_speckle_contrast_at_the_ends() -> None:
    assert limits.pixel_speckle_contrast(1e3, 1.0, 1.0) == pytest.approx(1.0, abs=1e-3)
    many = [limits.pixel_speckle_contrast(b, 1.0, 1.0) for b in (1 / 89.9, 1 / 90.1)]
    assert many[0] == pytest.approx(many[1], rel=0.01)


@pytest.mark.parametrize(
    ("blur", "sigma", "rows", "simulated"),
    [
        (0.236, 1.5, 1, 0.114),
        (0.448, 1.5, 1, 0.206),
        (1.087, 2.0, 1, 0.486),
        (0.5, 3.0, 1, 0.320),
        (1.0, 3.0, 1, 0.570),
        (2.0, 3.0, 1, 0.895),
        (0.236, 1.5, 3, 0.067),
        (0.448, 1.5, 3, 0.129),
        (1.087, 2.0, 3, 0.334),
        (2.0, 3.0, 3, 0.701),
    ],
)
def test_line_speckle_against_wave_simulation(
    blur: float, sigma: float, rows: int, simulated: float
) -> None:
    predicted = limits.line_speckle(1.0, blur, sigma, float(rows))
    assert predicted == pytest.approx(simulated, rel=0.085)


def test_photon_bound_is_the_fisher_information() -> None:
    sigma, peak, read = 1.5, 20_000.0, 100.0
    i = np.arange(-40, 41) + 0.3
    mean = peak * np.exp(-(i**2) / (2 * sigma**2))
    slope = mean * i / sigma**2
    shot = 1 / math.sqrt(np.sum(slope**2 / np.maximum(mean, 1e-300)))
    dark = 1 / math.sqrt(np.sum(slope**2 / read**2))
    assert limits.photon_bound(sigma, peak) == pytest.approx(shot, rel=1e-4)
    assert limits.readout_bound(sigma, peak, read) == pytest.approx(dark, rel=1e-4)


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_presets_stand(name: str) -> None:
    d = design_preset(name)
    assert d.r_max > 50
    rim = d.point(d.half_width, d.half_height)
    assert float(2 * rim.z) == pytest.approx(d.h_max)
    assert np.isnan(d.delta_r(d.r_max * 1.01))
    step = math.degrees(d.recommended_step(d.r_max / 2))
    assert 360 / step == pytest.approx(round(360 / step))
    width = d.stripe_sigma * d.pixel_width * d.distance / d.focal
    arc = math.radians(step) * d.r_max / 2
    assert 1.4 * width < arc <= 1.5 * width


def test_delta_r_is_what_one_pixel_moves() -> None:
    d = replace(design_preset("modern"), pan=0.02, offset=1.0)
    R = np.linspace(0, d.r_max * 0.99, 20)
    x = d.pixel(R)[..., 0]
    half = d.pixel_width / 2
    moved = d.point(x + half).R - d.point(x - half).R
    np.testing.assert_allclose(d.delta_r(R), moved, rtol=1e-6)


def test_blind_columns_at_small_angles() -> None:
    d = _paper(10)
    assert math.isnan(d.r_min)
    limit = 320 - 12.5 * math.tan(math.radians(10)) / 0.011
    assert d.blind_columns == pytest.approx(limit, abs=1)
    assert _paper(30).blind_columns == 0
    assert _paper(30).r_min < 0


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"theta": 0.0}, "theta is 0°"),
        ({"theta": math.pi / 2}, "theta is 90°"),
        ({"theta": math.nan}, "theta is nan"),
        ({"focal": -16.0}, "focal is -16"),
        ({"focal": 500.0}, "focal is 500"),
        ({"distance": math.inf}, "distance is inf"),
        ({"columns": 0}, "columns is 0"),
        ({"rows": 10**6}, "rows is"),
        ({"pan": 2.0}, "pan is"),
        ({"pan": -0.9}, "outside the field of view"),
        ({"offset": 1e5}, "offset is"),
        ({"offset": -200.1}, "offset is"),
        ({"step": 4.0}, "step is"),
        ({"read_noise": -1.0}, "read_noise is -1"),
        ({"wavelength": 0.0}, "wavelength is 0"),
    ],
)
def test_impossible_designs_are_refused_by_name(change: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        replace(design_preset("modern"), **change)


def test_unknown_preset() -> None:
    with pytest.raises(InputError, match="tabletop"):
        design_preset("tabletop")


@given(
    theta=st.floats(1e-3, 1.57),
    distance=st.floats(1, 1e4),
    focal=st.floats(0.1, 1e3),
    pan=st.floats(-1, 1),
    offset=st.floats(-50, 50),
    columns=st.integers(1, 3000),
)
@settings(max_examples=150)
def test_any_design_is_refused_or_has_finite_figures(**values: Any) -> None:
    try:
        d = replace(design_preset("paper"), **values)
    except InputError:
        return
    assert 0 < d.r_max < math.inf
    assert 0 < d.h_max < math.inf
    assert d.delta_r_rim > 0
    assert d.recommended_step(d.r_max) > 0
    assert 0 <= d.blind_columns < d.columns
