"""STEP: a solid of analytic faces where shapes close, triangles where they do not."""

from __future__ import annotations

import io
import json
import re
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.needs import needs
from tests.shapes.solids import closed_box, noisy, prism, turned
from turnscan.arrays import Floats
from turnscan.cli import main, turnscan
from turnscan.drawings import (
    Colour,
    ShellMaker,
    Solid,
    StepPart,
    _step,
    read_step,
    write_step,
)  # fmt: skip
from turnscan.drawings._parts import middle_and_size, parts_of
from turnscan.drawings._step import faults_in_file
from turnscan.errors import ExportError
from turnscan.formats import read_about, write_ply
from turnscan.mesh import Mesh, submesh
from turnscan.progress import Cancelled, Progress
from turnscan.shapes.patches import Border, Bordering, Borders, Charting, Charts, ShapePatch
from turnscan.workflows._files._reading import step_findings
from turnscan.workflows._inspection._shapes import FoundShapes, find_shapes
from turnscan.workflows._solids import _shapes_step
from turnscan.workflows._solids._shapes_step import iges_of

SHAFT = [(0.5, 0), (25, 0), (25, 20), (15, 20), (15, 40), (0.5, 40)]
AROUND = 120
NAME = "it's */ a shaft"


def _closed(mesh: Mesh, around: int) -> Mesh:
    """With a point in the middle of both ends."""
    n = len(mesh.vertices)
    i = np.arange(around)
    j = (i + 1) % around
    X = np.vstack([mesh.vertices, [[0, 0, mesh.vertices[0, 2]], [0, 0, mesh.vertices[-1, 2]]]])
    low = np.column_stack([j, i, np.full(around, n)])
    high = np.column_stack([n - around + i, n - around + j, np.full(around, n + 1)])
    return Mesh(X, np.concatenate([mesh.faces, low, high]))


@pytest.fixture(scope="module")
def shaft(tmp_path_factory: pytest.TempPathFactory) -> FoundShapes:
    needs("OpenCASCADE")
    mesh = noisy(_closed(turned(SHAFT, 0.9, AROUND), AROUND), 0.01, 1)
    path = tmp_path_factory.mktemp("step") / f"{NAME.replace('/', '')}.ply"
    path.write_bytes(write_ply(mesh))
    return find_shapes(path)


def test_a_solid_is_written_as_iges_and_what_is_none_is_not(
    shaft: FoundShapes, tmp_path: Path
) -> None:
    paths = [tmp_path / "shaft.igs", tmp_path / "again.iges"]
    [finding] = shaft.save(*paths)
    assert "a valid solid of 5 faces" in finding.message
    first, second = (p.read_bytes() for p in paths)
    assert first == second  # neither clock nor file name in it
    assert b"2HMM" in first
    from OCP.IGESControl import IGESControl_Reader

    from turnscan.drawings._parts import parts_of, volume_of

    reader = IGESControl_Reader()
    reader.ReadFile(str(paths[0]))
    reader.TransferRoots()
    back = reader.OneShape()
    assert len(parts_of(back, "solid")) == 1
    assert volume_of(back) == pytest.approx(shaft.step.figures["volume_mm3"], rel=1e-6)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.iges", "shaft.igs"]


def _lumpy(noise: float, rings: int) -> tuple[Mesh, float]:
    """A closed freeform body, no part of it analytic, and its volume, mm³."""
    around = 2 * rings
    u, v = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.pi * (np.arange(rings) + 0.5) / rings
    )

    def radius(u: Floats, v: Floats) -> Floats:
        lobes = 2.5 * np.cos(2 * u) * np.sin(v) ** 2 + 1.5 * np.cos(3 * u + 1) * np.sin(v) ** 3
        return np.asarray(20 + lobes + 2 * np.cos(v) + np.cos(2 * v))

    def places(u: Floats, v: Floats) -> Floats:
        out = [np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)]
        return np.asarray(radius(u, v)[..., None] * np.stack(out, axis=-1))

    low, high = places(np.zeros(1), np.array([np.pi])), places(np.zeros(1), np.zeros(1))
    i, j = (k.ravel() for k in np.meshgrid(np.arange(around), np.arange(rings - 1)))
    a, b = j * around + i, j * around + (i + 1) % around
    n = rings * around
    ring, after = np.arange(around), (np.arange(around) + 1) % around
    faces = [
        np.stack([a, a + around, b + around], axis=1), np.stack([a, b + around, b], axis=1),
        np.stack([n - around + after, n - around + ring, np.full(around, n)], axis=1),
        np.stack([ring, after, np.full(around, n + 1)], axis=1),
    ]  # fmt: skip
    X = np.concatenate([places(u, v).reshape(-1, 3), low, high])
    body = Mesh(X, np.concatenate(faces).astype(np.int32))
    fine = np.pi * (np.arange(400) + 0.5) / 400
    turn = np.arange(400) * 2 * np.pi / 400
    U, V = np.meshgrid(turn, fine)
    volume = float((radius(U, V) ** 3 / 3 * np.sin(V)).sum() * (2 * np.pi / 400) * (np.pi / 400))
    return noisy(body, noise, 1), volume


@pytest.fixture(scope="module")
def lumpy() -> tuple[FoundShapes, float]:
    needs("OpenCASCADE")
    mesh, volume = _lumpy(0.01, 36)
    return find_shapes(mesh, tolerance=0.05), volume


def test_a_freeform_part_is_a_valid_solid_of_splines(lumpy: tuple[FoundShapes, float]) -> None:
    found, volume = lumpy
    step = found.step
    assert step.solid, step.findings
    assert [f.code for f in step.findings] == ["shapes.solid"]
    part = read_step(step.data, 0.05)
    assert (part.solids, part.valid, part.lost) == (1, True, 0)
    assert part.faces == step.figures["faces"]
    assert part.volume == pytest.approx(volume, rel=1e-3)
    assert step.figures["faces_bspline"] >= 6
    assert step.figures["triangles"] == 0
    # Noise, and nothing of it in the surface: neither followed nor smoothed over.
    assert 0.007 < step.figures["deviation_rms_mm"] < 0.015
    assert b"B_SPLINE_SURFACE" in step.data


def _paints(reader: Any, name: str) -> Counter[Colour | None]:
    """The colours of the faces that a reader of OpenCASCADE finds, and how many have each."""
    from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFApp import XCAFApp_Application
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    from turnscan.drawings._parts import parts_of

    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    reader.SetColorMode(True)
    assert reader.Transfer(document), name
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    paints = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    seen: Counter[Colour | None] = Counter()
    for face in parts_of(shapes.GetOneShape(), "face"):
        colour = Quantity_Color()
        kinds = (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen)
        there = any(paints.GetColor(face, kind, colour) for kind in kinds)
        red, green, blue = (round(255 * x) for x in colour.Values(Quantity_TOC_sRGB))
        seen[(red, green, blue) if there else None] += 1
    return seen


def test_faces_have_the_colour_of_their_deviation(
    lumpy: tuple[FoundShapes, float], tmp_path: Path
) -> None:
    from OCP.IGESCAFControl import IGESCAFControl_Reader
    from OCP.STEPCAFControl import STEPCAFControl_Reader

    step = lumpy[0].step
    off = step.deviations
    assert off is not None
    assert step.made is not None
    wanted = Counter(off.colours.values())
    assert len(wanted) > 1
    caf = STEPCAFControl_Reader()
    caf.ReadStream("part.step", io.BytesIO(step.data))
    assert _paints(caf, "STEP") == wanted
    path = tmp_path / "part.igs"
    path.write_bytes(iges_of(step.made, "part"))
    iges = IGESCAFControl_Reader()
    iges.ReadFile(str(path))
    assert _paints(iges, "IGES") == wanted
    told = read_about(step.data)
    assert "positive outside" in str(told["face_colours"])
    means = [f.mean_mm for f in off.faces if f.points]
    assert max(map(abs, means)) <= 3.5 * off.width
    for face in off.faces:
        red, _, blue = off.colours[face.face - 1]
        if abs(face.mean_mm) > off.width:
            assert (red > blue) == (face.mean_mm > 0)


def test_the_report_has_the_legend(lumpy: tuple[FoundShapes, float], tmp_path: Path) -> None:
    found, _ = lumpy
    found.save(tmp_path / "lumpy.step")
    found.save_report(tmp_path / "r.html")
    found.save_report(tmp_path / "r.json")
    text = (tmp_path / "r.html").read_text()
    assert "colour of a face" in text
    assert "not measured" in text
    rows = json.loads((tmp_path / "r.json").read_text())["step"]["face_deviations"]
    assert len(rows) == found.step.figures["faces"]
    assert sum(r["points"] for r in rows) == len(found.mesh.vertices)


def test_an_open_freeform_part_is_a_shell_and_says_so(tmp_path: Path) -> None:
    needs("OpenCASCADE")
    t = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    outline = [((12 + 2 * np.cos(3 * a)) * np.cos(a), (12 + np.sin(2 * a)) * np.sin(a)) for a in t]
    freeform = find_shapes(prism(outline, 9, 1.0))
    [finding] = freeform.save(tmp_path / "free.step", tmp_path / "free.igs")
    assert finding.code == "shapes.shell"
    assert "open as the mesh is" in finding.message
    part = read_step((tmp_path / "free.step").read_bytes(), 0.05)
    assert (part.solids, part.valid) == (0, True)
    assert part.mesh.area_of() == pytest.approx(freeform.mesh.area_of(), rel=5e-3)


def test_what_no_surface_fits_stays_triangles_and_iges_is_refused(tmp_path: Path) -> None:
    needs("OpenCASCADE")
    mesh, _ = _lumpy(0.2, 12)
    found = find_shapes(mesh, tolerance=1e-3)
    found = replace(found, surface=found.surface.with_mesh(mesh))
    assert not found.step.solid
    assert found.step.findings[-1].code == "shapes.triangles"
    assert "tolerance" in str(found.step.findings[-1])
    with pytest.raises(ExportError, match="IGES holds no triangles"):
        found.save(tmp_path / "part.ply", tmp_path / "part.igs")
    assert not list(tmp_path.iterdir())


def test_no_solid_of_splines_contradicts_the_volume_of_the_mesh(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    needs("OpenCASCADE")
    mesh, _ = _lumpy(0.01, 8)
    near, far = (Solid(None, times * mesh.volume, 9) for times in (1.005, 0.37))
    assert not _shapes_step._other_volume(mesh, near)
    assert not _shapes_step._other_volume(submesh(mesh, np.arange(len(mesh.faces)) > 0), far)
    shell = SimpleNamespace(charts=(0,), solid=lambda: far)
    whole = SimpleNamespace(label=np.zeros(len(mesh.faces), int))
    monkeypatch.setattr(_shapes_step, "shell_under", lambda *_: (shell, whole))
    step = find_shapes(mesh, tolerance=0.05).step
    assert not step.solid
    [finding] = step.findings
    assert finding.code == "shapes.triangles"
    wanted = f"the volume is {far.volume:.0f} mm³, of the mesh {mesh.volume:.0f} ±"
    assert wanted in finding.message


def _rough() -> Mesh:
    """A lumpy body with a patch that no surface fits."""
    mesh, _ = _lumpy(0.01, 36)
    rough = np.flatnonzero(np.linalg.norm(mesh.vertices - mesh.vertices[1300], axis=1) < 4)
    X = mesh.vertices.copy()
    X[rough] *= 1 + np.random.default_rng(3).normal(0, 0.015, (len(rough), 1))
    return replace(mesh, vertices=X)


@pytest.fixture(scope="module")
def rough() -> FoundShapes:
    needs("OpenCASCADE")
    return find_shapes(_rough(), tolerance=0.05)


def test_edges_and_faces_that_are_known_are_those_that_would_be_made_anew(
    rough: FoundShapes,
) -> None:
    mesh = rough.mesh
    cutting = Charting(mesh, rough.found)
    tracing, maker, charts = Bordering(mesh), ShellMaker(), cutting.charts()
    for _ in range(3):
        borders, fresh = tracing.borders(charts), Bordering(mesh).borders(charts)
        for loops, others in zip(borders.loops, fresh.loops, strict=True):
            a, b = ([borders_of.edges[e] for loop in some for e, _ in loop]
                    for borders_of, some in ((borders, loops), (fresh, others)))  # fmt: skip
            ends = sorted(tuple(np.round(e.places()[[0, -1]].sum(axis=0), 6)) for e in a)
            assert ends == sorted(tuple(np.round(e.places()[[0, -1]].sum(axis=0), 6)) for e in b)
        assert maker.bad(charts, borders) == maker.shell(charts, fresh).bad
        seen = {id(e) for e in borders.edges}
        whole = {*charts.label.tolist()} - charts.facets
        charts = cutting.finer(charts, [min(whole), max(whole)])
        again = {id(e) for e in tracing.borders(charts).edges}
        assert 0.5 * len(seen) < len(seen & again) < len(seen)


def _flat() -> tuple[Charting, Charts, int, int]:
    """Charts of a lumpy body with a flat top, the chart of that, and one beside it."""
    mesh, _ = _lumpy(0.0, 36)
    mesh = noisy(replace(mesh, vertices=np.minimum(mesh.vertices, [99.0, 99.0, 9.0])), 0.01, 1)
    cutting = Charting(mesh, find_shapes(mesh, tolerance=0.05).found)
    charts = cutting.charts()
    flat = next(k for k, p in enumerate(charts.patches) if isinstance(p, ShapePatch))
    beside = cutting.beside[charts.label == flat]
    return cutting, charts, flat, int(max({*charts.label[beside[beside >= 0]].tolist()} - {flat}))


def test_a_plane_loses_faces_where_its_border_is_wrong_and_is_given_up_last() -> None:
    cutting, charts, flat, beside = _flat()
    assert cutting.first_of(charts, frozenset({flat, beside})) == {beside}
    assert cutting.first_of(charts, frozenset({flat})) == {flat}
    own = charts.label == flat
    plane, middle = charts.patches[flat], cutting.mesh.triangles.mean(axis=1)
    at = middle[own][int(np.argmax(middle[own][:, 0]))]
    far = np.linalg.norm(middle - at, axis=1)
    before, times = own.sum(), 0
    while times < 8:
        charts = cutting.finer(charts, [flat], {flat: at[None]})
        left = [k for k, p in enumerate(charts.patches) if p is plane]
        if not left:
            break
        [flat] = left
        on = charts.label == flat
        assert far[on].min() > far[own & ~on].min()
        assert 0.5 * before < on.sum() < before
        assert frozenset(charts.label[own & ~on].tolist()) <= charts.facets
        before, times = on.sum(), times + 1
    assert 1 < times < 6


def test_where_a_border_crosses_itself_or_leaves_its_surface_is_found() -> None:
    needs("OpenCASCADE")
    _, charts, flat, _ = _flat()
    z = float(charts.patches[flat].origin[2])
    bow = np.array([[0, 0, z], [5, 5, z], [5, 0, z], [0, 5, z], [0, 0, z + 1]], dtype=float)
    knots = np.array([0.0, 0.0, 7.0, 12.0, 19.0, 24.0, 24.0])
    border = Border(0, 1, knots, bow, 1, 0.0)
    loops = [((0, True),) if k == flat else () for k in range(len(charts.patches))]
    borders = Borders(bow[[0, -1]], (border,), tuple((loop,) if loop else () for loop in loops))
    places = ShellMaker().wrong_places(charts, borders, flat)
    assert np.linalg.norm(places - [2.5, 2.5, z], axis=1).min() < 0.1
    assert np.linalg.norm(places - bow[-1], axis=1).min() < 1e-9
    assert len(places) == 3


def test_making_a_solid_tells_how_far_it_is_and_can_be_cancelled(
    rough: FoundShapes, tmp_path: Path
) -> None:
    found = replace(rough)  # which has no file yet
    told = list[float]()
    late = Progress(lambda fraction, _: told.append(fraction), lambda: len(told) > 3)
    with pytest.raises(Cancelled):
        found.save(tmp_path / "part.step", progress=late)
    assert not list(tmp_path.iterdir())
    found.save(tmp_path / "part.step", progress=Progress(lambda fraction, _: told.append(fraction)))
    assert told[4:] == sorted(told[4:])
    assert len(told) > 8


def test_where_no_surface_fits_triangles_close_the_solid(
    rough: FoundShapes, tmp_path: Path
) -> None:
    mesh, found = rough.mesh, rough
    step = found.step
    assert step.solid, step.findings
    alone = step.figures["faces_triangles"]
    assert 10 < alone < 0.5 * len(mesh.faces)
    assert f"{alone} triangles of the mesh where no surface fits" in step.findings[0].message
    assert step.figures["triangles"] == 0
    part = read_step(step.data, 0.05)
    assert (part.solids, part.valid, part.faces) == (1, True, step.figures["faces"])
    assert part.volume == pytest.approx(found.mesh.volume, rel=3e-3)
    off = step.deviations
    assert off is not None
    assert len(off.faces) == step.figures["faces"] - alone
    assert list(off.colours.values()).count((255, 255, 255)) == alone
    assert ("white", "triangle of the mesh") in list(off.legend())
    found.save(tmp_path / "part.igs")
    assert (tmp_path / "part.igs").stat().st_size > 1000


def test_two_bodies_are_two_solids_and_a_cavity_is_none() -> None:
    needs("OpenCASCADE")
    mesh, volume = _lumpy(0.01, 36)
    n = len(mesh.vertices)
    vertices = [mesh.vertices, mesh.vertices + [60.0, 0.0, 0.0], 0.4 * mesh.vertices]
    faces = [mesh.faces, mesh.faces + n, mesh.faces[:, ::-1] + 2 * n]
    step = find_shapes(Mesh(np.concatenate(vertices), np.concatenate(faces)), tolerance=0.05).step
    assert step.figures["solids"] == 2, step.findings
    assert "2 valid solids" in step.findings[0].message
    assert step.figures["volume_mm3"] == pytest.approx((2 - 0.4**3) * volume, rel=3e-3)


def test_a_body_that_faces_inward_within_no_other_is_said_to_be_why_there_is_no_solid() -> None:
    needs("OpenCASCADE")
    mesh, _ = _lumpy(0.01, 36)
    vertices = np.concatenate([mesh.vertices, 0.8 * mesh.vertices + [60.0, 0.0, 0.0]])
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + len(mesh.vertices)])
    step = find_shapes(Mesh(vertices, faces), tolerance=0.05).step
    assert not step.solid
    assert "a body of the mesh faces inward and lies within no other" in step.findings[0].message


def test_a_floor_that_was_filled_with_the_wall_above_it_closes_the_solid() -> None:
    needs("OpenCASCADE")
    mesh = noisy(_closed(turned(SHAFT, 0.9, AROUND), AROUND), 0.01, 1)
    filled = mesh.triangles[..., 2].min(axis=1) < 0.5
    step = find_shapes(replace(mesh, measured=~filled)).step
    assert step.solid, step.findings
    assert step.figures["faces"] == 5
    assert step.figures["faces_not_measured"] == 1
    truth = np.pi * (25**2 * 20 + 15**2 * 20)
    assert step.figures["volume_mm3"] == pytest.approx(truth, rel=1e-3)


@pytest.mark.parametrize("seen", [6.0, 12.0, 23.0])
def test_a_face_that_is_mostly_hidden_goes_on_to_where_the_others_end_it(seen: float) -> None:
    """Of the lid of a box a strip was measured, the rest is open."""
    needs("OpenCASCADE")
    mesh = noisy(closed_box(), 0.003, 1)
    t = mesh.triangles
    hidden = (t[..., 2].min(axis=1) > 11.5) & (t[..., 0].max(axis=1) > seen + 0.5)
    step = find_shapes(replace(mesh, faces=mesh.faces[~hidden])).step
    assert step.solid, step.findings
    assert step.figures["faces"] == 6
    # Six planes, each known to a third of the noise or better: 1 µm on 1728 mm² are 1.7 mm³.
    assert step.figures["volume_mm3"] == pytest.approx(24 * 16 * 12, abs=5)
    assert step.figures["volume_mm3"] != pytest.approx(24 * 16 * 12, abs=1e-6)


def test_an_open_mesh_has_no_solid_that_lacks_a_part_of_it() -> None:
    needs("OpenCASCADE")
    mesh = noisy(_closed(turned(SHAFT, 0.9, AROUND), AROUND), 0.01, 1)
    shoulder = (np.abs(mesh.triangles[..., 2] - 20) < 0.1).all(axis=1)
    step = find_shapes(replace(mesh, faces=mesh.faces[~shoulder])).step
    assert not step.solid
    assert step.findings[0].code == "shapes.shell"


def test_a_shaft_is_a_valid_solid_of_its_five_faces(shaft: FoundShapes) -> None:
    step = shaft.step
    assert step.solid
    part = read_step(step.data, 0.01)
    assert (part.solids, part.valid) == (1, True)
    truth = np.pi * (25**2 * 20 + 15**2 * 20)
    assert part.volume == pytest.approx(truth, rel=4e-4)
    assert part.volume != pytest.approx(truth, rel=1e-9)  # measured, not drawn
    assert step.figures["faces"] == 5
    assert step.figures["faces_not_measured"] == 0
    # The points' noise, and no more: what a chord of the mesh leaves out is not in it.
    assert 0.008 < step.figures["deviation_rms_mm"] < 0.014
    text = step.data.decode("ascii")
    assert text.count("CYLINDRICAL_SURFACE(") == 2
    assert text.count("= PLANE(") == 3
    assert "AP242" in text
    assert ".MILLI." in text


def test_a_solid_whose_facets_were_looked_at_is_written_once(
    shaft: FoundShapes, lumpy: tuple[FoundShapes, float]
) -> None:
    for part in (shaft, lumpy[0]):
        solid = part.step.made
        assert solid is not None
        facets = solid.facets(0.05)
        data = write_step(solid, "part", {})
        assert b"TESSELLATED" not in data
        assert read_step(data).solids == 1
        again = solid.facets(0.05)
        assert len(again.mesh.faces) == len(facets.mesh.faces)


def test_it_says_where_it_comes_from_and_holds_no_date(shaft: FoundShapes) -> None:
    about = {"source": NAME, "parameters": {"größe": "a'b\\c"}}
    name = "d'Ä"
    data = write_step(shaft.mesh, name, about)
    told = read_about(data)
    assert {k: told[k] for k in about} == about
    assert data == write_step(shaft.mesh, name, about)
    text = data.decode("ascii")
    assert r"PRODUCT('d''\X4\000000C4\X0\','d''\X4\000000C4\X0\'" in text
    assert re.search(r"FILE_NAME\('[^,]*','',", text)


def test_an_open_block_is_a_shell_of_its_planes_and_says_why(tmp_path: Path) -> None:
    needs("OpenCASCADE")
    block = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 1.0), 0.02, 1)
    source, out = tmp_path / "block.ply", tmp_path / "block.step"
    source.write_bytes(write_ply(block))
    done = CliRunner().invoke(turnscan, ["export", str(source), "-o", str(out)])
    assert done.exit_code == 0, done.output
    assert "shapes.shell" in done.output
    assert "do not close to a solid" in done.output
    part = read_step(out.read_bytes(), 0.1)
    assert (part.solids, part.valid, part.faces) == (0, True, 4)
    assert {s.kind for s in part.shapes} == {"plane"}
    assert part.mesh.area_of() == pytest.approx(2 * (40 + 30) * 20, rel=2e-3)


def test_both_doors_write_the_same_solid(shaft: FoundShapes, tmp_path: Path) -> None:
    one, other = tmp_path / "one.step", tmp_path / "other.stp"
    (remark,) = shaft.save(one)
    assert remark.code == "shapes.solid"
    done = ts.export(shaft.name, other)
    assert [f.code for f in done.remarks] == ["shapes.solid"]
    shaft.save_report(tmp_path / "r.json")
    assert json.loads((tmp_path / "r.json").read_text())["step"]["faces"] == 5
    a, b = (read_step(p.read_bytes(), 0.1) for p in (one, other))
    assert a.volume == pytest.approx(b.volume, rel=1e-6)


@pytest.mark.parametrize("verb", ["shapes", "export"])
def test_without_opencascade_one_line_says_what_to_install(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "OCP", None)
    source, out = tmp_path / "block.ply", tmp_path / "block.step"
    source.write_bytes(write_ply(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 5.0)))
    monkeypatch.setattr("sys.argv", ["turnscan", verb, str(source), "-o", str(out)])
    with pytest.raises(SystemExit) as end:
        main()
    error = capsys.readouterr().err
    assert end.value.code == 2
    assert len(error.splitlines()) == 1, error
    assert "turnscan[cad]" in error
    assert not out.exists()


def test_faces_without_triangles_and_faults_are_said() -> None:
    part = StepPart(1, False, 0.0, Mesh(np.eye(3), [[0, 1, 2]]), (), np.zeros(1, np.int32), 2)
    lost, faults = step_findings(part, Path("folder/part.step"))
    assert "part.step: OpenCASCADE makes no triangles of 2 of its faces" in lost.message
    assert faults.code == "step.faults"
    assert not step_findings(replace(part, valid=True, lost=0), Path("part.step"))


@pytest.mark.parametrize("change", ["parted", "left out"])
def test_a_face_that_a_reader_parts_or_leaves_out_is_named_whatever_the_order(
    change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt
    from OCP.TopoDS import TopoDS_Compound

    box = BRepPrimAPI_MakeBox(30.0, 20.0, 10.0).Shape()
    solid = Solid(box, 6000.0, 6)
    assert faults_in_file(solid) == ()
    made = parts_of(box, "face")
    (top,) = (k for k, f in enumerate(made) if middle_and_size(f)[2] == pytest.approx(10.0))
    floor = gp_Pln(gp_Ax3(gp_Pnt(0, 0, 10), gp_Dir(0, 0, 1)))
    ends = ((0.0, 29.0), (29.0, 30.0))
    pieces = [BRepBuilderAPI_MakeFace(floor, a, b, 0.0, 20.0).Face() for a, b in ends]
    there = [f for k, f in enumerate(made) if k != top]
    read, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(read)
    for face in [*(pieces if change == "parted" else []), *reversed(there)]:
        builder.Add(read, face)
    monkeypatch.setattr(_step, "_shape_in", lambda data: read)
    assert faults_in_file(solid) == (top,)


def test_iges_without_a_temporary_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Plain:
        def iges(self, name: str) -> bytes:
            return name.encode()

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    with pytest.raises(ExportError, match="no temporary file"):
        iges_of(Plain(), "part")  # type: ignore[arg-type]
