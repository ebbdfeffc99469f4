"""turnscan: laser-line turntable 3-D scanning."""

__version__ = "0.1.0"
