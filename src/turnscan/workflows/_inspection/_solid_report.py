"""The part of a report that tells of a solid: its faces, their deviations and their colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnscan.workflows._pages import _document as doc
from turnscan.workflows._solids._face_deviations import FaceDeviations
from turnscan.workflows._solids._shapes_step import StepFile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEWS = ((0.6, 0.45), (3.7, 0.45), (2.1, -0.6))
_MOST = 200
"""Rows of the table of faces; the JSON report has them all."""


def solid_blocks(made: StepFile) -> list[doc.Block]:
    """What there is to say of a STEP file."""
    out: list[doc.Block] = [doc.Heading("Solid")]
    out += [doc.Paragraph(f.message) for f in made.findings]
    off = made.deviations
    if off is None:
        return out
    faces = sorted(off.faces, key=lambda f: -f.points)
    rows: list[list[object]] = [
        [
            f.face,
            f.surface,
            f.points,
            *(f"{x:+.4f}" if f.points else "not measured" for x in (f.mean_mm, f.rms_mm)),
        ]
        for f in faces[:_MOST]
    ]
    rest = f" Those with the most points of {len(faces)}." if len(faces) > _MOST else ""
    return [
        *out,
        doc.Picture(
            _figure(off),
            "The faces as they are in the file, each in the colour of the mean deviation of its "
            f"measured points, positive outside.{rest}",
        ),
        doc.Table(["colour of a face", "mean deviation"], [list(row) for row in off.legend()]),
        doc.Table(["face", "surface", "points", "mean, mm", "rms, mm"], rows),
    ]


def _figure(off: FaceDeviations) -> Figure:
    """Three views of the faces in their colours."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.6), layout="constrained")
    mesh = off.painted()
    for axes, (azimuth, elevation) in zip(figure.subplots(1, 3), _VIEWS, strict=True):
        seen = mesh.show(azimuth=azimuth, elevation=elevation, size=(420, 400))
        axes.imshow(seen.pixels)
        axes.set_axis_off()
    return figure
