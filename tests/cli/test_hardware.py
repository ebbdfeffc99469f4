"""Signals of the verbs that drive devices, and the options to go on with."""

from __future__ import annotations

import os
import shlex
import signal

import pytest

from tests.needs import needs
from turnscan.cli._devices_in_use import again
from turnscan.cli._signals import ended_by_signals
from turnscan.workflows import DeviceOptions


def test_a_hang_up_ends_the_block_but_not_under_nohup() -> None:
    needs("POSIX")
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with pytest.raises(KeyboardInterrupt), ended_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with ended_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_options_are_repeated_as_they_were_given() -> None:
    assert again(None) == again(DeviceOptions()) == ""
    assert again(DeviceOptions(device="sim:cup?seed=8")) == " --device 'sim:cup?seed=8'"
    given = DeviceOptions(camera="folder:my pictures", turntable="grbl:/dev/ttyUSB0")
    words = shlex.split(again(given))
    assert words == ["--camera", "folder:my pictures", "--turntable", "grbl:/dev/ttyUSB0"]
    assert given.addresses().camera == "folder:my pictures"
