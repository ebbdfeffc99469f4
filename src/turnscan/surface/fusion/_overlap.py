"""Overlaps: how surfaces of several lasers or scans lie to each other where both measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.findings import Finding
from turnscan.mesh import faces_about
from turnscan.points import RangeGrid
from turnscan.surface.fusion._range_surface import RangeSurface, spacing

_JUMP = 3.0
_SHARE = 0.02
"""Share of an overlap beyond three sigma from which it is worth a word; noise alone gives 0.3 %."""
_SAME_PART = 0.3
"""Share of what one laser measured round a part that another must have measured, too."""
_SAMPLES = 5_000
_PAIRS = 3
_ALIKE = 0.8
_KINK = 4.0
"""Fourth differences beyond this many of their own sigma are an edge of the part, not noise …"""
_FOURTH = 70.0**0.5
"""… whose sigma is this many of a point's: 1, 4, 6, 4 and 1 in squares."""


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

    met: int
    """Samples of the first that lie on a surface of the second, compared or not."""

    @property
    def disagreeing(self) -> float:
        """Share of the points that lie more than three combined sigma apart."""
        return float((self.ratios > _JUMP).mean()) if len(self.ratios) else 0.0


def overlaps(surfaces: Sequence[RangeSurface]) -> list[Overlap]:
    """How every two surfaces lie to each other where both were measured, by samples.

    A point of the one is compared with the other along that one's normal. Between two profiles the
    other is the cubic through four of them, along the line they share: a chord would lie inside a
    round part by more than noise. Its sigma is what the noise of the four makes of the cubic. Left
    out are places at the border of either surface and at edges of the part, where no polynomial
    runs through the profiles.
    """
    from scipy.spatial import cKDTree

    usual = spacing(surfaces)
    woven = [_Woven.of(s) for s in surfaces]
    # Nothing is looked for in the first.
    trees = [
        cKDTree(s.mesh.vertices, compact_nodes=False, balanced_tree=False) for s in surfaces[1:]
    ]
    out = []
    for i, one in enumerate(surfaces):
        X = one.mesh.vertices
        some = np.linspace(0, len(X) - 1, min(len(X), _SAMPLES)).astype(np.intp)
        for j in range(i + 1, len(surfaces)):
            other = surfaces[j]
            reach = 3 * usual + 10 * float(np.median(other.sigma))
            away, near = trees[j - 1].query(X[some], distance_upper_bound=reach)
            hit = np.flatnonzero(np.isfinite(away))
            a, b = some[hit], np.asarray(near)[hit].astype(np.int32)
            alike = np.einsum("ij,ij->i", one.normals[a], other.normals[b]) > _ALIKE
            found = _compared(woven[i], woven[j], a[alike], b[alike])
            if found is not None:
                out.append(found)
    return out


@dataclass(frozen=True)
class _Woven:
    """A surface, and how its profiles hang together."""

    surface: RangeSurface
    start: Longs
    numbers: Ints
    """The faces about each vertex, as `kernels.about` has them."""
    rank: Ints
    """(v,) which of the profiles."""
    before: Ints
    after: Ints
    """(v,) the vertex on the same line of the next profile; −1 where there is none."""
    second: Floats
    """(v, 3) mm: second difference from profile to profile."""
    smooth: Bools
    """(v,) True away from borders and edges."""
    noise: Floats
    """(v, 3) mm: sigma as a vector along the normal."""

    @classmethod
    def of(cls, s: RangeSurface) -> _Woven:
        from turnscan.surface.fusion import _overlap_kernels as kernels

        X, faces = s.mesh.vertices, s.mesh.faces
        before, after = s.neighbours
        second = kernels.differences(X, before, after)
        fourth = kernels.differences(second, before, after)
        noise = s.sigma[:, None] * s.normals
        with np.errstate(invalid="ignore"):
            bend = np.abs(np.einsum("ij,ij->i", s.normals, fourth))
            most = _KINK * _FOURTH * s.sigma
            smooth = kernels.inner(faces, len(X)) & (bend <= most)
        start, numbers = faces_about(faces, len(X))
        return cls(s, start, numbers, s.ranks, before, after, second, smooth, noise)


def _compared(one: _Woven, other: _Woven, a: Ints, b: Ints) -> Overlap | None:
    """The vertices ``a`` of one surface against the other about its nearest vertices ``b``."""
    from turnscan.surface.fusion import _overlap_kernels as kernels

    mesh, normals = other.surface.mesh, other.surface.normals[b]
    X = one.surface.mesh.vertices[a]
    which, weights, off = kernels.feet(
        X, normals, b, mesh.vertices, mesh.faces, other.start, other.numbers
    )
    there = which >= 0
    if not there.any():
        return None
    good = there & one.smooth[a]
    a, X, normals, off = a[good], X[good], normals[good], off[good]
    bulge, spread = kernels.between(
        which[good], weights[good], normals, mesh.vertices, mesh.faces,
        other.rank, (other.before, other.after), other.smooth, other.second, other.noise,
    )  # fmt: skip
    known = np.isfinite(bulge)
    own = np.einsum("ij,ij->i", normals, one.noise[a])
    off, combined = (off - bulge)[known], np.hypot(own, spread)[known]
    ratio = np.abs(off) / np.maximum(combined, 1e-12)
    names = _name(one.surface), _name(other.surface)
    return Overlap(*names, off, ratio, X[known], int(there.sum()))


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
        met[o.first, o.second] += o.met
    out = []
    for i, first in enumerate(round_it):
        for second in round_it[i + 1 :]:
            share = met[first, second] / max(asked[first], 1)
            if share < _SAME_PART:
                text = (
                    f"only {share:.0%} of the surface that one laser measured agrees with that of "
                    "the other: one of the laser sheets is mirrored, or belongs to another laser"
                )
                remedy = (
                    f"calibrate again; reconstruct each alone to see which of {first}, {second}"
                )
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
        remedy = "calibrate again, check for glare there, or take finer steps"
        where = f"{o.first} and {o.second}"
        out.append(Finding("surface.disagree", "warning", text, where, remedy))
    if len(apart) > _PAIRS:
        text = f"{len(apart)} of {len(found)} overlaps disagree; the largest {_PAIRS} are named"
        out.append(Finding("surface.disagree", "warning", text))
    return out
