"""Sections as a report: every point, piece and size, unrounded, in mm and degrees."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from turnscan import __version__
from turnscan.arrays import Floats
from turnscan.drawings._dxf import placements
from turnscan.drawings._sheet import counts
from turnscan.shapes import Arc, Chain, FittedSection, Line, Outline, Piece, Size
from turnscan.shapes.views import Relief


def section_report(
    sections: Sequence[FittedSection], about: Mapping[str, object]
) -> dict[str, Any]:
    """What was measured and fitted, as plain lists and numbers; None where nothing is known."""
    places = placements(sections)
    return {
        "turnscan": __version__,
        **about,
        "units": {"length": "mm", "angle": "degree", "uncertainty": "standard, k = 1"},
        "sections": [_section(s, at) for s, at in zip(sections, places, strict=True)],
    }


def write_section_json(sections: Sequence[FittedSection], about: Mapping[str, object]) -> bytes:
    """`section_report` as text."""
    return (json.dumps(section_report(sections, about), indent=1, allow_nan=False) + "\n").encode()


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _numbers(values: Floats) -> list[Any]:
    return [_number(v) for v in values]


def _section(section: FittedSection, at: Floats) -> dict[str, Any]:
    cut, box = section.cut, section.box
    sigma = section.size_sigma
    return {
        "name": cut.name,
        "normal": cut.normal.tolist(),
        "distance_mm": cut.distance,
        "right": cut.right.tolist(),
        "up": cut.up.tolist(),
        "half_plane": cut.half,
        "view": cut.view,
        "drawn_at_mm": at.tolist(),
        "box_mm": box.tolist(),
        "width_mm": float(box[1, 0] - box[0, 0]),
        "width_sigma_mm": _number(sigma[0]),
        "height_mm": float(box[1, 1] - box[0, 1]),
        "height_sigma_mm": _number(sigma[1]),
        "found": counts(section),
        "polylines": [_chain(c) for c in section.chains],
        "outlines": [_outline(o) for o in section.fitted],
        **({} if section.relief is None else {"relief": _relief(section.relief)}),
    }


def _relief(relief: Relief) -> dict[str, Any]:
    return {
        "radius_of_drawing_mm": relief.radius,
        "noise_mm": _number(relief.noise),
        "level_step_mm": relief.step,
        "levels_of_polylines_mm": relief.levels.tolist(),
        "r_mm": [_numbers(row) for row in relief.r.round(6)],
    }


def _chain(chain: Chain) -> dict[str, Any]:
    return {
        "closed": chain.closed,
        "length_mm": chain.length,
        "points_mm": chain.points.tolist(),
        "sigma_mm": _numbers(chain.sigma),
        "filled": chain.filled.tolist(),
    }


def _outline(outline: Outline) -> dict[str, Any]:
    return {
        "closed": outline.closed,
        "tolerance_mm": outline.tolerance,
        "noise_mm": outline.noise,
        "noise_known": outline.known,
        "box_mm": outline.box.tolist(),
        "box_sigma_mm": [_numbers(row) for row in outline.box_sigma],
        "pieces": [_piece(p) for p in outline.pieces],
        "sizes": [_size(s) for s in outline.sizes],
        "lines_without_sizes": outline.chords,
    }


def _piece(piece: Piece) -> dict[str, Any]:
    common = {
        "start_mm": piece.start.tolist(),
        "end_mm": piece.end.tolist(),
        "length_mm": piece.length,
        "joint": piece.joint,
        "points": piece.rest.count,
        "rms_mm": piece.rest.rms,
        "worst_mm": piece.rest.worst,
    }
    if isinstance(piece, Line):
        return {
            "kind": "link" if piece.link else "line",
            **common,
            "length_sigma_mm": _number(piece.length_sigma),
            "angle_deg": float(np.rad2deg(piece.angle)),
            "angle_sigma_deg": _number(float(np.rad2deg(piece.angle_sigma))),
            "sigma_mm": _number(piece.sigma),
        }
    if isinstance(piece, Arc):
        return {
            "kind": "circle" if piece.full else "arc",
            **common,
            "centre_mm": piece.centre.tolist(),
            "centre_sigma_mm": _numbers(piece.centre_sigma),
            "radius_mm": piece.radius,
            "radius_sigma_mm": _number(piece.radius_sigma),
            "begin_deg": float(np.rad2deg(piece.begin)),
            "sweep_deg": float(np.rad2deg(piece.sweep)),
        }
    return {
        "kind": "spline",
        **common,
        "degree": 3,
        "control_mm": piece.control.tolist(),
        "knots": piece.knots.tolist(),
        "sigma_mm": _number(piece.sigma),
    }


def _size(size: Size) -> dict[str, Any]:
    if size.kind == "angle":
        value: dict[str, Any] = {
            "angle_deg": float(np.rad2deg(size.value)),
            "sigma_deg": _number(float(np.rad2deg(size.sigma))),
        }
    else:
        value = {
            "distance_mm": size.value,
            "sigma_mm": _number(size.sigma),
            "off_parallel_deg": float(np.rad2deg(size.off_parallel)),
        }
    return {"kind": size.kind, **value, "between": list(size.between),
            "places_mm": size.places.tolist()}  # fmt: skip
