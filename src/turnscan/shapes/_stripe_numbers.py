"""Which stripes of a turn measured the vertices of a mesh, and how many lie between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Stripes:
    """The stripes of a mesh, those of each laser in the order of the turn."""

    number: Longs
    """(v,) of each vertex; −1 where it is not known."""
    first: Longs
    """(l + 1,) the number of the first stripe of each laser, and how many there are."""

    def spanned(self, vertices: Longs) -> int:
        """How many stripes of one laser lie from the first to the last of ``vertices`` (k,).

        Decimation leaves two of a face that many stripes measured; from one step to the next there
        are never more. A turn goes on at its begin: the shorter way counts.
        """
        numbers = np.unique(self.number[vertices])
        most = 0
        for first, end in zip(self.first[:-1], self.first[1:], strict=True):
            own = numbers[(numbers >= first) & (numbers < end)]
            if len(own):
                gaps = np.diff(np.r_[own, own[0] + end - first])
                most = max(most, int(end - first - gaps.max()) + 1)
        return most


def stripes_of(mesh: Mesh) -> Stripes | None:
    """The stripes of the vertices of a mesh; None where it does not know them."""
    p = mesh.provenance
    if p is None:
        return None
    known = (p.laser >= 0) & (p.step >= 0)
    if not known.any():
        return None
    number, first = np.full(len(known), -1, dtype=np.int64), [0]
    for laser in np.unique(p.laser[known]):
        own = known & (p.laser == laser)
        steps = p.step[own].astype(np.int64) - int(p.step[own].min())
        # Decimation may leave none of a stripe: the widest spacing in which all lie is the steps'.
        number[own] = first[-1] + steps // max(int(np.gcd.reduce(steps)), 1)
        first.append(int(number[own].max()) + 1)
    return Stripes(number, np.array(first, dtype=np.int64))


def doubt_along(stripe: Longs, residual: Floats, sigma: Floats, usual: float) -> Floats:
    """(n,) mm: by how much an edge may have moved each point together with its ``stripe`` (n,).

    Where points are known worse than ``usual`` (mm), and scatter less along their stripe than that,
    an edge may have bent the stripe: this moves its points alike, however many they are.
    """
    count = np.maximum(np.bincount(stripe), 1)
    mean = np.bincount(stripe, residual) / count
    scatter = np.bincount(stripe, (residual - mean[stripe]) ** 2) / count
    noise = np.maximum(scatter, usual**2)[stripe]
    return np.asarray(np.sqrt(np.maximum(sigma**2 - noise, 0.0)))
