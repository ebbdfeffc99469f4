"""The table's angle in one picture, read from the markers on the platter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.calibrate._markers import detect_markers
from turnscan.findings import Finding
from turnscan.rig import Rig

_ROUNDS = 15
_HUBER = 2.0
_AGREE_PX = 6.0  # a marker this far from where the others put it is not on the platter
_MOVED_PX, _USUAL_WIDTH = 1.5, 1280  # calibrations leave 0.1 to 0.5 px in pictures of that width
_LEAST_SIGMA_PX = 0.05  # corners of real markers are never better than this


@dataclass(frozen=True)
class TableAngle:
    """The angle of the table in one picture."""

    angle: float
    """rad in [-π, π), counter-clockwise seen from above."""
    sigma: float
    """rad, standard uncertainty from the scatter of the corners."""
    residual_px: float
    """rms distance of the corners from where the rig puts them, px."""
    markers: tuple[int, ...]
    """Numbers of the markers that were used."""


@dataclass(frozen=True)
class Platter:
    """The platter as its markers show it in one picture."""

    angle: TableAngle | None
    """None where no marker of the rig is seen, or where those seen contradict the rig."""
    off: float
    """px by which half of the corners are farther from where the rig puts them, the table turned as
    fits them best; NaN where none is seen."""


def platter_seen(image: Image, rig: Rig) -> Platter:
    """The platter in a picture (H, W) or (H, W, 3), by the rig's markers.

    One visible marker is enough for its angle. Raises ValueError when the rig has no markers or
    another picture size.
    """
    seen = _markers_seen(image, rig)
    if not seen:
        return Platter(None, float("nan"))
    first = _fitted(rig, seen)
    return Platter(_agreeing(rig, seen, first), first.off)


def _markers_seen(image: Image, rig: Rig) -> list[tuple[int, Floats, Floats]]:
    """The rig's markers in a picture, each as (number, corners (4, 3) mm, pixels (4, 2))."""
    if not rig.markers:
        raise ValueError("this rig has no table markers")
    if image.shape[:2] != (rig.camera.height, rig.camera.width):
        raise ValueError(
            f"picture {image.shape[1]}×{image.shape[0]} px, but the rig's camera has "
            f"{rig.camera.width}×{rig.camera.height}"
        )
    layout = {(m.dictionary, m.number): m.corners for m in rig.markers}
    seen: list[tuple[int, Floats, Floats]] = []
    for dictionary in sorted({m.dictionary for m in rig.markers}):
        view = detect_markers(image, dictionary)
        for number, corners in zip(view.numbers, view.corners, strict=True):
            known = layout.get((dictionary, int(number)))
            if known is not None:
                seen.append((int(number), known, corners))
    return seen


def markers_off(rig: Rig, seen: Sequence[tuple[int, Floats, Floats]]) -> float:
    """`Platter.off` of markers given as (number, corners (4, 3) mm, pixels (4, 2))."""
    return _fitted(rig, seen).off if seen else float("nan")


def moved_platter(rig: Rig, off: Sequence[float]) -> list[Finding]:
    """A warning where most pictures show the platter's markers beside their places; ``off`` are
    `Platter.off` of each."""
    seen = np.array([one for one in off if not np.isnan(one)])
    px = float(np.median(seen)) if len(seen) else 0.0
    if px <= _MOVED_PX * max(1.0, rig.camera.width / _USUAL_WIDTH):
        return []
    mm = px * float(np.linalg.norm(rig.T_camera_table.translation)) / rig.camera.fx
    return [
        Finding(
            "scan.rig-moved",
            "warning",
            f"the markers on the platter are {px:.1f} px, about {mm:.1f} mm, beside where the rig "
            "puts them: camera or table has moved since it was calibrated",
            f"{len(seen)} picture" + ("s" if len(seen) > 1 else ""),
            "calibrate again, from pictures of the table and of each laser",
        )
    ]


@dataclass(frozen=True)
class _Fitted:
    """One angle for all corners, and what is left of them, px."""

    angle: float
    residual: Floats
    slope: Floats
    weight: Floats

    @property
    def off(self) -> float:
        return float(np.median(np.linalg.norm(self.residual, axis=1)))


def _fitted(rig: Rig, seen: Sequence[tuple[int, Floats, Floats]]) -> _Fitted:
    start = _median_angle(np.array([_start(rig, mm, px) for _, mm, px in seen]))
    points = np.concatenate([mm for _, mm, _ in seen])
    pixels = np.concatenate([px for _, _, px in seen])
    return _Fitted(*_refine(rig, points, pixels, start))


def table_angle(rig: Rig, seen: Sequence[tuple[int, Floats, Floats]]) -> TableAngle | None:
    """Angle of the table from markers given as (number, corners (4, 3) mm, pixels (4, 2))."""
    return _agreeing(rig, seen, _fitted(rig, seen)) if seen else None


def _agreeing(
    rig: Rig, seen: Sequence[tuple[int, Floats, Floats]], fit: _Fitted
) -> TableAngle | None:
    """The angle, the worst markers left out one by one until the others agree; ``fit`` is that of
    all."""
    left = list(seen)
    while True:
        residual, weight = fit.residual, fit.weight
        worst = np.linalg.norm(residual.reshape(len(left), 4, 2), axis=2).mean(axis=1)
        if worst.max() <= _AGREE_PX:
            rms = float(np.sqrt((weight * residual**2).sum() * 2 / weight.sum()))
            scatter = np.sqrt((weight * residual**2).sum() / max(residual.size - 1, 1))
            sigma = max(float(scatter), _LEAST_SIGMA_PX) / np.sqrt((weight * fit.slope**2).sum())
            wrapped = (fit.angle + np.pi) % (2 * np.pi) - np.pi
            return TableAngle(float(wrapped), float(sigma), rms, tuple(n for n, _, _ in left))
        del left[int(worst.argmax())]
        if not left:
            return None
        fit = _fitted(rig, left)


def _start(rig: Rig, corners_mm: Floats, pixels: Floats) -> float:
    """Lay the marker's pixels on its plane of the table; by how much must it turn to get there?"""
    T = rig.T_camera_table
    normal = T.rotation[:, 2]
    centre = corners_mm.mean(axis=0)
    level = normal @ (T.translation + normal * centre[2])
    rays = rig.camera.rays(pixels)
    laid = T.inverse().apply(rays * (level / (rays @ normal))[:, None])
    # Edges turn with the table just as the centre does, and serve a marker near the axis too.
    here = np.concatenate([laid - laid.mean(axis=0), laid.mean(axis=0, keepdims=True)])
    there = np.concatenate([corners_mm - centre, centre[None]])
    sine = (there[:, 0] * here[:, 1] - there[:, 1] * here[:, 0]).sum()
    return float(np.arctan2(sine, (there[:, :2] * here[:, :2]).sum()))


def _median_angle(angles: Floats) -> float:
    """The one of the angles that is nearest to all others on the circle."""
    apart = np.abs(np.angle(np.exp(1j * (angles[:, None] - angles[None]))))
    return float(angles[apart.sum(axis=1).argmin()])


def _refine(
    rig: Rig, points: Floats, pixels: Floats, angle: float
) -> tuple[float, Floats, Floats, Floats]:
    """Gauss-Newton on one angle with Huber weights → angle, residual, slope, weight (n, 2)."""
    T = rig.T_camera_table

    def project(a: float) -> Floats:
        turn, shift = rig.turning(a)
        return rig.camera.project(T.apply(points @ turn.T + shift))

    small = 1e-5
    weight = np.ones_like(pixels)
    for _ in range(_ROUNDS):
        residual = pixels - project(angle)
        slope = (project(angle + small) - project(angle - small)) / (2 * small)
        scale = max(1.4826 * float(np.median(np.abs(residual))), _LEAST_SIGMA_PX)
        off = np.linalg.norm(residual, axis=1, keepdims=True) / (_HUBER * scale)
        weight = np.broadcast_to(1.0 / np.maximum(off, 1.0), residual.shape)
        step = float((weight * slope * residual).sum() / (weight * slope**2).sum())
        angle += step
        if abs(step) < 1e-10:
            break
    return angle, pixels - project(angle), slope, weight
