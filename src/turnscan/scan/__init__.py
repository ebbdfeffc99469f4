"""The scan file and the pictures that go into it: the only code that writes one."""

from turnscan.scan._codec import signal_of, statistics
from turnscan.scan._file import Scan
from turnscan.scan._fit import rig_for
from turnscan.scan._pictures import (
    is_video,
    list_pictures,
    natural_key,
    picture_numbers,
    read_picture,
    read_video,
)
from turnscan.scan._plan import Frame, ScanPlan
from turnscan.scan._replace import replacing_scan
from turnscan.scan._stored import Stored

__all__ = [
    "Frame",
    "Scan",
    "ScanPlan",
    "Stored",
    "is_video",
    "list_pictures",
    "natural_key",
    "picture_numbers",
    "read_picture",
    "read_video",
    "replacing_scan",
    "rig_for",
    "signal_of",
    "statistics",
]
