"""ReconstructResult: a surface with where it comes from and what there is to know about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan import edit
from turnscan.errors import ExportError
from turnscan.findings import Finding
from turnscan.formats import ExportOptions, Profiles
from turnscan.mesh import Mesh
from turnscan.picture import card, image
from turnscan.pipeline import Reconstruction
from turnscan.points import RangeGrid, cloud, profiles
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.shapes import Source
from turnscan.surface.holes import Hole
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._solids._sections import Sections, cuts_of, sections_of
from turnscan.workflows._surface._report import (
    ReportTable,
    figures,
    known,
    made_from,
    summary,
    volume_of,
    write_report,
)
from turnscan.workflows._surface._saving import save

POINT = np.dtype(
    [
        ("x", "f8"), ("y", "f8"), ("z", "f8"), ("sigma", "f8"),
        ("laser", "i4"), ("step", "i4"), ("row", "i4"),
    ]
)  # fmt: skip
"""A measured point: mm, its standard uncertainty (mm), and the pixel row it comes from."""


@dataclass(frozen=True, eq=False)
class ReconstructResult:
    """The surface of a part, the points it was made from, and what there is to know about both.

    >>> import turnscan as ts
    >>> part = ts.reconstruct("cup.turnscan", ts.ReconstructOptions(close=True))
    >>> part.mesh.faces.shape[1], part.points.dtype.names
    (3, ('x', 'y', 'z', 'sigma', 'laser', 'step', 'row'))
    """

    reconstruction: Reconstruction
    """All that the pipeline made."""
    about: Mapping[str, object]
    """Where it comes from: version, source, rig, parameters, edits; embedded in files."""
    rig: Rig | None = None
    """The rig that measured it; None for range scans of other scanners and for joined poses."""
    tables: Sequence[ReportTable] = ()
    """Tables of the report that concern this result alone."""
    options: ReconstructOptions = field(default_factory=ReconstructOptions)
    """What it was made with."""
    notes: tuple[Finding, ...] = ()
    """What there is to know about its making, not about the surface."""

    @property
    def mesh(self) -> Mesh:
        """The surface, mm, in the object's frame."""
        return self.reconstruction.mesh

    @property
    def grids(self) -> tuple[RangeGrid, ...]:
        """The points as they were measured: one grid for each laser and turn."""
        return self.reconstruction.grids

    @property
    def made_from(self) -> Source:
        """Grids, rig and common causes: what the uncertainty of what is measured on it hangs on."""
        return made_from(self.reconstruction, self.rig)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found about scan, points and surface."""
        return (*self.reconstruction.findings, *self.notes)

    @property
    def edits(self) -> tuple[edit.Entry, ...]:
        """The repairs by hand that were done."""
        return self.reconstruction.edits

    @property
    def holes(self) -> list[Hole]:
        """The gaps of the surface as it was measured and edited, each with its cause."""
        return self.reconstruction.holes

    @property
    def failed(self) -> bool:
        """Whether an error is among the findings; such a result is not saved."""
        return any(f.severity == "error" for f in self.findings)

    @cached_property
    def points(self) -> npt.NDArray[Any]:
        """(n,) structured array ``x y z sigma laser step row`` of all points of the grids.

        ``laser`` counts the `grids`; ``sigma`` is NaN where it is not known.
        """
        loose = cloud(self.grids)
        out = np.empty(len(loose.points), POINT)
        for k, name in enumerate("xyz"):
            out[name] = loose.points[:, k]
        out["sigma"], out["laser"] = loose.sigma, loose.laser
        out["step"], out["row"] = loose.step, loose.line
        return out

    def __str__(self) -> str:
        return "\n".join(self.summary())

    def _repr_html_(self) -> str:
        rows: list[tuple[str, object]] = [("", line) for line in self.summary()]
        rows += [("", finding) for finding in self.findings if finding.severity != "note"]
        drawn = image(self.mesh.show(size=(320, 240)).pixels) if len(self.mesh.faces) else ""
        return card(f"Surface of {self.about['source']}", rows, drawn)

    def figures(self) -> dict[str, Any]:
        """The result in numbers: points, faces, size, volume with its uncertainty."""
        return figures(self.reconstruction, self.rig)

    def summary(self) -> list[str]:
        """The same in words, one line each."""
        return summary(self.reconstruction, self.rig)

    def volume(self) -> dict[str, float]:
        """What is known of the volume, mm³, measured and filled; empty where it is open."""
        return known(volume_of(self.reconstruction, self.rig))

    def sections(
        self,
        *planes: str,
        x: float | Sequence[float] = (),
        y: float | Sequence[float] = (),
        z: float | Sequence[float] = (),
        half_planes_deg: Sequence[float] = (),
        tolerance: float | None = None,
    ) -> Sections:
        """Cut the surface with planes, and fit lines, arcs and splines to each section.

        Parameters
        ----------
        planes
            As texts: ``z=20``, ``z=10:100:10`` (from, to, step), ``nx,ny,nz,distance``, mm.
        x, y, z
            Planes at right angles to an axis, mm: one place or several.
        half_planes_deg
            Half-planes from the rotation axis at these angles.
        tolerance
            mm that a misfit may be; None: what the noise of the points allows.

        Returns
        -------
        Sections
            To be saved as drawings. A cut that misses the part is one of their ``findings``.

        Raises
        ------
        InputError
            Where nothing is asked for, or no cut meets the part.

        >>> import turnscan as ts
        >>> part = ts.reconstruct("cup.turnscan")
        >>> part.sections(z=[10.0, 20.0]).save("cup.dxf")
        """
        along = {"x": x, "y": y, "z": z}
        texts = [
            f"{axis}={float(at)!r}"
            for axis, places in along.items()
            for at in ([places] if isinstance(places, int | float) else places)
        ]
        cuts = cuts_of([*planes, *texts], half_planes_deg)
        title = str(self.about["source"])
        return sections_of(self.mesh, cuts, tolerance, title, {**self.about, **self.volume()})

    def save(
        self,
        *paths: str | PathLike[str],
        options: ExportOptions | None = None,
        progress: Progress = no_progress,
    ) -> list[Finding]:
        """Write the surface to files, whose suffixes name the formats.

        Each file is read back and compared first; nothing is written unless all are sound.

        Parameters
        ----------
        paths
            Files to write: .dxf .stl .ply .obj .3mf .glb .xyz, and .step (or .stp): a solid or
            shell of the part's shapes and of B-splines.
        options
            Choices about the formats; None takes the usual ones.
        progress
            Told how far the files are; it may cancel.

        Returns
        -------
        list of Finding
            Remarks of the comparison, like what a format cannot hold.

        Raises
        ------
        InputError
            Where a format is unknown, and for STEP where OpenCASCADE is not installed.
        ExportError
            Where the result has an error among its findings, a file cannot be written, or does not
            read back the same.

        >>> import turnscan as ts
        >>> ts.reconstruct("cup.turnscan").save("cup.dxf")
        []
        """
        error = next((f for f in self.findings if f.severity == "error"), None)
        if error is not None:
            raise ExportError(f"nothing was written: {error.message}", hint=error.remedy)
        formats, profiles = self.content(options or ExportOptions())
        files = dict.fromkeys(map(Path, paths), self.mesh)
        return save(files, formats, profiles, progress, made_from=self.made_from)

    def content(self, options: ExportOptions) -> tuple[ExportOptions, Profiles | None]:
        """What goes into files besides the mesh: provenance, and profiles where they are asked for.

        Parameters
        ----------
        options
            Choices about the formats.

        Returns
        -------
        tuple of ExportOptions and Profiles
            The options with the provenance, and the profiles; None where nobody asks for them.

        Raises
        ------
        ValueError
            Where a profile holds what is no number.

        >>> import turnscan as ts
        >>> options, profiles = ts.reconstruct("cup.turnscan").content(ts.ExportOptions())
        >>> options.about["source"], profiles
        ('cup.turnscan', None)
        """
        lines: dict[str, tuple[Any, ...]] = {}
        if "profiles" in options.dxf_forms:
            for grid in self.reconstruction.spaced:
                runs = [p.points for step in profiles(grid) for p in step]
                lines[grid.laser] = (*lines.get(grid.laser, ()), *runs)
        described = replace(options, about={**self.about, **self.volume()})
        return described, Profiles(lines) if lines else None

    def save_report(self, path: str | PathLike[str]) -> None:
        """Write the report.

        Parameters
        ----------
        path
            The file: .html with pictures, or .json.

        Raises
        ------
        ExportError
            Where it cannot be written.

        >>> import turnscan as ts
        >>> ts.reconstruct("cup.turnscan").save_report("cup.json")
        """
        write_report(Path(path), self.about, self.reconstruction, self.rig, self.tables)
