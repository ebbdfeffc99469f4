"""An audit finds what is damaged, wherever it is."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.formats.parts import inside, measured, outside, torus
from turnscan.formats import EXPORTERS, ExportOptions, audit, export
from turnscan.mesh import Mesh

PART = measured(torus(12, 9))
TEXT = ExportOptions(ascii=True)


def errors(data: bytes, suffix: str, options: ExportOptions, mesh: Mesh = PART) -> list[str]:
    found = audit(data, mesh, suffix, options=options)
    return [f.code for f in found if f.severity == "error"]


@pytest.mark.parametrize("suffix", [s for s in EXPORTERS if s != ".glb"])
@pytest.mark.parametrize(
    "options",
    [TEXT, ExportOptions(ascii=True, dxf_forms=("mesh",), dxf_version="R2010")],
)
def test_any_digit_of_a_coordinate_counts(suffix: str, options: ExportOptions) -> None:
    data = inside(export(PART, suffix, options=options), suffix)
    start = {
        ".dxf": data.find(b"ENTITIES"),
        ".stl": data.find(b"\n"),
        ".ply": data.find(b"end_header"),
        ".3mf": data.find(b"<vertices>"),
    }.get(suffix, data.rfind(b"# "))
    places = [
        start + m.start() + k
        for m in re.finditer(rb"\d+\.\d{6,}", data[start:])
        for k in range(m.end() - m.start())
        if data[start + m.start() + k] != ord(".")
    ]
    if suffix == ".stl":  # normals are not read back: corners are what counts
        lines = [data.rindex(b"\n", 0, p) for p in places]
        places = [p for p, n in zip(places, lines, strict=True) if data[n + 1 :][:6] == b"vertex"]
    for p in np.random.default_rng(2).choice(places, 60, replace=False):
        digit = (data[p] - 48 + 5) % 10 + 48
        bad = outside(data[:p] + bytes([digit]) + data[p + 1 :], suffix)
        assert errors(bad, suffix, options), data[p - 30 : p]


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".glb"])
def test_any_high_byte_of_a_binary_number_counts(suffix: str) -> None:
    """``at`` is the second highest byte of a number, the first of a record of this size."""
    data = export(PART, suffix)
    start, size, at_first = {
        ".stl": (84, 50, 12 + 2),
        ".ply": (data.find(b"end_header\n") + 11, 3 * 8 + 3 + 8 + 3 * 4, 6),
        ".glb": (data.find(b"BIN\0") + 4, 12, 2),
    }[suffix]
    for i in range(20):
        at = start + i * size + at_first
        assert errors(
            data[:at] + bytes([data[at] ^ 0x15]) + data[at + 1 :], suffix, ExportOptions()
        )


@pytest.mark.parametrize("suffix", [s for s in EXPORTERS if s != ".xyz"])
@pytest.mark.parametrize("options", [ExportOptions(), TEXT])
def test_a_missing_or_turned_face_is_found(suffix: str, options: ExportOptions) -> None:
    less = Mesh(PART.vertices, PART.faces[:-1], PART.provenance, PART.colour)
    assert errors(export(less, suffix, options=options), suffix, options) == ["export.count"]
    turned = PART.faces.copy()
    turned[3] = turned[3][::-1]
    other = Mesh(PART.vertices, turned, PART.provenance, PART.colour)
    assert errors(export(other, suffix, options=options), suffix, options) == ["export.coordinates"]


@pytest.mark.parametrize("suffix", EXPORTERS)
@pytest.mark.parametrize("options", [ExportOptions(), TEXT])
def test_a_file_cut_short_is_found(suffix: str, options: ExportOptions) -> None:
    data = export(PART, suffix, options=options)
    for part in (0.0, 0.1, 0.5, 0.9, 0.99):
        assert errors(data[: int(len(data) * part)], suffix, options)


def test_a_lost_value_is_found() -> None:
    bare = Mesh(PART.vertices, PART.faces)
    assert errors(export(bare, ".ply"), ".ply", ExportOptions()) == ["export.values"]
    grey = Mesh(PART.vertices, PART.faces, PART.provenance, np.zeros_like(PART.vertices, np.uint8))
    assert errors(export(grey, ".ply"), ".ply", ExportOptions()) == ["export.values"]
    for other in (bare, grey):
        assert errors(export(other, ".glb"), ".glb", ExportOptions()) == ["export.values"]
    assert errors(export(bare, ".xyz"), ".xyz", ExportOptions()) == ["export.values"]


def test_a_form_too_many_is_found() -> None:
    both = export(PART, ".dxf", options=ExportOptions(dxf_forms=("3dface", "polyface")))
    assert errors(both, ".dxf", ExportOptions()) == ["export.count"]


def test_coarse_numbers_far_away_are_remarked() -> None:
    far = Mesh(torus(12, 9).vertices + 1e6, torus(12, 9).faces)
    found = audit(export(far, ".stl"), far, ".stl")
    assert [f.code for f in found] == ["export.rounding"]
    assert audit(export(far, ".ply"), far, ".ply") == []
