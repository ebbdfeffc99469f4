"""The shapes found in an open scan, for showing them on the surface as it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan import edit
from turnscan.arrays import Floats, Ints
from turnscan.workflows._inspection._dimension_report import dimension_table
from turnscan.workflows._inspection._shapes import FoundShapes, relation_in_words, shape_in_words
from turnscan.workflows._surface._report import ReportTable

_SAME = 0.05
"""mm within which a vertex of the surface is one of the surface that shapes were found on."""


@dataclass(frozen=True, eq=False)
class ShownShapes:
    """Shapes of an open scan."""

    label: Ints
    """(v,) of each vertex of the body the index of its shape; -1 for freeform, for what was not
    measured, and for vertices that a decimation took away."""
    places: Floats
    """(n, 3) mm: the middle of each shape."""
    sizes: Floats
    """(n,) mm: how far each shape reaches."""
    found: FoundShapes

    @property
    def words(self) -> list[str]:
        """Each shape with its sizes and their uncertainties."""
        return [shape_in_words(s) for s in self.found.found.shapes]

    @property
    def relations(self) -> list[str]:
        """The relations that were adopted."""
        return [relation_in_words(r) for r in self.found.found.relations]

    @property
    def dimensions(self) -> ReportTable:
        """Every size with its uncertainty."""
        return dimension_table(self.found.dimensions)


def shown_shapes(body: edit.Body, found: FoundShapes) -> ShownShapes:
    """Put the shapes on the vertices of a body."""
    from scipy.spatial import cKDTree

    mesh, own = found.mesh, found.found.label
    away, which = cKDTree(mesh.vertices).query(body.mesh.vertices, distance_upper_bound=_SAME)
    near = np.isfinite(away)
    label = np.full(len(near), -1, dtype=np.int32)
    label[near] = own[np.asarray(which)[near]]
    parts = [mesh.vertices[own == k] for k in range(len(found.found.shapes))]
    return ShownShapes(
        label,
        np.array([p.mean(axis=0) for p in parts]).reshape(-1, 3),
        np.array([float(np.linalg.norm(np.ptp(p, axis=0))) for p in parts]),
        found,
    )
