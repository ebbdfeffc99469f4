"""``manual:``: a person turns the table when asked."""

from __future__ import annotations

import math
import queue
import sys
import threading
import time
from collections.abc import Callable

from turnscan.errors import DeviceDisconnected, DeviceRefused, DeviceTimeout

Ask = Callable[[str], str]


def ask_at_terminal(question: str) -> str:
    """Write to standard error and read a line; "" at the end of the input is no answer."""
    sys.stderr.write(question)
    sys.stderr.flush()
    line = sys.stdin.readline()
    if not line:
        raise EOFError
    return line.strip()


class ManualTurntable:
    """`turnscan.devices.Turntable` made of a person, who presses Enter when the table is there.

    The answer may be the angle really reached, in degrees; empty means as asked, ``q`` gives up.
    """

    def __init__(self, ask: Ask = ask_at_terminal) -> None:
        self._ask = ask
        self._stop = threading.Event()
        self._closed = False

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`. Raises DeviceRefused when the person or `stop` gives up."""
        if not math.isfinite(angle):
            raise DeviceRefused(f"manual turntable: angle {angle}", hint="give a finite angle")
        if self._closed:
            raise DeviceDisconnected("manual turntable: closed")
        self._stop.clear()
        degrees = math.degrees(angle)
        question = f"Turn the table to {degrees:.3f}°, then press Enter (or type the angle, or q): "
        while True:
            answer = self._answer(question, timeout).strip().rstrip("°").replace(",", ".")
            if not answer:
                return angle
            if answer.lower().startswith("q"):
                raise DeviceRefused("manual turntable: given up by the operator")
            try:
                reached = math.radians(float(answer))
            except ValueError:
                reached = math.nan
            if math.isfinite(reached):
                return reached
            question = f"{answer!r} is not an angle. Enter, an angle in degrees, or q: "

    def _answer(self, question: str, timeout: float) -> str:
        answers: queue.SimpleQueue[str | None] = queue.SimpleQueue()

        def wait() -> None:
            try:
                answers.put(self._ask(question))
            except (EOFError, OSError, ValueError):
                answers.put(None)

        threading.Thread(target=wait, daemon=True, name="manual turntable").start()
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            if self._stop.is_set():
                raise DeviceRefused("manual turntable: stopped")
            try:
                answer = answers.get(timeout=0.05)
            except queue.Empty:
                continue
            if answer is None:
                raise DeviceDisconnected("manual turntable: no terminal for the operator's answer")
            return answer
        raise DeviceTimeout(f"manual turntable: no answer within {timeout:g} s")

    def stop(self) -> None:
        """See `Turntable`: the question is withdrawn."""
        self._stop.set()

    def close(self) -> None:
        """Withdraw the question and ask no more."""
        self._closed = True
        self._stop.set()
