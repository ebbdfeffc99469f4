"""Mesh and points → planes and other primitives, with residuals and uncertainty; deviations."""

from turnscan.shapes._deviation import Deviation, deviation, sample_surface

__all__ = ["Deviation", "deviation", "sample_surface"]
