"""Formats of other packages: found by suffix, checked by a kit, contained when they fail."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.package import install_package
from turnscan.errors import FormatError, InputError, PluginError
from turnscan.formats import EXPORTERS, Exporter, ExportOptions, exporter_for
from turnscan.mesh import Mesh
from turnscan.testing import check_format
from turnscan.workflows import export, read_mesh_file

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-format.md"
BOX = Mesh(np.eye(3) * 10.0, np.array([(0, 1, 2)]))


@pytest.fixture
def off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The package of the page, installed; the code of its test."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(), re.S)
    sources = [text for language, text in blocks if language == "python"]
    (entry,) = (text for language, text in blocks if language == "toml")
    code = [line for line in sources[0].splitlines() if line.strip()]
    assert len(code) <= 40, f"{len(code)} lines"
    install_package(tmp_path / "site", "turnscan_off", sources[0], entry, monkeypatch)
    return sources[1]


def test_the_example_of_the_page_passes_its_own_check(off: str) -> None:
    namespace: dict[str, Any] = {}
    exec(off, namespace)
    namespace["test_my_format"]()


@pytest.mark.usefixtures("off")
def test_by_its_suffix_it_is_written_and_read(tmp_path: Path) -> None:
    done = export(BOX, tmp_path / "part.OFF", tmp_path / "part.stl")
    assert not done.remarks
    assert (tmp_path / "part.OFF").read_text().startswith("OFF\n3 1 0\n")
    assert np.array_equal(read_mesh_file(tmp_path / "part.OFF").triangles, BOX.triangles)
    with pytest.raises(InputError, match=r"\.xyz, \.off"):
        exporter_for(".odd")
    (tmp_path / "half.off").write_bytes(b"OFF\n3 1")
    with pytest.raises(FormatError, match=r"half\.off: OFF: "):
        read_mesh_file(tmp_path / "half.off")


@pytest.mark.parametrize("suffix", [s for s in EXPORTERS if s in (".obj", ".3mf")])
def test_our_own_formats_pass_the_kit(suffix: str) -> None:
    check_format(suffix)


HEAD = "from turnscan.formats import Exporter\n"
BROKEN = {
    "raise RuntimeError('no such library')": "RuntimeError: no such library",
    "form = 7": "it gives a int, not an Exporter",
    HEAD + "form = Exporter('.foo', None, None)": "it is for files ending '.foo', not '.odd'",
    HEAD + "form = Exporter('.odd', lambda m, o: 1 / 0, None)": "ZeroDivisionError",
    HEAD + "form = Exporter('.odd', lambda m, o: 'text', None)": "it gave a str, not bytes",
    HEAD + "form = Exporter('.odd', lambda m, o: b'', lambda d: {}['x'])": "KeyError: 'x'",
    HEAD + "form = Exporter('.odd', lambda m, o: b'', lambda d: d)": "it gave a bytes, not Mesh",
}


@pytest.mark.parametrize("source", BROKEN)
def test_a_broken_package_ends_in_one_line_that_names_it(
    source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"broken_form_{list(BROKEN).index(source)}"
    entry = f'[project.entry-points."turnscan.formats"]\nodd = "{name}:form"\nstl = "{name}:form"\n'
    install_package(tmp_path / "site", name, source, entry, monkeypatch)
    with pytest.raises(PluginError) as caught:
        export(BOX, tmp_path / "a.odd", tmp_path / "a.stl")
    assert f"odd of {name} 1.0 ({name}:form) failed: {BROKEN[source]}" in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["site"]
    export(BOX, tmp_path / "a.stl")


OBJ = EXPORTERS[".obj"]
Change = Callable[[Mesh], Mesh]


def _reading(change: Change) -> Exporter:
    return replace(OBJ, read=lambda data: change(OBJ.read(data)))


COUNT = count()


def _never_the_same(mesh: Mesh, options: ExportOptions) -> bytes:
    return OBJ.write(mesh, options) + f"# {next(COUNT)}\n".encode()


WRONG = {
    "11 faces read, 12 written": _reading(lambda m: Mesh(m.vertices, m.faces[1:])),
    "keep their order and their sense": _reading(lambda m: Mesh(m.vertices, m.faces[:, ::-1])),
    "mm off; the format rounds to": _reading(lambda m: Mesh(m.vertices + 1e-4, m.faces)),
    "the bytes differ": replace(OBJ, write=_never_the_same),
    "not a FormatError": replace(OBJ, read=lambda data: OBJ.read(data) if data else {}["x"]),
    "raised nothing": replace(OBJ, read=lambda data: OBJ.read(data) if len(data) > 40 else BOX),
    "not bytes": replace(OBJ, write=lambda m, o: OBJ.write(m, o).decode()),
    "has capitals": replace(OBJ, suffix=".Obj"),
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_the_kit_says_what_is_wrong(words: str) -> None:
    with pytest.raises(AssertionError, match=re.escape(words)):
        check_format(WRONG[words])
