"""What a user may choose about the formats of files that are written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._units import STEP_SUFFIXES

if TYPE_CHECKING:
    from turnscan.formats import DxfForm, ExportOptions


_CONCERN = {
    "dxf_forms": (".dxf",),
    "dxf_version": (".dxf",),
    "ascii": (".stl", ".ply"),
    "float32": (".ply",),
    "obj_texture": (".obj",),
}
"""Which files an option has an effect on."""


@dataclass(frozen=True)
class FormatOptions(Checked):
    """How meshes are written; of several files each takes what concerns its format."""

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

    def export_options(self, outputs: Iterable[Path]) -> ExportOptions:
        """The same as the formats of the files to write take them.

        Raises InputError where they exclude each other, or one concerns none of the files.
        """
        from turnscan.formats import ExportOptions

        if not self.dxf_forms:
            raise InputError("none chosen", hint="choose one or more", option=Option("dxf_forms"))
        self._refuse_idle(list(outputs))
        return ExportOptions(
            dxf_forms=tuple(dict.fromkeys(self.dxf_forms)),
            dxf_version=self.dxf_version or ("R2010" if "mesh" in self.dxf_forms else "R12"),
            ascii=self.ascii,
            single=self.float32,
            texture=self.obj_texture,
        )

    def _refuse_idle(self, outputs: Sequence[Path]) -> None:
        from turnscan.formats import EXPORTERS

        kinds = {path.suffix.lower() for path in outputs}
        if kinds - {*EXPORTERS, *STEP_SUFFIXES}:  # what another package's format makes of them
            return
        for name in self.changed():
            if not kinds.intersection(_CONCERN[name]):
                suffixes = " or ".join(_CONCERN[name])
                raise InputError(
                    f"no effect on {', '.join(path.name for path in outputs)}",
                    hint=f"leave it out, or write a {suffixes} as well",
                    option=Option(name),
                )
