"""A simulated rig behind real wires: a board on a serial port, a camera on the network."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from turnscan.errors import InputError
from turnscan.simulate._address import Simulated
from turnscan.simulate._darkroom import Darkroom
from turnscan.simulate._gige import GigeServer
from turnscan.simulate.controllers._fabscan import FabScanFirmware
from turnscan.simulate.controllers._firmware import Firmware
from turnscan.simulate.controllers._grbl import GrblFirmware
from turnscan.simulate.controllers._horus import HorusFirmware
from turnscan.simulate.controllers._sardauscan import SardauscanFirmware
from turnscan.simulate.controllers._socket import Socket
from turnscan.simulate.controllers._world import drive

SERIAL = "TS01"

_TURNTABLE = {"100": 80.0, "110": 6000.0, "120": 800.0}
"""GRBL's settings for a table: microsteps/°, °/min, °/s²."""
EMULATED: Mapping[str, Callable[[], Firmware]] = {
    "grbl": lambda: GrblFirmware(_TURNTABLE),
    "horus": HorusFirmware,
    "fabscan": FabScanFirmware,
    "sardauscan": SardauscanFirmware,
}
"""A board of each dialect, with a turntable."""


@dataclass(frozen=True)
class LaserTimes:
    """What a board's own log says of its lasers."""

    times: int
    """How often any of them was lit."""
    longest: float
    """s without a pause."""
    total: float
    """s."""


class Emulator:
    """One simulated rig behind a real serial port and, if wanted, a real GigE Vision camera.

    Whatever opens `board` and `camera`, by the drivers of this program or another, turns the same
    table and sees the same lasers. A context manager.
    """

    def __init__(
        self,
        dialect: str,
        bench: Simulated,
        *,
        port: Path | None = None,
        camera: bool = True,
        hurry: float = 1.0,
    ) -> None:
        """``port``: where the serial port shall appear; ``hurry``: how much faster the board lives.

        Raises InputError for a dialect there is not, a port that already exists, or a bench
        without noise, whose camera would count as broken.
        """
        if dialect not in EMULATED:
            raise InputError(f"no board {dialect!r}", hint=f"there is {', '.join(EMULATED)}")
        if not 0.01 <= hurry <= 1000.0:
            raise InputError(f"{hurry:g} times as fast", hint="0.01 to 1000")
        if camera and not bench.world.bench.noise:
            raise InputError(
                "a camera without noise repeats itself to the byte, as broken ones do",
                hint="leave out perfect, or serve no camera",
            )
        if port is not None:
            _check_free(port)
        self.dialect, self.bench = dialect, bench
        self.firmware = EMULATED[dialect]()
        self._camera = camera
        self._socket = Socket(self.firmware, scale=hurry, path=port)
        self._darkroom = Darkroom(bench.world, bench.seconds)
        self._server: GigeServer | None = None
        self._stack = ExitStack()

    def __enter__(self) -> Emulator:
        """Plug everything in. Raises DeviceNotFound and DeviceRefused as `GigeServer` does."""
        names = self.bench.lasers.names
        board = self.firmware
        drive(self.bench.world, board, dict(zip(board.outputs, names, strict=False)))
        with ExitStack() as stack:
            if self._camera:
                stack.enter_context(self._darkroom)
                seen = self.bench.world.bench.rig.camera
                size = (seen.width, seen.height)
                self._server = GigeServer(self._darkroom.picture, SERIAL, size=size)
                stack.enter_context(self._server)
                self._follow()
            stack.enter_context(self._socket)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Unplug everything."""
        self._stack.close()

    @property
    def board(self) -> str:
        """The address of turntable and lasers."""
        names = ",".join(self.bench.lasers.names)
        return f"{self.dialect}:{self._socket.path}?lasers={names}"

    @property
    def camera(self) -> str:
        """The address of the camera; empty where none is served."""
        if not self._camera:
            return ""
        sensor = self.bench.world.bench.sensor
        form = "?format=RGB8" if sensor.bayer else "?format=Mono16" if sensor.bits > 8 else ""
        return f"aravis:{SERIAL}{form}"

    @property
    def pictures(self) -> int:
        """How many the camera has given."""
        return 0 if self._server is None else self._server.served

    @property
    def trouble(self) -> Exception | None:
        """What kept a picture from being rendered, if anything did."""
        return None if self._server is None else self._server.error

    def laser_times(self) -> LaserTimes:
        """From the board's own log; a laser that still burns counts up to now."""
        begun: float | None = None
        spans = []
        for entry in [*self.firmware.log]:
            if entry.outputs and begun is None:
                begun = entry.time
            elif not entry.outputs and begun is not None:
                spans.append(entry.time - begun)
                begun = None
        if begun is not None:
            spans.append(time.monotonic() - begun)
        return LaserTimes(len(spans), max(spans, default=0.0), sum(spans))

    def _follow(self) -> None:
        """Let the darkroom know where the table comes to rest."""
        inner = self.firmware.on_change

        def changed(board: Firmware) -> None:
            if inner is not None:
                inner(board)
            self._darkroom.look()

        self.firmware.on_change = changed
        self._darkroom.look()


def _check_free(port: Path) -> None:
    if port.is_symlink() and not port.exists():
        port.unlink()  # left behind by one that was killed
    if port.exists():
        raise InputError(f"{port}: already exists", hint="name another port")
    if not port.resolve().parent.is_dir():
        raise InputError(f"{port}: no such folder", hint="name a port in a folder that is there")
