"""The first surface of a large scan: a few of its profiles, shown until the whole is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from turnscan import edit
from turnscan.detection import Detection, View, views_of
from turnscan.gridding import to_grids
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.surface.fusion import paste
from turnscan.workflows._session._mesh import Arrays, coarse_arrays

WORTH_IT = 80_000
"""Image lines of all frames, from which on the whole takes noticeably longer than this."""
_PROFILES = 96
"""How many are looked at, of all lasers together: one for every 4° of a single one."""
_FACES = 60_000
"""The most that are shown."""


@dataclass(frozen=True, eq=False)
class FirstSurface:
    """A part of what was measured, as scanned: without edits, clean-up and merge."""

    every: int
    """One in so many profiles is in it."""
    edits: int
    """Repairs in the file, which are not in it."""
    arrays: Arrays
    """``positions`` (v, 3) mm, ``faces`` (f, 3)."""


def first_surface(
    scan: Scan, rig: Rig, s: Settings, history: edit.History, tick: Callable[[], None]
) -> FirstSurface | None:
    """Evenly chosen profiles pasted together; None where the whole is soon there, or they show
    nothing. ``tick`` is called after each frame. Raises as `detect_scan` and `build`.

    Light of neighbouring frames, and clean-up by neighbouring profiles, need all of them.
    """
    plan = scan.plan
    lines = plan.height if plan.orientation == "vertical" else plan.width
    views = list(views_of(scan, rig, replace(s.stripes, refine="none"), s.volume))
    profiles = sum(len(scan.steps(view.lit)) for view in views)
    if profiles * lines < WORTH_IT:
        return None
    every = -(-profiles // _PROFILES)
    seen = [_some(scan, view, every, tick) for view in views]
    sparse = replace(s, every=1, along=None, between=None, clean=None, denoise=None)
    grids = to_grids(seen, sparse).grids
    body = edit.Body.of(paste(grids, s.tears, keep_double=True))
    if not len(body.mesh.faces):
        return None
    left_out = sum(_repairs(entry.edit) for entry in history.enabled)
    return FirstSurface(every, left_out, coarse_arrays(body, _FACES))


def _repairs(one: edit.Edit) -> bool:
    still = edit.is_measure(one) or edit.is_written(one)
    return not (still or isinstance(one, edit.ChangeSettings))


def _some(scan: Scan, view: View, every: int, tick: Callable[[], None]) -> Detection:
    steps = sorted(set(scan.steps(view.lit)))
    stripes, found = view.seek(tick, only=frozenset(steps[::every]))
    return Detection(view, stripes, tuple(found))
