"""Decimation: as few faces as a tolerance allows, out of measured vertices."""

from turnscan.surface.decimation._decimate import decimate, decimation_findings, dissolve

__all__ = [
    "decimate",
    "decimation_findings",
    "dissolve",
]
