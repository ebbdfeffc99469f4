"""Frame → candidates per scan line → one sub-pixel Stripe with sigma and quality."""

from turnscan.stripes._background import background_beside, temporal_background, without_lines
from turnscan.stripes._colour import COLOURS, UINT16_SCALE, learn_colour, project_colour
from turnscan.stripes._detect import choose, detect, find_candidates, scattered
from turnscan.stripes._detector import named
from turnscan.stripes._fuse import fuse_exposures
from turnscan.stripes._installed import detector_names
from turnscan.stripes._light import Light
from turnscan.stripes._runs import RunDetector
from turnscan.stripes._series import Stripes
from turnscan.stripes._settings import Choice, Detector, Refinement, Strategy, StripeSettings
from turnscan.stripes._signal import Exposed, Signal
from turnscan.stripes._stripe import Candidates, Orientation, Stripe, StripeFlag

__all__ = [
    "COLOURS",
    "UINT16_SCALE",
    "Candidates",
    "Choice",
    "Detector",
    "Exposed",
    "Light",
    "Orientation",
    "Refinement",
    "RunDetector",
    "Signal",
    "Strategy",
    "Stripe",
    "StripeFlag",
    "StripeSettings",
    "Stripes",
    "background_beside",
    "choose",
    "detect",
    "detector_names",
    "find_candidates",
    "fuse_exposures",
    "learn_colour",
    "named",
    "project_colour",
    "scattered",
    "temporal_background",
    "without_lines",
]
