"""Scans the gallery's parts, draws their pictures and writes docs/gallery.md.

``python docs/make_gallery.py`` scans all with a simulated rig (ten minutes of one processor);
``python docs/make_gallery.py PART …`` makes some pictures again, and the page from the figures of
``docs/pictures/gallery/figures.json``. ``--keep FOLDER`` keeps the scans, and finds them again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from make_pictures import show
from matplotlib.figure import Figure
from PIL import Image as Pillow

from turnscan.arrays import Floats, Image
from turnscan.pipeline import Reconstruction, reconstruct
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import Renderer, SimulationSpec, seconds_of, simulated
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file, truth

DOCS = Path(__file__).parent
PICTURES = DOCS / "pictures" / "gallery"
FIGURES = PICTURES / "figures.json"
STEPS = 72
"""Of a turn, where an exhibit needs no more."""
WIDTH = 880
"""px of a picture."""
SIGMA, DEVIATION = "viridis", "RdYlBu_r"
"""Colour maps that are distinct with every common colour blindness."""


@dataclass(frozen=True)
class Exhibit:
    """A part of the gallery, and how it is scanned and looked at."""

    part: str
    title: str
    words: str
    lasers: int = 1
    azimuth: float = 0.6
    elevation: float = 0.45
    steps: int = STEPS


PAPER = (
    Exhibit("cup", "Coffee cup",
            "Thin translucent plastic: light spreads inside, and the line blurs."),
    Exhibit("mannequin", "Mannequin head",
            "Two lasers: each lights much that the nose hides from the other.",
            lasers=2, azimuth=1.05, elevation=0.15),
    Exhibit("bust", "Bust",
            "Polished stone: a bright zone about the line, many undercuts.",
            lasers=2, azimuth=1.05, elevation=0.15),
)  # fmt: skip
OTHERS = (
    Exhibit("gear", "Gear", "Deep gaps: only the hub and the tips of teeth are measured.",
            elevation=0.6, steps=200),
    Exhibit("v-groove", "V-groove", "Light reflected between both flanks draws a second stripe.",
            azimuth=1.3),
    Exhibit("mug", "Mug", "Few profiles cross the handle: it is lost, and hides the wall.",
            azimuth=0.5),
    Exhibit("bracket", "Bracket", "Edges and a bore: what no step sees stays a hole.",
            lasers=2, azimuth=2.4),
    Exhibit("torus", "Torus",
            "Grazing light above and below; the inside of the ring stays unseen."),
    Exhibit("shaft", "Shaft", "Steps and shoulders: diameters to fit, edges to keep.",
            elevation=0.25),
    Exhibit("hexagon", "Hexagonal prism",
            "Six flats: distances and angles between planes, no curvature."),
    Exhibit("grooves", "Grooves",
            "Ever narrower grooves show the finest detail that is resolved."),
    Exhibit("ball-bar", "Ball bar", "Two balls at a measured distance verify a scanner.",
            elevation=0.2),
)  # fmt: skip


_HEAD = """\
# Gallery

Parts that the simulated rig of the paper scanned (640 × 480 pixels, θ = 22.4°), with speckle, noise
and blur, each of its own material, as `turnscan reconstruct` makes them without options: nothing is
filled or smoothed, and what no laser lights or no camera sees stays open. The command
`python docs/make_gallery.py` scans them, draws the pictures and writes this page.

Each picture shows a camera frame, the surface coloured by the standard uncertainty that every point
carries, and the surface coloured by its deviation from the true shape, which only a simulation
knows (blue inside, red outside; 5 % of the vertices lie beyond the ends of a scale). Faces seen
from behind are rust. The deviation holds the shift of light that enters the material, too.

## The three tests of the paper

A plastic coffee cup, a mannequin head lit by two lines, and a bust (figures 11 to 13).
"""


@dataclass(frozen=True)
class Figures:
    """What the page states of a scan."""

    size: tuple[float, float, float]
    """mm."""
    points: int
    faces: int
    steps: int
    lasers: int
    sigma: float
    """Median, mm."""
    rms: float
    """mm off the true shape."""
    p95: float
    """mm off the true shape that 95 % of the vertices stay within."""


def scan(of: Exhibit, keep: Path) -> tuple[Reconstruction, Floats, Image]:
    """The surface, how far its vertices lie off the truth (mm), and one picture."""
    devices = simulated(SimulationSpec(of.part, lasers=of.lasers, steps=of.steps, seed=1))
    path = keep / f"{of.part}.turnscan"
    if not path.exists():
        scan_into_file(devices, plan_of(devices), path, "sparse")
    with Scan.open(path) as opened:
        done = reconstruct(opened, None, Settings())
    found = deviation(done.mesh.vertices, truth(devices)).distance
    made = devices.world.bench
    lit = tuple(b.name for b in made.beams)
    return done, found, Renderer(made).picture(0.42, lit, seconds_of(devices.spec))


def draw(of: Exhibit, keep: Path) -> Figures:
    """Write the picture of a part; returns what the page says of it."""
    done, away, picture = scan(of, keep)
    mesh = done.mesh
    assert mesh.provenance is not None
    sigma = 1000 * mesh.provenance.sigma
    away = 1000 * away
    figure = Figure(figsize=(10.4, 3.7), layout="constrained")
    frame, left, right = figure.subplots(1, 3, width_ratios=[0.9, 1, 1])
    show(frame, picture, "camera frame", gain=4.0)
    limit = _round_up(float(np.quantile(np.abs(away), 0.95)))
    for axes, values, low, high, colours, label in (
        (left, sigma, 0.0, _round_up(float(np.quantile(sigma, 0.95))), SIGMA,
         "standard uncertainty, µm"),
        (right, away, -limit, limit, DEVIATION, "deviation from the true shape, µm"),
    ):  # fmt: skip
        share = np.clip((values - low) / (high - low), 0, 1)
        colour = mpl.colormaps[colours](share)[:, :3] * 255
        seen = mesh.show(azimuth=of.azimuth, elevation=of.elevation, size=(420, 420), colour=colour)
        axes.imshow(seen.pixels)
        axes.set_axis_off()
        shades = mpl.cm.ScalarMappable(mpl.colors.Normalize(low, high), colours)
        bar = figure.colorbar(shades, ax=axes, orientation="horizontal", fraction=0.05, pad=0.02)
        bar.set_label(label, fontsize=9)
        bar.ax.tick_params(labelsize=8)
    data = BytesIO()
    figure.savefig(data, format="png", dpi=110, metadata={"Software": None})
    image = Pillow.open(data).convert("RGB")
    scaled = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Pillow.LANCZOS)
    # Few colours make a small file; those of the scales must be among them.
    few = scaled.quantize(255, method=Pillow.Quantize.MAXCOVERAGE, dither=Pillow.Dither.NONE)
    few.save(PICTURES / f"{of.part}.png", optimize=True)
    low_corner, high_corner = mesh.bounds
    size = tuple(round(float(x), 1) for x in high_corner - low_corner)
    points = sum(int(g.found.sum()) for g in done.grids)
    return Figures(
        (size[0], size[1], size[2]), points, len(mesh.faces), of.steps, of.lasers,
        round(float(np.median(sigma)) / 1000, 4),
        round(float(np.sqrt(np.mean(away**2))) / 1000, 4),
        round(float(np.quantile(np.abs(away), 0.95)) / 1000, 4),
    )  # fmt: skip


def _round_up(value: float) -> float:
    step = 10.0 ** np.floor(np.log10(value))
    return float(np.ceil(value / step) * step)


def page(known: dict[str, Figures]) -> str:
    """The text of docs/gallery.md."""
    lines = [_HEAD]
    for title, group in (("", PAPER), ("## More parts", OTHERS)):
        if title:
            lines += [title, ""]
        for of in group:
            if of.part in known:
                lines += _entry(of, known[of.part])
    return "\n".join(lines)


def _entry(of: Exhibit, f: Figures) -> list[str]:
    size = " × ".join(f"{x:.0f}" for x in f.size)
    lasers = "one laser" if f.lasers == 1 else f"{f.lasers} lasers"
    picture = f"pictures/gallery/{of.part}.png"
    figures = (
        f"{size} mm; {f.points} points in {f.steps} steps with {lasers}, {f.faces} faces; "
        f"sigma {1000 * f.sigma:.0f} µm (median); deviation {1000 * f.rms:.0f} µm rms, 95 % within "
        f"{1000 * f.p95:.0f} µm."
    )
    shown = f"![{of.title}: camera frame, standard uncertainty, deviation]({picture})"
    return [f"### {of.title}", "", of.words, "", shown, "", figures, ""]


def main() -> None:
    """Make the pictures that are named, or all, and the page."""
    everything = {of.part: of for of in (*PAPER, *OTHERS)}
    parser = argparse.ArgumentParser(description="Make the pictures of the gallery, and its page.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(everything))
    parser.add_argument("--keep", type=Path, help="folder for the scans")
    args = parser.parse_args()
    unknown = [name for name in args.parts if name not in everything]
    if unknown:
        parser.error(f"no {unknown[0]} in the gallery; there are {', '.join(everything)}")
    PICTURES.mkdir(parents=True, exist_ok=True)
    known: dict[str, Figures] = {}
    if FIGURES.exists():
        known = {k: Figures(**v) for k, v in json.loads(FIGURES.read_text()).items()}
    with tempfile.TemporaryDirectory() as folder:
        for name in args.parts or everything:
            known[name] = draw(everything[name], args.keep or Path(folder))
            print(name, known[name], flush=True)
            data = {k: asdict(known[k]) for k in everything if k in known}
            FIGURES.write_text(json.dumps(data, indent=1) + "\n")
            (DOCS / "gallery.md").write_text(page(known))


if __name__ == "__main__":
    main()
