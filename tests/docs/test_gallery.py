"""The gallery's page says what its command measured, and shows what the command drew."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
LARGEST = 1_500_000
"""Bytes of all pictures of the gallery."""


def test_the_page_is_what_the_command_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    gallery = importlib.import_module("make_gallery")
    for name in ("make_gallery", "make_pictures"):
        monkeypatch.delitem(sys.modules, name)
    known = {k: gallery.Figures(**v) for k, v in json.loads(gallery.FIGURES.read_text()).items()}
    assert {of.part for of in gallery.PAPER} <= known.keys(), "the tests of the paper come first"
    assert (DOCS / "gallery.md").read_text() == gallery.page(known)
    pictures = {p.stem: p.stat().st_size for p in gallery.PICTURES.glob("*.png")}
    assert pictures.keys() == known.keys()
    assert sum(pictures.values()) < LARGEST
    for of in (*gallery.PAPER, *gallery.OTHERS):
        assert len(of.words.split()) <= 12, of.words


def test_what_deviates_is_what_sigma_allows_for_the_most_part() -> None:
    """Deviations hold what sigma cannot know, such as light inside the material, but not much."""
    known = json.loads((DOCS / "pictures" / "gallery" / "figures.json").read_text())
    for part, figures in known.items():
        assert 0.3 * figures["sigma"] < figures["rms"] < 10 * figures["sigma"], part
