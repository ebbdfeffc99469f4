"""Comparing with a CAD part: alignment by shape and by datums, features, tolerances, maps."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from tests.needs import needs
from tests.once import once
from tests.shapes.solids import noisy, prism
from turnscan.cli import turnscan
from turnscan.drawings import Solid, read_step, write_step
from turnscan.errors import FormatError, InputError
from turnscan.formats import export
from turnscan.mesh import Mesh, submesh
from turnscan.progress import no_progress
from turnscan.rig import Pose, rotation_from_vector
from turnscan.workflows import Comparison, compare, read_mesh_file
from turnscan.workflows._inspection._compared_features import Check, overall, unmet
from turnscan.workflows._inspection._tolerances import (
    Tolerance,
    limits_of,
    read_tolerances,
    verdict,
)
from turnscan.workflows._surface._nominal import nominal, with_features

NOISE = 0.01
BORE, WORN = 12.0, 12.06
"""mm: diameter as drawn, and as it is."""
MOVED = Pose(rotation_from_vector(np.array([0.9, -0.4, 1.7])), np.array([10.0, -30.0, 55.0]))


def _bracket(bore: float) -> Solid:
    """An L of 40 × 30 × 24 mm with a bore, in OpenCASCADE; no symmetry but the mirror's."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    foot = BRepPrimAPI_MakeBox(40.0, 30.0, 8.0).Shape()
    wall = BRepPrimAPI_MakeBox(10.0, 30.0, 24.0).Shape()
    axis = gp_Ax2(gp_Pnt(27.0, 13.0, -1.0), gp_Dir(0.0, 0.0, 1.0))
    hole = BRepPrimAPI_MakeCylinder(axis, bore / 2, 10.0).Shape()
    whole = BRepAlgoAPI_Cut(BRepAlgoAPI_Fuse(foot, wall).Shape(), hole).Shape()
    return Solid(whole, 0.0, 0)


def _make(folder: Path) -> None:
    (folder / "part.step").write_bytes(write_step(_bracket(BORE), "bracket", {}))
    drawn = read_step((folder / "part.step").read_bytes(), 0.01).mesh
    (folder / "part.stl").write_bytes(export(drawn, ".stl"))
    worn = read_step(write_step(_bracket(WORN), "worn", {}), 0.002).mesh
    v, f = trimesh.remesh.subdivide_to_size(worn.vertices, worn.faces, 1.8, max_iter=12)
    v, same = np.unique(np.round(v, 9), axis=0, return_inverse=True)
    mesh = noisy(Mesh(v, same.reshape(-1)[f]), NOISE, 3)
    moved = Mesh(MOVED.apply(mesh.vertices), mesh.faces)
    (folder / "got.ply").write_bytes(export(moved, ".ply"))


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    needs("OpenCASCADE")
    return once(tmp_path_factory, "compare-cad", _make)


@pytest.fixture(scope="module")
def told(parts: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Comparison, Path]:
    """By datums, which need the alignment by shape first, with a table of tolerances."""
    table = tmp_path_factory.mktemp("table") / "limits.csv"
    rows = ["feature,quantity,tolerance", "*,*,ISO 2768-m", "*,profile,0.1"]
    number = _bore(parts / "part.step")
    table.write_text("\n".join([*rows, f"{number},diameter,H7"]) + "\n")
    datums = _datums(parts / "part.step")
    found = compare(
        parts / "got.ply", parts / "part.step", align="datums", datums=datums,
        tolerance_table=table,
    )  # fmt: skip
    return found, table


def _bore(path: Path) -> int:
    shapes = with_features(nominal(path, "mm", no_progress)).shapes
    (k,) = [k for k, s in enumerate(shapes) if s.kind == "cylinder"]
    return k + 1


def _datums(path: Path) -> Sequence[int]:
    """The bottom, the back, a side: z, x and y."""
    shapes = nominal(path, "mm", no_progress).shapes
    sides = [(k + 1, s.axis) for k, s in enumerate(shapes) if s.kind == "plane"]
    ways = ([0, 0, -1], [-1, 0, 0], [0, -1, 0])
    return tuple(next(k for k, axis in sides if axis @ way > 1 - 1e-9) for way in ways)


def _error(found: Comparison) -> tuple[float, float]:
    """Radians and mm (of the part's middle) by which the alignment is off."""
    e = found.placement.pose @ MOVED
    turn = float(np.arccos(np.clip((np.trace(e.rotation) - 1) / 2, -1, 1)))
    middle = np.array([[20.0, 15.0, 8.0]])
    return turn, float(np.linalg.norm(e.apply(middle) - middle))


def test_step_and_stl_of_a_part_show_the_same_features(parts: Path) -> None:
    step = nominal(parts / "part.step", "mm", no_progress)
    stl = with_features(nominal(parts / "part.stl", "mm", no_progress))
    assert [s.kind for s in step.shapes].count("plane") == 8
    for one, other in zip(step.shapes, stl.shapes, strict=True):
        assert (one.kind, one.hollow) == (other.kind, other.hollow)
        assert one.area == pytest.approx(other.area, rel=2e-3)
        assert one.radius == pytest.approx(other.radius, rel=1e-5)
    bore = step.shapes[_bore(parts / "part.step") - 1]
    assert bore.hollow
    assert bore.radius == pytest.approx(BORE / 2, rel=1e-12)


def test_a_face_without_area_joins_no_planes() -> None:
    """A side that is cut on the top and whole on the front, with a sliver that closes the gap."""
    corners = [[x, y, z] for z in (0, 10) for x, y in ((0, 0), (30, 0), (30, 20), (0, 20))]
    bottom, top = [[0, 2, 1], [0, 3, 2]], [[4, 8, 7], [8, 5, 6], [8, 6, 7]]
    sides = [[i, j, j + 4] for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    sides += [[i, j + 4, i + 4] for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    faces = np.array([*bottom, *top, *sides, [4, 5, 8]], dtype=np.int32)
    mesh = Mesh(np.array([*corners, [15, 0, 10]], dtype=float), faces)
    shapes = with_features(nominal(mesh, "mm", no_progress)).shapes
    assert [round(s.area) for s in shapes] == [600, 600, 300, 300, 200, 200]
    assert all(np.abs(s.axis).max() == pytest.approx(1) for s in shapes)


def test_datums_hold_and_leave_the_bore_where_it_is(told: tuple[Comparison, Path]) -> None:
    found, _ = told
    turn, off = _error(found)
    assert turn < 1e-4
    assert off < 3 * NOISE / 10  # some hundred points on each of the three sides
    assert found.placement.figures["freedoms_taken"] == [3, 2, 1]


def test_the_worn_bore_fails_and_the_rest_keeps_its_tolerances(
    told: tuple[Comparison, Path],
) -> None:
    found, _ = told
    diameter = next(c for c in found.checks if c.quantity == "diameter")
    assert diameter.nominal == pytest.approx(BORE, rel=1e-12)
    assert abs(diameter.measured - WORN) < 4 * diameter.sigma + 0.001
    assert diameter.sigma < 0.005
    assert (diameter.tolerance, diameter.verdict) == ("H7", "fail")
    distances = [c for c in found.checks if c.quantity == "distance"]
    assert len(distances) >= 5
    assert {c.verdict for c in distances} == {"pass"}
    for c in distances:
        assert abs(c.off) < 4 * c.sigma
    profiles = {c.features[0]: c for c in found.checks if c.quantity == "profile"}
    assert profiles[diameter.features[0]].measured == pytest.approx(WORN - BORE, abs=3 * NOISE)
    assert found.verdict == "fail"


def test_alignment_by_shape_on_a_mesh_is_no_worse_than_the_noise(parts: Path) -> None:
    found = compare(parts / "got.ply", parts / "part.stl", align="shape")
    turn, off = _error(found)
    assert turn < 2e-4
    assert off < NOISE / 2
    assert found.placement.figures["undetermined"] == []
    x, y, _ = found.mesh.vertices.T
    beside = found.every.distance[np.hypot(x - 27, y - 13) > 8]  # the bore is worn
    assert 0.9 * NOISE < np.sqrt(np.mean(beside**2)) < 1.1 * NOISE


def test_files_of_the_command(told: tuple[Comparison, Path], parts: Path, tmp_path: Path) -> None:
    _, table = told
    names = [tmp_path / n for n in ("map.ply", "map.glb", "r.csv", "map.png")]
    datums = [x for n in _datums(parts / "part.step") for x in ("--datum", str(n))]
    done = CliRunner().invoke(
        turnscan,
        ["compare", str(parts / "got.ply"), str(parts / "part.step"), "--align", "datums", *datums,
         "--tolerance-table", str(table), "-o", str(names[0]), "-o", str(names[1]),
         "--report", str(names[2]), "--picture", str(names[3]), "--json"],
    )  # fmt: skip
    assert done.exit_code == 1, done.output  # the bore
    figures = json.loads(done.stdout)
    assert (figures["alignment"]["by"], figures["verdict"]) == ("datums", "fail")
    ply, glb = (read_mesh_file(n) for n in names[:2])
    assert ply.colour is not None
    assert glb.colour is not None
    assert len(np.unique(ply.colour, axis=0)) > 100
    rows = list(csv.DictReader(names[2].read_text().splitlines()))
    assert len(rows) == len(figures["checks"])
    assert next(r for r in rows if r["quantity"] == "diameter")["verdict"] == "fail"
    assert names[3].read_bytes().startswith(b"\x89PNG")


def test_a_page_shows_the_table(told: tuple[Comparison, Path], tmp_path: Path) -> None:
    told[0].save_report(tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text()
    assert "aligned by datums" in page
    assert "Tolerances: fail" in page
    assert page.count("<img") == 1


def test_surfaces_apart_are_told_and_aligned_only_when_asked(parts: Path) -> None:
    found = compare(parts / "got.ply", parts / "part.stl")
    (finding,) = [f for f in found.findings if f.code == "compare.frames"]
    assert str(finding.remedy) == "bring them together by align=shape"
    assert np.array_equal(found.placement.pose.rotation, np.eye(3))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"align": "datums"}, "no datum is given"),
        ({"align": "datums", "datums": (99,)}, "features 1 to 9"),
        ({"align": "datums", "datums": (1, 1)}, "features 1 to 9"),
    ],
)
def test_datums_that_cannot_be(parts: Path, changes: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        compare(parts / "got.ply", parts / "part.step", **changes)  # type: ignore[arg-type]


def test_a_reference_in_inches_is_suspected(parts: Path, tmp_path: Path) -> None:
    drawn = read_mesh_file(parts / "part.stl")
    small = tmp_path / "inch.stl"
    small.write_bytes(export(Mesh(drawn.vertices / 25.4, drawn.faces), ".stl"))
    with pytest.raises(InputError, match="is too small for the part") as caught:
        compare(parts / "got.ply", small, align="shape")
    assert "reference_unit=inch" in str(caught.value.hint)
    (said,) = [f for f in compare(parts / "got.ply", small).findings if f.code == "compare.unit"]
    assert "reference_unit=inch" in str(said.remedy)
    right = compare(parts / "got.ply", small, align="shape", reference_unit="inch")
    assert not [f for f in right.findings if f.code == "compare.unit"]


def _box(draft: float, noise: float, seed: int) -> Mesh:
    """Walls of 30 × 20 × 10 mm, one of them turned by ``draft`` radians from square."""
    out = 20 * np.tan(draft)
    return noisy(prism([(0, 0), (30, 0), (30 + out, 20), (0, 20)], 10, 0.7), noise, seed)


def test_what_is_measured_is_not_made_square_or_parallel() -> None:
    """Relations that `find_shapes` adopts within the noise would leave no uncertainty."""
    found = compare(_box(0.0, 0.02, 1), _box(0.0, 0.0, 0), features=True)
    angles = [c for c in found.checks if c.quantity == "angle"]
    assert len(angles) == 4
    for c in angles:
        assert 0.002 < c.sigma < 0.02  # 0.02 mm over √400 points of walls 10 mm high and 30 long
        assert abs(c.off) < 4 * c.sigma


def test_datums_do_not_hide_that_a_part_is_symmetric() -> None:
    found = compare(_box(0.0, 0.02, 1), _box(0.0, 0.0, 0), align="datums", datums=(1, 3))
    assert found.placement.figures["other_ways"] == 3
    codes = [f.code for f in found.findings]
    assert codes == ["compare.symmetric", "compare.free", "compare.datums"]


def test_faces_with_a_draft_have_an_angle_and_no_distance() -> None:
    drawn = _box(np.radians(2.0), 0.0, 0)
    found = compare(_box(np.radians(2.0), 0.02, 1), drawn, features=True)
    (distance,) = [c for c in found.checks if c.quantity == "distance"]
    assert distance.nominal == pytest.approx(20.0)
    assert {round(c.nominal) for c in found.checks if c.quantity == "angle"} == {88, 90, 92}


def test_surfaces_without_area_are_refused_in_one_line() -> None:
    box = _box(0.0, 0.0, 0)
    nothing = replace(box, measured=np.zeros(len(box.faces), dtype=np.bool_))
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], dtype=np.int32))
    for one, other in ((nothing, box), (flat, box), (box, flat)):
        with pytest.raises(InputError, match="no measured face that has an area"):
            compare(one, other, align="shape")


def test_a_profile_tells_a_wave_from_noise_and_fails_no_perfect_face(tmp_path: Path) -> None:
    flat = _box(0.0, 0.0, 0)
    table = tmp_path / "t.csv"
    x = flat.vertices[:, 0]
    wavy = Mesh(flat.vertices + np.outer(0.1 * np.sin(x * 0.6), [0, 1, 0]), flat.faces)
    for part, width, allowed in (
        (wavy, 0.1, {"fail"}),
        (_box(0.0, 0.02, 1), 0.01, {"undecided"}),
        (_box(0.0, 0.02, 1), 0.1, {"pass"}),
    ):
        table.write_text(f"*,profile,{width}\n")
        found = compare(part, flat, tolerance_table=table)
        said = {c.features[0]: c for c in found.checks if c.quantity == "profile"}
        assert len(said) == 4
        assert {said[number].verdict for number in (1, 2)} == allowed  # the long walls
    sparse = _box(0.0, 0.0, 0)
    few = submesh(sparse, sparse.triangles[:, :, 2].max(axis=1) < 0.8)
    lost = compare(few, flat, tolerance_table=table)
    assert [c for c in lost.checks if c.quantity == "profile"] == []
    assert lost.verdict == "undecided"


def test_faces_across_an_undetermined_motion_have_no_profile(tmp_path: Path) -> None:
    """Four walls slide in a closed box: how far they lie from its ends is chance."""
    box = trimesh.creation.box(
        (30, 20, 10), trimesh.transformations.translation_matrix((15, 10, 5))
    )
    drawn = Mesh(np.asarray(box.vertices), np.asarray(box.faces))
    shapes = with_features(nominal(drawn, "mm", no_progress)).shapes
    ends = [k + 1 for k, s in enumerate(shapes) if abs(s.axis[2]) > 0.5]
    table = tmp_path / "t.csv"
    table.write_text("*,profile,1\n")
    walls = _box(0.0, 0.02, 1)
    slid = Mesh(walls.vertices * [1, 1, 1.1] + [0, 0, 0.3], walls.faces)
    found = compare(slid, drawn, align="shape", tolerance_table=table)
    said = {c.features[0]: c.verdict for c in found.checks if c.quantity == "profile"}
    assert said == {number: "pass" for number in range(1, 7) if number not in ends}
    (adrift,) = [f for f in found.findings if f.code == "compare.adrift"]
    assert adrift.message.startswith(f"features {ends[0]}, {ends[1]} lie across")
    assert found.verdict == "undecided"
    held = compare(slid, drawn, align="none", tolerance_table=table)
    assert not [f for f in held.findings if f.code == "compare.adrift"]


def test_a_row_of_a_feature_that_the_part_lacks_is_an_error_before_anything_is_compared(
    tmp_path: Path,
) -> None:
    flat = _box(0.0, 0.0, 0)
    table = tmp_path / "t.csv"
    table.write_text("*,profile,0.1\n1-99,distance,±0.1\n")
    with pytest.raises(InputError, match=r"1-99,distance,±0.1: .* has features 1 to 4 →") as told:
        compare(flat, flat, tolerance_table=table)
    assert told.value.option is not None
    assert told.value.option.name == "tolerance_table"


# Tolerances


def test_a_size_that_the_standard_says_nothing_of_is_named(parts: Path) -> None:
    reference = with_features(nominal(parts / "part.step", "mm", no_progress))
    large = Check((1, 2), "distance", 2400.0, 2400.1, 0.01, "mm")
    every = Tolerance((), "*", "ISO 2768-m")
    coaxial = Check((1, 2), "axis distance", 0.0, 0.01, 0.01, "mm")
    (said,) = [f for f in unmet(reference, [large, coaxial], [every]) if "2400" in f.message]
    assert "no verdict, ISO 2768-m says nothing of 2400 mm" in said.message
    assert overall([large], [said]) == "undecided"


@pytest.mark.parametrize(
    ("text", "nominal", "limits"),
    [  # ISO 286-2 and ISO 2768-1
        ("H7", 20.0, (0.0, 0.021)),
        ("H7", 18.0, (0.0, 0.018)),
        ("h6", 50.0, (-0.016, 0.0)),
        ("g6", 25.0, (-0.020, -0.007)),
        ("F8", 40.0, (0.025, 0.064)),
        ("e8", 80.0, (-0.106, -0.060)),
        ("D9", 100.0, (0.120, 0.207)),
        ("js9", 12.0, (-0.0215, 0.0215)),
        ("ISO 2768-m", 30.0, (-0.2, 0.2)),
        ("2768-fH", 30.1, (-0.15, 0.15)),
        ("ISO 2768-v", 500.0, (-4.0, 4.0)),
        ("±0.05", 7.0, (-0.05, 0.05)),
        ("+0.2 -0.1", 7.0, (-0.1, 0.2)),
        ("-0.1/-0.3", 7.0, (-0.3, -0.1)),
        ("0.3", 7.0, (-0.3, 0.3)),
        ("H7", 10.000000000000002, (0.0, 0.015)),  # a step ends at 10, whatever arithmetic adds
        ("H7", 500.0000001, (0.0, 0.063)),
        ("H7", 10.001, (0.0, 0.018)),
        ("ISO 2768-m", 30.000000000000004, (-0.2, 0.2)),
    ],
)
def test_limits_of_the_standards(text: str, nominal: float, limits: tuple[float, float]) -> None:
    assert limits_of(text, nominal) == pytest.approx(limits, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "nominal", "said"),
    [
        ("H7", 501.0, "known to 500 mm"),
        ("H19", 20.0, "grades 1 to 18"),
        ("p6", 20.0, "not a tolerance"),
        ("ISO 2768-v", 1.0, "says nothing of 1 mm"),
        ("ISO 2768-m", 0.2, "says nothing of 0.2 mm"),
        ("", 1.0, "not a tolerance"),
    ],
)
def test_what_the_tables_do_not_hold_is_refused(text: str, nominal: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        limits_of(text, nominal)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1,diameter", "line 1: 2 columns"),
        ("x,diameter,H7", "line 1: 'x' is not a number"),
        ("1,width,H7", "line 1: 'width' is not one of"),
        ("1,diameter,tight", "line 1: 'tight' is not a tolerance"),
        ("1,profile,H7", "line 1: 'H7' is not the width"),
        ("# nothing", "no tolerance in it"),
        ("1,diameter," + 150_000 * "1", "not a table"),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, row: str, said: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(row + "\n")
    with pytest.raises(FormatError, match=said):
        read_tolerances(path)


@given(st.floats(-1, 1), st.floats(0, 0.5), st.floats(0.001, 0.8))
def test_a_verdict_leaves_no_doubt(off: float, sigma: float, width: float) -> None:
    said = verdict(off, sigma, (-width, width))
    truths = {abs(x) <= width for x in (off - 2 * sigma, off, off + 2 * sigma)}
    if said == "pass":
        assert truths == {True}
    if said == "fail":
        assert truths == {False}
    if said == "undecided":
        assert sigma > 0
        assert len(truths) == 2 or 2 * sigma > width
