"""Fill what can be filled: a hole whose patch would cut through the surface stays open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.findings import Finding
from turnscan.surface._fill import FillHow, Patch, patches, with_patches
from turnscan.surface._mesh import Mesh
from turnscan.surface._soundness import crossings

_CUT = 0.25
"""Of a patch's faces at most this share may cut through others: `mend` can see to some, but where
it had to make most of a patch anew, there would be nothing to go by."""
_FEW = 20
"""Faces are few up to this number, whatever their share: `mend` makes such a place anew."""


def fill_soundly(mesh: Mesh, loops: Sequence[Ints], how: FillHow) -> tuple[Mesh, list[Ints]]:
    """The mesh with those of the borders filled that can be, and the borders that stay open.

    A border that runs round many tongues, as where light grazes the surface, or round a corner of
    the part, has no surface that continues it: its patch cuts through the part.
    """
    made = patches(mesh, loops, how)
    done = with_patches(mesh, made, how)
    bad = _useless(mesh, done, made)
    if not bad.any():
        return done, []
    good = [patch for patch, b in zip(made, bad, strict=True) if not b]
    return with_patches(mesh, good, how), [k for k, b in zip(loops, bad, strict=True) if b]


def _useless(mesh: Mesh, done: Mesh, made: Sequence[Patch]) -> Bools:
    """(n,) True for the patches of a filled mesh that cut through it."""
    start, sizes = len(mesh.faces), np.array([len(p.faces) for p in made], dtype=np.int64)
    owner = np.repeat(np.arange(len(made)), sizes)
    pairs = crossings(done, np.arange(len(done.faces)) >= start)
    cut = np.bincount(owner[np.unique(pairs[pairs >= start]) - start], minlength=len(made))
    return np.asarray((cut > _FEW) & (cut > _CUT * sizes))


def unfilled(borders: Sequence[Floats], how: FillHow) -> Finding:
    """What `fill_soundly` left open: borders (m, 3) mm."""
    x, y, z = borders[0].mean(axis=0)
    size = max(float(np.linalg.norm(np.ptp(b, axis=0))) for b in borders)
    text = (
        f"{len(borders)} gap(s) up to {size:.1f} mm wide stay open: filled ({how}), the surface "
        "would cut through itself there"
    )
    where = f"({x:.2f}, {y:.2f}, {z:.2f}) mm"
    more = "" if len(borders) == 1 else f", the first of {len(borders)}"
    hint = "scan the part in another pose or with a second laser, or bridge the gap by hand"
    return Finding("surface.unfilled", "warning", text, where + more, hint)
