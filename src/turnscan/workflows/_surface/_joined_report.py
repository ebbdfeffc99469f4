"""Tables of a report on joined poses: where they lie, and how they agree."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from turnscan.poses import Alignment
from turnscan.workflows._surface._report import ReportTable


def joined_tables(found: Alignment) -> list[ReportTable]:
    """Tables of where the poses lie, and how they agree."""
    placed_at: list[dict[str, Any]] = []
    for i, (name, pose, fit) in enumerate(zip(found.names, found.poses, found.fits, strict=True)):
        spread = np.sqrt(np.diagonal(found.covariance[i]))
        placed_at.append(
            {
                "pose": name,
                "rotation": pose.rotation.tolist(),
                "translation_mm": pose.translation.tolist(),
                "sigma_turn_deg": float(np.rad2deg(spread[:3].max())),
                "sigma_shift_mm": float(spread[3:].max()),
                "shared": fit.shared,
                "free": [str(f) for f in found.freedoms if f.view == i],
            }
        )
    where = [
        [
            p["pose"], f"{p['sigma_turn_deg']:.4f}", f"{p['sigma_shift_mm']:.4f}",
            f"{p['shared']:.0%}", "; ".join(p["free"]) or "nothing",
        ]
        for p in placed_at
    ]  # fmt: skip
    apart = [
        [m.first, m.second, m.points, f"{m.mean:+.4f}", f"{m.rms:.4f}", f"{m.sigmas:.2f}"]
        for m in found.meetings
    ]
    return [
        ReportTable(
            "Poses",
            ["pose", "turn, sigma °", "shift, sigma mm", "on the others", "not determined"],
            where,
            "poses",
            placed_at,
        ),
        ReportTable(
            "Overlaps",
            ["first", "second", "places", "mean, mm", "rms, mm", "rms, sigma"],
            apart,
            "overlaps",
            [asdict(m) for m in found.meetings],
        ),
    ]
