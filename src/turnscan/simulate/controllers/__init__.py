"""Emulated controller boards behind pseudo-terminals, with a laser log of their own.

Each answers as the real firmware does. A `Socket` puts a board on a pseudo-terminal::

    with Socket(GrblFirmware()) as socket:
        board = open_turntable(f"grbl:{socket.path}")

An `Emulator` adds the simulated camera, served over the network.

Linux only; the drivers that talk to them are not.
"""

from turnscan.simulate.controllers._cable import Cable
from turnscan.simulate.controllers._emulator import EMULATED, Emulator, LaserTimes
from turnscan.simulate.controllers._fabscan import FabScanFirmware
from turnscan.simulate.controllers._firmware import Fault, Firmware, Lit
from turnscan.simulate.controllers._generator import GeneratorFirmware
from turnscan.simulate.controllers._grbl import GrblFirmware
from turnscan.simulate.controllers._horus import HorusFirmware
from turnscan.simulate.controllers._sardauscan import SardauscanFirmware, SardauscanHorusFirmware
from turnscan.simulate.controllers._socket import Socket
from turnscan.simulate.controllers._world import drive

__all__ = [
    "EMULATED",
    "Cable",
    "Emulator",
    "FabScanFirmware",
    "Fault",
    "Firmware",
    "GeneratorFirmware",
    "GrblFirmware",
    "HorusFirmware",
    "LaserTimes",
    "Lit",
    "SardauscanFirmware",
    "SardauscanHorusFirmware",
    "Socket",
    "drive",
]
