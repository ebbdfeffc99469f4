"""What a user may choose about the formats of files that are written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.formats import DxfForm, ExportOptions


@dataclass(frozen=True)
class FormatOptions(Checked):
    """How meshes are written; a format ignores what does not concern it."""

    dxf_forms: tuple[DxfForm, ...] = option(
        ("3dface",), "choice",
        "DXF entities that hold the part; may be repeated, each on its own layer.",
        choices=("3dface", "polyface", "mesh", "profiles"), many=True, group="Formats",
    )  # fmt: skip
    dxf_version: Literal["R12", "R2010"] | None = option(
        None, "choice",
        "DXF version.  [default: R12, which all programs read; R2010 for form mesh]",
        choices=("R12", "R2010"), group="Formats",
    )  # fmt: skip
    ascii: bool = option(False, "switch", "Write STL and PLY as text.", group="Formats")
    float32: bool = option(
        False, "switch", "Write PLY coordinates as 32-bit numbers.", group="Formats"
    )
    obj_texture: bool = option(
        False, "switch",
        "Write the colours of an OBJ also as a texture, in part.mtl and part-texture.png.",
        group="Formats",
    )  # fmt: skip

    @property
    def export_options(self) -> ExportOptions:
        """The same as the formats take them. Raises InputError where they exclude each other."""
        from turnscan.formats import ExportOptions

        if not self.dxf_forms:
            raise InputError("none chosen", hint="choose one or more", option=Option("dxf_forms"))
        return ExportOptions(
            dxf_forms=tuple(dict.fromkeys(self.dxf_forms)),
            dxf_version=self.dxf_version or ("R2010" if "mesh" in self.dxf_forms else "R12"),
            ascii=self.ascii,
            single=self.float32,
            texture=self.obj_texture,
        )
