"""The search in a picture of which only the pixels near the stripe are kept.

What costs time and memory here is the light that was kept, not the picture it was taken from. The
stripe is to the bit the one that `Signal.detect` finds in the whole picture.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Image
from turnscan.errors import InputError
from turnscan.runs import Runs
from turnscan.stripes._detect import Table, chosen, readable, region_of, terms_of
from turnscan.stripes._settings import StripeSettings
from turnscan.stripes._stripe import MEASURES, Stripe, StripeFlag

if TYPE_CHECKING:
    from turnscan.stripes._signal import Signal


class RunDetector:
    """Finds the stripe in the runs of one frame after the other; for one thread at a time.

    It keeps a picture as a work surface, of which it only ever writes and reads what is near the
    runs of the frame.
    """

    def __init__(
        self,
        signal: Signal,
        settings: StripeSettings,
        shape: tuple[int, int],
        inside: Bools | None = None,
    ) -> None:
        """``settings`` and ``inside`` are those of `Signal.detect`, ``shape`` (H, W) of pictures.

        Raises InputError where mask or region of interest do not fit the shape.
        """
        self._signal = signal
        mask = settings.mask
        if mask is not None and mask.shape != shape:
            raise InputError(f"mask of shape {mask.shape} for pictures of shape {shape}")
        self._roi = region_of(settings, shape)
        self._flat = settings.orientation == "horizontal"
        self._mask = self._laid(np.ones((0, 0), np.bool_) if mask is None else mask)
        self._inside = None if inside is None else self._laid(inside)
        self._settings = signal.in_levels(replace(settings, mask=None))
        self._shape = shape[::-1] if self._flat else shape
        self._lit: Image = np.zeros((0, 0), np.uint8)
        self._dark: Image = self._lit

    def stripe(self, runs: Runs, level: float, noise: float) -> Stripe | None:
        """The stripe of a frame, or None where only whole pictures tell.

        That is where the noise is not known, where light above the threshold is not kept, and where
        runs are not in order. ``level`` and ``noise`` are those of `Signal.detect`.
        """
        if math.isnan(noise):
            return None
        from turnscan.stripes._runs_kernels import Order, Surface, find_in_runs, lay_runs

        lit, dark = self._surface(runs)
        nothing = readable(np.zeros((0, 0), lit.dtype))
        behind = nothing if runs.background is None else readable(runs.background)
        off = np.zeros(0, lit.dtype) if runs.dark is None else runs.dark
        paired = runs.dark is not None or runs.background is not None
        known = (level + (0.0 if paired else self._signal.black), noise)
        terms = terms_of(self._settings, known, paired=paired)
        surface = Surface(lit, dark, behind, self._mask, (runs.ground, runs.dark_ground))
        order = Order(np.cumsum(runs.counts), runs.starts, runs.lengths)
        if not lay_runs(surface, order, runs.lit, off, terms):
            return None
        lines, wanted = self._shape[0], self._settings.max_candidates
        table = np.full((MEASURES, lines, wanted), np.nan)
        bits = np.zeros((lines, wanted), np.uint16)
        u0, v0, u1, v1 = self._roi
        if u0 < u1 and v0 < v1:
            unlit = dark if runs.dark is not None else np.zeros((1, lit.shape[1]), lit.dtype)
            below = readable(unlit) if runs.background is None else behind
            find_in_runs(surface, readable(lit), below, order, self._roi, terms, table, bits)
        bits[:v0, 0] |= np.uint16(StripeFlag.OUTSIDE)
        bits[v1:, 0] |= np.uint16(StripeFlag.OUTSIDE)
        return self._chosen(table, bits)

    def _chosen(self, table: Table, bits: npt.NDArray[np.uint16]) -> Stripe:
        from turnscan.stripes._choice import restrict_lines

        beyond = None
        if self._inside is not None:
            beyond = np.empty(bits.shape)
            restrict_lines(table, bits, self._inside, beyond)
        gain = self._signal.gain
        stripe = chosen(table, bits, self._settings.orientation, self._settings, beyond)
        return stripe if gain == 1.0 else replace(stripe, amplitude=stripe.amplitude / gain)

    def _surface(self, runs: Runs) -> tuple[Image, Image]:
        """Pictures to lay the runs on, of any content: the second where there are dark runs."""
        if self._lit.dtype != runs.lit.dtype or self._lit.shape != self._shape:
            self._lit = np.empty(self._shape, runs.lit.dtype)
        if runs.dark is None:
            return self._lit, np.empty((0, 0), runs.lit.dtype)
        if self._dark.dtype != runs.lit.dtype or self._dark.shape != self._shape:
            self._dark = np.empty(self._shape, runs.lit.dtype)
        return self._lit, self._dark

    def _laid(self, picture: Bools) -> Bools:
        """Read-only, lines as rows."""
        view = np.ascontiguousarray(picture.T if self._flat else picture).view()
        view.flags.writeable = False
        return view
