"""Points and merged surfaces of shapes that no rule was made with, against the shapes themselves.

``python -m bench foreign`` scans 26 random shapes (displaced balls, twisted prisms, parts put
together of boxes, cylinders and balls, and parts off a lathe, with collars, grooves and threads;
all drawn by seeds used nowhere else) and the parts of other people that lie in
``../shared/data/parts``, on both rigs with two lasers and 60 and 160 steps, the rig exactly known.
``--quick`` takes the paper's rig with 60 steps. ``--write`` puts each row into
docs/explain/accuracy.md as it is measured, with its commit; the others stay. ``python -m
bench.foreign --keep FOLDER`` keeps the simulated scans there and finds them again, ``--only KIND
…`` takes these random shapes alone, ``--each 2`` the first two of each kind and no parts of other
people, ``--seeds 203 212`` those of each kind, also such as are drawn for nothing else, ``--rigs``
and ``--steps`` some of those.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from bench import _hole_truth as truth
from bench import _keep, _page
from bench._cause_scenes import FORMS
from bench._page import MEASURED
from bench.surface_truth import FLAT, Run, covered, places, scanned, visible
from turnscan import shapes
from turnscan.arrays import Floats
from turnscan.detection import detect_scan
from turnscan.formats import read_mesh, write_stl
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh, cut_touching, longest_sides
from turnscan.points import RangeGrid, normal_sigma
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import SimulationSpec
from turnscan.surface._noise import spacing
from turnscan.surface.clean import drop_islands
from turnscan.surface.fusion import merge

DATA = Path(__file__).parents[2] / "shared" / "data" / "parts"
TALL, WIDE = 70.0, 56.0
"""mm: so high and wide at most are the parts of other people made."""
FIRST = 201
SHAPES = (
    *(("displaced-ball", seed) for seed in range(FIRST, FIRST + 7)),
    *(("twisted-prism", seed) for seed in range(FIRST, FIRST + 6)),
    *(("put-together", seed) for seed in range(FIRST, FIRST + 7)),
    *(("turned", seed) for seed in range(FIRST, FIRST + 6)),
)
RIGS, STEPS = ("paper", "modern"), (60, 160)
HEAD = (
    "| shape, rig | steps | points | beyond 3 σ % | beyond 6 σ + half | rms / σ "
    "| merged | beyond 3 σ % | beyond 6 σ + half | rms / σ | worst mm | complete % "
    f"| {MEASURED} |",
    "|" + "---|" * 13,
)


def put_together(draw: np.random.Generator) -> Mesh:
    """A base with three to five solids on it or cut out of it."""
    from manifold3d import Manifold

    whole = Manifold.cylinder(14.0, 24.0, draw.uniform(14.0, 24.0), int(draw.choice([6, 8, 180])))
    for _ in range(int(draw.integers(3, 6))):
        kind, size = draw.integers(3), draw.uniform(8.0, 22.0, 3)
        tool = (
            Manifold.cube(tuple(size), True),
            Manifold.cylinder(2 * size[0], size[1] / 2, size[2] / 2, 120, True),
            Manifold.sphere(size[0] / 1.6, 120),
        )[kind]
        at = (*draw.uniform(-15.0, 15.0, 2), draw.uniform(10.0, 36.0))
        tool = tool.rotate(tuple(draw.uniform(-60.0, 60.0, 3))).translate(at)
        whole = whole - tool if draw.random() < 0.4 else whole + tool
    biggest = max(whole.decompose(), key=lambda piece: piece.volume())
    made = biggest.to_mesh()
    return Mesh(np.array(made.vert_properties[:, :3], np.float64), np.array(made.tri_verts))


def turned(draw: np.random.Generator) -> Mesh:
    """A part off a lathe: some lengths, plain, conical, with collars, grooves or a thread."""
    profile = list[tuple[float, float, float]]()  # height, radius, how deep a thread is cut
    z, r, pitch = 0.0, draw.uniform(13.0, 20.0), draw.uniform(2.0, 3.5)
    for _ in range(int(draw.integers(3, 7))):
        kind, long = draw.integers(5), draw.uniform(7.0, 15.0)
        ends, height, count = (z, r), draw.uniform(0.6, 2.0), int(draw.integers(1, 4))
        if kind == 1:
            r = float(np.clip(r + draw.uniform(-6.0, 6.0), 9.0, 22.0))
        profile += [(*ends, 0.0), (z + long, r, 0.0)]
        if kind in (2, 3):
            depth = height if kind == 2 else -height
            wide = long / (2 * count + 1)
            for k in range(count):
                low = z + (2 * k + 1) * wide
                at = (low, r), (low, r + depth), (low + wide, r + depth), (low + wide, r)
                profile[-1:-1] = [(*place, 0.0) for place in at]
        elif kind == 4:
            places = np.linspace(z, z + long, int(long / 0.2))[1:-1]
            cut = 0.6 * pitch * np.minimum(1.0, 0.5 * np.minimum(places - z, z + long - places))
            profile[-1:-1] = [(at, r, deep) for at, deep in zip(places, cut, strict=True)]
        z += long
        r = float(np.clip(r + draw.uniform(-4.0, 4.0), 9.0, 22.0))
    return _revolved(np.array(profile), pitch)


def _revolved(profile: Floats, pitch: float) -> Mesh:
    """The solid of a profile (n, 3), upwards: height, radius and depth of a thread, mm."""
    count, around = len(profile), 360
    turn = np.linspace(0.0, 1.0, around, endpoint=False)
    z, r, deep = profile.T[:, :, None]
    r = r - deep * np.abs((z / pitch - turn) % 1.0 - 0.5) * 2.0
    ring = np.stack([r * np.cos(2 * np.pi * turn), r * np.sin(2 * np.pi * turn), z + 0 * turn], -1)
    ends = np.array([[0.0, 0.0, profile[0, 0]], [0.0, 0.0, profile[-1, 0]]])
    a = np.arange(count * around).reshape(count, around)
    b = np.roll(a, -1, axis=1)
    low, high = np.full(around, count * around), np.full(around, count * around + 1)
    faces = np.concatenate([
        np.stack([a[:-1], b[:-1], b[1:]], -1).reshape(-1, 3),
        np.stack([a[:-1], b[1:], a[1:]], -1).reshape(-1, 3),
        np.stack([b[0], a[0], low], -1),
        np.stack([a[-1], b[-1], high], -1),
    ])  # fmt: skip
    return Mesh(np.concatenate([ring.reshape(-1, 3), ends]), faces)


def others(folder: Path) -> Iterator[tuple[str, Path]]:
    """The closed meshes of other people, made to fit on the table, written into the folder."""
    from turnscan.mesh import is_closed

    for path in sorted(DATA.glob("*")) if DATA.exists() else ():
        if path.suffix.lower() not in (".stl", ".ply"):
            continue
        mesh = read_mesh(path.read_bytes(), path.suffix)
        if not is_closed(mesh):
            continue
        size = np.ptp(mesh.vertices, axis=0)
        scale = min(WIDE / float(np.hypot(*size[:2])), TALL / float(size[2]))
        middle = mesh.vertices.min(axis=0) + size / 2
        out = folder / f"{path.stem}.stl"
        out.write_bytes(write_stl(Mesh((mesh.vertices - middle) * scale, mesh.faces)))
        yield path.stem, out


def drawn(name: str, seed: int, folder: Path) -> Path:
    """The file of a random shape."""
    path = folder / f"{name}-{seed}.stl"
    if not path.exists():
        draw = np.random.default_rng(seed)
        made = {**FORMS, "put-together": put_together, "turned": turned}[name]
        path.write_bytes(write_stl(made(draw)))
    return path


@dataclass(frozen=True)
class Errors:
    """How places that were measured lie to the shape."""

    off: Floats
    """(n,) mm."""
    sigma: Floats
    """(n,) mm, as the program claims it."""
    half: Floats
    """(n,) mm: half of the spacing there."""

    @property
    def beyond(self) -> float:
        """Share beyond three sigma."""
        return float((self.off > 3 * self.sigma).mean())

    @property
    def invented(self) -> int:
        """Places beyond six sigma and half the spacing."""
        return int((self.off > 6 * self.sigma + self.half).sum())

    @property
    def ratio(self) -> float:
        """rms of error over sigma."""
        return float(np.sqrt(np.mean((self.off / self.sigma) ** 2)))

    def cells(self) -> tuple[str, ...]:
        """For a table."""
        return (
            str(len(self.off)), f"{100 * self.beyond:.2f}", str(self.invented),
            f"{self.ratio:.2f}",
        )  # fmt: skip


def together(parts: Sequence[Errors]) -> Errors:
    """Of all places."""
    return Errors(
        *(np.concatenate([getattr(e, name) for e in parts]) for name in ("off", "sigma", "half"))
    )


def of_points(grids: Sequence[RangeGrid], part: Mesh) -> Errors:
    """The points of grids that nothing merged."""
    some = []
    for g in grids:
        at = g.found
        off = np.abs(shapes.deviation(g.points[at], part).distance)
        some.append(Errors(off, normal_sigma(g)[at], np.maximum(*spacing(g))[at] / 2))
    return together(some)


def of_mesh(mesh: Mesh, part: Mesh) -> Errors:
    """The vertices of a merged surface. Raises ValueError for one without sigma."""
    if mesh.provenance is None:
        raise ValueError("the mesh does not know its sigma")
    off = np.abs(shapes.deviation(mesh.vertices, part).distance)
    return Errors(off, mesh.provenance.sigma, longest_sides(mesh) / 2)


@dataclass(frozen=True)
class Row:
    """One shape on one rig."""

    name: str
    steps: int
    single: Errors
    merged: Errors
    complete: float

    def line(self) -> str:
        """For the table."""
        cells = (
            self.name, str(self.steps), *self.single.cells(), *self.merged.cells(),
            f"{max(self.merged.off, default=np.nan):.2f}", f"{100 * self.complete:.1f}",
        )  # fmt: skip
        return f"| {' | '.join(cells)} |"


def row(spec: SimulationSpec, name: str, folder: Path) -> Row:
    """Scan a shape and hold what was measured against it."""
    made, path = scanned(spec, folder)
    with Scan.open(path) as scan:
        seen = tuple(detect_scan(scan, made.rig, Settings().stripes))
    grids = to_grids(seen, Settings()).grids
    part = truth.made_mesh(made)
    mesh, _ = merge(grids)
    mesh, _ = cut_touching(mesh)
    mesh, _, _ = drop_islands(mesh, None, grids)
    run = Run(made, spec.steps or 0, seen)
    some = places(made)
    complete = covered(mesh, some, visible(run, some, FLAT, spec.lasers or 1), run.near)
    return Row(name, spec.steps or 0, of_points(grids, part), of_mesh(mesh, part), complete)


def rows(
    rigs: Sequence[str],
    steps: Sequence[int],
    folder: Path,
    only: Sequence[str] = (),
    seeds: Sequence[int] = (),
) -> Iterator[Row]:
    """All shapes on each rig, or the random ones of some kinds and ``seeds``."""
    kinds = dict.fromkeys(name for name, _ in SHAPES if not only or name in only)
    some = product(kinds, seeds) if seeds else (s for s in SHAPES if s[0] in kinds)
    every = [(f"{name} {seed}", drawn(name, seed, folder)) for name, seed in some]
    every += [] if only or seeds else others(folder)
    for rig, count, (name, path) in product(rigs, steps, every):
        spec = SimulationSpec(str(path), rig, lasers=2, steps=count)
        one = row(spec, f"{name}, {rig}", folder)
        if len(one.single.off):
            yield one
        else:  # a flat plate, made to fit, is lower than the platter's margin
            print(f"{one.name}, {count} steps: no point was measured; it does not count")


def said(found: Sequence[Row]) -> str:
    """What all rows come to."""
    single, merged = together([r.single for r in found]), together([r.merged for r in found])
    return (
        f"Of all {len(found)} scans: {100 * single.beyond:.2f} % of {len(single.off)} single points"
        f" and {100 * merged.beyond:.2f} % of {len(merged.off)} merged vertices beyond three sigma;"
        f" {single.invented} and {merged.invented} beyond six sigma and half the spacing; rms of"
        f" error over sigma {single.ratio:.2f} and {merged.ratio:.2f}; completeness"
        f" {100 * np.nanmean([r.complete for r in found]):.1f} %."
    )


def run(
    quick: bool = False,
    into_pages: bool = False,
    keep: Path | None = None,
    only: Sequence[str] = (),
    seeds: Sequence[int] = (),
    rigs: Sequence[str] = RIGS,
    steps: Sequence[int] = STEPS,
) -> None:
    """Print every row as it is measured, put it into the page, and print what they come to."""
    order = [f"{name} {seed}, {rig}" for rig in RIGS for name, seed in SHAPES]
    print("\n".join(HEAD))
    found = list[Row]()
    with _keep.folder(keep) as folder:
        rigs, steps = (RIGS[:1], STEPS[:1]) if quick else (rigs, steps)
        for one in rows(rigs, steps, folder, only, seeds):
            lines = _page.measured([one.line()], "rig known")
            print(lines[0], flush=True)
            found.append(one)
            if into_pages:
                _page.put(_page.ACCURACY, "foreign", [*HEAD, *lines], 2, order)
    print(said(found))


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the paper rig with 60 steps")
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    kinds = sorted({name for name, _ in SHAPES})
    parser.add_argument("--only", choices=kinds, nargs="+", default=(), help="of these kinds")
    parser.add_argument("--each", type=int, help="so many random shapes of each kind, no others")
    parser.add_argument("--seeds", type=int, nargs="+", default=(), help="shapes of these seeds")
    parser.add_argument("--rigs", choices=RIGS, nargs="+", default=RIGS, help="these rigs")
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="these steps a turn")
    given = parser.parse_args()
    seeds = given.seeds or range(FIRST, FIRST + (given.each or 0))
    run(given.quick, given.write, given.keep, given.only, seeds, given.rigs, given.steps)


if __name__ == "__main__":
    main()
