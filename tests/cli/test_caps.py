"""The options that close a surface, from the command line's side."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from turnscan.cli._flags import flags_of
from turnscan.cli._reconstruct import verb
from turnscan.errors import InputError
from turnscan.formats import read_mesh
from turnscan.surface.holes import ClosingOptions, holes
from turnscan.workflows import ReconstructOptions


def chosen(*words: str) -> ClosingOptions | None:
    got: list[ReconstructOptions] = []

    @click.command()
    @flags_of(ReconstructOptions)
    def command(options: ReconstructOptions) -> None:
        got.append(options)

    CliRunner().invoke(command, list(words), catch_exceptions=False)
    return got[0].caps


def test_what_is_asked_for_is_what_is_done() -> None:
    assert chosen() is None
    assert chosen("--close") == ClosingOptions()
    assert chosen("--close", "--fill", "none", "--top", "open") == ClosingOptions(
        holes=None, top="open"
    )
    fine = chosen("--close", "--fill", "curvature", "--top", "fan", "--largest-hole", "4.5")
    assert fine == ClosingOptions(holes="curvature", top="fan", largest=4.5)
    assert chosen("--close", "--bottom", "open") == ClosingOptions(bottom="open")
    assert chosen("--close", "--bottom", "hole", "--top", "hole") == ClosingOptions(
        floor=None, top=None
    )
    only_top = chosen("--close", "--bottom", "open", "--fill", "none")
    assert only_top == ClosingOptions(bottom="open", holes=None)


def test_options_that_do_nothing_are_refused() -> None:
    with pytest.raises(InputError, match="fill, top: no effect without close"):
        chosen("--fill", "flat", "--top", "plane")
    for merge in ("grid", "paste"):
        with pytest.raises(InputError, match=f"voxel: no effect with merge {merge}.*merge=tsdf"):
            chosen("--voxel", "1", "--merge", merge)
    with pytest.raises(InputError, match="spacing_by: no effect without spacing → add spacing"):
        chosen("--spacing-by", "arc")
    chosen("--voxel", "1")
    chosen("--spacing-by", "arc", "--spacing", "1")


def range_scan(folder: Path) -> Path:
    """A wavy sheet of 30 × 40 points, 1 mm apart, with a small and a large hole."""
    lines, index = [], []
    for j in range(30):
        for i in range(40):
            if (10 <= i < 13 and 10 <= j < 12) or (20 <= i < 33 and 8 <= j < 20):
                index.append("0")
                continue
            index.append(f"1 {len(lines)}")
            lines.append(f"{i / 1e3} {j / 1e3} {np.sin(i / 9) / 1e3:.7f}")
    head = (
        "ply\nformat ascii 1.0\nobj_info num_cols 40\nobj_info num_rows 30\n"
        f"element vertex {len(lines)}\nproperty float x\nproperty float y\nproperty float z\n"
        "element range_grid 1200\nproperty list uchar int vertex_indices\nend_header\n"
    )
    (folder / "a.ply").write_text("\n".join([head.rstrip(), *lines, *index]) + "\n")
    (folder / "a.conf").write_text("bmesh a.ply 0 0 0 0 0 0 1\n")
    return folder / "a.conf"


def test_only_small_holes_are_filled_and_the_marks_are_in_the_file(tmp_path: Path) -> None:
    source, out = range_scan(tmp_path), tmp_path / "a.ply.out.ply"
    words = [str(source), "-o", str(out), "--edge", "0", "--keep-strays"]
    CliRunner().invoke(verb, words, catch_exceptions=False)
    before = len(holes(read_mesh(out.read_bytes(), ".ply")))
    assert before == 3
    few = [*words, "--close", "--largest-hole", "8"]
    result = CliRunner().invoke(verb, few, catch_exceptions=False)
    assert "1 gaps closed" in result.stderr
    mesh = read_mesh(out.read_bytes(), ".ply")
    assert len(holes(mesh)) == before - 1
    assert 0 < (~mesh.measured).sum() < 60
    assert (mesh.provenance.step[mesh.faces[~mesh.measured]] >= 0).any(), "sewn to the measured"
    result = CliRunner().invoke(verb, [*words, "--close"], catch_exceptions=False)
    assert "1 gap(s) up to" in result.stderr, "a sheet cannot be closed by one that lies on it"
    (border,) = holes(read_mesh(out.read_bytes(), ".ply"))
    assert border.size > 40
    for idle in (["--close", "--top", "fan"], ["--largest-sigma", "1"], ["--refine", "auto"]):
        with pytest.raises(InputError, match=rf"{idle[-2]}: no effect on .*a\.conf"):
            CliRunner().invoke(verb, [*words, *idle], catch_exceptions=False)
