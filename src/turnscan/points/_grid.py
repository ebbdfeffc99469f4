"""RangeGrid, the master structure of a scan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Flags, Floats, Ints, Singles, frozen, handed_over
from turnscan.picture import Picture, card, coloured, image, shrunk
from turnscan.threads import in_parts

_BESIDE = 16
"""Lines beside those with points; no kernel looks further along a profile than 12."""


@dataclass(frozen=True)
class Origin:
    """What a resampled grid was made of: which of its points are one surface is asked there."""

    grid: RangeGrid
    """As it was measured; in its own frame, wherever the resampled one was placed since."""
    lines: Floats
    """(s, n) line of ``grid`` at which each point of the new one lies, a fraction between two;
    ascending along each profile, NaN where there is none."""


@dataclass(frozen=True)
class RangeGrid:
    """Profiles of one laser stacked as (step, line): where each measured point lies, and how well.

    Points are in the table frame turned back to angle 0 (the object's frame), so all steps of a
    scan lie in one frame. Lines are image rows (columns for a horizontal stripe).
    """

    laser: str
    steps: Ints
    """(s,) step numbers of the scan, ascending."""
    angles: Floats
    """(s,) table angles, radians, counter-clockwise seen from above."""
    points: Floats
    """(s, n, 3) mm, NaN where missing."""
    sigma: Floats
    """(s, n) mm: how far the stripe's standard uncertainty moves the point along the laser sheet,
    NaN where missing."""
    amplitude: Floats
    """(s, n) grey levels, NaN where missing."""
    flags: Flags
    """(s, n) bits of `turnscan.stripes.StripeFlag`: quality, or why a point is missing."""
    closed: bool
    """True when the steps go all the way round, so that the last profile neighbours the first."""
    eyes: Floats | None = None
    """(s, 3) mm: where the camera stood in the object's frame at each step; None when not known."""
    behind: Bools | None = None
    """(s, n) True where the laser sheet was met beyond the rotation axis, so that neighbouring
    steps run the other way round; None when nowhere."""
    origin: Origin | None = None
    """The grid that this one was resampled from; None for one that was measured so."""
    thickness: float = 0.0
    """mm rms of the sheet of light, as the stripes' widths say; 0 where they do not."""
    light_doubt: Singles | None = None
    """(s, n, 3) mm by which one standard deviation of what is not known of the thick sheet moves
    the points, all of them at once, so that it does not average out; None where its thickness is
    not known."""
    halo: Singles | None = None
    """(s, n) mm by which light that spread in the material is estimated to have moved a point along
    the laser sheet, where it is flagged HALO; NaN elsewhere and where its tails do not tell."""
    noise: Singles | None = None
    """(s, n) mm: of ``sigma``, what moves each point by itself, so that it averages out; the rest
    may move those beside it alike. NaN where missing; None where it is not known."""
    width_share: Singles | None = None
    """(s, n) cosine between the way along which the error of a stripe's centre moves its point and
    the surface's normal, as the stripe's width tells, or a larger one; NaN where it tells nothing,
    None where no width was looked at."""
    alike: float = 0.0
    """Correlation of ``noise`` on adjacent lines of a profile: speckle grains taller than a pixel,
    interpolated colours, JPEG."""

    def __post_init__(self) -> None:
        if self.points.ndim != 3:
            raise ValueError(f"RangeGrid.points: shape {self.points.shape}, expected (s, n, 3)")
        s, n, _ = self.points.shape
        put = object.__setattr__
        put(self, "steps", frozen(self.steps, (s,), "RangeGrid.steps", np.int32))
        put(self, "angles", frozen(self.angles, (s,), "RangeGrid.angles"))
        put(self, "points", frozen(self.points, (s, n, 3), "RangeGrid.points", nan=True))
        put(self, "sigma", frozen(self.sigma, (s, n), "RangeGrid.sigma", nan=True))
        put(self, "amplitude", frozen(self.amplitude, (s, n), "RangeGrid.amplitude", nan=True))
        put(self, "flags", frozen(self.flags, (s, n), "RangeGrid.flags", np.uint16))
        if self.eyes is not None:
            put(self, "eyes", frozen(self.eyes, (s, 3), "RangeGrid.eyes"))
        if self.light_doubt is not None:
            doubt = frozen(self.light_doubt, (s, n, 3), "RangeGrid.light_doubt", np.float32)
            put(self, "light_doubt", doubt)
        if self.halo is not None:
            halo = frozen(self.halo, (s, n), "RangeGrid.halo", np.float32, nan=True)
            put(self, "halo", halo)
        if self.noise is not None:
            noise = frozen(self.noise, (s, n), "RangeGrid.noise", np.float32, nan=True)
            put(self, "noise", noise)
        if self.width_share is not None:
            share = frozen(self.width_share, (s, n), "RangeGrid.width_share", np.float32, nan=True)
            put(self, "width_share", share)
        if self.behind is not None:
            put(self, "behind", frozen(self.behind, (s, n), "RangeGrid.behind", np.bool_))

    def show(self) -> Picture:
        """A map of the points' distance from the rotation axis: a step a column, a line a row."""
        return Picture(coloured(np.hypot(self.points[..., 0], self.points[..., 1]).T))

    def _repr_html_(self) -> str:
        there = self.found
        rows: list[tuple[str, object]] = [
            ("profiles", f"{len(self.steps)}{', all the way round' if self.closed else ''}"),
            ("points", f"{int(there.sum())} of {there.size}"),
        ]
        if there.any():
            away = np.hypot(self.points[..., 0], self.points[..., 1])[there]
            height = self.points[..., 2][there]
            rows += [
                ("from the axis", f"{away.min():.2f} to {away.max():.2f} mm"),
                ("height", f"{height.min():.2f} to {height.max():.2f} mm"),
                ("sigma, median", f"{np.nanmedian(self.sigma):.4f} mm"),
            ]
        return card(f"Range grid of laser {self.laser}", rows, self._map() if there.any() else "")

    def _map(self) -> str:
        """The map without the lines that nothing was found in, a few pixels a step."""
        lines = np.flatnonzero(self.found.any(axis=0))
        small = shrunk(self.show().pixels[lines[0] : lines[-1] + 1], 320)
        return image(np.repeat(small, max(1, 240 // small.shape[1]), axis=1))

    @property
    def found(self) -> Bools:
        """(s, n) True where there is a point."""
        return ~np.isnan(self.points[..., 0])

    def lines_about(self) -> slice:
        """The lines that have points, from first to last, and some beside them, so that nothing
        ends at the border of those lines which would not end there anyway.

        A sensor has far more lines than a part covers: what is done to points need not look at all.
        """
        return lines_about(self.found)

    def of_lines(self, lines: slice) -> RangeGrid:
        """The grid of these lines alone, numbered from 0; not of one that was resampled."""
        if lines == slice(0, self.flags.shape[1]):
            return self
        return replace(
            self,
            points=self.points[:, lines],
            sigma=self.sigma[:, lines],
            amplitude=self.amplitude[:, lines],
            flags=self.flags[:, lines],
            behind=None if self.behind is None else self.behind[:, lines],
            light_doubt=None if self.light_doubt is None else self.light_doubt[:, lines],
            halo=None if self.halo is None else self.halo[:, lines],
            noise=None if self.noise is None else self.noise[:, lines],
            width_share=None if self.width_share is None else self.width_share[:, lines],
        )

    def among(self, lines: slice, light: Floats, flags: Flags) -> RangeGrid:
        """The grid of all lines, which has points in these ``lines`` alone: those of this one.

        ``light`` and ``flags`` (s, n) are what is known of all others.
        """
        if self.flags.shape == flags.shape:
            return self

        def all_of(
            values: npt.NDArray[Any], others: npt.ArrayLike, nan: bool = False
        ) -> npt.NDArray[Any]:
            out = np.empty((*flags.shape, *values.shape[2:]), values.dtype)

            def part(a: int, b: int) -> None:
                out[a:b] = others[a:b] if isinstance(others, np.ndarray) else others
                out[a:b, lines] = values[a:b]

            in_parts(part, len(out))
            return handed_over(out, nan=nan)

        behind, doubt, halo = self.behind, self.light_doubt, self.halo
        share = self.width_share
        return replace(
            self,
            points=all_of(self.points, np.nan, nan=True),
            sigma=all_of(self.sigma, np.nan, nan=True),
            amplitude=all_of(self.amplitude, light, nan=True),
            flags=all_of(self.flags, flags),
            behind=None if behind is None else all_of(behind, False),
            light_doubt=None if doubt is None else all_of(doubt, 0.0),
            halo=None if halo is None else all_of(halo, np.nan, nan=True),
            noise=None if self.noise is None else all_of(self.noise, np.nan, nan=True),
            width_share=None if share is None else all_of(share, np.nan, nan=True),
        )


def lines_about(found: Bools) -> slice:
    """`RangeGrid.lines_about` of the points that were ``found`` (s, n)."""
    at = np.flatnonzero(found.any(axis=0))
    if not len(at):
        return slice(0, 0)
    return slice(max(int(at[0]) - _BESIDE, 0), min(int(at[-1]) + 1 + _BESIDE, found.shape[1]))
