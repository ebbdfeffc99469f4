"""The bias of a thick sheet on curved surfaces, before and after it is taken off.

``python -m bench curvature`` scans round parts on the paper's rig and prints the signed distance of
the points from the true part: its median is the bias, the mean of `DRAWS` medians. Noise draws the
median of one scan of a torus by 1 µm; and the picture of a body of revolution on the axis is the
same at every step, so that all of its points have what the camera's pixels do to one profile, 7 µm
or more. So each scan has noise of its own and a laser turned by a part of a pixel.
Beside the axis the pictures tell how thick the sheet is; on it the rig does
(`turnscan.rig.LaserSheet.thickness`). ``--write`` puts each row into docs/explain/accuracy.md.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

from bench import _page
from bench._page import MEASURED
from bench.surface_truth import scanned
from turnscan import points
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.points._curvature import curvature_shift
from turnscan.points._lit_points import LitPoints
from turnscan.rig import design_preset
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import SimulationSpec

PARTS = ("sphere", "cylinder", "torus", "cone", "shaft")
ON_AXIS = ("cylinder", "shaft")
STEPS = 48
ASIDE = (4.0, -3.0)
"""mm: parts stand so far from the axis, so that their sides slope to the light."""
DRAWS = 6
"""Scans of each part."""
PHASE = math.radians(0.23)
"""So far the laser is turned from one to the next: a sixth of the paper's pixel, on such parts."""
HEAD = (
    "| part | as measured µm | taken off µm | rms / σ | σ of the sheet mm | " + MEASURED + " |",
    "|" + "---|" * 6,
)


@dataclass(frozen=True)
class Outcome:
    """The points of one part, as measured."""

    error: Floats
    """(m,) mm outside the true part."""
    sigma: Floats
    """(m,) mm."""
    thickness: float
    """mm rms of the sheet, by the pictures; NaN where it was not known."""

    @property
    def median(self) -> float:
        """The bias, µm."""
        return 1e3 * float(np.median(self.error))

    @property
    def ratio(self) -> float:
        """rms of error over sigma."""
        return float(np.sqrt(((self.error / self.sigma) ** 2).mean()))


@contextmanager
def _watched(known: list[float], taken: bool) -> Iterator[None]:
    """Hear of the thickness; the correction is left out unless ``taken``."""

    def heard(light: LitPoints, thickness: float) -> Floats:
        known.append(thickness)
        shift = curvature_shift(light, thickness)
        return shift if taken else np.zeros_like(shift)

    with patch("turnscan.points._build.curvature_shift", heard):
        yield


def outcome(spec: SimulationSpec, folder: Path, taken: bool) -> Outcome:
    """A part's points. Raises ValueError for one whose surface has no formula."""
    made, path = scanned(spec, folder)
    body, s = made.scene.bodies[0], Settings()
    if body.part.distance is None:
        raise ValueError(f"{spec.scene}: no formula of its surface")
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


def _name(part: str, aside: tuple[float, float]) -> str:
    return f"{part}{'' if any(aside) else ' on the axis'}"


def row(part: str, aside: tuple[float, float], draws: int) -> str:
    """A line of the table: one part, measured so many times."""
    found = list[tuple[float, float, float, float]]()
    for k in range(draws):
        spec = SimulationSpec(
            part, "paper", lasers=2, steps=STEPS, shift=aside, seed=k + 1,
            theta=design_preset("paper").theta + k * PHASE,
        )  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            raw, off = (outcome(spec, Path(folder), taken) for taken in (False, True))
        found.append((raw.median, off.median, off.ratio, off.thickness))
    mean = np.mean(found, axis=0)
    noise = np.std(found, axis=0, ddof=1) / np.sqrt(draws) if draws > 1 else np.full(4, np.nan)
    return (
        f"| {_name(part, aside)} | {mean[0]:+.1f} ± {noise[0]:.1f} "
        f"| {mean[1]:+.1f} ± {noise[1]:.1f} | {mean[2]:.2f} | {mean[3]:.3f} |"
    )


def run(quick: bool = False, into_pages: bool = False, only: Sequence[str] | None = None) -> None:
    """Print the table, and put each row into the page."""
    print("\n".join(HEAD))
    asked = [(part, ASIDE) for part in (PARTS[:2] if quick else PARTS)]
    asked += [(part, (0.0, 0.0)) for part in (ON_AXIS[:1] if quick else ON_AXIS)]
    order = [*PARTS, *(f"{part} on the axis" for part in ON_AXIS)]
    for part, aside in asked:
        if only is not None and _name(part, aside) not in only:
            continue
        lines = _page.measured([row(part, aside, 2 if quick else DRAWS)], "rig known")
        print(lines[0], flush=True)
        if into_pages:
            _page.put(_page.ACCURACY, "curvature", [*HEAD, *lines], 1, order)


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two parts and one, twice each")
    parser.add_argument("--only", nargs="+", help="these rows, by their names")
    parser.add_argument("--write", action="store_true", help="put the rows into the documents")
    given = parser.parse_args()
    run(given.quick, given.write, given.only)


if __name__ == "__main__":
    main()
