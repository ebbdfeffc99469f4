"""A trial of settings on an open scan: a few profiles and a patch of surface, before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.detection import Detection, View, views_of
from turnscan.edit import Entry
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.gridding import to_grids
from turnscan.mesh import Mesh
from turnscan.meshing import to_mesh
from turnscan.points import RangeGrid
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.surface import thin
from turnscan.surface.clean import drop_uncertain
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._session._mesh import Arrays
from turnscan.workflows._session._nothing import Left, nothing_made
from turnscan.workflows._surface._reconstruct import below_stored

_REACH = 12
"""Profiles on each side of the one at hand that the patch has."""
_LEAST = 2
"""Profiles on each side of any that is shown: clean-up and denoising look at neighbours."""
_PROFILES = 4
"""How many are shown: the one at hand, and others evenly round the part."""


@dataclass(frozen=True, eq=False)
class TriedProfile:
    """One profile with two settings."""

    step: int
    old: Floats
    """(n, 3) mm along the profile, NaN where it is torn."""
    new: Floats


@dataclass(frozen=True, eq=False)
class Trial:
    """What settings would make of a part of a scan; nothing is kept."""

    laser: str
    profiles: tuple[TriedProfile, ...]
    """The one at hand first."""
    old: Mesh
    """The patch as it is, without islands removed, and neither closed nor decimated."""
    new: Mesh
    distance: Floats
    """(v,) mm of each vertex of the new patch from the old one; NaN where that has nothing."""
    findings: tuple[Finding, ...]

    @property
    def arrays(self) -> Arrays:
        """By name: ``old.K`` and ``new.K`` (n, 3) of profile K; ``old.positions``, ``old.faces``,
        ``new.positions``, ``new.faces`` and ``new.distance`` of the patches."""
        out: Arrays = {"new.distance": self.distance}
        for k, one in enumerate(self.profiles):
            out |= {f"old.{k}": one.old, f"new.{k}": one.new}
        for name, mesh in (("old", self.old), ("new", self.new)):
            out |= {f"{name}.positions": mesh.vertices, f"{name}.faces": mesh.faces}
        return out


@dataclass(frozen=True, eq=False)
class Way:
    """One of the two: settings, and the stripes found with them."""

    options: ReconstructOptions
    settings: Settings
    """The same, with the rig."""
    find: Callable[[str, Longs], Detection | None]
    """The stripes of a laser in frames, by their places among those that were found."""


def found_before(seen: Sequence[Detection]) -> Callable[[str, Longs], Detection | None]:
    """Frames of what was seen already."""
    by_name = {d.view.laser: d for d in seen}

    def find(laser: str, rows: Longs) -> Detection | None:
        one = by_name[laser]
        wanted = {one.stripes.steps[k] for k in rows}
        gone = set(one.stripes.steps) - wanted
        return replace(one, stripes=one.stripes.without(gone), findings=()) if wanted else None

    return find


def found_anew(
    seen: Sequence[Detection], scan: Scan, rig: Rig, s: Settings, tick: Callable[[], None]
) -> Callable[[str, Longs], Detection | None]:
    """The same frames of the file, searched with other settings."""
    known = {d.view.laser: d.stripes.steps for d in seen}
    views: dict[str, View] = {v.laser: v for v in views_of(scan, rig, s.stripes, s.volume)}

    def find(laser: str, rows: Longs) -> Detection | None:
        steps = frozenset(known[laser][k] for k in rows)
        stripes, _ = views[laser].seek(tick, only=steps)
        return Detection(views[laser], stripes, ()) if stripes.steps else None

    return find


def tried(
    seen: Sequence[Detection],
    at: tuple[str, float],
    old: Way,
    new: Way,
    edits: Sequence[Entry],
    scan: Scan,
    check: Callable[[], None],
) -> Trial:
    """Make the profile at hand, others, and the patch about it in two ways.

    ``seen`` is what was found last, ``at`` a laser and the angle of the profile at hand, rad;
    ``edits`` are those of the grid; ``check`` raises to end it. Where no face is left of the new
    patch, the first finding says why. Raises InputError where the new settings cannot be.
    """
    laser, angle = at
    main = next(d for d in seen if d.view.laser == laser)
    angles = main.stripes.angles
    if not len(angles):
        raise InputError("no stripe was found in any picture", hint="choose other settings")
    middle = int(np.argmin(np.abs(_apart(angles, angle))))
    count = len(angles)
    several = np.unique((middle + np.arange(_PROFILES) * count // _PROFILES) % count)
    centres = [middle, *(int(k) for k in several if k != middle)]
    profiles = []
    for k in centres:
        check()
        pair = (_profile(way, main, k, edits) for way in (old, new))
        profiles.append(TriedProfile(main.stripes.steps[k], *pair))
    before, _ = _patch(old, seen, main, middle, edits)
    check()
    after, left = _patch(new, seen, main, middle, edits)
    check()
    distance = np.full(len(after.vertices), np.nan)
    if len(before.faces) and len(after.vertices):
        off = deviation(after.vertices, before)
        distance = np.where(off.beyond, np.nan, off.distance)
    said = below_stored(scan, new.settings.stripes.threshold)
    if not len(after.faces):
        said = [nothing_made(left, old.options, new.options), *said]
    return Trial(laser, tuple(profiles), before, after, distance, tuple(said))


def _apart(angles: Floats, angle: float) -> Floats:
    """Signed differences of angles, rad, −π to π."""
    return np.asarray(np.mod(angles - angle + np.pi, 2 * np.pi) - np.pi)


def _rows(s: Settings, middle: int, reach: int, count: int) -> Longs:
    """Places of the frames about one that these settings use; all of them where their light is
    followed from frame to frame."""
    whole = reach * s.every
    first, last = max(middle - whole, 0), min(middle + whole, count - 1)
    first += -first % s.every
    step = 1 if s.stripes.refine != "none" else s.every
    return np.arange(first, last + 1, step, dtype=np.int64)


def _of_part(s: Settings) -> Settings:
    """Settings for a part of a scan: what they say of the whole surface is left out."""
    every = s.every if s.stripes.refine != "none" else 1
    return replace(s, every=every, island=0, caps=None, tolerance=None, faces=None)


def _profile(way: Way, main: Detection, k: int, edits: Sequence[Entry]) -> Floats:
    """(n, 3) mm the profile nearest to frame k, NaN between pieces."""
    s = _of_part(way.settings)
    rows = _rows(way.settings, k, _LEAST, len(main.stripes.steps))
    grids = _grids(_found(way, main.view.laser, rows), s, edits)
    nearest: tuple[float, Floats] = np.inf, np.zeros((0, 3))
    for grid in grids:
        sure, _ = drop_uncertain(grid, s.largest_sigma)
        spaced = thin(sure, s.along, s.tears)
        if not len(spaced.angles):
            continue
        off = np.abs(_apart(spaced.angles, float(main.stripes.angles[k])))
        row = int(np.argmin(off))
        if off[row] < nearest[0]:
            nearest = float(off[row]), spaced.points[row]
    return nearest[1]


def _found(way: Way, laser: str, rows: Longs) -> list[Detection]:
    found = way.find(laser, rows)
    return [] if found is None else [found]


def _grids(found: Sequence[Detection], s: Settings, edits: Sequence[Entry]) -> list[RangeGrid]:
    return to_grids(found, s, edits).grids if found else []


def _patch(
    way: Way, seen: Sequence[Detection], main: Detection, middle: int, edits: Sequence[Entry]
) -> tuple[Mesh, Left]:
    """The surface about a frame: of its laser, and of the others where they see the same part.

    With what was left of its frames.
    """
    s = _of_part(way.settings)
    reach = max(_REACH // way.settings.every, _LEAST)
    rows = _rows(way.settings, middle, reach, len(main.stripes.steps))
    found = _found(way, main.view.laser, rows)
    grids = _grids(found, s, edits)
    sector = _azimuths(grids)
    for other in seen:
        if other is main or sector is None:
            continue
        mine = _in_sector(other, sector, way.settings, s, edits)
        beside = _found(way, other.view.laser, mine)
        found += beside
        grids += _grids(beside, s, edits)
    shown = sum(bool(stripe.found.any()) for d in found for stripe in d.stripes.stripes)
    there = [g for g in grids if g.found.any()]
    if not there:
        none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
        return none, Left.of(len(rows), shown, grids)
    made = to_mesh(there, s, (), rig=main.view.rig, finish=False)
    return made.opened, Left.of(len(rows), shown, made.grids)


def _azimuths(grids: Sequence[RangeGrid]) -> tuple[float, float] | None:
    """Middle and half width, rad, of the part of the circle in which the points lie."""
    there = [g.points[g.found] for g in grids]
    points = np.concatenate(there) if there else np.zeros((0, 3))
    if not len(points):
        return None
    middle = float(np.arctan2(points[:, 1].sum(), points[:, 0].sum()))
    off = np.abs(_apart(np.arctan2(points[:, 1], points[:, 0]), middle))
    return middle, float(np.quantile(off, 0.9))


def _in_sector(
    other: Detection,
    sector: tuple[float, float],
    used: Settings,
    s: Settings,
    edits: Sequence[Entry],
) -> Longs:
    """The longest run of another laser's frames whose points lie in a part of the circle.

    Where a frame's points lie is known from some frames that were seen before.
    """
    count = len(other.stripes.steps)
    some = np.unique(np.linspace(0, count - 1, min(count, 24)).astype(np.int64))
    plain = replace(s, clean=None, denoise=None, between=None)
    known = found_before([other])(other.view.laser, some)
    placed = _grids([] if known is None else [known], plain, edits)
    shifts = [
        float(_apart(np.arctan2(p[:, 1].sum(), p[:, 0].sum())[None], -float(angle))[0])
        for g in placed
        for p, angle in zip((g.points[k][g.found[k]] for k in range(len(g.steps))), g.angles,
                            strict=True)
        if len(p)
    ]  # fmt: skip
    if not shifts:
        return np.zeros(0, np.int64)
    # The part turns under the sheet: points of a frame lie at a fixed azimuth less its angle.
    shift = float(np.angle(np.exp(1j * np.array(shifts)).sum()))
    inside = np.abs(_apart(shift - other.stripes.angles, sector[0])) <= sector[1]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    if not len(edges):
        return np.zeros(0, np.int64)
    first, last = max(edges.reshape(-1, 2).tolist(), key=lambda run: run[1] - run[0])
    step = 1 if used.stripes.refine != "none" else used.every
    return np.arange(first + -first % used.every, last, step, dtype=np.int64)
