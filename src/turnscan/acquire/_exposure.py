"""Exposure: found by a few test pictures, bracketed, and checked to be obeyed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Image
from turnscan.devices import Camera, frame_deadline
from turnscan.errors import InputError
from turnscan.findings import Finding

LOW, HIGH = 0.6, 0.8
"""Of the scale: where the brightest part of the stripe belongs."""
_AIM = 0.7
_CLIPPED = 0.98
_BRIGHT = 99.0
"""Percentile of the row peaks that is brought there: the brightest rows may be a highlight."""
_FEWER = 0.25
"""What a clipped picture, which does not say by how much, is shortened to."""
_TRIES = 10
_MORE = 16.0
"""The most that one step lengthens: what is seen in a dark picture is mostly noise."""


@dataclass(frozen=True)
class FoundExposure:
    """What `auto_exposure` found."""

    seconds: float
    """Exposure time as the camera accepted it."""
    gain: float
    """Gain factor as the camera accepted it, NaN where it does not tell."""
    peak: float
    """Of the scale: 99th percentile of the row peaks at that exposure."""
    reached: bool
    """Whether ``peak`` lies between the wanted limits."""
    pictures: int
    """Test pictures that it took."""


def stripe_peak(image: Image) -> float:
    """Share of the scale that the brightest rows reach: the 99th percentile of the row maxima.

    In a picture in which fewer rows see the stripe, it is the 99th percentile of those that stand
    out of the rest by more than half of the highest.
    """
    flat = image.max(axis=2) if image.ndim == 3 else image
    peaks = flat.max(axis=1).astype(np.float64)
    floor = float(np.median(flat))
    seen = peaks[peaks > floor + 0.5 * (peaks.max() - floor)]
    top = float(np.iinfo(image.dtype).max)
    return float(np.percentile(seen if len(seen) else peaks, _BRIGHT)) / top


def auto_exposure(
    camera: Camera,
    seconds: float,
    *,
    gain: float = 1.0,
    shortest: float = 1e-4,
    longest: float = 1.0,
    low: float = LOW,
    high: float = HIGH,
    light: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> FoundExposure:
    """Bring the stripe that the camera sees to 60 to 80 % of the scale.

    ``light`` lights the laser for one picture, where it is not lit anyway; the brightest part of
    the object must be turned into it. Each test picture tells the next exposure; cameras with
    gamma take one or two more. Where the limits or the camera do not let it get there,
    ``reached`` is False and the best that was met is returned.

    Raises InputError for limits that cannot be, and DeviceError as the camera does.
    """
    if not 0.0 < shortest <= seconds <= longest < math.inf or not 0.0 < low < high < _CLIPPED:
        raise InputError(
            f"exposure {seconds:g} s within {shortest:g} s to {longest:g} s, peak {low:g} to "
            f"{high:g}: not in order"
        )
    aim = _AIM if low < _AIM < high else 0.5 * (low + high)
    seen: list[FoundExposure] = []
    clear, clipped = 0.0, math.inf
    asked = seconds
    for count in range(1, _TRIES + 1):
        accepted, amplified = camera.configure(asked, gain)
        now = asked if math.isnan(accepted) else accepted
        with light():
            image = camera.grab(frame_deadline(now, first=count == 1))
        peak = stripe_peak(image)
        seen.append(FoundExposure(now, amplified, peak, low <= peak <= high, count))
        if seen[-1].reached:
            return seen[-1]
        if peak < low:
            clear = max(clear, now)
        else:
            clipped = min(clipped, now)
        power = _steepness(seen)
        factor = _FEWER if peak >= _CLIPPED else (aim / max(peak, 1e-3)) ** (1.0 / power)
        wanted = now * min(factor, _MORE)
        if not clear < wanted < clipped:  # gamma, black level or noise: half way, in stops
            wanted = math.sqrt(clear * clipped) if clear > 0.0 and clipped < math.inf else wanted
        wanted = min(max(wanted, shortest), longest)
        if math.isclose(wanted, asked, rel_tol=1e-3) or math.isnan(accepted):
            break
        asked = wanted
    best = min(
        seen, key=lambda e: (e.peak, e.seconds) if e.peak >= _CLIPPED else (0.0, abs(aim - e.peak))
    )
    camera.configure(best.seconds, gain)
    return FoundExposure(best.seconds, best.gain, best.peak, False, len(seen))


def _steepness(seen: Sequence[FoundExposure]) -> float:
    """The power of the exposure that the peak follows: 1, or less for a camera with gamma."""
    a, b = (seen[-2], seen[-1]) if len(seen) > 1 else (seen[-1], seen[-1])
    if max(a.peak, b.peak) >= _CLIPPED or math.isclose(a.seconds, b.seconds, rel_tol=0.1):
        return 1.0
    rise = math.log(max(b.peak, 1e-3) / max(a.peak, 1e-3)) / math.log(b.seconds / a.seconds)
    return min(max(rise, 0.4), 1.0)


def bracket(
    camera: Camera, seconds: Sequence[float], *, gain: float = 1.0, timeout: float | None = None
) -> list[tuple[Image, float]]:
    """One picture with each exposure, and the exposures as the camera accepted them.

    Raises DeviceError as the camera does.
    """
    taken = []
    for wanted in seconds:
        accepted, _ = camera.configure(wanted, gain)
        limit = frame_deadline(wanted) if timeout is None else timeout
        taken.append((camera.grab(limit), wanted if math.isnan(accepted) else accepted))
    return taken


def exposure_findings(camera: Camera, seconds: float, gain: float = 1.0) -> list[Finding]:
    """Does the camera do what it says? Two exposures of the same scene, before a scan.

    A setting that is not the one asked for, one that cannot be set, and one that is accepted but
    changes nothing in the picture are named. The scene must not be dark. Raises DeviceError as
    the camera does; the exposure is ``seconds`` afterwards.
    """
    found = []
    (short, at_short), (long, at_long) = bracket(camera, (0.25 * seconds, seconds), gain=gain)
    accepted, amplified = camera.configure(seconds, gain)
    for name, want, got in (("exposure", seconds, accepted), ("gain", gain, amplified)):
        if math.isnan(got):
            found.append(
                Finding(
                    f"devices.{name}-unknown",
                    "warning",
                    f"this camera does not allow its {name} to be set, or does not report it",
                    remedy="check with the camera's own program that it is fixed, not automatic",
                )
            )
        elif abs(got - want) > 0.05 * want:
            found.append(
                Finding(
                    f"devices.{name}-differs",
                    "warning",
                    f"{name} {want:g} was requested, the camera set {got:g}",
                    remedy="choose a value that the camera accepts",
                )
            )
    if math.isnan(accepted):
        return found
    expected = at_long / at_short
    dark, light = _level(short), _level(long)
    if expected > 1.5 and light - dark < 0.1 * max(light, 1.0):
        found.append(
            Finding(
                "devices.exposure-ignored",
                "error",
                f"{expected:.3g} times the exposure changed the picture from {dark:.1f} to "
                f"{light:.1f} grey levels: the camera ignores it or adapts, or no light reaches it",
                remedy="switch automatic exposure off; add light; remove the lens cap",
            )
        )
    return found


def _level(image: Image) -> float:
    """A grey level that follows the exposure: the upper tenth, without what is clipped."""
    values = image[image < np.iinfo(image.dtype).max]
    return float(np.percentile(values, 90.0)) if values.size else float(np.iinfo(image.dtype).max)
