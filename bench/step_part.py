"""A part of many faces, drawn as STEP, scanned in two poses and recovered: what comes back of it.

``python -m bench step_part`` simulates `featuretype.STEP` of the shared data on the paper's rig in
two poses, lying on its face and on its back, both leaning; joins them, finds shapes, and holds
these against the faces of the drawing: found, missed, invented, and how far points lie off; then
writes it as STEP and reads that back. ``--write`` puts the table into the page. ``python -m
bench.step_part PART.STEP`` takes another part, ``--steps`` (200) for each turn; ``--rig``; ``--keep
FOLDER`` keeps the scans there and finds them again; ``--free`` joins the poses by their own shape,
not by the drawing.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from pathlib import Path

import numpy as np

from bench import _keep
from bench._page import DOCS, write
from bench.surface_truth import scanned
from turnscan import workflows as w
from turnscan.drawings import read_step
from turnscan.formats import export
from turnscan.mesh import is_closed
from turnscan.progress import no_progress
from turnscan.shapes import deviation, volume_sigma
from turnscan.simulate import SimulationSpec
from turnscan.workflows._aligning import labels_of
from turnscan.workflows._compare import measured_labels
from turnscan.workflows._compared_features import matched
from turnscan.workflows._nominal import Nominal, nominal

PART = Path(__file__).parents[2] / "shared" / "data" / "parts" / "featuretype.STEP"
PAGE = DOCS / "how-to" / "shapes.md"
POSES = ((0.0, (55.0, 20.0)), (180.0, (55.0, -20.0)))
"""Degrees: how far the part is tipped over, then leans about x and y."""
_SEEN = 60
"""Measured vertices that a face must have to count as seen: those of the smallest plane."""


def recovered(drawing: Path, rig: str, steps: int, folder: Path, free: bool) -> list[str]:
    """The lines of the report."""
    drawn = nominal(drawing, "mm", no_progress)
    mesh = folder / f"{drawing.stem}-mm.stl"
    mesh.write_bytes(export(drawn.mesh, ".stl"))
    specs = [
        SimulationSpec(
            str(mesh),
            rig,
            lasers=1,
            seed=1 + k,
            steps=steps,
            tip=math.radians(tip),
            lean=(math.radians(lean[0]), math.radians(lean[1])),
        )
        for k, (tip, lean) in enumerate(POSES)
    ]
    scans = [scanned(spec, folder)[1] for spec in specs]
    joined = w.join(scans, reference=None if free else drawing)
    found = w.find_shapes(joined)
    moved = w.compare(joined, drawing, align="shape" if free else "none")
    return _told(drawn, found, moved)


def _told(drawn: Nominal, found: w.FoundShapes, moved: w.Comparison) -> list[str]:
    label = labels_of(drawn, moved.every.face, moved.every.beyond)
    match = matched(drawn, label, found.found, measured_labels(found.mesh, found))
    seen = np.bincount(label[label >= 0], minlength=len(drawn.shapes)) >= _SEEN
    lines = ["| kind | drawn | seen | found | missed | invented |", "|---|---|---|---|---|---|"]
    for kind in Counter(s.kind for s in (*drawn.shapes, *found.found.shapes)):
        of = [k for k, s in enumerate(drawn.shapes) if s.kind == kind]
        got = {match[k] for k, s in enumerate(found.found.shapes) if s.kind == kind and k in match}
        alien = sum(s.kind == kind and k not in match for k, s in enumerate(found.found.shapes))
        visible = sum(bool(seen[k]) for k in of)
        lost = sum(bool(seen[k]) and k not in got for k in of)
        lines.append(f"| {kind} | {len(of)} | {visible} | {len(got)} | {lost} | {alien} |")
    d = deviation(moved.mesh.vertices, drawn.mesh)
    return [
        *lines,
        "",
        f"measured points off the drawing: {1e3 * d.mean:+.1f} µm mean, {1e3 * d.rms:.1f} µm rms, "
        f"95 % within {1e3 * d.quantile(0.95):.1f} µm",
        "",
        *_solid(drawn, found),
    ]


def _solid(drawn: Nominal, found: w.FoundShapes) -> list[str]:
    """What the STEP holds, and its volume against the drawing's and the mesh's."""
    made = found.step
    back = read_step(made.data)
    mesh = "the mesh is open"
    if is_closed(found.mesh):
        mesh = f"mesh {found.mesh.volume:.0f} ± {volume_sigma(found.mesh).total:.0f} mm³"
    held = f"{back.solids} solids, {back.faces} faces, {'valid' if back.valid else 'not valid'}"
    volume = f", {back.volume:.0f} mm³" if back.solids else ""
    return [
        *(f"STEP: {f.message}" for f in made.findings),
        f"read back by OpenCASCADE: {held}{volume}; drawn {drawn.mesh.volume:.0f} mm³, {mesh}",
    ]


def run(quick: bool = False, into_pages: bool = False) -> None:
    """The part of the shared data."""
    if not PART.exists():
        print(f"{PART} is not there")
        return
    with _keep.folder(None) as folder:
        lines = recovered(PART, "paper", 60 if quick else 200, folder, free=False)
    print("\n".join(lines))
    if into_pages and not quick:
        write(PAGE, "step-part", lines)


def main() -> None:
    """Print what comes back of a drawing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drawing", type=Path)
    parser.add_argument("--rig", default="paper")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--free", action="store_true", help="join by shape, without the drawing")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    args = parser.parse_args()
    with _keep.folder(args.keep) as folder:
        lines = recovered(args.drawing, args.rig, args.steps, folder, args.free)
        print("\n".join(lines))
        if args.write:
            write(PAGE, "step-part", lines)


if __name__ == "__main__":
    main()
