"""What each mesh edit does to a body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Ints
from turnscan.edit._body import Alive, Append, Body, Compact, Patch, difference
from turnscan.edit._edits import (
    BridgeHoles,
    BridgeSides,
    ChangeSettings,
    Close,
    Cut,
    Decimate,
    Delete,
    Despike,
    Fill,
    GridEdit,
    HoleName,
    MeshEdit,
    RemovePieces,
    SetEdit,
    Smooth,
    is_written,
)
from turnscan.edit._history import Entry
from turnscan.edit._measures import REACH, Measure, Sources, Specify, Vector, taken
from turnscan.edit._select import by_size
from turnscan.errors import CalibrationError, InputError
from turnscan.findings import Finding, Severity
from turnscan.mesh import Mesh, Provenance, clip, half_edges, vertex_fans
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Measured, Source
from turnscan.surface.clean import smooth, spikes
from turnscan.surface.decimation import decimate
from turnscan.surface.holes import (
    ClosingOptions,
    FillHow,
    Hole,
    bridge,
    close,
    fill_soundly,
    holes,
    unfilled,
)

_WAYS: tuple[FillHow, ...] = ("membrane", "tangent", "flat", "curvature")
MISFIT = "edit.misfit"
"""The finding of a measurement that was made on another surface, which this one is unlike."""
_SAME = "make sure that it is the same part and stands there in the same place"
_LIKE = 3.0
"""A hole of a third to three times the size may be the one that was meant."""


@dataclass(frozen=True, eq=False)
class Done:
    """An edit that was applied, and how to take it back."""

    entry: Entry
    forward: tuple[Patch, ...]
    """In the order they are done."""
    back: tuple[Patch, ...]
    """In the order they are done."""
    findings: tuple[Finding, ...]
    measured: Measured | None = None
    """The result of a measurement."""


def apply(
    body: Body, entry: Entry, progress: Progress = no_progress, source: Sources = Source
) -> tuple[Body, Done]:
    """A body after a mesh edit. An edit that cannot be done changes nothing and is a finding.

    ``progress`` hears of filling, smoothing and decimating how much of it is done; ``source`` says
    what the surface was made from.
    """
    findings: list[Finding] = []
    assert not isinstance(entry.edit, GridEdit | ChangeSettings), "before there is a mesh"
    patches: tuple[Patch, ...] = ()
    measured: Measured | None = None
    try:
        if isinstance(entry.edit, Measure):
            doubts = list[str]()
            measured = taken(body, entry.edit, source, doubts)
            findings += [Finding(MISFIT, "warning", said, remedy=_SAME) for said in doubts]
        elif not isinstance(entry.edit, SetEdit | Specify):
            patches = _patches(body, entry.edit, findings, progress)
    except (InputError, CalibrationError) as e:
        # A part is none the worse for a measurement that cannot be taken.
        severity: Severity = "warning" if isinstance(entry.edit, Measure) else "error"
        findings.append(Finding("edit.refused", severity, e.message, remedy=e.hint))
    back: list[Patch] = []
    for patch in patches:
        back.insert(0, patch.inverse(body))
        body = patch.on(body)
    idle = not is_written(entry.edit) and not patches and measured is None
    if idle and not findings:
        findings.append(_nothing("no change: nothing matched"))
    named = tuple(Finding(f.code, f.severity, f.message, entry.place, f.remedy) for f in findings)
    return body, Done(entry, patches, tuple(back), named, measured)


def _patches(
    body: Body, edit: MeshEdit, findings: list[Finding], progress: Progress
) -> tuple[Patch, ...]:
    match edit:
        case Delete():
            faces = _with_what_hangs(body, edit.where.find(body))
            return (Alive(faces, False),) if len(faces) else ()
        case Fill():
            return _filled(body, edit, findings, progress)
        case BridgeSides():
            before = Compact.of(body)
            one, other = _side_at(before.mesh, edit.a), _side_at(before.mesh, edit.b)
            return difference(body, before, bridge(before.mesh, one, other))
        case BridgeHoles():
            before = Compact.of(body)
            there = holes(before.mesh)
            found = [_called(there, name) for name in (edit.a, edit.b)]
            if found[0] is None or found[1] is None:
                findings.append(_no_hole(edit.a if found[0] is None else edit.b))
                return ()
            return difference(body, before, bridge(before.mesh, found[0], found[1], edit.how))
        case Close():
            before = Compact.of(body)
            caps = ClosingOptions(
                edit.floor, edit.reach, edit.bottom, edit.top, edit.holes, edit.largest
            )
            mesh, said = close(before.mesh, caps, progress)
            findings += [f for f in said if f.severity != "note"]
            return difference(body, before, mesh)
        case Cut():
            return _cut(body, edit)
        case Decimate():
            before = Compact.of(body)
            mesh = decimate(
                before.mesh, tolerance=edit.tolerance, faces=edit.faces, progress=progress
            )
            return difference(body, before, mesh)
        case Smooth():
            return _smoothed(body, edit, progress)
        case Despike():
            return _despiked(body, edit, findings, progress)
        case RemovePieces():
            small = np.flatnonzero(by_size(body.mesh, edit.fewer, body.alive)).astype(np.int32)
            return (Alive(small, False),) if len(small) else ()


def _smoothed(body: Body, edit: Smooth, progress: Progress) -> tuple[Patch, ...]:
    """Each vertex moves as much as its faces belong to the region; only they are looked at."""
    chosen = edit.where.find(body)
    faces, size = body.mesh.faces, len(body.mesh.vertices)
    mine = np.bincount(faces[chosen].ravel(), minlength=size)
    part = Compact.of(body, np.asarray((mine > 0)[faces].any(axis=1)))
    all_of_them = np.bincount(part.mesh.faces.ravel(), minlength=len(part.mesh.vertices))
    weight = edit.strength * np.minimum(mine[part.vertex_ids] / np.maximum(all_of_them, 1), 1.0)
    return (
        difference(body, part, smooth(part.mesh, weight, edit.rounds, progress))
        if len(chosen)
        else ()
    )


def _despiked(
    body: Body, edit: Despike, findings: list[Finding], progress: Progress
) -> tuple[Patch, ...]:
    """The faces about spikes go, and the holes that leaves are filled."""
    before = Compact.of(body)
    about = spikes(before.mesh, edit.beyond)[before.mesh.faces].any(axis=1)
    faces = before.face_ids[about]
    if edit.where is not None:
        faces = np.intersect1d(faces, edit.where.find(body))
    if not len(faces):
        return ()
    gone = Alive(_with_what_hangs(body, faces), False)
    without = gone.on(body)
    after = Compact.of(without)
    beside = np.zeros(len(body.mesh.vertices), dtype=np.bool_)
    beside[body.mesh.faces[gone.faces]] = True
    made = [h for h in holes(after.mesh) if beside[after.vertex_ids[h.loop]].all()]
    mesh, left, _ = _filled_somehow(after.mesh, made, edit.how, progress)
    if left:
        findings.append(unfilled(left, _way_out(after.mesh, left, edit.how)))
    return gone, *difference(without, after, mesh)


def _cut(body: Body, edit: Cut) -> tuple[Patch, ...]:
    """A cut whose clipped faces and caps are added, so that all others keep their numbers."""
    before = Compact.of(body)
    done = clip(before.mesh, edit.normal, edit.distance, edit.cap)
    if not done.gone.any():
        return ()
    start = len(body.mesh.vertices)
    fresh = np.arange(start, start + len(done.vertices), dtype=np.int32)
    number = np.concatenate([before.vertex_ids, fresh])
    p = before.mesh.provenance
    if p is not None:
        p = Provenance(
            p.sigma[done.near], p.laser[done.near], p.step[done.near], p.line[done.near], p.lasers
        )
    added = Append(done.vertices, number[done.faces].reshape(-1, 3), done.measured, p)
    return Alive(before.face_ids[done.gone], False), added


def _with_what_hangs(body: Body, faces: Ints) -> Ints:
    """Faces to delete, and those that would then touch others in a corner only.

    Of the fans of faces about a vertex the largest stays, as in `surface.cut_touching`, so that
    what is left can be filled and closed.
    """
    left = body.alive.copy()
    left[faces] = False
    touched = np.zeros(len(body.mesh.vertices), dtype=np.bool_)
    touched[body.mesh.faces[faces]] = True
    while True:
        near = np.flatnonzero(left & touched[body.mesh.faces].any(axis=1))
        fan, about = vertex_fans(body.mesh.faces[near])
        order = np.lexsort((np.arange(len(about)), -np.bincount(fan, minlength=len(about)), about))
        rest = order[1:][about[order[1:]] == about[order[:-1]]]
        rest = rest[touched[about[rest]]]  # of other vertices not all faces are here
        if not len(rest):
            return np.flatnonzero(body.alive & ~left).astype(np.int32)
        hanging = near[np.isin(fan, rest).reshape(-1, 3).any(axis=1)]
        left[hanging] = False
        touched[body.mesh.faces[hanging]] = True


def _filled(
    body: Body, edit: Fill, findings: list[Finding], progress: Progress
) -> tuple[Patch, ...]:
    """Holes filled; refused where each of them would cut through the surface."""
    whole = Compact.of(body)
    wanted = _to_fill(holes(whole.mesh), edit, findings)
    if not wanted:
        return ()
    mesh, left, ways = _filled_somehow(whole.mesh, wanted, edit.how, progress)
    if left:
        hint = _way_out(whole.mesh, left, edit.how)
        if len(left) == len(wanted):
            which = "the hole" if len(wanted) == 1 else f"each of the {len(wanted)} holes"
            raise InputError(
                f"{which} stays open: filled ({edit.how}), the surface would intersect itself",
                hint=hint,
            )
        findings.append(unfilled(left, hint))
    for way, many in ways.items():
        which = "a hole was" if many == 1 else f"{many} holes were"
        said = f"{which} filled by {way}: any other surface would intersect the part"
        findings.append(Finding("edit.other-fill", "note", said))
    return difference(body, whole, mesh)


def _filled_somehow(
    mesh: Mesh, wanted: list[Hole], how: FillHow, progress: Progress
) -> tuple[Mesh, list[Hole], dict[FillHow, int]]:
    """Holes filled, those that stay open, and how many another way than ``auto`` has filled.

    ``auto`` tries every way; any other way is tried alone.
    """
    others: tuple[FillHow, ...] = _WAYS if how == "auto" else ()
    part = 1.0 / (1 + len(others))
    filled = fill_soundly(mesh, wanted, how, progress.subrange(0, part))
    ways = dict[FillHow, int]()
    for k, way in enumerate(others, start=1):
        if not filled.left:
            break
        before = len(filled.left)
        rest = progress.subrange(k * part, (k + 1) * part)
        filled = fill_soundly(filled.mesh, filled.left, way, rest)
        if len(filled.left) < before:
            ways[way] = before - len(filled.left)
    return filled.mesh, filled.left, ways


def _way_out(mesh: Mesh, left: list[Hole], how: FillHow) -> str:
    """What else to do about holes whose filling would cut through the surface."""
    others = [] if how == "auto" else [way for way in _WAYS if way != how]
    open_still = {way: len(fill_soundly(mesh, left, way).left) for way in others}
    best = min(others, key=lambda way: open_still[way], default=how)
    if not others or open_still[best] == len(left):
        return "bridge it by hand, or delete the faces in it; no other fill method does better"
    which = "it" if len(left) == 1 else f"{len(left) - open_still[best]} of them"
    return f"choose {best}, which fills {which}"


def _to_fill(there: list[Hole], edit: Fill, findings: list[Finding]) -> list[Hole]:
    """The holes that an edit means."""
    left = [h for h in there if edit.largest is None or h.size <= edit.largest]
    if edit.holes is None:
        return left
    wanted = []
    for name in edit.holes:
        hole = _called(left, name)
        if hole is None:
            findings.append(_no_hole(name))
            continue
        wanted.append(hole)
        left = [h for h in left if h is not hole]
    return wanted


def _called(there: list[Hole], name: HoleName) -> Hole | None:
    """The nearest of the holes that are like the one that was named; None where none is."""
    like = [h for h in there if _away(h, name) <= name.size and _alike(h, name)]
    return min(like, key=lambda h: _away(h, name), default=None)


def _no_hole(name: HoleName) -> Finding:
    x, y, z = name.centre
    return _nothing(f"no hole of {name.size:.2f} mm near ({x:.2f}, {y:.2f}, {z:.2f})")


def _side_at(mesh: Mesh, at: Vector) -> tuple[int, int]:
    """The side of a border whose middle is nearest to a point, and near."""
    begin, end = half_edges(mesh.faces)
    if not len(begin):
        raise InputError("the surface has no boundary to bridge from")
    middle = (mesh.vertices[begin] + mesh.vertices[end]) / 2
    away = np.linalg.norm(middle - at, axis=1)
    nearest = int(away.argmin())
    if away[nearest] > REACH:
        raise InputError(
            f"the nearest boundary is {away[nearest]:.1f} mm from the end of the bridge"
        )
    return int(begin[nearest]), int(end[nearest])


def _away(hole: Hole, name: HoleName) -> float:
    return float(np.linalg.norm(hole.centre - name.centre))


def _alike(hole: Hole, name: HoleName) -> bool:
    return name.size / _LIKE <= hole.size <= name.size * _LIKE


def _nothing(message: str) -> Finding:
    return Finding(
        "edit.nothing", "warning", message, remedy="disable the edit, or make it again here"
    )
