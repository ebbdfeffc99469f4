"""Parameters of a rig in words, with the units in which people read them."""

from __future__ import annotations

import math

_CAMERA = {
    "fx": "focal length across the picture",
    "fy": "focal length down the picture",
    "cx": "column of the optical axis",
    "cy": "row of the optical axis",
    "tilt_x": "tilt of the sensor about its row",
    "tilt_y": "tilt of the sensor about its column",
}
_SHEET = {
    "turn_along": "turn of the sheet about its stripe",
    "turn_across": "lean of the stripe in the sheet",
    "offset": "shift of the sheet",
    "bow_aa": "bow of the sheet along the stripe",
    "bow_ab": "twist of the sheet",
    "bow_bb": "bow of the sheet across the stripe",
}
_WAYS = {"x": "right", "y": "downwards", "z": "away from the camera"}
_PLAY = {"start": "play taken up at the start", "backlash": "play between the two ways of turning"}
_WOBBLE = {
    "tilt_x": "tilt about the table's x, against the turn",
    "tilt_y": "tilt about the table's y, against the turn",
    "shift_x": "shift along the table's x, against the turn",
    "shift_y": "shift along the table's y, against the turn",
    "rise_cos": "rise and fall, cosine part",
    "rise_sin": "rise and fall, sine part",
}
_PIXELS = ("fx", "fy", "cx", "cy")
"""Parameters of a camera that are counted in px."""


def parameter_in_words(name: str) -> str:
    """What a parameter of a rig, of its table or of a body is, in words; ``scale`` is that of all
    lengths. A name that has no words of its own stays as it is, without points and underscores."""
    of, _, what = name.rpartition(".")
    plain = what.replace("_", " ")
    if name == "scale":
        return "the scale of all lengths"
    if of == "camera":
        return f"camera: {_CAMERA.get(what, f'distortion {what}')}"
    if of == "table" and what.startswith("turn_"):
        return f"rotation axis: turn about the direction {_WAYS[what[-1]]}"
    if of == "table" and what.startswith("shift_"):
        return f"rotation axis: shift {_WAYS[what[-1]]}"
    if of == "table" and what.startswith("wobble_"):
        return f"axis in a turn: {_WOBBLE[what[7:]]}"
    if of == "motion":
        if what in _PLAY:
            return f"table: {_PLAY[what]}"
        part = "cosine" if what.startswith("cos") else "sine"
        return f"table: wave {what[3:]} per turn, {part} part"
    if what in _SHEET:
        return f"laser {of}: {_SHEET[what]}"
    return f"{of.replace('_', ' ')}: {plain}" if of else plain


def amount_in_words(name: str, value: float, sigma: float) -> str:
    """A value and its standard uncertainty (mm, rad, px as the parameter has them), with the unit;
    angles in degrees."""
    factor, unit = unit_of(name)
    digits = "{:+.3g} ± {:.3g}" if "/" in unit else "{:+.4f} ± {:.4f}"
    return digits.format(factor * value, factor * sigma) + unit


def value_in_words(name: str, value: float) -> str:
    """A value (mm, rad, px as the parameter has it), with its unit; angles in degrees."""
    factor, unit = unit_of(name)
    return f"{factor * value:.6g}{unit}"


def uncertainty_in_words(name: str, sigma: float) -> str:
    """A standard uncertainty (mm, rad, px as the parameter has them), with its unit; angles in
    degrees."""
    factor, unit = unit_of(name)
    return f"{factor * sigma:.3g}{unit}"


def unit_of(name: str) -> tuple[float, str]:
    """What a parameter is multiplied with to be read, and the unit that follows the number; empty
    for a number without one."""
    of, _, what = name.rpartition(".")
    if (
        of == "motion"
        or what.startswith(("turn_", "tilt_", "wobble_tilt"))
        or what.endswith("angle")
    ):
        return math.degrees(1.0), "°"
    if of == "camera":
        return 1.0, " px" if what in _PIXELS else ""
    if what.startswith(("bow_", "bend_")):
        return 1.0, " 1/mm"
    if what.startswith("slope_") or name == "scale":
        return 1.0, ""
    return 1.0, " mm"
