"""``turnscan measure``: flat sides and the angles between them, spheres, cylinders, volume."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from turnscan.cli._input import read_mesh_file, read_start
from turnscan.cli._numbers import Finite
from turnscan.errors import InputError
from turnscan.export import read_about
from turnscan.shapes import (
    PlaneAngle,
    PlaneRegion,
    find_planes,
    plane_angles,
    volume_figures,
    volume_in_words,
    volume_sigma,
)
from turnscan.surface import Mesh, is_closed

_SAME = 1e-6
"""Relative: a volume that differs by more from what its file says is that of another mesh."""
_SQUARE = np.deg2rad(20.0)
"""Sides within this of square or parallel are compared with it."""


@click.command("measure")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--planes", is_flag=True, help="Flat sides, and the angles between them.")
@click.option(
    "--tolerance",
    type=Finite(min=0, min_open=True),
    help="mm that a point may lie off its side.  [default: three times the noise of the surface]",
)
@click.option(
    "--smallest",
    type=Finite(min=0, max=1),
    default=0.02,
    show_default=True,
    help="Least area of a side, as a part of the whole surface.",
)
@click.option("--sphere", is_flag=True, help="The sphere through all measured points.")
@click.option("--cylinder", is_flag=True, help="The cylinder through all measured points.")
@click.option("--json", "as_json", is_flag=True, help="The figures as JSON, unrounded.")
def verb(
    file: Path,
    planes: bool,
    tolerance: float | None,
    smallest: float,
    sphere: bool,
    cylinder: bool,
    as_json: bool,
) -> None:
    """Measure the mesh in FILE (.ply .stl .obj .3mf .glb .dxf, mm).

    Only what was measured is fitted, no vertex of a filling, as far as the file tells them apart
    (an STL does not); points weigh 1/sigma² where the file knows their sigma (PLY). Uncertainties
    follow from the scatter of the points about the fit; what a wrong calibration does to all points
    alike is not in them.
    """
    mesh = read_mesh_file(file)
    if not len(mesh.vertices):
        raise InputError(f"{file}: no points", hint="give a file with a part in it")
    result = _whole(mesh, read_about(read_start(file)))
    if planes:
        if not len(mesh.faces):
            raise InputError(f"{file}: no faces", hint="flat sides are found on a mesh")
        regions = find_planes(mesh, tolerance=tolerance, smallest=smallest)
        result["planes"] = [_plane(r) for r in regions]
        result["angles"] = [_angle(a) for a in plane_angles(regions)]
    if sphere:
        result["sphere"] = _sphere(mesh)
    if cylinder:
        result["cylinder"] = _cylinder(mesh)
    click.echo(json.dumps(result, indent=1) if as_json else "\n".join(_text(result)))


def _whole(mesh: Mesh, about: Mapping[str, object]) -> dict[str, Any]:
    closed = is_closed(mesh)
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "bounds_mm": mesh.bounds.tolist(),
        "closed": closed,
        **(_volume(mesh, about) if closed else {"volume_mm3": None, "volume_sigma_mm3": None}),
    }


def _volume(mesh: Mesh, about: Mapping[str, object]) -> dict[str, float | None]:
    """The volume of a closed mesh; where its file holds what was known when it was made, that."""
    figures = volume_figures(mesh.volume, volume_sigma(mesh))
    said = {k: v for k in figures if isinstance(v := about.get(k), float | int)}
    whole = said.get("volume_mm3")
    if whole is None or not np.isclose(whole, mesh.volume, rtol=_SAME, atol=0):
        return figures
    return {**dict.fromkeys(figures), **said, "volume_mm3": mesh.volume}


def _plane(r: PlaneRegion) -> dict[str, Any]:
    p = r.plane
    return {
        "area_mm2": r.area,
        "points": p.count,
        "rms_mm": p.rms,
        "normal": p.normal.tolist(),
        "normal_sigma_deg": float(np.rad2deg(p.normal_sigma)),
        "distance_mm": p.distance,
        "centre_mm": p.centre.tolist(),
    }


def _angle(a: PlaneAngle) -> dict[str, Any]:
    relation, off = "oblique", None
    if a.off_square < _SQUARE:
        relation, off = "adjacent", a.off_square
    elif a.off_parallel < _SQUARE:
        relation, off = "opposite" if a.angle > np.pi / 2 else "alike", a.off_parallel
    return {
        "sides": [a.first + 1, a.second + 1],
        "angle_deg": float(np.rad2deg(a.angle)),
        "sigma_deg": float(np.rad2deg(a.sigma)),
        "relation": relation,
        "off_deg": None if off is None else float(np.rad2deg(off)),
    }


def _sphere(mesh: Mesh) -> dict[str, Any]:
    from turnscan.shapes import fit_sphere, measured_points

    s = fit_sphere(*measured_points(mesh))
    sigma = np.sqrt(np.diag(s.covariance))
    return {
        "points": s.count,
        "centre_mm": s.centre.tolist(),
        "centre_sigma_mm": sigma[:3].tolist(),
        "radius_mm": s.radius,
        "radius_sigma_mm": float(sigma[3]),
        "rms_mm": s.rms,
    }


def _cylinder(mesh: Mesh) -> dict[str, Any]:
    from turnscan.shapes import fit_cylinder, measured_points

    c = fit_cylinder(*measured_points(mesh))
    sigma = np.sqrt(np.diag(c.covariance))
    return {
        "points": c.count,
        "point_mm": c.point.tolist(),
        "axis": c.axis.tolist(),
        "axis_sigma_deg": float(np.rad2deg(max(sigma[:2]))),
        "radius_mm": c.radius,
        "radius_sigma_mm": float(sigma[4]),
        "rms_mm": c.rms,
    }


def _text(r: dict[str, Any]) -> list[str]:
    low, high = r["bounds_mm"]
    size = " × ".join(f"{b - a:.3f}" for a, b in zip(low, high, strict=True))
    volume = f"volume {volume_in_words(r)}" if r["closed"] else "not closed, so no volume"
    lines = [f"{r['vertices']} vertices, {r['faces']} faces, {size} mm, {volume}"]
    for number, p in enumerate(r.get("planes", ()), start=1):
        normal = ", ".join(f"{x:+.4f}" for x in p["normal"])
        lines.append(
            f"side {number}: area {p['area_mm2']:.1f} mm², rms {p['rms_mm']:.4f} mm over "
            f"{p['points']} points, normal ({normal}) ± {p['normal_sigma_deg']:.4f}°"
        )
    for a in r.get("angles", ()):
        first, second = a["sides"]
        goal = {"adjacent": "square", "opposite": "parallel", "alike": "parallel"}
        off = "" if a["off_deg"] is None else f", {a['off_deg']:.3f}° off {goal[a['relation']]}"
        lines.append(
            f"sides {first} and {second}: {a['angle_deg']:.3f}° ± {a['sigma_deg']:.3f}°, "
            f"{a['relation']}{off}"
        )
    if "sphere" in r:
        s = r["sphere"]
        centre = ", ".join(f"{x:.4f}" for x in s["centre_mm"])
        lines.append(
            f"sphere: radius {s['radius_mm']:.4f} ± {s['radius_sigma_mm']:.4f} mm, centre "
            f"({centre}) mm, rms {s['rms_mm']:.4f} mm over {s['points']} measured points"
        )
    if "cylinder" in r:
        c = r["cylinder"]
        axis = ", ".join(f"{x:+.5f}" for x in c["axis"])
        lines.append(
            f"cylinder: radius {c['radius_mm']:.4f} ± {c['radius_sigma_mm']:.4f} mm, axis "
            f"({axis}) ± {c['axis_sigma_deg']:.4f}°, rms {c['rms_mm']:.4f} mm over "
            f"{c['points']} measured points"
        )
    return lines
