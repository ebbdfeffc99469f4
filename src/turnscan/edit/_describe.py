"""Edits in words, for lists of the history on the command line and in the browser."""

from __future__ import annotations

from turnscan.edit._edits import (
    BridgeHoles,
    BridgeSides,
    ChangeSettings,
    Close,
    CloseSeam,
    Cut,
    Decimate,
    Delete,
    DeletePoints,
    DeleteSet,
    Despike,
    Edit,
    Fill,
    GridEdit,
    KeepSet,
    MeshEdit,
    PickCandidate,
    ProfileOff,
    Redetect,
    RemovePieces,
    RenameSet,
    SetEdit,
    SetPoint,
    Smooth,
    Span,
)
from turnscan.edit._measures import (
    Measure,
    MeasureAngle,
    MeasureArea,
    MeasureCorner,
    MeasureDiameter,
    MeasureDistance,
    MeasureSection,
    MeasureToPlane,
    MeasureVolume,
    Specify,
)


def describe(edit: Edit) -> str:
    """What an edit does, and to how much, in a few words."""
    if isinstance(edit, ChangeSettings):
        return "change the settings" if edit.name == "default" else f"settings {edit.name!r}"
    if isinstance(edit, SetEdit):
        return _of_set(edit)
    if isinstance(edit, GridEdit):
        return _of_grid(edit)
    if isinstance(edit, Specify):
        return _of_dimension(edit)
    return _of_mesh(edit) if isinstance(edit, MeshEdit) else _of_measure(edit)


def _of_set(edit: SetEdit) -> str:
    match edit:
        case KeepSet():
            return f"keep settings as {edit.name!r}"
        case RenameSet():
            return f"rename settings {edit.name!r} to {edit.to!r}"
        case DeleteSet():
            return f"delete settings {edit.name!r}"


def _of_dimension(edit: Specify) -> str:
    what = f"dimension {edit.name!r}" if edit.name else f"dimension of measurement {edit.measure}"
    if edit.nominal is None:
        return what
    if edit.lower is None or edit.upper is None:
        return f"{what}: nominal {edit.nominal:g}"
    return f"{what}: {edit.nominal:g} {edit.lower:+g}/{edit.upper:+g}"


def _of_grid(edit: GridEdit) -> str:
    match edit:
        case DeletePoints():
            what = f"{len(edit.lines)} points" if len(edit.lines) > 1 else f"line {edit.lines[0]}"
            return f"delete {what} of step {edit.step}, laser {edit.laser}"
        case SetPoint():
            where = f"line {edit.line} of step {edit.step}, laser {edit.laser}"
            return f"set the point of {where} to {edit.position:.2f} px"
        case PickCandidate():
            where = f"{_span('line', edit.lines)} of step {edit.step}, laser {edit.laser}"
            return f"select the candidate near {edit.position:.1f} px in {where}"
        case ProfileOff():
            return f"disable {_span('step', edit.steps)} of laser {edit.laser}"
        case Redetect():
            where = f"{_span('step', edit.steps)}, {_span('line', edit.lines)} of {edit.laser}"
            level = None if edit.threshold is None else f"threshold {edit.threshold:g}"
            how = [w for w in (level, edit.strategy, edit.choose) if w is not None]
            return f"detect {where} again" + (f" ({', '.join(how)})" if how else "")
        case CloseSeam():
            return f'join first and last profile (laser "{edit.laser}")'


_WAYS = {"auto": "automatic", "membrane": "minimal surface"}
"""Ways to fill in words; the others go by their own names."""


def _of_mesh(edit: MeshEdit) -> str:
    match edit:
        case Delete():
            return f"delete {edit.where.count} triangles"
        case Fill():
            many = "all holes" if edit.holes is None else f"{len(edit.holes)} holes"
            if edit.holes is not None and len(edit.holes) == 1:
                many = f"a hole of {edit.holes[0].size:.1f} mm"
            limit = "" if edit.largest is None else f" up to {edit.largest:g} mm"
            return f"fill {many}{limit} ({_WAYS.get(edit.how, edit.how)})"
        case BridgeSides():
            return "bridge two edges"
        case BridgeHoles():
            return f"bridge two boundaries ({_WAYS.get(edit.how, edit.how)})"
        case Close():
            return "make watertight"
        case Cut():
            return _of_cut(edit)
        case Decimate():
            many = "" if edit.faces is None else f"{edit.faces} triangles"
            near = "" if edit.tolerance is None else f"{edit.tolerance:g} mm"
            return "decimate to " + " or ".join(w for w in (many, near) if w)
        case Smooth():
            return f"smooth {edit.where.count} triangles"
        case Despike():
            return "remove spikes"
        case RemovePieces():
            return f"remove pieces of fewer than {edit.fewer} triangles"


def _of_cut(edit: Cut) -> str:
    along = [k for k in (0, 1, 2) if edit.normal[k]]
    if len(along) == 1:
        up = edit.normal[along[0]] > 0
        where = f"{'xyz'[along[0]]} = {(edit.distance if up else -edit.distance) + 0.0:g} mm"
        where += ", what is above stays" if up else ", what is below stays"
    else:
        x, y, z = edit.normal
        where = f"({x:g}, {y:g}, {z:g}) · x = {edit.distance:g} mm"
    return f"cut at {where}" + (", capped" if edit.cap else "")


def _of_measure(measure: Measure) -> str:
    match measure:
        case MeasureDistance():
            return "measure a distance"
        case MeasureToPlane():
            return "measure from a point to a plane"
        case MeasureDiameter():
            return f"measure the diameter of {measure.where.count} triangles"
        case MeasureSection():
            return "measure the diameter of a section"
        case MeasureAngle() | MeasureCorner():
            return "measure an angle"
        case MeasureArea():
            where = "" if measure.where is None else f" of {measure.where.count} triangles"
            return f"measure the area{where}"
        case MeasureVolume():
            return "measure the volume"


def _span(word: str, span: Span) -> str:
    return f"{word} {span[0]}" if span[0] == span[1] else f"{word}s {span[0]}–{span[1]}"
