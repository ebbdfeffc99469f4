"""Where the edits of a scan come from."""

from turnscan.workflows._history import history_of

__all__ = ["history_of"]
