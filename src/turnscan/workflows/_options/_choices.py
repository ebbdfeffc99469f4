"""The words that options choose among, which the rooms that obey them declare as types.

They are repeated here so that a door lists them without loading those rooms; a contract test
compares both.
"""

from __future__ import annotations

STRATEGY = (
    "window", "maximum", "centroid", "median", "parabola", "gauss3", "squared", "blais-rioux",
)  # fmt: skip
CHOICE = ("brightest", "first", "last", "nearest")
REFINEMENT = ("none", "auto", "spacetime")
ORIENTATION = ("vertical", "horizontal")
KEEP = ("sparse", "full")
SPACING = ("height", "arc")
HOW = ("auto", "grid", "tsdf", "paste")
FILL_HOW = ("auto", "flat", "membrane", "tangent", "curvature")
PRESETS = ("paper", "modern", "ciclop")
