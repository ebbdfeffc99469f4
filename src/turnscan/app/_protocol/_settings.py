"""Messages of the settings of a scan."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque, Remark
from turnscan.app._protocol._headers import GridEntry

Option = bool | int | float | str | None


class SettingsSet(Model):
    """A named set of settings in a scan file."""

    name: str
    options: dict[str, Option]


class ScanSettings(Model):
    """What the surface of a scan is made with."""

    options: dict[str, Option]
    """Every option of a reconstruction, by name; null leaves it to turnscan."""
    volume: tuple[float, float | None, float | None]
    """Radius, lowest and largest height of the rig's own working volume, mm; None for no limit."""
    sets: list[SettingsSet]
    """The named sets in the file; to take one up is an edit with its options."""


class SettingsChanged(Model):
    """Other settings hold, or are kept by name; the surface and the grids follow by themselves."""

    kind: Literal["settings"] = "settings"
    scan: Opaque
    settings: ScanSettings
    grids: list[GridEntry]
    findings: list[Remark]


class SettingsTried(Model):
    """What settings would make of a part of the scan. Arrays ``old.K`` and ``new.K`` f32 (n, 3) of
    profile K, NaN where it is torn; positions f32 (v, 3) and faces u32 (f, 3) of the patches as
    ``old.positions`` and so on; ``new.distance`` f32 (v,) from the old one, NaN where it has
    nothing."""

    kind: Literal["settings_tried"] = "settings_tried"
    id: Count
    scan: Opaque
    laser: str
    steps: list[Count]
    """Of the profiles, the one at hand first."""
    findings: list[Remark]


class SettingsCompared(Model):
    """Two settings side by side. Arrays positions f32 (v, 3), faces u32 (f, 3) and distance f32
    (v,) of both, as ``first.positions`` and so on: mm from the other surface, NaN where that has
    nothing."""

    kind: Literal["settings_compared"] = "settings_compared"
    id: Count
    scan: Opaque
    mean: float
    """mm, of the second surface from the first."""
    rms: float
    p95: float
    worst: float
    areas: tuple[float, float]
    """mm², of both."""
    won: float
    """mm² of the second where the first has nothing."""
    lost: float
    """mm² of the first where the second has nothing."""
