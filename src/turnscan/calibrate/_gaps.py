"""How scans and bodies meet in a present state of a rig: gaps, their noise, and one adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._patches import patches_under
from turnscan.calibrate._prior import prior_of
from turnscan.calibrate._surfaces import (
    SurfaceNetwork,
    Surfaces,
    known_together,
    pair_of,
    scale_of,
)
from turnscan.calibrate._sweeps import Sweep
from turnscan.errors import Degenerate, DidNotConverge
from turnscan.rig import Rig

_FEWEST = 100
"""Places where two surfaces meet, below which nothing is said of a rig."""


def network_of(
    rig: Rig,
    state: Surfaces,
    sweeps: tuple[Sweep, ...],
    free: Bools,
    reach: float,
    queries: int,
    coarse: float = 0.0,
) -> SurfaceNetwork:
    """What meets what in the present state; ``coarse`` mm is how little a gap says besides.

    With ``reach`` 0 only bodies count: they need no neighbours.
    """
    names = state.rig.parameter_names
    stages = {n.rpartition(".")[0] for n, f in zip(names, free, strict=False) if f}
    prior = prior_of(rig, state.rig, stages) if stages else None
    network = SurfaceNetwork(
        sweeps, (), state, free, prior, rig.motion, loose_frame=not known_together(rig)
    )
    at = network.places(state)
    noise = network.noise(state)
    pairs = []
    for a in range(len(sweeps)):
        for b in range(len(sweeps)):
            if a == b or reach <= 0:
                continue
            some = np.unique(np.linspace(0, len(at[a]) - 1, queries).astype(np.intp))
            found = patches_under(at[a][some], at[b], noise[b], reach)
            found = replace(found, query=some[found.query])
            if len(found.query) < _FEWEST:
                continue
            pairs.append(pair_of(a, b, found, noise, coarse))
    if not pairs and not state.bodies:
        raise Degenerate(
            "no two surfaces overlap where they are smooth: one laser sees each place once in a "
            "turn, and where a part bends much from step to step no surface is known",
            hint="scan with two lasers, in smaller steps, the part in a second pose, or a body "
            "of known size",
        )
    on_bodies = tuple(
        tuple(
            np.einsum("mi,mi->m", body.distance(where[which])[1], moved[which])
            for where, moved, which in zip(at, noise, body.points, strict=True)
        )
        for body in state.bodies
    )
    scales = tuple(tuple(scale_of(np.abs(own), coarse) for own in one) for one in on_bodies)
    return replace(network, pairs=tuple(pairs), body_noise=on_bodies, body_scale=scales)


def gap_of(network: SurfaceNetwork, state: Surfaces) -> tuple[float, float, int]:
    """rms of the gaps (without the farthest hundredth), rms of their noise, number of places."""
    at = network.places(state)
    gaps = [p.patches.gaps(at[p.asked], at[p.others]) for p in network.pairs]
    sigma = [p.sigma for p in network.pairs]
    for body, scale in zip(state.bodies, network.body_scale, strict=True):
        for i, which in enumerate(body.points):
            gaps.append(body.distance(at[i][which])[0])
            sigma.append(scale[i].sigma)
    all_gaps, all_sigma = np.abs(np.concatenate(gaps)), np.concatenate(sigma)
    near = all_gaps <= np.quantile(all_gaps, 0.99)
    rms = float(np.sqrt(np.mean(all_gaps[near] ** 2)))
    return rms, float(np.sqrt(np.mean(all_sigma[near] ** 2))), len(all_gaps)


def adjusted(
    network: SurfaceNetwork,
    state: Surfaces,
    free: Bools,
    near: Fit[Surfaces] | None,
    told: bool,
) -> Fit[Surfaces]:
    """`adjust`, in words about surfaces where they come to no rest."""
    try:
        return adjust(network, state, free, near=None if told else near, told=told)
    except (DidNotConverge, np.linalg.LinAlgError):
        raise DidNotConverge(
            "the surfaces come to no rest against each other",
            hint="begin with a rig nearer to the truth (measure again with a ruler), or with one "
            "whose uncertainties say how far it may be off",
        ) from None
