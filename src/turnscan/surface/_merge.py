"""Merge: the surfaces of several lasers, passes or scans → one, and where they disagree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.points import RangeGrid
from turnscan.surface._grid_mesh import Tears
from turnscan.surface._mesh import Mesh
from turnscan.surface._paste import paste
from turnscan.surface._polar import merge_polar, polar_grid
from turnscan.surface._range_surface import RangeSurface, range_surfaces
from turnscan.surface._tsdf import fuse

How = Literal["auto", "grid", "tsdf", "paste"]
_JUMP = 3.0
_SHARE = 0.02
"""Share of an overlap beyond three sigma from which it is worth a word; noise alone gives 0.3 %."""
_SAME_PART = 0.3
"""Share of what one laser measured round a part that another must have measured, too."""
_SAMPLES = 5_000
_PAIRS = 3
_ALIKE = 0.8


@dataclass(frozen=True)
class Overlap:
    """How two surfaces lie to each other where both were measured."""

    first: str
    second: str
    offsets: Floats
    """(m,) mm: distance of points of the first from the second, positive outside."""
    ratios: Floats
    """(m,) the same, absolute, in combined sigma."""
    places: Floats
    """(m, 3) mm: those points."""

    @property
    def disagreeing(self) -> float:
        """Share of the points that lie more than three combined sigma apart."""
        return float((self.ratios > _JUMP).mean())


def merge(
    grids: Sequence[RangeGrid],
    tears: Tears | None = None,
    how: How = "auto",
    voxel: float | None = None,
) -> tuple[Mesh, list[Finding]]:
    """One mesh from the grids of several lasers or scans, and what there is to know about it.

    ``grid`` averages in cells of angle and height (parts with one radius at each); ``tsdf`` in
    voxels of ``voxel`` mm (None: the usual spacing of the points), for all parts; ``paste`` keeps
    every measured point and averages nothing (`paste`). ``auto`` pastes a single grid, and merges
    several by ``grid`` where the part allows it and the table turned, else by ``tsdf``.

    The order of the grids does not matter, to the last bit, as long as their lasers have names of
    their own.

    Raises InputError where a merge needs what the grids do not know, LimitExceeded for voxels too
    small for the part.
    """
    t = tears or Tears()
    # By name and place in the scan, so that the order in which they come changes nothing.
    grids = sorted(grids, key=lambda g: (g.laser, *g.steps[:1], *g.angles[:1]))
    there = [g for g in grids if g.found.any()]
    if how == "paste" or (how == "auto" and len(there) < 2) or not there:
        return paste(grids, t), []
    surfaces = [s for g in there for s in range_surfaces(g, t) if len(s.mesh.faces)]
    if not surfaces:
        return paste(grids, t), []
    found = overlaps(surfaces)
    findings = [*apart_findings(there, surfaces, found), *overlap_findings(found)]
    turns = all(len(g.angles) > 2 and np.ptp(g.angles) > 0 for g in there)
    if how == "grid" and not turns:
        raise InputError(
            "scans without a turning table have no angle to merge by", hint="use --merge tsdf"
        )
    if turns and how != "tsdf":
        cells = polar_grid(surfaces, _steps(there), _spacings(surfaces)[0])
        why = f"{cells.several:.1%} of the cells have several radii, {cells.flat:.0%} is level"
        if how == "grid" or cells.fits:
            mesh, off = merge_polar(cells, surfaces, t)
            text = f"{len(there)} grids merged in angle and height ({why}); {off} cells disagreed"
            return mesh, [
                *findings,
                Finding("surface.merge", "note", text, "", "other ways: --merge tsdf|paste"),
            ]
    else:
        why = "asked for" if how == "tsdf" else "the scans have no common axis"
    size = _spacings(surfaces)[1] if voxel is None else voxel
    sigma = float(np.median(np.concatenate([s.sigma for s in surfaces])))
    ramp = min(max(2.5 * size, 3 * sigma), 6 * size)
    text = f"{len(there)} grids merged in voxels of {size:.3g} mm, ramp {ramp:.3g} mm ({why})"
    findings.append(Finding("surface.merge", "note", text, "", "other ways: --merge grid|paste"))
    return fuse(surfaces, size, ramp), findings


def _steps(grids: Sequence[RangeGrid]) -> int:
    """Cells round the turn: as many as the usual step of the finest grid makes."""
    usual = min(float(np.median(np.abs(np.diff(np.unwrap(g.angles))))) for g in grids)
    return max(8, round(2 * np.pi / max(usual, 1e-4)))


def _spacings(surfaces: Sequence[RangeSurface]) -> tuple[float, float]:
    """The usual distance in height between points of a profile, and that between points, mm."""
    from turnscan.surface import _face_kernels as kernels

    rises, areas = [], []
    for s in surfaces:
        p, X, faces = s.mesh.provenance, s.mesh.vertices, s.mesh.faces
        if p is not None:
            rises.append(kernels.rises(X, faces, p.step))
        size = np.linalg.norm(kernels.crosses(X, faces), axis=1)
        areas.append(size[size > 0])
    area = float(np.median(np.concatenate(areas)))
    rise = np.concatenate([np.zeros(0), *rises])
    return float(np.median(rise)) if len(rise) else np.sqrt(area), float(np.sqrt(area))


def overlaps(surfaces: Sequence[RangeSurface]) -> list[Overlap]:
    """How every two surfaces lie to each other where both were measured, by samples.

    A point is compared with the tangent plane of the nearest vertex of the other surface, where
    that is no further along the plane than its faces reach and the normals are alike.
    """
    from scipy.spatial import cKDTree

    normals = [s.normals for s in surfaces]
    sigmas = [s.sigma for s in surfaces]
    trees = [cKDTree(s.mesh.vertices, compact_nodes=False, balanced_tree=False) for s in surfaces]
    spacing = _spacings(surfaces)[1]
    out = []
    for i, one in enumerate(surfaces):
        X = one.mesh.vertices
        some = np.linspace(0, len(X) - 1, min(len(X), _SAMPLES)).astype(np.intp)
        for j in range(i + 1, len(surfaces)):
            other = surfaces[j]
            reach = 3 * spacing + 10 * float(np.median(sigmas[j]))
            away, near = trees[j].query(X[some], distance_upper_bound=reach)
            hit = np.flatnonzero(np.isfinite(away))
            a, b = some[hit], np.asarray(near)[hit]
            gap = X[a] - other.mesh.vertices[b]
            off = np.einsum("ij,ij->i", gap, normals[j][b])
            beside = np.sqrt(np.maximum(np.einsum("ij,ij->i", gap, gap) - off**2, 0.0))
            alike = np.einsum("ij,ij->i", normals[i][a], normals[j][b]) > _ALIKE
            good = alike & (beside <= spacing)
            if not good.any():
                continue
            a, b, off = a[good], b[good], off[good]
            combined = np.hypot(sigmas[i][a], sigmas[j][b])
            ratio = np.abs(off) / np.maximum(combined, 1e-12)
            out.append(Overlap(_name(one), _name(other), off, ratio, X[a]))
    return out


def _name(s: RangeSurface) -> str:
    p = s.mesh.provenance
    return p.lasers[0] if p is not None else ""


def apart_findings(
    grids: Sequence[RangeGrid], surfaces: Sequence[RangeSurface], found: Sequence[Overlap]
) -> list[Finding]:
    """Findings on lasers that went round the same part and saw different ones.

    Each measures most of what the other does; a sheet with its normal mirrored, or another laser's,
    puts the part elsewhere or inside out.
    """
    round_it = list(dict.fromkeys(g.laser for g in grids if g.closed))
    asked, met = Counter[str](), Counter[tuple[str, str]]()
    for s in surfaces:
        asked[_name(s)] += min(len(s.mesh.vertices), _SAMPLES)
    for o in found:
        met[o.first, o.second] += len(o.ratios)
    out = []
    for i, first in enumerate(round_it):
        for second in round_it[i + 1 :]:
            share = met[first, second] / max(asked[first], 1)
            if share < _SAME_PART:
                text = (
                    f"only {share:.0%} of what the one measured is a surface of the other: one of "
                    "the two sheets is mirrored, or belongs to another laser"
                )
                remedy = f"calibrate again; look at each alone to see which of {first}, {second}"
                where = f"{first} and {second}"
                out.append(Finding("surface.apart", "warning", text, where, remedy))
    return out


def overlap_findings(found: Sequence[Overlap]) -> list[Finding]:
    """Findings on surfaces that lie further apart than their sigma explains, the worst first."""
    apart = sorted(
        (o for o in found if o.disagreeing > _SHARE), key=lambda o: -o.disagreeing * len(o.ratios)
    )
    out = []
    for o in apart[:_PAIRS]:
        beyond = o.ratios > _JUMP
        x, y, z = np.median(o.places[beyond], axis=0)
        text = (
            f"{o.disagreeing:.0%} of what both measured lies beyond 3 sigma, by "
            f"{np.median(np.abs(o.offsets[beyond])):.3f} mm about ({x:.0f}, {y:.0f}, {z:.0f}) mm; "
            f"over all {np.median(o.offsets):+.3f} mm"
        )
        remedy = "calibrate again, or look there for glare"
        where = f"{o.first} and {o.second}"
        out.append(Finding("surface.disagree", "warning", text, where, remedy))
    if len(apart) > _PAIRS:
        text = f"{len(apart)} of {len(found)} overlaps disagree; the largest {_PAIRS} are named"
        out.append(Finding("surface.disagree", "warning", text))
    return out
