"""Archives that are damaged on their way."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from turnscan.errors import FormatError
from turnscan.workflows import unpack


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_damaged_archive_is_told_as_one_however_it_was_packed(
    method: int, tmp_path: Path
) -> None:
    whole = tmp_path / "whole.zip"
    with zipfile.ZipFile(whole, "w", method) as archive:
        archive.writestr("a.png", np.random.default_rng(1).bytes(4000))
    data = bytearray(whole.read_bytes())
    for at in (60, 80, 200, 1500):
        bad = data.copy()
        bad[at : at + 8] = bytes(8)
        (tmp_path / f"bad{at}.zip").write_bytes(bad)
        (tmp_path / f"to{at}").mkdir()
        with pytest.raises(FormatError, match="not a sound zip archive"):
            unpack(tmp_path / f"bad{at}.zip", tmp_path / f"to{at}")
