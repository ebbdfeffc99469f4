"""Camera model, laser sheets, rotation axis; the paper's closed form; planning of a rig."""

from turnscan.rig import _limits as limits
from turnscan.rig import _paper as paper
from turnscan.rig._camera import Camera
from turnscan.rig._design import Design
from turnscan.rig._file import rig_from_json, rig_hash, rig_to_json
from turnscan.rig._motion import TableMotion
from turnscan.rig._planar import planar_pixel, planar_point
from turnscan.rig._pose import (
    Pose,
    nearest_rotation,
    nearest_rotations,
    rotation_about,
    rotation_from_vector,
    rotation_z,
)
from turnscan.rig._presets import PRESET_NAMES, design_preset
from turnscan.rig._rig import Marker, Rig
from turnscan.rig._ruler import rig_from_ruler
from turnscan.rig._sheet import LaserSheet
from turnscan.rig._table1 import disagreements, table_1, table_1_designs, table_1_text
from turnscan.rig._wobble import Wobble

__all__ = [
    "PRESET_NAMES",
    "Camera",
    "Design",
    "LaserSheet",
    "Marker",
    "Pose",
    "Rig",
    "TableMotion",
    "Wobble",
    "design_preset",
    "disagreements",
    "limits",
    "nearest_rotation",
    "nearest_rotations",
    "paper",
    "planar_pixel",
    "planar_point",
    "rig_from_json",
    "rig_from_ruler",
    "rig_hash",
    "rig_to_json",
    "rotation_about",
    "rotation_from_vector",
    "rotation_z",
    "table_1",
    "table_1_designs",
    "table_1_text",
]
