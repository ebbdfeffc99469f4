"""Which borders of a surface are there because somebody deleted what was beyond them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.edit._apply import Done
from turnscan.edit._body import Alive, Append, Body, Compact, Replace, Truncate
from turnscan.edit._edits import Cut, Delete, Despike, RemovePieces
from turnscan.mesh import boundary_loops

AWAY = (Delete, Despike, Cut, RemovePieces)
"""Edits that remove faces."""


def cut_by_hand(body: Body, steps: Sequence[Done]) -> Floats:
    """(k, 3) mm: the vertices of a surface that lost faces by hand, or came into being by a cut.

    ``steps`` are the edits that led to the body, in their order. Where one gives all vertices new
    numbers, as thinning out does, a vertex of a border counts as the nearest of a border before.
    """
    old = np.zeros(0, dtype=np.bool_)
    lost, fresh = list[Ints](), list[slice]()
    for step in steps:
        what = step.entry.edit
        for patch, inverse in zip(step.forward, reversed(step.back), strict=True):
            match patch, inverse:
                case Replace(), Replace():
                    old = _carried(
                        inverse.body, _marked(inverse.body, old, lost, fresh), patch.body
                    )
                    lost, fresh = [], []
                case Alive(), _ if isinstance(what, AWAY) and not patch.value:
                    lost.append(patch.faces)
                case Append(), Truncate() if isinstance(what, Cut):
                    fresh.append(slice(inverse.vertices, inverse.vertices + len(patch.vertices)))
    marked = _marked(body, old, lost, fresh)
    if marked.any():
        used = np.zeros(len(marked), dtype=np.bool_)
        used[body.mesh.faces[body.alive]] = True
        marked &= used
    return body.mesh.vertices[marked]


def _marked(body: Body, old: Bools, lost: Sequence[Ints], fresh: Sequence[slice]) -> Bools:
    """(v,) the vertices known before (``old``), those of lost faces, and those that were added."""
    out = np.zeros(len(body.mesh.vertices), dtype=np.bool_)
    out[: len(old)] = old
    for faces in lost:
        out[body.mesh.faces[faces]] = True
    for added in fresh:
        out[added] = True
    return out


def _carried(before: Body, marked: Bools, after: Body) -> Bools:
    """(v,) which vertices of another body stand where marked ones (w,) stood on a border."""
    out = np.zeros(len(after.mesh.vertices), dtype=np.bool_)
    if not marked.any():
        return out
    from scipy.spatial import cKDTree

    a, b = Compact.of(before), Compact.of(after)
    old, new = (
        np.concatenate([np.zeros(0, np.int32), *boundary_loops(one.mesh)]) for one in (a, b)
    )
    if len(old) and len(new):
        _, nearest = cKDTree(a.mesh.vertices[old]).query(b.mesh.vertices[new])
        out[b.vertex_ids[new]] = marked[a.vertex_ids[old[nearest]]]
    return out
