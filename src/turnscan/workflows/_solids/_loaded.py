"""A surface to measure, and what is known about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from turnscan.arrays import Floats
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.shapes import Source, common_moves


@dataclass(frozen=True, eq=False)
class Loaded:
    """A surface and what is known about it."""

    mesh: Mesh
    name: str
    """How messages call it."""
    about: Mapping[str, object] = field(default_factory=dict)
    """Where it comes from, with the volume as it was known there."""
    reconstructed: bool = False
    """Whether it was made from a scan, not read from a mesh file."""
    findings: tuple[Finding, ...] = ()
    """Of the reconstruction, where it was one."""
    source: Source | None = None
    """Grids, rig and common causes, where they are known."""

    @cached_property
    def moves(self) -> Sequence[Floats]:
        """(v, 3) mm each: how the vertices move, all at once, with one standard deviation of each
        common cause, the calibration's among them; none where the source is not known."""
        return [] if self.source is None else common_moves(self.mesh, self.source)

    def with_mesh(self, mesh: Mesh) -> Loaded:
        """The same with fewer vertices, each of which moves as the nearest of these does."""
        from scipy.spatial import cKDTree

        source = self.source
        if source is not None and source.moves:
            near = cKDTree(self.mesh.vertices).query(mesh.vertices)[1]
            source = replace(source, moves=[m[near] for m in source.moves])
        return replace(self, mesh=mesh, source=source)
