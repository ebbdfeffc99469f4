"""The report of a calibration: what was found, how well, and what was not used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Image
from turnscan.calibrate import Advice, Calibration, CalibrationQuality, parameters_of
from turnscan.findings import Finding
from turnscan.scan import read_picture
from turnscan.workflows._pages import _html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_THUMB = 320
_ARROW = 100.0


def report_html(
    c: Calibration,
    f: CalibrationQuality,
    advice: Advice,
    findings: Sequence[Finding],
    pictures: Mapping[tuple[str, str], Path],
) -> str:
    """The report as one HTML page; ``pictures``: where they lie, by role and name."""
    parts = [
        _html.table(("", ""), _summary(c, f)),
        _html.heading("Findings"),
        _html.findings(findings),
        _html.heading("What is still open"),
        _html.paragraph(f"Undetermined: {', '.join(advice.undetermined) or 'nothing'}."),
        _html.paragraph(f"What would help most: {advice.text}."),
    ]
    if c.network.boards:
        parts += [
            _html.heading("Camera"),
            _html.picture(_corners(c), "Residuals of the board corners, 100 times enlarged."),
            _html.picture(_per_view(c), "Residual of every board view; then those of the table."),
        ]
    if f.sheet_views:
        parts += [
            _html.heading("Laser sheets"),
            _html.picture(_stripes(c), "Residuals of the stripes along the picture."),
        ]
    if c.angles is not None:
        parts += [
            _html.heading("Table"),
            _html.picture(_angles(c), "Angle of each picture, compared with uniform motion."),
            _html.table(("marker", "side"), _sides(f)),
        ]
    parts += [
        _html.heading("Uncertainty of what is measured (k = 2)"),
        _html.paragraph(
            "What the calibration adds to a single measured point, by first-order propagation of "
            "the joint covariance of camera, sheets and table."
        ),
        _html.table(
            ("radius / height", "of the radius", "of the height"),
            [
                (f"{k} mm", f"{u:.3f} mm", f"{f.height_k2_mm[k]:.3f} mm")
                for k, u in f.radius_k2_mm.items()
            ],
        ),
        _html.heading("Parameters"),
        _html.table(("parameter", "value", "standard uncertainty"), parameters_of(c)),
        _html.heading("Pictures not used"),
        _html.table(("role", "picture", "why"), [(r.role, r.name, r.reason) for r in c.rejected]),
        *(
            _html.picture(_thumbnail(pictures[r.role, r.name]), f"{r.name} ({r.role}): {r.reason}")
            for r in c.rejected
            if (r.role, r.name) in pictures
        ),
    ]
    return _html.page("Calibration report", parts)


def _summary(c: Calibration, f: CalibrationQuality) -> list[tuple[str, str]]:
    camera = c.rig.camera
    k = ", ".join(f"{x:.5g}" for x in camera.distortion)
    rows = [
        ("picture", f"{camera.width}×{camera.height} px"),
        ("focal lengths", f"{camera.fx:.2f}, {camera.fy:.2f} px"),
        ("principal point", f"{camera.cx:.2f}, {camera.cy:.2f} px"),
        ("distortion k1 k2 p1 p2 k3", k),
        *_views(c, f),
    ]
    for laser in c.network.lasers:
        if laser not in f.sheet_views:
            rows.append((f"sheet of {laser}", "as it was known before"))
            continue
        rows.append(
            (
                f"sheet of {laser}",
                f"{f.sheet_rms_mm[laser]:.3f} mm rms, {f.sheet_rms_px[laser]:.3f} px rms, "
                f"{f.sheet_views[laser]} stripes",
            )
        )
        if laser in f.sheet_offset_mm:
            rows.append((f"distance of the axis from {laser}", f.sheet_offset_mm[laser].text("mm")))
    if c.network.table:
        rows.append(("table corners", f"{f.table_rms_px:.3f} px, {len(c.network.table)} pictures"))
    if np.isfinite(f.platter_rms_mm):
        rows.append(("stripe on the platter", f"{f.platter_rms_mm:.3f} mm rms"))
    if f.marker_side_mm is not None:
        rows.append(("marker side", f.marker_side_mm.text("mm", 3)))
    if f.marker_centre_mm is not None:
        rows.append(("middle of the markers from axis", f.marker_centre_mm.text("mm")))
    return rows


def _sides(f: CalibrationQuality) -> list[tuple[int, str]]:
    return [(n, m.text("mm", 3)) for n, m in f.marker_sides_mm.items()]


def _views(c: Calibration, f: CalibrationQuality) -> list[tuple[str, str]]:
    """How many pictures of boards were used, by what they were given for."""
    if not c.network.boards:
        return [("camera", "as it was known before")]
    lit = sum(1 for stripes in c.network.board_stripes if stripes)
    used = f"{f.camera_views} views, {lit} of them with a stripe"
    return [
        ("board corners", f"{f.camera_rms_px:.3f} px rms, {used}"),
        ("picture covered by corners", f"{f.coverage:.0%}"),
    ]


def _figure(width: float = 8, height: float = 4) -> Figure:
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(width, height), layout="constrained")


def _corners(c: Calibration) -> Figure:
    camera = c.rig.camera
    fig = _figure(8, 8 * camera.height / camera.width)
    ax = fig.add_subplot()
    for i, view in enumerate(c.network.boards):
        residual = _residual(c, "board corners", i).reshape(-1, 2) * _ARROW
        ax.quiver(*view.corners.T, *residual.T, angles="xy", scale_units="xy", scale=1, width=0.001)
    ax.set(xlim=(0, camera.width), ylim=(camera.height, 0), xlabel="u (px)", ylabel="v (px)")
    ax.set_aspect("equal")
    return fig


def _residual(c: Calibration, kind: str, view: int) -> np.ndarray:
    parts = [b.residual for b in c.fit.blocks if b.view == view and b.kind == kind]
    return np.concatenate(parts) if parts else np.zeros(0)


def _per_view(c: Calibration) -> Figure:
    fig = _figure(8, 3)
    ax = fig.add_subplot()
    for kind in c.fit.scales:
        points = [(b.view, np.sqrt(np.mean(b.residual**2))) for b in c.fit.blocks if b.kind == kind]
        ax.plot(*np.array(points).T, ".", label=kind)
    ax.set(xlabel="view", ylabel="rms (px)", ylim=(0, None))
    ax.legend(fontsize="small")
    return fig


def _stripes(c: Calibration) -> Figure:
    fig = _figure(8, 4)
    ax = fig.add_subplot()
    seen: dict[str, list[np.ndarray]] = {"boards": [], "table": []}
    groups = [*c.network.board_stripes, *(v.stripes for v in c.network.table)]
    for i, group in enumerate(groups):
        kind = "boards" if i < len(c.network.boards) else "table"
        for stripe in group:
            place = stripe.pixels @ stripe.direction[::-1]
            residual = _residual(c, f"stripe on {kind} [{stripe.laser}]", i)
            seen[kind].append(np.stack([place, residual], axis=1))
    for kind, parts in seen.items():
        if parts:
            ax.plot(*np.concatenate(parts).T, ".", markersize=2, label=kind, alpha=0.5)
    ax.set(xlabel="row or column (px)", ylabel="residual (px)")
    ax.legend(fontsize="small")
    return fig


def _angles(c: Calibration) -> Figure:
    assert c.angles is not None
    fig = _figure(8, 3)
    ax = fig.add_subplot()
    ax.errorbar(
        np.degrees(c.angles.angles),
        np.degrees(c.angles.deviation),
        np.degrees(c.angles.sigmas),
        fmt=".-",
        linewidth=0.5,
        markersize=3,
    )
    ax.set(xlabel="table angle (°)", ylabel="deviation from uniform motion (°)")
    return fig


def _thumbnail(path: Path) -> Image:
    picture = read_picture(path)
    step = max(1, picture.shape[1] // _THUMB)
    small = picture[::step, ::step]
    return (small // 257).astype(np.uint8) if small.dtype == np.uint16 else small
