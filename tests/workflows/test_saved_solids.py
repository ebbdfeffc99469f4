"""A STEP takes long to make: it tells how far it is, and is not made twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.needs import needs
from tests.shapes.solids import prism
from turnscan.progress import Progress
from turnscan.workflows._surface import _saving


def test_two_names_for_one_solid_make_it_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    needs("OpenCASCADE")
    box = prism([(0, 0), (20, 0), (20, 15), (0, 15)], 10, 1.0)
    made, told = list[str](), list[float]()
    own = _saving._as_step

    def counted(what: Any, options: Any, name: str, progress: Progress) -> Any:
        made.append(name)
        return own(what, options, name, progress)

    monkeypatch.setattr(_saving, "_as_step", counted)
    files = [tmp_path / name for name in ("a.step", "a.stp", "b.step")]
    show = Progress(lambda fraction, _: told.append(fraction))
    _saving.save(dict.fromkeys(files, box), progress=show)
    assert made == [str(files[0]), str(files[2])]
    assert files[0].read_bytes() == files[1].read_bytes()
    # The name of the part stands in the file.
    assert files[0].read_bytes() != files[2].read_bytes()
    assert told == sorted(told)
    assert len(told) > 2
