"""``scpi:``: a mirror draws the laser line, driven by a function generator of two channels."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from turnscan.devices._guard import LONGEST_LEASE
from turnscan.devices._guard_client import Deadlines, GuardedLink
from turnscan.devices._line_protocol import Lines
from turnscan.devices._options import number_of, split_address, whole_of
from turnscan.errors import (
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    InputError,
    SafetyError,
)

_KEYS = (
    "frequency", "amplitude", "offset", "waveform", "gate_volts", "lasers", "idn", "library",
    "baud",
)  # fmt: skip
_WAVEFORMS = {"sine": "SIN", "triangle": "TRI"}
_AGREES = 1e-3
"""Of a setting and what is read back."""
_WHOLE = 0.02
"""Of a sweep by which an exposure may miss a whole number of them."""
_MANY = 50
"""Sweeps from which one more or less here and there changes the line's light by at most 2 %."""


@dataclass(frozen=True)
class Swing:
    """How the mirror swings: there and back ``frequency`` times a second."""

    frequency: float
    """Hz."""
    amplitude: float
    """V from peak to peak."""
    offset: float
    """V."""
    waveform: str
    """sine or triangle."""


class Galvanometer:
    """``scpi:RESOURCE?frequency=105&amplitude=2``: `turnscan.devices.Lasers` with one laser.

    RESOURCE is a VISA address, as ``TCPIP0::192.168.1.5::INSTR`` or ``USB0::…::INSTR``. Channel 1
    swings the mirror, channel 2 gates the laser: its output on means lit, and the laser's input
    must have a pull-down, because off means open. The mirror swings as long as this is open; the
    laser is only lit while it does, because a laser on a mirror at rest is one bright spot.

    Options: ``frequency`` in Hz and ``amplitude`` in V (peak to peak) of the mirror; ``offset`` (V,
    0), ``waveform`` (sine or triangle), ``gate_volts`` (5), ``lasers`` (the laser's name), ``idn``
    (what the instrument's name must contain), ``library`` (of PyVISA: @py), ``baud``.

    Raises InputError for options that are none, DeviceNotFound where PyVISA or the instrument is
    missing, DeviceTimeout, DeviceGarbled or DeviceRefused for an instrument that is silent, is
    another, or cannot swing so, and LaserStateUnknown where the gate is not confirmed closed.
    """

    def __init__(self, address: str, deadlines: Deadlines | None = None) -> None:
        resource, options = split_address(address, _KEYS)
        if not resource:
            raise InputError(
                f"{address}: no resource", hint="write for example scpi:TCPIP0::192.168.1.5::INSTR"
            )
        self._d = deadlines or Deadlines()
        self._name = f"scpi:{resource}"
        self.swing = _swing_of(address, options)
        self._volts = number_of(options, "gate_volts", 5.0, 0.5, 24.0)
        self._laser = options.get("lasers", "laser1")
        if not self._laser or "," in self._laser:
            raise InputError(f"{address}: lasers={self._laser}", hint="a generator gates one laser")
        baud = whole_of(options, "baud", 115200, 300, 4_000_000)
        if importlib.util.find_spec("pyvisa") is None:
            raise DeviceNotFound(
                f"{self._name}: PyVISA is not installed", hint="pip install 'turnscan[scpi]'"
            )
        self._lock = threading.Lock()
        self._link = GuardedLink(
            resource, "scpi", ("2",), baud=baud, deadlines=self._d,
            library=options.get("library", "@py"),
        )  # fmt: skip
        self._lines = Lines(self._link, self._name)
        try:
            self._begin(options.get("idn", ""))
        except BaseException:
            with contextlib.suppress(DeviceError):
                self._link.close()
            raise

    @property
    def names(self) -> tuple[str, ...]:
        """The laser that channel 2 gates."""
        return (self._laser,)

    def check_exposure(self, seconds: float) -> None:
        """Raise DeviceRefused, naming the nearest that does, where it covers no whole sweeps.

        The line is drawn evenly by whole sweeps there and back. From 50 sweeps on a part of one
        more does not matter.
        """
        sweeps = seconds * self.swing.frequency
        whole = max(1, round(sweeps))
        if abs(sweeps - whole) <= _WHOLE or sweeps >= _MANY:
            return
        near = sorted({max(1, math.floor(sweeps)), math.ceil(sweeps)})
        offers = " or ".join(f"{n / self.swing.frequency:.6g} s ({n})" for n in near)
        raise DeviceRefused(
            f"{self._name}: an exposure of {seconds:g} s covers {sweeps:.2f} sweeps of the mirror "
            f"at {self.swing.frequency:g} Hz: parts of the line would be brighter than others",
            hint=f"expose for a whole number of sweeps: {offers}",
        )

    def light(self, lit: frozenset[str], lease: float) -> None:
        """See `turnscan.devices.Lasers`. Raises DeviceRefused where the mirror stands still."""
        unknown = sorted(lit - set(self.names))
        if unknown:
            raise DeviceRefused(f"{self._name}: no laser {unknown[0]!r}; there is {self._laser}")
        self._check_lease(lease)
        with self._locked():
            try:
                if lit and not self._on("OUTP1?"):
                    raise DeviceRefused(
                        f"{self._name}: channel 1 is off, so the mirror stands still and the laser "
                        "would be one bright spot",
                        hint="check the generator, then open it again",
                    )
                self._link.light(int(bool(lit)), lease)
            except DeviceError as e:
                self._dark_before(e)
                raise

    def renew(self, lease: float) -> None:
        """See `turnscan.devices.Lasers`."""
        self._check_lease(lease)
        self._link.renew(lease)

    def off(self) -> None:
        """See `turnscan.devices.Lasers`. The mirror swings on, which is the safer way to fail."""
        self._link.dark()

    def close(self) -> None:
        """Dark, then the mirror at rest. Raises LaserStateUnknown."""
        with contextlib.suppress(DeviceError, SafetyError):
            self._link.dark()
            self._tell("OUTP1 OFF")
            self._on("OUTP1?")  # when it answers it has done so
        self._link.close()

    def _begin(self, idn: str) -> None:
        """Make sure of the instrument, set it up, and let the mirror swing; the gate is closed."""
        said = self._ask("*IDN?")
        if said.count(",") < 2 or idn.lower() not in said.lower():
            wanted = f"one with {idn!r} in its name" if idn else "an instrument that speaks SCPI"
            raise DeviceRefused(f"{self._name}: is {said[:60]!r}, not {wanted}")
        self._tell("*CLS")
        s = self.swing
        self._choose("SOUR2:FUNC", "DC")
        self._set("SOUR2:VOLT:OFFS", self._volts, "V")
        self._choose("SOUR1:FUNC", _WAVEFORMS[s.waveform])
        self._set("SOUR1:FREQ", s.frequency, "Hz")
        self._set("SOUR1:VOLT", s.amplitude, "V")
        self._set("SOUR1:VOLT:OFFS", s.offset, "V")
        self._tell("OUTP1 ON")
        if not self._on("OUTP1?"):
            raise DeviceRefused(f"{self._name}: channel 1 does not switch on")
        self._check_errors()

    def _choose(self, header: str, word: str) -> None:
        self._tell(f"{header} {word}")
        said = self._ask(f"{header}?")
        if said.upper()[:3] != word[:3]:
            self._check_errors()
            raise DeviceRefused(f"{self._name}: {header} was set to {word}, it says {said[:40]!r}")

    def _set(self, header: str, value: float, unit: str) -> None:
        self._tell(f"{header} {value:.9g}")
        said = self._ask(f"{header}?")
        try:
            got = float(said)
        except ValueError:
            raise DeviceGarbled(f"{self._name}: {header}? gave {said[:40]!r}") from None
        if not abs(got - value) <= _AGREES * max(abs(value), 1.0):
            self._check_errors()
            raise DeviceRefused(
                f"{self._name}: {value:g} {unit} was asked for, {got:g} {unit} is set ({header})",
                hint="ask for what this generator can do into its load",
            )

    def _check_errors(self) -> None:
        said = self._ask("SYST:ERR?")
        number = said.partition(",")[0].strip()
        if number.lstrip("+-") != "0":
            raise DeviceRefused(
                f"{self._name}: the instrument reports {said[:80]}",
                hint="look up the error in its manual; change the options",
            )

    def _on(self, question: str) -> bool:
        said = self._ask(question).upper()
        if said not in ("0", "1", "ON", "OFF"):
            raise DeviceGarbled(f"{self._name}: {question} gave {said[:40]!r}")
        return said in ("1", "ON")

    def _tell(self, text: str) -> None:
        self._lines.expect_nothing()
        self._link.write(f"{text}\n".encode("ascii"))

    def _ask(self, text: str) -> str:
        self._tell(text)
        end = time.monotonic() + self._d.acknowledge
        return self._lines.next(end, repr(text)).decode("latin-1").strip()

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        if not self._lock.acquire(timeout=self._d.acknowledge):
            raise DeviceRefused(f"{self._name}: busy with another command")
        try:
            yield
        finally:
            self._lock.release()

    def _check_lease(self, lease: float) -> None:
        if not 0.0 < lease <= LONGEST_LEASE:
            raise DeviceRefused(
                f"{self._name}: lease {lease:g} s",
                hint=f"above 0 to {LONGEST_LEASE:g} s; renew it while it is needed",
            )

    def _dark_before(self, error: DeviceError) -> None:
        """The gate is closed before an error leaves; that it did not close is the worse error."""
        try:
            self._link.dark()
        except DeviceError as e:
            error.add_note(f"and then: {e}")


def _swing_of(address: str, options: Mapping[str, str]) -> Swing:
    for key in ("frequency", "amplitude"):
        if key not in options:
            raise InputError(
                f"{address}: no {key}", hint="write scpi:RESOURCE?frequency=105&amplitude=2"
            )
    waveform = options.get("waveform", "sine")
    if waveform not in _WAVEFORMS:
        raise InputError(f"waveform={waveform}", hint=f"there is {', '.join(_WAVEFORMS)}")
    return Swing(
        number_of(options, "frequency", 0.0, 1.0, 1e5),
        number_of(options, "amplitude", 0.0, 0.001, 50.0),
        number_of(options, "offset", 0.0, -25.0, 25.0),
        waveform,
    )
