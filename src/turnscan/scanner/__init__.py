"""The station: devices opened by their addresses, looked over, and made ready for a scan."""

from turnscan.scanner._doctor import Diagnosis, TableFacts, examine
from turnscan.scanner._examine import CameraFacts, Examination, LaserFacts
from turnscan.scanner._identify_lasers import Seen, which_laser
from turnscan.scanner._open import Addresses, Opened, opened
from turnscan.scanner._photograph import (
    LONGEST_PAUSE,
    MOST_PICTURES,
    Series,
    Shot,
    photograph,
)
from turnscan.scanner._prepare import (
    USUAL_SECONDS,
    USUAL_STEPS,
    Prepared,
    ScanRequest,
    laser_colour,
    plan_of,
    prepare,
    stops_of,
)
from turnscan.scanner._resume import (
    acquisition_of,
    check_space,
    forget_bad,
    hardware_to_resume,
    steps_left,
)
from turnscan.scanner._verified import USUAL_DAYS, verification_findings

__all__ = [
    "LONGEST_PAUSE",
    "MOST_PICTURES",
    "USUAL_DAYS",
    "USUAL_SECONDS",
    "USUAL_STEPS",
    "Addresses",
    "CameraFacts",
    "Diagnosis",
    "Examination",
    "LaserFacts",
    "Opened",
    "Prepared",
    "ScanRequest",
    "Seen",
    "Series",
    "Shot",
    "TableFacts",
    "acquisition_of",
    "check_space",
    "examine",
    "forget_bad",
    "hardware_to_resume",
    "laser_colour",
    "opened",
    "photograph",
    "plan_of",
    "prepare",
    "steps_left",
    "stops_of",
    "verification_findings",
    "which_laser",
]
