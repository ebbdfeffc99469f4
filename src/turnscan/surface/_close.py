"""Caps: a mesh with gaps → a closed one, with every face that nobody measured marked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._paste import measured
from turnscan.surface._topology import boundary_loops, split_touching


@dataclass(frozen=True)
class Caps:
    """How the gaps of a mesh are closed."""

    floor: float | None = 0.0
    """mm: height of the plane the part stands on; None when it stands on nothing."""
    reach: float = 5.0
    """A gap counts as the part's foot when at least half its border lies less than this many mm
    above the floor."""
    longest: int | None = None
    """Gaps with more sides than this stay open; None closes all."""


def close(mesh: Mesh, caps: Caps | None = None) -> tuple[Mesh, int]:
    """Close the gaps of a mesh; faces added are not ``measured``. Also gives how many gaps.

    The part's foot is carried straight down to the floor and closed there with a plane; every
    other gap is closed by triangles between its own corners, cut as ears in its best plane. That
    is right for small holes and flat tops, and an invention where a large part was never seen.
    Added vertices have provenance −1. Colour is dropped.
    """
    from turnscan.surface import _loop_kernels as kernels

    c = caps or Caps()
    whole = replace(split_touching(mesh), colour=None)
    vertices, faces = [whole.vertices], [whole.faces]
    count, gaps = len(whole.vertices), 0
    sides = _sides(whole.faces, count)
    for loop in boundary_loops(whole):
        if len(loop) < 3 or (c.longest is not None and len(loop) > c.longest):
            continue
        gaps += 1
        ring = loop
        corners = whole.vertices[loop]
        if c.floor is not None and _is_foot(corners, c.floor, c.reach):
            ring = np.arange(count, count + len(loop), dtype=np.int32)
            corners = np.column_stack([corners[:, :2], np.full(len(loop), c.floor)])
            vertices.append(corners)
            faces.append(_skirt(loop, ring))
            count += len(loop)
        # The gap lies on the other side of its border: the cap runs against the faces' winding.
        order = ring[::-1].astype(np.int64)
        faces.append(kernels.clip_ears(_flat(corners[::-1]), order, sides, len(whole.vertices)))
    added = sum(len(f) for f in faces[1:])
    return replace(
        whole,
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces),
        provenance=_extended(whole.provenance, count - len(whole.vertices)),
        measured=np.concatenate([measured(whole), np.zeros(added, dtype=np.bool_)]),
    ), gaps


def _sides(faces: Ints, size: int) -> npt.NDArray[np.int64]:
    """Sorted keys a·size + b, a < b, of all sides."""
    a = faces[:, [0, 1, 2]].ravel().astype(np.int64)
    b = faces[:, [1, 2, 0]].ravel().astype(np.int64)
    return np.unique(np.minimum(a, b) * size + np.maximum(a, b))


def _is_foot(corners: Floats, floor: float, reach: float) -> bool:
    low: Bools = np.abs(corners[:, 2] - floor) <= reach
    return bool(low.mean() >= 0.5)


def _skirt(loop: Ints, ring: Ints) -> Ints:
    """The wall between a border (m,) and its image (m,) on the floor, (2m, 3)."""
    after, below = np.roll(loop, -1), np.roll(ring, -1)
    upper = np.stack([after, loop, ring], axis=-1)
    lower = np.stack([after, ring, below], axis=-1)
    return np.concatenate([upper, lower]).astype(np.int32)


def _flat(loop: Floats) -> Floats:
    """A loop (m, 3) in the plane it encloses most area in (Newell's normal), (m, 2)."""
    centred = loop - loop.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    size = float(np.linalg.norm(normal))
    normal = normal / size if size > 0 else np.array([0.0, 0.0, 1.0])
    lead = np.eye(3)[int(np.argmin(np.abs(normal)))]
    e1 = np.cross(normal, lead)
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(normal, e1)
    return np.stack([centred @ e1, centred @ e2], axis=-1)


def _extended(p: Provenance | None, more: int) -> Provenance | None:
    if p is None:
        return None
    none = np.full(more, -1, dtype=np.int32)
    return Provenance(
        np.concatenate([p.sigma, np.full(more, np.nan)]),
        np.concatenate([p.laser, none]),
        np.concatenate([p.step, none]),
        np.concatenate([p.line, none]),
        p.lasers,
    )
