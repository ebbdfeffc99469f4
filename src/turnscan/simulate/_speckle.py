"""Laser speckle, wave-true: phasors that ride on the object, seen through the lens's pupil.

A rough surface lit by a laser scatters with random phases. Each small cell of the surface has one
circular complex Gaussian phasor, found by hashing its place on the object, so the same surface
gives the same speckle wherever the table has carried it. The image amplitude is the phasors
times the root of the energy, low-passed by the circular pupil, whose amplitude cut-off is
1/(2 λN'), N' = N(1+m); the picture is its squared modulus, summed over pixels and over the
mutually incoherent patterns (polarisations, wavelengths). Source: Goodman, Speckle Phenomena in
Optics; Dorsch, Häusler and Herrmann, Applied Optics 33 (1994) 1306.

The grain λN' is written (gy, gx) in pixel heights and widths: the two differ for oblong pixels.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.simulate._airy import Grain, Keys, Singles, Window, jinc

if TYPE_CHECKING:
    from turnscan.simulate._grain_kernels import Cells

MAX_PATTERNS = 4
"""Patterns computed at most; lower contrasts are had by mixing in speckle-free light."""
_LEAST_CELLS = 4
_MOST_CELLS = 128
_CHUNK_ROWS = 32
_APRON_GRAINS = 3.0


def grain(wavelength: float, f_number: float, magnification: float, pitch: Grain) -> Grain:
    """λN' = λN(1+m) in pixel heights and widths, from mm and pixel ``pitch`` (y, x) in mm."""
    blur = wavelength * f_number * (1.0 + magnification)
    return blur / pitch[0], blur / pitch[1]


def oversampling(grain: Grain, per_grain: int = 2) -> tuple[int, int]:
    """Cells per pixel (down, across) that resolve this grain: cells of at most λN'/``per_grain``.

    Intensity has no frequency above 1/(λN'), so λN'/2 is its Nyquist interval: with two cells per
    grain every single picture has the right statistics. How speckle changes while the surface
    moves by less than a grain takes four. At least four cells per pixel, for the picture's sake.

    Raises ValueError where the grain is too fine for the wave model (over 128 cells per pixel).
    """
    _check_grain(grain)
    if per_grain < 2:
        raise ValueError(f"oversampling: {per_grain} cells per grain, at least 2")
    down, across = (max(_LEAST_CELLS, math.ceil(per_grain / g - 1e-9)) for g in grain)
    if max(down, across) > _MOST_CELLS:
        raise ValueError(
            f"oversampling: grain {grain} px takes {down} x {across} cells per pixel, "
            f"at most {_MOST_CELLS}; use gamma_speckle"
        )
    return down, across


def cell_size(grain: Grain, pitch: Grain, magnification: float) -> float:
    """Edge of a scatterer on the object, mm: λN'/(2m)."""
    return 0.5 * grain[0] * pitch[0] / magnification


def contrast(polarisation: float = 1.0, modes: float = 1.0) -> float:
    """Speckle contrast before the pixel integrates.

    ``polarisation`` is the degree of polarisation of the scattered light (0 for a matt white
    surface: contrast 1/√2), ``modes`` the number of equal, mutually incoherent wavelengths.
    """
    if not 0.0 <= polarisation <= 1.0 or not modes >= 1.0:
        raise ValueError(f"contrast: polarisation {polarisation}, modes {modes}; 0 to 1, 1 or more")
    return math.sqrt(0.5 * (1.0 + polarisation**2) / modes)


def pattern_weights(contrast: float) -> tuple[float, tuple[float, ...]]:
    """(speckle-free share, shares of the independent patterns) with this contrast; they sum to 1.

    The fewest patterns that will do, the last of its own weight: Σ shares² = contrast².
    """
    if not 0.0 <= contrast <= 1.0:
        raise ValueError(f"pattern_weights: contrast {contrast}, expected 0 to 1")
    if contrast == 0.0:
        return 1.0, ()
    least = 1.0 / math.sqrt(MAX_PATTERNS)
    if contrast < least:
        coherent = contrast / least
        return 1.0 - coherent, (coherent / MAX_PATTERNS,) * MAX_PATTERNS
    n = math.ceil(1.0 / contrast**2 - 1e-9)
    if n == 1:
        return 0.0, (1.0,)
    # (n-1) a + b = 1 and (n-1) a² + b² = contrast²
    a = (1.0 + math.sqrt(max(n * contrast**2 - 1.0, 0.0) / (n - 1))) / n
    return 0.0, (a,) * (n - 1) + (1.0 - (n - 1) * a,)


def cell_keys(points: npt.ArrayLike, size: float) -> Keys:
    """Which scatterer each surface point belongs to.

    ``points`` (..., 3) are in coordinates fixed to the object, mm; ``size`` is the edge of the
    cubic cells. Returns (...) uint32 hashes of the cell's three whole numbers.
    """
    from turnscan.simulate import _grain

    X = np.ascontiguousarray(points, dtype=np.float64)
    if X.ndim < 1 or X.shape[-1] != 3:
        raise ValueError(f"cell_keys: points of shape {X.shape}, expected (..., 3)")
    if not (math.isfinite(size) and size > 0):
        raise ValueError(f"cell_keys: size {size} mm, expected above 0")
    return _grain.hashed_cells(X.reshape(-1, 3), size).reshape(X.shape[:-1])


def path_phase(
    points: npt.ArrayLike,
    size: float,
    laser: npt.ArrayLike,
    lens: npt.ArrayLike,
    wavelength: float,
) -> Singles:
    """Cycles, without the whole ones, of light from the laser by each scatterer to the lens.

    ``points`` (..., 3) and ``size`` as for `cell_keys`; ``laser`` and ``lens`` (3,) are in the
    same coordinates, fixed to the object; all mm. The path goes by one place in the scatterer's
    cell, so that all points of a scatterer have one phase. Returns (...).
    """
    from turnscan.simulate import _grain_kernels

    X = np.ascontiguousarray(points, dtype=np.float64)
    phase = np.empty(X.shape[:-1], np.float32)
    begin, end = (tuple(np.asarray(x, dtype=np.float64).tolist()) for x in (laser, lens))
    rough = _grain_kernels.Roughness(size, begin, end, 1.0 / wavelength)
    _grain_kernels.path_cycles(X.reshape(-1, 3), rough, phase.reshape(-1))
    return phase


def speckled(
    pixels: npt.ArrayLike,
    energy: npt.ArrayLike,
    keys: npt.ArrayLike,
    shape: tuple[int, int],
    grain: Grain,
    seed: int,
    *,
    contrast: float = 1.0,
    phase: npt.ArrayLike | None = None,
) -> Singles:
    """The picture of a laser-lit surface with speckle: expected electrons (H, W).

    ``pixels`` (n, 2): row and column of the lit pixels, each once, any order.
    ``energy`` (n, oy, ox): expected electrons of each cell of each pixel, as rays would give them
    (oy, ox as of `oversampling`, or more); their sum is the energy of the picture in the mean.
    ``keys`` (n, oy, ox) uint32: the scatterer each cell shows, from `cell_keys`.
    ``phase`` (n, oy, ox), cycles, from `path_phase`: added to the phasor's own, it changes the
    speckle as the table turns. Without it, speckle only moves along with the surface.
    ``seed`` says which rough surface; ``contrast`` as of `contrast`.

    Raises ValueError, naming the argument, where shapes or values do not fit.
    """
    from turnscan.simulate._grain_kernels import Cells

    where, cells, ids, turns = _checked(pixels, energy, keys, phase, shape, grain)
    all_ = np.ones((len(where), 1, 1), np.bool_)
    return imaged(where, Cells(cells, ids, turns, all_), shape, grain, seed, contrast)


def imaged(
    where: npt.NDArray[np.int32],
    cells: Cells,
    shape: tuple[int, int],
    grain: Grain,
    seed: int,
    contrast: float,
) -> Singles:
    """As `speckled`, of arrays that are known to fit: pixels and their cells."""
    from turnscan.simulate import _grain

    out = np.zeros(shape, np.float32)
    mixture = pattern_weights(contrast)
    lit = _grain.index_of_lit(where, cells, shape)
    apron = max(1, math.ceil(_APRON_GRAINS * max(grain)))
    for window in _windows(lit, apron):
        _grain.expose_window(window, lit, cells, grain, seed, mixture, apron, out)
    return out


def gamma_speckle(
    electrons: npt.ArrayLike, keys: npt.ArrayLike, grain: Grain, seed: int, *, contrast: float = 1.0
) -> Singles:
    """The cheap model for grains up to about half a pixel: a Gamma field times the picture.

    ``electrons`` (H, W) without speckle, ``keys`` (H, W) from `cell_keys` at the pixel centres.
    Contrast and the correlation of neighbouring pixels are those of `pixel_contrast`; finer
    structure, the exact distribution, and sub-pixel motion are not modelled.
    """
    from turnscan.simulate import _grain

    _check_grain(grain)
    light = np.ascontiguousarray(electrons, dtype=np.float32)
    ids = np.ascontiguousarray(keys, dtype=np.uint32)
    if light.ndim != 2 or light.shape != ids.shape:
        raise ValueError(f"gamma_speckle: electrons {light.shape} and keys {ids.shape} differ")
    spread = pixel_contrast(grain) * contrast
    if spread == 0.0:
        return light.copy()
    return _grain.gamma_field(ids, seed, spread, _neighbours(grain)) * light


@cache
def pixel_contrast(grain: Grain, rows: int = 1) -> float:
    """Speckle contrast after integration over a pixel (or a block of ``rows`` pixels), C = 1.

    The square is the mean of |γ|² over pairs of points of the pixel, γ = 2 J1(πr/λN')/(πr/λN').
    """
    return math.sqrt(pair_covariance(grain, 0, 0, rows))


def pair_covariance(grain: Grain, down: float, across: float, rows: int = 1) -> float:
    """Covariance of two pixels' intensity, this many rows and columns apart, mean intensity 1."""
    y, wy = _box_pairs(down, grain[0], rows)
    x, wx = _box_pairs(across, grain[1], 1)
    return float(wy @ (jinc(np.hypot(y[:, None], x[None, :])) ** 2) @ wx)


def _box_pairs(distance: float, grain: float, pixels: int) -> tuple[Floats, Floats]:
    """Separations in grains of points of two boxes, and their weights (a triangle)."""
    n = max(64, math.ceil(24 * pixels / grain))
    t = (np.arange(-n, n) + 0.5) / n
    weight = 1.0 - np.abs(t)
    return (distance + pixels * t) / grain, weight / weight.sum()


@lru_cache(maxsize=16)
def _neighbours(grain: Grain) -> tuple[float, float]:
    """Correlation of a pixel's speckle with its neighbour below and beside it."""
    own = pair_covariance(grain, 0, 0)
    return pair_covariance(grain, 1, 0) / own, pair_covariance(grain, 0, 1) / own


def _check_grain(grain: Grain) -> None:
    if not all(math.isfinite(g) and g > 0 for g in grain):
        raise ValueError(f"grain {grain}: λN' in pixels must be above 0")


def _checked(
    pixels: npt.ArrayLike,
    energy: npt.ArrayLike,
    keys: npt.ArrayLike,
    phase: npt.ArrayLike | None,
    shape: tuple[int, int],
    grain: Grain,
) -> tuple[npt.NDArray[np.int32], Singles, Keys, Singles]:
    where = np.ascontiguousarray(pixels, dtype=np.int32)
    cells = np.ascontiguousarray(energy, dtype=np.float32)
    ids = np.ascontiguousarray(keys, dtype=np.uint32)
    none = np.zeros((0, 0, 0), np.float32)
    turns = none if phase is None else _whole_turns_removed(phase)
    if where.ndim != 2 or where.shape[1] != 2:
        raise ValueError(f"speckled: pixels of shape {where.shape}, expected (n, 2)")
    if cells.ndim != 3 or any(
        n * g < 2 - 1e-6 for n, g in zip(cells.shape[1:], grain, strict=True)
    ):
        raise ValueError(
            f"speckled: energy of shape {cells.shape}, "
            f"expected (n, oy, ox) with oy, ox of at least {oversampling(grain)}"
        )
    wanted = (len(where), *cells.shape[1:])
    for name, got in (("energy", cells), ("keys", ids), ("phase", turns)):
        if got is not none and got.shape != wanted:
            raise ValueError(f"speckled: {name} of shape {got.shape}, expected {wanted}")
    if len(where):
        if where.min() < 0 or (where.max(axis=0) >= shape).any():
            raise ValueError(f"speckled: pixels beyond the picture of {shape[0]} x {shape[1]}")
        if not (cells.min() >= 0 and cells.max() < np.inf):
            raise ValueError("speckled: energy must be finite and not negative")
    return where, cells, ids, turns


def _whole_turns_removed(phase: npt.ArrayLike) -> Singles:
    """Cycles modulo 1: a path is some 10⁶ wavelengths, beyond what float32 can hold."""
    cycles = np.asarray(phase)
    return np.ascontiguousarray(cycles - np.floor(cycles), dtype=np.float32)


def _windows(lit: npt.NDArray[np.int32], apron: int) -> list[Window]:
    """Cut the picture into chunks of rows, and each chunk where at least two aprons are dark.

    Light beyond a window's apron is too far away to interfere in it, so the windows can be
    transformed one by one and their pictures laid side by side.
    """
    H, W = lit.shape
    windows: list[Window] = []
    for r0 in range(0, H, _CHUNK_ROWS):
        r1 = min(r0 + _CHUNK_ROWS, H)
        near = (lit[max(r0 - apron, 0) : r1 + apron] >= 0).any(axis=0)
        columns = np.flatnonzero(near)
        if len(columns) == 0:
            continue
        cuts = np.flatnonzero(np.diff(columns) > 2 * apron)
        starts = columns[np.concatenate([[0], cuts + 1])]
        ends = columns[np.concatenate([cuts, [len(columns) - 1]])] + 1
        windows += [
            (r0, r1, max(int(a) - apron, 0), min(int(b) + apron, W))
            for a, b in zip(starts, ends, strict=True)
        ]
    return windows
