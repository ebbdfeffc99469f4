"""Clean-up: strays, spikes, noise and islands, and vertices that every file format can hold."""

from turnscan.surface.clean._clean import Clean, clean
from turnscan.surface.clean._denoise import denoise
from turnscan.surface.clean._despike import despike
from turnscan.surface.clean._islands import drop_islands, long_islands
from turnscan.surface.clean._settle import settled
from turnscan.surface.clean._smooth import smooth, spikes
from turnscan.surface.clean._uncertain import drop_uncertain, part_uncertain, uncertain_findings

__all__ = [
    "Clean",
    "clean",
    "denoise",
    "despike",
    "drop_islands",
    "drop_uncertain",
    "long_islands",
    "part_uncertain",
    "settled",
    "smooth",
    "spikes",
    "uncertain_findings",
]
