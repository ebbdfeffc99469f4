"""What the part of a refinement is known to be: a form, or an artefact that was measured."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnscan.calibrate import Balls, Part, Round
from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._calibration._verify import read_artefact
from turnscan.workflows._files._reading import read_mesh_file
from turnscan.workflows._options._refine import RefineOptions

if TYPE_CHECKING:
    from turnscan.shapes.verification import Artefact

Form = Balls | Round | Part
Known = tuple[float, float]
Body = tuple[Form, tuple[Known | None, ...]]
"""A form and what is known of its sizes, mm and rad."""
_FORMS: dict[str, Form] = {
    "sphere": Balls(), "cylinder": Round(), "cone": Round(conical=True),
}  # fmt: skip
_MEASURED = (".toml", ".json")
_LEAST = 1e-4
"""mm: no length is known better."""
_CONE = math.radians(0.01)
"""Standard uncertainty of the half angle that is given."""


def body_of(options: RefineOptions, artefact: str | PathLike[str] | None) -> Body | None:
    """What the part is, by whichever says it; None where nothing does.

    Raises InputError where more than one says it, or what it says cannot be read or used.
    """
    given = {"sphere": options.sphere, "body": options.body, "artefact": artefact}
    named = [n for n, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(
            "the part is described twice",
            hint="say once what it is",
            option=Option(named[1], str(given[named[1]])),
        )
    if options.sphere is not None:
        return Balls(), ((options.sphere / 2, options.sphere_sigma / 2),)
    if options.body is not None:
        return _form_of(options.body, options.sphere_sigma)
    if artefact is None:
        return None
    path = Path(artefact)
    if path.suffix.lower() in _MEASURED:
        return _measured(read_artefact(path))
    return _drawn(path, options.sphere_sigma)


def _drawn(path: Path, sigma: float) -> Body:
    """A part as it is drawn, its lengths known to ``sigma`` mm over its longest side."""
    mesh = read_mesh_file(path)
    try:
        form = Part(mesh)
    except InputError as e:
        raise InputError(f"{path}: {e.message}", hint=e.hint) from None
    longest = float(np.ptp(form.mesh.vertices[form.mesh.faces.ravel()], axis=0).max())
    return form, ((1.0, sigma / longest),)


def _form_of(text: str, sigma: float) -> Body:
    """``cylinder``, ``cylinder:40.02``, ``cone``, ``cone:15`` or ``sphere``."""
    kind, colon, size = text.partition(":")
    form = _FORMS.get(kind)
    wrong = InputError(
        "not a form with its size",
        hint="write sphere, cylinder or cone, and where it is known the diameter in mm "
        "(cylinder:40.02) or the half angle in degrees (cone:15)",
        option=Option("body", text),
    )
    if form is None:
        raise wrong
    known: list[Known | None] = [None] * len(form.size_names)
    if colon:
        try:
            value = float(size)
        except ValueError:
            raise wrong from None
        if not 0 < value < (90 if kind == "cone" else 1e4):
            raise wrong
        known[-1] = (math.radians(value), _CONE) if kind == "cone" else (value / 2, sigma / 2)
    return form, tuple(known)


def _measured(a: Artefact) -> Body:
    """A sphere or ball bar as its file says."""
    radii = [(d.value / 2, max(d.sigma / 2, _LEAST)) for d in a.diameters]
    if a.kind == "sphere":
        return Balls(), tuple(radii)
    if a.kind == "ball-bar" and a.distance is not None:
        return Balls(2), (*radii, (a.distance.value, max(a.distance.sigma, _LEAST)))
    raise InputError(
        f"{a.name}: the lengths of a {a.kind} do not say what its sides are like",
        hint="give the part as it is drawn instead (STL, STEP)",
    )
