"""Stripe + Rig + angle → Profile → RangeGrid and PointCloud, with sigma and provenance."""

from turnscan.points._grid import PointCloud, RangeGrid

__all__ = ["PointCloud", "RangeGrid"]
