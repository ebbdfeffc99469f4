"""What the user can choose about a file, and what can be written into one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from turnscan.arrays import Floats, frozen
from turnscan.errors import InputError

DxfForm = Literal["3dface", "polyface", "mesh", "profiles"]
DxfVersion = Literal["R12", "R2010"]


@dataclass(frozen=True)
class ExportOptions:
    """Choices that the formats share; a format ignores what does not concern it."""

    dxf_forms: tuple[DxfForm, ...] = ("3dface",)
    """What a DXF holds, each on its own layer; ``mesh`` needs R2010."""
    dxf_version: DxfVersion = "R12"
    ascii: bool = False
    """STL and PLY as text instead of binary."""
    single: bool = False
    """PLY coordinates as 32-bit instead of 64-bit numbers."""
    texture: bool = False
    """Whether an OBJ that is written under a name has its colours as a texture, too."""
    material: str = ""
    """OBJ: name of the MTL beside it, without suffix, that holds its colours; "" for none."""
    about: Mapping[str, object] = field(default_factory=dict)
    """Provenance to embed: rig hash, parameters; must go into JSON."""

    def __post_init__(self) -> None:
        for form in self.dxf_forms:
            if form not in get_args(DxfForm):
                raise InputError(
                    f"DXF form {form!r} is unknown", hint=f"use one of {get_args(DxfForm)}"
                )
        if self.dxf_version not in get_args(DxfVersion):
            raise InputError(
                f"DXF version {self.dxf_version!r} is unknown", hint="use R12 or R2010"
            )
        if not self.dxf_forms:
            raise InputError("no DXF form was chosen", hint="choose 3dface, the form all can read")
        if "mesh" in self.dxf_forms and self.dxf_version == "R12":
            raise InputError(
                "DXF R12 has no MESH entity", hint="use DXF version R2010, or form 3dface"
            )


DEFAULTS = ExportOptions()
"""3DFACE in R12, the form that every reader knows; binary where there is a choice."""


@dataclass(frozen=True)
class Profiles:
    """Profiles as they were measured: unbroken runs of points, by laser."""

    lines: Mapping[str, tuple[Floats, ...]]
    """For each laser, runs of (k, 3) points in mm, k ≥ 1."""

    def __post_init__(self) -> None:
        checked = {
            laser: tuple(frozen(run, (None, 3), f"Profiles.lines[{laser!r}]") for run in runs)
            for laser, runs in self.lines.items()
        }
        object.__setattr__(self, "lines", checked)

    @property
    def points(self) -> Floats:
        """(n, 3) mm: the points of all runs, one after the other."""
        runs = [run for runs in self.lines.values() for run in runs]
        return np.concatenate(runs) if runs else np.empty((0, 3))
