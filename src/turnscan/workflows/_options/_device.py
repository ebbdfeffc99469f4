"""Which devices a verb works with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.scanner import Addresses

DEFAULT_DEVICE = "sim:cup?seed=7"
"""Used where nothing else is given."""


@dataclass(frozen=True)
class DeviceOptions(Checked):
    """Addresses of the devices; without any a simulated rig."""

    camera: str | None = option(
        None, "text", "Camera, such as uvc:0, genicam:SERIAL, folder:pictures/."
    )
    turntable: str | None = option(
        None, "text", "Turntable, such as grbl:/dev/ttyUSB0, horus:…, manual:"
    )
    lasers: str | None = option(None, "text", "Laser controller.  [default: the turntable's]")
    device: str | None = option(
        None,
        "text",
        f"Camera, turntable and lasers in one: a simulated rig.  [default: {DEFAULT_DEVICE}]",
    )

    def addresses(self, known: Addresses | None = None) -> Addresses:
        """All three addresses; what is not given is as ``known``, else simulated.

        Raises InputError where they contradict each other or leave one open.
        """
        from turnscan.scanner import Addresses

        camera, table, lasers = self.camera, self.turntable, self.lasers
        if self.device is not None:
            if camera or table or lasers:
                raise InputError(
                    "stands for camera, turntable and lasers",
                    hint="give it alone",
                    option=Option("device"),
                )
            return Addresses(self.device, self.device, self.device)
        if known is not None:
            same_board = table and known.lasers == known.turntable
            lasers = lasers or (table if same_board and table else known.lasers)
            return Addresses(camera or known.camera, table or known.turntable, lasers)
        if not (camera or table or lasers):
            return Addresses(DEFAULT_DEVICE, DEFAULT_DEVICE, DEFAULT_DEVICE)
        if camera is None or table is None:
            missing = Option("camera" if camera is None else "turntable")
            hint = "turnscan devices lists what is there"
            raise InputError("not given", hint=hint, option=missing)
        return Addresses(camera, table, lasers or table)
