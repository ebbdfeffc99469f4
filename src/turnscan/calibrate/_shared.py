"""Uncertainty of a rig from surfaces whose gaps share their points' noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
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
        A = b.common[:, free]
        if b.kind.startswith("prior"):
            before += A.T @ A
        else:
            rows.setdefault(b.kind, []).append(b)
            normal += (A * weight(b, fit.scales, HUBER)[:, None]).T @ A
    pulls = [np.zeros((len(s.pixels), p)) for s in network.sweeps]
    for pair in network.pairs:
        order = _order(network.sweeps[pair.asked].step[pair.patches.query])
        pull = _pulls(fit, rows[pair.kind], free) / pair.sigma[order, None]
        np.add.at(pulls[pair.asked], pair.patches.query[order], pull * pair.by_own[order, None])
        for k in range(pair.by_others.shape[1]):
            theirs = pull * pair.by_others[order, k, None]
            np.add.at(pulls[pair.others], pair.patches.near[order, k], theirs)
    for k, body in enumerate(fit.state.bodies):
        mine, at = _pulls(fit, rows[body_kind(k)], free), 0
        for i, which in enumerate(body.points):
            order = _order(network.sweeps[i].step[which])
            own = mine[at : at + len(which)]
            at += len(which)
            by = network.body_noise[k][i][order] / network.body_scale[k][i].sigma[order]
            np.add.at(pulls[i], which[order], own * by[:, None])
    shared = sum((g.T @ g for g in pulls), np.zeros((p, p)))
    back = inverse_of(normal + before, free_name(network, free))
    covariance = np.zeros_like(fit.covariance)
    own_noise = back @ (fit.view_factor**2 * shared + before) @ back
    covariance[np.ix_(free, free)] = (own_noise + own_noise.T) / 2
    return replace(fit, covariance=covariance)


def _order(step: Ints) -> Ints:
    """The order in which the rows of a kind stand in its blocks."""
    return np.argsort(step, kind="stable").astype(np.int32)


def _pulls(fit: Fit[Surfaces], blocks: list[Block], free: Bools) -> Floats:
    """(m, p): what one nominal standard deviation of a residual, as large as such residuals are,
    adds to the right side of the equations."""
    return np.concatenate(
        [
            b.common[:, free] * (weight(b, fit.scales, HUBER) * fit.scales[b.kind])[:, None]
            for b in blocks
        ]
    )
