"""ClosingOptions: a mesh with gaps → a closed one, with every face that was not measured marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.findings import Finding, Severity
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import smoothed_normals
from turnscan.mesh._parts import components, submesh
from turnscan.mesh._topology import cut_touching
from turnscan.progress import Progress, no_progress
from turnscan.surface.holes._fill import FillHow, Patch, patches, ways, with_patches
from turnscan.surface.holes._holes import Hole, holes, vector_area
from turnscan.surface.holes._self_intersections import Repaired, repair_self_intersections
from turnscan.surface.holes._sound_fill import Filled, fill_soundly, unfilled

Top = Literal["plane", "fan", "smooth", "open"]
"""plane: in its best plane. fan: to the axis. smooth: with the curvature of its border."""

Bottom = Literal["floor", "open"]
"""floor: led down to the platter and closed with its plane."""

_UP = 0.5
"""A gap looks up (or down) where its best plane is tilted by less than 60°."""
_LEAN = 2.5
"""mm to the side for each mm down, at most: a foot is not led further under the part."""
_STEADY = 2.0
"""mm along a border on either hand over which its normals are averaged."""
_LEVEL = float(np.tan(np.radians(2.0)))
"""A border that is tilted further is not that of a part that stands flat on the platter."""
_HINT = "scan the part in another pose or with a second laser, or bridge the gap by hand"
_ALIKE = 0.05
"""Of a hole's size, by which it may differ before and after."""
_CRUMB = 0.02
"""Of the vertices of a piece, or of all: fewer that come off it, or that it has, are crumbs."""
_GONE = 0.5
"""Of the vertices of a piece: where more give way, it is the piece that does."""
_HIGH = 0.1
"""The top reaches into this share of the part's height."""


@dataclass(frozen=True)
class ClosingOptions:
    """How the gaps of a mesh are closed."""

    floor: float | None = 0.0
    """mm: height of the platter that the part stands on, known from calibration; None when it
    stands on nothing."""
    reach: float = 5.0
    """A gap counts as the part's foot when it looks down and at least half its border lies less
    than this many mm above the floor."""
    bottom: Bottom = "floor"
    """How the part's foot is closed, where it stands on something."""
    top: Top | None = "plane"
    """How the largest gap that looks up from the part's highest tenth is closed; None when it is
    a hole like others."""
    holes: FillHow | None = "auto"
    """How all other gaps are filled; None leaves them open."""
    largest: float | None = None
    """mm: other gaps of a larger size stay open; None fills all."""

    def __post_init__(self) -> None:
        if self.reach < 0 or (self.largest is not None and not self.largest > 0):
            raise ValueError(f"ClosingOptions: reach {self.reach}, largest {self.largest} mm")


def close(
    mesh: Mesh, caps: ClosingOptions | None = None, progress: Progress = no_progress
) -> tuple[Mesh, list[Finding]]:
    """Close the gaps of a mesh, and say what was done; faces added are not ``measured``.

    The part's foot is carried on in its tangent planes down to the floor; the faces in the
    floor's plane count as measured where the foot's border is level, for they lie on the platter,
    whose place the calibration knows. Below a border that is tilted the part leans, and its bottom
    may lie anywhere up to the border. Then the top is closed, then all other holes (`fill`),
    nowhere below the floor. Where parts of the surface merely touch in a vertex, the faces of the
    smaller one go first: programs that join equal corners would find them joined. Holes whose
    patches cut through the surface stay open (`fill_soundly`). Last, places where the surface cuts
    through itself otherwise are made anew (`repair_self_intersections`), unless that would cut the
    surface in two; then what cannot be filled without it stays open. Added vertices have
    provenance −1; those that are there do not move. ``progress`` hears of each of the other holes.
    """
    c = caps or ClosingOptions()
    whole, remarks = cut_touching(mesh)
    foot, top, others = _sorted(whole, c)
    skip = [h for h in others if c.holes is None or (c.largest is not None and h.size > c.largest)]
    fillable = [h for h in others if not any(h is s for s in skip)]
    done = whole
    stands = c.floor is not None and c.bottom == "floor"
    if foot and c.floor is not None and stands:
        done = _stood(done, [h.loop for h in foot], c.floor)
    if top is not None and c.top == "fan":
        done = with_patches(done, [_fan(done, top.loop)])
    hows: list[FillHow] = [c.holes or "auto"] * len(fillable)
    if top is not None and c.top in ("plane", "smooth"):
        fillable.append(top)
        hows.append("flat" if c.top == "plane" else "curvature")
    filled, repaired = _filled(done, fillable, hows, c.floor, progress)
    if filled.left:
        remarks.append(unfilled(filled.left, _HINT))
    gaps = (
        stands * len(foot) + (top is not None and c.top == "fan") + len(fillable) - len(filled.left)
    )
    again = filled.replaced + repaired.replaced
    done = repaired.mesh
    if repaired.replaced:
        done = submesh(done, np.ones(len(done.faces), dtype=np.bool_))
    if again:
        text = f"{again} faces at self-intersections were rebuilt"
        remarks.append(Finding("surface.repaired", "note", text))
    tilts = [_tilt(whole.vertices[h.loop]) for h in foot] if stands else []
    return done, remarks + _said(done, gaps, tilts, c)


def _filled(
    mesh: Mesh,
    which: Sequence[Hole],
    hows: Sequence[FillHow],
    floor: float | None,
    progress: Progress,
) -> tuple[Filled, Repaired]:
    """Holes filled, and what was rebuilt for it; of measured faces only what parts nothing.

    Where the surface would be parted, it is the patch of the largest hole that cuts through most of
    it: that one stays open. Where that is not enough, no measured face gives way.
    """
    kept, left = list(range(len(which))), list[Hole]()
    while True:
        hold = len(left) > 1
        some = [which[k] for k in kept]
        filled = fill_soundly(mesh, some, [hows[k] for k in kept], progress, hold=hold, floor=floor)
        repaired = repair_self_intersections(filled.mesh, filled.owner, filled.flat, hold=hold)
        whole = hold or not repaired.replaced or not _parted(mesh, repaired.mesh)
        if whole or not kept:
            return replace(filled, left=[*left, *filled.left]), repaired
        progress = no_progress
        widest = max(kept, key=lambda k: which[k].size)
        kept.remove(widest)
        left.append(which[widest])


def _parted(before: Mesh, after: Mesh) -> bool:
    """Whether a piece of a surface hangs together no longer, or one that is no crumb is lost: its
    vertices, whose numbers are the same in both, lie on several pieces, `_CRUMB` of them at least
    on a second, or most of them on none."""
    old, new = _piece_of(before), _piece_of(after)[: len(before.vertices)]
    there = old >= 0
    size, gone = (
        np.bincount(old[k], minlength=old.max(initial=-1) + 1) for k in (there, there & (new < 0))
    )
    if ((gone > _GONE * size) & (size >= _CRUMB * size.sum())).any():
        return True
    there &= new >= 0
    pairs, count = np.unique(np.stack([old, new])[:, there], axis=1, return_counts=True)
    large = count >= _CRUMB * np.bincount(old[there])[pairs[0]]
    return bool(np.unique(pairs[0][large], return_counts=True)[1].max(initial=0) > 1)


def _piece_of(mesh: Mesh) -> Ints:
    """(v,) the connected piece of each vertex; −1 for one without faces."""
    out = np.full(len(mesh.vertices), -1, dtype=np.int32)
    out[mesh.faces] = components(mesh)[:, None]
    return out


def closings(
    mesh: Mesh, found: Sequence[Hole], caps: ClosingOptions | None, closed: Mesh
) -> list[str]:
    """In a word for each hole of a mesh how `close` dealt with it: "open" where it did not.

    ``closed`` is what became of the mesh; it may have been decimated.
    """
    if caps is None:
        return ["open"] * len(found)
    feet, top, _ = _sorted(mesh, caps)
    standing = {h.loop.tobytes() for h in feet}
    above = b"" if top is None else top.loop.tobytes()
    left = [(h.centre, h.size) for h in holes(closed)]
    taken = ways(mesh, [h.loop for h in found], [caps.holes or "auto"] * len(found))
    out = list[str]()
    for hole, way in zip(found, taken, strict=True):
        loop = hole.loop.tobytes()
        if loop in standing:
            out.append(caps.bottom)
        elif any(_same(hole, centre, size) for centre, size in left):
            out.append("open")
        elif loop == above:
            out.append(str(caps.top))
        else:
            large = caps.largest is not None and hole.size > caps.largest
            out.append("open" if large or caps.holes is None else way)
    return out


def _same(hole: Hole, centre: Floats, size: float) -> bool:
    """Whether a gap of this centre and size is the hole: decimating moves both a little."""
    away = float(np.linalg.norm(hole.centre - centre))
    return max(away, abs(hole.size - size)) <= _ALIKE * hole.size


def _said(mesh: Mesh, gaps: int, tilts: Sequence[float], c: ClosingOptions) -> list[Finding]:
    out = []
    if mesh.measured is not None:
        share = 1.0 - mesh.area_of(mesh.measured) / max(mesh.area_of(), 1e-300)
        text = f"{gaps} gaps closed; {share:.1%} of the surface was not measured"
        out.append(Finding("surface.caps", "warning" if share > 0.25 else "note", text))
    if tilts:
        area = mesh.area_of((mesh.triangles[..., 2] == c.floor).all(axis=1))
        text = (
            f"the bottom of the part is closed by the platter plane, {area:.0f} mm² at {c.floor} mm"
        )
        leans = max(tilts) > _LEVEL
        if leans:
            text += f", though its border is tilted by {np.degrees(np.arctan(max(tilts))):.0f}°"
        hint = "where the part leans, have its bottom filled as a hole" if leans else ""
        severity: Severity = "warning" if leans else "note"
        out.append(Finding("surface.floor", severity, text, "", hint))
    return out


def _sorted(mesh: Mesh, c: ClosingOptions) -> tuple[list[Hole], Hole | None, list[Hole]]:
    """The feet, the top if there is one, and all other holes of a mesh."""
    feet, ups, others = [], [], []
    low, high = mesh.bounds[:, 2] if len(mesh.vertices) else (0.0, 0.0)
    for hole in holes(mesh):
        corners = mesh.vertices[hole.loop]
        # A patch runs against the border, so this is how far the gap looks up, −1 to 1.
        up = -vector_area(corners)[2] / max(hole.area, 1e-300)
        if c.floor is not None and up < -_UP and _is_foot(corners, c.floor, c.reach):
            feet.append(hole)
        elif c.top is not None and up > _UP and corners[:, 2].max() > high - _HIGH * (high - low):
            ups.append(hole)
        else:
            others.append(hole)
    top = max(ups, key=lambda h: h.area, default=None)
    return feet, top, [*others, *(h for h in ups if h is not top)]


def _is_foot(corners: Floats, floor: float, reach: float) -> bool:
    return bool((np.abs(corners[:, 2] - floor) <= reach).mean() >= 0.5)


def _stood(mesh: Mesh, loops: Sequence[Ints], floor: float) -> Mesh:
    """The mesh with borders carried on down to the floor and closed there by its plane."""
    normals = smoothed_normals(mesh)
    done = with_patches(mesh, [_skirt(mesh, loop, floor, normals) for loop in loops])
    start, below = len(mesh.vertices), []
    for loop in loops:
        down = mesh.vertices[loop, 2] != floor
        ring = loop.copy()
        ring[down] = np.arange(start, start + down.sum())
        below.append(ring)
        start += int(down.sum())
    lids = patches(done, below, "flat")
    sewn = with_patches(done, lids)
    if sewn.measured is None:
        raise TypeError("a filled mesh knows which faces were measured")
    known = sewn.measured.copy()
    ends = len(done.faces) + np.cumsum([len(p.faces) for p in lids])
    for loop, lid, end in zip(loops, lids, ends, strict=True):
        known[end - len(lid.faces) : end] = _tilt(mesh.vertices[loop]) <= _LEVEL
    return replace(sewn, measured=known)


def _tilt(corners: Floats) -> float:
    """Slope of the plane through a border (m, 3), z over the level."""
    d = corners - corners.mean(axis=0)
    slope = np.linalg.lstsq(d[:, :2], d[:, 2], rcond=None)[0]
    return float(np.hypot(*slope))


def _skirt(mesh: Mesh, loop: Ints, floor: float, normals: Floats) -> Patch:
    """The wall from a border (m,) to the floor, in the border's tangent planes."""
    m = len(loop)
    corners = mesh.vertices[loop]
    down = corners[:, 2] != floor
    here = np.arange(m)
    ring = np.where(down, m + np.cumsum(down) - 1, here)
    after, below = np.roll(here, -1), np.roll(ring, -1)
    upper = np.stack([after, here, ring], axis=-1)
    lower = np.stack([after, ring, below], axis=-1)
    # A corner that stands on the floor already has no wall below it.
    faces = np.concatenate([upper[down], lower[np.roll(down, -1)]]).astype(np.int32)
    height = corners[:, 2] - floor
    foot = corners[:, :2] + _lean(corners, height, normals[loop]) * height[:, None]
    image = np.column_stack([foot[down], np.full(int(down.sum()), floor)])
    return Patch(loop, image, faces)


def _lean(corners: Floats, height: Floats, normals: Floats) -> Floats:
    """(m, 2) mm to the side for each mm that the surface goes down from its border (m, 3).

    ``height`` (m,) is the border's above the floor. The normals (m, 3) are averaged along the
    border, since a mm of noise there would become several on the floor.
    """
    along = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    width = max(1, round(_STEADY / max(float(along.mean()), 1e-9)))
    reach = min(width, (len(corners) - 1) // 2)
    shifted = [np.roll(normals, k, axis=0) for k in range(-reach, reach + 1)]
    total: Floats = np.sum(shifted, axis=0)
    level = np.hypot(total[:, 0], total[:, 1])
    slope = np.clip(total[:, 2] / np.maximum(level, 1e-12), -_LEAN, _LEAN)
    # A foot that is narrow, seen from above, must not be led beyond its own middle.
    reached = float(along.sum() * np.abs(height).max())
    room = abs(float(vector_area(corners)[2])) / max(reached, 1e-12)
    slope = np.maximum(slope, -room)
    out: Floats = total[:, :2] / np.maximum(level, 1e-12)[:, None] * slope[:, None]
    return out


def _fan(mesh: Mesh, loop: Ints) -> Patch:
    """Triangles from a border to the axis at its mean height; to its middle if that is outside."""
    m = len(loop)
    ring = loop[::-1].copy()
    corners = mesh.vertices[ring]
    middle = corners.mean(axis=0)
    turn = np.diff(np.unwrap(np.arctan2(corners[:, 1], corners[:, 0])[[*range(m), 0]]))
    if abs(turn.sum()) > np.pi:
        middle[:2] = 0.0
    around = np.arange(m, dtype=np.int32)
    return Patch(
        ring, middle[None], np.stack([around, np.roll(around, -1), np.full(m, m, np.int32)], axis=1)
    )
