"""What is odd about the steps of a turn: jumps, a slow start, harmonics and scatter, apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.findings import Finding

Indices = npt.NDArray[np.intp]

_HARMONICS = 3
_JUMP = 6.0
"""Robust standard deviations of the steps, from which one of them is a jump."""
_LEAST_JUMP = 0.15
"""Of a step: less is no lost or doubled step."""
_START = 8
"""Steps at the beginning that may be short because the table gathers way."""
_SHOWN = 5
_SURE = 4.0
_SENSIBLE = np.radians(0.1)
"""Amplitude or scatter below which a table counts as even."""
_REMEDY = "take each picture's angle from the markers, not from the step count"
_CAUSES = ("an axis beside that of the drive", "an elliptic drive", "a drive with three lobes")


def unevenness(
    k: Floats, angles: Floats, sigmas: Floats, good: Bools, names: Sequence[str]
) -> list[Finding]:
    """Findings about angles (n,) rad at step numbers ``k`` (n,), read where ``good``.

    A jump is a single step far off all others; a slow start are the first steps, all short (or all
    long); what is left is split into up to three harmonics of the table angle, where they earn
    their numbers (Bayes' information criterion), and scatter.
    """
    order = np.flatnonzero(good)[np.argsort(k[good], kind="stable")]
    order = order[np.concatenate([[True], np.diff(k[order]) > 0])]
    if len(order) < 4:
        return []
    dk = np.diff(k[order])
    turned = np.diff(angles[order])
    usual = float(np.median(turned / dk))
    off = turned - usual * dk
    noise = np.hypot(sigmas[order][1:], sigmas[order][:-1])
    spread = 1.4826 * float(np.median(np.abs(off - np.median(off))))
    wrong = np.abs(off) > np.maximum(np.maximum(_JUMP * spread, _SURE * noise),
                                     _LEAST_JUMP * abs(usual))  # fmt: skip
    slow = _start(off, noise, spread, usual)
    out = []
    if slow:
        out.append(_slow_start(k[order], off, slow, usual, names, order))
    jumps = np.flatnonzero(wrong)
    jumps = jumps[jumps >= slow]
    if len(jumps):
        out.append(_jumps(k[order], turned, dk, jumps, usual, names, order))
    odd = np.zeros(len(off), dtype=bool)
    odd[jumps] = True
    odd[:slow] = True
    even = np.concatenate([[0.0], np.cumsum(np.where(odd, 0.0, off))])
    return out + _smooth(angles[order], even, sigmas[order])


def _start(off: Floats, noise: Floats, spread: float, usual: float) -> int:
    """How many steps at the beginning are short, or long, beyond the scatter of the others."""
    limit = np.maximum(np.maximum(_SURE * spread, _SURE * noise), 0.05 * abs(usual))
    sense = np.sign(off[0])
    count = 0
    while count < min(_START, len(off) // 3) and sense * off[count] > limit[count]:
        count += 1
    return count if count > 1 or (count == 1 and sense * usual < 0) else 0


def _slow_start(
    k: Floats, off: Floats, count: int, usual: float, names: Sequence[str], order: Indices
) -> Finding:
    lost = float(off[:count].sum())
    way = "less" if lost * usual < 0 else "more"
    first, others = (
        ("step is", "another") if count == 1 else (f"{count} steps together are", f"{count} others")
    )
    return Finding(
        "calibrate.step-start",
        "warning",
        f"the table starts {'slowly' if way == 'less' else 'with a jump'}: the first {first} "
        f"{np.degrees(abs(lost)):.2f}° {way} than {others}",
        where=_place(k, 0, names, order),
        remedy=f"let the table turn a little before the first picture, or {_REMEDY}",
    )


def _jumps(
    k: Floats,
    turned: Floats,
    dk: Floats,
    jumps: Indices,
    usual: float,
    names: Sequence[str],
    order: Indices,
) -> Finding:
    worst = jumps[np.argsort(-np.abs(turned - usual * dk)[jumps])][:_SHOWN]
    each = [f"{np.degrees(turned[j]):+.2f}° instead of {np.degrees(usual * dk[j]):+.2f}°"
            for j in sorted(worst)]  # fmt: skip
    more = f" and {len(jumps) - len(each)} more" if len(jumps) > len(each) else ""
    return Finding(
        "calibrate.step-jump",
        "warning",
        f"{len(jumps)} of {len(turned)} steps jump: {', '.join(each)}{more}",
        where="; ".join(_place(k, int(j), names, order) for j in sorted(worst)),
        remedy=f"look for a motor that loses steps or a hand that touched the table; {_REMEDY}",
    )


def _place(k: Floats, j: int, names: Sequence[str], order: Indices) -> str:
    """Between which two pictures a step lies."""
    steps = f"step {k[j]:g} to {k[j + 1]:g}"
    if not names:
        return steps
    return f"{steps} ({names[order[j]]} to {names[order[j + 1]]})"


def _smooth(angles: Floats, off: Floats, sigmas: Floats) -> list[Finding]:
    """Harmonics and scatter of what is left of even motion."""
    n = len(angles)
    noise = float(np.median(sigmas))
    line = np.stack([np.ones(n), np.arange(n) / n], axis=1)
    waves = [f(m * angles) for m in range(1, _HARMONICS + 1) for f in (np.cos, np.sin)]
    turn = float(np.ptp(angles))
    plain = off - line @ np.linalg.lstsq(line, off, rcond=None)[0]
    rest = plain
    out = []
    if turn > np.pi and n > 4 * (2 * _HARMONICS + 2):
        design = np.concatenate([line, np.stack(waves, axis=1)], axis=1)
        solved = np.linalg.lstsq(design, off, rcond=None)[0]
        left = off - design @ solved
        better = n * np.log(max(float(left @ left), 1e-300) / max(float(plain @ plain), 1e-300))
        size = np.hypot(solved[2::2], solved[3::2])
        if better + 2 * _HARMONICS * np.log(n) < 0 and size.max() > max(_SENSIBLE, _SURE * noise):
            rest = left
            m = int(size.argmax())
            each = ", ".join(f"{np.degrees(s):.2f}° {i + 1}-fold" for i, s in enumerate(size))
            out.append(
                Finding(
                    "calibrate.step-harmonic",
                    "warning",
                    f"the table turns unevenly with its angle, amplitudes {each} a turn: "
                    f"{_CAUSES[m]} does so",
                    remedy=_REMEDY,
                )
            )
    scatter = float(np.std(np.diff(rest))) / np.sqrt(2)
    if scatter > max(_SENSIBLE, 2 * noise):
        out.append(
            Finding(
                "calibrate.step-uneven",
                "warning",
                f"besides jumps and harmonics the angles scatter by {np.degrees(scatter):.3f}° "
                f"about even motion; they are read to {np.degrees(noise):.3f}°",
                remedy=f"look for play in the drive; {_REMEDY}",
            )
        )
    return out
