"""The parameters of a calibration in words: name, value, uncertainty."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._observations import BEND
from turnscan.calibrate._rig import Calibration
from turnscan.calibrate._words import (
    parameter_in_words,
    uncertainty_in_words,
    value_in_words,
)
from turnscan.rig import Wobble

_BOW = ("aa", "ab", "bb")


def parameters_of(c: Calibration) -> list[tuple[str, str, str]]:
    """Name in words, value with unit, standard uncertainty; of directions the uncertainty alone."""
    state = c.fit.state
    rig, layout = state.rig, state.layout
    camera = rig.camera
    lens = dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True))
    values = {f"camera.{n}": f"{getattr(camera, n):.3f} px" for n in ("fx", "fy", "cx", "cy")}
    values |= {f"camera.{n}": f"{v:.6f}" for n, v in lens.items()}
    for s in rig.sheets:
        away = float(s.normal @ s.centre)
        values[f"{s.name}.offset"] = f"{away:.3f} mm from the camera"
        values[f"{s.name}.turn_along"] = f"normal {_vector(s.normal)}"
        bows = {f"{s.name}.bow_{n}": float(q) for n, q in zip(_BOW, s.bow, strict=True)}
        values |= {name: value_in_words(name, q) for name, q in bows.items()}
    if rig.table_known or layout is not None:
        T = c.rig.T_camera_table
        values["table.turn_x"] = f"axis {_vector(T.rotation[:, 2])}"
        shifts = zip("xyz", T.translation, strict=True)
        values |= {f"table.shift_{n}": f"{t:.3f} mm" for n, t in shifts}
    if c.rig.wobble is not None:
        moves = zip(Wobble.NAMES, c.rig.wobble.values, strict=True)
        values |= {n: value_in_words(n, float(v)) for n, v in moves}
    if isinstance(layout, MarkerLayout):
        own = [*layout.shape, *layout.squares.ravel()]
        values |= {n: value_in_words(n, float(v)) for n, v in zip(layout.names, own, strict=True)}
    values |= {n: value_in_words(n, float(v)) for n, v in zip(BEND, state.bend, strict=True)}
    sigma = np.sqrt(np.diag(c.fit.covariance))
    return [
        (
            parameter_in_words(name),
            values.get(name, ""),
            uncertainty_in_words(name, float(s)) if s > 0 else "held fixed",
        )
        for name, s in zip(c.network.names, sigma, strict=True)
    ]


def _vector(v: Floats) -> str:
    return "(" + ", ".join(f"{x:+.5f}" for x in v) + ")"
