"""The station: devices opened by their addresses, looked over, and made ready for a scan."""

from turnscan.station._doctor import Diagnosis, TableFacts, examine
from turnscan.station._examine import CameraFacts, Examination, LaserFacts
from turnscan.station._open import DEFAULT_DEVICE, Addresses, Opened, opened
from turnscan.station._which import Seen, which_laser
from turnscan.station._wishes import (
    USUAL_SECONDS,
    USUAL_STEPS,
    Prepared,
    Wishes,
    laser_colour,
    plan_of,
    prepare,
    stops_of,
)

__all__ = [
    "DEFAULT_DEVICE",
    "USUAL_SECONDS",
    "USUAL_STEPS",
    "Addresses",
    "CameraFacts",
    "Diagnosis",
    "Examination",
    "LaserFacts",
    "Opened",
    "Prepared",
    "Seen",
    "TableFacts",
    "Wishes",
    "examine",
    "laser_colour",
    "opened",
    "plan_of",
    "prepare",
    "stops_of",
    "which_laser",
]
