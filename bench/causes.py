"""Causes of holes against truth, by the area that is missing: ``python -m bench causes``.

Simulated scans of parts that stand, lean and lie, on the paper's rig, each with one line and with
two. For every hole the simulator says which cause hinders the most of the part's surface that is
missing there (`bench._hole_truth`), and a hole is right where it bears that name; it counts with
its missing area, whether its cause is clear or mixed. ``python -m bench.causes --write`` puts the
table of the held-out scenes into docs/explain/surface.md. ``--keep FOLDER`` keeps the scans there
and finds them again,
``--only made`` and ``--only held`` take one set of scenes, ``--light assumed`` measures without the
place of the light, ``--light moved`` with a wrong one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bench import _hole_truth as truth
from bench import _keep, _page
from bench._cause_scenes import HELD_OUT, MADE_WITH, Scene
from bench.surface_truth import Run, scanned
from turnscan.arrays import Bools, Floats, Ints
from turnscan.detection import detect_scan
from turnscan.mesh import Mesh
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import Bench
from turnscan.surface.holes import Cause, Hole

RIG = "paper"
ASKED = 5_000
"""Missing triangles of a scan that are asked, about."""
_TELLS = 1 / 6
"""Part of a hole for which its second name alone must be right: half of what it claims."""
PAGE = _page.DOCS / "explain" / "surface.md"


@dataclass(frozen=True)
class Share:
    """How much of the missing area bears the right name; mm²."""

    missing: float = 0.0
    """Of the part's surface, beside any hole."""
    right: float = 0.0
    """In holes that bear the name of the most of it first."""
    either: float = 0.0
    """In holes that bear it first or second, …"""
    two: float = 0.0
    """… in those that have two names at all, …"""
    second: float = 0.0
    """… and in those of them of which the second alone is right for a sixth at least."""
    places: float = 0.0
    """Where a name of the hole is right at the place itself."""
    taken: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Missing area by the true cause of the most of its hole and by the name."""

    def __add__(self, other: Share) -> Share:
        return Share(
            self.missing + other.missing,
            self.right + other.right,
            self.either + other.either,
            self.two + other.two,
            self.second + other.second,
            self.places + other.places,
            self.taken + other.taken,
        )

    def cells(self) -> tuple[str, ...]:
        """For a table: area, and the shares."""
        whole = max(self.missing, 1e-9)
        return f"{self.missing:.0f}", *(
            f"{100 * some / whole:.1f}" for some in (self.right, self.either, self.two, self.places)
        )


@dataclass(frozen=True)
class Missing:
    """What an open mesh lacks of the part beside its holes, and what hinders it, whatever the
    program says of that."""

    some: truth.Patches
    """Small triangles of it, evenly some."""
    owner: Ints
    """(f,) the hole that each is beside."""
    area: float
    """mm² of all for each mm² of these."""
    hindered: tuple[tuple[Ints, Bools], ...]
    """(f,) by what each is, and True for those that have a say, for both `LIMITS`."""

    @staticmethod
    def of(made: Bench, steps: int, mesh: Mesh, holes: Sequence[Hole]) -> Missing:
        """Ask the true part. A hole's names are not looked at."""
        true = truth.patches(made)
        gone, owner = truth.gaps(made, true, mesh, holes)
        few = np.arange(0, len(gone), max(1, len(gone) // ASKED))
        area = float(true.area[gone].sum()) / max(float(true.area[gone[few]].sum()), 1e-9)
        some = true.some(gone[few])
        labels = [truth.labels(made, some, steps, *limits) for limits in LIMITS]
        return Missing(
            some,
            owner[few],
            area,
            tuple((label, _say(made, some, label, steps)) for label in labels),
        )

    def share(self, holes: Sequence[Hole]) -> Share:
        """How much of it is in holes with the right cause, as these say.

        What counts as too flat, too faint or clipped has a lower and an upper limit
        (`bench._hole_truth`): a name is right that is right for half of the missing area, or for
        more of it than any other, under either.
        """
        some, owner = self.some, self.owner
        names = _numbers(h.cause for h in holes), _numbers(h.also for h in holes)
        right, placed = np.zeros((2, len(holes)), np.bool_), np.zeros(len(owner), np.bool_)
        told = np.zeros(len(holes), np.bool_)
        two = np.array([h.also is not None for h in holes], bool)
        word = np.zeros(len(holes), np.int32)
        for label, say in self.hindered:
            votes, total = _votes(some, owner, label, say, len(holes))
            word = np.argmax(votes, axis=1).astype(np.int32)
            best = votes.max(axis=1)
            new = (_RIGHT[label, names[1][owner]] > 0) & ~(_RIGHT[label, names[0][owner]] > 0)
            alone, all_of_it = (
                np.bincount(owner[m], some.area[m], len(holes)) for m in (say & new, say)
            )
            told |= two & (alone >= _TELLS * all_of_it) & (alone > 0)
            for k, name in enumerate(names):
                mine = np.where(name < 0, -1.0, votes[np.arange(len(holes)), name])
                right[k] |= (mine >= np.minimum(best - 1e-9, 0.5 * total)) & (best > 0)
                placed |= (_RIGHT[label, name[owner]] > 0) & (name[owner] >= 0)
        taken: Counter[tuple[str, str]] = Counter()
        lost = self.area * np.bincount(owner, some.area, len(holes))
        for k, h in enumerate(holes):
            said = str(h.cause)
            taken[said if right[0, k] else truth.NAMES[word[k]], said] += round(float(lost[k]))
        return Share(
            float(lost.sum()),
            float(lost[right[0]].sum()),
            float(lost[right.any(axis=0)].sum()),
            float(lost[two].sum()),
            float(lost[told].sum()),
            self.area * float(some.area[placed].sum()),
            taken,
        )


def _numbers(names: Iterable[Cause | None]) -> Ints:
    """(h,) of names of causes; −1 for those that the truth does not know, and for none."""
    known = [truth.NAMES.index(n) if n in truth.NAMES else -1 for n in names]
    return np.array(known, dtype=np.int32)


LIMITS = tuple(zip(truth.GRAZING, truth.FAINT, truth.CLIPPED, strict=True))
"""Lower and upper limits of what is too flat, too faint and clipped."""
_RIGHT: Floats = np.array(
    [[name in truth.RIGHT[label] for name in truth.NAMES] for label in truth.LABELS], np.float64
)


def _votes(
    some: truth.Patches, owner: Ints, label: Ints, say: Bools, holes: int
) -> tuple[Floats, Floats]:
    """(h, names) missing area by right name, and (h,) the area that has a say: what only the
    sampling left out has none where anything else has."""
    votes, total = np.zeros((2, holes, len(truth.NAMES))), np.zeros((2, holes))
    for k, which in enumerate((say, ~say)):
        np.add.at(votes[k], owner[which], some.area[which, None] * _RIGHT[label[which]])
        total[k] = np.bincount(owner[which], some.area[which], holes)
    silent = total[0] == 0
    return np.where(silent[:, None], votes[1], votes[0]), np.where(silent, total[1], total[0])


def _say(made: Bench, some: truth.Patches, label: Ints, steps: int) -> Bools:
    """(f,) as rule 4 of `bench._hole_truth`: not what is measurable beside what is not."""
    from scipy.spatial import cKDTree

    lost = label != truth.MEASURABLE
    if not lost.any():
        return np.ones(len(label), np.bool_)
    reach = truth.SAMPLES * truth.spacing(made, some.middle, steps) + truth.FINE
    away = np.asarray(cKDTree(some.middle[lost]).query(some.middle)[0])
    return np.asarray(lost | (away > reach))


def without_sources(rig: Rig) -> Rig:
    """The rig as a calibration knows it that was not told where the light comes from."""
    return replace(rig, sheets=tuple(replace(s, source=None) for s in rig.sheets))


def moved_sources(rig: Rig) -> Rig:
    """The rig with its light a quarter nearer to the axis and 60 mm higher than it is."""
    T, sheets = rig.T_camera_table, []
    for s in rig.sheets:
        at = T.inverse().apply(rig.light_source(s.name)) * (0.75, 0.75, 1.0) + (0.0, 0.0, 60.0)
        sheets.append(replace(s, source=T.apply(at)))
    return replace(rig, sheets=tuple(sheets))


LIGHT: Mapping[str, Callable[[Rig], Rig]] = {
    "known": lambda rig: rig,
    "assumed": without_sources,
    "moved": moved_sources,
}
"""What is believed of the place of the light."""


def shares(scene: Scene, folder: Path, light: str = "known") -> tuple[Share, Share]:
    """Of one scene, with one line and with two."""
    made, path = scanned(scene.spec(RIG, folder), folder, scene.paint)
    rig = LIGHT[light](made.rig)
    with Scan.open(path) as scan:
        run = Run(made, scene.steps, tuple(detect_scan(scan, rig, Settings().stripes)))
    out = []
    for lines, done in ((1, run.one), (2, run.both)):
        lit = replace(made, beams=made.beams[:lines])
        missing = Missing.of(lit, scene.steps, done.opened or done.mesh, done.holes)
        out.append(missing.share(done.holes))
    return out[0], out[1]


_SHARES = "in holes named right, % | by either name, % | with two names, % | right at the place, %"
HEAD = (
    f"| part | one line: missing mm² | {_SHARES} | two lines: missing mm² | {_SHARES} |",
    "|---|---|---|---|---|---|---|---|---|---|---|",
)


SETS = {"made": MADE_WITH, "held": HELD_OUT}


def run(
    keep: Path | None = None, only: str | None = None, light: str = "known", write: bool = False
) -> None:
    """Print the tables and what was taken for what."""
    with _keep.folder(keep) as folder:
        for word, scenes in SETS.items():
            if only not in (None, word):
                continue
            rows, whole, said = list[str](), Share(), ""
            for scene in scenes:
                one, two = shares(scene, folder, light)
                rows.append(f"| {scene} | {' | '.join(one.cells())} | {' | '.join(two.cells())} |")
                print(rows[-1], flush=True)
                whole += one + two
                part = [
                    f"{some / whole.missing:.1%}"
                    for some in (whole.right, whole.either, whole.two, whole.places)
                ]
                said = (
                    f"{part[0]} of {whole.missing:.0f} mm² of hole bears the right name first, "
                    f"{part[1]} first or second; {part[2]} has two names, and of "
                    f"{whole.second / max(whole.two, 1e-9):.0%} of that the second name alone is "
                    f"right for a sixth or more; at the place itself a name of {part[3]} is right."
                )
                if write and word == "held":
                    _page.write(PAGE, f"causes {word}", [*HEAD, *rows, "", said])
            print(f"{word}, light {light}: {said} Wanted: 95 %")
            for (true, named), area in sorted(whole.taken.items()):
                print(f"  truly {true:<10} named {named:<10} {area:>9} mm²")


def main() -> None:
    """Parse the options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--only", choices=list(SETS), help="this set of scenes alone")
    parser.add_argument("--light", choices=list(LIGHT), default="known", help="its believed place")
    parser.add_argument("--write", action="store_true", help="put the tables into the documents")
    given = parser.parse_args()
    run(given.keep, given.only, given.light, given.write)


if __name__ == "__main__":
    main()
