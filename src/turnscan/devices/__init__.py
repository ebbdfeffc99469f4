"""Camera, Turntable and Lasers: the protocols every device obeys."""

from turnscan.devices._protocols import Camera, Lasers, Turntable

__all__ = ["Camera", "Lasers", "Turntable"]
