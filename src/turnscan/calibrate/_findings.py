"""What a person should know about a calibration: each finding with its value and a remedy."""

from __future__ import annotations

from collections import Counter

import numpy as np

from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._observations import BEND, BOARD, RIDER
from turnscan.calibrate._quality import CalibrationQuality
from turnscan.calibrate._rig import Calibration
from turnscan.calibrate._words import parameter_in_words
from turnscan.findings import Finding
from turnscan.remedy import Option, Remedy
from turnscan.rig import Wobble

_SURE = 3.0  # standard deviations
_CORRELATED = 0.95
_FEW_VIEWS = 10
_LITTLE_COVERAGE = 0.6
_CAMERA_PX = 0.5
_SHEET_MM = 0.5
_TABLE_PX = 0.5
_NAMED = 3


def findings_of(c: Calibration, f: CalibrationQuality) -> tuple[Finding, ...]:
    """All findings of a calibration, the worst first."""
    found = [*_of_camera(c, f), *_of_lasers(c, f), *_of_table(c, f), *_of_fit(c)]
    if c.angles is not None:
        found += list(c.angles.findings)
    order = {"error": 0, "warning": 1, "note": 2}
    return tuple(sorted(found, key=lambda x: order[x.severity]))


def _of_camera(c: Calibration, f: CalibrationQuality) -> list[Finding]:
    if not c.network.boards:
        return []
    out = []
    if f.camera_rms_px > _CAMERA_PX:
        out.append(
            Finding(
                "calibrate.camera-residual",
                "warning",
                f"the board's corners are {f.camera_rms_px:.2f} px rms off; 0.3 px is usual",
                remedy="check for blurred pictures, a changed focus or another board size",
            )
        )
    given = "camera" in c.stages.given
    if given and f.camera_views < _FEW_VIEWS:
        out.append(
            Finding(
                "calibrate.few-views",
                "warning",
                f"only {f.camera_views} board views; 20 are recommended",
                remedy="add pictures of the board, tilted up to 45°",
            )
        )
    if given and f.coverage < _LITTLE_COVERAGE:
        out.append(
            Finding(
                "calibrate.coverage",
                "warning",
                f"corners fill {f.coverage:.0%} of the picture; elsewhere the lens distortion is "
                f"extrapolated",
                remedy="add pictures with the board in the uncovered parts of the image, above "
                "all its corners",
            )
        )
    trend = _residual_trend(c)
    if trend > 0.5:
        out.append(
            Finding(
                "calibrate.residual-trend",
                "note",
                f"the mean residual in parts of the picture reaches {trend:.2f} of their scatter: "
                "the lens model or the board shape deviates from the assumed one",
                remedy="see the residual map in the report",
            )
        )
    bend = c.fit.state.bend
    first = c.network.names.index(BEND[0])
    sigma = np.sqrt(np.diag(c.fit.covariance)[first : first + 3])
    if (np.abs(bend) > _SURE * np.maximum(sigma, 1e-15)).any() and c.network.boards:
        x0, y0, x1, y1 = c.network.boards[0].board.extent
        half = np.array([x1 - x0, y1 - y0]) / 2
        height = bend[[0, 2]] * half**2
        worst = int(np.abs(height).argmax())
        error = float(sigma[[0, 2]][worst] * half[worst] ** 2)
        out.append(
            Finding(
                "calibrate.board-bent",
                "note",
                f"the board is not flat: it bulges by {abs(height[worst]):.2f} ± {error:.2f} mm "
                f"over half its {'width' if worst == 0 else 'height'}; this is part of the model",
                remedy="mount the pattern on glass or aluminium for a better calibration",
            )
        )
    return out


def _residual_trend(c: Calibration) -> float:
    """Largest mean residual in one of 4×3 cells, relative to the scatter of all corners."""
    corners = np.concatenate([v.corners for v in c.network.boards])
    residual = np.concatenate([b.residual.reshape(-1, 2) for b in c.fit.blocks if b.kind == BOARD])
    camera = c.rig.camera
    cell = (corners[:, 0] * 4 // camera.width).astype(int) * 3 + (
        corners[:, 1] * 3 // camera.height
    ).astype(int)
    worst = 0.0
    for k in np.unique(cell):
        if np.count_nonzero(cell == k) >= 30:
            worst = max(worst, float(np.abs(residual[cell == k].mean(axis=0)).max()))
    return worst / float(residual.std())


def _of_lasers(c: Calibration, f: CalibrationQuality) -> list[Finding]:
    out = []
    for laser in c.network.lasers:
        if f.sheet_rms_mm.get(laser, 0.0) > _SHEET_MM:
            out.append(
                Finding(
                    "calibrate.sheet-residual",
                    "warning",
                    f"the stripes of laser {laser!r} lie {f.sheet_rms_mm[laser]:.2f} mm rms from "
                    f"their laser sheet ({f.sheet_rms_px[laser]:.2f} px)",
                    remedy="check that the laser did not move between the pictures",
                )
            )
        e = f.sheet_offset_mm.get(laser)
        if e is not None and e.value > max(_SURE * e.sigma, 0.2):
            out.append(
                Finding(
                    "calibrate.sheet-off-axis",
                    "note",
                    f"the sheet of laser {laser!r} passes {e.text('mm')} beside the axis; the "
                    "closed form of the paper needs 0, the full model used here does not",
                    remedy="turn the laser until its line crosses the axis, to cover narrow parts",
                )
            )
        bow = float(c.rig.sheet(laser).bow[0])
        if bow:
            out.append(
                Finding(
                    "calibrate.sheet-bent",
                    "note",
                    f"the sheet of laser {laser!r} is curved: {abs(bow) * 1e4:.3f} mm at 100 mm "
                    f"from "
                    "its middle; this is part of the model",
                )
            )
    return out


def _of_table(c: Calibration, f: CalibrationQuality) -> list[Finding]:
    layout = c.fit.state.layout
    out = []
    if f.table_rms_px > _TABLE_PX:
        out.append(_table_residual(c, f.table_rms_px))
    if c.rig.wobble is not None and "table" in c.stages.given:
        out.append(_axis_moves(c, c.rig.wobble))
    if not isinstance(layout, MarkerLayout) or f.marker_side_mm is None:
        return out
    nominal = c.settings.marker_side
    side = f.marker_side_mm
    if c.network.trusted_side is not None:
        out.append(
            Finding(
                "calibrate.scale-trusted",
                "warning",
                f"no stripe was seen on the platter, so the scale rests on the nominal marker "
                f"side of {nominal:g} mm, with a standard uncertainty of "
                f"{c.network.trusted_side[1]:.2g} mm",
                remedy="take the pictures of the empty table with the laser on",
            )
        )
    elif nominal and abs(side.value - nominal) > _SURE * side.sigma:
        each = ", ".join(f"{n}: {m.value:.2f}" for n, m in f.marker_sides_mm.items())
        out.append(
            Finding(
                "calibrate.marker-size",
                "warning",
                f"the markers measure {side.text('mm')}, not the nominal {nominal:g} mm "
                f"({side.value / nominal - 1:+.1%}); one by one {each}",
                remedy="the measured size is used; measure a printed marker to check the scale",
            )
        )
    centre = f.marker_centre_mm
    radii = np.linalg.norm(layout.squares[:, :2], axis=1)
    if centre is not None and centre.value > max(_SURE * centre.sigma, 0.005 * radii.mean()):
        each = ", ".join(f"{n}: {r:.1f}" for n, r in zip(layout.numbers, radii, strict=True))
        out.append(
            Finding(
                "calibrate.marker-centre",
                "warning",
                f"the centre of the markers lies {centre.text('mm')} beside the rotation axis; "
                f"the markers are {each} mm from it",
                remedy="nothing to do: the axis is taken from the motion, not from the markers",
            )
        )
    out += _platter(c, layout, float(radii.max()))
    return out


def _table_residual(c: Calibration, rms: float) -> Finding:
    first = len(c.network.boards)
    each = [c.fit.rms(RIDER, first + k) for k in range(len(c.network.table))]
    worst = np.argsort(np.nan_to_num(each))[::-1][:_NAMED]
    named = ", ".join(f"{c.network.table[k].name or k} {each[k]:.2f} px" for k in sorted(worst))
    return Finding(
        "calibrate.table-residual",
        "warning",
        f"what is fixed to the table is {rms:.2f} px rms off one turning motion; 0.2 px is usual",
        where=named,
        remedy="check that camera, markers and board did not move between the pictures",
    )


def _axis_moves(c: Calibration, wobble: Wobble) -> Finding:
    assert c.rig.covariance is not None
    at = c.rig.parameter_names.index(Wobble.NAMES[0])
    parts = list[str]()
    for what, first, factor, unit in (
        ("tilts by", 0, np.degrees(1.0), "°"),
        ("shifts by", 2, 1.0, " mm"),
        ("rises and falls by", 4, 1.0, " mm"),
    ):
        some = slice(at + first, at + first + 2)
        value, C = wobble.values[first : first + 2], c.rig.covariance[some, some]
        size = float(np.linalg.norm(value))
        if size > 0.0:
            error = float(np.sqrt(value @ C @ value)) / size
            parts.append(f"{what} {factor * size:.3f} ± {factor * error:.3f}{unit}")
    rim = _rim(c)
    return Finding(
        "calibrate.axis-moves",
        "note",
        f"the axis itself moves once in a turn: it {', '.join(parts)}, which puts places {rim:.0f} "
        f"mm from it up to {wobble.reach(rim):.2f} mm off; this is part of the rig, and is undone "
        "in scans",
        remedy="scans whose angles are not read from markers must begin where the first picture of "
        "the table was taken; look for play in the bearing",
    )


def _rim(c: Calibration) -> float:
    """mm from the axis to the farthest of what is fixed to the table."""
    layout = c.fit.state.layout
    if isinstance(layout, MarkerLayout):
        return float(np.linalg.norm(layout.squares[:, :2], axis=1).max())
    assert layout is not None
    corners, _ = layout.points(np.arange(len(layout.board.points), dtype=np.int32))
    return float(np.hypot(corners[:, 0], corners[:, 1]).max())


def _platter(c: Calibration, layout: MarkerLayout, reach: float) -> list[Finding]:
    first = c.network.names.index("platter.slope_x")
    sigma = np.sqrt(np.diag(c.fit.covariance)[first : first + 5])
    slope = float(np.hypot(*layout.shape[:2]))
    error = float(np.hypot(*sigma[:2]) / np.sqrt(2))
    out = []
    if slope > _SURE * error and slope * reach > 0.05:
        out.append(
            Finding(
                "calibrate.wobble",
                "note",
                f"the platter is tilted by {np.degrees(slope):.3f}° ± {np.degrees(error):.3f}° "
                f"to the rotation axis: {reach:.0f} mm from it the height varies by "
                f"{2 * slope * reach:.2f} mm in a turn",
            )
        )
    bulge = layout.shape[2:] * reach**2
    errors = sigma[2:] * reach**2
    worst = int(np.abs(bulge).argmax())
    if abs(bulge[worst]) > max(_SURE * float(errors[worst]), 0.05):
        out.append(
            Finding(
                "calibrate.platter-warped",
                "note",
                f"the platter is warped: {bulge[worst]:+.2f} ± {errors[worst]:.2f} mm at "
                f"{reach:.0f} mm from the axis; this is part of the model",
            )
        )
    return out


def _of_fit(c: Calibration) -> list[Finding]:
    out = []
    count = Counter(r.role for r in c.rejected)
    for role, n in count.items():
        named = ", ".join(r.name for r in c.rejected if r.role == role)
        why: str | Remedy = "the report gives the reasons"
        if role.startswith("laser "):
            why = Remedy(f"{why}; where the stripe lies on the board's margin and was not found, "
                         "give its width (", Option("margin_mm"), ")")  # fmt: skip
        shown = named if len(named) <= 120 else named[:117] + "…"
        out.append(
            Finding(
                "calibrate.rejected",
                "note",
                f"{n} pictures were not used ({shown})",
                where=role,
                remedy=why,
            )
        )
    if c.fit.view_factor > 1.5:
        out.append(
            Finding(
                "calibrate.errors-common",
                "note",
                "residuals within a picture are correlated; all uncertainties are increased "
                f"{c.fit.view_factor:.1f}-fold",
            )
        )
    known = c.stages.known
    if c.stages.held and known is not None and known.rig.covariance is None:
        out.append(
            Finding(
                "calibrate.held-exactly",
                "warning",
                f"the rig states no uncertainty of {', '.join(c.stages.held)}: treated as exact, "
                "so all uncertainties here are too small",
                remedy="calibrate these stages from pictures, too",
            )
        )
    pairs = strong_correlations(c)
    if pairs:
        worst = "; ".join(
            f"{parameter_in_words(a)} with {parameter_in_words(b)} ({r:+.3f})"
            for a, b, r in pairs[:4]
        )
        out.append(
            Finding(
                "calibrate.correlated",
                "note",
                f"strongly correlated parameters (|r| > {_CORRELATED}, pairs: {len(pairs)}): "
                f"{worst}; together they are better known than each alone, see the report",
                remedy="add pictures of the board with more tilts, distances and positions",
            )
        )
    return out


def strong_correlations(c: Calibration) -> list[tuple[str, str, float]]:
    """Pairs of rig parameters with |r| > 0.95, the strongest first."""
    cov = c.rig.covariance
    if cov is None:
        return []
    names = c.rig.parameter_names
    sigma = np.sqrt(np.diag(cov))
    on = np.flatnonzero(sigma)
    r = cov[np.ix_(on, on)] / np.outer(sigma[on], sigma[on])
    i, j = np.nonzero(np.triu(np.abs(r) > _CORRELATED, 1))
    pairs = [(names[on[a]], names[on[b]], float(r[a, b])) for a, b in zip(i, j, strict=True)]
    return sorted(pairs, key=lambda p: -abs(p[2]))
