"""The option that thins a mesh out, for the verbs that write one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import click


@dataclass(frozen=True)
class Fewer:
    """How far a mesh is thinned out: one of the two is given."""

    tolerance: float | None
    """mm."""
    faces: int | None


class FewerType(click.ParamType[Fewer]):
    """``0.05mm`` is a tolerance, ``100000`` a number of faces."""

    name = "TOL|COUNT"

    def convert(
        self, value: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> Fewer:
        """Return what is asked for, or refuse it naming the option."""
        text = value.strip().lower()
        length = text.removesuffix("mm").strip()
        if text.isdecimal():
            if int(text) < 4:
                self.fail(f"{value!r} faces are no surface; a tolerance ends in mm.", param, ctx)
            return Fewer(None, int(text))
        try:
            tolerance = float(length)
        except ValueError:
            tolerance = math.nan
        if not (tolerance > 0 and math.isfinite(tolerance)):
            self.fail(f"{value!r}: give a length like 0.05mm or a number of faces.", param, ctx)
        return Fewer(tolerance, None)


decimate_option = click.option(
    "--decimate",
    type=FewerType(),
    help="Thin the mesh out: as far as a tolerance (0.05mm) allows, or to a number of faces.",
)
