"""Uncertainty of a rig from surfaces whose gaps share their points' noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import HUBER, Fit
from turnscan.calibrate._normal import Block, free_name, inverse_of, weight
from turnscan.calibrate._surfaces import SurfaceNetwork, Surfaces, body_kind


def with_shared_noise(network: SurfaceNetwork, fit: Fit[Surfaces], free: Bools) -> Fit[Surfaces]:
    """The fit with a covariance for which every point's noise counts once.

    A point stands above a patch of the other surface, and is one of 24 of the patches under many
    points of that one: gaps are not independent, and each meeting of two surfaces is looked at from
    both sides. Each point's noise is followed into the estimate through all gaps that it is part
    of: with N the normal equations, g_p the pull of the noise of point p on them and P what was
    known before, the covariance is N⁻¹ (f² Σ g_p g_pᵀ + P) N⁻¹ (Liang & Zeger, 1986), f being how
    much more the steps scatter than their points' noise would make them (`Fit.view_factor`).
    """
    p = int(np.count_nonzero(free))
    normal, before = np.zeros((p, p)), np.zeros((p, p))
    rows: dict[str, list[Block]] = {}
    for b in fit.blocks:
        A = b.common.compress(free, axis=1)
        if b.kind.startswith("prior"):
            before += A.T @ A
        else:
            rows.setdefault(b.kind, []).append(b)
            normal += (A * weight(b, fit.scales, HUBER)[:, None]).T @ A
    pulls = [np.zeros((len(s.pixels), p)) for s in network.sweeps]
    for pair in network.pairs:
        pull = _pulls(fit, rows[pair.kind], free) / pair.sigma[:, None]
        _add(pulls[pair.asked], pair.patches.query, pull * pair.by_own[:, None])
        for near, by in zip(pair.patches.near.T, pair.by_others.T, strict=True):
            _add(pulls[pair.others], near, pull * by[:, None])
    for k, body in enumerate(fit.state.bodies):
        mine, at = _pulls(fit, rows[body_kind(k)], free), 0
        for i, which in enumerate(body.points):
            by = network.body_noise[k][i] / network.body_scale[k][i].sigma
            _add(pulls[i], which, mine[at : at + len(which)] * by[:, None])
            at += len(which)
    shared = sum((g.T @ g for g in pulls), np.zeros((p, p)))
    back = inverse_of(normal + before, free_name(network, free))
    covariance = np.zeros_like(fit.covariance)
    own_noise = back @ (fit.view_factor**2 * shared + before) @ back
    covariance[np.ix_(free, free)] = (own_noise + own_noise.T) / 2
    return replace(fit, covariance=covariance)


def _add(sums: Floats, place: npt.NDArray[np.intp], what: Floats) -> None:
    """Add rows (m, p) to the rows of ``sums`` (n, p) that stand at ``place`` (m,), some of which
    come more than once."""
    from scipy.sparse import csr_array

    m = len(place)
    rows = csr_array((np.ones(m), place, np.arange(m + 1)), shape=(m, len(sums)))
    sums += np.asarray(rows.T @ what)


def _pulls(fit: Fit[Surfaces], blocks: list[Block], free: Bools) -> Floats:
    """(m, p): what one nominal standard deviation of a residual, as large as such residuals are,
    adds to the right side of the equations."""
    return np.concatenate(
        [
            b.common[:, free] * (weight(b, fit.scales, HUBER) * fit.scales[b.kind])[:, None]
            for b in blocks
        ]
    )
