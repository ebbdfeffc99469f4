"""From a ruler's numbers to a rig without a board: what two lasers see of a part is one surface.

The rig is the modern preset with both lasers; the stripes are cut by the true sheets and have the
noise that its rendered pictures show (docs/explain/accuracy.md). Every number of the ruler is wrong
by its whole standard uncertainty, 5 mm or 2°; the signs change from seed to seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from tests.calibrate.bodies import Body, both, doubted, drawn, prism, sphere, two_lasers

from bench.calibration._figures import Figure, at_most
from turnscan.arrays import Floats
from turnscan.calibrate import Balls, Part, Refined, RefineSettings, Sweep, refine
from turnscan.errors import CalibrationError
from turnscan.mesh import Mesh
from turnscan.rig import Pose, Rig, rotation_from_vector
from turnscan.shapes import fit_sphere
from turnscan.shapes.verification import step_block_body
from turnscan.simulate import SimulationSpec, bench
from turnscan.simulate import part as simulated

NOISE = 0.385
"""px: the modern rig's stripes, with speckle."""
LENGTH, ANGLE = 5.0, 2.0
"""mm and degrees by which the ruler is wrong."""
STEPS = np.radians(np.arange(0.0, 360.0, 9.0))
KNOWN, OTHER = 18.0, 12.0
"""mm: radius of the ball that makes the rig, and of the one that it measures."""
GIVEN, UNKNOWN, SHAPELESS = "one length given", "a ball of unknown size", "a part of unknown shape"
BALL, HEXAGON = sphere((14.0, 3.0, 22.0), KNOWN), prism((5.0, 2.0), 40.0, 6, 5.0)
WAYS = ((GIVEN, ((KNOWN, 0.005),)), (UNKNOWN, (None,)))
"""What is said of the ball: its radius with its standard uncertainty, mm, or that it is one."""
LEAN = (0.3, -0.4, 0.9)
"""Rotation vector of a drawn part, which lies anyhow."""
_EVERY = 4
"""Lines of the picture, of which one is looked at: `turnscan refine` averages eight where there are
as many. What the surfaces leave open falls as the root of their number."""


def _smaller(name: str, share: float) -> Mesh:
    mesh = simulated(name).mesh
    return Mesh(share * np.asarray(mesh.vertices), mesh.faces)


PARTS = {
    "step block of 27 mm": step_block_body((4.0, 9.0), width=9.0, tall=26.0, back=6.0),
    "bracket of 42 mm": _smaller("bracket", 0.6),
    "hexagon of 28 mm": _smaller("hexagon", 0.6),
}
"""What is scanned of known shape."""


def figures(quick: bool) -> Iterator[Figure]:
    """By what is said of the part, as soon as it is measured; drawn parts but for ``quick``."""
    seeds = range(2 if quick else 5)
    true = bench(SimulationSpec("sphere", "modern", lasers=2)).rig
    for way, sizes in WAYS:
        done = [_refined(true, BALL, wrong_rig(true, seed), seed, sizes) for seed in seeds]
        yield from _lines(true, done, way)
    far = [_refined(true, HEXAGON, wrong_rig(true, seed), seed, None) for seed in seeds]
    refused = sum(one is None for one in far)
    told = f"{refused} of {len(far)}"
    yield Figure(f"refused by name, {SHAPELESS}", "all", told, refused == len(far))
    way = f"{SHAPELESS}, the lasers known"
    beside = [table_unknown(true, seed) for seed in seeds]
    done = [_refined(true, HEXAGON, rig, seed, None) for seed, rig in enumerate(beside)]
    yield from _lines(true, done, way)
    for name, mesh in () if quick else PARTS.items():
        yield from _by_drawing(name, mesh, seeds)


def _by_drawing(name: str, mesh: Mesh, seeds: range) -> list[Figure]:
    """A part whose drawing is known, on the small rig of the tests: its scale comes with it."""
    true = two_lasers()
    lean = rotation_from_vector(LEAN)
    lies = Pose(lean, np.array([2.0, 4.0, 22.0]) - lean @ mesh.bounds.mean(axis=0))
    sweeps = both(true, drawn(mesh, lies), STEPS, STEPS, 2, every=6)
    settings = RefineSettings(body=(Part(mesh), ((1.0, 1e-4),)), rounds=4, queries=200)
    other = both(true, sphere((-8.0, 10.0, 20.0), OTHER), STEPS, STEPS, 5, noise=0.0, every=8)
    found = list[tuple[float, float]]()
    for seed in seeds:
        try:
            rig = refine(wrong_rig(true, seed), sweeps, settings).rig
        except CalibrationError as e:
            print(f"  {name}, seed {seed}: {e}", flush=True)
            continue
        at = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in other])
        ball = fit_sphere(at)
        off = np.abs(np.linalg.norm(at - ball.centre, axis=1) - ball.radius)
        found.append((ball.radius - OTHER, float(2 * np.quantile(off, 0.95))))
    way = f"a {name} as it is drawn"
    told = f"{len(found)} of {len(seeds)}"
    out = [Figure(f"rigs found, {way}", "all", told, len(found) == len(seeds))]
    if found:
        size, form = (max(v, key=abs) for v in zip(*found, strict=True))
        out.append(at_most(f"another ball, 95 % of its form, {way}", form, 0.05, "mm"))
        out.append(Figure(f"its radius, {way}", "", f"{size:+.3f} mm"))
    return out


def wrong_rig(true: Rig, seed: int) -> Rig:
    """The rig as a ruler knows it."""
    known = doubted(true, LENGTH, ANGLE)
    assert known.covariance is not None
    sign = np.random.default_rng(seed).choice([-1.0, 1.0], len(known.covariance))
    off = sign * np.sqrt(np.diag(known.covariance))
    return replace(known.perturbed(off), covariance=known.covariance)


def table_unknown(true: Rig, seed: int) -> Rig:
    """The rig with its lasers as they are, and its axis as a ruler knows it."""
    known, wrong = doubted(true, LENGTH, ANGLE), wrong_rig(true, seed)
    assert known.covariance is not None
    table = [n.startswith("table.") for n in true.parameter_names]
    covariance = known.covariance * np.outer(table, table)
    return replace(true, T_camera_table=wrong.T_camera_table, covariance=covariance)


def _refined(
    true: Rig,
    part: Body,
    wrong: Rig,
    seed: int,
    sizes: tuple[tuple[float, float] | None, ...] | None,
) -> Refined | None:
    sweeps = both(true, part, STEPS, STEPS, seed, noise=NOISE, every=_EVERY)
    try:
        body = None if sizes is None else (Balls(), sizes)
        return refine(wrong, sweeps, RefineSettings(body=body))
    except CalibrationError as e:
        print(f"  seed {seed}: {e}", flush=True)
        return None


def _lines(true: Rig, done: list[Refined | None], way: str) -> list[Figure]:
    good = [d for d in done if d is not None]
    out = [
        Figure(f"rigs found, {way}", "all", f"{len(good)} of {len(done)}", len(good) == len(done))
    ]
    if not good:
        return out
    before = max(d.gap_before for d in good)
    gap = max(d.gap_after / d.gap_noise for d in good)
    told = f"{gap:.2f} (surfaces at first up to {before:.1f} mm apart)"
    out.append(Figure(f"overlap of two lasers, times the noise, {way}", "≤ 1.2", told, gap <= 1.2))
    seen = [_measured(true, d.rig, seed) for seed, d in enumerate(good)]
    form = max(f for _, f in seen)
    out.append(at_most(f"another ball, 95 % of its form, {way}", form, 0.05, "mm"))
    scale = max(abs(r / OTHER - 1) for r, _ in seen)
    if way != UNKNOWN:
        size = max((r - OTHER for r, _ in seen), key=abs)
        out.append(Figure("its radius", "", f"{size:+.3f} mm"))
    else:
        said = sum("scale" in d.held for d in good)
        told = f"{said} of {len(good)}, and it is {100 * scale:.0f} % off"
        out.append(Figure(f"scale is said to be unknown, {way}", "all", told, said == len(good)))
    return out


def _measured(true: Rig, rig: Rig, seed: int) -> tuple[float, float]:
    """Radius of another ball, and how far 95 % of its smoothed points are off roundness, mm.

    Without noise: the form that the rig makes, not the speckle of a single point.
    """
    sweeps: list[Sweep] = both(
        true, sphere((-8.0, 10.0, 20.0), OTHER), STEPS, STEPS, seed + 50, noise=0.0, every=_EVERY
    )
    clean = [replace(s, sigma=np.full(len(s.pixels), NOISE)) for s in sweeps]
    at: Floats = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in clean])
    found = fit_sphere(at)
    off = np.linalg.norm(at - found.centre, axis=1) - found.radius
    return found.radius, float(2 * np.quantile(np.abs(off), 0.95))


__all__ = ["figures"]
