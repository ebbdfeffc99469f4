"""What a person should know about the points of a scan."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from turnscan.findings import Finding
from turnscan.points._grid import RangeGrid
from turnscan.points._sweep import Swept
from turnscan.points._triangulate import beyond_axis
from turnscan.points._volume import Volume
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import StripeFlag

_SHARE = 0.05
"""Share of the points from which a flag is worth a word."""
_UNLIKE = 1.5
"""Times: two thicknesses of one sheet agree within it. Widths tell it to a tenth (simulated parts),
boards to a quarter."""
_TELL = 20
"""Times that four lines must follow each other to tell how far centres scatter (`stripes.scatter`).
"""
_RESOLVED = 4.0
"""Thicknesses (rms) of the light, nearly all of it: what is narrower lies in it as a whole."""
_UNEVEN = 0.2
"""Spread of the steps, as a part of the usual step, from which they are worth a word."""
_WORDS = (
    (StripeFlag.SATURATED, "saturated", "are clipped", "take shorter exposures"),
    (StripeFlag.HALO, "halo", "are shifted by a halo", ""),
    (StripeFlag.GRAZING, "grazing", "are seen at a grazing angle", "their sigma is larger"),
    (
        StripeFlag.AMBIGUOUS,
        "ambiguous",
        "had another candidate",
        Remedy("select the candidate with ", Option("choose")),
    ),
)


def grid_findings(
    grid: RangeGrid,
    clipped: RangeGrid,
    volume: Volume,
    strategy: str = "window",
    stated: float | None = None,
) -> list[Finding]:
    """Findings on one laser's points: ``grid`` as triangulated, ``clipped`` as kept.

    ``strategy`` is how the stripes were measured, so that what was done is not recommended again;
    ``stated`` mm rms is how thick the rig says that the sheet of light is.
    """
    where = f"laser {grid.laser}"
    before, after = int(grid.found.sum()), int(clipped.found.sum())
    if not after:
        cause = (
            f"{before} points, all outside the working volume"
            if before
            else "no stripe was found in any picture"
        )
        return [
            Finding(
                "points.none",
                "error",
                f"{cause} ({volume})",
                where,
                Remedy(
                    "check the rig, ",
                    Option("radius"),
                    " and ",
                    Option("z_min"),
                    ", or the threshold",
                ),
            )
        ]
    out = [
        Finding(
            "points.volume",
            "note",
            f"{after} points kept; {before - after} removed, outside {volume} or isolated",
            where,
        )
    ]
    out += _thickness_findings(grid.thickness, stated, where)
    out += _few_lines_findings(grid, where)
    out += _detail_findings(grid, grid.thickness or stated or 0.0, where)
    flags = clipped.flags[clipped.found]
    for bit, word, what, remedy in _WORDS:
        share = float(((flags & bit) != 0).mean())
        if share >= _SHARE:
            text = f"{share:.0%} of the points {what}"
            if bit == StripeFlag.HALO:
                text += _moved(clipped)
                remedy = _halo_remedy(strategy)
            out.append(Finding(f"points.{word}", "note", text, where, remedy))
    return out


def _thickness_findings(seen: float, stated: float | None, where: str) -> list[Finding]:
    """Whether the stripes' widths contradict what the rig says of the sheet's thickness, mm rms."""
    if not seen > 0 or stated is None or 1 / _UNLIKE < seen / stated < _UNLIKE:
        return []
    text = (
        f"the stripes are as wide as a sheet of light {seen:.2f} mm thick (rms) makes them; the "
        f"rig states {stated:.2f} mm. Curved surfaces are corrected for {seen:.2f} mm"
    )
    remedy = (
        "focus the laser at the axis and calibrate it again, which measures the thickness; where "
        "the part scatters light inside (wax, skin, plastic), spray it"
        if seen > stated
        else "calibrate the laser again, which measures the thickness; the rig's was stated for "
        "another focus or another laser"
    )
    return [Finding("points.sheet-thickness", "warning", text, where, remedy)]


def _few_lines_findings(grid: RangeGrid, where: str) -> list[Finding]:
    """Whether sigma had to be assumed, for profiles too low to show how far centres scatter."""
    found = grid.found & ((grid.flags & (StripeFlag.REFINED | StripeFlag.HAND)) == 0)
    alike = found[:, 3:] & found[:, 2:-1] & found[:, 1:-2] & found[:, :-3]
    if alike.sum() >= _TELL or not found.any():
        return []
    text = (
        f"profiles of at most {int(found.sum(axis=1).max())} points do not tell how far centres "
        "scatter: sigma is taken as a quarter of the stripes' width"
    )
    remedy = "to know it better, move the camera nearer, or stand the part up"
    return [Finding("points.few-lines", "note", text, where, remedy)]


def _detail_findings(grid: RangeGrid, thickness: float, where: str) -> list[Finding]:
    """What is too narrow for light ``thickness`` mm rms, where profiles are close enough for it.

    The centre of a stripe that lies on a groove and beside it is that of neither, and its light
    does not tell.
    """
    if len(grid.angles) < 2:
        return []
    usual = float(np.median(np.abs(np.diff(np.unwrap(grid.angles)))))
    apart = usual * float(np.median(np.hypot(*grid.points[grid.found][:, :2].T)))
    narrow = _RESOLVED * thickness
    if not narrow > 2 * apart > 0:
        return []
    text = (
        f"profiles lie {apart:.2f} mm apart, but the light is {thickness:.2f} mm thick (rms): "
        f"across the profiles, grooves, ribs and steps narrower than {narrow:.1f} mm are rounded "
        "off or missed, and sigma does not always say so"
    )
    remedy = "focus the laser at the axis, or take a thinner line, where such details matter"
    return [Finding("points.detail", "note", text, where, remedy)]


def _moved(grid: RangeGrid) -> str:
    """By how much halos move the points of a grid, in words."""
    flagged = grid.found & ((grid.flags & StripeFlag.HALO) != 0)
    sigma = float(np.median(grid.sigma[flagged]))
    if grid.halo is None or np.isnan(grid.halo[flagged]).all():
        return f", by how much is not known (their sigma is {sigma:.2g} mm)"
    known = grid.halo[flagged]
    half, most = np.quantile(known[~np.isnan(known)], [0.5, 0.95])
    return f": half by {half:.2g} mm or more, 5 % by more than {most:.2g} mm (sigma {sigma:.2g} mm)"


def _halo_remedy(strategy: str) -> Remedy | str:
    """What is left to do about a halo, however the stripes were measured."""
    spray = "light the other side, or apply matting spray"
    if strategy == "blais-rioux":
        return f"the core of the stripe is measured already; {spray}"
    compare, core = "compare ", Option("strategy", "blais-rioux")
    if strategy == "window":
        # It goes over to the core by itself where light glows beside a stripe.
        compare = "where it is strongest the core of the stripe is measured already; compare "
        return Remedy(compare, core, f", which measures the core everywhere; {spray}")
    return Remedy(compare, core, f", which measures the core of the stripe alone; {spray}")


def angle_findings(grid: RangeGrid, again: int) -> list[Finding]:
    """Findings on the table's angles: a turn that is open, or goes on past its start."""
    where = f"laser {grid.laser}"
    out = []
    if again:
        text = f"{again} profiles beyond one full turn are left out"
        out.append(Finding("points.second-turn", "note", text, where))
    moves = np.abs(np.diff(np.unwrap(grid.angles)))
    if not len(moves):
        return out
    usual = float(np.median(moves))
    if usual > 0 and float(np.std(moves)) > _UNEVEN * usual:
        text = (
            f"steps of {np.rad2deg(moves.min()):.3f}° to {np.rad2deg(moves.max()):.3f}°, "
            f"usually {np.rad2deg(usual):.3f}°"
        )
        out.append(Finding("points.uneven-steps", "note", text, where))
    if not grid.closed:
        turn = float(np.rad2deg(abs(np.unwrap(grid.angles)[-1] - grid.angles[0])))
        text = f"the profiles cover {turn:.2f}° and do not close a turn"
        remedy = "the surface stays open there; scan a full turn to close it"
        out.append(Finding("points.open-turn", "warning", text, where, remedy))
    return out


def together_findings(
    grid: RangeGrid, rig: Rig, others: Iterable[str], volume: Volume
) -> list[Finding]:
    """Findings on a laser that was lit together with ``others``: whose stripe is it?

    A pixel on the near side of this laser's sheet can as well show another's sheet beyond the axis:
    the inside of a cup over its rim, the far half of a level top.
    """
    found, names = grid.found, tuple(others)
    if not names or not found.any():
        return []
    turned = np.einsum("sij,snj->sni", rotation_z(grid.angles), grid.points)[found]
    rays = rig.camera.rays(rig.camera.project(rig.T_camera_table.apply(turned)))
    either = np.zeros(len(turned), dtype=np.bool_)
    for name in names:
        X = rig.sheet(name).intersect(rays)
        inside = volume.contains(rig.T_camera_table.inverse().apply(X))
        either |= inside & beyond_axis(rig, name, X)
    if not either.any():
        return []
    highest = float(turned[either, 2].max())
    text = (
        f"{either.mean():.0%} of the points may belong to another laser whose stripe was seen "
        f"beyond the axis, and would then lie lower; the highest ({highest:.1f} mm) may not exist"
    )
    remedy = Remedy(
        "give the part's height with ",
        Option("z_max"),
        ", or scan with one laser after the other",
    )
    return [Finding("points.together", "warning", text, f"laser {grid.laser}", remedy)]


def swept_findings(laser: str, swept: Swept, asked: bool) -> list[Finding]:
    """Findings on the space-time refinement of a laser; none where it was neither possible nor
    ``asked`` for.
    """
    where = f"laser {laser}"
    if swept.refined.any():
        found = sum(int(stripe.found.sum()) for stripe in swept.stripes)
        text = (
            f"{swept.refined.sum() / found:.0%} of the points refined with the pictures around; "
            f"the sheet of light is {swept.thickness:.2f} mm thick (rms), "
            f"and a step moves the surface by {swept.arc:.2f} mm"
        )
        return [Finding("points.refined", "note", text, where)]
    if not asked or np.isnan(swept.arc):
        return []
    why = f"no point refined: a step moves the surface by {swept.arc:.2f} mm; "
    if swept.arc > swept.most:
        text = f"{why}at most {swept.most:.2f} mm is possible with a sheet of light this thin"
        more = f"take {swept.arc / swept.most:.1f} times as many steps"
        remedy = Remedy(f"{more}, or leave ", Option("refine"), " out")
    else:
        text = (
            f"{why}so near the axis it stays in the sheet of light, {swept.thickness:.2f} mm thick"
        )
        remedy = Remedy("place the part further out, or leave ", Option("refine"), " out")
    return [Finding("points.not-refined", "warning", text, where, remedy)]


def lost_frames(laser: str, missing: Mapping[int, str], no_angle: int) -> list[Finding]:
    """Findings on steps without a frame (step → cause), and on frames without a table angle."""
    where = f"laser {laser}"
    out = []
    if missing:
        steps = ", ".join(str(k) for k in list(missing)[:8]) + (" …" if len(missing) > 8 else "")
        causes = "; ".join(dict.fromkeys(missing.values()))
        text = f"{len(missing)} steps have no frame ({steps}): {causes}"
        out.append(
            Finding("points.missing-frames", "warning", text, where, "the mesh bridges them")
        )
    if no_angle:
        text = f"{no_angle} frames have no table angle and are left out"
        out.append(Finding("points.no-angle", "warning", text, where))
    return out
