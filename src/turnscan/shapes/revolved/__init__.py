"""Turned parts: their axis, the profile of their wall, and how round they are."""

from turnscan.shapes.revolved._axis import Axis, Turned, turned_about
from turnscan.shapes.revolved._axis_share import axis_counted
from turnscan.shapes.revolved._profile import wall_profile
from turnscan.shapes.revolved._roundness import (
    Cylindricity,
    Roundness,
    Thread,
    cylindricities,
    roundness,
    thread,
)

__all__ = [
    "Axis",
    "Cylindricity",
    "Roundness",
    "Thread",
    "Turned",
    "axis_counted",
    "cylindricities",
    "roundness",
    "thread",
    "turned_about",
    "wall_profile",
]
