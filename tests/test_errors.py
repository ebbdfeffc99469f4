"""The error tree: one line each, the builtin it resembles, the exit code the door gives."""

from __future__ import annotations

import pytest

from turnscan import errors


def _tree() -> list[type[errors.TurnscanError]]:
    return [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and issubclass(kind, errors.TurnscanError)
    ]


def test_every_error_stands_in_the_printed_tree() -> None:
    assert errors.__doc__ is not None
    for kind in _tree():
        assert kind.__name__ in errors.__doc__


@pytest.mark.parametrize("kind", _tree(), ids=lambda k: k.__name__)
def test_error_is_one_line_with_its_hint(kind: type[errors.TurnscanError]) -> None:
    error = kind("picture 7:\nboard not seen", hint="turn the\nlight on")
    assert str(error) == "picture 7: board not seen → turn the light on"
    assert error.exit_code in {1, 2, 3, 4, 5}


@pytest.mark.parametrize(
    ("kind", "builtin", "code"),
    [
        (errors.DeviceTimeout, TimeoutError, 3),
        (errors.DeviceDisconnected, ConnectionError, 3),
        (errors.LaserStateUnknown, RuntimeError, 4),
        (errors.ScanCorrupt, OSError, 5),
        (errors.StorageFull, OSError, 5),
        (errors.FormatError, ValueError, 2),
        (errors.NotEnoughViews, ValueError, 1),
        (errors.ExportError, OSError, 5),
    ],
)
def test_error_resembles_a_builtin_and_has_an_exit_code(
    kind: type[errors.TurnscanError], builtin: type[Exception], code: int
) -> None:
    assert issubclass(kind, builtin)
    assert kind.exit_code == code
    with pytest.raises(builtin, match="what"):
        raise kind("what")
