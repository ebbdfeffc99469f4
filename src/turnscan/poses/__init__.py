"""Surfaces of several poses → one frame: matching, refinement, and what stays undetermined."""

from turnscan.poses._align import Alignment, align, alignment_findings, check
from turnscan.poses._landmarks import from_landmarks, rigid
from turnscan.poses._markers import from_markers, marker_spheres
from turnscan.poses._moves import pose_moves
from turnscan.poses._onto import Onto, onto, onto_all, plain_view
from turnscan.poses._place import place, ways
from turnscan.poses._view import View, view

__all__ = [
    "Alignment",
    "Onto",
    "View",
    "align",
    "alignment_findings",
    "check",
    "from_landmarks",
    "from_markers",
    "marker_spheres",
    "onto",
    "onto_all",
    "place",
    "plain_view",
    "pose_moves",
    "rigid",
    "view",
    "ways",
]
