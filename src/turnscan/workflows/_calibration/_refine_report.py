"""The report of a refinement: what moved, how well it is known, and what is still open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnscan.calibrate import Refined
from turnscan.workflows._pages import _html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TURN = 361
"""Places of a turn at which the table's error is drawn."""


def refine_html(done: Refined, scans: Sequence[str]) -> str:
    """The report as one HTML page."""
    parts = [
        _html.table(("", ""), _summary(done, scans)),
        _html.heading("What is still open"),
        _html.paragraph(f"Undetermined: {'; '.join(done.advice.undetermined) or 'nothing'}."),
        _html.paragraph(f"What would help most: {done.advice.text}."),
        _html.heading("Surfaces"),
        _html.picture(
            _gaps(done),
            "Distances between surfaces (or from the body) in each picture, rms over what the "
            "stripes' noise makes of them: 1 is noise alone.",
        ),
        _html.heading("Parameters"),
        _html.paragraph(
            "How far each moved with its standard uncertainty, and that of before; sizes of bodies "
            "and errors of the table: their value."
        ),
        _html.table(("parameter", "moved by, or value", "uncertainty before"), done.worded),
    ]
    if done.rig.motion is not None and np.any(done.rig.motion.values):
        parts.append(
            _html.picture(_table(done), "By how much the table is off its commanded angle, k = 2.")
        )
    if done.dropped:
        parts.append(_html.paragraph(f"Not asked for by the scan, and left out: {done.left_out}."))
    return _html.page("Refinement of a rig", parts)


def _summary(done: Refined, scans: Sequence[str]) -> list[tuple[str, str]]:
    rows = [
        ("scans", ", ".join(scans)),
        ("places where surfaces meet", str(done.places)),
        ("apart before", f"{done.gap_before:.3f} mm rms"),
        ("apart after", f"{done.gap_after:.3f} mm rms"),
        ("of that, noise makes", f"{done.gap_noise:.3f} mm rms"),
    ]
    if done.shape_before > 0:
        rows += [
            ("what the rig may bend, before", f"{done.shape_before:.3f} mm rms"),
            ("what the rig may bend, after", f"{done.shape_after:.3f} mm rms"),
        ]
    return rows


def _figure() -> Figure:
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(8, 3), layout="constrained")


def _gaps(done: Refined) -> Figure:
    fig = _figure()
    ax = fig.add_subplot()
    for block in done.fit.blocks:
        if block.views is None:
            continue
        views, which = np.unique(block.views, return_inverse=True)
        squares = np.bincount(which, block.residual**2) / np.bincount(which)
        ax.plot(views - views[0], np.sqrt(squares), ".", markersize=4, label=block.kind)
    ax.axhline(1.0, color="0.7", linewidth=0.8)
    ax.set(xlabel="picture", ylabel="distance / noise", ylim=(0, None))
    ax.legend(fontsize="small")
    return fig


def _table(done: Refined) -> Figure:
    assert done.rig.motion is not None
    fig = _figure()
    ax = fig.add_subplot()
    turn = np.linspace(0.0, 2 * np.pi, _TURN)
    off = np.degrees(done.rig.motion.angle(turn) - turn)
    wide = 2 * np.degrees(done.rig.motion.sigma(turn))
    ax.plot(np.degrees(turn), off)
    ax.fill_between(np.degrees(turn), off - wide, off + wide, alpha=0.3, linewidth=0)
    ax.set(xlabel="commanded angle (°)", ylabel="off (°)")
    return fig
