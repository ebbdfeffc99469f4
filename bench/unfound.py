"""What a scan knows of faces that `bench.shapes` does not find: ``python -m bench.unfound``.

On the paper's rig, 200 steps a turn, these are the tips of the gear's teeth, the floors of the
plate's grooves, and one flank of the V-groove. Told is how many points and stripes lie where the
part has the face, how many of the points are on it, within 0.1 mm, how far they are off it on
average, and what they claim to be known to. ``--keep FOLDER`` keeps the scans and finds them again;
``--write`` puts the table into the page; ``--steps`` takes another number of steps.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import _keep
from bench._page import MEASURED, measured, put
from bench.shapes import PAGE, STEPS, Task, found_on, placed
from turnscan.arrays import Bools, Floats

ON = 0.1
"""mm: what lies so near a face is on it."""
_ENDS = 3.0
"""mm at the ends of the parts that are left out."""
HEAD = (
    "| part | face | wide mm | points there | stripes across each | on it | their mean off µm "
    f"| σ µm | {MEASURED} |",
    "|---|---|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Face:
    """A face of a part, or several that are alike."""

    part: str
    name: str
    wide: float
    """mm across stripes."""
    many: int
    there: Callable[[Floats], Bools]
    """Which points (n, 3) mm of the part's frame lie where it is."""
    off: Callable[[Floats], Floats]
    """(n,) mm: how far they lie off its plane, outward."""


def _tooth(X: Floats) -> tuple[Floats, Floats]:
    """Angle (n,) of points off the middle of the nearest tooth of the gear, and their radius mm."""
    pitch = 2 * np.pi / 20
    turn = np.arctan2(X[:, 1], X[:, 0]) - 0.5 * pitch
    return turn - pitch * np.round(turn / pitch), np.hypot(X[:, 0], X[:, 1])


def _within(z: Floats, height: float) -> Bools:
    return np.asarray((z > _ENDS) & (z < height - _ENDS))


def _on_tips(X: Floats) -> Bools:
    return (np.abs(_tooth(X)[0]) < _TIP) & _within(X[:, 2], 30.0)


def _off_tips(X: Floats) -> Floats:
    turn, r = _tooth(X)
    return np.asarray(r * np.cos(turn) - 33.0 * np.cos(_TIP))


def _in_groove(at: float, width: float) -> Callable[[Floats], Bools]:
    def there(X: Floats) -> Bools:
        return np.asarray(
            (np.abs(X[:, 1] - at) < width / 2) & _within(X[:, 2], 80.0) & (X[:, 0] > 5.0)
        )

    return there


def _off_floor(X: Floats) -> Floats:
    return np.asarray(X[:, 0] - 9.0)


def _on_flank(X: Floats) -> Bools:
    return np.asarray(
        (X[:, 1] < 0.0) & (X[:, 1] > -15.0) & _within(X[:, 2], 80.0) & (X[:, 0] > 9.0)
    )


def _off_flank(X: Floats) -> Floats:
    return np.asarray((X[:, 0] - 10.0 + X[:, 1]) / np.sqrt(2.0))


_TIP = 0.16 * 2 * np.pi / 20
"""Half the angle of a tip."""
FACES = (
    *(
        Face("grooves", f"floor of a groove of {w:g} mm", w, 1, _in_groove(at, w), _off_floor)
        for at, w in ((-15.0, 2.0), (0.0, 1.0), (15.0, 0.5))
    ),
    Face("v-groove", "left flank", 15.0 * np.sqrt(2.0), 1, _on_flank, _off_flank),
    Face("gear", "tip of a tooth", 2 * 33.0 * np.sin(_TIP), 20, _on_tips, _off_tips),
)


def rows_of(part: str, steps: int, folder: Path) -> list[str]:
    """The lines of a part's faces, after a scan."""
    f = found_on(Task(part, steps=steps), folder)
    known = f.mesh.provenance
    assert known is not None
    taken = known.step >= 0
    X = placed(f).apply(f.mesh.vertices[taken])
    sigma, step = known.sigma[taken], known.step[taken]
    out = list[str]()
    for face in (face for face in FACES if face.part == part):
        there = face.there(X)
        off = face.off(X)[there]
        on = np.abs(off) < ON
        stripes = len(np.unique(step[there])) / face.many
        mean = f"{1e3 * off.mean():+.0f}" if len(off) else ""
        usual = f"{1e3 * float(np.median(sigma[there])):.0f}" if len(off) else ""
        out.append(
            f"| {part} | {face.name} | {face.wide:.1f} | {len(off)} | {stripes:.1f} "
            f"| {int(on.sum())} | {mean} | {usual} |"
        )
    return measured(out, f"{steps} steps")


def main() -> None:
    """Scan the parts and tell what is known of these faces."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help="grooves, v-groove, gear")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--keep", type=Path, help="folder of the simulated scans")
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    args = parser.parse_args()
    print("\n".join(HEAD))
    with _keep.folder(args.keep) as folder:
        for part in args.parts or dict.fromkeys(face.part for face in FACES):
            rows = rows_of(part, args.steps, folder)
            print("\n".join(rows), flush=True)
            if args.write:
                order = tuple(dict.fromkeys(face.part for face in FACES))
                put(PAGE, "shapes-unfound", [*HEAD, *rows], 2, order)


if __name__ == "__main__":
    main()
