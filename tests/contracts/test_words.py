"""Text for people is plain technical English: words that a reader must guess at are rejected.

Read are texts of the program (string constants of several words), first lines of docstrings, texts
of the front end and the documentation. Decisions and the change log tell history and stay.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contracts.sources import nodes

TOP = Path(__file__).parents[2]

BANNED = {
    r"(is|are)n't there|never there": "simulated, emulated, missing",
    r"mistake inside": "internal error",
    r"stands? twice": "is given twice, appears twice, duplicate",
    r"says a person|chosen, and said": "set by the operator; printed",
    r"anyhow|so exposed|so bright": "in varied poses; with this exposure",
    r"to what\?": "give a tolerance or a face count",
    r"not a sentence of": "unrecognised reply",
    r"nobody": "the operator, unknown, not measured",
    r"soap film": "membrane (minimal area)",
    r"before it is made": "before manufacturing",
    r"one to be found": "automatic",
    r"known only together": "strongly correlated",
    r"merely touch|wind against": "non-manifold, opposite orientation",
    r"cuts? through itself|cut through themselves": "self-intersection, intersects itself",
    r"told": "reported, stated, commanded, known",
    r"thin(s|ned|ning)? (it |them |the mesh )?out": "decimate",
    r"mend(s|ed|ing)?": "repair, correct",
    r"anew": "again, new",
    r"(is|are|was|were|has|have) gone": "missing, disconnected, ended",
    r"simulated bench": "simulated rig",
    r"a mistake": "an error",
    r"on end": "consecutive, in a row",
    r"taken away": "removed",
    r"sought|fallen": "searched, missing",
    r"wish|wishes|wished": "requests, options",
    r"ha(s|ve) (a|no) say": "is fitted, counts",
    r"none of them sure|less sure": "not reliable, with a larger sigma",
    r"byte for byte the one": "identical to the one",
    r"who runs this": "the administrator of this",
    r"(says?|knows?|said) nothing of the uncertainty|taken for exact": "states none, exact",
    r"with a leap": "with a jump",
    r"in line with its neighbours: that": "continuous with the rows beside it",
    r"rid(es?|ing) on (it|the table)": "is on, is fixed to",
    r"flat sides?": "planar face",
    r"cannot be called so": "not a valid name",
    r"let its \{?\w*\}? ?be set": "allow it to be set",
    r"(the|no|this|which) boards? (re(started|fused)|answered|did not confirm)": "controller",
}  # fmt: skip
"""Words (regular expressions, whole words, any case) and what to write instead."""

ALLOWED: dict[str, str] = {}
"""Excerpts in which a banned word stands for a reason."""

OUTSIDE = "|".join([
    r"ALGORITHMS|DESIGN\.md|\bnotes/[A-Z]|shared/(science|notes)",
    r"(?<![\w.])/(home|Users)/\w",
    *(re.escape(f"{p}/") for p in {TOP.parent, Path.home()} if p != Path(p.anchor)),
])  # fmt: skip
"""What is no part of the repository, absolute paths of one machine included; tests may name
`../shared/data`, where others' data are."""

_BANNED = {re.compile(rf"\b(?:{word})(?!\w)", re.IGNORECASE): use for word, use in BANNED.items()}
_SENTENCE = re.compile(r"\w\S* +\S*\w")
_IN_FRONT_END = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`|>([^<>{}=;]+)<')


def _python(path: Path) -> Iterator[tuple[int, str]]:
    """Texts of a module, and the first lines of its docstrings."""
    docstrings = set()
    for node in nodes(path):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstrings.add(id(node.value))
            if isinstance(node.value.value, str):
                yield node.lineno, node.value.value.strip().split("\n")[0]
    for node in nodes(path):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str):
            continue
        if id(node) not in docstrings and _SENTENCE.search(node.value):
            yield node.lineno, " ".join(node.value.split())


def _front_end(path: Path) -> Iterator[tuple[int, str]]:
    text = path.read_text()
    for found in _IN_FRONT_END.finditer(text):
        said = next(g for g in found.groups() if g is not None).strip()
        if not (_SENTENCE.search(said) or said[:1].isupper()):
            continue  # a key, a path or a class
        yield text.count("\n", 0, found.start()) + 1, " ".join(said.split())


def _page(path: Path) -> Iterator[tuple[int, str]]:
    """Paragraphs without code: what stands between back quotes is not prose."""
    text = re.sub(
        r"```.*?```|`[^`]*`|\]\([^)]*\)",
        lambda m: "\n" * m[0].count("\n"),
        path.read_text(),
        flags=re.DOTALL,
    )
    at = 1
    for paragraph in re.split(r"(\n\s*\n)", text):
        if paragraph.strip():
            yield at, " ".join(paragraph.split())
        at += paragraph.count("\n")


def _texts() -> Iterator[tuple[str, int, str]]:
    pages = [TOP / "README.md", TOP / "CONTRIBUTING.md", *(TOP / "docs").rglob("*.md")]
    kinds = (
        (_python, (TOP / "src" / "turnscan").rglob("*.py")),
        (_front_end, (TOP / "frontend" / "src").rglob("*.ts*")),
        (_page, (p for p in pages if "decisions" not in p.parts and "_build" not in p.parts)),
    )
    for read, paths in kinds:
        for path in sorted(paths):
            for line, text in read(path):
                yield path.relative_to(TOP).as_posix(), line, text


@pytest.fixture(scope="module")
def texts() -> list[tuple[str, int, str]]:
    return list(_texts())


def test_no_text_for_people_uses_a_banned_word(texts: list[tuple[str, int, str]]) -> None:
    assert len(texts) > 5000
    found = []
    for path, line, text in texts:
        for word, use in _BANNED.items():
            for hit in word.finditer(text):
                excerpt = text[max(0, hit.start() - 40) : hit.end() + 40]
                if not any(allowed in text for allowed in ALLOWED):
                    found.append(f"{path}:{line}: “{excerpt}”: write {use}")
    assert not found, "\n".join(found)


def test_every_exception_is_needed(texts: list[tuple[str, int, str]]) -> None:
    for allowed in ALLOWED:
        assert any(allowed in text for _, _, text in texts), f"{allowed} is written nowhere"


def test_nothing_cites_a_file_outside_of_the_repository() -> None:
    kinds = (".py", ".md", ".ts", ".tsx", ".toml", ".txt", ".yaml")
    listed = subprocess.run(
        ["git", "ls-files"], cwd=TOP, capture_output=True, text=True, check=True
    )
    paths = [p for p in listed.stdout.split("\n") if p.endswith(kinds) or p == "Makefile"]
    assert len(paths) > 500
    own = Path(__file__).relative_to(TOP).as_posix()
    found = [
        f"{path}:{number}: {line.strip()}"
        for path in paths
        if path != own
        for number, line in enumerate((TOP / path).read_text().splitlines(), 1)
        if re.search(OUTSIDE, line)
    ]
    assert not found, "\n".join(found)
