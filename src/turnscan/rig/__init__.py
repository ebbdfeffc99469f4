"""Camera model, laser sheets, rotation axis; the paper's closed form; planning of a rig."""

from turnscan.rig._camera import Camera
from turnscan.rig._file import rig_from_json, rig_hash, rig_to_json
from turnscan.rig._pose import Pose, rotation_about, rotation_from_vector, rotation_z
from turnscan.rig._rig import Marker, Rig
from turnscan.rig._sheet import LaserSheet

__all__ = [
    "Camera",
    "LaserSheet",
    "Marker",
    "Pose",
    "Rig",
    "rig_from_json",
    "rig_hash",
    "rig_to_json",
    "rotation_about",
    "rotation_from_vector",
    "rotation_z",
]
