"""The document around the bodies: header, tables and layers by ezdxf, made reproducible."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.formats._options import DxfVersion
from turnscan.formats._text import about_lines

if TYPE_CHECKING:
    from ezdxf.document import Drawing

_DAY = "2451544.5"  # 2000-01-01 as a Julian date: a file must not depend on the clock
_NOBODY = "{00000000-0000-0000-0000-000000000000}"
_ENTITIES = "  0\nSECTION\n  2\nENTITIES\n"


@dataclass(frozen=True)
class Frame:
    """A document without entities."""

    head: str
    """All up to the first entity."""
    tail: str
    """All after the last entity."""
    first_handle: int
    """The lowest handle that is free for entities."""
    owner: int
    """Handle of the block record of the model space."""

    def around(self, body: list[bytes], next_handle: int) -> bytes:
        """Return the whole file; ``next_handle`` is the first that the body left free."""
        seed = rf"\g<1>{next_handle:X}"
        head = re.sub(r"(\$HANDSEED\n  5\n)[0-9A-F]+", seed, self.head, count=1)
        return b"".join([head.encode("ascii"), *body, self.tail.encode("ascii")])


def frame(
    version: DxfVersion, layers: Mapping[str, int], bounds: Floats, about: Mapping[str, object]
) -> Frame:
    """Return a document with layers (name → colour number) for entities within (2, 3) bounds, mm.

    The unit and ``about`` stand in comments (group 999) at the top, which every version allows;
    R2010 also has them in $INSUNITS and in the custom properties.
    """
    document, notes = new_document(version, layers, bounds, about)
    head, tail = text_of(document, notes).split(_ENTITIES)
    return Frame(
        head=head + _ENTITIES,
        tail=tail,
        first_handle=int(str(document.entitydb.handles), 16),
        owner=int(document.modelspace().block_record_handle, 16),
    )


def new_document(
    version: DxfVersion, layers: Mapping[str, int], bounds: Floats, about: Mapping[str, object]
) -> tuple[Drawing, list[str]]:
    """An empty document as `frame` says, and the lines of its comments."""
    from ezdxf.document import Drawing

    document = Drawing.new(version)
    notes = ["unit: millimetre", *about_lines(about)]
    if version != "R12":
        document.units = 4
        for i, line in enumerate(notes):
            document.header.custom_vars.append(f"turnscan {i}", line)
    for name, colour in layers.items():
        document.layers.add(name, color=colour)
    low, high = ([float(x) for x in corner] for corner in bounds)
    document.modelspace().reset_extents(low, high)
    document.header["$EXTMIN"], document.header["$EXTMAX"] = low, high
    document.set_modelspace_vport(
        height=1.2 * max(float(np.ptp(bounds, axis=0).max()), 1e-6),
        center=((low[0] + high[0]) / 2, (low[1] + high[1]) / 2),
    )
    return document, notes


def text_of(document: Drawing, notes: list[str]) -> str:
    """The whole file, with comments at its top; the same document gives the same text."""
    out = io.StringIO()
    document.write(out)
    return "".join(f"999\n{note}\n" for note in notes) + _reproducible(out.getvalue())


def _reproducible(text: str) -> str:
    """Replace what ezdxf takes from the clock and from chance."""
    text = re.sub(r"(\$TDU?(?:CREATE|UPDATE)\n 40\n)[^\n]*", rf"\g<1>{_DAY}", text)
    text = re.sub(r"(GUID\n  2\n)\{[^}\n]*\}", rf"\g<1>{_NOBODY}", text)
    return re.sub(r"(\n[0-9][0-9a-z.]*) @ [0-9T:.+-]+\n", r"\1\n", text)
