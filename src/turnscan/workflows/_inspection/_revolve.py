"""Turned parts: the axis, how round the wall is, its profile, a half-section and a solid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.drawings import (
    draw_section,
    found,
    read_step,
    revolved_solid,
    section_report,
    with_sigma,
    write_step,
)
from turnscan.errors import ExportError, InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Arc, FittedSection, Line, deviation, fit_outlines
from turnscan.shapes.revolved import (
    Cylindricity,
    Roundness,
    Thread,
    Turned,
    axis_counted,
    cylindricities,
    roundness,
    thread,
    turned_about,
    wall_profile,
)
from turnscan.workflows._files._writing import check_apart, check_output, write_atomically
from turnscan.workflows._options._check_tolerance import check_tolerance
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._revolve import REVOLVE_SUFFIXES, RevolveOptions
from turnscan.workflows._options._units import is_step
from turnscan.workflows._pages import _document as doc
from turnscan.workflows._pages._colours import DEVIATION
from turnscan.workflows._solids._sections import section_file
from turnscan.workflows._solids._shapes_table import COVERAGE, Dimension, dimensions_csv, finite
from turnscan.workflows._surface._loading import Source
from turnscan.workflows._surface._measured_surface import measured_surface

_HEIGHTS = 10
_UPRIGHT = float(np.deg2rad(1.0))
"""Between a wall and the axis, up to which it has a diameter and not an angle."""
_MOSTLY = 0.9
"""Share of the points on the surface of revolution below which it is said."""
_PLACES = 5
"""Places of the profile that a piece needs before its size is stated: shorter pieces are edges."""
_EXACT = 1e-6
_FACETS = 0.1
"""Of the points' scatter: how far facets are off the solid that points are compared with."""
_OFF = 4.0
"""Tolerances of the profile that the points may be off its solid, rms; more is warned of."""
_SURE = 4.0
"""Standard deviations by which a form must be more than noise alone gives, to be shown."""


@dataclass(frozen=True, eq=False)
class RevolvedPart:
    """A turned part: its axis, roundness and profile; as text, a line each."""

    name: str
    turned: Turned
    section: FittedSection
    """The profile of the wall: x is the distance from the axis, y the place along it."""
    rounds: tuple[Roundness, ...]
    cylinders: tuple[Cylindricity, ...]
    threads: tuple[Thread, ...]
    options: RevolveOptions
    about: Mapping[str, object] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    @property
    def foot(self) -> float:
        """mm along the axis from its point: the lowest measured point, where heights begin."""
        return float(self.turned.z.min())

    def figures(self) -> dict[str, Any]:
        """Everything, unrounded, by name with the unit at its end."""
        t, axis = self.turned, self.turned.axis
        return {
            "source": Path(self.name).name,
            "axis": {
                "point_mm": (axis.point + self.foot * axis.direction).tolist(),
                "direction": axis.direction.tolist(),
                "tilt_sigma_deg": float(np.rad2deg(axis.tilt_sigma)),
                "shift_sigma_mm": axis.shift_sigma,
            },
            "on_surface": t.share,
            "off_surface_rms_mm": t.sigma,
            "roundness": [self._risen(r) for r in self.rounds],
            "cylindricity": [self._risen(c) for c in self.cylinders],
            "threads": [self._risen(s) for s in self.threads],
            "dimensions": [
                {**asdict(d), "value": finite(d.value), "sigma": finite(d.sigma)}
                for d in self.dimensions
            ],
            "profile": section_report([self.section], self.about),
        }

    def _risen(self, what: Roundness | Cylindricity | Thread) -> dict[str, Any]:
        """Its fields, heights above the foot."""
        body = asdict(what)
        for key in ("height", "low", "high"):
            if key in body:
                body[key] = body[key] - self.foot
        return {k: v if isinstance(v, bool | int) else finite(v) for k, v in body.items()}

    def __str__(self) -> str:
        return "\n".join(_in_words(self))

    @property
    def dimensions(self) -> list[Dimension]:
        """Sizes of the profile, then roundness and cylindricity, each with its uncertainty."""
        return [*_of_profile(self), *_of_rounds(self)]

    @cached_property
    def step(self) -> tuple[bytes, Finding]:
        """The revolved solid as STEP AP242, read back, and what there is to say of it.

        Raises InputError where OpenCASCADE is not installed, ExportError where the profile does not
        close to a sound solid.
        """
        axis = self.turned.axis
        solid, added = revolved_solid(self.section.fitted, axis.point, axis.basis)
        about = {"source": Path(self.name).name, **self.about}
        data = write_step(solid, Path(self.name).stem or "part", about)
        t = self.turned
        facets = max(
            _FACETS * t.sigma, 1e-5 * float(np.linalg.norm(np.ptp(t.mesh.vertices, axis=0)))
        )
        part = read_step(data, facets)
        if part.solids != 1 or not part.valid or abs(part.volume / solid.volume - 1) > _EXACT:
            raise ExportError("the STEP does not read back the same", hint="write a .dxf")
        if 2 * part.volume < t.sigma * part.mesh.area_of():
            raise ExportError(
                "the profile cannot be revolved to a solid: it encloses nothing, for it ends at "
                "the height where it begins",
                hint="measure more of the wall, or write the profile as .dxf",
            )
        own = t.mesh.vertices[t.on] @ axis.basis + axis.point
        off = deviation(own, part.mesh)
        closing = f"; {added} straight lines of its profile were not measured" if added else ""
        far = off.rms > _OFF * max(t.sigma, self.section.fitted[0].tolerance)
        return data, Finding(
            "revolve.solid", "warning" if far else "note",
            f"a valid solid of {solid.faces} faces, {solid.volume:.1f} mm³{closing}; measured "
            f"points lie {off.rms:.4f} mm (rms) off it, 95 % of them within "
            f"{off.quantile(0.95):.4f} mm",
        )  # fmt: skip

    def save(self, *paths: str | Path) -> list[Finding]:
        """Write the half-section (.dxf, .svg, .pdf, .json) or the revolved solid (.step, .stp).

        Raises InputError for another suffix, and for STEP where OpenCASCADE is not installed;
        ExportError where a profile does not close to a solid or a file cannot be written.
        """
        targets = [Path(p) for p in paths]
        check_apart(targets)
        for path in targets:
            check_output(path, REVOLVE_SUFFIXES)
        title, version = Path(self.name).name, self.options.dxf_version
        ready = {
            p: self.step[0]
            if is_step(p)
            else section_file([self.section], p.suffix, title, self.about, version)
            for p in targets
        }
        for path, data in ready.items():
            write_atomically(path, data)
        return [self.step[1]] if any(map(is_step, targets)) else []

    def save_report(self, path: str | Path) -> None:
        """Write the report: .html or .pdf with pictures, .json, or the dimensions as .csv.

        Raises ExportError where it cannot be written.
        """
        doc.write_report(
            Path(path),
            f"{Path(self.name).name}, revolved",
            lambda: _blocks(self),
            lambda: dimensions_csv(self.dimensions),
            self.figures,
            self.findings,
        )


def revolve(
    source: Source,
    options: RevolveOptions | None = None,
    *,
    progress: Progress = no_progress,
    **changes: Any,
) -> RevolvedPart:
    """Measure a turned part: best axis, run-out, roundness by height, cylindricity, wall profile.

    Only measured points count; what is not on the surface of revolution, such as a handle or a
    keyway, is left out and said.

    Parameters
    ----------
    source
        A mesh, a mesh file in mm, the result of `reconstruct`, or a scan, which is reconstructed
        with its own settings; for the last two the calibration's uncertainty counts too.
    options
        Heights, tolerance and DXF version; None takes the usual ones.
    progress
        Told how far the reconstruction of a scan is; it may cancel.
    changes
        Options to change by name, as in ``tolerance=0.05``.

    Returns
    -------
    RevolvedPart
        The axis, the profile, roundness, cylindricity and windings, with their uncertainties; it
        writes drawings, the revolved solid and reports.

    Raises
    ------
    InputError
        Where there is no measured face, where no axis or more than one fits the part, for a height
        that the part does not have, and for a tolerance of more than a tenth of it.

    >>> import turnscan as ts
    >>> part = ts.revolve("cup.turnscan")
    >>> part.section.cut.name
    'profile of the wall'
    """
    wanted = chosen(RevolveOptions, options, changes)
    loaded = measured_surface(source, "a turned part is measured on a mesh", progress)
    check_tolerance(wanted.tolerance, loaded.mesh)
    try:
        turned = turned_about(loaded.mesh, loaded.moves)
        cut, chains = wall_profile(turned)
    except InputError as e:
        raise InputError(f"{loaded.name}: {e.message}", hint=e.hint) from None
    fitted = fit_outlines(chains, wanted.tolerance)
    rows = [[axis_counted(o, turned) for o in row] for row in fitted]
    outlines = [o for row in rows for o in row]
    return RevolvedPart(
        loaded.name,
        turned,
        FittedSection(cut, chains, tuple(map(tuple, rows))),
        tuple(roundness(turned, _heights(turned, wanted.height))),
        tuple(cylindricities(turned, outlines)),
        tuple(thread(turned, outlines)),
        wanted,
        loaded.about,
        (*loaded.findings, *_remarks(turned)),
    )


def _heights(turned: Turned, wanted: tuple[float, ...]) -> list[float]:
    low, high = float(turned.z.min()), float(turned.z.max())
    for height in wanted:
        if not 0 <= height <= high - low:
            raise InputError(
                f"height {height:g} mm: the part reaches from 0 to {high - low:.3f} mm along its "
                "axis",
                hint="give a height on it",
            )
    if wanted:
        return [low + h for h in wanted]
    return list(np.linspace(low, high, 2 * _HEIGHTS + 1)[1::2])


def _remarks(turned: Turned) -> list[Finding]:
    if turned.share >= _MOSTLY:
        return []
    return [
        Finding(
            "revolve.partly", "warning",
            f"{1 - turned.share:.0%} of the measured points are not on the surface of revolution "
            "and are left out",
        )
    ]  # fmt: skip


def _in_words(part: RevolvedPart) -> list[str]:
    t, axis = part.turned, part.turned.axis
    at = ", ".join(f"{x:.4f}" for x in axis.point + part.foot * axis.direction)
    way = ", ".join(f"{x:+.6f}" for x in axis.direction)
    lines = [
        f"{Path(part.name).name}: axis ({way}) ± {np.rad2deg(axis.tilt_sigma):.4f}° through ({at}) "
        f"± {axis.shift_sigma:.4f} mm; {t.share:.1%} of the points lie on the surface of "
        f"revolution, {t.sigma:.4f} mm (rms) off it",
        f"profile of the wall: {found(part.section) or 'nothing fitted'}",
    ]
    return lines + [
        f"{d.feature}: {d.quantity} {with_sigma(d.value, d.sigma)} {d.unit}, {d.rests_on}"
        for d in part.dimensions
    ] + [
        f"{s.low - part.foot:.2f} to {s.high - part.foot:.2f} mm: a wave winds about the axis, "
        f"pitch {s.pitch:+.4f} mm, amplitude {with_sigma(s.amplitude, s.sigma)} mm"
        for s in part.threads
    ]  # fmt: skip


def _of_profile(part: RevolvedPart) -> list[Dimension]:
    out = []
    for outline in part.section.fitted:
        for p in outline.pieces:
            if p.rest.count < _PLACES:
                continue
            rests = f"{p.rest.count} places of the profile"
            if isinstance(p, Line) and not p.link:
                low, high = sorted((p.start[1] - part.foot, p.end[1] - part.foot))
                where = f"wall {low:.2f} to {high:.2f} mm"
                lean = float(np.rad2deg(np.arcsin(np.clip((p.end - p.start)[0] / p.length, -1, 1))))
                if abs(lean) < np.rad2deg(_UPRIGHT):
                    radius = float(p.start[0] + p.end[0]) / 2
                    out.append(Dimension(where, "diameter", 2 * radius, 2 * p.sigma, "mm", rests))
                elif abs(lean) < 89.0:
                    sigma = 2 * float(np.rad2deg(p.angle_sigma))
                    out.append(Dimension(where, "cone angle", 2 * abs(lean), sigma, "deg", rests))
            elif isinstance(p, Arc) and _bow(p) > part.turned.sigma:
                where = f"arc at {p.centre[1] - part.foot:.2f} mm"
                out.append(Dimension(where, "radius", p.radius, p.radius_sigma, "mm", rests))
            elif isinstance(p, Arc):
                out += _hidden_bow(part, p, rests)
    return out


def _hidden_bow(part: RevolvedPart, arc: Arc, rests: str) -> list[Dimension]:
    """The diameter of a wall whose bow noise would hide: the mean of it, known as far as it is."""
    way = arc.end - arc.start
    if abs(way[0]) > np.sin(_UPRIGHT) * np.hypot(*way):
        return []
    low, high = sorted((arc.start[1] - part.foot, arc.end[1] - part.foot))
    points = arc.sampled(1e-6)
    bow = _bow(arc)
    where = f"wall {low:.2f} to {high:.2f} mm"
    said = f"{rests}; it may be bowed by {bow:.2g} mm"
    return [Dimension(where, "diameter", 2 * float(points[:, 0].mean()), 2 * bow, "mm", said)]


def _bow(arc: Arc) -> float:
    """mm that the middle of an arc is off its chord; one that noise would hide has no radius."""
    return arc.radius * (1.0 - float(np.cos(min(abs(arc.sweep) / 2, np.pi))))


def _of_rounds(part: RevolvedPart) -> list[Dimension]:
    out = []
    for r in part.rounds:
        hole = ", inside" if r.hollow else ""
        where = f"height {r.height - part.foot:.2f} mm{hole}"
        rests = f"{r.cells} places on {r.covered:.0%} of the turn"
        noise = _noise(r.least_squares, r.noise, r.sigma)
        out += [
            Dimension(where, "diameter", 2 * r.radius, 2 * r.radius_sigma, "mm", rests),
            Dimension(where, "roundness, LSC", r.least_squares, r.sigma, "mm", noise),
            Dimension(where, "roundness, MZC", r.minimum_zone, r.sigma, "mm", noise),
            Dimension(where, "run-out", r.run_out, r.sigma, "mm", noise),
            Dimension(where, "eccentricity", r.eccentricity, r.eccentricity_sigma, "mm", rests),
        ]
    for c in part.cylinders:
        hole = ", inside" if c.hollow else ""
        where = f"wall {c.low - part.foot:.2f} to {c.high - part.foot:.2f} mm{hole}"
        noise = _noise(c.value, c.noise, c.sigma)
        out += [
            Dimension(where, "cylindricity", c.value, c.sigma, "mm", noise),
            Dimension(where, "total run-out", c.run_out, c.sigma, "mm", noise),
        ]
    return out


def _noise(value: float, noise: float, sigma: float) -> str:
    if not np.isfinite(noise):
        return "too few points to tell their noise, or an edge beside it, so none is shown"
    shown = "" if value > noise + _SURE * sigma else ", so none is shown"
    return f"noise alone gives {noise:.2g} mm{shown}"


def _blocks(part: RevolvedPart) -> list[doc.Block]:
    return [
        doc.Paragraph(_in_words(part)[0] + ". ± is one standard uncertainty."),
        doc.Picture(draw_section(part.section, Path(part.name).name), "Half-section."),
        doc.Picture(_map(part), "Off the mean profile by angle and height, outside positive."),
        doc.Heading("Dimensions"),
        doc.Table(
            ["where", "quantity", "value ± u", "", "U (k = 2)", "rests on"],
            [
                [d.feature, d.quantity, with_sigma(d.value, d.sigma), d.unit,
                 f"{COVERAGE * d.sigma:.2g}", d.rests_on]
                for d in part.dimensions
            ],
        ),
        doc.Heading("Findings"),
        doc.Findings(part.findings),
    ]  # fmt: skip


def _map(part: RevolvedPart) -> Any:
    """The deviation of every point, unrolled: angle and height."""
    from matplotlib.figure import Figure

    t = part.turned
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    axes = figure.add_subplot()
    top = 3 * max(t.sigma, 1e-9)
    some = np.flatnonzero(t.on)[:: max(1, int(t.on.sum()) // 60_000)]
    dots = axes.scatter(
        np.rad2deg(t.angle[some]), t.z[some] - part.foot, c=t.off[some], s=1, cmap=DEVIATION,
        vmin=-top, vmax=top, linewidths=0,
    )  # fmt: skip
    axes.set_xlabel("angle, °")
    axes.set_ylabel("height, mm")
    figure.colorbar(dots, label="mm")
    return figure
