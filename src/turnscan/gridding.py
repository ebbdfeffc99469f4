"""Stripes → range grids, with the edits of what was seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from turnscan import edit, points
from turnscan.detection import Detection
from turnscan.edit import Entry
from turnscan.findings import Finding
from turnscan.memory import give_back
from turnscan.points import RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.settings import Settings
from turnscan.surface import clean, fusion
from turnscan.surface.holes import ScanCoverage


class Gridded(NamedTuple):
    """The grids of a scan, one for each turn of each laser."""

    grids: list[RangeGrid]
    """All that a surface is made of, uncertain points too (`Settings.largest_sigma`)."""
    sought: list[ScanCoverage]
    """What each could have found."""
    findings: list[Finding]


def to_grids(
    seen: Sequence[Detection],
    s: Settings,
    edits: Sequence[Entry] = (),
    progress: Progress = no_progress,
) -> Gridded:
    """Stripes → grids, what each could have found, and what there is to know.

    ``progress`` hears of the profiles that an edit wants to be sought again, and of each grid.
    """
    grids, sought = list[RangeGrid](), list[ScanCoverage]()
    findings = edit.lost_edits(edits, [sight.view.laser for sight in seen])
    for k, sight in enumerate(seen):
        v = sight.view
        mine = progress.subrange(k / len(seen), (k + 1) / len(seen))
        repaired, nothing = edit.repair_stripes(sight.stripes, edits, v, mine.subrange(0, 0.5))
        off = sight.stripes.angles[~np.isin(sight.stripes.steps, repaired.steps)]
        whole = points.build_grid(
            v.rig, v.laser, repaired.stripes, repaired.steps, repaired.angles, repaired.angle_sigma
        )
        give_back()
        turns, again = points.whole_turns(points.every(whole, s.every))
        findings += [*sight.findings, *nothing, *points.angle_findings(turns[0], again)]
        for i, turn in enumerate(turns):
            now = mine.subrange(0.5, 1).subrange(i / len(turns), (i + 1) / len(turns))
            now(0)
            seamed = edit.repair_grid(turn, edits)
            lines = turn.lines_about()
            kept = seamed.of_lines(lines)
            kept = points.drop_specks(points.clip(kept, v.volume), s.shortest)
            stated = v.rig.sheet(v.laser).thickness
            findings += points.grid_findings(turn, kept, v.volume, str(v.settings.strategy), stated)
            findings += points.together_findings(kept, v.rig, v.others, v.volume)
            if s.clean is not None:
                kept, taken = clean.clean(kept, s.clean)
                findings += taken
                if s.largest_sigma is None:
                    findings += clean.uncertain_findings(kept)
            if s.denoise is not None:
                kept = clean.denoise(kept, s.denoise, now)
            kept = kept.among(lines, turn.amplitude, turn.flags)
            light, places = turn.amplitude, turn.points
            sought.append(
                ScanCoverage(v.rig, kept, v.volume, v.settings.orientation, light, places, off)
            )
            if s.between is not None:
                kept = fusion.respace(kept, s.between, s.tears)
            grids.append(kept)
        give_back()
    return Gridded(grids, sought, findings)
