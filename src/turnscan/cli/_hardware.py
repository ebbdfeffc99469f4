"""Devices by their addresses, for the verbs that drive them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from types import FrameType
from typing import Any, TypeVar

import click

from turnscan.acquire import Hardware
from turnscan.devices import Steady, open_camera, open_devices
from turnscan.errors import InputError
from turnscan.rig import Rig

DEFAULT_DEVICE = "sim:cup?seed=7"
Command = TypeVar("Command", bound=Callable[..., Any])


@dataclass(frozen=True)
class Addresses:
    """Where the devices are."""

    camera: str
    turntable: str
    lasers: str


@dataclass(frozen=True)
class Opened:
    """Devices, and what only a simulated bench knows."""

    hardware: Hardware
    seconds: float | None = None
    """The exposure that suits it."""
    steps: int | None = None
    """Of a turn."""
    rig: Rig | None = None
    """The true one."""


def device_options(command: Command) -> Command:
    """Give a verb the options that name devices; it receives them as ``devices``."""

    @click.option("--camera", metavar="ADDRESS", help="As uvc:0, genicam:SERIAL, folder:pictures/.")
    @click.option("--turntable", metavar="ADDRESS", help="As grbl:/dev/ttyUSB0, horus:…, manual:")
    @click.option("--lasers", metavar="ADDRESS", help="[default: the turntable's board]")
    @click.option(
        "--device",
        metavar="ADDRESS",
        help=f"All three at once: a simulated bench.  [default: {DEFAULT_DEVICE}]",
    )
    @wraps(command)
    def with_devices(
        *args: Any,
        camera: str | None,
        turntable: str | None,
        lasers: str | None,
        device: str | None,
        **others: Any,
    ) -> Any:
        given = {"camera": camera, "turntable": turntable, "lasers": lasers, "device": device}
        return command(*args, devices=given, **others)

    return with_devices  # type: ignore[return-value]


def addresses_of(given: dict[str, str | None], known: Addresses | None = None) -> Addresses:
    """What the options say, else ``known``, else the simulator.

    Raises InputError where they contradict each other or leave one open.
    """
    camera, table, lasers = given["camera"], given["turntable"], given["lasers"]
    device = given["device"]
    if device is not None:
        if camera or table or lasers:
            raise InputError(
                "--device stands for camera, turntable and lasers", hint="give it alone"
            )
        return Addresses(device, device, device)
    if known is not None:
        lasers = lasers or (table if table and known.lasers == known.turntable else known.lasers)
        return Addresses(camera or known.camera, table or known.turntable, lasers)
    if not (camera or table or lasers):
        return Addresses(DEFAULT_DEVICE, DEFAULT_DEVICE, DEFAULT_DEVICE)
    if camera is None or table is None:
        missing = "--camera" if camera is None else "--turntable"
        raise InputError(f"{missing} is not given", hint="turnscan devices lists what is there")
    return Addresses(camera, table, lasers or table)


@contextmanager
def opened(at: Addresses) -> Iterator[Opened]:
    """The devices, closed on every way out, the lasers dark before anything else.

    Pictures of real cameras are looked at, and taken again where something is wrong with them.
    Raises InputError for addresses that are none, DeviceError and SafetyError as the devices do.
    """
    simulated = [a.startswith("sim:") for a in (at.turntable, at.lasers)]
    if any(simulated):
        if not len({at.camera, at.turntable, at.lasers}) == 1:
            raise InputError(
                "a simulated bench is camera, turntable and lasers in one",
                hint="give --device sim:… alone",
            )
        yield _bench(at.camera)
        return
    with open_devices(at.turntable, at.lasers) as board, open_camera(at.camera) as camera:
        yield Opened(Hardware(Steady(camera), board.turntable, board.lasers))


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Ctrl-C, hanging up and a polite kill end the block once, as KeyboardInterrupt.

    More of them while it cleans up are ignored: nothing may keep the lasers from going dark.
    """
    came = False

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal came
        if not came:
            came = True
            raise KeyboardInterrupt

    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def was_interrupted(error: BaseException) -> bool:
    """Whether a signal ended the block; one that comes in compiled code is wrapped on its way."""
    inner: BaseException | None = error
    while inner is not None and not isinstance(inner, KeyboardInterrupt):
        inner = inner.__cause__ or inner.__context__
    return inner is not None


def _bench(address: str) -> Opened:
    from turnscan.simulate import simulated

    bench = simulated(address)
    hardware = Hardware(bench.camera, bench.turntable, bench.lasers)
    return Opened(hardware, bench.seconds, bench.steps, bench.world.bench.rig)
