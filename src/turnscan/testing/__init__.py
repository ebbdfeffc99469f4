"""Checks that the author of a driver, a detector or a format runs against it.

They need nothing but turnscan.
"""

from turnscan.testing._cameras import check_camera
from turnscan.testing._detectors import CheckedDetector, check_detector
from turnscan.testing._formats import check_format
from turnscan.testing._lasers import check_lasers
from turnscan.testing._turntables import check_turntable

__all__ = [
    "CheckedDetector",
    "check_camera",
    "check_detector",
    "check_format",
    "check_lasers",
    "check_turntable",
]
