"""The scan file and the pictures that go into it: the only code that writes one."""

from turnscan.json_text import strict_json
from turnscan.scan._codec import packed_size
from turnscan.scan._copy import copy_scan
from turnscan.scan._file import Scan
from turnscan.scan._fit import lit_in, rig_for
from turnscan.scan._header import is_scan
from turnscan.scan._limits import STEPS
from turnscan.scan._pictures import (
    is_video,
    list_pictures,
    numbers_apart,
    picture_numbers,
    read_picture,
    read_video,
)
from turnscan.scan._plan import Frame, Keep, ScanPlan, Setting
from turnscan.scan._replace import replacing_scan
from turnscan.scan._signal import LEAST_THRESHOLD, NOISE_FACTOR, signal_of, statistics
from turnscan.scan._stored import Stored
from turnscan.scan._verifications import (
    VerifiedFigure,
    VerifiedRun,
    add_verification,
    read_verifications,
)

__all__ = [
    "LEAST_THRESHOLD",
    "NOISE_FACTOR",
    "STEPS",
    "Frame",
    "Keep",
    "Scan",
    "ScanPlan",
    "Setting",
    "Stored",
    "VerifiedFigure",
    "VerifiedRun",
    "add_verification",
    "copy_scan",
    "is_scan",
    "is_video",
    "list_pictures",
    "lit_in",
    "numbers_apart",
    "packed_size",
    "picture_numbers",
    "read_picture",
    "read_verifications",
    "read_video",
    "replacing_scan",
    "rig_for",
    "signal_of",
    "statistics",
    "strict_json",
]
