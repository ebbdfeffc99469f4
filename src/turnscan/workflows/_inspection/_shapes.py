"""Shapes: the planes, cylinders, spheres, cones and tori of a part, with sizes and relations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnscan.drawings import with_sigma
from turnscan.errors import ExportError, InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.shapes.primitives import (
    Edge,
    FormError,
    Relation,
    Shape,
    ShapeSet,
    ShapeSize,
    Sharpened,
    find_edges,
    form_errors,
    orientation_errors,
    sharpened,
    sizes_between,
)
from turnscan.shapes.primitives import find_shapes as find_in_mesh
from turnscan.shapes.swept import Swept, find_swept
from turnscan.shapes.walls import Walls, wall_thickness
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._inspection._solid_report import solid_blocks
from turnscan.workflows._options._check_tolerance import check_tolerance
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._shapes import SHAPES_SUFFIXES, ShapesOptions
from turnscan.workflows._options._units import is_iges, is_step
from turnscan.workflows._pages import _document as doc
from turnscan.workflows._pages._colours import DISTINCT, GREY
from turnscan.workflows._solids._deviation_map import VIEWS, distance_figure
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._solids._shapes_step import StepFile, iges_of, step_of
from turnscan.workflows._solids._shapes_table import (
    Dimension,
    dimensions,
    dimensions_csv,
    form_in_words,
    walls_in_words,
)
from turnscan.workflows._surface._loading import Source
from turnscan.workflows._surface._measured_surface import measured_surface
from turnscan.workflows._surface._saving import save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class FoundShapes:
    """The shapes of a part, what was found about them, and where they lie on its mesh."""

    surface: Loaded
    """What they were found on."""
    found: ShapeSet
    sizes: tuple[ShapeSize, ...]
    edges: tuple[Edge, ...] = ()
    """Where neighbouring shapes meet."""
    with_edges: bool = False
    """Whether the mesh that is saved has the true edges."""

    @property
    def name(self) -> str:
        """How messages call the part."""
        return self.surface.name

    @property
    def mesh(self) -> Mesh:
        """The surface they were found on."""
        return self.surface.mesh

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What there is to know about the surface."""
        return self.surface.findings

    # A solid needs none of the following, and each costs about as much as finding the shapes.
    @cached_property
    def forms(self) -> tuple[FormError, ...]:
        """How flat or round the shapes are, how parallel or square to each other, and their
        run-out."""
        every = form_errors(self.mesh, self.found), orientation_errors(self.mesh, self.found)
        return tuple(chain(*every))

    @cached_property
    def walls(self) -> Walls | None:
        """How thick the material is, where both of its sides were measured."""
        return wall_thickness(self.mesh, self.surface.moves)

    @cached_property
    def swept(self) -> tuple[Swept, ...]:
        """Freeform pieces with one profile all along: surfaces of revolution, and extrusions."""
        return find_swept(self.mesh, self.found, self.surface.moves)

    def figures(self) -> dict[str, Any]:
        """Shapes, relations and sizes, unrounded, by name with the unit at its end."""
        f = self.found
        return {
            "source": Path(self.name).name,
            "tolerance_mm": f.tolerance,
            "coverage": f.coverage,
            "shapes": [
                {"number": k + 1, **_figures(s), "as_measured": _figures(m)}
                for k, (s, m) in enumerate(zip(f.shapes, f.measured, strict=True))
            ],
            "swept": [_swept(s) for s in self.swept],
            "relations": [_relation(r) for r in f.relations],
            "sizes": [_size(s, f) for s in self.sizes],
            "edges": [_edge(e) for e in self.edges],
            "forms": [_form(f) for f in self.forms],
            "walls": None if self.walls is None else _walls(self.walls),
        }

    def __str__(self) -> str:
        return "\n".join(in_words(self))

    @property
    def dimensions(self) -> list[Dimension]:
        """The dimension table: sizes, forms, fillets and chamfers, each with its uncertainty."""
        return dimensions(self.found, self.sizes, self.forms, self.edges, self.walls)

    @cached_property
    def sharpened(self) -> Sharpened:
        """The mesh with its sharp edges where the shapes meet; the rest as measured."""
        return sharpened(self.mesh, self.found, self.edges)

    def coloured(self) -> Mesh:
        """The mesh with a colour for each shape, grey where it is freeform or not measured."""
        sharp = self.sharpened if self.with_edges else None
        mesh, label = (sharp.mesh, sharp.label) if sharp else (self.mesh, self.found.label)
        colour = np.full((len(mesh.vertices), 3), GREY, dtype=np.uint8)
        on = label >= 0
        colour[on] = np.array(DISTINCT, dtype=np.uint8)[label[on] % len(DISTINCT)]
        return replace(mesh, colour=colour)

    @cached_property
    def step(self) -> StepFile:
        """The part as STEP AP242: a solid or shell of its shapes and of B-splines.

        Raises InputError where OpenCASCADE is not installed, ExportError where the file does not
        read back the same.
        """
        return self._step(no_progress)

    def _step(self, progress: Progress) -> StepFile:
        about = {"source": Path(self.name).name, **self.surface.about}
        surface = replace(self.surface, about=about)
        return step_of(surface, self.found, lambda: self.swept, progress)

    def save(self, *paths: str | Path, progress: Progress = no_progress) -> list[Finding]:
        """Write the coloured mesh (.ply or .glb) or a solid (.step, .stp, .igs or .iges).

        Raises InputError for another suffix, and for a solid where OpenCASCADE is not installed;
        ExportError where a file cannot be written, and for IGES where not all of it has a surface;
        Cancelled where ``progress``, told how far a solid is, says so.
        """
        for path in map(Path, paths):
            if path.suffix.lower() not in SHAPES_SUFFIXES:
                raise InputError(
                    f"{path}: shapes are not written as {path.suffix!r}",
                    hint=f"choose one of {' '.join(SHAPES_SUFFIXES)}",
                )
        solids = [path for path in map(Path, paths) if is_step(path) or is_iges(path)]
        if solids and _made(self) is None:
            vars(self)["step"] = self._step(progress)
        made = {path: self._solid(path) for path in solids}
        remarks = list(self.step.findings) if made else []
        rest = [path for path in map(Path, paths) if path not in made]
        if rest and self.with_edges:
            remarks.append(_constructed(self.sharpened))
        remarks += save(dict.fromkeys(rest, self.coloured()))
        for path, data in made.items():
            write_atomically(path, data)
        return remarks

    def _solid(self, path: Path) -> bytes:
        """The part as STEP or IGES; the latter has no triangles, and so needs faces for all."""
        if is_step(path):
            return self.step.data
        if self.step.made is None or self.step.made.rest is not None:
            raise ExportError(
                f"{path}: IGES holds no triangles: {self.step.findings[-1].message}",
                hint="write a .step, which can hold them",
            )
        return iges_of(self.step.made, Path(self.name).stem or "part")

    def save_report(self, path: str | Path) -> None:
        """Write the report: .html with pictures, .json, or the dimension table as .csv.

        Raises ExportError where it cannot be written.
        """
        _write_report(self, Path(path))


def find_shapes(
    source: Source,
    options: ShapesOptions | None = None,
    *,
    progress: Progress = no_progress,
    **changes: Any,
) -> FoundShapes:
    """Find the planes, spheres, cylinders, cones and tori that a part is made of.

    Only measured points are fitted. A shape is reported where its misfit is noise; the rest stays
    freeform. Relations (parallel, perpendicular, coaxial, equal radius, symmetric,
    patterns of holes) are adopted
    where the measured shapes agree with them inside their uncertainty, and each is reported.

    Parameters
    ----------
    source
        A mesh, a mesh file in mm, the result of `reconstruct`, or a scan, which is reconstructed
        with its own settings; for the last two the calibration's uncertainty counts too.
    options
        How shapes are looked for; None takes the usual way.
    progress
        Told how far the reconstruction of a scan is; it may cancel.
    changes
        Options to change by name, as in ``tolerance=0.05``.

    Returns
    -------
    FoundShapes
        Shapes, relations and sizes with standard uncertainties; as text, one line each.

    Raises
    ------
    InputError
        Where there is no surface, or no face that was measured, and for a tolerance of more than a
        tenth of the part.

    >>> import turnscan as ts
    >>> found = ts.find_shapes("cup.turnscan")
    >>> 0 <= found.found.coverage <= 1
    True
    """
    wanted = chosen(ShapesOptions, options, changes)
    loaded = measured_surface(source, "shapes are found on a mesh", progress)
    check_tolerance(wanted.tolerance, loaded.mesh)
    found = find_in_mesh(
        loaded.mesh,
        tolerance=wanted.tolerance,
        smallest=wanted.smallest,
        relations=not wanted.as_measured,
        moves=loaded.moves,
    )
    sizes = tuple(sizes_between(loaded.mesh, found))
    return FoundShapes(loaded, found, sizes, find_edges(loaded.mesh, found), wanted.edges)


def _figures(s: Shape) -> dict[str, Any]:
    sigma = np.sqrt(np.maximum(np.diagonal(s.covariance), 0.0))
    out: dict[str, Any] = {
        "kind": s.kind,
        "hollow": s.hollow,
        "points": s.count,
        "area_mm2": s.area,
        "rms_mm": s.rms,
        "point_mm": s.point.tolist(),
        "point_sigma_mm": float(sigma[2:5].max()),
    }
    if s.kind != "sphere":
        out["normal" if s.kind == "plane" else "axis"] = s.axis.tolist()
        out["axis_sigma_deg"] = float(np.rad2deg(s.axis_sigma))
    if s.kind != "plane":
        out["radius_mm"], out["radius_sigma_mm"] = s.radius, s.radius_sigma
    if s.kind == "cone":
        out["half_angle_deg"] = float(np.rad2deg(s.second))
        out["half_angle_sigma_deg"] = float(np.rad2deg(s.second_sigma))
    if s.kind == "torus":
        out["tube_radius_mm"], out["tube_radius_sigma_mm"] = s.second, s.second_sigma
    if s.length:
        out["length_mm"] = s.length
    return out


def _swept(s: Swept) -> dict[str, Any]:
    out: dict[str, Any] = {
        "kind": s.kind,
        "points": s.count,
        "area_mm2": s.area,
        "rms_mm": s.rms,
        "point_mm": s.point.tolist(),
        "axis": s.axis.tolist(),
        "axis_sigma_deg": float(np.rad2deg(s.axis_sigma)),
        "length_mm": s.length,
    }
    return out if s.kind == "extrusion" else {**out, "axis_shift_sigma_mm": s.shift_sigma}


def _relation(r: Relation) -> dict[str, Any]:
    out: dict[str, Any] = {"kind": r.kind, "shapes": [k + 1 for k in r.shapes]}
    if r.kind in ("parallel", "perpendicular"):
        out["off_deg"] = float(np.rad2deg(r.off))
        out["sigma_deg"] = float(np.rad2deg(r.sigma))
    else:
        out["off_mm"], out["sigma_mm"] = r.off, r.sigma
    if r.sizes:
        out["sizes"] = [{"kind": n, "value_mm": v, "sigma_mm": u} for n, v, u in r.sizes]
    return out


def _size(s: ShapeSize, found: ShapeSet) -> dict[str, Any]:
    second = [] if s.second is None else [s.second + 1]
    named = s.named(found)
    out: dict[str, Any] = {
        "kind": s.kind,
        **({} if named == s.kind else {"name": named}),
        "shapes": [s.first + 1, *second],
    }
    if s.kind in ("angle", "cone angle"):
        out["value_deg"] = float(np.rad2deg(s.value))
        out["sigma_deg"] = float(np.rad2deg(s.sigma))
    else:
        out["value_mm"], out["sigma_mm"] = s.value, s.sigma
    return out


def _edge(e: Edge) -> dict[str, Any]:
    out: dict[str, Any] = {
        "shapes": [e.first + 1, e.second + 1],
        "form": e.form,
        "convex": e.convex,
        "angle_deg": float(np.rad2deg(e.angle)),
        "points": e.points,
    }
    if e.form == "sharp":
        return {**out, "radius_below_mm": e.sigma}
    what = "radius" if e.form == "fillet" else "leg"
    blend = {} if e.blend is None else {"shape": e.blend + 1}
    return {**out, **blend, f"{what}_mm": e.size, f"{what}_sigma_mm": e.sigma}


def _form(f: FormError) -> dict[str, Any]:
    return {
        "kind": f.kind,
        "shapes": [f.shape + 1],
        **({} if f.datum is None else {"datum": f.datum + 1}),
        "value_mm": f.value,
        "sigma_mm": f.sigma,
        "noise_alone_mm": f.noise,
        "cells": f.cells,
        "cell_mm": f.side,
    }


def _walls(w: Walls) -> dict[str, Any]:
    return {
        "least_mm": w.least,
        "least_sigma_mm": w.least_sigma,
        "least_at_mm": w.where.tolist(),
        "noise_alone_mm": w.noise,
        "median_mm": w.median,
        "median_sigma_mm": w.median_sigma,
        "places": w.places,
        "share": w.share,
    }


def _constructed(sharp: Sharpened) -> Finding:
    """What was put into a mesh for its true edges."""
    left = f"; {sharp.left} vertices stay as measured, faces would fold over" if sharp.left else ""
    return Finding(
        "shapes.edges",
        "note",
        f"{int(sharp.on_edge.sum())} vertices lie on true edges, "
        f"{int((sharp.constructed & ~sharp.on_edge).sum())} beside them on their shape; they count "
        f"as constructed, not as measured{left}",
    )


def in_words(found: FoundShapes) -> list[str]:
    """What was found, one line for each shape, relation and size."""
    f = found.found
    if not f.shapes:
        return [
            f"{Path(found.name).name}: freeform: no shape within {f.tolerance:.3g} mm over enough "
            "of the surface",
            *map(swept_in_words, found.swept),
            *([walls_in_words(found.walls)] if found.walls else []),
        ]
    lines = [
        f"{Path(found.name).name}: {len(f.shapes)} shapes on {f.coverage:.1%} of the measured "
        f"surface, tolerance {f.tolerance:.3g} mm; the rest is freeform"
    ]
    lines += [f"{k + 1}: {shape_in_words(s)}" for k, s in enumerate(f.shapes)]
    lines += [swept_in_words(s) for s in found.swept]
    lines += [relation_in_words(r) for r in f.relations]
    lines += [size_in_words(s, f) for s in found.sizes]
    lines += [walls_in_words(found.walls)] if found.walls else []
    lines += [form_in_words(e) for e in found.forms]
    lines += [edge_in_words(e) for e in found.edges]
    return lines


def shape_in_words(s: Shape) -> str:
    """A shape in a line."""
    tail = f"rms {s.rms:.4f} mm over {s.count} points, {s.area:.1f} mm²"
    if s.kind == "plane":
        return f"plane, normal {_way_in_words(s)}, {tail}"
    hole = "hollow " if s.hollow else ""
    if s.kind == "sphere":
        middle = ", ".join(f"{x:.4f}" for x in s.point)
        return (f"{hole}sphere ⌀ {with_sigma(2 * s.radius, 2 * s.radius_sigma)} mm about "
                f"({middle}) mm, {tail}")  # fmt: skip
    along = f"axis {_way_in_words(s)}"
    if s.kind == "cylinder":
        return (f"{hole}cylinder ⌀ {with_sigma(2 * s.radius, 2 * s.radius_sigma)} mm, "
                f"{s.length:.3f} mm of it, {along}, {tail}")  # fmt: skip
    if s.kind == "cone":
        angle = with_sigma(2 * abs(np.rad2deg(s.second)), 2 * np.rad2deg(s.second_sigma))
        return f"{hole}cone of {angle}°, {s.length:.3f} mm of it, {along}, {tail}"
    return (f"{hole}torus, ring ⌀ {with_sigma(2 * s.radius, 2 * s.radius_sigma)} mm, tube ⌀ "
            f"{with_sigma(2 * s.second, 2 * s.second_sigma)} mm, {along}, {tail}")  # fmt: skip


def swept_in_words(s: Swept) -> str:
    """A piece of freeform surface with one profile, in a line."""
    tail = f"{s.length:.3f} mm of it, rms {s.rms:.4f} mm over {s.count} points, {s.area:.1f} mm²"
    if s.kind == "extrusion":
        return f"freeform: extrusion along {_way_in_words(s)}, {tail}"
    at = ", ".join(f"{x:.4f}" for x in s.point)
    return (
        f"freeform: surface of revolution, axis {_way_in_words(s)} through ({at}) ± "
        f"{s.shift_sigma:.2g} mm, {tail}; its profile is drawn by revolve"
    )


def _way_in_words(s: Shape | Swept) -> str:
    """Its normal or axis with the standard uncertainty, both to that one's second digit."""
    sigma = float(s.axis_sigma)
    if not (np.isfinite(sigma) and sigma > 0):
        return "(" + ", ".join(f"{x:+.5f}" for x in s.axis) + ")"
    places, digits = (
        int(np.clip(1 - np.floor(np.log10(x)), 0, 12)) for x in (sigma, np.rad2deg(sigma))
    )
    way = ", ".join(f"{x:+.{max(places, 3)}f}" for x in s.axis)
    return f"({way}) ± {np.rad2deg(sigma):.{digits}f}°"


def relation_in_words(r: Relation) -> str:
    """A relation in a line: what was adopted, and how far off it was measured."""
    own = [str(k + 1) for k in (r.shapes[:2] if r.kind == "symmetric" else r.shapes)]
    about = f" about the axis of {r.shapes[2] + 1}" if r.kind == "symmetric" else ""
    sizes = "".join(f", {name} {with_sigma(v, u)} mm" for name, v, u in r.sizes)
    who = f"{', '.join(own[:-1])} and {own[-1]}: {r.kind}{about}{sizes}"
    if r.sigma == 0:
        return f"{who} (the others imply it)"
    if r.kind in ("parallel", "perpendicular"):
        off = f"{with_sigma(np.rad2deg(r.off), np.rad2deg(r.sigma))}°"
    else:
        off = f"{with_sigma(r.off, r.sigma)} mm"
    return f"{who} (measured {off} off)"


def size_in_words(s: ShapeSize, found: ShapeSet) -> str:
    """A size in a line."""
    who = f"{s.first + 1}" if s.second is None else f"{s.first + 1} and {s.second + 1}"
    if s.kind in ("angle", "cone angle"):
        return f"{who}: {s.kind} {with_sigma(np.rad2deg(s.value), np.rad2deg(s.sigma))}°"
    return f"{who}: {s.named(found)} {with_sigma(s.value, s.sigma)} mm"


def edge_in_words(e: Edge) -> str:
    """An edge in a line."""
    way = "" if e.convex else "inner "
    who = f"{e.first + 1} and {e.second + 1}: {way}"
    between = f"between normals {np.rad2deg(e.angle):.2f}° apart"
    if e.form == "sharp":
        return f"{who}edge {between}, sharp or of a radius below {e.sigma:.2g} mm"
    what = "fillet of radius" if e.form == "fillet" else "chamfer of legs of"
    own = "" if e.blend is None else f" (shape {e.blend + 1})"
    return f"{who}{what} {with_sigma(e.size, e.sigma)} mm {between}{own}"


def _write_report(found: FoundShapes, path: Path) -> None:
    doc.write_report(
        path,
        f"Shapes of {Path(found.name).name}",
        lambda: _blocks(found),
        lambda: dimensions_csv(found.dimensions),
        lambda: {**found.figures(), **_step(found)},
        found.findings,
    )


def _blocks(found: FoundShapes) -> list[doc.Block]:
    f, made = found.found, _made(found)
    solid = solid_blocks(made) if made else []
    return [
        doc.Paragraph(
            f"{len(f.shapes)} shapes lie under {f.coverage:.1%} of the measured surface; a point "
            f"may be {f.tolerance:.3g} mm off its shape. ± is one standard uncertainty."
        ),
        doc.Picture(shapes_figure(found), "The part by shape; grey is freeform or not measured."),
        doc.Heading("Shapes"),
        doc.Table(
            ["", "shape, relations adopted", "on its own"],
            [
                [k + 1, shape_in_words(s), shape_in_words(m)]
                for k, (s, m) in enumerate(zip(f.shapes, f.measured, strict=True))
            ],
        ),
        *(doc.Paragraph(swept_in_words(s)) for s in found.swept),
        *solid,
        doc.Heading("Relations adopted"),
        doc.Table(["shapes and relation"], [[relation_in_words(r)] for r in f.relations]),
        doc.Heading("Dimensions"),
        doc.Table(
            ["feature", "quantity", "value ± standard uncertainty", "", "rests on"],
            [
                [d.feature, d.quantity, with_sigma(d.value, d.sigma), d.unit, d.rests_on]
                for d in found.dimensions
            ],
        ),
        doc.Heading("Edges"),
        doc.Table(["shapes and edge"], [[edge_in_words(e)] for e in found.edges]),
        doc.Heading("Residuals"),
        doc.Picture(
            residual_figure(found),
            "How far measured points lie off their shapes, outside positive.",
        ),
        doc.Heading("Findings"),
        doc.Findings(found.findings),
    ]


def _made(found: FoundShapes) -> StepFile | None:
    """The STEP file, where one was asked for."""
    made: StepFile | None = vars(found).get("step")
    return made


def _step(found: FoundShapes) -> dict[str, Any]:
    made = _made(found)
    return {} if made is None else {"step": made.figures}


def shapes_figure(found: FoundShapes) -> Figure:
    """Two views of the part, each shape in its colour."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    mesh = found.coloured()
    for axes, azimuth in zip(figure.subplots(1, 2), VIEWS, strict=True):
        axes.imshow(mesh.show(azimuth=azimuth, size=(520, 440)).pixels)
        axes.set_axis_off()
    return figure


def residual_figure(found: FoundShapes) -> Figure:
    """Two views coloured by residual, and the histogram of all of them."""
    top = max(found.found.tolerance, 1e-6)
    return distance_figure(found.mesh, found.found.residual, top, "residual")
