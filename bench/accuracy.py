"""Accuracy against truth: rigs × parts × seeds, from camera pictures to fitted dimensions.

``python -m bench.accuracy`` runs a short version, ``--write`` puts it into the page; ``--full`` all
rigs, parts and seeds at their own step angles. The truth of a stripe is where the sheet cuts the
part's triangles (`bench._exact`), the truth of a point the part's own equation.
"""

from __future__ import annotations

import argparse
import math
import resource
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from bench._exact import Crossings, Exact, camera_error, speckle_error
from bench._page import ACCURACY, write
from bench._rigs import KNOWLEDGE, Knowledge, known_rig
from turnscan import points, shapes
from turnscan.arrays import Bools, Floats, Image
from turnscan.rig import Rig
from turnscan.simulate import Bench, Renderer, SimulationSpec, bench, seconds_of, steps_of
from turnscan.stripes import Stripe, StripeFlag, StripeSettings, detect

TOLERANCES = (0.05, 0.1, 0.2)
GROSS = 3.0
"""px: a centre this far from every crossing is a blunder, not noise."""
NEAR_EDGE = 2.0
"""mm."""
MARGIN = 24
"""px beyond the working volume in which a stripe is still looked at, as in the pipeline."""

SPHERE, CYLINDER, PLATE = 20.0, 25.0, 8.0
"""mm: radius, radius and thickness of those parts."""


@dataclass(frozen=True)
class Case:
    """A row of the table, but for its seed."""

    rig: str
    part: str
    steps: int = 0
    """0: the rig's own."""
    theta_deg: float = 0.0
    """0: the rig's own."""
    knowledge: Knowledge = "exact"
    perfect: bool = False
    """No speckle, blur or noise, a thin sheet, 16 bits."""

    @property
    def name(self) -> str:
        """The rig in words."""
        angle = f" {self.theta_deg:g}°" if self.theta_deg else ""
        known = ", true rig" if self.knowledge == "exact" else f", {self.knowledge}"
        return f"{self.rig}{angle}{known}" + (", perfect" if self.perfect else "")

    def spec(self, seed: int) -> SimulationSpec:
        """The bench to build."""
        theta = math.radians(self.theta_deg) or None
        return SimulationSpec(
            self.part, self.rig, theta=theta, lasers=1, seed=seed, perfect=self.perfect
        )


SHORT = (
    Case("paper", "sphere", 40),
    Case("paper", "sphere", 40, knowledge="calibrated"),
    Case("paper", "sphere", 40, knowledge="uncalibrated"),
    Case("paper", "cylinder", 40),
    Case("paper", "plate", 40),
    Case("paper", "hexagon", 40),
    Case("ciclop", "sphere", 12),
    Case("modern", "sphere", 8),
    Case("paper", "sphere", 20, perfect=True),
    Case("modern", "sphere", 4, perfect=True),
)
PARTS = (
    "sphere", "ball-bar", "plate", "cylinder", "cone", "torus", "shaft", "hexagon", "gear",
    "bracket", "grooves", "v-groove", "cup",
)  # fmt: skip
FULL = (
    *(Case(r, p) for r in ("paper", "ciclop", "modern") for p in PARTS),
    *(Case("paper", p, theta_deg=t) for t in (10.0, 60.0) for p in ("sphere", "hexagon")),
    *(Case(r, "sphere", knowledge=k) for r in ("paper", "modern") for k in KNOWLEDGE[1:]),
    *(Case(r, "sphere", perfect=True) for r in ("paper", "modern")),
)


@dataclass(frozen=True)
class Scan:
    """What one bench gave: a stripe and the true crossings per step, and the range grids."""

    stripes: list[Stripe]
    truth: list[Crossings]
    grid: points.RangeGrid
    visible: Bools
    """(s, n) True where the first body is lit, seen and inside the working volume."""
    seconds: float
    """Of detection and triangulation."""


def scan(made: Bench, exposure: float, steps: int, rig: Rig | None = None) -> Scan:
    """Pictures of the first laser at ``steps`` even angles, detected and triangulated.

    ``rig`` is what the software believes; None: the truth.
    """
    laser = made.beams[0].name
    believed = rig or made.rig
    angles = np.arange(steps) * (2 * math.pi / steps)
    volume = points.working_volume(believed, laser)
    look = StripeSettings(mask=points.view_mask(believed, laser, volume, margin=MARGIN))
    channel = int(np.argmax(made.sensor.response(made.beams[0].wavelength)))
    exact = Exact(made)
    spent = 0.0

    def half(some: Iterable[float]) -> list[tuple[Stripe, Crossings]]:
        nonlocal spent
        renderer = Renderer(made)
        found = []
        for angle in some:
            lit = _grey(renderer.picture(angle, {laser}, exposure), channel)
            dark = _grey(renderer.picture(angle, (), exposure), channel)
            start = time.perf_counter()
            stripe = detect(lit, dark, look)
            spent += time.perf_counter() - start
            found.append((stripe, exact.crossings(angle, laser)))
        return found

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(half, (angles[: steps // 2], angles[steps // 2 :]))
    stripes, truth = (list(each) for each in zip(*first, *second, strict=True))
    number = np.arange(steps)
    start = time.perf_counter()
    grid = points.clip(points.build_grid(believed, laser, stripes, number, angles), volume)
    spent += time.perf_counter() - start
    perfect = [_as_stripe(t, made.rig.camera.height) for t in truth]
    seen = points.build_grid(made.rig, laser, perfect, number, angles)
    inside = points.clip(seen, points.working_volume(made.rig, laser))
    return Scan(stripes, truth, grid, inside.found, spent)


def _grey(image: Image, channel: int) -> Image:
    grey: Image = image if image.ndim == 2 else image[..., channel]
    return grey


def _as_stripe(truth: Crossings, height: int) -> Stripe:
    """One crossing of the first body per row, as a stripe."""
    at = np.full(height, np.nan)
    at[truth.row[truth.own]] = truth.column[truth.own]
    known = np.where(np.isnan(at), np.nan, 1e-3)
    flags = np.where(np.isnan(at), np.uint16(StripeFlag.DARK), np.uint16(0))
    return Stripe(at, known, known, known, flags.astype(np.uint16))


def measure(case: Case, seed: int) -> dict[str, float]:
    """One case and seed → the figures of a row of the table."""
    spec = case.spec(seed)
    made = bench(spec)
    steps = case.steps or steps_of(spec)
    start = time.perf_counter()
    rig = known_rig(made, spec, case.knowledge)
    real = scan(made, seconds_of(spec), steps, rig)
    row = stripe_figures(real, made)
    row |= _cloud_figures(real, made, case.knowledge == "exact")
    if case.knowledge != "exact":
        row.pop("E_n", None)  # it knows the stripe's noise only, not the rig's error
    elif "size µm" in row and made.noise:
        still = scan(undisturbed(made), seconds_of(spec), min(steps, 40))
        row["optics µm"] = _cloud_figures(still, made, True)["size µm"]
        row["E_n rest"] = row["E_n"] * abs(1 - row["optics µm"] / row["size µm"])
    row["detect s"] = real.seconds
    row["all s"] = time.perf_counter() - start
    row["GB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return row


def undisturbed(made: Bench) -> Bench:
    """The same light through the same lens on the same scene, without speckle or noise, 16 bits."""
    s = made.sensor
    fine = replace(
        s, bits=16, adc_bits=0, gain=s.saturation / 65535, black=0.0, gamma=1.0, bayer="",
        jpeg_quality=0, jitter=0.0, prnu=0.0,
    )  # fmt: skip
    dim = replace(made.scene, sky=0.0, lamp=0.0, background=0.0)
    return replace(made, sensor=fine, scene=dim, waves="diffraction", noise=False)


def stripe_figures(real: Scan, made: Bench) -> dict[str, float]:
    """Stripe centres against the exact crossings; theory where it applies (`Crossings.fine`)."""
    errors, sigmas, predicted, fine, wanted, missed, alien, found = [], [], [], [], 0, 0, 0, 0
    for stripe, truth in zip(real.stripes, real.truth, strict=True):
        off = stripe.position[truth.row] - truth.column
        nearest = np.full(len(stripe.position), np.inf)
        np.minimum.at(nearest, truth.row, np.where(np.isnan(off), np.inf, np.abs(off)))
        wanted += len(np.unique(truth.row[truth.own]))
        missed += len(np.unique(truth.row[truth.own & np.isnan(off)]))
        crossed = np.isin(np.arange(len(nearest)), truth.row) & stripe.found
        found += int(crossed.sum())
        alien += int((nearest[crossed] > GROSS).sum())
        k = truth.own & (np.abs(off) <= GROSS) & (np.abs(off) == nearest[truth.row])
        errors.append(off[k])
        sigmas.append(stripe.sigma[truth.row[k]])
        fine.append(truth.fine[k])
        noise = speckle_error(made, truth.width[k])
        if made.sensor.gamma == 1.0:
            amplitude = stripe.amplitude[truth.row[k]]
            noise = np.hypot(noise, camera_error(made, truth.width[k], amplitude))
        predicted.append(noise)
    e, sigma, theory, f = (np.concatenate(x) for x in (errors, sigmas, predicted, fine))
    z = e / sigma
    inner = float(np.std(e[f]))
    row = {
        "bias px": float(e.mean()),
        "rms px": float(np.sqrt(np.mean(e**2))),
        "fine rms": inner,
        "z": float(1.4826 * np.median(np.abs(z - np.median(z)))),
        "gross %": 100 * alien / max(found, 1),
        "missed %": 100 * missed / max(wanted, 1),
    }
    if made.noise:
        row["theory"] = float(np.sqrt(np.mean(theory[f] ** 2)))
        row["ratio"] = inner / row["theory"]
    return row


def _cloud_figures(real: Scan, made: Bench, aligned: bool) -> dict[str, float]:
    """Points against the part; not ``aligned``: a sphere against the one of its size fitted."""
    body = made.scene.bodies[0]
    found, visible = real.grid.found, real.visible
    at = body.T_table_part.inverse().apply(real.grid.points[found])
    if not aligned:
        on = np.abs(np.linalg.norm(at - (0.0, 0.0, SPHERE), axis=1) - SPHERE) < 3.0
        ball = shapes.fit_sphere(at[on], real.grid.sigma[found][on])
        at = at - ball.centre + (0.0, 0.0, SPHERE)
    if body.part.distance is None:
        away = shapes.deviation(at, body.part.mesh).distance
    else:
        away = body.part.distance(at)
    size = np.abs(away)
    row = {
        "mean µm": 1e3 * float(away.mean()),
        "rms µm": 1e3 * float(np.sqrt(np.mean(away**2))),
        "p95 µm": 1e3 * float(np.quantile(size, 0.95)),
        "max µm": 1e3 * float(size.max()),
    }
    near = np.full(found.shape, np.inf)
    near[found] = size
    for limit in TOLERANCES:
        complete = float((visible & (near <= limit)).sum() / visible.sum())
        precise = float((size <= limit).mean())
        row[f"C@{limit}"] = 100 * complete
        row[f"F@{limit}"] = 100 * 2 * complete * precise / max(complete + precise, 1e-9)
    return row | _fitted(body.part.name, at, real.grid.sigma[found], away)


def _fitted(name: str, at: Floats, sigma: Floats, away: Floats) -> dict[str, float]:
    """A dimension of the part fitted to all its points, and how it compares with its uncertainty.

    Neighbouring points of a profile share speckle within a grain only, so the points count as
    independent.
    """
    keep = np.abs(away) < 5 * max(float(np.median(np.abs(away))), 1e-3)
    if name == "hexagon":
        corner = _to_corners(at, SPHERE / math.cos(math.pi / 6)) & (at[:, 2] > 2) & (at[:, 2] < 38)
        rms = float(np.sqrt(np.mean(away[corner] ** 2))) if corner.any() else math.nan
        return {"edge µm": 1e3 * rms}
    if name == "sphere":
        ball = shapes.fit_sphere(at[keep], sigma[keep])
        off, spread = 2 * (ball.radius - SPHERE), 2 * math.sqrt(ball.covariance[3, 3])
    elif name == "cylinder":
        side = keep & (at[:, 2] < 78) & (np.hypot(at[:, 0], at[:, 1]) > 20)
        tube = shapes.fit_cylinder(at[side], sigma[side])
        off, spread = 2 * (tube.radius - CYLINDER), 2 * math.sqrt(tube.covariance[4, 4])
    elif name == "plate":
        faces = []
        for way in (1.0, -1.0):
            face = keep & (np.abs(at[:, 0] - way * PLATE / 2) < 2) & (np.abs(at[:, 1]) < 28)
            face &= at[:, 2] < 78
            faces.append(shapes.fit_plane(at[face], sigma[face]))
        # Thickness at the middle of the plate, where each plane's height is best known.
        middle = np.array([0.0, 0.0, 40.0])
        off = sum(abs(float(f.distances(middle))) for f in faces) - PLATE
        spread = math.hypot(*(f.rms / math.sqrt(f.count) for f in faces))
    else:
        return {}
    return {"size µm": 1e3 * off, "E_n": abs(off) / (2 * spread)}


def _to_corners(at: Floats, radius: float) -> Bools:
    """(n,) True within `NEAR_EDGE` of the six upright edges of the hexagonal prism."""
    turn = np.arange(6) * (math.pi / 3)
    corners = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    apart = np.linalg.norm(at[:, None, :2] - corners, axis=-1).min(axis=1)
    return np.asarray(apart < NEAR_EDGE, dtype=np.bool_)


COLUMNS = (
    "bias px", "rms px", "fine rms", "theory", "ratio", "z", "gross %", "missed %", "mean µm",
    "rms µm", "p95 µm", "max µm", "C@0.05", "F@0.05", "C@0.1", "F@0.1", "C@0.2", "F@0.2",
    "size µm", "E_n", "optics µm", "E_n rest", "edge µm", "detect s", "all s", "GB",
)  # fmt: skip


def head() -> list[str]:
    """The first two lines of the table."""
    columns = " | ".join(COLUMNS)
    return [f"| rig | part | seed | {columns} |", "|---" * (3 + len(COLUMNS)) + "|"]


def line(case: Case, seed: int) -> str:
    """One more line of the table, measured."""
    row = measure(case, seed)
    cells = [f"{row[c]:.3g}" if c in row else "" for c in COLUMNS]
    return f"| {case.name} | {case.part} | {seed} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table, one line per rig, part and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="every rig and part, three seeds")
    parser.add_argument("--rig", help="only this rig")
    parser.add_argument("--part", help="only this part")
    parser.add_argument(
        "--write", action="store_true", help="put the short table into docs/explain/accuracy.md"
    )
    args = parser.parse_args()
    if args.write and (args.full or args.rig or args.part):
        parser.error("--write is for the whole short table")
    lines = head()
    print("\n".join(lines))
    for case in FULL if args.full else SHORT:
        if args.rig not in (None, case.rig) or args.part not in (None, case.part):
            continue
        for seed in (1, 2, 3) if args.full else (1,):
            lines.append(line(case, seed))
            print(lines[-1], flush=True)
    if args.write:
        write(ACCURACY, "short", lines)


if __name__ == "__main__":
    main()
