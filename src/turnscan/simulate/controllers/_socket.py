"""A board on a pseudo-terminal that can be unplugged."""

from __future__ import annotations

import contextlib
import os
import select
import tempfile
import termios
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from turnscan.simulate.controllers._cable import Cable
from turnscan.simulate.controllers._firmware import Firmware


class Socket:
    """Runs a board's firmware in a thread behind a pseudo-terminal.

    ``scale`` board seconds pass in one second. With ``reset_on_open`` opening the port restarts the
    board, as DTR does with an Arduino. `path` stays the same through unplugging.
    """

    def __init__(
        self,
        firmware: Firmware,
        *,
        scale: float = 1.0,
        reset_on_open: bool = False,
        path: Path | None = None,
        baud: int = 0,
        cable: Cable | None = None,
    ) -> None:
        """``path``: where the port shall appear; without it, in a folder of its own.

        ``baud``: the rate at which the board talks; at another one both sides hear noise. 0: any.
        """
        self.cable = cable or Cable()
        self._baud = baud
        self.firmware = firmware
        self._scale, self._reset_on_open = scale, reset_on_open
        self._folder = tempfile.TemporaryDirectory(prefix="turnscan-board-")
        self.path = str(path or Path(self._folder.name) / "port")
        self._closing = threading.Event()
        self._paused = threading.Event()
        self._begin = time.monotonic()
        self._master = -1
        self.opened: list[float] = []
        """`time.monotonic` of every opening."""
        self._thread = threading.Thread(target=self._run, daemon=True, name="board")

    def __enter__(self) -> Socket:
        """Plug it in."""
        self._plug()
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Unplug it for good."""
        self._closing.set()
        self._thread.join(timeout=5.0)
        self._unplug()
        self._folder.cleanup()

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """The board's processor stands still: nothing is read, buffers fill."""
        self._paused.set()
        try:
            yield
        finally:
            self._paused.clear()

    def _plug(self) -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        link = Path(self.path)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(slave))
        os.close(slave)
        os.set_blocking(master, False)
        self._master, self._open = master, False

    def _unplug(self) -> None:
        if self._master >= 0:
            Path(self.path).unlink(missing_ok=True)
            os.close(self._master)
            self._master = -1

    def _now(self) -> float:
        return (time.monotonic() - self._begin) * self._scale

    def _run(self) -> None:
        board = self.firmware
        while not self._closing.is_set():
            if self._paused.is_set():
                self._closing.wait(0.002)
                continue
            board.run(self._now())
            if board.unplugged:
                self._pull(board)
                continue
            self.cable.up(board.take(), time.monotonic())
            data = self._at_rate(self.cable.arrived(time.monotonic()))
            with contextlib.suppress(OSError):  # nobody there, or nobody reads
                if data and self._open:
                    os.write(self._master, data)
            self._hear(board, self._patience(board))

    def _patience(self, board: Firmware) -> float:
        wake, arrives = board.wake(), self.cable.wake()
        waits = [] if wake is None else [(wake - self._now()) / self._scale]
        if arrives is not None:
            waits.append(arrives - time.monotonic())
        return max(0.0, min([0.05, *waits]))

    def _hear(self, board: Firmware, patience: float) -> None:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        happened = poll.poll(patience * 1000)
        events = happened[0][1] if happened else 0
        hung = bool(events & select.POLLHUP)
        if not hung and not self._open:
            self.opened.append(time.monotonic())
            if self._reset_on_open:
                board.run(self._now())
                board.power_on()
        self._open = not hung
        if events & select.POLLIN:
            with contextlib.suppress(OSError):
                data = os.read(self._master, 4096)
                board.run(self._now())
                board.feed(self.cable.down(self._at_rate(data)))
        elif hung:
            self._closing.wait(0.001)

    def _at_rate(self, data: bytes) -> bytes:
        """Noise where the other side has set another rate."""
        if not self._baud or not data:
            return data
        speed = termios.tcgetattr(self._master)[5]
        if speed == getattr(termios, f"B{self._baud}"):
            return data
        return bytes(0x80 | (byte * 37 + 11) % 128 for byte in data)

    def _pull(self, board: Firmware) -> None:
        """The port disappears for a while; a board that keeps its power lives on."""
        self._unplug()
        self.cable.cut()
        end = time.monotonic() + board.unplugged
        while (left := end - time.monotonic()) > 0 and not self._closing.wait(min(left, 0.01)):
            if board.powered:
                board.run(self._now())
                board.take()
        board.run(self._now())
        if not board.powered:
            board.power_on()
        self._plug()
        board.unplugged = 0.0
