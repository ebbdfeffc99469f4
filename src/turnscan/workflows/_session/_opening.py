"""Opening a scan file to look at it."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from turnscan.picture import brightened, card, image, shrunk
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.stripes import Detector
from turnscan.workflows._files._kept_options import kept_options
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._surface._stripes import ScanStripes, stripes_of


class OpenScan(Scan):
    """A scan file open for reading, with its frames and its stripes; use it as a context manager.

    >>> import turnscan as ts
    >>> with ts.open_scan("cup.turnscan") as scan:
    ...     picture = scan.frame(5).show()
    ...     stripes = scan.stripes()
    >>> picture.shape, stripes.position.shape
    ((240, 320), (24, 240))
    """

    def _repr_html_(self) -> str:
        plan = self.plan
        angles = np.degrees(self.angles(plan.lasers[0]))
        kind = "colour" if plan.channels == 3 else "grey"
        known = angles[~np.isnan(angles)]
        rows: list[tuple[str, object]] = [
            ("frames", f"{len(self)} in {plan.steps} steps, lasers {', '.join(plan.lasers)}"),
            ("pictures", f"{plan.width} × {plan.height} {plan.dtype}, {kind}"),
            ("angles", f"{known.min():.2f}° to {known.max():.2f}°" if len(known) else "not known"),
            ("rig", "none" if self.rig is None else f"{len(self.rig.sheets)} lasers"),
            ("complete", "yes" if self.complete else "no"),
        ]
        steps = self.steps(plan.lasers[0])
        if not steps:
            return card(f"Scan {self.path.name}", rows)
        middle = self.frame(steps[len(steps) // 2])
        drawn = brightened(shrunk(middle.lit, 320))
        return card(f"Scan {self.path.name}", rows, image(drawn))

    def stripes(
        self,
        laser: str | None = None,
        options: ReconstructOptions | None = None,
        *,
        rig: Rig | None = None,
        detector: Detector | None = None,
        progress: Progress = no_progress,
        **changes: Any,
    ) -> ScanStripes:
        """Find the stripes of one laser in all its frames.

        Parameters
        ----------
        laser
            Its name; None takes the first one.
        options
            As for `reconstruct`, of which those about stripes count; None takes the scan's own.
        rig
            Tells where a stripe can be; None takes the one in the scan file. Without any, stripes
            are sought in the whole picture.
        detector
            A function that finds the stripe in a picture instead of ``options.strategy``.
        progress
            Told how far it is; it may cancel.
        changes
            Options to change by name, as in ``strategy="gauss3"``.

        Returns
        -------
        ScanStripes
            Arrays of one row a frame.

        Raises
        ------
        InputError
            Where there is no such laser or option.
        ScanCorrupt
            Naming the frame that is damaged.

        >>> import turnscan as ts
        >>> with ts.open_scan("cup.turnscan") as scan:
        ...     ours, coarse = scan.stripes(), scan.stripes(strategy="maximum")
        >>> float(abs(ours.position - coarse.position)[ours.found & coarse.found].max()) < 3.0
        True
        """
        wanted = chosen(ReconstructOptions, options or kept_options(self), changes)
        return stripes_of(self, laser, wanted, rig, detector, progress)


def open_scan(path: str | PathLike[str]) -> OpenScan:
    """Open a scan file for reading, also while it is being written.

    Parameters
    ----------
    path
        The scan file (.turnscan), or what made one.

    Returns
    -------
    OpenScan
        Its frames, stripes, angles, rig, settings and edits; use it as a context manager.

    Raises
    ------
    InputError
        Where no such file, or it is something else.
    ScanError
        Where it is damaged, or was written by a later turnscan.

    >>> import turnscan as ts
    >>> with ts.open_scan("cup.turnscan") as scan:
    ...     len(scan), scan.frame(5).lit.shape
    (24, (240, 320))
    """
    return OpenScan.open(path)
