"""What each grid edit does: to the stripes of a laser, and to its range grid."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from turnscan.arrays import Flags, Floats, Ints
from turnscan.edit._edits import (
    CloseSeam,
    DeletePoints,
    GridEdit,
    PickCandidate,
    ProfileOff,
    Redetect,
    SetPoint,
    Span,
)
from turnscan.edit._history import Entry
from turnscan.findings import Finding
from turnscan.points import RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.stripes import Candidates, Stripe, StripeFlag, Stripes

HAND_SIGMA = 0.5
"""px: standard uncertainty of a centre that a person set."""
_FOLLOW = 4.0
"""px that a picked candidate may lie from where it is searched, and usual widths besides."""


class StripeSearch(Protocol):
    """Looks at the stored frames of one laser again."""

    def candidates(self, step: int) -> Candidates:
        """Everything in the frame of a step that might be the stripe."""
        ...

    def again(self, step: int, edit: Redetect) -> Stripe:
        """The stripe of a step, searched as the edit wants it."""
        ...


def repair_stripes(
    seen: Stripes, entries: Iterable[Entry], eyes: StripeSearch, progress: Progress = no_progress
) -> tuple[Stripes, list[Finding]]:
    """The stripes of a laser with the edits of it done, in their order.

    ``eyes`` is asked where an edit needs what a frame shows. An edit that names a step, or a line
    with a candidate, that is not there is a finding and changes nothing. ``progress`` hears of each
    edit, and of each profile that is sought again.
    """
    mine = [e for e in entries if isinstance(e.edit, GridEdit) and e.edit.laser == seen.laser]
    stripes = dict(zip(seen.steps, seen.stripes, strict=True))
    off: set[int] = set()
    findings: list[Finding] = []
    for k, entry in enumerate(mine):
        progress(k / len(mine))
        match edit := entry.edit:
            case ProfileOff():
                gone = _steps(stripes, edit.steps)
                off.update(gone)
                acted = bool(gone)
            case Redetect():
                changed = _redetected(
                    stripes, edit, eyes, progress.subrange(k / len(mine), (k + 1) / len(mine))
                )
                stripes.update(changed)
                acted = bool(changed)
            case DeletePoints() | SetPoint() | PickCandidate():
                old = stripes.get(edit.step)
                new = None if old is None else _repaired(old, edit, eyes)
                if new is not None:
                    stripes[edit.step] = new
                acted = new is not None
            case _:
                acted = True
        if not acted:
            findings.append(_nothing(entry, f"laser {seen.laser} has no data there"))
    done = replace(seen, stripes=tuple(stripes[step] for step in seen.steps))
    return done.without(off), findings


def repair_grid(grid: RangeGrid, entries: Iterable[Entry]) -> RangeGrid:
    """The grid, its seam closed where an edit wants that and the turn has three steps."""
    wanted = any(isinstance(e.edit, CloseSeam) and e.edit.laser == grid.laser for e in entries)
    return replace(grid, closed=True) if wanted and len(grid.steps) >= 3 else grid


def lost_edits(entries: Iterable[Entry], lasers: Sequence[str]) -> list[Finding]:
    """A finding for each grid edit of a laser that the scan does not have."""
    return [
        _nothing(e, f"the scan has no laser {e.edit.laser!r}, only {', '.join(lasers)}")
        for e in entries
        if isinstance(e.edit, GridEdit) and e.edit.laser not in lasers
    ]


def _nothing(entry: Entry, message: str) -> Finding:
    return Finding(
        "edit.nothing",
        "warning",
        message,
        entry.place,
        "disable the edit, or make it again here",
    )


def _steps(stripes: dict[int, Stripe], span: Span) -> list[int]:
    return [step for step in stripes if span[0] <= step <= span[1]]


def _redetected(
    stripes: dict[int, Stripe], edit: Redetect, eyes: StripeSearch, progress: Progress
) -> dict[int, Stripe]:
    changed = {}
    steps = _steps(stripes, edit.steps)
    for k, step in enumerate(steps):
        progress(k / len(steps))
        old = stripes[step]
        first, last = edit.lines[0], min(edit.lines[1], len(old.position) - 1)
        if first <= last:
            new = eyes.again(step, edit)
            rows = np.arange(first, last + 1, dtype=np.int32)
            sigma = _scattering(new.sigma, new.width, old.scatter, new.scatter)
            table = replace(new, sigma=sigma).table()[:, rows]
            changed[step] = _with_rows(old, rows, table, new.flags[rows])
    return changed


def _repaired(
    stripe: Stripe, edit: DeletePoints | SetPoint | PickCandidate, eyes: StripeSearch
) -> Stripe | None:
    """The stripe of one profile after an edit of it; None where there is nothing to change."""
    n = len(stripe.position)
    match edit:
        case DeletePoints():
            rows = np.array([k for k in edit.lines if k < n], dtype=np.int32)
            rows = rows[stripe.found[rows]]
            gone = np.full_like(stripe.table()[:, rows], np.nan)
            # Neither dark nor outside: deleted, as `surface` names the cause of such a hole.
            flags = np.full(len(rows), StripeFlag.HAND, dtype=np.uint16)
            return _with_rows(stripe, rows, gone, flags) if len(rows) else None
        case SetPoint():
            if edit.line >= n:
                return None
            usual = [_usual(stripe.amplitude), _usual(stripe.width)]
            row = np.array(
                [[edit.position], [HAND_SIGMA], [usual[0]], [usual[1]], [np.nan], [np.nan]]
            )
            by_hand = np.full(1, StripeFlag.HAND, dtype=np.uint16)
            return _with_rows(stripe, np.array([edit.line], np.int32), row, by_hand)
        case PickCandidate():
            return _picked(stripe, edit, eyes.candidates(edit.step))


def _picked(stripe: Stripe, edit: PickCandidate, found: Candidates) -> Stripe | None:
    """Line by line the candidate nearest to where the last one was picked."""
    last = min(edit.lines[1], len(stripe.position) - 1)
    reach = _FOLLOW + 2.0 * _usual(stripe.width)
    at, rows, columns = edit.position, list[int](), list[int]()
    for line in range(edit.lines[0], last + 1):
        away = np.abs(found.position[line] - at)
        if np.isnan(away).all() or np.nanmin(away) > reach:
            continue
        j = int(np.nanargmin(away))
        rows.append(line)
        columns.append(j)
        at = float(found.position[line, j])
    if not rows:
        return None
    sigma = _scattering(found.sigma, found.width, stripe.scatter)
    table = replace(found, sigma=sigma).table()[:, rows, columns]
    flags = found.flags[rows, columns] | np.uint16(StripeFlag.HAND)
    return _with_rows(stripe, np.array(rows, np.int32), table, flags)


def _with_rows(stripe: Stripe, rows: Ints, table: Floats, flags: Flags) -> Stripe:
    """The stripe with the measures (6, n) of some lines replaced."""
    whole = stripe.table()
    whole[:, rows] = table
    bits = stripe.flags.copy()
    bits[rows] = flags
    return Stripe.made_of(whole, bits, stripe.orientation, stripe.scatter)


def _scattering(sigma: Floats, width: Floats, per_width: float, before: float = 0.0) -> Floats:
    """Sigmas px of centres of a ``width`` px with the scatter of another stripe in them
    (`Stripe.scatter`) for the one ``before``."""
    if np.array_equal(per_width, before, equal_nan=True):
        return sigma
    more = np.nan_to_num(per_width) - np.nan_to_num(before)
    return np.asarray(np.sqrt(np.maximum(sigma**2 + more * width, 0.0)))


def _usual(values: Floats) -> float:
    have = values[~np.isnan(values)]
    return float(np.median(have)) if len(have) else 1.0
