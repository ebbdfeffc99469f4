"""ReconstructOptions: how the points of a scan become a surface."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.workflows._options import _choices as choices
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.points import Between, Spacing, Volume
    from turnscan.rig import Rig
    from turnscan.scan import Scan
    from turnscan.settings import Settings
    from turnscan.stripes import Choice, Refinement
    from turnscan.surface.fusion import MergeMethod
    from turnscan.surface.holes import Bottom, ClosingOptions, FillHow, Top

_BELOW = Remedy("choose ", Option("z_min"), " below ", Option("z_max"))


@dataclass(frozen=True)
class Decimation:
    """How far a mesh is decimated: one of the two is given."""

    tolerance: float | None = None
    """mm."""
    faces: int | None = None


def decimation(text: str) -> Decimation:
    """``0.05mm`` is a tolerance, ``100000`` or ``1e5`` a number of faces. Raises ValueError."""
    given = text.strip().lower()
    in_mm = given.endswith("mm")
    try:
        size = float(given.removesuffix("mm"))
    except ValueError:
        size = math.nan
    if not math.isfinite(size) or (in_mm and size <= 0):
        raise ValueError(f"{text!r}: give a length like 0.05mm or a number of faces.")
    if in_mm:
        return Decimation(tolerance=size)
    if not size.is_integer():
        raise ValueError(f"{text!r} is not a number of faces; give a length as {given}mm.")
    if size < 4:
        raise ValueError(f"{text!r} faces are not a surface; a tolerance ends in mm.")
    return Decimation(faces=int(size))


def _spacing(text: str) -> tuple[float, Literal["rad", "mm"]]:
    """``2deg`` is a table angle, ``1.5mm`` a length on the part's outermost circle.

    Raises ValueError.
    """
    told = text.strip().lower()
    unit = "deg" if told.endswith("deg") else "mm" if told.endswith("mm") else ""
    try:
        size = float(told.removesuffix(unit)) if unit else math.nan
    except ValueError:
        size = math.nan
    if not (size > 0 and math.isfinite(size)):
        raise ValueError(f"{text!r}: give an angle like 2deg or a length like 1.5mm.")
    return (math.radians(size), "rad") if unit == "deg" else (size, "mm")


def spacing_between(text: str) -> Between:
    """The spacing that a text like ``2deg`` or ``1.5mm`` stands for. Raises ValueError."""
    from turnscan.points import Between

    return Between(*_spacing(text))


def _detectors() -> tuple[str, ...]:
    """Stripe detectors of other packages."""
    from turnscan.stripes import detector_names

    return detector_names()


_OF_CLOSING = ("fill", "top", "bottom", "largest_hole")


def idle_options(held: Mapping[str, Any]) -> dict[str, tuple[str, Remedy]]:
    """Which of these options (those left out are at their default) have no effect: for want of
    what, and what to do."""
    out = dict[str, tuple[str, Remedy]]()
    if not held.get("close"):
        lack = ("without close", Remedy("add ", Option("close")))
        out |= dict.fromkeys((name for name in _OF_CLOSING if held.get(name)), lack)
    merge = held.get("merge")
    if held.get("voxel") is not None and merge in ("grid", "paste"):
        instead = Remedy("leave it out, or give ", Option("merge", "tsdf"))
        out["voxel"] = (f"with merge {merge}, which has no voxels", instead)
    if held.get("spacing_by", "height") != "height" and held.get("spacing") is None:
        out["spacing_by"] = ("without spacing", Remedy("add ", Option("spacing")))
    return out


@dataclass(frozen=True)
class ReconstructOptions(Checked):
    """How the points of a scan become a surface; lengths in mm, None leaves it to turnscan."""

    strategy: str = option(
        "window", "choice",
        "Estimator of the stripe centre; installed packages may add others.",
        choices=choices.STRATEGY, more=_detectors, group="Stripes",
    )  # fmt: skip
    choose: Choice = option(
        "brightest", "choice",
        "Which candidate is taken where an image row shows several "
        "stripes.", choices=choices.CHOICE, group="Stripes",
    )  # fmt: skip
    refine: Refinement = option(
        "none", "choice",
        "spacetime: refine each point over the neighbouring pictures, where the steps are small "
        "enough; auto: the same, without a finding where they are not.",
        choices=choices.REFINEMENT, group="Stripes",
    )  # fmt: skip
    threshold: float | None = option(
        None,
        "number",
        "Threshold above the background, grey levels.  [default: from the noise]",
        least=0,
        above=True,
        unit="grey levels",
        group="Stripes",
    )
    spacing: float | None = option(
        None,
        "number",
        "Spacing of points along a profile, mm; both end points are kept.",
        least=0,
        above=True,
        unit="mm",
        group="Points",
    )
    spacing_by: Spacing = option(
        "height", "choice",
        "Space points by equal height, or by equal arc length along each profile.",
        choices=choices.SPACING, group="Points",
    )  # fmt: skip
    spacing_between: str | None = option(
        None, "text",
        "Spacing between profiles: an angle (2deg), or a length at the largest radius (1.5mm); "
        "profiles are interpolated between measured ones.  [default: as scanned]",
        parse=_spacing, group="Points",
    )  # fmt: skip
    every: int = option(1, "count", "Use every N-th profile.", least=1, group="Points")
    radius: float | None = option(
        None,
        "number",
        "Largest radius, mm from the axis; points further out are dropped.",
        least=0,
        above=True,
        unit="mm",
        group="Points",
    )
    z_min: float | None = option(
        None,
        "number",
        "Lowest height, mm above the platter; points below are dropped.",
        unit="mm",
        group="Points",
    )
    z_max: float | None = option(
        None,
        "number",
        "Largest height, mm above the platter; points above are dropped.",
        unit="mm",
        group="Points",
    )
    island: int | None = option(
        None, "count",
        "Remove unconnected pieces (islands) of fewer faces.  [default: 1 % of the largest piece]",
        least=0, unit="faces", group="Clean-up",
    )  # fmt: skip
    edge: int = option(
        1, "count",
        "Number of points dropped at each end of a profile run at a depth discontinuity or in "
        "one-sided light.",
        least=0, most=20, unit="points", group="Clean-up",
    )  # fmt: skip
    outliers: float | None = option(
        None,
        "number",
        "Remove points further than this many sigma from the surface through their neighbours.",
        least=0,
        above=True,
        unit="sigma",
        group="Clean-up",
    )
    largest_sigma: float | None = option(
        None,
        "number",
        "Leave out points and vertices of a larger standard uncertainty, mm; holes stay there.",
        least=0,
        above=True,
        unit="mm",
        group="Clean-up",
    )
    keep_strays: bool = option(
        False, "switch", "Keep isolated points, which lie on no surface.", group="Clean-up"
    )
    denoise: float | None = option(
        None, "number",
        "Denoise along camera rays: maximum shift of a point in sigma, like 2.",
        least=0, above=True, most=10, unit="sigma", group="Clean-up",
    )  # fmt: skip
    merge: MergeMethod = option(
        "auto", "choice",
        "Merging of several lasers or scans: average in angle and height (grid), in voxels "
        "(tsdf), or keep every point (paste).",
        choices=choices.HOW, group="Surface",
    )  # fmt: skip
    voxel: float | None = option(
        None,
        "number",
        "Voxel size of tsdf, mm.  [default: the point spacing]",
        least=0,
        above=True,
        unit="mm",
        group="Surface",
    )
    decimate: str | None = option(
        None, "text",
        "Decimate the mesh: within a tolerance (0.05mm), or to a number of faces.",
        parse=decimation, group="Surface",
    )  # fmt: skip
    no_colour: bool = option(
        False, "switch", "Leave the surface without the colours of the texture images.",
        group="Surface",
    )  # fmt: skip
    close: bool = option(
        False, "switch", "Close the surface; the faces added are marked.", group="Closing"
    )
    fill: FillHow | Literal["none"] | None = option(
        None, "choice",
        "Hole filling: flat, membrane (minimal area), tangent (in the tangent planes of the "
        "boundary), curvature (with its curvature too), or none; auto takes membrane where an edge "
        "runs round the hole, and tangent elsewhere.  [default: auto]",
        choices=(*choices.FILL_HOW, "none"), group="Closing",
    )  # fmt: skip
    top: Top | Literal["hole"] | None = option(
        None, "choice",
        "With close, the gap at the top: closed by its plane, by a fan to the axis, with the "
        "curvature of its boundary (smooth), as any hole, or left open.  [default: plane]",
        choices=("plane", "fan", "smooth", "hole", "open"), group="Closing",
    )  # fmt: skip
    bottom: Bottom | Literal["hole"] | None = option(
        None, "choice",
        "With close, the gap at the bottom: extended to the platter and closed by its plane "
        "(floor), filled as any hole, or left open.  [default: floor]",
        choices=("floor", "hole", "open"), group="Closing",
    )  # fmt: skip
    largest_hole: float | None = option(
        None,
        "number",
        "With close, largest hole to fill, mm across; larger ones stay open.  [default: all are "
        "filled]",
        least=0,
        above=True,
        unit="mm",
        group="Closing",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        idle = idle_options(self.changed())
        if idle:
            lack, remedy = next(iter(idle.values()))
            names = ", ".join(name for name, why in idle.items() if why == (lack, remedy))
            raise InputError(f"{names}: no effect {lack}", hint=remedy)
        faces = None if self.decimate is None else decimation(self.decimate).faces
        if faces is not None:  # in digits: what is kept as 5e2 was a length once
            object.__setattr__(self, "decimate", str(faces))
        if self.z_min is not None and self.z_max is not None and self.z_max <= self.z_min:
            raise InputError(
                f"no height between {self.z_min} and {self.z_max} mm",
                hint=_BELOW,
            )

    def carried(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """As of any options, without those that the changes leave no effect."""
        held = super().carried(changes)
        idle = idle_options({**held, **changes})
        return {name: value for name, value in held.items() if name not in idle}

    @property
    def caps(self) -> ClosingOptions | None:
        """How the surface is closed; None leaves its borders open."""
        if not self.close:
            return None
        from turnscan.surface.holes import ClosingOptions

        return ClosingOptions(
            holes=None if self.fill == "none" else self.fill or "auto",
            top=None if self.top == "hole" else self.top or "plane",
            bottom="open" if self.bottom == "open" else "floor",
            floor=None if self.bottom == "hole" else 0.0,
            largest=self.largest_hole,
        )

    def settings(self, rig: Rig | None = None, scan: Scan | None = None) -> Settings:
        """The settings of the reconstruction of a scan with a rig; without them, of range scans.

        Raises InputError where no height of the rig's working volume is left.
        """
        from turnscan.points import Along
        from turnscan.settings import Settings
        from turnscan.stripes import StripeSettings
        from turnscan.surface.clean import Clean

        clean = Clean(edge=self.edge, outlier=self.outliers)
        fewer = Decimation() if self.decimate is None else decimation(self.decimate)
        between = self.spacing_between
        return Settings(
            stripes=StripeSettings(
                strategy=self.strategy,
                choose=self.choose,
                refine=self.refine,
                threshold=self.threshold,
            ),
            volume=None if rig is None or scan is None else self._volume(rig, scan),
            every=self.every,
            along=None if self.spacing is None else Along(self.spacing, self.spacing_by),
            between=None if between is None else spacing_between(between),
            island=self.island,
            clean=replace(clean, support=0, piece=0.0) if self.keep_strays else clean,
            denoise=self.denoise,
            merge=self.merge,
            voxel=self.voxel,
            largest_sigma=self.largest_sigma,
            caps=self.caps,
            tolerance=fewer.tolerance,
            faces=fewer.faces,
        )

    def _volume(self, rig: Rig, scan: Scan) -> Volume | None:
        """What is wanted, and the rig's own limits for the rest; None for those alone."""
        if self.radius is None and self.z_min is None and self.z_max is None:
            return None
        from turnscan.points import Volume, working_volume
        from turnscan.scan import lit_in

        names = [name for lit in scan.plan.lasers for name in lit_in(lit, rig)]
        usual = [working_volume(rig, laser) for laser in names]
        low = usual[0].z_min if self.z_min is None else self.z_min
        high = usual[0].z_max if self.z_max is None else self.z_max
        if high <= low:
            raise InputError(f"no height between {low} and {high} mm", hint=_BELOW)
        reach = max(v.r_max for v in usual) if self.radius is None else self.radius
        return Volume(reach, low, high)
