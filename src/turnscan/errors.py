"""What can go wrong, by name.

Every error says what, where and which value in its message, and what to do next in ``hint``::

    TurnscanError
    ├── DeviceError (OSError)           exit 3
    │   ├── DeviceNotFound
    │   ├── DeviceTimeout (TimeoutError)
    │   │   └── LeaseEnded
    │   ├── DeviceDisconnected (ConnectionError)
    │   ├── DeviceGarbled
    │   ├── DeviceAlarm
    │   ├── DeviceRestarted
    │   └── DeviceRefused
    ├── SafetyError (RuntimeError)      exit 4
    │   ├── LaserStateUnknown
    │   └── InterlockOpen
    ├── ScanError (OSError)             exit 5
    │   ├── ScanBusy
    │   ├── ScanCorrupt
    │   ├── ScanNewer
    │   ├── AngleLost
    │   └── StorageFull
    ├── InputError (ValueError)         exit 2
    │   ├── FormatError
    │   ├── LimitExceeded
    │   └── UnsafePath
    ├── CalibrationError (ValueError)   exit 1
    │   ├── NotEnoughViews
    │   ├── Degenerate
    │   └── DidNotConverge
    ├── ExportError (OSError)           exit 5
    └── PluginError (RuntimeError)      exit 2

The exit codes of the command line: 0 done, 1 finding, 2 usage or bad input, 3 device, 4 safety,
5 storage, 130 interrupted and resumable.
"""

from __future__ import annotations

from typing import ClassVar

from turnscan.remedy import Option, Remedy


class TurnscanError(Exception):
    """Base of all errors that turnscan raises on purpose.

    ``message`` says what, where and which value; ``hint`` says what to do next; ``option`` is the
    option whose value cannot be used, where there is one, and ``problem`` what is wrong with it.
    """

    exit_code: ClassVar[int] = 1

    def __init__(
        self, problem: str, *, hint: str | Remedy = "", option: Option | None = None
    ) -> None:
        self.problem = problem
        self.hint = hint
        self.option = option
        self.message = problem if option is None else f"{option}: {problem}"
        super().__init__(self.message)

    def __str__(self) -> str:
        """One line: the message, then the hint."""
        text = f"{self.message} → {self.hint}" if self.hint else self.message
        return " ".join(text.split())


class DeviceError(TurnscanError, OSError):
    """A camera, turntable or laser did not do what it was asked."""

    exit_code = 3


class DeviceNotFound(DeviceError):
    """No device answers at this address."""


class DeviceTimeout(DeviceError, TimeoutError):
    """A wait expired; the message says which."""


class LeaseEnded(DeviceTimeout):
    """A laser went dark while it was needed, as nothing showed that the work went on."""


class DeviceDisconnected(DeviceError, ConnectionError):
    """The device was there and has disconnected."""


class DeviceGarbled(DeviceError):
    """The device sent something that is not a valid reply of its protocol."""


class DeviceAlarm(DeviceError):
    """The device reports an alarm and waits for a person."""


class DeviceRestarted(DeviceError):
    """The device restarted; its position is no longer known."""


class DeviceRefused(DeviceError):
    """The device understood the request and refused it."""


class SafetyError(TurnscanError, RuntimeError):
    """Something about a laser is not as safe as it must be."""

    exit_code = 4


class LaserStateUnknown(SafetyError):
    """It is not confirmed that the laser is dark: cut the power."""


class InterlockOpen(SafetyError):
    """The interlock or the door is open."""


class ScanError(TurnscanError, OSError):
    """The scan file cannot be read or written."""

    exit_code = 5


class ScanBusy(ScanError):
    """Another process is writing this scan file."""


class ScanCorrupt(ScanError):
    """The scan file is damaged; the message says where."""


class ScanNewer(ScanError):
    """The scan file was written by a newer turnscan."""


class AngleLost(ScanError):
    """The table's angle no longer agrees with the scan file."""


class StorageFull(ScanError):
    """No room left on the device that holds the scan file."""


class InputError(TurnscanError, ValueError):
    """What was given cannot be used."""

    exit_code = 2


class FormatError(InputError):
    """A file or a text is not in the form it should have."""


class LimitExceeded(InputError):
    """A size is beyond what turnscan accepts."""


class UnsafePath(InputError):
    """A name would lead outside the place it belongs to."""


class CalibrationError(TurnscanError, ValueError):
    """The views do not determine the rig."""

    exit_code = 1


class NotEnoughViews(CalibrationError):
    """Too few usable views."""


class Degenerate(CalibrationError):
    """The views leave a direction of the rig undetermined."""


class DidNotConverge(CalibrationError):
    """The adjustment did not settle."""


class ExportError(TurnscanError, OSError):
    """The result cannot be written, or what was written does not read back the same."""

    exit_code = 5


class PluginError(TurnscanError, RuntimeError):
    """Code that another package adds to turnscan failed; the message names the package."""

    exit_code = 2
