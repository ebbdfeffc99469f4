"""Which laser is which? The camera tells."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.scanner._examine import Examination
from turnscan.scanner._open import Opened

_FEW = 0.05
"""Share of the lines with a stripe below which a laser was not seen."""


@dataclass(frozen=True)
class Seen:
    """Camera picture of a laser."""

    name: str
    column: float | None
    """px, where its stripe is; None where there is none."""
    place: str
    """left, right, middle (numbered from the left where there are several), or dark."""


def which_laser(bench: Opened, seconds: float | None = None, gain: float = 1.0) -> list[Seen]:
    """Light each laser for one picture, and tell from its stripe where it stands.

    On what is in front, a laser from the left throws its stripe left of one from the right; so one
    that is alone could be either. All is dark when this returns, however it does. Raises
    DeviceError and SafetyError as the devices do.
    """
    look = Examination(bench.hardware, seconds or bench.exposure, gain)
    with look.shooter.dark_at_the_end():
        facts = [look.laser(name) for name in bench.hardware.lasers.names]
    columns = {f.name: f.column for f in facts if f.found >= _FEW}
    order = sorted(columns, key=columns.__getitem__)
    places = dict(zip(order, _places(len(order)), strict=True))
    return [Seen(f.name, columns.get(f.name), places.get(f.name, "dark")) for f in facts]


def _places(count: int) -> list[str]:
    if count <= 1:
        return ["the only one"][:count]
    inner = [f"middle{k + 1}" if count > 3 else "middle" for k in range(count - 2)]
    return ["left", *inner, "right"]
