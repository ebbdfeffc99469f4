"""What scans of a part left open of their rig, and the one scan that would help most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import Fit
from turnscan.calibrate._advice import Advice
from turnscan.calibrate._shape import shape_doubt
from turnscan.calibrate._surfaces import Surfaces
from turnscan.calibrate._sweeps import Sweep
from turnscan.calibrate._words import parameter_in_words
from turnscan.rig import Rig

_WAVES = ("motion.cos", "motion.sin")


def refine_advice(
    rig: Rig,
    fit: Fit[Surfaces],
    free: Bools,
    held: Sequence[str],
    sweeps: Sequence[Sweep],
    bent: float,
) -> Advice:
    """What is open after a refinement, as ``held`` names it, and the scan that would help most.

    What no repetition tells comes first: the scale without a length, laser sheets and axis where
    the part says nothing of them, waves and play of the table where the scan could not show them.
    Where nothing of that is open, another scan of the same kind makes all of it more certain, by
    how much follows from counting the observations twice; ``bent`` mm is what the rig may bend
    shapes by now.
    """
    open_ = tuple(parameter_in_words(name) for name in held)
    known = bool(fit.state.bodies)
    geometry = [n for n in held if n != "scale" and not n.startswith("motion.")]
    if "scale" in held:
        return Advice(open_, "body", "a scan of a ball or another part of which one length was "
                      "measured, given with it: it tells the scale")  # fmt: skip
    if geometry:
        what = "the same body, beside the rotation axis and tilted" if known else (
            "a ball or ball bar of known size, beside the rotation axis"
        )  # fmt: skip
        return Advice(open_, "body", f"a scan of {what}: {len(geometry)} numbers of the rig show "
                      "little in this one")  # fmt: skip
    moved = any(sweep.moved for sweep in sweeps)
    if moved and any(n.startswith(_WAVES) for n in held):
        return Advice(open_, "pose", "a scan of the same part laid down again, given together with "
                      "this one: it tells the table's waves")  # fmt: skip
    if moved and "motion.backlash" in held:
        return Advice(open_, "table", "a scan that turns there and back: it tells the table's play")
    if moved and "motion.start" in held:
        return Advice(open_, "table", "a scan that goes on past a whole turn: what it saw in its "
                      "first steps it sees again, with the play taken up")  # fmt: skip
    if rig.covariance is None or not free[: len(rig.parameter_names)].any():
        return Advice(open_, "", "nothing: laser sheets and axis are held as they were")
    again = shape_doubt(replace(rig, covariance=_twice(rig.covariance, fit, free)), sweeps)
    return Advice(
        open_,
        "again",
        "another scan of this kind, of the part at another place: as many points again would take "
        f"what the rig bends from {bent:.3f} to {again:.3f} mm (rms)",
    )


def _twice(covariance: Floats, fit: Fit[Surfaces], free: Bools) -> Floats:
    """(p, p) the rig's covariance, were all observations there twice; what was known before counts
    once."""
    p = len(covariance)
    before = sum(
        (b.common[:, free].T @ b.common[:, free] for b in fit.blocks if b.kind.startswith("prior")),
        np.zeros((np.count_nonzero(free),) * 2),
    )
    told = np.linalg.inv(fit.covariance[np.ix_(free, free)]) - before
    values, ways = np.linalg.eigh((told + told.T) / 2)
    told = (ways * np.maximum(values, 0.0)) @ ways.T
    part = np.flatnonzero(free[:p])
    out = np.array(covariance)
    out[np.ix_(part, part)] = np.linalg.inv(2 * told + before)[: len(part), : len(part)]
    return out
