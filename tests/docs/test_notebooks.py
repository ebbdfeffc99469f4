"""The notebooks of the documentation run, and show what their words say they do."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def cells() -> ModuleType:
    """The runner that Sphinx uses, too."""
    spec = importlib.util.spec_from_file_location("notebook_cells", DOCS / "notebook_cells.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _run(cells: ModuleType, name: str, folder: Path) -> tuple[str, set[str]]:
    """What a notebook prints, and the kinds of what it shows."""
    made = cells.as_ipynb((DOCS / "notebooks" / f"{name}.md").read_text(), folder)
    outputs: list[Any] = [o for c in made["cells"] for o in c.get("outputs", [])]
    said = "".join(o["text"] for o in outputs if o["output_type"] == "stream")
    kinds = {kind for o in outputs if "data" in o for kind in o["data"]}
    assert [c["cell_type"] for c in made["cells"]].count("code") > 4
    return said, kinds


def test_ten_lines_lead_from_a_folder_of_pictures_to_a_dxf(
    cells: ModuleType, tmp_path: Path
) -> None:
    page = (DOCS / "notebooks" / "from-pictures.md").read_text()
    ten = next(code for kind, code in cells.pieces(page) if "import_pictures" in code)
    assert len([line for line in ten.splitlines() if line.strip()]) <= 10
    said, kinds = _run(cells, "from-pictures", tmp_path)
    assert kinds > {"text/html", "image/png"}
    sizes = re.findall(r"parallel lines ([\d.]+) ±([\d.]+)", said)
    assert sizes
    # Of several values one may lie beyond its U by chance; together they do not.
    off, expanded = np.array([(float(mm) - 40.0, float(u)) for mm, u in sizes]).T
    assert expanded.max() < 0.35
    assert np.sqrt(np.mean((off / expanded) ** 2)) <= 1.0
    assert np.abs(off).max() < 0.1
    dxf = (tmp_path / "part.dxf").read_text()
    assert dxf.count("3DFACE") > 1000
    assert dxf.rstrip().endswith("EOF")
    assert (tmp_path / "section.dxf").stat().st_size > 1000


def test_an_own_detector_is_compared_with_ours(cells: ModuleType, tmp_path: Path) -> None:
    said, kinds = _run(cells, "own-detector", tmp_path)
    assert "image/png" in kinds
    found = re.findall(r"(own|ours): diameter ([\d.]+) mm", said)
    assert [name for name, _ in found] == ["own", "ours"]
    assert [float(mm) for _, mm in found] == pytest.approx([50.0, 50.0], abs=0.3)


def test_the_diameter_lies_within_its_uncertainty(cells: ModuleType, tmp_path: Path) -> None:
    said, _ = _run(cells, "diameter", tmp_path)
    (told,) = re.findall(r"diameter ([\d.]+) mm ± ([\d.]+) mm \(k = 2\)", said)
    mean, expanded = map(float, told)
    assert 0.005 < expanded < 0.3
    assert abs(mean - 50.0) < expanded
    (honest,) = re.findall(r"said ([\d.]+) µm, seen ([\d.]+) µm", said)
    assert 0.2 < float(honest[1]) / float(honest[0]) < 5.0


def test_a_cell_that_fails_is_an_error(cells: ModuleType, tmp_path: Path) -> None:
    page = "# A page\n\n```{code-cell} python\n1 / 0\n```\n"
    with pytest.raises(ZeroDivisionError):
        cells.as_ipynb(page, tmp_path)
    page = "# A page\n\n```{code-cell} python\nprint(1)\n2\n```\n\n```{code-cell} python\n3;\n```\n"
    made = cells.as_ipynb(page, tmp_path)
    assert [c["cell_type"] for c in made["cells"]] == ["markdown", "code", "code"]
    assert [o["output_type"] for o in made["cells"][1]["outputs"]] == ["stream", "execute_result"]
    assert made["cells"][1]["outputs"][1]["data"] == {"text/plain": "2"}
    assert made["cells"][2]["outputs"] == []
