"""The stripes of a scan as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Flags, Floats, Ints
from turnscan.detection import detect_scan, look_through
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan, ScanPlan, lit_in, rig_for
from turnscan.stripes import Detector, Orientation, Stripe
from turnscan.workflows._options._reconstruct import ReconstructOptions


@dataclass(frozen=True, eq=False)
class ScanStripes:
    """The stripes of one laser in all its frames; a line is an image row of a vertical stripe."""

    laser: str
    steps: Ints
    """(s,) step numbers, in the order of the frames."""
    angles: Floats
    """(s,) rad, table angles; NaN where not known."""
    position: Floats
    """(s, n) px across the stripe, NaN where there is none."""
    sigma: Floats
    """(s, n) px standard uncertainty of ``position``, NaN where there is none."""
    amplitude: Floats
    """(s, n) grey levels above the background, NaN where there is none."""
    width: Floats
    """(s, n) px rms, NaN where there is none."""
    flags: Flags
    """(s, n) bits of `turnscan.stripes.StripeFlag`."""
    scatter: Floats
    """(s,) px: how far the centres of each frame scatter for their width (`Stripe.scatter`)."""
    orientation: Orientation
    halo: Floats
    """(s, n) px by which halos are estimated to move ``position``, NaN where nothing tells."""
    skew: Floats
    """(s, n) third standardised moment of the light (`Stripe.skew`), NaN where there is none."""

    @property
    def found(self) -> Bools:
        """(s, n) True where there is a centre."""
        return ~np.isnan(self.position)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.steps)

    def stripe(self, k: int) -> Stripe:
        """The stripe of the k-th frame."""
        own = (self.position[k], self.sigma[k], self.amplitude[k], self.width[k])
        more = float(self.scatter[k]), self.halo[k], self.skew[k]
        return Stripe(*own, self.flags[k], self.orientation, *more)


def stripes_of(
    scan: Scan,
    laser: str | None,
    options: ReconstructOptions,
    rig: Rig | None = None,
    detector: Detector | None = None,
    progress: Progress = no_progress,
) -> ScanStripes:
    """The stripes of a laser (None: the first) of a scan; `OpenScan.stripes` says more.

    Raises InputError where there is no such laser, ScanCorrupt naming a frame.
    """
    known = rig or scan.rig
    settings = options.settings() if known is None else options.settings(known, scan)
    look = settings.stripes if detector is None else replace(settings.stripes, strategy=detector)
    if known is None:
        name = _one_of(laser, scan.plan.lasers, scan)
        look = replace(look, orientation=scan.plan.orientation)
        tick = progress.counter(len(scan.steps(name)))
        _, done = look_through(scan, name, look, tick=tick)
        steps, angles, found, _ = zip(*done, strict=True) if done else ((), (), (), ())
        return _arrays(name, steps, np.array(angles), found, scan.plan)
    used = rig_for(scan, known)
    names = [n for lit in scan.plan.lasers for n in lit_in(lit, used)]
    name = _one_of(laser, names, scan)
    looks = [lit for lit in scan.plan.lasers if name in lit_in(lit, used)]
    tick = progress.counter(sum(len(scan.steps(lit)) for lit in looks))
    (sight,) = detect_scan(scan, used, look, settings.volume, tick, name)
    s = sight.stripes
    return _arrays(name, s.steps, s.angles, s.stripes, scan.plan)


def _one_of(laser: str | None, names: Sequence[str], scan: Scan) -> str:
    if laser is not None and laser not in names:
        raise InputError(f"{scan.path}: no laser {laser!r}", hint=f"it has {', '.join(names)}")
    return names[0] if laser is None else laser


def _arrays(
    laser: str, steps: Sequence[int], angles: Floats, found: Sequence[Stripe], plan: ScanPlan
) -> ScanStripes:
    lines = plan.height if plan.orientation == "vertical" else plan.width

    nothing = np.full(lines, np.nan)

    def rows(name: str) -> Floats:
        values = (getattr(s, name) for s in found)
        measured = [nothing if v is None else v for v in values]
        return np.array(measured).reshape(len(found), lines)

    flags = rows("flags").astype(np.uint16)
    numbers = np.array(steps, np.int32)
    return ScanStripes(
        laser,
        numbers,
        np.array(angles),
        rows("position"),
        rows("sigma"),
        rows("amplitude"),
        rows("width"),
        flags,
        np.array([s.scatter for s in found], np.float64),
        plan.orientation,
        rows("halo"),
        rows("skew"),
    )
