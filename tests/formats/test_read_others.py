"""Files that we did not write: read, or refused by name."""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats.parts import box_with_hole, measured, outside
from turnscan.arrays import Floats
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.formats import EXPORTERS, ExportOptions, export, read_mesh
from turnscan.mesh import is_closed


def test_files_of_others_are_read_or_refused_by_name(shared_data: Path) -> None:
    read = {}
    for path in sorted([*(shared_data / "parts").iterdir(), *(shared_data / "dxf").rglob("*.*")]):
        if path.suffix.lower() in EXPORTERS:
            try:
                read[path.name] = read_mesh(path.read_bytes(), path.suffix)
            except InputError:
                continue
    assert len(read["3dface.dxf"].faces) >= 46
    sphere = read["unit_sphere.STL"]
    assert sphere.volume == pytest.approx(
        4 / 3 * np.pi * (np.ptp(sphere.vertices[:, 0]) / 2) ** 3, rel=0.05
    )
    closed = [m for m in read.values() if 2 * len(m.vertices) - len(m.faces) == 4]
    assert closed, "no part of genus 0: corners were not joined"


PLY = """ply
format ascii 1.0
comment by another program
obj_info scanned
element vertex 5
property float x
property float y
property float z
property uchar flag
element face 2
property list uchar uint vertex_index
property float quality
element edge 0
property int a
end_header
0 0 0 7
1 0 0 7

1 1 0 7
0 1 0 7
0 0 1e0 7
4 0 1 2 3 0.5
3 0 1 4 .25
"""


@pytest.mark.parametrize("name", ["angle_block", "featuretype", "idler_riser", "octagonal_pocket"])
def test_parts_of_cad_programs_are_closed(shared_data: Path, name: str) -> None:
    """Their zeros are 0 in one triangle and 6e-17 in the next."""
    (path,) = (p for p in (shared_data / "parts").glob(f"{name}.*") if p.suffix.lower() == ".stl")
    assert is_closed(read_mesh(path.read_bytes(), ".stl"))


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 254.0, 1e6]))
@settings(max_examples=30, deadline=None)
@pytest.mark.parametrize("suffix", [".stl", ".dxf"])
def test_what_rounding_leaves_of_a_zero_tears_nothing(suffix: str, seed: int, size: float) -> None:
    """Of a soup in any unit; what differs by more than rounding stays apart."""
    draw, box = np.random.default_rng(seed), box_with_hole()
    corners = box.triangles.reshape(-1, 3)
    corners = (corners - corners.min(axis=0)) * (size / np.abs(corners).max())
    rest = draw.uniform(-1, 1, corners.shape) * 10.0 ** draw.uniform(-18, -13) * size
    noisy = np.where(corners == 0, rest, corners)
    read = read_mesh(_soup(noisy, suffix), suffix)
    assert is_closed(read)
    assert len(read.vertices) == len(box.vertices)
    assert np.abs(read.triangles.reshape(-1, 3) - noisy).max() < 1e-6 * size
    apart = np.where(corners == 0, draw.choice([0.0, 1e-11], corners.shape) * size, corners)
    assert len(read_mesh(_soup(apart, suffix), suffix).vertices) > len(box.vertices)


def _soup(corners: Floats, suffix: str) -> bytes:
    """Loose triangles with every digit, (3f, 3) corners."""
    if suffix == ".stl":
        faces = "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in face.tolist())
            + "endloop\nendfacet\n"
            for face in corners.reshape(-1, 3, 3)
        )
        return f"solid soup\n{faces}endsolid soup\n".encode()
    faces = "".join(
        "0\n3DFACE\n8\n0\n"
        + "".join(
            f"{10 * (axis + 1) + k}\n{face[min(k, 2)][axis]!r}\n"
            for k in range(4)
            for axis in range(3)
        )
        for face in corners.reshape(-1, 3, 3).tolist()
    )
    return f"0\nSECTION\n2\nENTITIES\n{faces}0\nENDSEC\n0\nEOF\n".encode()


def test_ply_with_polygons_and_other_elements() -> None:
    wanted = [[0, 1, 2], [0, 2, 3], [0, 1, 4]]
    mesh = read_mesh(PLY.encode(), ".ply")
    assert mesh.faces.tolist() == wanted
    for mark, name in ((">", "big"), ("<", "little")):
        head = PLY[: PLY.index("end_header")].replace("ascii", f"binary_{name}_endian")
        data = (head + "end_header\n").encode()
        for v in mesh.vertices:
            data += struct.pack(mark + "3fB", *v, 7)
        data += struct.pack(mark + "B4If", 4, 0, 1, 2, 3, 0.5)
        data += struct.pack(mark + "B3If", 3, 0, 1, 4, 0.25)
        again = read_mesh(data, ".ply")
        assert again.faces.tolist() == wanted
        np.testing.assert_array_equal(again.vertices, mesh.vertices)
        with pytest.raises(FormatError, match="ends before"):
            read_mesh(data[:-1], ".ply")


def test_obj_with_slashes_and_negative_numbers() -> None:
    text = "# x\nmtllib a\nv 0 0 0 1\nv 1 0 0\nvn 0 0 1\nvt 0 0\nv 1 1 0\nv 0 1 0\n"
    mesh = read_mesh((text + "f 1/1/1 2//1 3 4\nf -4 -2 -1\n").encode(), ".obj")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 3]]
    for bad in (
        "f 1 2 9\n",
        "f 1 2 0\n",
        "f 1 2 -9\n",
        "f 1 2\n",
        "f a b c\n",
        "v 1 2\n",
        "v 1 2 inf\n",
    ):
        with pytest.raises(FormatError):
            read_mesh((text + bad + "f 1 2 3\n").encode(), ".obj")
    with pytest.raises(InputError, match="no faces"):
        read_mesh(text.encode(), ".obj")


@pytest.mark.parametrize(
    ("data", "suffix", "error", "message"),
    [
        (b"", ".stl", FormatError, "need 84 bytes"),
        (b"\0" * 84, ".stl", FormatError, "no triangles"),
        (
            b"\0" * 80 + b"\xff\xff\xff\x7f" + b"\0" * 50,
            ".stl",
            FormatError,
            "2147483647 triangles",
        ),
        (b"solid a\nendsolid a\n", ".stl", FormatError, "no triangles"),
        (b"solid\nvertex 1 2 3\nendsolid\n", ".stl", FormatError, "whole triangles"),
        (b"solid\nvertex 1 2\nendsolid\n", ".stl", FormatError, "line 2"),
        (b"solid\nvertex 1 2 nan\nendsolid\n", ".stl", FormatError, "'nan' is not a finite"),
        (b"hello", ".ply", FormatError, "no PLY header"),
        (b"ply\nformat ascii 2\nend_header\n", ".ply", FormatError, "format line"),
        (b"ply\nformat ebcdic 1.0\nend_header\n", ".ply", FormatError, "format line"),
        (PLY.encode().replace(b"vertex 5", b"vertex -5"), ".ply", FormatError, "element line"),
        (
            PLY.encode().replace(b"vertex 5", b"vertex 500000000"),
            ".ply",
            LimitExceeded,
            "500000000",
        ),
        (PLY.encode().replace(b"vertex 5", b"vertex 99999999"), ".ply", FormatError, "cannot fit"),
        (PLY.encode().replace(b"face 2", b"face 49999999"), ".ply", FormatError, "cannot fit"),
        (PLY.encode().replace(b"face 2", b"tristrips 2"), ".ply", InputError, "strips"),
        (PLY.encode().replace(b"3 0 1 4", b"3 0 1 5"), ".ply", FormatError, "names .0, 1, 5."),
        (PLY.encode().replace(b"1e0", b"inf"), ".ply", FormatError, "not finite"),
        (PLY.encode().replace(b"1e0", b"x"), ".ply", FormatError, "'x' is not the number"),
        (b"1 2\n", ".xyz", FormatError, "2 numbers"),
        (b"1 2 3\n4 5\n", ".xyz", FormatError, "line 2"),
        (b"1 2 3\n4 5 6 7\n", ".xyz", FormatError, "line 2"),
        (b"1 2 nan\n", ".xyz", FormatError, "not finite"),
        (b"# only\n", ".xyz", FormatError, "no points"),
    ],
)
def test_what_is_wrong_is_named_and_costs_no_memory(
    data: bytes, suffix: str, error: type[InputError], message: str
) -> None:
    with pytest.raises(error, match=message):
        read_mesh(data, suffix)  # loads and compiles what it needs, for which no file is to blame
    tracemalloc.start()
    try:
        with pytest.raises(error, match=message):
            read_mesh(data, suffix)
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("suffix", EXPORTERS)
@pytest.mark.parametrize(
    "options",
    [
        ExportOptions(),
        ExportOptions(ascii=True),
        ExportOptions(dxf_forms=("polyface", "mesh"), dxf_version="R2010"),
    ],
)
def test_mutated_files_are_read_or_refused_by_name(suffix: str, options: ExportOptions) -> None:
    rng = np.random.default_rng(3)
    good = export(measured(box_with_hole(8)), suffix, options=options)
    head = min(len(good), 400) if suffix != ".dxf" else len(good)
    refused = 0
    for _ in range(100):
        data = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(0, rng.choice([head, len(good)])))
            way = rng.integers(0, 4)
            if way == 0:
                data[at : at + 1] = bytes([rng.integers(0, 256)])
            elif way == 1:
                data[at : at + 1] = b"%d" % rng.integers(0, 2**40)
            elif way == 2:
                del data[at : at + int(rng.integers(1, 60))]
            else:
                data[at:at] = data[at // 2 : at // 2 + int(rng.integers(1, 60))]
        try:
            mesh = read_mesh(bytes(data), suffix)
            assert np.isfinite(mesh.vertices).all()
        except InputError:
            refused += 1
    assert refused


def glb(head: dict[str, object], binary: bytes = b"") -> bytes:
    """A file of these two parts."""
    text = json.dumps(head).encode()
    text = text.ljust(-(-len(text) // 4) * 4)
    parts = [struct.pack("<I4s", len(text), b"JSON"), text]
    parts += [struct.pack("<I4s", len(binary), b"BIN\0"), binary]
    body = b"".join(parts)
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")


def triangle_glb(**more: object) -> dict[str, object]:
    """One triangle of 1 m without indices, in a node of a node."""
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [1]}],
        "nodes": [
            {"mesh": 0, "translation": [0, 0, 2]},
            {"children": [0], "scale": [2, 2, 2], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
        **more,
    }


def test_a_glb_of_nodes_in_nodes_in_metres_with_y_up() -> None:
    read = read_mesh(glb(triangle_glb(), TRIANGLE.tobytes()), ".glb")
    # A quarter turn about glTF's z, twice the size, 2 · 2 m along it, which is our −y.
    expected = [[0, -4000, 0], [0, -4000, 2000], [-2000, -4000, 0]]
    np.testing.assert_allclose(read.vertices, expected, atol=1e-3)
    assert read.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "needs KHR_draco"),
        ({"nodes": [{"children": [0]}, {"children": [0]}]}, "more than 64 deep"),
        ({"nodes": [{"mesh": 7}, {"children": [0]}]}, "IndexError"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}]},
         "beyond the binary part"),
        ({"scenes": []}, "no triangles"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]},
         "no triangles"),
    ],
)  # fmt: skip
def test_a_glb_that_is_not_read_says_why(more: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_mesh(glb(triangle_glb(**more), TRIANGLE.tobytes()), ".glb")


def test_a_glb_with_a_coordinate_that_is_no_number_is_refused() -> None:
    bad = TRIANGLE.copy()
    bad[1, 1] = np.inf
    with pytest.raises(FormatError, match="vertex 2"):
        read_mesh(glb(triangle_glb(), bad.tobytes()), ".glb")


def coloured_glb(colours: np.ndarray, indices: np.ndarray, view: int = 48) -> bytes:
    """One triangle with colours (3, 4) float32 and indices (3,) of a type that readers know."""
    kinds = {"u": {1: 5121, 2: 5123, 4: 5125}, "f": {4: 5126}, "i": {1: 5120, 2: 5122}}
    binary = TRIANGLE.tobytes() + colours.astype("<f4").tobytes() + indices.tobytes()
    kind = kinds[indices.dtype.kind][indices.dtype.itemsize]
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2}
    head = triangle_glb(
        meshes=[{"primitives": [primitive]}],
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "componentType": kind, "count": 3, "type": "SCALAR"},
        ],
        bufferViews=[
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": view},
            {"buffer": 0, "byteOffset": 84, "byteLength": indices.nbytes},
        ],
    )
    return glb(head, binary)


def test_a_damaged_glb_says_what_is_wrong_with_it() -> None:
    white, order = np.ones((3, 4)), np.arange(3, dtype="<u2")
    assert len(read_mesh(coloured_glb(white, order), ".glb").faces) == 1
    with pytest.raises(InputError, match="vertex indices are not whole numbers"):
        read_mesh(coloured_glb(white, order.astype("<f4")), ".glb")
    with pytest.raises(InputError, match="vertex indices are not whole numbers"):
        read_mesh(coloured_glb(white, -order.astype("<i2")), ".glb")
    with pytest.raises(InputError, match="a colour is not a finite number"):
        read_mesh(coloured_glb(white * np.nan, order), ".glb")
    with pytest.raises(InputError, match="reaches beyond its buffer view"):
        read_mesh(coloured_glb(white, order, view=44), ".glb")


@settings(max_examples=150, deadline=None)
@given(st.integers(20, 900), st.integers(1, 255))
def test_a_glb_with_one_damaged_byte_is_read_or_refused(place: int, change: int) -> None:
    data = bytearray(coloured_glb(np.ones((3, 4)), np.arange(3, dtype="<u2")))
    data[place % len(data)] ^= change
    mesh, said = None, "GLB: refused"
    try:
        mesh = read_mesh(bytes(data), ".glb")
    except InputError as e:
        said = str(e)
    assert said.startswith("GLB")
    assert "\n" not in said
    if mesh is not None:
        assert np.isfinite(mesh.vertices).all()
        assert set(mesh.faces.ravel()) <= set(range(len(mesh.vertices)))


def test_a_glb_that_shows_a_node_a_million_times_is_refused() -> None:
    nodes: list[dict[str, object]] = [{"children": [k + 1] * 100} for k in range(10)]
    nodes.append({"mesh": 0})
    with pytest.raises(LimitExceeded, match="nodes"):
        read_mesh(glb(triangle_glb(nodes=nodes, scenes=[{"nodes": [0]}]), bytes(36)), ".glb")


THREEMF = (
    '<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    '<resources><object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/>'
    '<vertex x="1" y="0" z="0"/><vertex z="0" y="1" x="0"/></vertices>'
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>'
    '<object id="5"><components><component objectid="1" transform="{}"/>'
    '<component objectid="1"/></components></object></resources>'
    '<build><item objectid="5" transform="1 0 0 0 1 0 0 0 1 0 0 10"/></build></model>'
)


def test_a_3mf_of_components_in_inches() -> None:
    mirrored = THREEMF.format("-1 0 0 0 1 0 0 0 1 5 0 0")
    read = read_mesh(outside(mirrored.encode(), ".3mf"), ".3mf")
    first = [[5, 0, 10], [4, 0, 10], [5, 1, 10]]
    second = [[0, 0, 10], [1, 0, 10], [0, 1, 10]]
    np.testing.assert_allclose(read.vertices, 25.4 * np.array(first + second), rtol=1e-12)
    normals = np.cross(read.triangles[:, 1] - read.triangles[:, 0],
                       read.triangles[:, 2] - read.triangles[:, 0])  # fmt: skip
    assert (normals[:, 2] > 0).all(), "the mirrored one shows its back"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"inch"', '"furlong"', "unit 'furlong'"),
        ('v3="2"', 'v3="3"', "there are 3 vertices"),
        ('x="1"', 'x="one"', "line 1: ValueError"),
        ('x="1"', 'x="inf"', "not finite"),
        ('v1="0"', "", "KeyError: 'v1'"),
        ("{}", "1 2 3", "3 numbers, not 12"),
        ('item objectid="5"', 'item objectid="6"', "object '6' does not exist"),
        ('component objectid="1" t', 'component objectid="5" t', "more than 16 deep"),
        ("<build>", "<!--", "3MF: "),
        ("<item", "<thing", "no triangles"),
        ("<model", '<!DOCTYPE m [<!ENTITY a "b">]><model', "forbids"),
    ],
)
def test_a_3mf_that_is_not_read_says_why(old: str, new: str, says: str) -> None:
    assert THREEMF.count(old) == 1
    text = THREEMF.replace(old, new).replace("{}", "1 0 0 0 1 0 0 0 1 0 0 0")
    with pytest.raises(InputError, match=says):
        read_mesh(outside(text.encode(), ".3mf"), ".3mf")


def test_a_3mf_without_a_model_is_refused() -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        file.writestr("a.txt", b"")
    with pytest.raises(FormatError, match="no model"):
        read_mesh(out.getvalue(), ".3mf")
