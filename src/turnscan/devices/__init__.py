"""Camera, Turntable and Lasers: the protocols every device obeys, and drivers by address."""

from turnscan.devices._aravis import aravis_library
from turnscan.devices._cameras import camera_schemes, find_cameras, open_camera
from turnscan.devices._discover import Answer, Port, list_ports, probe_port
from turnscan.devices._lit import alive, burning, exposed
from turnscan.devices._options import split_address
from turnscan.devices._pixels import image_of
from turnscan.devices._protocols import Camera, CameraTraits, Lasers, Sweeping, Turntable
from turnscan.devices._registry import acknowledge_alarm, open_devices, open_lasers, open_turntable
from turnscan.devices._stop_switch import StopSwitch
from turnscan.devices._validated_camera import Steady, frame_deadline

__all__ = [
    "Answer",
    "Camera",
    "CameraTraits",
    "Lasers",
    "Port",
    "Steady",
    "StopSwitch",
    "Sweeping",
    "Turntable",
    "acknowledge_alarm",
    "alive",
    "aravis_library",
    "burning",
    "camera_schemes",
    "exposed",
    "find_cameras",
    "frame_deadline",
    "image_of",
    "list_ports",
    "open_camera",
    "open_devices",
    "open_lasers",
    "open_turntable",
    "probe_port",
    "split_address",
]
