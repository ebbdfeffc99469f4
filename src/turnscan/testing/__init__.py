"""Checks that the author of a driver runs against it; they need nothing but turnscan."""

from turnscan.testing._cameras import check_camera
from turnscan.testing._lasers import check_lasers
from turnscan.testing._turntables import check_turntable

__all__ = ["check_camera", "check_lasers", "check_turntable"]
