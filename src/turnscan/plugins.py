"""What other packages add, found by entry points; what they raise breaks nothing but themselves."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from turnscan.errors import PluginError, TurnscanError

T = TypeVar("T")


class Plugin:
    """One thing that an installed package adds. It is loaded once, when it is made."""

    def __init__(self, entry: EntryPoint) -> None:
        """Load it. Raises PluginError where that fails."""
        self.name = entry.name
        self.source = entry.value
        """Module and name of the thing, like ``my_package:detect``."""
        dist = entry.dist
        self.package = "an unknown package" if dist is None else f"{dist.name} {dist.version}"
        self.value: Any = self.run(entry.load)

    def run(self, function: Callable[..., T], *args: Any, **named: Any) -> T:
        """Call one of its functions. Raises PluginError for whatever is not turnscan's own error.

        A module that ends the program while it is loaded counts as one that fails.
        """
        try:
            return function(*args, **named)
        except TurnscanError:
            raise
        except (Exception, SystemExit) as e:
            raise self.failure(f"{type(e).__name__}: {e}") from e

    def failure(self, text: str) -> PluginError:
        """The error that says what is wrong with it."""
        return PluginError(
            f"{self.name} of {self.package} ({self.source}) failed: {text}",
            hint="update or remove that package",
        )

    def __str__(self) -> str:
        return f"{self.name} ({self.package}, {self.source})"

    def __deepcopy__(self, memo: object) -> Plugin:
        return self  # settings that hold one are copied to be written down


def plugin_names(group: str) -> tuple[str, ...]:
    """The names that installed packages use in a group of entry points, sorted; loads nothing."""
    return tuple(sorted({e.name for e in entry_points(group=group)}))


def find_plugin(group: str, name: str) -> Plugin | None:
    """The thing of that name, loaded; None where there is none.

    Where two packages use a name, the one whose own name comes first in the alphabet has it.
    Raises PluginError where it cannot be loaded.
    """
    found = sorted(entry_points(group=group, name=name), key=_order)
    return Plugin(found[0]) if found else None


def _order(entry: EntryPoint) -> tuple[str, str]:
    return ("" if entry.dist is None else entry.dist.name, entry.value)
