"""Options about how points become a surface, for the verbs that reconstruct."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, TypeVar

import click

from turnscan.cli._between import BetweenType
from turnscan.cli._caps import caps_options
from turnscan.cli._decimation import Fewer, decimate_option
from turnscan.cli._numbers import Finite
from turnscan.errors import InputError
from turnscan.points import Along, Between, Volume, working_volume
from turnscan.rig import Rig
from turnscan.scan import Scan, lit_in
from turnscan.settings import Settings
from turnscan.stripes import StripeSettings
from turnscan.surface import Caps, Clean

Command = TypeVar("Command", bound=Callable[..., Any])
STRATEGIES = (
    "window", "maximum", "centroid", "median", "parabola", "gauss3", "squared", "blais-rioux",
)  # fmt: skip
REFINEMENTS = ("none", "auto", "spacetime")
_length = Finite(min=0, min_open=True)


@dataclass(frozen=True)
class Limits:
    """What a user keeps of the working volume, mm; None for the rig's own limit."""

    radius: float | None = None
    z_min: float | None = None
    z_max: float | None = None

    def volume(self, rig: Rig, scan: Scan) -> Volume | None:
        """What is wanted, and the rig's own limits for the rest; None for those alone.

        Raises InputError where no height is left.
        """
        if self == Limits():
            return None
        names = [name for lit in scan.plan.lasers for name in lit_in(lit, rig)]
        usual = [working_volume(rig, laser) for laser in names]
        low = usual[0].z_min if self.z_min is None else self.z_min
        high = usual[0].z_max if self.z_max is None else self.z_max
        if high <= low:
            raise InputError(
                f"no height between {low} and {high} mm", hint="give --z-min below --z-max"
            )
        reach = max(v.r_max for v in usual) if self.radius is None else self.radius
        return Volume(reach, low, high)


def settings_options(command: Command) -> Command:
    """Give a verb the options of a reconstruction; it receives ``settings`` and ``limits``.

    The volume is not in the settings: it needs the rig of the scan (`Limits.volume`).
    """

    @click.option(
        "--strategy",
        type=click.Choice(STRATEGIES),
        default="window",
        show_default=True,
        help="How the centre of the stripe is computed.",
    )
    @click.option(
        "--choose",
        type=click.Choice(["brightest", "first", "last", "nearest"]),
        default="brightest",
        show_default=True,
        help="Which stripe counts where a line of the picture shows several.",
    )
    @click.option(
        "--refine",
        type=click.Choice(REFINEMENTS),
        default="none",
        show_default=True,
        help="spacetime: also follow each place of the surface through the pictures around, where "
        "the steps are small enough; auto: the same, without a word where they are not.",
    )
    @click.option("--threshold", type=_length, help="Grey levels; without it from the noise.")
    @click.option(
        "--spacing", type=_length, help="mm between points along a profile; both ends of it stay."
    )
    @click.option(
        "--spacing-by",
        type=click.Choice(["height", "arc"]),
        default="height",
        show_default=True,
        help="Points at common heights, or at equal length along each profile.",
    )
    @click.option(
        "--spacing-between",
        type=BetweenType(),
        help="Between profiles, 2deg or 1.5mm (there where the part is widest); new ones lie "
        "between two that were measured.  [default: the profiles of the scan]",
    )
    @click.option("--every", type=click.IntRange(min=1), default=1, help="Use every N-th profile.")
    @click.option(
        "--radius", type=_length, help="mm from the axis; what is further out is dropped."
    )
    @click.option("--z-min", type=Finite(), help="mm above the platter; what is lower is dropped.")
    @click.option("--z-max", type=Finite(), help="mm above the platter; what is higher is dropped.")
    @click.option(
        "--island",
        type=click.IntRange(min=0),
        help="Loose pieces of fewer faces are taken away.  [default: 1 % of the largest piece]",
    )
    @click.option(
        "--edge",
        type=click.IntRange(min=0, max=20),
        default=1,
        show_default=True,
        help="Points dropped where a run ends at a jump in depth or in one-sided light.",
    )
    @click.option(
        "--outliers",
        type=_length,
        help="Sigmas: points further off the surface of their neighbours are taken away.",
    )
    @click.option("--keep-strays", is_flag=True, help="Keep points without a surface round them.")
    @click.option(
        "--denoise",
        type=Finite(min=0, min_open=True, max=10),
        help="Sigmas, like 2: points move along their rays by no more, onto the surface there.",
    )
    @click.option(
        "--merge",
        type=click.Choice(["auto", "grid", "tsdf", "paste"]),
        default="auto",
        show_default=True,
        help="Several lasers or scans: average in angle and height, in voxels, or keep every "
        "point.",
    )
    @click.option(
        "--voxel", type=_length, help="mm: voxels of tsdf.  [default: the points' spacing]"
    )
    @decimate_option
    @caps_options
    @wraps(command)
    def with_options(
        *args: Any,
        strategy: Any,
        choose: Any,
        refine: Any,
        threshold: float | None,
        spacing: float | None,
        spacing_by: Any,
        spacing_between: Between | None,
        every: int,
        radius: float | None,
        z_min: float | None,
        z_max: float | None,
        island: int | None,
        edge: int,
        outliers: float | None,
        keep_strays: bool,
        denoise: float | None,
        merge: Any,
        voxel: float | None,
        caps: Caps | None,
        decimate: Fewer | None,
        **others: Any,
    ) -> Any:
        usual = Clean(edge=edge, outlier=outliers)
        settings = Settings(
            stripes=StripeSettings(
                strategy=strategy, choose=choose, refine=refine, threshold=threshold
            ),
            every=every,
            along=None if spacing is None else Along(spacing, spacing_by),
            between=spacing_between,
            island=island,
            clean=replace(usual, support=0, piece=0.0) if keep_strays else usual,
            denoise=denoise,
            merge=merge,
            voxel=voxel,
            caps=caps,
            tolerance=None if decimate is None else decimate.tolerance,
            faces=None if decimate is None else decimate.faces,
        )
        limits = Limits(radius, z_min, z_max)
        return command(*args, settings=settings, limits=limits, **others)

    return with_options  # type: ignore[return-value]
