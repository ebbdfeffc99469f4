"""Faces for all of a mesh: where a chart makes no sound face it is cut finer, last into facets."""

from __future__ import annotations

from turnscan.drawings import Shell, shell_of
from turnscan.mesh import Mesh
from turnscan.shapes.patches import Charting, Charts, borders_of
from turnscan.shapes.primitives import ShapeSet

_ROUNDS = 40
_MOST = 30_000
_SHARE = 0.5
"""Of the faces of a mesh, and in all: with more facets it is a mesh and no drawing. A facet takes
some 2 KB in a file."""


def shell_under(mesh: Mesh, found: ShapeSet) -> tuple[Shell, Charts]:
    """Faces on the charts of a mesh, sewn by the edges that they share.

    Where a face is off its edges or has faults, here or read back, its edges follow the mesh. Where
    that does not help, its chart is cut finer. What is then too small becomes facets, so that the
    shell still closes; unless these were most of the mesh.
    """
    cutting = Charting(mesh, found)
    charts = cutting.charts()
    along_mesh = frozenset[int]()
    most = min(_MOST, int(_SHARE * len(mesh.faces)))
    for _ in range(_ROUNDS):
        used = charts
        shell = shell_of(used, borders_of(mesh, used, along_mesh))
        bad = shell.bad - used.facets
        bare = frozenset(used.label.tolist()) - {*shell.charts} - shell.bad - used.facets
        if not bad and not bare:
            bad = shell.faults() - used.facets
        worse = (bad & along_mesh) | bare
        if not bad and not worse:
            break
        along_mesh |= bad
        if worse:
            charts = cutting.finer(used, worse)
        if len(charts.facets) > most:
            break
    return shell, used
