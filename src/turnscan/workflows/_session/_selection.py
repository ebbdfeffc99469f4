"""Selections by rules like ``sigma=0.2`` or ``piece=10,0,35`` → faces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan import edit
from turnscan.arrays import Bools
from turnscan.detection import detect_scan
from turnscan.edit import Entry, History, Region
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.pipeline import Reconstruction, build
from turnscan.progress import Progress, no_progress
from turnscan.scan import Scan, rig_for
from turnscan.stripes import StripeFlag
from turnscan.surface import holes
from turnscan.surface.holes import CAUSE_WORDS
from turnscan.workflows._files._kept_options import kept_options

_HINT = "the help of turnscan edits lists the rules"


def region_where(
    scan: Scan,
    history: History,
    rules: Sequence[str],
    rounds: int,
    progress: Progress = no_progress,
) -> Region:
    """What any of the rules means on the surface of a scan with these edits, grown or shrunk.

    Raises InputError for a rule that is none, and where nothing is like it.
    """
    rig = rig_for(scan)
    settings = kept_options(scan, edits=history.enabled).settings(rig, scan)
    made: list[Reconstruction] = []

    def built(entries: Sequence[Entry], progress: Progress) -> tuple[Mesh, Sequence[Finding]]:
        made.append(build(seen, settings, entries, progress, finish=False))
        return made[-1].mesh, made[-1].findings

    tick = progress.subrange(0, 0.6, "reconstructing").counter(len(scan))
    seen = detect_scan(scan, rig, settings.stripes, settings.volume, tick)
    document = edit.Document.open(built, history)
    body = document.body
    live = edit.Compact.of(body)
    chosen = np.zeros(len(live.mesh.faces), dtype=np.bool_)
    done = replace(made[-1], cut=document.cut())
    for rule in rules:
        chosen |= select(done, live.mesh, rule)
    if rounds:
        near = edit.beside(live.mesh)
        more = rounds > 0
        chosen = edit.grow(chosen, near, rounds) if more else edit.shrink(chosen, near, -rounds)
    if not chosen.any():
        raise InputError(f"no face matches {' or '.join(rules)}", hint="choose another value")
    return edit.Region.of(body, live.face_ids[chosen])


def select(done: Reconstruction, mesh: Mesh, rule: str) -> Bools:
    """The faces (f,) of the edited surface that a rule means.

    Raises InputError for a rule that is none, or whose value is not what it must be.
    """
    name, _, value = rule.partition("=")
    match name:
        case "laser":
            return edit.by_laser(mesh, value)
        case "steps":
            first, last = _numbers(rule, value.split("-"), 2)
            return edit.by_steps(mesh, int(first), int(last))
        case "sigma":
            [above] = _numbers(rule, [value], 1)
            if above <= 0:  # every face is known worse than that
                raise _odd(rule, "mm above 0")
            return edit.by_sigma(mesh, above)
        case "flag":
            names = [name for name in StripeFlag.__members__ if name != "OK"]
            if value.upper() not in names:
                raise _odd(rule, "one of " + ", ".join(names).lower())
            return edit.by_quality(mesh, done.grids, int(StripeFlag[value.upper()]))
        case "cause":
            if value not in CAUSE_WORDS:
                raise _odd(rule, "one of " + ", ".join(CAUSE_WORDS))
            borders = holes.explain(mesh, holes.holes(mesh), done.sought, done.cut, done.lost)
            return edit.by_cause(mesh, borders, {c for c in CAUSE_WORDS if c == value})
        case "pieces":
            return edit.by_size(mesh, int(_numbers(rule, [value], 1)[0]))
        case "piece":
            seed = _nearest(mesh, _numbers(rule, value.split(","), 3))
            return edit.connected(seed, edit.beside(mesh))
        case "crease":
            *place, degrees = _numbers(rule, value.split(","), 4)
            seed = _nearest(mesh, place)
            return edit.within_angle(seed, edit.beside(mesh), mesh, math.radians(degrees))
    raise InputError(f"{rule!r} is not a rule", hint=_HINT)


def _nearest(mesh: Mesh, place: list[float]) -> Bools:
    away = np.linalg.norm(mesh.triangles.mean(axis=1) - place, axis=1)
    return np.asarray(np.arange(len(away)) == (int(away.argmin()) if len(away) else -1))


def _numbers(rule: str, words: list[str], count: int) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise _odd(rule, "a number" if count == 1 else f"{count} numbers")
    return numbers


def _odd(rule: str, wanted: str) -> InputError:
    return InputError(f"{rule!r}: expected {wanted} after the =", hint=_HINT)
