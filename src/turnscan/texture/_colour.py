"""Colours of a mesh's vertices, blended from the pictures that show them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.findings import Finding
from turnscan.mesh import Mesh, measured_vertices
from turnscan.remedy import Option, Remedy
from turnscan.texture._levels import Levels, levels_of, no_levels, normals_seen
from turnscan.texture._picture import TexturePicture
from turnscan.texture._views import Views, best_views

NEUTRAL = (153, 153, 153)
"""Red, green, blue of a vertex that no picture shows."""
_BLOCK = 1 << 16
"""Vertices that are blended together."""
_NOISE = 0.02
"""Share of the grey scale by which views of one colour may differ in any case."""
_DIM = 0.1
"""Share of the grey scale below which a picture's parts are called dark."""
_MUCH = 0.05
"""Share of vertices without colour that is worth a warning."""


@dataclass(frozen=True, eq=False)
class Colours:
    """The colours of a mesh, and where they come from."""

    colour: npt.NDArray[np.uint8]
    """(v, 3) red, green, blue; `NEUTRAL` where unknown."""
    seen: Bools
    """(v,) True for a measured vertex that a picture shows."""
    blended: Bools
    """(v,) True for a vertex that has the colour of the surface around it: an added one, and one
    that is seen only where an edge mixes it with what lies beside it."""
    gains: Floats
    """(p, 3) how much brighter than the others each picture is, factor per channel."""


def colours_of(
    mesh: Mesh, pictures: Iterable[TexturePicture], channels: int = 3, level: bool = True
) -> Colours:
    """Colour each vertex from the pictures that show it.

    Visible is what faces the camera and lies behind nothing of the mesh (z-buffer). Each vertex
    keeps its best views: square to the camera, off the edges of what stands before something else,
    not overexposed. Exposure of the pictures and the room's light are levelled (``level``) over
    vertices that several show; the views are blended, outliers such as highlights have no say.
    Added vertices, and those seen only at an edge, take the colour of the surface around them.
    ``pictures`` are taken one by one; ``channels`` is 1 where all of them are grey.
    """
    views = best_views(mesh, pictures, channels)
    colour = np.full((len(mesh.vertices), 3), NEUTRAL, np.uint8)
    if not len(views.rotations):
        none = np.zeros(len(colour), np.bool_)
        return Colours(colour, none, none, np.ones((0, 3)))
    levels = levels_of(views) if level else no_levels(views)
    share = _blended(views, levels)
    own = measured_vertices(mesh)
    seen = own & (views.weight.max(axis=1, initial=0.0) > 0)
    blended = _spread(mesh, share, seen, ~own | (views.glimpsed & ~seen))
    known = seen | blended
    colour[known] = np.rint(255.0 * np.clip(share[known], 0.0, 1.0)).astype(np.uint8)
    gains = np.broadcast_to(np.exp(levels.gain), (len(levels.gain), 3))
    return Colours(colour, seen, blended, gains)


def texture_findings(mesh: Mesh, found: Colours) -> list[Finding]:
    """What there is to know: how many vertices have a colour, and whether the pictures are dark."""
    own = measured_vertices(mesh)
    unseen = float(1.0 - (found.seen | found.blended)[own].mean()) if own.any() else 0.0
    levelled = 100.0 * (float(found.gains.max()) / float(found.gains.min()) - 1.0)
    text = f"colour from {len(found.gains)} pictures, whose exposures differed by {levelled:.0f} %"
    findings = [Finding("texture.colour", "note", text)]
    if unseen > 0.0:
        findings.append(
            Finding(
                "texture.unseen",
                "warning" if unseen > _MUCH else "note",
                f"{100 * unseen:.1f} % of the measured vertices are in no texture picture; "
                "they are grey",
                remedy=Remedy("take more of them: ", Option("texture_every", "1")),
            )
        )
    # A red part is dark in green and blue, and well lit all the same.
    if found.seen.any() and float(np.median(found.colour[found.seen].max(axis=1))) < 255.0 * _DIM:
        findings.append(
            Finding(
                "texture.dark",
                "warning",
                f"the texture pictures are dark: half of the surface is below {100 * _DIM:.0f} % "
                "of the grey scale",
                remedy=Remedy("take them with a lamp, or a longer ", Option("texture")),
            )
        )
    return findings


def _blended(views: Views, levels: Levels) -> Floats:
    """(v, channels) share of the grey scale: robust mean of the levelled views."""
    out = np.zeros((len(views.weight), views.colour.shape[2]))
    for start in range(0, len(out), _BLOCK):
        some = slice(start, start + _BLOCK)
        weight, picture = views.weight[some], views.picture[some]
        value = views.colour[some] * np.exp(-levels.at(picture, normals_seen(views, some)))
        total = np.maximum(weight.sum(axis=1), 1e-12)[:, None]
        # From the weighted median of each channel; then what lies far from it counts for less.
        order = np.argsort(value, axis=1)
        heap = np.cumsum(np.take_along_axis(weight[..., None], order, axis=1), axis=1)
        middle = np.argmax(heap >= 0.5 * total[:, None], axis=1)[:, None]
        mean = np.take_along_axis(np.take_along_axis(value, order, axis=1), middle, axis=1)[:, 0]
        for _ in range(2):
            off = np.abs(value - mean[:, None]).max(axis=2)
            spread = np.maximum((weight * off).sum(axis=1) / total[:, 0], _NOISE)
            trust = weight / (1.0 + (off / spread[:, None]) ** 2) ** 2
            mean = np.einsum("nk,nkc->nc", trust, value)
            mean /= np.maximum(trust.sum(axis=1), 1e-12)[:, None]
        out[some] = mean
    return out


def _spread(mesh: Mesh, share: Floats, seen: Bools, added: Bools) -> Bools:
    """Colour ``added`` vertices as membrane between those seen around them (Laplace), in place.

    Returns (v,) True for those that hang together with a coloured one.
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import spsolve

    reached = np.zeros(len(added), np.bool_)
    if not added.any() or not seen.any():
        return reached
    a, b = np.concatenate([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]).T
    between = (added[a] & (added[b] | seen[b])) | (added[b] & seen[a])
    a, b = a[between], b[between]
    shape = (len(added), len(added))
    links = sparse.coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape).tocsr()
    # Coloured vertices do not link: a piece is a run of added ones and the border that it touches.
    inner = np.flatnonzero(added)
    count, piece = connected_components(links[inner][:, inner], directed=False)
    outer = links[inner][:, np.flatnonzero(seen)]
    touching = np.zeros(count, np.bool_)
    touching[piece[np.asarray(outer.sum(axis=1)).ravel() > 0]] = True
    some = inner[touching[piece]]
    if not len(some):
        return reached
    rows = links[some]
    matrix = sparse.csc_array(
        sparse.diags_array(np.asarray(rows.sum(axis=1)).ravel()) - rows[:, some]
    )
    known = rows[:, np.flatnonzero(seen)] @ share[seen]
    solved: Floats = np.asarray(spsolve(matrix, known))
    share[some] = solved.reshape(len(some), -1)
    reached[some] = True
    return reached
