"""The working parts of the speckle model. Its kernels import numba; import it inside functions."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.simulate import _grain_kernels as kernels
from turnscan.simulate._airy import Grain, Keys, Singles, Window, jinc
from turnscan.simulate._grain_kernels import Complexes
from turnscan.simulate._random import normal_tables, phasor_table, seed64

_TURN = 4096
"""Steps of the table of phase factors."""


def hashed_cells(points: Floats, size: float) -> Keys:
    """(n, 3) → (n,) hash of the cubic cell of edge ``size`` that holds the point."""
    keys = np.empty(len(points), np.uint32)
    kernels.hash_cells(points, 1.0 / size, keys)
    return keys


def index_of_lit(
    pixels: npt.NDArray[np.int32], cells: kernels.Cells, shape: tuple[int, int]
) -> npt.NDArray[np.int32]:
    """(H, W) index of each lit pixel in the list, -1 where dark.

    Raises ValueError where a pixel is listed twice.
    """
    lit = np.full(shape, -1, np.int32)
    if kernels.index(pixels, cells, lit):
        raise ValueError("speckled: a pixel is listed twice")
    return lit


def expose_window(
    window: Window,
    lit: npt.NDArray[np.int32],
    cells: kernels.Cells,
    grain: Grain,
    seed: int,
    mixture: tuple[float, tuple[float, ...]],
    apron: int,
    out: Singles,
) -> None:
    """Add the picture of one window to ``out``, from the lit cells in it and in its apron.

    ``mixture`` is as of `pattern_weights`.
    """
    from scipy import fft

    plain, shares = mixture
    per_pixel = cells.energy.shape[1:]
    r0, r1, c0, c1 = window
    box = ((r1 - r0 + 2 * apron) * per_pixel[0], (c1 - c0) * per_pixel[1])
    size = (fft.next_fast_len(box[0]), fft.next_fast_len(box[1]))
    light = np.zeros(size, np.float32)
    ids = np.zeros(size if shares else (0, 0), np.uint32)
    turns = np.zeros(size if shares and len(cells.cycles) else (0, 0), np.float32)
    kernels.gather(lit, (r0 - apron, r1 + apron, c0, c1), cells, light, ids, turns)
    # One row of cells more at either end: the rule that integrates a pixel reaches over its edge.
    core = slice(apron * per_pixel[0] - 1, (apron + r1 - r0) * per_pixel[0] + 1)
    place = (r0, c0, c1 - c0)
    down, across = (_rule(n, g) for n, g in zip(per_pixel, grain, strict=True))
    if shares:
        amplitude, field = np.zeros(size, np.float32), np.empty(size, np.complex64)
        kernels.amplitudes(light, ids, _lobe(grain, per_pixel), amplitude)
    for k, share in enumerate(shares):
        kernels.dress(amplitude, ids, turns, seed64(seed, k), phasor_table(), _turns(), field)
        seen = _low_passed(field, _pupil(grain, per_pixel, size), core)
        kernels.integrate(kernels.intensity(seen), share, down, across, place, out)
    if plain:
        seen = _low_passed(light.astype(np.complex64), _transfer(grain, per_pixel, size), core)
        kernels.integrate(seen.real, plain, down, across, place, out)


def gamma_field(keys: Keys, seed: int, spread: float, neighbours: tuple[float, float]) -> Singles:
    """(H, W) Gamma numbers of mean 1 and relative spread ``spread``, correlated to neighbours."""
    from scipy.ndimage import correlate1d
    from scipy.special import gammaincinv, ndtr

    white = np.empty(keys.shape, np.float32)
    kernels.white(keys, seed64(seed, 0), white, *normal_tables())
    for axis, correlation in enumerate(neighbours):
        white = correlate1d(white, _short_filter(correlation), axis=axis, mode="wrap")
    shape = 1.0 / spread**2
    z = np.linspace(-6.0, 6.0, 2049)
    values = gammaincinv(shape, ndtr(z)) / shape
    return np.asarray(np.interp(white, z, values), dtype=np.float32)


def _short_filter(correlation: float) -> Floats:
    """Three taps (b, a, b) of power 1 whose output correlates by 2ab with its neighbour."""
    wanted = min(max(correlation, 0.0), 0.6)
    # a² + 2b² = 1 and 2ab = wanted, so 8b⁴ - 4b² + wanted² = 0.
    square = (1.0 - math.sqrt(1.0 - 2.0 * wanted**2)) / 4.0
    b = math.sqrt(square)
    return np.array([b, math.sqrt(1.0 - 2.0 * square), b])


@lru_cache(maxsize=32)
def _lobe(grain: Grain, per_pixel: tuple[int, int]) -> Singles:
    """How coherently cells of one scatterer add up in the lens, by their distance in cells.

    As far as a scatterer of edge λN'/2 can reach when the surface cuts it along its diagonal.
    """
    step = [1.0 / (n * g) for n, g in zip(per_pixel, grain, strict=True)]
    reach = [max(1, int(0.5 * math.sqrt(3.0) / s)) for s in step]
    y = np.arange(-reach[0], reach[0] + 1)[:, None] * step[0]
    x = np.arange(-reach[1], reach[1] + 1)[None, :] * step[1]
    return jinc(np.hypot(y, x)).astype(np.float32)


@lru_cache(maxsize=32)
def _rule(cells: int, grain: float) -> Singles:
    """(cells + 2,) weights of the cells of a pixel, and of one beyond either edge.

    They integrate light that has no frequency above 1/(λN'). The plain sum would let too much
    of the finest grain pass when a cell is half a grain: each cell must stand for its own mean,
    which a three-point average (a, 1 - 2a, a) gives, exact here at half the highest frequency.
    """
    beta = 1.0 / (cells * grain)
    a = (1.0 - np.sinc(0.5 * beta)) / (2.0 * (1.0 - math.cos(math.pi * beta)))
    rule = np.ones(cells + 2)
    rule[[0, -1]] = a
    rule[[1, -2]] -= a
    return rule.astype(np.float32)


def _radius(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Floats:
    """Spatial frequency in units of 1/(λN'), in the transform's order."""
    fy = np.fft.fftfreq(size[0], 1.0 / (per_pixel[0] * grain[0]))
    fx = np.fft.fftfreq(size[1], 1.0 / (per_pixel[1] * grain[1]))
    return np.asarray(np.hypot(fy[:, None], fx[None, :]), dtype=np.float64)


@lru_cache(maxsize=32)
def _pupil(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Singles:
    """The circular pupil on the frequencies of a window, of power gain 1 for white light."""
    # The edge is softened over one frequency step, so that its area does not jump with the size.
    step = max(n * g / m for n, g, m in zip(per_pixel, grain, size, strict=True))
    P = np.clip((0.5 - _radius(grain, per_pixel, size)) / step + 0.5, 0.0, 1.0)
    return (P * math.sqrt(P.size / (P**2).sum())).astype(np.float32)


@lru_cache(maxsize=8)
def _transfer(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Singles:
    """What the same lens does to incoherent light: the pupil's autocorrelation."""
    nu = np.minimum(_radius(grain, per_pixel, size), 1.0)
    otf = (np.arccos(nu) - nu * np.sqrt(1.0 - nu**2)) * (2.0 / np.pi)
    return np.asarray(otf, dtype=np.float32)


def _low_passed(field: Complexes, filter_: Singles, core: slice) -> Complexes:
    """The rows ``core`` of the field behind the filter.

    Columns of the spectrum that the filter kills are not transformed.
    """
    from scipy import fft

    # The filter falls with frequency: its first row is its widest, and the low frequencies stand
    # at either end.
    low = len(filter_[0]) // 2 + 1
    a, b = np.count_nonzero(filter_[0, :low]), np.count_nonzero(filter_[0, low:])
    ends = (int(a), int(b))
    spectrum = kernels.low_frequencies(fft.fft(field, axis=1), ends)
    spectrum = fft.fft(spectrum, axis=0, overwrite_x=True)
    kernels.filtered(spectrum, filter_, ends)
    part = fft.ifft(spectrum, axis=0, overwrite_x=True)
    full = kernels.whole_spectrum(part, core.start, core.stop, field.shape[1], ends[0])
    return np.asarray(fft.ifft(full, axis=1, overwrite_x=True))


@lru_cache(maxsize=1)
def _turns() -> Complexes:
    steps = np.arange(_TURN) + 0.5
    table: Complexes = np.exp(2j * np.pi * steps / _TURN).astype(np.complex64)
    table.flags.writeable = False
    return table
