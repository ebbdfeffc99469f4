"""The picture of the house in the README, and the list of make's targets, say what is there."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

TOP = Path(__file__).parents[2]
_ROOM = re.compile(r"^  ([a-z]+)/ ", re.MULTILINE)
_MODULE = re.compile(r"\b([a-z_]+\.py)\b")


def _picture() -> str:
    """The block of the README that draws `src/turnscan`."""
    found = re.search(r"```\nsrc/turnscan/\n(.*?)```", (TOP / "README.md").read_text(), re.DOTALL)
    assert found, "README.md draws no src/turnscan/"
    return found[1]


def _tracked() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "src/turnscan"], cwd=TOP, capture_output=True, text=True, check=True
    )
    return [Path(line).relative_to("src/turnscan") for line in listed.stdout.split()]


def test_every_room_is_in_the_picture_and_nothing_else() -> None:
    rooms = {p.parts[0] for p in _tracked() if len(p.parts) > 1}
    drawn = _ROOM.findall(_picture())
    assert len(drawn) == len(set(drawn))
    assert set(drawn) == rooms


def test_every_module_beside_the_rooms_is_in_the_picture() -> None:
    modules = {p.name for p in _tracked() if len(p.parts) == 1 and p.suffix == ".py"}
    assert set(_MODULE.findall(_picture())) == modules


def test_make_help_lists_every_target() -> None:
    text = (TOP / "Makefile").read_text().replace("\\\n", " ")
    targets = {
        name for line in re.findall(r"^\.PHONY:(.*)$", text, re.MULTILINE) for name in line.split()
    }
    shown = set(re.findall(r"^([a-z-]+):.*## ", text, re.MULTILINE))
    assert len(targets) > 10
    assert targets == shown


def test_a_contributor_finds_what_the_page_names() -> None:
    text = (TOP / "CONTRIBUTING.md").read_text()
    for name in re.findall(r"`((?:src|tests|docs|bench|frontend)/[\w./-]+)`", text):
        assert (TOP / name).exists(), f"CONTRIBUTING.md names {name}"
    targets = re.findall(r"make ([a-z-]+)", text)
    makefile = (TOP / "Makefile").read_text()
    assert targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"there is no make {target}"
