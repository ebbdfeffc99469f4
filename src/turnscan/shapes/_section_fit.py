"""A section of a mesh: what was measured, and what was fitted to it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes._outline_curves import Outline
from turnscan.shapes._outline_fit import fit_outlines
from turnscan.shapes._outline_together import held_together
from turnscan.shapes._section import Chain, Cut, CutMisses, cross_section
from turnscan.shapes.views._silhouette import outermost, silhouette
from turnscan.shapes.views._unrolled import Relief, unrolled


@dataclass(frozen=True)
class FittedSection:
    """One cut through a part."""

    cut: Cut
    chains: tuple[Chain, ...]
    """The polylines as they were measured, the longest first."""
    outlines: tuple[tuple[Outline, ...], ...]
    """For each chain the outlines of its measured stretches."""
    relief: Relief | None = None
    """Of an unrolled surface, whose chains have one radius each."""

    @property
    def fitted(self) -> list[Outline]:
        """All outlines."""
        return [o for row in self.outlines for o in row]

    @property
    def unstated(self) -> str:
        """How many lines have no sizes and why, in words; empty where all have."""
        chords = sum(o.chords for o in self.fitted)
        lines = f"{chords} lines rest" if chords > 1 else "1 line rests"
        return f"{lines} on fewer than three measured places: no sizes" if chords else ""

    @property
    def box(self) -> Floats:
        """(2, 2) mm: least and largest x and y of what was fitted, or of the points if nothing.

        That of a turned part begins at its axis, x = 0.
        """
        if self.relief is not None:
            return self.relief.box
        boxes = [o.box for o in self.fitted]
        boxes = boxes or [
            np.stack([c.points.min(axis=0), c.points.max(axis=0)]) for c in self.chains
        ]
        every = np.stack(boxes)
        low, high = every[:, 0].min(axis=0), every[:, 1].max(axis=0)
        return np.stack([low * [0.0, 1.0] if self.cut.turned else low, high])

    @property
    def extent(self) -> Floats:
        """(2, 2) mm: ``box``, with the axis x = 0 from which a half-plane goes."""
        low, high = self.box
        return np.stack([np.minimum(low, [0.0, np.inf]) if self.cut.half else low, high])

    @property
    def size_sigma(self) -> Floats:
        """(2,) mm: standard uncertainty of width and height of ``box``; NaN where not known."""
        if not self.fitted:
            return np.full(2, np.nan)
        every = np.stack([o.box for o in self.fitted])
        sigma = np.stack([o.box_sigma for o in self.fitted])
        low, high = every[:, 0].argmin(axis=0), every[:, 1].argmax(axis=0)
        axes = np.arange(2)
        first, last = sigma[low, 0, axes], sigma[high, 1, axes]
        return np.asarray(np.hypot(first * [0.0, 1.0] if self.cut.turned else first, last))


def fit_section(mesh: Mesh, cut: Cut, tolerance: float | None = None) -> FittedSection:
    """Cut a mesh and fit lines, arcs and splines to the section (`cross_section`, `fit_outlines`).

    ``tolerance`` mm, or None for what the noise allows. The outline of a silhouette is that of the
    outermost points, which its uncertainties hold (`outermost`). To an unrolled surface nothing is
    fitted. Raises InputError as they do.
    """
    if cut.view == "unrolled":
        chains, relief = unrolled(mesh)
        return FittedSection(cut, tuple(chains), ((),) * len(chains), relief)
    if cut.view == "section":
        chains = cross_section(mesh, cut)
        together = held_together(mesh, cut, chains)
        chains = [replace(c, together=together) for c in chains]
        rows = fit_outlines(chains, tolerance)
        return FittedSection(cut, tuple(chains), tuple(map(tuple, rows)))
    chains = silhouette(mesh, cut)
    if not chains:
        raise CutMisses(f"{cut.name}: the mesh has no faces that are seen from there",
                        hint="give a surface, and another direction")  # fmt: skip
    rows = [[outermost(o) for o in row] for row in fit_outlines(chains, tolerance)]
    return FittedSection(cut, tuple(chains), tuple(map(tuple, rows)))
