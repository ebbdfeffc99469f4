"""Faces for all of a mesh: where a chart makes no sound face it is cut finer, last into facets."""

from __future__ import annotations

from collections.abc import Sequence

from turnscan.drawings import Shell, ShellMaker
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.shapes.patches import Bordering, Charting, Charts
from turnscan.shapes.primitives import ShapeSet
from turnscan.shapes.swept import Swept

_ROUNDS = 40
_MOST = 30_000
_CUT, _TRACED, _LESS = 0.1, 0.6, 0.8
"""Shares of the work that are done when charts are cut, and when edges are traced; each round of
those takes some part of what is left."""
_SHARE = 0.5
"""Of the faces of a mesh, and in all: with more facets it is a mesh and no drawing. A facet takes
some 2 KB in a file."""


def shell_under(
    mesh: Mesh, found: ShapeSet, swept: Sequence[Swept], progress: Progress = no_progress
) -> tuple[Shell, Charts]:
    """Faces on the charts of a mesh, sewn by the edges that they share: of its shapes, its swept
    pieces, and B-splines.

    Where a face is off its edges or has faults, here or read back, its edges follow the mesh. Where
    that does not help, its chart is cut finer. What is then too small becomes facets, so that the
    shell still closes; unless these were most of the mesh.
    """
    progress(0.0, "laying surfaces under the part")
    cutting = Charting(mesh, found, swept)
    tracing, maker = Bordering(mesh), ShellMaker()
    charts, along_mesh = cutting.charts(), frozenset[int]()
    most = min(_MOST, int(_SHARE * len(mesh.faces)))
    for turn in range(_ROUNDS):
        progress(_CUT + (_TRACED - _CUT) * (1 - _LESS**turn), "tracing the edges of faces")
        used, borders = charts, tracing.borders(charts, along_mesh)
        told = frozenset(used.label.tolist()) - used.facets
        bare = frozenset(k for k in told if used.patches[k] is None)
        bad = maker.bad(used, borders) - used.facets
        if not bad and not bare:
            progress(_TRACED, "making the faces and reading them back")
            shell = maker.shell(used, borders)
            bad = (shell.bad or shell.faults()) - used.facets
        worse = (bad & along_mesh) | bare
        if not bad and not worse:
            return shell, used
        along_mesh |= bad
        if worse:
            worse = cutting.first_of(used, worse)
            places = {k: maker.wrong_places(used, borders, k) for k in worse - bare}
            charts = cutting.finer(used, worse, places)
        if len(charts.facets) > most:
            break
    return maker.shell(used, borders), used
