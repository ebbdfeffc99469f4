"""Freeform parts of a mesh that a profile sweeps out: surfaces of revolution, and extrusions."""

from turnscan.shapes.swept._swept import Swept, SweptKind, find_swept

__all__ = ["Swept", "SweptKind", "find_swept"]
