"""The volume within a surface, and how well it is known.

The parts of the uncertainty are derived in ``docs/explain/accuracy.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh, opposite_half_edges, vector_areas
from turnscan.shapes._added import added_part
from turnscan.shapes._hollow import hollow_sigma
from turnscan.shapes._passed import passed_by, passed_sigma
from turnscan.shapes._shared import Source, common_moves, moved, profile_sigma

_WIDEST = 0.95
"""Share of the sides whose faces are as wide as they count; wider ones cross a gap or an edge."""


@dataclass(frozen=True)
class VolumeSigma:
    """Standard uncertainties of a volume, mm³, by their causes; of a mesh, or of a solid of it."""

    noise: float
    """Of the points, independent from one to the next; NaN where their sigma is not known."""
    between: float
    """By what the surface bulges between its points."""
    filled: float
    """By the filled faces and never measured (`Added.sigma`)."""
    profiles: float = 0.0
    """By what a merge put between the profiles."""
    shared: float = 0.0
    """By what all points have in common: the rig's calibration, and where the poses lie."""

    alike: float = 0.0
    """By what points at edges, creases and between profiles may have in common."""

    hollow: float = 0.0
    """By bores and pockets that fillings may cover (`hollow_sigma`): it can only be too large."""

    passed: float = 0.0
    """By measured points that the fillings pass by (`passed_sigma`)."""

    added: float = 0.0
    """mm³ that the fillings hold beyond straight fans over their borders; part of the volume."""

    shapes: float = 0.0
    """Of a solid, by its faces on shapes, as points and calibration give these."""

    left: float = 0.0
    """Of a solid, by what it leaves of measured points that lie on no shape."""

    @property
    def measured(self) -> float:
        """Of the measured part, whatever was filled; NaN where the noise is not known. What the
        calibration does may be alike on shapes and on the rest."""
        common = self.shared + self.shapes
        own = (self.noise, self.between, self.alike, self.profiles, self.left, common)
        return float(np.sqrt(sum(part**2 for part in own)))

    @property
    def unmeasured(self) -> float:
        """Of what was filled, of what may lie behind it, and of points that it passes by."""
        return float(np.sqrt(self.filled**2 + self.hollow**2 + self.passed**2))

    @property
    def total(self) -> float:
        """All together; NaN where the noise is not known."""
        return float(np.hypot(self.measured, self.unmeasured))

    @property
    def mostly(self) -> str:
        """What the largest part comes from, in words."""
        parts = {
            "the points' noise": np.nan_to_num(self.noise),
            "the curvature between the points": self.between,
            "the edges": self.alike,
            "the filled faces": self.filled,
            "what fillings may cover": self.hollow,
            "measured points beside the filled faces": self.passed,
            "the interpolation between the profiles": self.profiles,
            "the calibration": self.shared,
            "the shapes": self.shapes,
            "what lies on no shape": self.left,
        }
        return max(parts, key=lambda k: parts[k])


def volume_sigma(
    mesh: Mesh,
    source: Source | None = None,
    faces: Bools | None = None,
    moves: Sequence[Floats] | None = None,
) -> VolumeSigma:
    """How well the volume within a closed mesh is known, as far as its ``source`` is.

    With ``faces`` (f,) only these are in doubt, the others lie on something that is known better;
    what fillings hide counts all the same. ``moves`` are the `common_moves` of both, where they
    are worked out already.

    - noise: √Σ(aᵢσᵢ)² over the vertices, aᵢ a third of the vector area of the faces about i and
      σᵢ their sigma, the usual one at most.
    - alike: Σ aᵢ √(σᵢ² − usual²): beyond the usual it is edges, creases and chords that move a
      point, and its neighbours the same way, which does not average out.
    - between: Σ l θ w²/12 over the sides that were measured, l their length, θ the angle between
      the faces there, positive where they make a ridge, w the mean of their heights over it: a
      surface of curvature k stands w²k/12 above its chords of length w on average, and ½ Σ l θ is
      the integral of its mean curvature (Steiner), sharp edges included. Ridges and valleys make up
      for each other.
    - filled: what the fillings may be wrong by (`added_part`).
    - hollow: what bores and pockets behind them may take from it, where the ``source`` tells what
      was in sight (`hollow_sigma`).
    - passed: what measured points that are on no face, and that the fillings pass by, say of these
      (`passed_sigma`).
    - profiles: what a merge in voxels put between the profiles (`profile_sigma`).
    - shared: √Σ(Σ aᵢ·mᵢ)² over the independent ways m in which all vertices move at once, those of
      the rig's covariance and those of the source (`common_moves`); they do not average out.
    """
    known = source or Source()
    shares = _shares(mesh, faces)
    common = moved(shares, common_moves(mesh, known) if moves is None else moves)
    between = profile_sigma(known.profiles, mesh)
    if between and faces is not None:
        between *= mesh.area_of(faces) / mesh.area_of()
    more = added_part(mesh, faces)
    noise, alike = _noise(mesh, shares)
    bulge = abs(_bulge(mesh, faces))
    hollow = hollow_sigma(mesh, known.every_view)
    passed = passed_sigma(mesh, passed_by(mesh, known.alone), faces)
    return VolumeSigma(
        noise, bulge, more.sigma, between, common, alike, hollow, passed, more.volume
    )


def volume_figures(volume: float, known: VolumeSigma) -> dict[str, float | None]:
    """A volume in numbers, mm³: all of it, what was measured and the filled faces, each with its
    standard uncertainty; None where that is not known.
    """
    figures = {
        "volume_mm3": volume,
        "volume_sigma_mm3": known.total,
        "volume_measured_mm3": volume - known.added,
        "volume_measured_sigma_mm3": known.measured,
        "volume_added_mm3": known.added,
        "volume_added_sigma_mm3": known.unmeasured,
    }
    return {k: v if np.isfinite(v) else None for k, v in figures.items()}


def volume_in_words(figures: Mapping[str, float | None]) -> str:
    """The same as one phrase; the two parts where something was filled."""

    def one(key: str) -> str:
        value, wide = figures[f"{key}_mm3"], figures[f"{key}_sigma_mm3"]
        return f"{value:.2f}" + ("" if wide is None else f" ± {wide:.3g}")

    text = f"{one('volume')} mm³"
    if figures["volume_added_mm3"] or figures["volume_added_sigma_mm3"]:
        text += f" ({one('volume_measured')} measured, {one('volume_added')} filled)"
    return text


def _shares(mesh: Mesh, faces: Bools | None = None) -> Floats:
    """(v, 3) mm²: ∂V/∂vertex, a third of the vector area of the faces about each; of ``faces`` (f,)
    alone where they are given."""
    area = vector_areas(mesh.triangles)
    own = area if faces is None else np.where(faces[:, None], area, 0.0)
    third = np.repeat(own[:, None] / 3, 3, axis=1).reshape(-1, 3)
    count = len(mesh.vertices)
    total = [np.bincount(mesh.faces.ravel(), third[:, k], minlength=count) for k in range(3)]
    return np.stack(total, axis=-1)


def _noise(mesh: Mesh, shares: Floats) -> tuple[float, float]:
    """mm³ of the points' usual sigma, and of what goes beyond it; NaN and 0 where not known.

    A measured point that does not know its own has the usual one.
    """
    p = mesh.provenance
    if p is None or np.isnan(p.sigma).all():
        return float("nan"), 0.0
    usual = float(np.median(p.sigma[p.sigma > 0])) if (p.sigma > 0).any() else 0.0
    sigma = np.where(np.isnan(p.sigma), np.where(p.laser >= 0, usual, 0.0), p.sigma)
    own = np.minimum(sigma, usual)
    size = np.linalg.norm(shares, axis=1)
    beyond = np.sqrt(np.maximum(sigma**2 - own**2, 0.0))
    return float(np.sqrt(np.square(size * own).sum())), float(size @ beyond)


def mean_curvature(mesh: Mesh) -> float:
    """mm: the integral of the mean curvature of a closed mesh, ridges positive (Steiner).

    Half the sum of length times angle over its sides; 4πR for a ball.
    """
    length, angle, _, _ = _sides(mesh, None)
    return float((length * angle).sum() / 2)


def _bulge(mesh: Mesh, faces: Bools | None) -> float:
    """mm³ by which a smooth surface through the vertices of a closed mesh holds more than it, over
    sides between ``faces`` (f,) where they are given.

    No face counts as wider than nearly all are (`_WIDEST`).
    """
    length, angle, wide, real = _sides(mesh, faces)
    if not real.any():
        return 0.0
    wide = np.minimum(wide, np.quantile(wide[real], _WIDEST))
    return float((length * angle * wide**2)[real].sum() / 12)


def _sides(mesh: Mesh, chosen: Bools | None) -> tuple[Floats, Floats, Floats, Bools]:
    """(s,) for each side its length, the angle of the faces there, and their mean height over it,
    and True where both were measured, and ``chosen`` (f,) if some are.

    Sides of faces without area are left out.
    """
    other = opposite_half_edges(mesh.faces)
    here = np.flatnonzero(other > np.arange(len(other)))
    there = other[here] // 3
    f, corner = here // 3, here % 3
    t = mesh.triangles
    side = t[f, (corner + 1) % 3] - t[f, corner]
    length = np.linalg.norm(side, axis=1)
    twice = 2 * vector_areas(t)
    size = np.linalg.norm(twice, axis=1)
    good = (size[f] > 0) & (size[there] > 0)
    f, there, side, length = f[good], there[good], side[good], length[good]
    n = twice / np.maximum(size, 1e-300)[:, None]
    turned = np.einsum("ij,ij->i", np.cross(n[f], n[there]), side / length[:, None])
    angle = np.arctan2(turned, np.einsum("ij,ij->i", n[f], n[there]))
    known = mesh.measured
    real = np.ones(len(f), np.bool_) if known is None else known[f] & known[there]
    if chosen is not None:
        real &= chosen[f] & chosen[there]
    return length, angle, (size[f] + size[there]) / (2 * length), real
