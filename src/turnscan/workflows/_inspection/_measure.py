"""Measure: planar faces and the angles between them, spheres, cylinders, volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.drawings import with_sigma
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, is_closed
from turnscan.progress import Progress, no_progress
from turnscan.shapes import (
    PlaneAngle,
    PlaneRegion,
    area,
    find_planes,
    fit_cylinder,
    fit_sphere,
    plane_angles,
    volume_figures,
    volume_in_words,
    volume_sigma,
)
from turnscan.shapes.primitives import fit_whole
from turnscan.workflows._inspection._dimension_report import dimension_table, write_dimensions
from turnscan.workflows._inspection._shapes import FoundShapes, find_shapes, in_words
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._measure import MeasureOptions
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._solids._shapes_table import Dimension
from turnscan.workflows._surface._loading import Source, load
from turnscan.workflows._surface._reconstruct import reconstruct
from turnscan.workflows._surface._report import ReportTable

_SAME = 1e-6
"""Relative: a volume that differs by more from what its file says is that of another mesh."""
_SQUARE = np.deg2rad(20.0)
"""Sides within this of square or parallel are compared with it."""


@dataclass(frozen=True)
class Measured:
    """What was measured, unrounded, with standard uncertainties."""

    figures: Mapping[str, Any]
    """By name, with the unit at its end: ``volume_mm3``, ``bounds_mm``, ``planes``, …"""
    findings: tuple[Finding, ...] = ()
    """Of the reconstruction, where a scan was measured; what a mesh does not know."""
    shapes: FoundShapes | None = None
    """What every size was found from, where they were asked for."""

    @property
    def tables(self) -> list[ReportTable]:
        """Every size; none where sizes were not asked for."""
        if self.shapes is None:
            return []
        return [dimension_table(self.dimensions)]

    def summary(self) -> list[str]:
        """Size, volume, area, and the shapes that were asked for, a line each."""
        return _lines(self.figures)

    def __str__(self) -> str:
        lines = self.summary()
        if self.shapes is not None and not self.shapes.found.shapes:
            return "\n".join([*lines, *in_words(self.shapes)])
        for d in self.shapes.dimensions if self.shapes else ():
            value = with_sigma(d.value, d.sigma)
            lines.append(f"{d.feature}: {d.quantity} {value} {d.unit}, {d.rests_on}")
        return "\n".join(lines)

    @property
    def dimensions(self) -> list[Dimension]:
        """Volume and sizes, each with its uncertainty; none where sizes were not asked for."""
        return [*_whole_part(self.figures), *(self.shapes.dimensions if self.shapes else ())]

    def save_report(self, path: str | Path, named: ReportTable | None = None) -> None:
        """Write the dimension report: .html or .pdf with a picture of each feature, .json or .csv.

        ``named`` are dimensions that a person took, which stand first. Raises InputError where
        sizes were not asked for, ExportError where it cannot be written.
        """
        if self.shapes is None:
            raise InputError("the sizes of the part were not measured", hint="measure its sizes")
        write_dimensions(
            self.shapes, _whole_part(self.figures), self.figures, self.findings, Path(path), named
        )


def measure(
    source: Source,
    options: MeasureOptions | None = None,
    *,
    progress: Progress = no_progress,
    **changes: Any,
) -> Measured:
    """Measure a surface: its volume, and every size or the shapes that the options ask for.

    Only what was measured is fitted, no vertex of a filling, as far as the source tells them apart;
    points weigh 1/sigma² where their sigma is known. Uncertainties follow from the points' sigma or
    scatter, more where neighbours or whole stripes are off together; of a scan, or the result of a
    reconstruction, also from what light and rig do to all points alike. A mesh does not know that,
    and says so.

    Parameters
    ----------
    source
        A mesh, a mesh file in mm, the result of `reconstruct`, or a scan, which is reconstructed
        with its own settings.
    options
        What to measure; None: every size, as far as shapes are found.
    progress
        Told how far the reconstruction of a scan is; it may cancel.
    changes
        Options to change by name, as in ``sphere=True``.

    Returns
    -------
    Measured
        The figures; as text, one line each.

    Raises
    ------
    InputError
        Where there are no points, or no faces to find planar faces on.

    >>> import turnscan as ts
    >>> found = ts.measure("cup.turnscan", cylinder=True)
    >>> 20 < found.figures["cylinder"]["radius_mm"] < 60
    True
    """
    wanted = chosen(MeasureOptions, options, changes)
    if isinstance(source, str | Path) and Path(source).suffix.lower() == ".turnscan":
        source = reconstruct(source, progress=progress)
    loaded = load(source, progress=progress)
    mesh = loaded.mesh
    if not len(mesh.vertices):
        raise InputError(f"{loaded.name}: no points", hint="give a file with a part in it")
    result = _whole(mesh, loaded.about)
    if wanted.planes:
        if not len(mesh.faces):
            raise InputError(f"{loaded.name}: no faces", hint="planar faces are found on a mesh")
        regions = find_planes(
            mesh, tolerance=wanted.tolerance, smallest=wanted.smallest, moves=loaded.moves
        )
        result["planes"] = [_plane(r) for r in regions]
        result["angles"] = [_angle(a) for a in plane_angles(regions)]
    if wanted.sphere:
        result["sphere"] = _sphere(loaded)
    if wanted.cylinder:
        result["cylinder"] = _cylinder(loaded)
    said = (*loaded.findings, *_noise_alone(loaded))
    if not wanted.every_size or not (wanted.sizes or len(mesh.faces)):
        return Measured(result, said)
    found = find_shapes(source)
    result["sizes"] = found.figures()["sizes"]
    return Measured(result, said, found)


def _noise_alone(loaded: Loaded) -> list[Finding]:
    """What is to be said of a scanned surface that does not know what it was made from."""
    p = loaded.mesh.provenance
    if loaded.source is not None or p is None or not (p.sigma > 0).any():
        return []
    text = (
        "a mesh knows the noise of its vertices, not what light and rig move alike: "
        "uncertainties of sizes may be half of what they are from the scan"
    )
    remedy = "measure the scan (.turnscan) that it was made of"
    return [Finding("measure.noise-alone", "note", text, loaded.name, remedy)]


def _whole_part(figures: Mapping[str, Any]) -> list[Dimension]:
    rests = f"{figures['faces']} faces"
    out = []
    for kind, unit in (("area", "mm²"), ("volume", "mm³")):
        key = unit.replace("²", "2").replace("³", "3")
        value, sigma = figures.get(f"{kind}_{key}"), figures.get(f"{kind}_sigma_{key}")
        if value is not None:
            known = float("nan") if sigma is None else float(sigma)
            out.append(Dimension("the whole part", kind, float(value), known, unit, rests))
    return out


def _whole(mesh: Mesh, about: Mapping[str, object]) -> dict[str, Any]:
    closed = is_closed(mesh)
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "bounds_mm": mesh.bounds.tolist(),
        "closed": closed,
        **_area(mesh),
        **(_volume(mesh, about) if closed else {"volume_mm3": None, "volume_sigma_mm3": None}),
    }


def _area(mesh: Mesh) -> dict[str, float | None]:
    if not len(mesh.faces):
        return {"area_mm2": None, "area_sigma_mm2": None, "area_unmeasured": None}
    found, filled = area(mesh), 0.0
    if mesh.measured is not None:
        filled = mesh.area_of(~mesh.measured) / max(mesh.area_of(), 1e-12)
    return {
        "area_mm2": found.value,
        "area_unmeasured": filled,
        "area_sigma_mm2": None if np.isnan(found.sigma) else found.sigma,
    }


def _volume(mesh: Mesh, about: Mapping[str, object]) -> dict[str, float | None]:
    """The volume of a closed mesh; where its file holds what was known when it was made, that."""
    figures = volume_figures(mesh.volume, volume_sigma(mesh))
    said = {k: v for k in figures if isinstance(v := about.get(k), float | int)}
    whole = said.get("volume_mm3")
    if whole is None or not np.isclose(whole, mesh.volume, rtol=_SAME, atol=0):
        return figures
    return {**dict.fromkeys(figures), **said, "volume_mm3": mesh.volume}


def _plane(r: PlaneRegion) -> dict[str, Any]:
    p = r.plane
    return {
        "area_mm2": r.area,
        "points": p.count,
        "rms_mm": p.rms,
        "normal": p.normal.tolist(),
        "normal_sigma_deg": float(np.rad2deg(p.normal_sigma)),
        "distance_mm": p.distance,
        "centre_mm": p.centre.tolist(),
    }


def _angle(a: PlaneAngle) -> dict[str, Any]:
    relation, off = "oblique", None
    if a.off_square < _SQUARE:
        relation, off = "adjacent", a.off_square
    elif a.off_parallel < _SQUARE:
        relation, off = "opposite" if a.angle > np.pi / 2 else "alike", a.off_parallel
    return {
        "sides": [a.first + 1, a.second + 1],
        "angle_deg": float(np.rad2deg(a.angle)),
        "sigma_deg": float(np.rad2deg(a.sigma)),
        "relation": relation,
        "off_deg": None if off is None else float(np.rad2deg(off)),
    }


def _sphere(of: Loaded) -> dict[str, Any]:
    s = fit_whole(fit_sphere, of.mesh, of.moves)
    sigma = np.sqrt(np.diag(s.covariance))
    return {
        "points": s.count,
        "centre_mm": s.centre.tolist(),
        "centre_sigma_mm": sigma[:3].tolist(),
        "radius_mm": s.radius,
        "radius_sigma_mm": float(sigma[3]),
        "rms_mm": s.rms,
    }


def _cylinder(of: Loaded) -> dict[str, Any]:
    c = fit_whole(fit_cylinder, of.mesh, of.moves)
    sigma = np.sqrt(np.diag(c.covariance))
    return {
        "points": c.count,
        "point_mm": c.point.tolist(),
        "axis": c.axis.tolist(),
        "axis_sigma_deg": float(np.rad2deg(max(sigma[:2]))),
        "radius_mm": c.radius,
        "radius_sigma_mm": float(sigma[4]),
        "rms_mm": c.rms,
    }


def _lines(r: Mapping[str, Any]) -> list[str]:
    low, high = r["bounds_mm"]
    size = " × ".join(f"{b - a:.3f}" for a, b in zip(low, high, strict=True))
    volume = f"volume {volume_in_words(r)}" if r["closed"] else "not closed, so no volume"
    lines = [f"{r['vertices']} vertices, {r['faces']} faces, {size} mm, {volume}"]
    if r["area_mm2"] is not None:
        known = "" if r["area_sigma_mm2"] is None else f" ± {r['area_sigma_mm2']:.3g}"
        share = r["area_unmeasured"]
        filled = f", {share:.1%} of it not measured" if share else ""
        lines.append(f"area {r['area_mm2']:.1f}{known} mm²{filled}")
    for number, p in enumerate(r.get("planes", ()), start=1):
        normal = ", ".join(f"{x:+.4f}" for x in p["normal"])
        lines.append(
            f"planar face {number}: area {p['area_mm2']:.1f} mm², rms {p['rms_mm']:.4f} mm over "
            f"{p['points']} points, normal ({normal}) ± {p['normal_sigma_deg']:.4f}°"
        )
    for a in r.get("angles", ()):
        first, second = a["sides"]
        goal = {"adjacent": "square", "opposite": "parallel", "alike": "parallel"}
        off = "" if a["off_deg"] is None else f", {a['off_deg']:.3f}° off {goal[a['relation']]}"
        lines.append(
            f"planar faces {first} and {second}: {a['angle_deg']:.3f}° ± {a['sigma_deg']:.3f}°, "
            f"{a['relation']}{off}"
        )
    if "sphere" in r:
        s = r["sphere"]
        centre = ", ".join(f"{x:.4f}" for x in s["centre_mm"])
        lines.append(
            f"sphere: radius {s['radius_mm']:.4f} ± {s['radius_sigma_mm']:.4f} mm, centre "
            f"({centre}) mm, rms {s['rms_mm']:.4f} mm over {s['points']} measured points"
        )
    if "cylinder" in r:
        c = r["cylinder"]
        axis = ", ".join(f"{x:+.5f}" for x in c["axis"])
        lines.append(
            f"cylinder: radius {c['radius_mm']:.4f} ± {c['radius_sigma_mm']:.4f} mm, axis "
            f"({axis}) ± {c['axis_sigma_deg']:.4f}°, rms {c['rms_mm']:.4f} mm over "
            f"{c['points']} measured points"
        )
    return lines
