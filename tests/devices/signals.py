"""A signal before any one line of the drivers, as Python may hear it there."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any


def interrupted(act: Callable[[], object], number: int, files: tuple[str, ...]) -> str:
    """Do it, with KeyboardInterrupt raised before the line ``number`` that is run in these files.

    The function that was interrupted; empty where it ended with fewer lines than that.
    """
    seen, where = 0, ""

    def line(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal seen, where
        if event == "line" and not where:
            seen += 1
            if seen == number:
                where = frame.f_code.co_name
                raise KeyboardInterrupt
        return line

    def call(frame: FrameType, *_: Any) -> Any:
        return line if frame.f_code.co_filename.endswith(files) and not where else None

    before = sys.gettrace()
    sys.settrace(call)
    try:
        act()
    except KeyboardInterrupt:
        assert where
    finally:
        sys.settrace(before)
    return where
