"""Settings: what a user may choose about a reconstruction."""

from __future__ import annotations

from dataclasses import dataclass, field

from turnscan.points import Along, Between, Volume
from turnscan.stripes import StripeSettings
from turnscan.surface import TearLimits
from turnscan.surface.clean import Clean
from turnscan.surface.fusion import MergeMethod
from turnscan.surface.holes import ClosingOptions


@dataclass(frozen=True)
class Settings:
    """Everything a user may choose about a reconstruction."""

    stripes: StripeSettings = field(default_factory=StripeSettings)
    volume: Volume | None = None
    """What to keep; None takes what the rig can measure above the platter."""
    shortest: int = 3
    """Runs of fewer points in a profile are specks."""
    every: int = 1
    """Use every n-th profile."""
    along: Along | None = None
    """Spacing of points along the profiles; None keeps one point per image line."""
    between: Between | None = None
    """Spacing between profiles; None keeps those of the scan."""
    clean: Clean | None = field(default_factory=Clean)
    """What is removed before points become a surface; None keeps all."""
    denoise: float | None = None
    """Points move along their rays, by at most this many sigma; None leaves them."""
    tears: TearLimits = field(default_factory=TearLimits)
    merge: MergeMethod = "auto"
    """How several lasers become one surface."""
    voxel: float | None = None
    """mm: voxels of the volumetric merge; None takes the usual spacing of the points."""
    island: int | None = None
    """Loose pieces of fewer faces are removed; None takes 1 % of the largest piece."""
    largest_sigma: float | None = None
    """mm: points and vertices of a larger standard uncertainty are left out of the surface that all
    points make; None keeps them."""
    caps: ClosingOptions | None = None
    """How to close the surface; None leaves its borders open."""
    tolerance: float | None = None
    """mm: how far faces may be decimated in the end; None: not at all, or to ``faces``."""
    faces: int | None = None
    """Faces to be left in the end, as far as ``tolerance`` allows; None: as few as it does."""
