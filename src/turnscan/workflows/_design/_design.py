"""Design: what a rig will resolve, before it is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.rig import Design, rig_to_json, table_1_designs
from turnscan.workflows._design._report import (
    design_body,
    design_lines,
    paper_body,
    paper_lines,
    without_nan,
)
from turnscan.workflows._files._writing import check_output, write_atomically
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._design import DesignOptions


@dataclass(frozen=True)
class DesignedRig:
    """Designs that differ in their angle of triangulation, and what they will resolve."""

    designs: tuple[Design, ...]
    published: bool = False
    """Whether this is the rig of the paper, with what the paper prints about it."""

    def lines(self) -> list[str]:
        """All figures, rounded, as lines of a table."""
        return list(paper_lines() if self.published else design_lines(self.designs))

    def body(self) -> dict[str, Any]:
        """All figures, unrounded, for JSON; None where there is no number."""
        held = paper_body() if self.published else design_body(self.designs)
        clean: dict[str, Any] = without_nan(held)
        return clean


def design(
    options: DesignOptions | None = None,
    theta_deg: Sequence[float] = (),
    *,
    picture: str | PathLike[str] | None = None,
    rig: str | PathLike[str] | None = None,
    **changes: Any,
) -> DesignedRig:
    """Resolution, working volume and physical limits of a rig before it is built.

    Parameters
    ----------
    options
        What differs from a 5 megapixel rig at 30°; lengths in mm.
    theta_deg
        Angles of triangulation in degrees; without them the preset's.
    picture
        A PNG to write: working volume, resolution and error of the first angle.
    rig
        A rig file to write, as if this geometry were calibrated; for one angle only.
    changes
        Options to change by name, as in ``distance=300.0``.

    Returns
    -------
    DesignedRig
        A design for each angle, and its figures.

    Raises
    ------
    InputError
        A rig that cannot be; nothing is written then.
    ExportError
        A file cannot be written.

    >>> import turnscan as ts
    >>> done = ts.design(theta_deg=[22.5, 45.0], preset="paper")
    >>> [round(float(d.delta_r()), 2) for d in done.designs]  # mm in a pixel, at the axis
    [1.15, 0.62]
    """
    wanted = chosen(DesignOptions, options, changes)
    return _written(DesignedRig(wanted.designs(theta_deg)), picture, rig)


def published_design(
    *, picture: str | PathLike[str] | None = None, rig: str | PathLike[str] | None = None
) -> DesignedRig:
    """The paper's rig: its Table 1, and where its print and its equations disagree.

    Takes, returns and raises what `design` does.
    """
    return _written(DesignedRig(table_1_designs(), published=True), picture, rig)


def _written(
    done: DesignedRig, picture: str | PathLike[str] | None, rig: str | PathLike[str] | None
) -> DesignedRig:
    picture = None if picture is None else Path(picture)
    rig = None if rig is None else Path(rig)
    if picture is not None:
        check_output(picture, (".png",))
    if rig is not None:
        check_output(rig, (".json",))
        if len(done.designs) > 1:
            raise InputError(
                f"a rig has one angle, but there are {len(done.designs)}",
                hint=Remedy("give one ", Option("theta_deg")),
                option=Option("rig"),
            )
    if picture is not None:
        from turnscan.workflows._design._picture import draw

        write_atomically(picture, draw(done.designs))
    if rig is not None:
        write_atomically(rig, rig_to_json(done.designs[0].rig()).encode())
    return done
