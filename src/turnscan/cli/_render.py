"""A shaded picture of a mesh."""

from turnscan.workflows._render import render

__all__ = ["render"]
