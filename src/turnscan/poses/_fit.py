"""Does a view belong where it was put? Its surface and the space before it answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Ints
from turnscan.poses._free_space import Empty
from turnscan.poses._links import link
from turnscan.poses._view import View
from turnscan.rig import Pose

TIGHT = 1 / 16
"""Sample spacings within which two measurements of one surface lie, or …"""
_NOISE = 4.0
"""… this many sigma."""
AGREE = 0.85
"""Part of the overlap that is so tight where a view belongs; elsewhere it is below a half."""
LEAST = 0.1
"""Part of a view that must lie on the others: a smaller one can agree by chance."""
THROUGH = 0.03
"""Part of it that may lie in space that another one saw to be empty; none does where it belongs."""
_AGAINST = 5.0
"""What speaks against a place outweighs as much that speaks for it by this factor."""


@dataclass(frozen=True)
class Fit:
    """How well a view lies on others."""

    shared: float
    """Part of the view that has a neighbour in another one."""
    agree: float
    """Part of that which lies as close as noise allows."""
    through: float
    """Part of a view that stands in space another one saw to be empty, the worst of all pairs."""

    @property
    def score(self) -> float:
        """What speaks for the place less what speaks against it, to tell places apart."""
        return self.shared - _AGAINST * (self.through + self.shared * (1.0 - self.agree))

    @property
    def good(self) -> bool:
        """True where nothing speaks against the place."""
        return self.shared >= LEAST and self.agree >= AGREE and self.through <= THROUGH


def fit(
    views: Sequence[View],
    poses: Sequence[Pose],
    spaces: Sequence[Empty],
    samples: Sequence[Ints],
    i: int,
    others: Sequence[int],
    step: float,
) -> Fit:
    """How view i lies on the ``others``, judged by samples ``step`` mm apart."""
    own = poses[i].apply(views[i].points[samples[i]])
    through, best = 0.0, np.full(len(own), np.inf)
    for j in others:
        back, there = poses[j].inverse(), poses[j].apply(views[j].points[samples[j]])
        through = max(through, float(spaces[j].holds(back.apply(own)).mean()))
        inside = spaces[i].holds(poses[i].inverse().apply(there))
        through = max(through, float(inside.mean()))
        k, at = link(views, poses, i, j, samples[i], step)
        tight = np.maximum(_NOISE * k.sigma, TIGHT * step)
        np.minimum.at(best, at, np.abs(k.offsets) / tight)
    met = np.isfinite(best)
    return Fit(float(met.mean()), float((best[met] <= 1).mean()) if met.any() else 0.0, through)
