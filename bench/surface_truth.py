"""Surfaces of simulated scans against truth: shadows, completeness, holes and their causes.

``python -m bench surface_truth`` prints every figure on the modern and the paper rig; ``--quick``
takes the paper rig alone, with few steps. ``python -m bench.surface_truth --keep FOLDER`` keeps the
simulated scans there and finds them again, ``--only PART`` prints one part's figures.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from bench import _hole_truth as truth
from bench import _keep
from turnscan import shapes, surface
from turnscan.arrays import Bools, Floats
from turnscan.detection import Detection, detect_scan
from turnscan.mesh import Mesh, sample_surface
from turnscan.pipeline import Reconstruction, build
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import (
    Bench,
    Material,
    SimCamera,
    SimLasers,
    SimTurntable,
    Simulated,
    SimulationSpec,
    World,
    bench,
)  # fmt: skip
from turnscan.stripes import StripeFlag
from turnscan.surface import TearLimits
from turnscan.surface.fusion import overlaps, range_surfaces
from turnscan.surface.holes import ClosingOptions
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file

NEAR = 0.2
"""mm: so close to the mesh a place of the part counts as measured."""
PRECISE = 0.3
"""mm: further from the part a place of the mesh was invented."""
SAMPLES = 20_000
PLACES = 15_000
"""Small triangles of the part that are asked."""
TWO_LINES = math.radians(22.4)
FLAT, EDGE = math.cos(TearLimits().grazing), math.cos(math.radians(89.5))
"""Cosines off face-on beyond which a place does not count as seen: by the rule of the tears, where
a pixel of the picture spans six on the part; and only where it cannot be seen at all."""
BESIDE = 3.0
"""mm."""
CAUSES = ("head", "cup", "bracket", "v-groove", "torus", "bust")
BLACK = 0.002
"""Reflectance of the painted squares, over that of the rest."""
PAINTED = Material((0.6, 0.6, 0.6), pattern="checks", pitch=12.0, pattern_ratio=BLACK)
LEANING = (
    ("bracket", 0.0, (0.0, -60.0), (40.0, 0.0)),
    ("bracket", 0.0, (0.0, -45.0), (35.0, -30.0)),
    ("bracket", 0.0, (0.0, 30.0), (-20.0, 0.0)),
    ("v-groove", 0.0, (-45.0, 0.0), (-45.0, -40.0)),
    ("torus", 90.0, (0.0, 0.0), (0.0, 30.0)),
)
"""Scene, tip and lean in degrees, shift in mm."""


@dataclass(frozen=True)
class Run:
    """One simulated scan, and what becomes of it, once it is asked for."""

    made: Bench
    steps: int
    seen: tuple[Detection, ...]

    @cached_property
    def both(self) -> Reconstruction:
        """With two lines."""
        return build(self.seen, Settings())

    @cached_property
    def one(self) -> Reconstruction:
        """With the first line alone."""
        return build(self.seen[:1], Settings())

    @cached_property
    def closed(self) -> Reconstruction:
        """With two lines, and its gaps closed."""
        return build(self.seen, Settings(caps=ClosingOptions()))

    @property
    def near(self) -> float:
        """mm: so close to the mesh a place of the part counts as measured: `NEAR`, or what the rig
        can tell.

        A centre that is right to half a pixel puts a point within half of what a pixel across the
        stripe is worth in depth, and between two profiles the chord lies inside the part by up to
        R (1 − cos(α/2)), with R its largest radius and α the step.
        """
        X = truth.made_mesh(self.made).vertices
        chord = float(np.hypot(X[:, 0], X[:, 1]).max()) * (1.0 - math.cos(math.pi / self.steps))
        return max(NEAR, 0.5 * truth.depth_of_a_pixel(self.made) + chord)


@dataclass(frozen=True)
class Size:
    """How much is simulated: table positions, of the head and the bust more than of the rest."""

    rig: str
    steps: int
    head: int = 100
    bust: int = 100
    mannequin: int = 100
    unseen: int = 80


def scanned(
    spec: SimulationSpec, folder: Path, paint: Material | None = None
) -> tuple[Bench, Path]:
    """A whole turn into a scan file, or the one that is there."""
    made = bench(spec)
    name = f"{spec.scene}-{spec.rig}-{spec.steps}"
    if spec.theta is not None:
        name += f"-{math.degrees(spec.theta):.0f}"
    if spec.lasers == 1:
        name += "-one"
    if any(spec.lean) or spec.tip or any(spec.shift):
        turns = (math.degrees(a) for a in (spec.tip, *spec.lean))
        name += "-posed-" + ",".join(f"{v:.0f}" for v in (*turns, *spec.shift))
    if paint is not None:
        first = replace(made.scene.bodies[0], material=paint)
        scene = replace(made.scene, bodies=(first, *made.scene.bodies[1:]))
        made, name = replace(made, scene=scene), name + f"-painted-{paint.pattern}-{paint.halo:g}"
    if spec.seed:
        name += f"-seed-{spec.seed}"
    path = folder / f"{name}.turnscan"
    if not path.exists():
        world = World(made)
        devices = Simulated(spec, world, SimCamera(world), SimTurntable(world), SimLasers(world))
        scan_into_file(devices, plan_of(devices), path, "sparse")
    return made, path


def reconstructed(spec: SimulationSpec, folder: Path, paint: Material | None = None) -> Run:
    """The scan of a spec, and what its stripes are."""
    made, path = scanned(spec, folder, paint)
    with Scan.open(path) as scan:
        seen = detect_scan(scan, made.rig, Settings().stripes)
    return Run(made, spec.steps or 0, tuple(seen))


def places(made: Bench) -> truth.Patches:
    """Small triangles of the part, every so many in their own order: evenly over all of it."""
    whole = truth.patches(made)
    every = max(1, len(whole.area) // PLACES)
    return whole.some(np.arange(0, len(whole.area), every, dtype=np.int32))


def visible(run: Run, some: truth.Patches, grazing: float, lines: int = 2) -> Bools:
    """(f,) which places the camera sees lit by one of the lines, at some table angle.

    What is seen or lit at less than the cosine ``grazing`` from face-on does not count.
    """
    made = replace(run.made, beams=run.made.beams[:lines])
    return np.asarray(truth.labels(made, some, run.steps, grazing) == truth.MEASURABLE)


def reference(run: Run, some: truth.Patches) -> str:
    """That the reference is the whole part: its area, and that all measured points lie on it."""
    from scipy.spatial import cKDTree

    area = float(truth.patches(run.made).area.sum())
    tree = cKDTree(some.middle[visible(run, some, truth.GRAZING[1])])
    X = np.concatenate([g.points[g.found] for g in run.both.grids])
    away = np.asarray(tree.query(X[:: max(1, len(X) // SAMPLES)])[0])
    on = float((away < 4 * truth.FINE).mean())
    whole = truth.made_mesh(run.made).area_of()
    return f"{area:.0f} of {whole:.0f} mm², {on:.2%} of the measured points lie on what it shows"


def covered(mesh: Mesh, some: truth.Patches, which: Bools, near: float) -> float:
    """Share of the area of patches that has the mesh within ``near`` mm, turned the same way."""
    at = some.some(np.flatnonzero(which).astype(np.int32))
    if not len(at.area) or not len(mesh.faces):
        return math.nan
    found = shapes.deviation(at.middle, mesh)
    t = mesh.triangles[found.face]
    flat = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    good = (np.abs(found.distance) < near) & (np.einsum("ij,ij->i", flat, at.normal) > 0)
    return float(at.area[good].sum() / at.area.sum())


def precision(run: Run, mesh: Mesh, limit: float) -> float:
    """Share of the mesh's area within ``limit`` mm of the part."""
    at = sample_surface(mesh, SAMPLES)[0]
    return shapes.deviation(at, truth.made_mesh(run.made)).within(limit)


def agreement(done: Reconstruction) -> Floats:
    """(m,) combined sigma between two lasers, at places that both measured."""
    parts = [s for g in done.grids for s in range_surfaces(g, surface.TearLimits())]
    return np.concatenate([np.zeros(0), *(o.ratios for o in overlaps(parts))])


def agreed(done: Reconstruction) -> str:
    """How many of these places lie within 1, 2, 3 combined sigma."""
    ratios = agreement(done)
    shares = ", ".join(f"{np.mean(ratios <= k):.1%}" for k in (1, 2, 3))
    return (
        f"two lasers within 1, 2, 3 sigma: {shares} of {len(ratios)} places "
        "(Gauss: 68, 95, 99.7 %; wanted at 2: 90 to 99 %)"
    )


def two_lines(size: Size, folder: Path) -> None:
    """The heads with one line and with two."""
    for scene, steps in (("head", size.head), ("mannequin", size.mannequin)):
        theta = TWO_LINES if size.rig == "modern" else None
        run = reconstructed(
            SimulationSpec(scene, size.rig, theta=theta, lasers=2, steps=steps), folder
        )
        some, near = places(run.made), run.near
        total = float(truth.patches(run.made).area.sum())
        print(
            f"{scene}, {size.rig} (true rig), {steps} steps, ±22.4°; "
            f"reference: {reference(run, some)}"
        )
        either = visible(run, some, FLAT)
        # What looks up or down is seen flatly for that, and from whichever side.
        wall = np.abs(some.normal[:, 2]) < 0.5
        for limit, word in (
            (FLAT, "seen by the second line, by the first beyond 80° from face-on at best"),
            (EDGE, "seen by the second line, by the first not at all"),
        ):
            shadow = either & wall & ~visible(run, some, limit, lines=1)
            area = total * some.area[shadow].sum() / some.area.sum()
            if area == 0.0:
                print(f"  {word}: nothing")
                continue
            one, two = (
                f"{covered(done.mesh, some, shadow, near):.1%} and leaves holes of "
                f"{holes_beside(done, some.middle[shadow]):.0f} mm²"
                for done in (run.one, run.both)
            )
            print(
                f"  {word}: {area:.0f} mm²: one line covers {one} there at {near:.2f} mm, two {two}"
            )
        whole = covered(run.both.mesh, some, either, near)
        print(f"  completeness at {near:.2f} mm of what either sees: {whole:.2%} (wanted: 99 %)")
        print(f"  {agreed(run.both)}")


def holes_beside(done: Reconstruction, X: Floats) -> float:
    """Area, mm², of the holes most of whose border lies within `BESIDE` of places X (m, 3)."""
    from scipy.spatial import cKDTree

    mesh, tree = done.opened or done.mesh, cKDTree(X)
    away = [np.asarray(tree.query(mesh.vertices[h.loop])[0]) for h in done.holes]
    near = [(a < BESIDE).mean() > 0.5 for a in away]
    return sum(h.area for h, there in zip(done.holes, near, strict=True) if there)


def halo(size: Size, folder: Path) -> None:
    """The bust, whose stone glows, beside the same stone without glow in half the steps."""
    for glow, steps in ((None, size.bust), (0.0, size.bust // 2)):
        spec = SimulationSpec("bust", size.rig, lasers=2, steps=steps)
        paint = None
        if glow is not None:
            paint = replace(bench(spec).scene.bodies[0].material, halo=glow)
        run = reconstructed(spec, folder, paint)
        flags = np.concatenate([g.flags[g.found] for g in run.both.grids])
        share = float(((flags & StripeFlag.HALO) != 0).mean())
        limit = PRECISE / NEAR * run.near
        exact = precision(run, run.both.mesh, limit)
        word = "with halo" if glow is None else "without"
        print(
            f"bust {word}, {size.rig}, {steps} steps: {share:.1%} of the points flagged HALO; "
            f"precision at {limit:.2f} mm {exact:.2%} (wanted: 99.5 %)"
        )
        print(f"  {agreed(run.both)}")


def causes(size: Size, folder: Path) -> tuple[int, int]:
    """The table of true causes against those named, one and two lines; right and known holes."""
    runs = []
    for scene in CAUSES:
        steps = size.bust if scene == "bust" else size.steps
        spec = SimulationSpec(scene, size.rig, lasers=2, steps=steps)
        runs.append((scene, reconstructed(spec, folder)))
    spec = SimulationSpec("sphere", size.rig, lasers=2, steps=size.steps)
    runs.append(("sphere painted", reconstructed(spec, folder, PAINTED)))
    return _told(runs, f"{size.rig}, {size.steps} steps")


def unseen(size: Size, folder: Path) -> tuple[int, int]:
    """The same for scans that the rules were not made with: leaning parts, and another seed."""
    runs = []
    for scene, tip, lean, shift in LEANING:
        a, b = lean
        spec = SimulationSpec(
            scene, size.rig, lasers=2, steps=size.unseen,
            tip=math.radians(tip), lean=(math.radians(a), math.radians(b)), shift=shift,
        )  # fmt: skip
        runs.append((f"{scene} leaning", reconstructed(spec, folder)))
    spec = SimulationSpec("sphere", size.rig, lasers=2, steps=size.unseen, seed=2)
    runs.append(("sphere painted, seed 2", reconstructed(spec, folder, PAINTED)))
    return _told(runs, f"{size.rig}, {size.unseen} steps, not looked at before")


def _told(runs: Sequence[tuple[str, Run]], conditions: str) -> tuple[int, int]:
    table: Counter[tuple[str, str]] = Counter()
    for scene, run in runs:
        for lines, done in ((1, run.one), (2, run.both)):
            mine = hole_table(run, done, lines)
            right, known = score(mine)
            line = f"{lines} line" + "s" * (lines - 1)
            print(f"  {scene}, {line}: {len(done.holes)} holes, {known} known, {right} right")
            table += mine
    # Tears and single points outnumber the rest, and are the easier ones.
    rest = Counter({pair: n for pair, n in table.items() if pair[0] != "removed"})
    for word, some in (("all", table), ("other than removed", rest)):
        right, known = score(some)
        print(f"hole causes, true rig, {conditions}, {word}: {right} of {known} right "
              f"({right / max(known, 1):.1%}; wanted: 95 %)")  # fmt: skip
    for (true, named), n in sorted(table.items()):
        print(f"  truly {true:<12} named {named:<10} {n:>5}")
    return score(table)


def hole_table(run: Run, done: Reconstruction, lines: int) -> Counter[tuple[str, str]]:
    """How often a true cause was called by each name; holes whose cause is not clear are left out.

    ``lines`` is how many lasers the mesh was made with.
    """
    made = replace(run.made, beams=run.made.beams[:lines])
    true = truth.true_causes(made, run.steps, done.mesh, done.holes)
    return Counter(("/".join(t), h.cause or "") for t, h in zip(true, done.holes, strict=True) if t)


def score(table: Counter[tuple[str, str]]) -> tuple[int, int]:
    """Right and known holes of a table."""
    right = sum(n for (true, named), n in table.items() if named in true.split("/"))
    return right, sum(table.values())


PARTS = {"lines": two_lines, "halo": halo, "causes": causes, "unseen": unseen}
"""What is measured, by name."""


def run(quick: bool = False, keep: Path | None = None, only: str | None = None) -> None:
    """Print all figures, or those of one part."""
    sizes = [Size("modern", 120, 400, 200, 120), Size("paper", 200, 200, 200, 200)]
    sizes = [Size("paper", 48, 100, 48, 100, 48)] if quick else sizes
    with _keep.folder(keep) as folder:
        for size in sizes:
            for name, part in PARTS.items():
                if only in (None, name):
                    part(size, folder)


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the paper rig with 48 steps")
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--only", choices=list(PARTS), help="this part alone")
    given = parser.parse_args()
    run(given.quick, given.keep, given.only)


if __name__ == "__main__":
    main()
