"""What there is to tell about a reconstruction: provenance, figures, summary, report."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from turnscan import __version__
from turnscan.edit import Entry, describe, edit_to_value
from turnscan.findings import record
from turnscan.mesh import is_closed
from turnscan.meshing import source_of
from turnscan.pipeline import Reconstruction
from turnscan.plugins import Plugin
from turnscan.points import systematic_sigma
from turnscan.rig import Rig, rig_hash
from turnscan.settings import Settings
from turnscan.shapes import Source, volume_figures, volume_in_words, volume_sigma
from turnscan.stripes import named
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._surface._surface_report import holes_line, surface_figures, surface_parts

_OF_PICTURES = (
    "stripes",
    "volume",
    "shortest",
    "every",
    "along",
    "between",
    "denoise",
)
"""Settings without a meaning for range scans."""


def about(
    source: Path, rig: Rig | None, settings: Settings, edits: Sequence[Entry] = ()
) -> dict[str, object]:
    """Provenance for the files: version, source, rig hash, parameters, the edits that were done.

    Edits are told in words; ``edits_sha256`` is that of their JSON, one a line.
    """
    used = asdict(settings)
    if rig is None:  # range scans of another scanner: no pictures, no table
        used = {k: v for k, v in used.items() if k not in _OF_PICTURES}
    return {
        "software": f"turnscan {__version__}",
        "source": source.name,
        "rig_sha256": None if rig is None else rig_hash(rig),
        "parameters": _plain(used),
        **(_repaired(edits) if edits else {}),
    }


def _repaired(edits: Sequence[Entry]) -> dict[str, object]:
    texts = "\n".join(json.dumps(edit_to_value(e.edit), sort_keys=True) for e in edits)
    return {
        "edits": [
            f"{e.id}: {describe(e.edit)}" + (f" ({e.name})" if e.name else "") for e in edits
        ],
        "edits_sha256": hashlib.sha256(texts.encode()).hexdigest(),
    }


def _plain(value: Any) -> Any:
    """Settings as JSON holds them; what is unlimited or not set is left out."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items() if v is not None and not _endless(v)}
    if callable(value) or isinstance(value, Plugin):
        return named(value)
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def _endless(value: Any) -> bool:
    return isinstance(value, float) and not np.isfinite(value)


def figures(done: Reconstruction, rig: Rig | None) -> dict[str, Any]:
    """The result in numbers."""
    mesh = done.mesh
    lasers = []
    for g in done.spaced:
        rigs = np.zeros(0) if rig is None else systematic_sigma(rig, g)
        known = g.sigma[~np.isnan(g.sigma)]
        lasers.append(
            {
                "laser": g.laser,
                "profiles": len(g.steps),
                "points": int(g.found.sum()),
                "closed_turn": g.closed,
                "sigma_mm": float(np.median(known)) if len(known) else None,
                "sigma_rig_mm": float(np.median(rigs)) if len(rigs) else None,
            }
        )
    closed = is_closed(mesh)
    return {
        "lasers": lasers,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "closed": closed,
        **volume_of(done, rig),
        "bounds_mm": mesh.bounds.tolist() if len(mesh.vertices) else None,
    }


def volume_of(done: Reconstruction, rig: Rig | None) -> dict[str, float | None]:
    """What `volume_figures` says of the part; nothing but None where it is open."""
    if not is_closed(done.mesh):
        return {"volume_mm3": None, "volume_sigma_mm3": None}
    return volume_figures(done.mesh.volume, volume_sigma(done.mesh, made_from(done, rig)))


def made_from(done: Reconstruction, rig: Rig | None) -> Source:
    """What the uncertainty of all that is measured on a surface hangs on."""
    return done.source or source_of(done.grids, rig, done.merged)


def summary(done: Reconstruction, rig: Rig | None) -> list[str]:
    """The same in words, one line each."""
    f = figures(done, rig)
    lines = []
    for g in f["lasers"]:
        noise = "" if g["sigma_mm"] is None else f", stripe noise {g['sigma_mm']:.3f} mm"
        system = "" if g["sigma_rig_mm"] is None else f", rig {g['sigma_rig_mm']:.3f} mm"
        lines.append(
            f"{g['laser']}: {g['points']} points in {g['profiles']} profiles{noise}{system}"
        )
    if f["vertices"]:
        low, high = f["bounds_mm"]
        size = " × ".join(f"{b - a:.2f}" for a, b in zip(low, high, strict=True))
        volume = f", volume {volume_in_words(f)}" if f["closed"] else ", open"
        lines.append(f"mesh: {f['vertices']} vertices, {f['faces']} faces, {size} mm{volume}")
    return lines + holes_line(done)


def known(figures: Mapping[str, float | None]) -> dict[str, float]:
    """The figures that have a value."""
    return {k: v for k, v in figures.items() if v is not None}


@dataclass(frozen=True)
class ReportTable:
    """A table of a report, and the same for a JSON file."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    key: str
    values: object


def write_report(
    path: Path,
    told: Mapping[str, object],
    done: Reconstruction,
    rig: Rig | None,
    sections: Sequence[ReportTable],
) -> None:
    """The report, as JSON or as one HTML page with pictures of the surface."""
    if path.suffix.lower() == ".json":
        body = {
            **told,
            **figures(done, rig),
            **surface_figures(done),
            **{s.key: s.values for s in sections},
            "findings": [record(f) for f in done.findings],
        }
        write_atomically(path, json.dumps(body, indent=1, ensure_ascii=False).encode())
        return
    from turnscan.workflows._pages import _html as html

    rows = [
        [
            g["laser"], g["profiles"], g["points"], _mm(g["sigma_mm"]), _mm(g["sigma_rig_mm"]),
        ]
        for g in figures(done, rig)["lasers"]
    ]  # fmt: skip
    head = ["laser", "profiles", "points", "stripe noise, median mm", "rig, median mm"]
    parts = [html.table(head, rows)]
    parts += [html.paragraph(line) for line in summary(done, rig)[len(rows) :]]
    for s in sections:
        parts += [html.heading(s.title), html.table(s.head, s.rows)]
    parts += [html.heading("Findings"), html.findings(done.findings)]
    parts += surface_parts(done)
    parameters = json.dumps(told, indent=1, ensure_ascii=False)
    parts += [html.heading("Parameters"), html.paragraph(parameters)]
    write_atomically(path, html.page(f"Reconstruction of {told['source']}", parts).encode())


def _mm(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4f}"
