"""Arrays of a scan as they go to the browser: each with the type that the page expects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from turnscan.app import _protocol as p
from turnscan.app._envelope import Array
from turnscan.workflows import SurfaceFigures, SurfacePatch

_TYPES = {
    "alive": "u1", "amplitude": "<f4", "angles": "<f4", "candidate_amplitude": "<f4",
    "candidate_points": "<f4", "candidates": "<f4", "cause": "u1", "chosen": "i1",
    "colour": "u1", "dead": "<u4", "distance": "<f4", "edited": "u1",
    "faces": "<u4", "flags": "<u2", "ids": "<u4", "laser": "<i4", "line": "<i4",
    "measured": "u1", "off": "u1", "points": "<f4", "position": "<f4", "positions": "<f4",
    "shape": "<i4", "sigma": "<f4", "step": "<i4", "steps": "<i4", "touch": "u1",
}  # fmt: skip
"""Of the arrays by name."""


def encoded(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Arrays in the types of the wire."""
    return {name: array.astype(_TYPES[name]) for name, array in arrays.items()}


def encoded_parts(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """The same of ``PART.NAME``; a name that is a number is of points."""
    last = {name: name.rpartition(".")[2] for name in arrays}
    types = {name: "<f4" if end.isdigit() else _TYPES[end] for name, end in last.items()}
    return {name: array.astype(types[name]) for name, array in arrays.items()}


def patch_parts(patches: Sequence[SurfacePatch]) -> tuple[list[p.Part], dict[str, Array]]:
    """Patches as parts of a message, and their arrays."""
    arrays = {
        f"{k}.{name}": array
        for k, patch in enumerate(patches)
        for name, array in encoded(patch.arrays).items()
    }
    return [_part(patch) for patch in patches], arrays


def _part(patch: SurfacePatch) -> p.Part:
    match patch.kind:
        case "alive":
            return p.Alive(value=patch.value)
        case "verts":
            return p.Verts()
        case "append":
            return p.Append()
        case "truncate":
            return p.Truncate(vertices=patch.vertices, faces=patch.faces)
        case "replace":
            return p.Replace()


def figures(of: SurfaceFigures) -> p.Figures:
    """What the surface is like."""
    return p.Figures(
        vertices=of.vertices,
        faces=of.faces,
        bounds=of.bounds,
        closed=of.closed,
        volume=of.volume,
    )
