"""Runs a plan on devices into a scan file."""

from turnscan.acquire._angle import Shifted, check_angle, counting_of, reindexed
from turnscan.acquire._capture import Hardware, Shooter
from turnscan.acquire._control import Control
from turnscan.acquire._events import (
    Ended,
    Event,
    Listener,
    Missing,
    Paused,
    StepDone,
    Stored,
    Taken,
    WentOn,
)
from turnscan.acquire._exposure import (
    FoundExposure,
    auto_exposure,
    bracket,
    exposure_findings,
    stripe_peak,
)
from turnscan.acquire._look import FirstLook, check_room, estimate, look
from turnscan.acquire._plan import (
    Acquisition,
    Exposure,
    Plan,
    Texture,
    acquisition_from_json,
    acquisition_to_json,
    turn_of,
)
from turnscan.acquire._run import Outcome, run
from turnscan.acquire._sink import Sink

__all__ = [
    "Acquisition",
    "Control",
    "Ended",
    "Event",
    "Exposure",
    "FirstLook",
    "FoundExposure",
    "Hardware",
    "Listener",
    "Missing",
    "Outcome",
    "Paused",
    "Plan",
    "Shifted",
    "Shooter",
    "Sink",
    "StepDone",
    "Stored",
    "Taken",
    "Texture",
    "WentOn",
    "acquisition_from_json",
    "acquisition_to_json",
    "auto_exposure",
    "bracket",
    "check_angle",
    "check_room",
    "counting_of",
    "estimate",
    "exposure_findings",
    "look",
    "reindexed",
    "run",
    "stripe_peak",
    "turn_of",
]
