"""What a laser's scan could have found: where its sheet met places, and what the frames showed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.points import RangeGrid, Volume
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import Orientation

GRAZING = float(np.cos(np.deg2rad(80.0)))
"""What is lit or seen further from face-on than this counts as hidden (as `TearLimits.grazing`)."""
_SPECKLED = 4.0
"""Times its mean that the light of a speckled place is seen with a chance of exp(−4) = 2 % (fully
developed speckle, Goodman 2007 §3.2): where a dark place shows at all, it shows no brighter."""
_NEARER = 0.25
"""Of a usual step: by so much a profile that was switched off is nearer than one that is there."""


@dataclass(frozen=True)
class ScanCoverage:
    """What one laser's scan could have found, and what it did."""

    rig: Rig
    grid: RangeGrid
    """As cleaned, with a flag for every line of the pictures: not resampled."""
    volume: Volume
    """What was kept of the scan."""
    orientation: Orientation = "vertical"
    light: Floats | None = None
    """(s, n) grey levels of the stripes before any point was dropped, NaN where none was chosen;
    None where only those of the grid are known."""

    taken: Floats | None = None
    """(s, n, 3) mm: places of all points before any was dropped, NaN where there was none; None
    where only those of the grid are known."""

    off: Floats | None = None
    """(k,) rad: table angles of profiles that were switched off by hand; the grid has none."""

    @cached_property
    def faint(self) -> Bools:
        """(s, n) True where there was a stripe that tells of a dark place.

        It is hardly brighter than the faintest that is found at all (`_SPECKLED`), and fainter than
        the usual one would be on a surface that is turned off as far as counts (`GRAZING`).
        """
        light = self.grid.amplitude if self.light is None else self.light
        usual = light[self.grid.found]
        if not len(usual):
            return np.zeros(light.shape, dtype=np.bool_)
        limit = min(_SPECKLED * float(np.nanmin(light)), GRAZING * float(np.median(usual)))
        return np.asarray(light < limit)


@dataclass(frozen=True)
class Crossings:
    """Moments at which places pass a laser's sheet."""

    place: Ints
    """(c,)."""
    step: Ints
    """(c,) index of the nearest step of the grid."""
    line: Ints
    """(c,) line of the picture, within the grid."""
    inside: Bools
    """(c,) True in the picture."""
    eye: Floats
    """(c, 3) mm: camera, object's frame."""
    source: Floats
    """(c, 3) mm: laser, object's frame."""
    off: Bools
    """(c,) True where the profile of that moment was switched off by hand."""

    def part(self, which: Ints) -> Crossings:
        place, step, line = self.place[which], self.step[which], self.line[which]
        eye, source = self.eye[which], self.source[which]
        return Crossings(place, step, line, self.inside[which], eye, source, self.off[which])


def crossings(view: ScanCoverage, at: Floats) -> Crossings:
    """The moments at which places (m, 3) pass a laser's sheet as the table turns."""
    grid, rig = view.grid, view.rig
    sheet, T, camera = rig.sheet(grid.laser), rig.T_camera_table, rig.camera
    closed = grid.closed and len(grid.steps) >= 3
    turn = rotation_z(grid.angles)
    off = np.stack([sheet.distance(T.apply(at @ R.T)) for R in turn])
    after = np.roll(off, -1, axis=0) if closed else off[1:]
    k, place = np.nonzero((off[: len(after)] < 0) != (after < 0))
    share = off[k, place] / (off[k, place] - after[k, place])
    angles = np.unwrap(np.append(grid.angles, grid.angles[:1]))
    wide = angles[k + 1] - angles[k]
    moment = angles[k] + share * wide
    back = rotation_z(-moment)
    X = T.apply(np.einsum("cji,cj->ci", back, at[place]))
    uv = camera.project(X)
    with np.errstate(invalid="ignore"):
        inside = ((uv > -0.5) & (uv < (camera.width - 0.5, camera.height - 0.5))).all(axis=1)
    from_table = T.inverse()
    return Crossings(
        place.astype(np.int32),
        ((k + (share > 0.5)) % len(grid.steps)).astype(np.int32),
        line_of(view, uv),
        np.asarray(inside),
        back @ from_table.translation,
        back @ from_table.apply(rig.light_source(grid.laser)),
        _switched_off(view, moment, np.minimum(share, 1.0 - share) * np.abs(wide)),
    )


def _switched_off(view: ScanCoverage, moment: Floats, kept: Floats) -> Bools:
    """(c,) True where a profile that was switched off is clearly nearer to a table angle (c,) than
    the grid's nearest one, ``kept`` (c,) rad away."""
    out = np.zeros(len(moment), dtype=np.bool_)
    if view.off is None or not len(view.off) or len(view.grid.angles) < 2:
        return out
    usual = float(np.median(np.abs(np.diff(np.unwrap(view.grid.angles)))))
    for angle in view.off:
        away = np.abs((moment - angle + np.pi) % (2 * np.pi) - np.pi)
        out |= away + _NEARER * usual < kept
    return out


def line_of(view: ScanCoverage, uv: Floats) -> Ints:
    """(c,) the picture's line of pixels (c, 2); the nearest one where they lie outside."""
    line = np.rint(uv[:, 1 if view.orientation == "vertical" else 0])
    kept = np.clip(np.nan_to_num(line), 0, view.grid.flags.shape[1] - 1)
    return np.asarray(kept, dtype=np.int32)
