"""Space-time refinement against truth: brightness steps, edges, creases, a table that trembles.

``python -m bench spacetime`` prints the error of the same centres before and after; with
``--quick`` the short cases alone. A few rows of picture and a sector of the turn are enough.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from turnscan import points
from turnscan.arrays import Floats, Image
from turnscan.rig import Rig
from turnscan.simulate import Bench, Renderer, SimulationSpec, bench, seconds_of
from turnscan.simulate._bench import Waves
from turnscan.simulate._parts import cylinder
from turnscan.stripes import Signal, Stripe, StripeSettings

RADIUS = 30.0
"""mm, of the cylinder with bars."""


@dataclass(frozen=True)
class Case:
    """A sector of a scan."""

    rig: str
    part: str
    step: float
    """Degrees."""
    steps: int
    bars: float = 0.0
    """mm: width of bars, every second of a tenth of the brightness; 0 for none."""
    waves: Waves = "diffraction"
    """As `Bench.waves`; rays is a lens without blur."""
    tremble: float = 0.0
    """Degrees rms: how far the table stands off the angle that it says."""
    bounces: bool = False
    """Also light that goes to and fro between surfaces."""
    rows: int = 0
    """Of the picture; 0 takes 24, in speckle 48: its share of sigma is the scatter along the rows.
    """
    seed: int = 1

    @property
    def name(self) -> str:
        """The case in words."""
        bounced = ", bounces" if self.bounces else ""
        what = f"bars of {self.bars:g} mm" if self.bars else self.part
        off = f", table ± {self.tremble:g}°" if self.tremble else ""
        return f"{self.rig}, {what}, {self.step:g}°, {self.waves}{off}{bounced}"


QUICK = (
    Case("modern", "cylinder", 0.45, 40, bars=2.0, waves="rays"),
    Case("modern", "cylinder", 0.225, 40, bars=2.0),
    Case("modern", "cylinder", 0.9, 24, bars=2.0),
    Case("paper", "cylinder", 1.2, 30, bars=4.0),
    Case("paper", "hexagon", 0.9, 70),
)
FULL = (
    *QUICK,
    Case("modern", "cylinder", 0.45, 40, bars=2.0),
    Case("modern", "cylinder", 0.225, 40, bars=2.0, waves="speckle"),
    Case("modern", "cylinder", 0.225, 40, waves="speckle"),
    Case("modern", "hexagon", 0.45, 80),
    Case("paper", "cylinder", 1.8, 24, bars=4.0),
    Case("paper", "cylinder", 1.2, 30, bars=4.0, waves="speckle"),
    Case("paper", "cylinder", 1.2, 30, waves="speckle"),
    Case("paper", "hexagon", 0.9, 70, waves="speckle"),
    Case("paper", "hexagon", 0.9, 70, tremble=0.03),
    Case("paper", "plate", 0.9, 110, waves="speckle"),
    Case("paper", "gear", 0.9, 30, waves="speckle"),
    Case("paper", "shaft", 0.9, 60, waves="speckle"),
    Case("paper", "v-groove", 0.9, 100, waves="speckle"),
    Case("paper", "grooves", 0.9, 100, waves="speckle"),
    Case("paper", "v-groove", 0.9, 100, waves="speckle", bounces=True),
    Case("paper", "cup", 0.9, 40, waves="speckle", bounces=True),
)


@dataclass(frozen=True, eq=False)
class Pictures:
    """What a case's camera saw."""

    angles: Floats
    """(s,) rad, as the table says."""
    lit: list[Image]
    dark: list[Image]


@dataclass(frozen=True, eq=False)
class Outcome:
    """The same centres before and after: signed errors and sigmas (s, n), mm, NaN where missing."""

    before: Floats
    sigma_before: Floats
    after: Floats
    sigma_after: Floats
    ordinary: tuple[Stripe, ...]
    """The stripes before."""
    swept: points.Swept
    seconds: tuple[float, float]
    """Of detection and of the refinement."""

    def row(self) -> dict[str, float]:
        """Figures of the refined points, and of all whose elements were followed."""
        m, some = self.swept.refined, self.swept.followed & ~np.isnan(self.before)
        if not some.any():
            return {"followed %": 0.0}
        out = {"followed %": 100 * float(some[~np.isnan(self.before)].mean())}
        out["refined %"] = 100 * float(m[some].mean())
        for word, error, sigma in (
            ("before", self.before, self.sigma_before),
            ("after", self.after, self.sigma_after),
        ):
            if m.any():
                out[f"rms {word} µm"] = 1e3 * rms(error[m])
                out[f"z {word}"] = rms((error / sigma)[m])
            out[f"all {word} µm"] = 1e3 * rms(error[some])
            out[f"all z {word}"] = rms((error / sigma)[some])
            beyond = np.abs(error / sigma)[some] > 3
            out[f"> 3σ {word} %"] = 100 * float(beyond.mean())
            out[f"max {word} µm"] = 1e3 * float(np.abs(error[some]).max())
        return out


def rms(values: Floats) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def built(case: Case) -> Bench:
    """The bench of a case."""
    made = bench(SimulationSpec(case.part, case.rig, lasers=1, seed=case.seed, waves=case.waves))
    body = made.scene.bodies[0]
    if case.part == "cylinder":
        body = replace(body, part=cylinder(RADIUS))
    if case.bars:
        # The pitch of a pattern is that at a radius of 25 mm.
        pitch = 2 * case.bars * 25.0 / RADIUS
        painted = replace(body.material, pattern="bars", pitch=pitch, pattern_ratio=0.1)
        body = replace(body, material=painted)
    scene = replace(made.scene, bodies=(body, *made.scene.bodies[1:]))
    return replace(
        made,
        scene=scene,
        rig=_strip(made.rig, case.rows or (48 if case.waves == "speckle" else 24)),
        bounces=case.bounces,
    )


@cache
def photographed(case: Case) -> Pictures:
    """Pictures of a case: laser on and off at every step."""
    made = built(case)
    renderer, laser = Renderer(made), made.beams[0].name
    seconds = seconds_of(SimulationSpec("cylinder", case.rig))
    angles: Floats = math.radians(case.step) * np.arange(case.steps, dtype=np.float64)
    off = np.random.default_rng(case.seed).normal(0.0, math.radians(case.tremble), case.steps)
    lit = [renderer.picture(angle, {laser}, seconds) for angle in angles + off]
    dark = [renderer.picture(angle, (), seconds) for angle in angles + off]
    return Pictures(angles, lit, dark)


def _strip(rig: Rig, rows: int) -> Rig:
    """The rig with a camera that reads only the rows in the middle of its picture."""
    camera = rig.camera
    first = (camera.height - rows) // 2
    return replace(rig, camera=replace(camera, height=rows, cy=camera.cy - first))


@cache
def outcome(case: Case) -> Outcome:
    """A case measured both ways."""
    seen = photographed(case)
    made = built(case)
    laser = made.beams[0].name
    look, signal = (
        StripeSettings(),
        Signal(None, "uint8" if seen.lit[0].itemsize == 1 else "uint16"),
    )
    light = [signal.light(on, off, look) for on, off in zip(seen.lit, seen.dark, strict=True)]
    signal.detect(seen.lit[0], seen.dark[0], look)
    start = time.perf_counter()
    stripes = [signal.detect(on, off, look) for on, off in zip(seen.lit, seen.dark, strict=True)]
    middle = time.perf_counter()
    for _ in range(2):  # the first time, kernels may be compiled
        again = time.perf_counter()
        swept = points.refine(made.rig, laser, stripes, seen.angles, light.__getitem__)
    seconds = (middle - start, time.perf_counter() - again)
    before, sigma_before = _errors(made, stripes, seen.angles)
    after, sigma_after = _errors(made, swept.stripes, seen.angles)
    return Outcome(before, sigma_before, after, sigma_after, tuple(stripes), swept, seconds)


def _errors(
    made: Bench, stripes: list[Stripe] | tuple[Stripe, ...], angles: Floats
) -> tuple[Floats, Floats]:
    """Distances from the true part and sigmas, mm, (s, n)."""
    laser, body = made.beams[0].name, made.scene.bodies[0]
    grid = points.build_grid(made.rig, laser, stripes, np.arange(len(stripes)), angles)
    error = np.full(grid.found.shape, np.nan)
    assert body.part.distance is not None
    at = body.T_table_part.inverse().apply(grid.points[grid.found])
    error[grid.found] = body.part.distance(at)
    return error, np.array(grid.sigma)


def run(quick: bool = False) -> None:
    """Print the table."""
    columns: list[str] | None = None
    for case in QUICK if quick else FULL:
        done = outcome(case)
        row = done.row()
        row["arc / sheet"] = done.swept.arc / done.swept.thickness
        row["time × detection"] = done.seconds[1] / done.seconds[0]
        if columns is None:
            columns = list(row)
            print("| case | " + " | ".join(columns) + " |")
            print("|---" * (1 + len(columns)) + "|")
        cells = [f"{row[c]:.3g}" if c in row else "" for c in columns]
        print(f"| {case.name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    run()
