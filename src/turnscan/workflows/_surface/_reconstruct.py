"""Reconstruct: a scan file, or placed range scans → surface, points and what is known of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from turnscan.detection import Known, detect_scan, look_in_block
from turnscan.edit import Entry
from turnscan.findings import Finding
from turnscan.pipeline import build
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.stripes import Detector
from turnscan.workflows._compile_ahead import compiling_ahead
from turnscan.workflows._files._history import repairs, wanted_history
from turnscan.workflows._files._kept_options import (
    DEFAULT_SET,
    check_name,
    kept_options,
    store_options,
)
from turnscan.workflows._importing._range_scans import join_scans, placed_scans
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._surface._report import about
from turnscan.workflows._surface._result import ReconstructResult
from turnscan.workflows._surface._texture import TextureSource, coloured

_DETECTION, _SURFACE = 0.6, 0.9
"""Of the work, until all stripes are found, and until there is a surface."""


def reconstruct(
    source: Scan | str | PathLike[str],
    options: ReconstructOptions | None = None,
    *,
    rig: Rig | None = None,
    edits: str | Sequence[Entry] = "own",
    unit: str = "m",
    detector: Detector | None = None,
    store: bool = False,
    settings: str = DEFAULT_SET,
    progress: Progress = no_progress,
    **changes: Any,
) -> ReconstructResult:
    """Turn a scan into a surface.

    Parameters
    ----------
    source
        A scan file (.turnscan) or what made one, an open scan, or the .conf file that places the
        range scans (PLY) of another scanner beside it.
    options
        How points become a surface; None takes the scan's own: what its edits changed of the
        settings, or those it was last reconstructed with, or the usual ones.
    rig
        The rig; None takes the one in the scan file.
    edits
        Repairs to do: ``own`` (those kept in the scan), ``none``, the name of another scan file or
        of a .json file, or entries of a history.
    unit
        Unit of range scans: mm, cm, m or inch; results are always mm.
    detector
        A function that finds the stripe in a picture instead of ``options.strategy``; it is not
        kept in the scan file.
    store
        Keep the options in the scan file, so that every door opens it with them. A file that
        cannot be changed stays as it is, with a note among the findings.
    settings
        Name of the set of settings in the scan file that is opened without ``options``, and in
        which ``store`` keeps them.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``close=True``.

    Returns
    -------
    ReconstructResult
        Mesh, grids, points and findings; an error among the findings says why there is no surface.

    Raises
    ------
    InputError
        Where there is no such file or option, scan and rig do not fit, or no angle is known.
    ScanCorrupt
        Naming the frame that is damaged.

    >>> import turnscan as ts
    >>> part = ts.reconstruct("cup.turnscan", strategy="gauss3", close=True)
    >>> part.failed
    False
    """
    check_name(settings)
    if isinstance(source, Scan):
        wanted, by_hand = _wanted(source, options, settings, edits, changes)
        return _of_scan(source, wanted, rig, by_hand, detector, progress)
    path = Path(source)
    if path.suffix.lower() == ".conf":
        wanted = chosen(ReconstructOptions, options, changes)
        used = wanted.settings()
        done = join_scans(path, placed_scans(path, unit), unit, used, progress)
        return ReconstructResult(done, about(path, None, used), options=wanted)
    with Scan.open(path) as scan:
        wanted, by_hand = _wanted(scan, options, settings, edits, changes)
        result = _of_scan(scan, wanted, rig, by_hand, detector, progress)
    note = store_options(path, result.options, settings) if store and not result.failed else None
    return result if note is None else replace(result, notes=(note,))


@dataclass(frozen=True)
class Order:
    """How a scan file is to be reconstructed, as in `reconstruct`."""

    scan: Path
    options: ReconstructOptions | None
    edits: str
    settings: str

    def block(self, block: int, blocks: int) -> tuple[Known, ...]:
        """What a block of the scan's steps shows of each laser. Raises like `reconstruct`."""
        with Scan.open(self.scan) as scan:
            wanted, _ = _wanted(scan, self.options, self.settings, self.edits, {})
            rig = rig_for(scan)
            used = wanted.settings(rig, scan)
            return look_in_block(scan, rig, used.stripes, used.volume, block, blocks)

    def carried_out(self, known: Sequence[Known] = ()) -> ReconstructResult:
        """The reconstruction; ``known`` of each laser is not searched again. Raises like it."""
        if not known:
            return reconstruct(self.scan, self.options, edits=self.edits, settings=self.settings)
        with Scan.open(self.scan) as scan:
            wanted, by_hand = _wanted(scan, self.options, self.settings, self.edits, {})
            return _of_scan(scan, wanted, None, by_hand, None, no_progress, known)


def _wanted(
    scan: Scan,
    options: ReconstructOptions | None,
    settings: str,
    edits: str | Sequence[Entry],
    changes: Mapping[str, Any],
) -> tuple[ReconstructOptions, Sequence[Entry]]:
    """The options to reconstruct with, and the repairs; changed settings are options."""
    by_hand = wanted_history(scan, edits).enabled if isinstance(edits, str) else edits
    used = chosen(ReconstructOptions, options or kept_options(scan, settings, by_hand), changes)
    return used, repairs(by_hand)


def _of_scan(
    scan: Scan,
    options: ReconstructOptions,
    rig: Rig | None,
    edits: Sequence[Entry],
    detector: Detector | None,
    progress: Progress,
    known: Sequence[Known] = (),
) -> ReconstructResult:
    rig = rig_for(scan, rig)
    settings = options.settings(rig, scan)
    if detector is not None:
        settings = replace(settings, stripes=replace(settings.stripes, strategy=detector))
    looks = sum(len(lit_in(name, rig)) * len(scan.steps(name)) for name in scan.plan.lasers)
    tick = progress.subrange(0, _DETECTION, "finding the stripes").counter(looks)
    with compiling_ahead():
        seen = detect_scan(scan, rig, settings.stripes, settings.volume, tick, known=known)
        surfacing = progress.subrange(_DETECTION, _SURFACE, "building the surface")
        done = build(seen, settings, edits, surfacing)
    remarks = below_stored(scan, settings.stripes.threshold)
    # One laser says nothing about the table, nor do profiles between those that were measured.
    if len(seen) > 1 and settings.between is None:
        from turnscan.workflows._calibration._refine import table_findings

        remarks += table_findings(seen, done.grids)
    mesh = done.mesh
    if not options.no_colour:
        sources = [TextureSource(scan, rig)]
        mesh, said = coloured(mesh, sources, progress.subrange(_SURFACE, 1, "colouring"))
        remarks += said
    done = replace(done, mesh=mesh, findings=(*done.findings, *remarks))
    return ReconstructResult(
        done, about(scan.path, rig, settings, done.edits), rig, options=options
    )


def below_stored(scan: Scan, threshold: float | None) -> list[Finding]:
    """Whether a threshold asks for pixels that the scan file does not hold."""
    kept = scan.plan.threshold
    if threshold is None or scan.plan.keep != "sparse" or threshold >= kept:
        return []
    return [
        Finding(
            "scan.threshold-below-stored",
            "warning",
            f"the threshold is {threshold:g} grey levels, but the file holds only the pixels near "
            f"those above {kept:g}: a weaker stripe is not in it",
            remedy=Remedy("give at least ", Option("threshold", f"{kept:g}"), ", or import or scan "
                          "again with ", Option("keep", "full")),
        )
    ]  # fmt: skip
