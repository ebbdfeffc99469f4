"""Devices: found, examined, emulated, simulated; pictures and scans taken with them."""
