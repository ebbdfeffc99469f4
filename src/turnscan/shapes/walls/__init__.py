"""Mesh of a part → how thick its walls are."""

from turnscan.shapes.walls._thickness import Walls, wall_thickness

__all__ = ["Walls", "wall_thickness"]
