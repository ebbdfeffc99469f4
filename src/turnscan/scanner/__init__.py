"""The station: devices opened by their addresses, looked over, and made ready for a scan."""

from turnscan.scanner._doctor import Diagnosis, examine
from turnscan.scanner._identify_lasers import Seen, which_laser
from turnscan.scanner._open import Addresses, Opened, opened
from turnscan.scanner._photograph import (
    LONGEST_PAUSE,
    MOST_PICTURES,
    Series,
    Shot,
    photograph,
)
from turnscan.scanner._prepare import ScanRequest, laser_colour, prepare, stops_of
from turnscan.scanner._resume import (
    acquisition_of,
    check_space,
    forget_bad,
    hardware_to_resume,
    steps_left,
)
from turnscan.scanner._verified import verification_findings

__all__ = [
    "LONGEST_PAUSE",
    "MOST_PICTURES",
    "Addresses",
    "Diagnosis",
    "Opened",
    "ScanRequest",
    "Seen",
    "Series",
    "Shot",
    "acquisition_of",
    "check_space",
    "examine",
    "forget_bad",
    "hardware_to_resume",
    "laser_colour",
    "opened",
    "photograph",
    "prepare",
    "steps_left",
    "stops_of",
    "verification_findings",
    "which_laser",
]
