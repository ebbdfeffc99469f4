"""How brightly each picture shows the same colour: its exposure, and the light on the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.texture._views import Views

_MOST = 20_000
"""Vertices that levels are found from."""
_DARK, _BRIGHT = 0.04, 0.95
"""Shares of the grey scale between which a value is proportional to the light."""
_PRIOR_GAIN, _PRIOR_LIGHT = 0.5, 3.0
"""Standard deviations of logarithms that decide where the pictures do not."""
_ROUNDS = 5
_LEAST_SPREAD = 0.01
_TERMS = 8


@dataclass(frozen=True, eq=False)
class Levels:
    """Logarithms of how much brighter a picture shows a vertex than all pictures do."""

    gain: Floats
    """(p, channels): of each picture; their mean is about 0."""
    light: Floats
    """(8, channels): of the terms of `light_terms`."""
    usual: Floats
    """(channels,): what these terms come to in the mean, so that the surface stays as bright."""

    def at(self, picture: Ints, normals: Floats) -> Floats:
        """(..., channels) of views by their pictures (...) and normals (..., 3) in the camera."""
        light: Floats = light_terms(normals) @ self.light - self.usual
        return self.gain[np.maximum(picture, 0)] + light


def no_levels(views: Views) -> Levels:
    """All pictures as they are."""
    channels = views.colour.shape[2]
    gain = np.zeros((len(views.rotations), channels))
    return Levels(gain, np.zeros((_TERMS, channels)), np.zeros(channels))


def light_terms(normals: Floats) -> Floats:
    """(..., 8) of unit normals (..., 3) in the camera's frame: terms of first and second order.

    Light from anywhere onto a matt surface varies with the normal as spherical harmonics of up to
    second order do (Ramamoorthi & Hanrahan 2001); their constant is the surface's own colour.
    """
    x, y, z = np.moveaxis(normals, -1, 0)
    return np.stack([x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], axis=-1)


def levels_of(views: Views) -> Levels:
    """Find exposures and light by robust least squares over vertices that several pictures show.

    log colour = log own colour + log gain of the picture + light terms of the normal; own colours
    fall out in the differences of two views of one vertex. What the pictures leave open stays 0.
    """
    from scipy import sparse

    pictures, channels = len(views.rotations), views.colour.shape[2]
    first, second, log, weight, light = _pairs(views)
    if not len(first):
        return no_levels(views)
    rows = np.arange(len(first))
    ends = sparse.coo_array(
        (np.repeat([1.0, -1.0], len(first)), (np.r_[rows, rows], np.r_[first, second])),
        shape=(len(first), pictures),
    )
    design = sparse.hstack([ends, sparse.coo_array(light)], format="csr")
    prior = np.r_[np.full(pictures, _PRIOR_GAIN**-2), np.full(_TERMS, _PRIOR_LIGHT**-2)]
    found, trust = np.zeros((pictures + _TERMS, channels)), np.ones(len(first))
    for _ in range(_ROUNDS):
        residual = np.abs(log - design @ found).max(axis=1)
        spread = max(1.4826 * float(np.median(residual)), _LEAST_SPREAD)
        trust = weight / (1.0 + (residual / (2.0 * spread)) ** 2) / spread**2
        weighted = design.multiply(trust[:, None]).tocsr()
        normal = (design.T @ weighted).toarray() + np.diag(prior)
        found = np.linalg.solve(normal, weighted.T @ log)
    front = _some_of(views.weight.max(axis=1) > 0)
    best = np.argmax(views.weight[front], axis=1)
    seen = normals_seen(views, front)[np.arange(len(front)), best]
    usual = (light_terms(seen) @ found[pictures:]).mean(axis=0)
    return Levels(found[:pictures], found[pictures:], usual)


def _pairs(views: Views) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Pairs (m,) of views of one vertex: their pictures, the difference of their logarithms
    (m, channels), weight, and the difference of their light terms (m, 8).
    """
    fair = (views.weight > 0) & (views.colour > _DARK).all(axis=2)
    fair &= (views.colour < _BRIGHT).all(axis=2)
    some = _some_of(fair.sum(axis=1) > 1)
    fair, weight, picture = fair[some], views.weight[some], views.picture[some]
    log = np.log(np.maximum(views.colour[some], 1e-3))
    terms = light_terms(normals_seen(views, some))
    total = np.maximum((weight * fair).sum(axis=1), 1e-12)
    out: list[list[Floats]] = [[], [], [], [], []]
    for a in range(weight.shape[1]):
        for b in range(a):
            k = np.flatnonzero(fair[:, a] & fair[:, b])
            both = weight[k, a] * weight[k, b] / total[k]
            parts = picture[k, a], picture[k, b], log[k, a] - log[k, b], both
            for column, part in zip(out, (*parts, terms[k, a] - terms[k, b]), strict=True):
                column.append(part)
    first, second, difference, both, light = (np.concatenate(column) for column in out)
    return first, second, difference, both, light


def _some_of(which: Bools) -> npt.NDArray[np.intp]:
    """Up to `_MOST` of those that are True, spread evenly."""
    every = np.flatnonzero(which)
    return every[:: max(1, -(-len(every) // _MOST))]


def normals_seen(views: Views, some: npt.NDArray[np.intp] | slice) -> Floats:
    """(n, k, 3) the normals of some vertices, in the frame of each view's camera."""
    turn = views.rotations[np.maximum(views.picture[some], 0)]
    seen: Floats = np.einsum("nkij,nj->nki", turn, views.normals[some])
    return seen
