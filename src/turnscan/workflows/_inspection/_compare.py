"""Compare: how far a measured surface lies from a reference, and how much of it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import Ints
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, sample_surface, submesh, vector_areas
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.rig import Pose
from turnscan.shapes import Deviation, deviation
from turnscan.workflows._files._kept_options import OWN_SETTINGS, named_options
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._inspection._compared_features import (
    Agreement,
    Check,
    Feature,
    check_figures,
    checks_of,
    features_of,
    matched,
    overall,
    profiles_of,
    unmet,
)
from turnscan.workflows._inspection._shapes import FoundShapes, find_shapes
from turnscan.workflows._inspection._tolerances import Tolerance, Verdict, read_tolerances
from turnscan.workflows._options._check_tolerance import check_tolerance
from turnscan.workflows._options._compare import MAP_SUFFIXES, CompareOptions
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._surface._aligning import Placement, adrift, labels_of, placed_by
from turnscan.workflows._surface._loading import Source, load
from turnscan.workflows._surface._nominal import Nominal, nominal, with_features
from turnscan.workflows._surface._reconstruct import reconstruct
from turnscan.workflows._surface._report import ReportTable
from turnscan.workflows._surface._result import ReconstructResult
from turnscan.workflows._surface._saving import save

_GAP = 0.2
"""mm: surfaces further apart are not of one place."""


@dataclass(frozen=True)
class Areas:
    """How much of two surfaces lies where the other one has nothing, mm²."""

    measured: float
    """Of the measured surface."""
    reference: float
    won: float
    """Of the measured surface, off the reference."""
    lost: float
    """Of the reference, off the measured surface."""
    gap: float
    """mm: what is further than this from the other surface, or off its end, is off it."""

    def __str__(self) -> str:
        return (
            f"area {self.measured / 100:.2f} cm² against {self.reference / 100:.2f} cm²: "
            f"{self.won / 100:.2f} cm² won, {self.lost / 100:.2f} cm² lost "
            f"(off the other surface by more than {self.gap:g} mm)"
        )


@dataclass(frozen=True, eq=False)
class Comparison:
    """How a measured surface lies to its reference."""

    mesh: Mesh
    """The measured surface in the frame of the reference, without faces that were not measured."""
    every: Deviation
    """Of every vertex of it, mm, positive outside of the reference."""
    deviation: Deviation
    """The same without vertices off the end of an open reference."""
    agreements: tuple[Agreement, ...]
    """One for each tolerance."""
    findings: tuple[Finding, ...]
    """Of the reconstruction, where a scan was compared, and of the comparison."""
    placement: Placement
    """How the surface was brought into that frame."""
    names: tuple[str, str]
    """Of the measured surface and of the reference."""
    drawn: Mesh
    """The reference."""
    features: tuple[Feature, ...] = ()
    """Those of the reference that were measured, where they were asked for."""
    checks: tuple[Check, ...] = ()
    """Sizes and profiles against nominal values and tolerances."""
    areas: Areas | None = None
    """What two settings of scans make of their areas; None where no settings were chosen."""

    @property
    def verdict(self) -> Verdict:
        """Whether all tolerances of the table are kept; empty without a table."""
        return overall(self.checks, self.findings)

    def figures(self) -> dict[str, Any]:
        """The figures, unrounded, by name with the unit at its end."""
        d = self.deviation
        out: dict[str, Any] = {
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
            "alignment": {
                "by": self.placement.way,
                "rotation": self.placement.pose.rotation.tolist(),
                "translation_mm": self.placement.pose.translation.tolist(),
                **self.placement.figures,
            },
        }
        if self.areas is not None:
            out["areas"] = {
                "measured_mm2": self.areas.measured,
                "reference_mm2": self.areas.reference,
                "won_mm2": self.areas.won,
                "lost_mm2": self.areas.lost,
                "gap_mm": self.areas.gap,
            }
        if self.features:
            out["features"] = [
                {
                    "number": f.number,
                    "nominal": f.nominal,
                    "points": f.points,
                    "mean_mm": f.mean,
                    "rms_mm": f.rms,
                    "p95_mm": f.p95,
                }
                for f in self.features
            ]
            out["checks"] = [check_figures(c) for c in self.checks]
            out["verdict"] = self.verdict or None
        return out

    @property
    def tables(self) -> list[ReportTable]:
        """How the surfaces agree, and features and sizes where they were asked for."""
        from turnscan.workflows._inspection._compared_report import compared_tables

        return compared_tables(self)

    def summary(self) -> list[str]:
        """How they were aligned, how they agree, and whether tolerances are kept, a line each."""
        d = self.deviation
        lines = [
            self.placement.text,
            f"{len(d.distance)} measured vertices against the reference: mean {d.mean:+.4f} mm, "
            f"rms {d.rms:.4f} mm, 95 % within {d.quantile(0.95):.4f} mm, "
            f"worst {d.quantile(1.0):.4f} mm",
        ]
        lines += [
            f"within {a.tolerance:g} mm: precision {a.precision:.2%}, completeness "
            f"{a.completeness:.2%}, F-score {a.f_score:.4f}"
            for a in self.agreements
        ]
        lines += [] if self.areas is None else [str(self.areas)]
        return [*lines, *([f"tolerances: {self.verdict}"] if self.verdict else [])]

    def __str__(self) -> str:
        features = [
            f"{f.number}: {f.nominal}: mean {f.mean:+.4f} mm, rms {f.rms:.4f} mm over {f.points} "
            "points"
            for f in self.features
        ]
        lines = self.summary()
        end = len(lines) - bool(self.verdict)
        return "\n".join([*lines[:end], *features, *map(str, self.checks), *lines[end:]])

    def coloured(self, limit: float | None = None) -> Mesh:
        """The measured surface coloured by its deviation; ``limit`` ends the scale, in mm."""
        from turnscan.workflows._solids._deviation_map import deviation_colours

        return replace(self.mesh, colour=deviation_colours(self.every, limit))

    def save_picture(self, path: str | Path, limit: float | None = None) -> None:
        """Write the deviation as a colour map (PNG); ``limit`` ends its scale, in mm.

        Raises ExportError where it cannot be written.
        """
        from turnscan.workflows._pages._html import png
        from turnscan.workflows._solids._deviation_map import deviation_figure

        figure = deviation_figure(self.mesh, self.every, limit)
        write_atomically(Path(path), png(figure))

    def save_map(self, *paths: str | Path, limit: float | None = None) -> list[Finding]:
        """Write the measured surface coloured by its deviation (.ply or .glb).

        ``limit`` ends the scale, in mm. Raises InputError for another suffix, ExportError where a
        file cannot be written.
        """
        for path in map(Path, paths):
            if path.suffix.lower() not in MAP_SUFFIXES:
                raise InputError(
                    f"{path}: a map is not written as {path.suffix!r}",
                    hint=f"choose one of {' '.join(MAP_SUFFIXES)}",
                )
        return save(dict.fromkeys(map(Path, paths), self.coloured(limit))) if paths else []

    def save_report(self, path: str | Path, limit: float | None = None) -> None:
        """Write the report: .html with pictures, .json, or the sizes as .csv.

        ``limit`` ends the scale of the map, in mm. Raises ExportError where it cannot be written.
        """
        from turnscan.workflows._inspection._compared_report import write_report

        write_report(self, Path(path), limit)


def compare(
    measured: Source,
    reference: Source,
    options: CompareOptions | None = None,
    *,
    tolerance_table: str | PathLike[str] | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> Comparison:
    """How far a measured surface lies from a reference, and how much of it was measured.

    Faces marked as not measured do not count, nor do vertices off the end of an open reference.
    Without ``align`` both are taken to be in one frame. With ``settings`` and
    ``reference_settings`` one scan is compared with itself as two settings make it.

    Parameters
    ----------
    measured, reference
        Meshes, mesh files, STEP files, results of `reconstruct`, or scans, which are reconstructed
        with their own settings.
    options
        Alignment, tolerances, samples and units of mesh files; None takes the usual ones.
    tolerance_table
        A table of tolerances (CSV), one row ``feature,quantity,tolerance`` each; the features are
        those of the reference by number.
    progress
        Told how far the reconstruction of a scan is; it may cancel.
    changes
        Options to change by name, as in ``align="shape"``.

    Returns
    -------
    Comparison
        Deviations, figures and a colour map; as text, one line each.

    Raises
    ------
    InputError
        Where there is no surface, it belongs nowhere on the reference, and for an option that
        cannot be.

    >>> import turnscan as ts
    >>> found = ts.compare("cup.turnscan", "cup.turnscan")
    >>> found.deviation.rms < 1e-6, found.agreements[0].precision
    (True, 1.0)
    """
    wanted = chosen(CompareOptions, options, changes)
    _check_datums(wanted)
    rows = () if tolerance_table is None else read_tolerances(Path(tolerance_table))
    measured = _with_settings(measured, "settings", wanted, progress.subrange(0, 0.5))
    if wanted.reference_settings != OWN_SETTINGS:
        later = progress.subrange(0.5, 0.7)
        reference = _with_settings(reference, "reference_settings", wanted, later)
    got = load(measured, wanted.unit, progress.subrange(0, 0.5))
    drawn = nominal(reference, wanted.reference_unit, progress.subrange(0.5, 0.7))
    table = wanted.features or bool(rows) or wanted.align == "datums"
    if table:
        drawn = _answering(with_features(drawn), rows)
    mesh = got.mesh if got.mesh.measured is None else submesh(got.mesh, got.mesh.measured)
    _check_area(mesh, got.name)
    _check_area(drawn.mesh, drawn.name)
    for tolerance in wanted.tolerances:
        check_tolerance(tolerance, drawn.mesh, "tolerances")
    placement = placed_by(wanted.align, mesh, got.name, drawn, wanted.datums)
    mesh = _moved(mesh, placement.pose)
    every = deviation(mesh.vertices, drawn.mesh)
    out = every.covered()
    back = deviation(sample_surface(drawn.mesh, wanted.samples)[0], mesh)
    agreements = tuple(Agreement(t, out.within(t), back.within(t)) for t in wanted.tolerances)
    names = (got.name, drawn.name)
    findings = (*got.findings, *drawn.findings, *placement.findings)
    plain = Comparison(mesh, every, out, agreements, findings, placement, names, drawn.mesh)
    if (wanted.settings, wanted.reference_settings) != (OWN_SETTINGS, OWN_SETTINGS):
        plain = replace(plain, areas=areas_of(plain, max(wanted.tolerances, default=_GAP)))
    if not table:
        return plain
    source = measured if isinstance(measured, ReconstructResult) else got.mesh
    # What is held against a tolerance must not have been made parallel, square or equal before.
    found = find_shapes(source, as_measured=True)
    return _by_feature(plain, drawn, measured_labels(got.mesh, found), found, rows)


def _with_settings(
    source: Source, option: str, wanted: CompareOptions, progress: Progress
) -> Source:
    """A scan file as the settings make it that an option names; anything else as it is.

    Raises InputError where settings are named and there is no scan file.
    """
    name: str = getattr(wanted, option)
    if isinstance(source, str | PathLike) and Path(source).suffix.lower() == ".turnscan":
        return reconstruct(source, named_options(source, name), progress=progress)
    if name != OWN_SETTINGS:
        raise InputError("settings are of scans", hint="compare a scan", option=Option(option))
    return source


def areas_of(found: Comparison, gap: float) -> Areas:
    """How much of both surfaces the other one lacks; ``gap`` in mm, see `Areas`."""
    missing = deviation(found.drawn.vertices, found.mesh)
    return Areas(
        found.mesh.area_of(),
        found.drawn.area_of(),
        _area_off(found.mesh, found.every, gap),
        _area_off(found.drawn, missing, gap),
        gap,
    )


def _area_off(mesh: Mesh, off: Deviation, gap: float) -> float:
    """mm² of a fine mesh whose vertices are off another surface; a third of a face for each."""
    area = np.linalg.norm(vector_areas(mesh.triangles), axis=1)
    out = off.beyond | (np.abs(off.distance) > gap)
    return float((area * out[mesh.faces].mean(axis=1)).sum())


def _check_datums(wanted: CompareOptions) -> None:
    if wanted.datums and wanted.align != "datums":
        raise InputError(
            "datums are given, but not used",
            hint=Remedy("align by ", Option("align", "datums")),
            option=Option("datums"),
        )


def _answering(drawn: Nominal, rows: Sequence[Tolerance]) -> Nominal:
    """The reference itself; raises InputError where it lacks features that a table speaks of."""
    count = len(drawn.shapes)
    if rows and not count:
        raise InputError(
            f"{drawn.name}: no planes, cylinders or spheres to hold tolerances against",
            hint="give the part as STEP",
            option=Option("tolerance_table"),
        )
    for row in rows:
        if any(number > count for number in row.features):
            who = "-".join(map(str, row.features))
            raise InputError(
                f"{who},{row.quantity},{row.text}: {drawn.name} has features 1 to {count}",
                hint=Remedy("correct the row; they are listed by ", Option("features", True)),
                option=Option("tolerance_table"),
            )
    return drawn


def _check_area(mesh: Mesh, name: str) -> None:
    if not mesh.area_of() > 0:
        raise InputError(
            f"{name}: no measured face that has an area",
            hint="give a mesh with measured faces, not a cloud of points",
        )


def _moved(mesh: Mesh, pose: Pose) -> Mesh:
    return replace(mesh, vertices=pose.apply(mesh.vertices))


def measured_labels(mesh: Mesh, found: FoundShapes) -> Ints:
    """(n,) the shape of each vertex of the measured faces."""
    label: Ints = found.found.label
    if mesh.measured is None:
        return label
    used = np.zeros(len(mesh.vertices), dtype=np.bool_)
    used[mesh.faces[mesh.measured]] = True
    return label[used]


def _adrift_told(loose: Sequence[int]) -> Finding:
    who = ", ".join(str(k + 1) for k in loose)
    text = f"features {who} lie across a motion that the shape does not determine: how far points"
    text += " are from them is chance; sizes are not touched"
    remedy = "scan, in another pose, what would hold the part there"
    return Finding("compare.adrift", "warning", text, remedy=remedy)


def _by_feature(
    plain: Comparison, drawn: Nominal, own: Ints, found: FoundShapes, rows: Sequence[Tolerance]
) -> Comparison:
    """The comparison with a table of the reference's features, and their sizes."""
    label = labels_of(drawn, plain.every.face, plain.every.beyond)
    loose = adrift(drawn, plain.placement.loose)
    match = matched(drawn, label, found.found, own)
    checks = [
        *checks_of(drawn, found.sizes, match, rows),
        *profiles_of(drawn, label, plain.mesh.vertices, plain.every, rows, loose),
    ]
    told = [] if not loose else [_adrift_told(sorted(loose))]
    return replace(
        plain,
        features=features_of(drawn, label, plain.every),
        checks=tuple(checks),
        findings=(*plain.findings, *told, *unmet(drawn, checks, rows, loose)),
    )
