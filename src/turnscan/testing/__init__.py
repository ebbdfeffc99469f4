"""Checks that the author of a driver runs against it; they need nothing but turnscan."""

from turnscan.testing._cameras import check_camera

__all__ = ["check_camera"]
