"""A STEP takes long to make: it tells how far it is, and is not made twice."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.needs import needs
from tests.shapes.solids import closed_box, noisy
from turnscan.mesh import submesh
from turnscan.progress import Progress
from turnscan.shapes import Source
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._surface import _saving


def test_two_names_for_one_solid_make_it_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    needs("OpenCASCADE")
    box = closed_box()
    made, told = list[str](), list[float]()
    own = _saving._as_step

    def counted(what: Any, options: Any, name: str, *rest: Any) -> Any:
        made.append(name)
        return own(what, options, name, *rest)

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


def test_a_solid_of_a_scan_knows_what_its_calibration_does(tmp_path: Path) -> None:
    """A scale that is unknown by a hundredth makes three of the volume, through either door."""
    needs("OpenCASCADE")
    box = noisy(closed_box(), 1e-3, 1)
    known = Source(moves=[1e-2 * box.vertices])
    (told,) = _saving.save({tmp_path / "a.step": box}, made_from=known)
    (alone,) = _saving.save({tmp_path / "b.step": box})
    said, bare = (float(re.findall(r"± (\S+) mm³", f.message)[0]) for f in (told, alone))
    assert said == pytest.approx(0.03 * box.volume, rel=0.05)
    assert bare < 0.1 * said


def test_fewer_vertices_move_as_the_nearest_did() -> None:
    box = closed_box()
    loaded = Loaded(box, "box", source=Source(moves=[1e-2 * box.vertices]))
    half = submesh(box, np.arange(len(box.faces)) % 2 == 0)
    (move,) = loaded.with_mesh(half).moves
    np.testing.assert_allclose(move, 1e-2 * half.vertices)
