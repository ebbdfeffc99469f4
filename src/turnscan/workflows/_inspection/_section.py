"""Sections of a part as drawings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Cut
from turnscan.workflows._solids._sections import Sections, cuts_of, sections_of
from turnscan.workflows._surface._loading import Source, load


def section(
    source: Source,
    cuts: Sequence[Cut | str],
    tolerance: float | None = None,
    progress: Progress = no_progress,
) -> Sections:
    """Cut a surface, and fit lines, arcs and splines to each section.

    Parameters
    ----------
    source
        A mesh, a mesh file in mm, the result of `reconstruct`, or a scan, which is reconstructed
        with its own settings.
    cuts
        Planes as texts: ``z=20``, ``z=10:100:10`` (from, to, step) or ``nx,ny,nz,distance``, mm;
        ``silhouette=x`` (or ``-z``, ``nx,ny,nz``): the outline from there; ``unrolled``: the
        radius of the outer surface over angle and height; or cuts of `turnscan.shapes`.
    tolerance
        mm that a misfit may be; None: what the noise of the points allows.
    progress
        Told how far the reconstruction of a scan is; it may cancel.

    Returns
    -------
    Sections
        The sections in the order of the cuts, to be saved as drawings. A cut that misses the part
        is one of their ``findings``, and the others are drawn.

    Raises
    ------
    InputError
        For a mesh without faces, where no cut meets it, a text that is no cut, and a tolerance
        that is not positive; and what `reconstruct` raises.

    >>> import turnscan as ts
    >>> cut = ts.section("cup.turnscan", ["z=20"])
    >>> cut.save("cup.svg")
    >>> len(cut), cut[0].cut.name
    (1, 'z = 20 mm')
    """
    wanted = [c for cut in cuts for c in (cuts_of([cut]) if isinstance(cut, str) else [cut])]
    loaded = load(source, progress=progress)
    if not len(loaded.mesh.faces):
        raise InputError(f"{loaded.name}: no faces", hint="sections are cut through a mesh")
    title = Path(loaded.name).name
    return sections_of(loaded.mesh, wanted, tolerance, title, {"source": title, **loaded.about})
