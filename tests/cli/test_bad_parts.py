"""Parts and tolerances of which nothing can be drawn: one line each, the same for every verb."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from tests.needs import needs
from tests.shapes.outlines import along, regular, wall
from turnscan.cli import main
from turnscan.formats import write_ply
from turnscan.mesh import Mesh

VERBS = {
    "section": ["PART", "--plane", "z=5", "-o", "OUT.dxf"],
    "shapes": ["PART", "-o", "OUT.ply"],
    "revolve": ["PART", "-o", "OUT.dxf"],
    "compare": ["PART", "GOOD"],
}


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    body = wall(along(regular(6, 20.0), 2.0), np.linspace(0, 20, 11), 0.01)
    (folder / "good.ply").write_bytes(write_ply(body))
    (folder / "points.ply").write_bytes(write_ply(Mesh(np.eye(3), np.zeros((0, 3), np.int32))))
    (folder / "broken.step").write_text("ISO-10303-21;\nnonsense\n")
    (folder / "lumpy.ply").write_bytes(write_ply(_lumpy()))
    return folder


def _lumpy() -> Mesh:
    """A closed freeform part without axis."""
    u, v = np.meshgrid(np.arange(60) * np.pi / 30, np.linspace(0.02, np.pi - 0.02, 30))
    r = 15 + 3 * np.cos(3 * u) * np.sin(v) ** 3 + 1.5 * np.sin(5 * v)
    r += 2 * np.sin(2 * u + 1) * np.sin(v) ** 2
    x = [r * np.cos(u) * np.sin(v), r * np.sin(u) * np.sin(v), r * np.cos(v)]
    i, j = (k.ravel() for k in np.meshgrid(np.arange(60), np.arange(29)))
    a, b = j * 60 + i, j * 60 + (i + 1) % 60
    faces = [np.stack([a, a + 60, b + 60], axis=1), np.stack([a, b + 60, b], axis=1)]
    return Mesh(np.stack(x, axis=-1).reshape(-1, 3), np.concatenate(faces).astype(np.int32))


def _line(
    verb: str, part: str, more: list[str], parts: Path, out: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> tuple[object, str]:  # fmt: skip
    words = {"PART": str(parts / part), "GOOD": str(parts / "good.ply")}
    args = [words.get(a, a.replace("OUT", str(out / "out"))) for a in VERBS[verb]]
    monkeypatch.setattr(sys, "argv", ["turnscan", verb, *args, *more])
    code: object = 0
    try:
        main()
    except SystemExit as stop:
        code = stop.code or 0
    said = capsys.readouterr()
    return code, said.err if code else said.out


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(
    ("part", "more", "text"),
    [
        ("good.ply", ["--tolerance", "0"], "--tolerance"),
        ("good.ply", ["--tolerance", "-1"], "--tolerance"),
        ("good.ply", ["--tolerance", "nan"], "not a finite number"),
        ("good.ply", ["--tolerance", "1e9"], "more than a tenth of the part, whose diagonal is"),
        ("points.ply", [], "no "),
        ("broken.step", [], "broken.step: OpenCASCADE cannot read this STEP file"),
    ],
)
def test_one_clear_line_and_nothing_written(
    verb: str, part: str, more: list[str], text: str, parts: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    if part.endswith(".step"):
        needs("OpenCASCADE")
    code, err = _line(verb, part, more, parts, tmp_path, monkeypatch, capsys)
    assert code == 2
    assert err.count("\n") == 1
    assert text in err
    assert "→" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", [v for v in VERBS if v != "compare"])
def test_without_the_extra_a_step_file_is_one_line(
    verb: str, parts: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    for name in [m for m in sys.modules if m == "OCP" or m.startswith("OCP.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    code, err = _line(verb, "broken.step", [], parts, tmp_path, monkeypatch, capsys)
    assert code == 2
    assert err.count("\n") == 1
    assert "[cad]" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("verb", "code", "text"),
    [
        ("section", 0, "1 spline"),
        ("shapes", 0, "freeform: no shape within"),
        ("revolve", 2, "lumpy.ply: not a turned part"),
    ],
)
def test_a_freeform_part_gets_no_invented_shape(
    verb: str, code: int, text: str, parts: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    got, said = _line(verb, "lumpy.ply", [], parts, tmp_path, monkeypatch, capsys)
    assert (got, text in said) == (code, True), said
