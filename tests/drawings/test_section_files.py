"""Sections written as DXF, SVG, PDF and JSON, and read by programs that are not ours."""

from __future__ import annotations

import io
import json
import re
import subprocess
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing

from tests.needs import needs
from tests.shapes.outlines import along, regular, rounded_polygon, wall
from tests.shapes.solids import turned
from turnscan.drawings import (
    draw_section,
    section_report,
    with_sigma,
    write_section_dxf,
    write_section_json,
    write_section_pdf,
    write_section_svg,
)
from turnscan.shapes import Arc, FittedSection, fit_section, half_plane_cut, plane_cut

SVG = "{http://www.w3.org/2000/svg}"


def _sections() -> list[FittedSection]:
    """A rounded rectangle, a circle and a freeform ring."""
    t = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    ring = np.stack([np.cos(t), np.sin(t)], axis=1)
    rectangle = rounded_polygon(np.array([[20, -12], [20, 12], [-20, 12], [-20, -12.0]]), 4.0, 0.4)
    blob = (15 + 3 * np.cos(3 * t) + np.sin(5 * t))[:, None] * ring
    heights = np.array([0.0, 1.0])
    meshes = [wall(o, heights, 0.01, k) for k, o in enumerate((rectangle, 8 * ring, blob))]
    return [fit_section(m, plane_cut([0, 0, 1], 0.4, f"z = {k}")) for k, m in enumerate(meshes)]


@pytest.fixture(scope="module")
def sections() -> list[FittedSection]:
    return _sections()


def _dxf(data: bytes) -> Drawing:
    document = ezdxf.read(io.StringIO(data.decode()))
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    return document


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_a_dxf_has_lines_arcs_circles_and_splines_on_named_layers(
    sections: list[FittedSection], version: str
) -> None:
    data = write_section_dxf(sections, version, {"source": "part.ply"})
    document = _dxf(data)
    assert document.dxfversion == {"R12": "AC1009", "R2010": "AC1024"}[version]
    space = document.modelspace()
    fitted = [e for e in space if e.dxf.layer == "TURNSCAN_SECTION_FITTED_MM"]
    kinds = [e.dxftype() for e in fitted]
    assert kinds.count("LINE") == kinds.count("ARC") == 4
    assert kinds.count("CIRCLE") == 1
    assert ("SPLINE" in kinds) == (version == "R2010")
    circle = next(e for e in fitted if e.dxftype() == "CIRCLE")
    assert abs(circle.dxf.radius - 8.0) < 0.005
    for e in fitted:
        if e.dxftype() == "ARC":
            assert abs((e.dxf.end_angle - e.dxf.start_angle) % 360 - 90) < 2.0
            assert abs(e.dxf.radius - 4) < 0.05
    kind = "POLYLINE" if version == "R12" else "LWPOLYLINE"
    measured = space.query(f'{kind}[layer=="TURNSCAN_SECTION_MEASURED_MM"]')
    assert len(measured) == 3
    assert all(e.is_closed if version == "R12" else e.closed for e in measured)
    dimensions = space.query("DIMENSION")
    assert bool(dimensions) == (version == "R2010")
    for e in dimensions:
        # What a CAD program measures between the places is what the text says.
        assert abs(e.get_measurement() - e.dxf.actual_measurement) < 1e-9
        number = re.search(r"[\d.]+", re.sub("%%.", "", e.dxf.text))
        assert number is not None
        assert abs(float(number[0]) - e.dxf.actual_measurement) < 0.06
        assert list(e.virtual_entities())
    texts = [e.dxf.text for e in space.query("TEXT DIMENSION")]
    assert any("%%c16.0" in t or "%%c15.9" in t for t in texts), texts
    assert any(t.startswith(("R4.0", "R3.9")) for t in texts), texts
    if version == "R2010":
        assert data == write_section_dxf(_sections(), version, {"source": "part.ply"})
    # Ends meet: the outline is one ring for whoever joins it.
    ends: dict[tuple[float, float], int] = {}
    for e in fitted:
        if e.dxftype() in ("LINE", "ARC"):
            points = (e.dxf.start, e.dxf.end) if e.dxftype() == "LINE" else (
                e.start_point, e.end_point)  # fmt: skip
            for p in points:
                key = (round(p.x, 5) + 0.0, round(p.y, 5) + 0.0)
                ends[key] = ends.get(key, 0) + 1
    assert set(ends.values()) == {2}


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_gdal_reads_the_dxf(sections: list[FittedSection], version: str, tmp_path: Path) -> None:
    needs("gdal")
    path = tmp_path / "section.dxf"
    path.write_bytes(write_section_dxf(sections[:1], version, {}))
    done = subprocess.run(
        ["ogr2ogr", "-f", "CSV", "/vsistdout/", str(path), "-lco", "GEOMETRY=AS_WKT"],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    rows = [r for r in done.stdout.splitlines() if "SECTION_FITTED" in r]
    assert len(rows) == 8
    assert all(r.startswith('"LINESTRING') for r in rows)
    xy = np.array([p.split()[:2] for r in rows
                   for p in re.findall(r"[-\d.e]+ [-\d.e]+", r)], float)  # fmt: skip
    assert np.allclose(np.abs(xy).max(axis=0), (20, 12), atol=0.02)


def test_an_svg_has_arcs_dimensions_and_a_scale(sections: list[FittedSection]) -> None:
    data = write_section_svg(sections, "part <1> & more.ply", {"source": "part --1.ply"})
    assert data == write_section_svg(_sections(), "part <1> & more.ply", {"source": "part --1.ply"})
    root = ET.fromstring(data.decode())
    assert len(root.findall(f"{SVG}g")) == 3
    paths = [p.get("d", "") for p in root.iter(f"{SVG}path") if p.get("class") == "fitted"]
    assert sum("A" in d for d in paths) == 5
    texts = ["".join(t.itertext()) for t in root.iter(f"{SVG}text")]
    assert any(t.startswith("scale ") for t in texts)
    assert any(re.fullmatch(r"40\.0\d+ ±0\.00\d+|39\.9\d+ ±0\.00\d+", t) for t in texts), texts
    numbers = [float(n) for d in paths for n in re.findall(r"-?\d+\.\d+", d)]
    assert min(numbers) > 0
    assert max(numbers) < 297


def test_a_pdf_has_a_page_for_each_section(sections: list[FittedSection]) -> None:
    data = write_section_pdf(sections, "part.ply")
    assert data.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type /Page\b", data)) == 3
    assert b"CreationDate" not in data
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+)", data)
    assert box is not None
    assert np.allclose([float(x) for x in box.groups()], (841.89, 595.28), atol=0.1)


def test_the_report_holds_every_point_with_its_sigma(sections: list[FittedSection]) -> None:
    text = write_section_json(sections, {"source": "part.ply"})
    report = json.loads(text)
    assert report == json.loads(json.dumps(section_report(sections, {"source": "part.ply"})))
    first = report["sections"][0]
    [line] = first["polylines"]
    assert len(line["points_mm"]) == len(line["sigma_mm"]) == len(line["filled"])
    assert all(0.004 < s < 0.012 for s in line["sigma_mm"])
    assert first["found"] == {"lines": 4, "arcs": 4, "circles": 0, "splines": 0}
    assert abs(first["width_mm"] - 40) < 5 * first["width_sigma_mm"]
    [circle] = report["sections"][1]["outlines"][0]["pieces"]
    assert circle["kind"] == "circle"
    assert abs(circle["radius_mm"] - 8) < 4 * circle["radius_sigma_mm"]
    assert isinstance(sections[1].fitted[0].pieces[0], Arc)


def test_many_sections_stand_beside_each_other() -> None:
    mesh = wall(regular(6, 10.0), np.array([0.0, 20.0]), None)
    many = [fit_section(mesh, plane_cut([0, 0, 1], z, f"z = {z}")) for z in range(1, 11)]
    document = _dxf(write_section_dxf(many, "R2010", {}))
    rings = document.modelspace().query('LWPOLYLINE[layer=="TURNSCAN_SECTION_MEASURED_MM"]')
    spans = sorted((min(p[0] for p in e), max(p[0] for p in e)) for e in rings)
    assert len(spans) == 10
    assert all(a[1] < b[0] for a, b in pairwise(spans))


def test_a_text_that_is_wider_than_its_dimension_stands_clear_of_the_extension_lines() -> None:
    slim = np.array([[3, -30], [3, 30], [-3, 30], [-3, -30.0]])
    mesh = wall(along(slim, 1.0), np.array([0.0, 1.0]), 0.01)
    figure = draw_section(fit_section(mesh, plane_cut([0, 0, 1], 0.4, "z = 0.4")), "slim")
    figure.canvas.draw()
    [axes] = figure.axes
    [text] = [t for t in axes.texts if t.get_text().startswith(("5.9", "6.0"))]
    box = text.get_window_extent()
    assert box.width > 2 * axes.transData.get_matrix()[0, 0] * 6  # wider than it is drawn, 2 : 1
    upright = [
        line
        for line in (axes.transData.transform(np.column_stack(x.get_data())) for x in axes.lines)
        if len(line) == 2 and abs(line[0, 0] - line[1, 0]) < 0.1
    ]
    below = [line for line in upright if box.x0 < line[0, 0] < box.x1]
    assert len(below) >= 2
    assert all(line[:, 1].min() >= box.y1 for line in below)


def test_a_half_plane_shows_the_axis_from_which_it_goes() -> None:
    ring = turned([(12, 0), (20, 0), (20, 30), (12, 30), (12, 0)], 1.0, 60)
    half = fit_section(ring, half_plane_cut(0.0))
    whole = fit_section(ring, plane_cut([0, 1, 0], 0.0))
    assert half.box[0, 0] == pytest.approx(12, abs=0.05)
    document = _dxf(write_section_dxf([whole, half], "R2010", {}))
    rings = document.modelspace().query('LWPOLYLINE[layer=="TURNSCAN_SECTION_MEASURED_MM"]')
    right = max(p[0] for e in rings for p in e)
    left = max(p[0] for e in rings for p in e if p[0] < right - 10)
    lines = document.modelspace().query('LINE[layer=="TURNSCAN_SECTION_DIMENSIONS_MM"]')
    ends = [np.array([(e.dxf.start.x, e.dxf.start.y), (e.dxf.end.x, e.dxf.end.y)]) for e in lines]
    axis = [e[:, 1] for e in ends if np.allclose(e[:, 0], right - 20, atol=0.05)]
    assert min(map(np.min, axis)) < -0.5
    assert max(map(np.max, axis)) > 30.5
    assert right - 20 > left, "the axis stands beside the other section, not in it"
    assert not [e for e in ends if np.allclose(e[:, 0], left - 20)], "a plane has no axis"
    root = ET.fromstring(write_section_svg([half], "ring", {}).decode())
    paths = [p.get("d", "") for p in root.iter(f"{SVG}path") if p.get("class") == "dimensions"]
    strokes = [np.array(re.findall(r"-?\d+\.\d+", d), float).reshape(-1, 2) for d in paths]
    dashes = [s for s in strokes if len(s) == 2 and s[0, 0] == s[1, 0]]
    places = {x: sum(s[0, 0] == x for s in dashes) for x in {float(s[0, 0]) for s in dashes}}
    x, many = max(places.items(), key=lambda o: o[1])
    assert many > 8
    assert 10 < x < 287
    fitted = [p.get("d", "") for p in root.iter(f"{SVG}path") if p.get("class") == "fitted"]
    walls = [float(n) for d in fitted for n in re.findall(r"M(-?[\d.]+),", d)]
    assert (min(walls) - x) / (max(walls) - x) == pytest.approx(12 / 20, abs=0.01)


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [(40.01234, 0.0123, "40.012 ±0.012"), (40.0, float("nan"), "40.000"),
     (1.0, 1e-9, "1.0000 ±0.0001"),
     (123.4, 2.3, "123.4 ±2.3"), (12.3456, 0.00456, "12.3456 ±0.0046")],
)  # fmt: skip
def test_figures_end_with_their_uncertainty(value: float, sigma: float, text: str) -> None:
    assert with_sigma(value, sigma) == text
