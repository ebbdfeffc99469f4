"""Compare: how far a measured surface lies from a reference, and how much of it was measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, submesh
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Deviation, deviation, sample_surface
from turnscan.workflows._compare_options import CompareOptions
from turnscan.workflows._declare import chosen
from turnscan.workflows._files import write_atomically
from turnscan.workflows._loading import Source, load


@dataclass(frozen=True)
class Agreement:
    """How two surfaces agree within a tolerance."""

    tolerance: float
    """mm."""
    precision: float
    """Share of the measured vertices within the tolerance of the reference."""
    completeness: float
    """Share of the reference's area within the tolerance of the measured surface."""

    @property
    def f_score(self) -> float:
        """Harmonic mean of precision and completeness."""
        both = self.precision + self.completeness
        return 2 * self.precision * self.completeness / both if both > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Comparison:
    """How a measured surface lies to its reference."""

    mesh: Mesh
    """The measured surface, without faces that were not measured."""
    every: Deviation
    """Of every vertex of it, mm, positive outside of the reference."""
    deviation: Deviation
    """The same without vertices off the end of an open reference."""
    agreements: tuple[Agreement, ...]
    """One for each tolerance."""
    findings: tuple[Finding, ...] = ()
    """Of the reconstruction, where a scan was compared."""

    def figures(self) -> dict[str, Any]:
        """The figures, unrounded, by name with the unit at its end."""
        d = self.deviation
        return {
            "vertices": len(d.distance),
            "mean_mm": d.mean,
            "rms_mm": d.rms,
            "p95_mm": d.quantile(0.95),
            "max_mm": d.quantile(1.0),
            "tolerances": [
                {
                    "tolerance_mm": a.tolerance,
                    "precision": a.precision,
                    "completeness": a.completeness,
                    "f_score": a.f_score,
                }
                for a in self.agreements
            ],
        }

    def __str__(self) -> str:
        d = self.deviation
        lines = [
            f"{len(d.distance)} measured vertices against the reference: mean {d.mean:+.4f} mm, "
            f"rms {d.rms:.4f} mm, 95 % within {d.quantile(0.95):.4f} mm, "
            f"worst {d.quantile(1.0):.4f} mm"
        ]
        lines += [
            f"within {a.tolerance:g} mm: precision {a.precision:.2%}, completeness "
            f"{a.completeness:.2%}, F-score {a.f_score:.4f}"
            for a in self.agreements
        ]
        return "\n".join(lines)

    def save_picture(self, path: str | Path, limit: float | None = None) -> None:
        """Write the deviation as a colour map (PNG); ``limit`` ends its scale, in mm.

        Raises ExportError where it cannot be written.
        """
        from turnscan.workflows._deviation_map import deviation_figure
        from turnscan.workflows._html import png

        figure = deviation_figure(self.mesh, self.every, limit)
        write_atomically(Path(path), png(figure))


def compare(
    measured: Source,
    reference: Source,
    options: CompareOptions | None = None,
    *,
    progress: Progress = no_progress,
    **changes: Any,
) -> Comparison:
    """How far a measured surface lies from a reference, and how much of it was measured.

    Both are in one frame. Faces marked as not measured do not count, nor do vertices off the end
    of an open reference.

    Parameters
    ----------
    measured, reference
        Meshes, mesh files, results of `reconstruct`, or scans, which are reconstructed with their
        own settings.
    options
        Tolerances, samples and units of mesh files; None takes the usual ones.
    progress
        Told how far the reconstruction of a scan is; it may cancel.
    changes
        Options to change by name, as in ``tolerances=(0.1,)``.

    Returns
    -------
    Comparison
        Deviations, figures and a colour map; as text, one line each.

    Raises
    ------
    InputError
        Where there is no surface, and for an option that cannot be.

    >>> import turnscan as ts
    >>> found = ts.compare("cup.turnscan", "cup.turnscan")
    >>> found.deviation.rms < 1e-6, found.agreements[0].precision
    (True, 1.0)
    """
    wanted = chosen(CompareOptions, options, changes)
    got = load(measured, wanted.unit, progress.subrange(0, 0.5))
    truth = load(reference, wanted.reference_unit, progress.subrange(0.5, 1)).mesh
    mesh = got.mesh
    if not len(mesh.faces):
        raise InputError(f"{got.name}: no faces", hint="compare a mesh, not a cloud of points")
    if mesh.measured is not None:
        mesh = submesh(mesh, mesh.measured)
    every = deviation(mesh.vertices, truth)
    out = every.covered()
    back = deviation(sample_surface(truth, wanted.samples), mesh)
    agreements = tuple(Agreement(t, out.within(t), back.within(t)) for t in wanted.tolerances)
    return Comparison(mesh, every, out, agreements, got.findings)
