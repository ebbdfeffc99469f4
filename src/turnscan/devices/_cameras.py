"""Cameras by address: ``uvc:0``, ``aravis:…``, ``folder:…``, and those of other packages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from turnscan.arrays import Image
from turnscan.devices._protocols import Camera, CameraTraits
from turnscan.errors import DeviceDisconnected, DeviceError, InputError, TurnscanError
from turnscan.findings import Finding

GROUP = "turnscan.cameras"
"""Entry points of cameras: the scheme of the address, and what opens it."""


@contextmanager
def open_camera(address: str) -> Iterator[Camera]:
    """The camera at an address such as ``uvc:0``, closed on every way out.

    The part before the colon names an entry point of the group ``turnscan.cameras``, a callable
    that is given the address and returns a `Camera`, which may have ``close()``. Only that
    entry point is loaded, and whatever it raises, at import, on opening or in use, comes out as
    a DeviceError that names the address.

    Raises InputError for an address of no known kind, DeviceNotFound and DeviceRefused as the
    driver does.
    """
    scheme, colon, _ = address.partition(":")
    known = _known()
    if not colon or scheme not in known:
        raise InputError(
            f"{address!r}: not a camera address",
            hint=f"begin with one of {', '.join(f'{s}:' for s in sorted(known))}",
        )
    camera = _contained(address, _load(address, known[scheme]), address)
    opened = _Opened(address, camera)
    try:
        yield opened
    finally:
        opened.close()


def camera_schemes() -> tuple[str, ...]:
    """The beginnings of the addresses that can be opened."""
    return tuple(sorted(_known()))


def find_cameras() -> tuple[list[str], list[Finding]]:
    """Addresses of the cameras that are connected, and why a kind could not be looked for.

    Nothing is configured or started. A driver takes part by a ``find()`` on its entry point that
    returns addresses.
    """
    addresses: list[str] = []
    findings: list[Finding] = []
    for scheme, entry in sorted(_known().items()):
        try:
            factory = _load(f"{scheme}:", entry)
            addresses += _contained(f"{scheme}:", getattr(factory, "find", list))
        except TurnscanError as e:
            findings.append(
                Finding("devices.not-looked", "note", e.message, where=scheme, remedy=e.hint)
            )
    return addresses, findings


def _known() -> dict[str, EntryPoint]:
    """Entry points by scheme; turnscan's own win over others of the same name."""
    found = sorted(
        entry_points(group=GROUP), key=lambda e: (_package(e) == "turnscan", _package(e))
    )
    return {e.name: e for e in found}


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else ""


def _load(address: str, entry: EntryPoint) -> Callable[..., Any]:
    factory: Callable[..., Any] = _contained(address, entry.load)
    return factory


def _contained(address: str, call: Callable[..., Any], *args: Any) -> Any:
    """Call a driver; whatever it raises that is not turnscan's comes out as a DeviceError."""
    try:
        return call(*args)
    except TurnscanError:
        raise
    except (Exception, SystemExit) as e:
        raise DeviceError(
            f"{address}: its driver failed: {type(e).__name__}: {e}",
            hint="this is a defect of the driver; report it to its authors",
        ) from e


class _Opened:
    """A driver's camera between opening and closing."""

    def __init__(self, address: str, camera: Camera) -> None:
        self._address = address
        self._camera: Camera | None = camera
        self._traits: CameraTraits = getattr(camera, "traits", CameraTraits())

    @property
    def traits(self) -> CameraTraits:
        """What the driver says of its pictures."""
        return self._traits

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """See `Camera.configure`."""
        camera = self._there

        def settings() -> tuple[float, float]:
            accepted, amplified = camera.configure(seconds, gain)
            return float(accepted), float(amplified)

        told: tuple[float, float] = _contained(self._address, settings)
        return told

    def grab(self, timeout: float) -> Image:
        """See `Camera.grab`."""
        image: Image = _contained(self._address, self._there.grab, timeout)
        return image

    def close(self) -> None:
        """Let the camera go; whatever its driver makes of that, closing never fails."""
        camera, self._camera = self._camera, None
        close = getattr(camera, "close", None)
        if close is not None:
            try:
                _contained(self._address, close)
            except DeviceError:
                return  # it is of no use any more either way

    @property
    def _there(self) -> Camera:
        if self._camera is None:
            raise DeviceDisconnected(
                f"{self._address}: the camera is closed", hint="open it again with open_camera"
            )
        return self._camera
