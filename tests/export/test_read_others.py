"""Files that we did not write: read, or refused by name."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.export.parts import box_with_hole, measured, torus
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.export import EXPORTERS, ExportOptions, export, read_mesh


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
        (b"ply\nformat ascii 2\nend_header\n", ".ply", FormatError, "no x, y, z"),
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
    read_mesh(export(torus(4, 4), suffix), suffix)  # compiles
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
