"""``turnscan export`` and the files that verbs write."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from tests.formats.parts import torus
from turnscan.cli._export import verb
from turnscan.errors import ExportError, FormatError, InputError
from turnscan.formats import export, read_dxf_content, read_mesh
from turnscan.mesh import Mesh, join
from turnscan.workflows import check, check_writable, write_atomically

PART = torus(12, 9)


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(verb, [str(w) for w in words])


@pytest.fixture
def ply(tmp_path: Path) -> Path:
    path = tmp_path / "part.ply"
    path.write_bytes(export(PART, ".ply"))
    return path


def test_a_mesh_becomes_files_of_other_formats(ply: Path) -> None:
    outs = [ply.with_name(f"out{s}") for s in (".dxf", ".STL", ".obj", ".xyz")]
    words = [w for out in outs for w in ("-o", str(out))]
    done = call(ply, *words, "--dxf-form", "mesh", "--dxf-form", "polyface")
    assert done.exit_code == 0, done.output
    assert f"out.xyz: {len(PART.vertices)} points, " in done.stdout
    content = read_dxf_content(outs[0].read_bytes())
    assert len(content.meshes) == len(content.polyfaces) == 3 * len(PART.faces)
    assert len(content.faces) == 0
    assert read_mesh(outs[1].read_bytes(), ".stl").volume == pytest.approx(PART.volume, rel=1e-6)
    assert b"part.ply" in outs[2].read_bytes()
    assert sorted(p.name for p in ply.parent.iterdir()) == sorted(
        ["part.ply", *(o.name for o in outs)]
    )


def test_bad_requests_write_nothing(ply: Path) -> None:
    good = ply.with_name("good.dxf")
    text = ply.with_name("text.stl")
    text.write_text("this is no STL")
    cases: list[tuple[list[str | Path], type[Exception], str]] = [
        ([ply, "-o", good, "-o", ply.with_name("x.dwg")], InputError, "'.dwg'"),
        ([ply, "-o", good, "-o", ply.parent / "no" / "x.dxf"], ExportError, "no folder"),
        ([ply, "-o", good, "-o", ply.with_name("d.dxf")], ExportError, "is a folder"),
        ([ply, "-o", good, "--dxf-form", "profiles"], InputError, "no profiles"),
        ([ply, "-o", good, "--dxf-form", "mesh", "--dxf-version", "R12"], InputError, "R12"),
        ([text, "-o", good], FormatError, "text.stl"),
        ([ply.with_name("none.ply"), "-o", good], InputError, "no such file"),
    ]
    ply.with_name("d.dxf").mkdir()
    for words, error, message in cases:
        done = call(*words)
        assert isinstance(done.exception, error), done.output
        assert message in str(done.exception)
        assert not good.exists()


def test_a_full_disk_leaves_the_old_file(ply: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = ply.read_bytes()

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ExportError, match="No space left") as caught:
        write_atomically(ply, b"new")
    assert caught.value.exit_code == 5
    assert ply.read_bytes() == old
    assert [p.name for p in ply.parent.iterdir()] == ["part.ply"]


def test_a_file_is_replaced_through_its_link_and_keeps_its_mode(ply: Path) -> None:
    ply.chmod(0o640)
    link = ply.with_name("link.ply")
    link.symlink_to(ply)
    write_atomically(link, b"new")
    assert ply.read_bytes() == b"new"
    assert link.is_symlink()
    assert ply.stat().st_mode & 0o777 == 0o640


def test_what_cannot_be_written_is_said_before(ply: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ExportError, match="device"):
        check_writable(Path("/dev/null"))
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != ply)
    with pytest.raises(ExportError, match="file is read-only"):
        check_writable(ply)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(ExportError, match=r"folder .* is read-only"):
        check_writable(ply.with_name("new.dxf"))


def test_a_mesh_is_thinned_out_to_a_count_or_a_tolerance(ply: Path) -> None:
    few, near = ply.with_name("few.stl"), ply.with_name("near.stl")
    done = call(ply, "-o", few, "--decimate", "100")
    assert done.exit_code == 0, done.output
    assert len(read_mesh(few.read_bytes(), ".stl").faces) == 100
    assert f"100 of {len(PART.faces)} faces are left" in done.stderr
    done = call(ply, "-o", near, "--decimate", "0.001mm")
    assert done.exit_code == 0, done.output
    assert len(read_mesh(near.read_bytes(), ".stl").faces) == len(PART.faces)


def test_a_whole_number_without_a_unit_is_a_count(ply: Path) -> None:
    for asked in ("1e2", "100.0", "100"):
        done = call(ply, "-o", ply.with_name("few.stl"), "--decimate", asked)
        assert f"100 of {len(PART.faces)} faces are left" in done.stderr
    done = call(ply, "-o", ply.with_name("all.stl"), "--decimate", "1e9")
    assert f"{len(PART.faces)} of {len(PART.faces)} faces are left" in done.stderr


def test_what_check_finds_in_a_file_the_export_has_said(ply: Path) -> None:
    few, crossed, cut = (ply.with_name(f"{name}.ply") for name in ("few", "crossed", "cut"))
    done = call(ply, "-o", few, "--decimate", "4")
    (left,) = re.findall(r"^note surface.decimated: (\d+) of", done.stderr, re.MULTILINE)
    assert "4 faces cannot be reached" in done.stderr
    assert f"ask for as many as are left: --decimate {left}\n" in done.stderr
    assert "--close" not in done.stderr, "which export has not"
    assert not check(few).findings
    away = np.array([20.0, 0.0, 3.0])
    crossed.write_bytes(export(join([PART, Mesh(PART.vertices + away, PART.faces)]), ".ply"))
    cut.write_bytes(export(Mesh(PART.vertices, PART.faces[1:]), ".ply"))
    for source in (crossed, cut):
        done = call(source, "-o", few, "--decimate", "100")
        assert done.exit_code == 0, done.output
        found = check(few).findings
        assert found
        for finding in found:
            assert finding.code in done.stderr
            assert finding.where in done.stderr
    assert "surface.crossing" not in done.stderr
    done = call(crossed, "-o", few)
    (finding,) = check(few).findings
    assert str(finding) in done.stderr, "as it does of what was not decimated"


@pytest.mark.parametrize("asked", ["3", "3.0", "-1", "0.05", "0mm", "nanmm", "inf", "little"])
def test_a_decimation_that_cannot_be_is_refused_before_work(ply: Path, asked: str) -> None:
    done = call(ply, "-o", ply.with_name("out.stl"), "--decimate", asked)
    assert done.exit_code == 2
    assert "--decimate" in done.stderr
    assert not ply.with_name("out.stl").exists()
