"""Accuracy against truth: rigs × parts × seeds, from camera pictures to fitted dimensions.

``python -m bench.accuracy`` runs a short version; ``--full`` all rigs, parts and seeds at their own
step angles. The rig is known exactly, so what is measured is optics, speckle, noise and software,
not calibration. The truth of a stripe is the picture of the same scene under a thin sheet,
without speckle or noise; the truth of a point is the part's own equation.
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

from turnscan import points, shapes
from turnscan.arrays import Bools, Floats, Image
from turnscan.simulate import Bench, Renderer, Wish, bench, seconds_of, steps_of
from turnscan.stripes import Stripe, StripeSettings, detect

TOLERANCES = (0.05, 0.1, 0.2)
GROSS = 3.0
"""px: a centre this far from the truth is a blunder, not noise."""
NEAR_EDGE = 2.0
"""mm."""

SHORT = (
    ("paper", "sphere", 50),
    ("paper", "cylinder", 50),
    ("paper", "plate", 50),
    ("paper", "hexagon", 50),
    ("ciclop", "sphere", 20),
    ("modern", "sphere", 12),
)
FULL_RIGS = ("paper", "ciclop", "modern")
FULL_PARTS = (
    "sphere", "ball_bar", "plate", "cylinder", "cone", "torus", "shaft", "hexagon", "gear",
    "bracket", "grooves", "v_groove", "cup",
)  # fmt: skip


@dataclass(frozen=True)
class Scan:
    """What one bench gave: a stripe per step, and their range grid."""

    stripes: list[Stripe]
    grid: points.RangeGrid
    seconds: float


def scan(made: Bench, exposure: float, steps: int) -> Scan:
    """Pictures of the first laser at ``steps`` even angles, detected and triangulated."""
    laser = made.beams[0].name
    angles = np.arange(steps) * (2 * math.pi / steps)
    volume = points.working_volume(made.rig, laser)
    look = StripeSettings(mask=points.view_mask(made.rig, laser, volume))
    channel = int(np.argmax(made.sensor.response(made.beams[0].wavelength)))
    spent = 0.0

    def half(some: Iterable[float]) -> list[Stripe]:
        nonlocal spent
        renderer = Renderer(made)
        found = []
        for angle in some:
            lit = renderer.picture(angle, {laser}, exposure)
            dark = renderer.picture(angle, (), exposure)
            start = time.perf_counter()
            found.append(detect(_grey(lit, channel), _grey(dark, channel), look))
            spent += time.perf_counter() - start
        return found

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(half, (angles[: steps // 2], angles[steps // 2 :]))
    stripes = first + second
    start = time.perf_counter()
    grid = points.build_grid(made.rig, laser, stripes, np.arange(steps), angles)
    grid = points.clip(grid, volume)
    return Scan(stripes, grid, spent + time.perf_counter() - start)


def _grey(image: Image, channel: int) -> Image:
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., channel])


def measure(rig: str, part: str, steps: int, seed: int) -> dict[str, float]:
    """One rig, part and seed → the figures of a row of the table."""
    wish = Wish(part, rig, seed=seed)
    made = bench(wish)
    steps = steps or steps_of(wish)
    start = time.perf_counter()
    real = scan(made, seconds_of(wish), steps)
    truth = scan(undisturbed(wish), seconds_of(wish), steps)
    row = _stripe_figures(real, truth, made)
    row |= _cloud_figures(real, truth, made)
    row["detect s"] = real.seconds
    row["all s"] = time.perf_counter() - start
    row["GB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return row


def undisturbed(wish: Wish) -> Bench:
    """The same scene without speckle, diffraction, defocus or noise, under a thin sheet.

    The sheet is 0.7 px thick (rms): in a thinner one the centre of gravity would jump from pixel
    to pixel.
    """
    made = bench(replace(wish, perfect=True))
    on_object = made.sensor.pitch_x / made.lens.magnification
    thin = tuple(replace(b, waist=max(b.waist, 1.4 * on_object)) for b in made.beams)
    return replace(made, beams=thin)


def _stripe_figures(real: Scan, truth: Scan, made: Bench) -> dict[str, float]:
    at, sigma, width, wanted = (
        np.concatenate(values)
        for values in (
            [s.position for s in real.stripes],
            [s.sigma for s in real.stripes],
            [s.width for s in real.stripes],
            [s.position for s in truth.stripes],
        )
    )
    error = at - wanted
    both = np.isfinite(error)
    fine = both & (np.abs(error) <= GROSS)
    limit = speckle_limit(made, float(np.median(width[fine])))
    return {
        "bias px": float(error[fine].mean()),
        "rms px": float(np.sqrt(np.mean(error[fine] ** 2))),
        "limit px": limit,
        "z": float(1.4826 * np.median(np.abs(error[fine] / sigma[fine]))),
        "gross %": 100 * float(1 - fine.sum() / max(both.sum(), 1)),
        "missed %": 100 * float(np.mean(np.isnan(at[np.isfinite(wanted)]))),
    }


def speckle_limit(made: Bench, width: float) -> float:
    """rms error of a line's centre of gravity in one row, px: C √(K σ / (4√π))."""
    from turnscan.simulate import contrast

    down, across = made.grain
    C = contrast(made.scene.bodies[0].material.polarisation, made.modes)
    K = 4 / math.pi * down * across / math.hypot(1.0, 1.18 * down)
    return C * math.sqrt(K * width / (4 * math.sqrt(math.pi)))


def _cloud_figures(real: Scan, truth: Scan, made: Bench) -> dict[str, float]:
    body = made.scene.bodies[0]
    found, visible = real.grid.found, truth.grid.found
    at = body.T_table_part.inverse().apply(real.grid.points[found])
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
    near = np.zeros(found.shape)
    near[found] = size
    for limit in TOLERANCES:
        good = found & (near <= limit)
        complete = float((good & visible).sum() / visible.sum())
        precise = float(good.sum() / found.sum())
        row[f"C@{limit}"] = 100 * complete
        row[f"F@{limit}"] = 100 * 2 * complete * precise / max(complete + precise, 1e-9)
    return row | _fitted(body.part.name, at, real.grid, found, away)


def _fitted(
    name: str,
    at: Floats,
    grid: points.RangeGrid,
    found: Bools,
    away: Floats,
) -> dict[str, float]:
    """A dimension of the part fitted to all its points, and how it compares with its uncertainty.

    Neighbouring points of a profile share speckle within a grain only, so the points count as
    independent.
    """
    sigma = grid.sigma[found]
    keep = np.abs(away) < 5 * max(float(np.median(np.abs(away))), 1e-3)
    if name == "hexagon":
        corner = _to_corners(at, 40.0 / math.sqrt(3.0)) & (at[:, 2] > 2) & (at[:, 2] < 38)
        edge = 1e3 * float(np.sqrt(np.mean(away[corner] ** 2)))
        return {"edge µm": edge}
    if name == "sphere":
        ball = shapes.fit_sphere(at[keep], sigma[keep])
        off, spread = 2 * (ball.radius - 20.0), 2 * math.sqrt(ball.covariance[3, 3])
    elif name == "cylinder":
        side = keep & (at[:, 2] < 78) & (np.hypot(at[:, 0], at[:, 1]) > 20)
        tube = shapes.fit_cylinder(at[side], sigma[side])
        off, spread = 2 * (tube.radius - 25.0), 2 * math.sqrt(tube.covariance[4, 4])
    elif name == "plate":
        faces = []
        for way in (1.0, -1.0):
            face = keep & (np.abs(at[:, 0] - way * 4.0) < 2) & (np.abs(at[:, 1]) < 28)
            face &= at[:, 2] < 78
            faces.append(shapes.fit_plane(at[face], sigma[face]))
        # Thickness at the middle of the plate, where each plane's height is best known.
        middle = np.array([0.0, 0.0, 40.0])
        off = sum(abs(float(f.distances(middle))) for f in faces) - 8.0
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
    "bias px", "rms px", "limit px", "z", "gross %", "missed %", "mean µm", "rms µm", "p95 µm",
    "max µm", "C@0.05", "F@0.05", "C@0.1", "F@0.1", "C@0.2", "F@0.2", "size µm", "E_n", "edge µm",
    "detect s", "all s", "GB",
)  # fmt: skip


def main() -> None:
    """Print the table, one line per rig, part and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="every rig and part, three seeds")
    parser.add_argument("--rig", help="only this rig")
    parser.add_argument("--part", help="only this part")
    args = parser.parse_args()
    cases = [(r, p, 0) for r in FULL_RIGS for p in FULL_PARTS] if args.full else SHORT
    seeds = (1, 2, 3) if args.full else (1,)
    print("| rig | part | seed | " + " | ".join(COLUMNS) + " |")
    print("|---" * (3 + len(COLUMNS)) + "|")
    for rig, part, steps in cases:
        if args.rig not in (None, rig) or args.part not in (None, part):
            continue
        for seed in seeds:
            row = measure(rig, part, steps, seed)
            cells = [f"{row[c]:.3g}" if c in row else "" for c in COLUMNS]
            print(f"| {rig} | {part} | {seed} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
