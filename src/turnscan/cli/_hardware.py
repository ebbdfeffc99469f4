"""Options and signals of the verbs that drive devices."""

from __future__ import annotations

import shlex
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import Any, TypeVar

import click

from turnscan.errors import InputError
from turnscan.scanner import DEFAULT_DEVICE, Addresses

Command = TypeVar("Command", bound=Callable[..., Any])


def device_options(command: Command) -> Command:
    """Give a verb the options that name devices; it receives them as ``devices``."""

    @click.option(
        "--camera",
        metavar="ADDRESS",
        help="Camera, such as uvc:0, genicam:SERIAL, folder:pictures/.",
    )
    @click.option(
        "--turntable",
        metavar="ADDRESS",
        help="Turntable, such as grbl:/dev/ttyUSB0, horus:…, manual:",
    )
    @click.option(
        "--lasers", metavar="ADDRESS", help="Laser controller.  [default: the turntable's]"
    )
    @click.option(
        "--device",
        metavar="ADDRESS",
        help=f"Camera, turntable and lasers in one: a simulated rig.  [default: {DEFAULT_DEVICE}]",
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


def again(given: dict[str, str | None]) -> str:
    """The options as they were given, to be typed once more after a command; "" for none."""
    return "".join(f" --{name} {shlex.quote(at)}" for name, at in given.items() if at)


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
def ended_by_signals() -> Iterator[None]:
    """Ctrl-C, hanging up and a polite kill end the block once, as KeyboardInterrupt.

    More of them while it cleans up are ignored: nothing may keep the lasers from going dark. A
    signal that was ignored before, as ``nohup`` does with hanging up, stays so.
    """
    came = False

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal came
        if not came:
            came = True
            raise KeyboardInterrupt

    names = ("SIGINT", "SIGTERM", "SIGHUP")
    there = [getattr(signal, name) for name in names if hasattr(signal, name)]
    numbers = [number for number in there if signal.getsignal(number) != signal.SIG_IGN]
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
