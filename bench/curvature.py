"""The bias of a thick sheet on curved surfaces, before and after it is taken off.

``python -m bench curvature`` scans round parts on the paper's rig and prints the signed distance of
the points from the true part: its median is the bias. Beside the axis the pictures tell how thick
the sheet is; on it the rig does (`turnscan.rig.LaserSheet.thickness`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

from bench.surface_truth import scanned
from turnscan import points
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.points._curvature import curvature_shift
from turnscan.points._lit_points import LitPoints
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import SimulationSpec

PARTS = ("sphere", "cylinder", "torus", "cone", "shaft")
ON_AXIS = ("cylinder", "shaft")
STEPS = 48
ASIDE = (4.0, -3.0)
"""mm: parts stand so far from the axis, so that their sides slope to the light."""


@dataclass(frozen=True)
class Outcome:
    """The points of one part, as measured."""

    error: Floats
    """(m,) mm outside the true part."""
    sigma: Floats
    """(m,) mm."""
    thickness: float
    """mm rms of the sheet, by the pictures; NaN where it was not known."""

    def cells(self) -> tuple[str, ...]:
        """Median, rms, rms over sigma and the thickness."""
        return (
            f"{1e3 * np.median(self.error):+.1f}", f"{1e3 * np.sqrt((self.error**2).mean()):.0f}",
            f"{np.sqrt(((self.error / self.sigma) ** 2).mean()):.2f}", f"{self.thickness:.3f}",
        )  # fmt: skip


@contextmanager
def _watched(known: list[float], taken: bool) -> Iterator[None]:
    """Hear of the thickness; the correction is left out unless ``taken``."""

    def heard(light: LitPoints, thickness: float) -> Floats:
        known.append(thickness)
        shift = curvature_shift(light, thickness)
        return shift if taken else np.zeros_like(shift)

    with patch("turnscan.points._build.curvature_shift", heard):
        yield


def outcome(
    part: str,
    folder: Path,
    taken: bool,
    steps: int = STEPS,
    aside: tuple[float, float] = ASIDE,
) -> Outcome:
    """A part's points. Raises ValueError for one whose surface has no formula."""
    spec = SimulationSpec(part, "paper", lasers=2, steps=steps, shift=aside, seed=1)
    made, path = scanned(spec, folder)
    body, s = made.scene.bodies[0], Settings()
    if body.part.distance is None:
        raise ValueError(f"{part}: no formula of its surface")
    error, sigma, known = list[Floats](), list[Floats](), list[float]()
    with Scan.open(path) as scan:
        seen = detect_scan(scan, made.rig, s.stripes)
    for sight in seen:
        v, own = sight.view, sight.stripes
        with _watched(known, taken):
            grid = points.build_grid(
                v.rig, v.laser, own.stripes, own.steps, own.angles, own.angle_sigma
            )
        grid = points.drop_specks(points.clip(grid, v.volume), s.shortest)
        at = body.T_table_part.inverse().apply(grid.points[grid.found])
        error.append(np.asarray(body.part.distance(at)))
        sigma.append(grid.sigma[grid.found])
    return Outcome(
        np.concatenate(error),
        np.concatenate(sigma),
        float(np.mean(known)) if known else float("nan"),
    )


def run(quick: bool = False) -> None:
    """Print the table."""
    head = ("part", "median µm", "rms µm", "rms / σ", "σ of the sheet mm")
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    with tempfile.TemporaryDirectory() as folder:
        asked = [(part, ASIDE) for part in (PARTS[:2] if quick else PARTS)]
        asked += [(part, (0.0, 0.0)) for part in (ON_AXIS[:1] if quick else ON_AXIS)]
        for part, aside in asked:
            where = "" if any(aside) else " on the axis"
            for word, taken in (("as measured", False), ("taken off", True)):
                cells = outcome(part, Path(folder), taken, aside=aside).cells()
                print(f"| {part}{where}, {word} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    run()
