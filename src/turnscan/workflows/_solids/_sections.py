"""Sections of a surface: from texts to cuts, fitted, as drawings and in words."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import overload

from turnscan.drawings import (
    found,
    with_sigma,
    write_section_dxf,
    write_section_json,
    write_section_pdf,
    write_section_svg,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.formats import DxfVersion
from turnscan.mesh import Mesh
from turnscan.remedy import Option, Remedy
from turnscan.shapes import (
    Arc,
    Cut,
    CutMisses,
    FittedSection,
    fit_section,
    half_plane_cut,
    plane_cut,
)
from turnscan.shapes.views import silhouette_cut, unrolled_cut
from turnscan.workflows._files._writing import check_apart, check_output, write_atomically
from turnscan.workflows._options._check_tolerance import check_tolerance
from turnscan.workflows._options._units import SECTION_SUFFIXES

_MOST = 100
_SIZE = re.compile(r'(?<=<svg )(.*?)width="[^"]*" height="[^"]*" ')
_FORM = "write z=20, z=10:100:10 (from, to, step) or nx,ny,nz,distance"


def cuts_of(
    planes: Iterable[str],
    half_planes_deg: Iterable[float] = (),
    silhouettes: Iterable[str] = (),
    unrolled: bool = False,
) -> list[Cut]:
    """Cuts from texts: ``z=20``, ``z=10:100:10`` (from, to, step), ``nx,ny,nz,distance`` in mm,
    ``silhouette=x`` and ``unrolled``.

    ``half_planes_deg`` are angles in degrees about the rotation axis, ``silhouettes`` directions
    as ``x``, ``-z`` or ``nx,ny,nz``; ``unrolled`` adds the unrolled surface. Raises InputError
    naming the text that is none of these, for more than 100 cuts, and for none at all.
    """
    cuts = [cut for text in planes for cut in _planes(text)]
    cuts += [half_plane_cut(math.radians(a), f"half-plane at {a:g}°") for a in half_planes_deg]
    cuts += [_silhouette(text, Option("silhouette", text)) for text in silhouettes]
    cuts += [unrolled_cut()] * unrolled
    if not cuts:
        raise InputError(
            "no section was asked for",
            hint=Remedy(
                "give ",
                Option("plane"),
                ", ",
                Option("half_plane_deg"),
                ", ",
                Option("silhouette"),
                " or ",
                Option("unrolled"),
            ),
        )
    if len(cuts) > _MOST:
        raise InputError(f"{len(cuts)} sections; at most {_MOST} go into one drawing",
                         hint="take a larger step")  # fmt: skip
    return cuts


def _silhouette(text: str, option: Option) -> Cut:
    word = text.strip()
    if word.lstrip("+-") in ("x", "y", "z") and len(word) <= 2:
        n = [(-1.0 if word[0] == "-" else 1.0) * (word[-1] == a) for a in "xyz"]
        return silhouette_cut(n, f"silhouette from {word}")
    try:
        n = [float(p) for p in word.split(",")]
        return silhouette_cut(n)
    except (ValueError, InputError):
        hint = "write x, -y, z or nx,ny,nz, three finite numbers that are not all 0"
        raise InputError("not a direction", hint=hint, option=option) from None


def _planes(text: str) -> list[Cut]:
    axis, equals, rest = text.strip().partition("=")
    if axis.strip() == "unrolled" and not equals:
        return [unrolled_cut()]
    if equals and axis.strip() == "silhouette":
        return [_silhouette(rest, Option("plane", text))]
    if equals and axis.strip() in ("x", "y", "z"):
        axis = axis.strip()
        normal = [float(axis == a) for a in "xyz"]
        values = _range(_floats(rest.split(":"), text), text)
        return [plane_cut(normal, v, f"{axis} = {v:.6g} mm") for v in values]
    numbers = _floats(text.split(","), text)
    if len(numbers) != 4:
        raise _no_plane(text)
    return [plane_cut(numbers[:3], numbers[3])]


def _floats(parts: Sequence[str], text: str) -> list[float]:
    try:
        numbers = [float(p) for p in parts]
    except ValueError:
        raise _no_plane(text) from None
    if not all(map(math.isfinite, numbers)):
        raise _no_plane(text, "a number in it is not finite")
    return numbers


def _no_plane(text: str, why: str = "not a plane") -> InputError:
    return InputError(why, hint=_FORM, option=Option("plane", text))


def _range(numbers: list[float], text: str) -> list[float]:
    if len(numbers) == 1:
        return numbers
    if len(numbers) != 3 or not numbers[2] > 0 or numbers[1] < numbers[0]:
        raise _no_plane(text)
    start, stop, step = numbers
    count = (stop - start) / step
    if count > _MOST:
        told = f"{count:.0f} sections; at most {_MOST} are drawn"
        raise InputError(told, hint="take a larger step", option=Option("plane", text))
    return [start + k * step for k in range(int(count + 1e-9) + 1)]


@dataclass(frozen=True, eq=False)
class Sections(Sequence[FittedSection]):
    """Cuts through a part, fitted with lines, arcs and splines; as text, a few lines each."""

    fitted: tuple[FittedSection, ...]
    title: str = ""
    """Stands on the drawings."""
    about: Mapping[str, object] = field(default_factory=dict)
    """Where the part comes from; embedded in files."""
    findings: tuple[Finding, ...] = ()
    """Cuts that miss the part, an error each: there is no section of them."""

    @overload
    def __getitem__(self, at: int) -> FittedSection: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[FittedSection, ...]: ...
    def __getitem__(self, at: int | slice) -> FittedSection | tuple[FittedSection, ...]:
        return self.fitted[at]

    def __len__(self) -> int:
        return len(self.fitted)

    def __iter__(self) -> Iterator[FittedSection]:
        return iter(self.fitted)

    def __str__(self) -> str:
        return "\n".join(line for s in self.fitted for line in section_in_words(s))

    def save(self, *paths: str | PathLike[str], version: DxfVersion = "R2010") -> None:
        """Write the drawings: .dxf, .svg, .pdf or .json, several sections side by side.

        Parameters
        ----------
        paths
            Files to write; nothing is written unless all can be.
        version
            Of a DXF; R12 has no splines, there they are polylines.

        Raises
        ------
        InputError
            For another suffix, and for one file named twice.
        ExportError
            Where a file cannot be written.
        """
        targets = [Path(p) for p in paths]
        check_apart(targets)
        for path in targets:
            check_output(path, SECTION_SUFFIXES)
        ready = {
            p: section_file(self.fitted, p.suffix, self.title, self.about, version) for p in targets
        }
        for path, data in ready.items():
            write_atomically(path, data)

    def _repr_html_(self) -> str:
        drawn = write_section_svg(self.fitted, self.title, self.about).decode()
        fitting = _SIZE.sub(r"\1", drawn, count=1)
        return f'<div style="width: 480px">{fitting}</div>'


def sections_of(
    mesh: Mesh,
    cuts: Sequence[Cut],
    tolerance: float | None,
    title: str,
    about: Mapping[str, object],
) -> Sections:
    """Cut a mesh and fit each section; the arguments are those of `turnscan.workflows.section`.

    A cut that misses the part is a finding, and the others are drawn. Raises InputError for a mesh
    without faces, where no cut meets it, and for a tolerance that is not positive, or more than a
    tenth of the part.
    """
    check_tolerance(tolerance, mesh)
    fitted, missed = list[FittedSection](), list[CutMisses]()
    try:
        for cut in cuts:
            try:
                fitted.append(fit_section(mesh, cut, tolerance))
            except CutMisses as e:
                missed.append(e)
        if missed and not fitted:
            raise missed[0]
    except InputError as e:
        raise InputError(f"{title}: {_every(missed)}{e.message}", hint=e.hint) from None
    findings = (Finding("section.misses", "error", e.message, title, e.hint) for e in missed)
    return Sections(tuple(fitted), title, about, tuple(findings))


def _every(missed: Sequence[CutMisses]) -> str:
    """That none of several cuts meets the part, before what is said of the first."""
    return f"none of {len(missed)} sections meets it: " if len(missed) > 1 else ""


def section_file(
    sections: Sequence[FittedSection],
    suffix: str,
    title: str,
    about: Mapping[str, object],
    version: DxfVersion = "R2010",
) -> bytes:
    """The sections as a file: ``.dxf``, ``.svg``, ``.pdf`` or ``.json``.

    ``title`` stands on the drawings, ``about`` says where they come from. Raises InputError for
    another suffix.
    """
    kind = suffix.lower()
    if kind == ".dxf":
        return write_section_dxf(sections, version, about)
    if kind == ".svg":
        return write_section_svg(sections, title, about)
    if kind == ".pdf":
        return write_section_pdf(sections, title)
    if kind == ".json":
        return write_section_json(sections, about)
    raise InputError(f"a section is not written as {suffix!r}",
                     hint=f"choose one of {' '.join(SECTION_SUFFIXES)}")  # fmt: skip


def section_in_words(section: FittedSection) -> list[str]:
    """What was found, in a line or two of text for each outline."""
    box, sigma = section.box, section.size_sigma
    width, height = box[1] - box[0]
    if section.relief is not None:
        return [f"{section.cut.name}: {found(section)}"]
    size = f"{with_sigma(width, sigma[0])} × {with_sigma(height, sigma[1])} mm"
    seen = section.cut.view == "silhouette"
    name = section.cut.name if seen else f"section {section.cut.name}"
    lines = [f"{name}: {size}; {found(section) or 'nothing fitted'}"]
    for outline in section.fitted:
        rest = [p.rest for p in outline.pieces]
        if isinstance(circle := outline.pieces[0], Arc) and circle.full:
            diameter = with_sigma(2 * circle.radius, 2 * circle.radius_sigma)
            lines.append(f"  circle ⌀ {diameter} mm, rms {rest[0].rms:.4f} mm")
            continue
        worst = max(r.worst for r in rest)
        ring = "closed" if outline.closed else "open"
        lines.append(
            f"  {ring} outline of {len(outline.pieces)}: tolerance {outline.tolerance:.3g} mm, "
            f"no point further off than {worst:.3g} mm"
        )
        for s in outline.sizes:
            if s.kind == "distance":
                lines.append(f"    parallel lines {with_sigma(s.value, s.sigma)} mm apart")
    if why := section.unstated:
        lines.append(f"  {why}")
    return lines
