"""What Sphinx does again for each page and each annotation, done once. The pages are the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.domains.python import ObjectEntry, PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.pycode.parser import Parser


class QuickPythonDomain(PythonDomain):
    """The Python domain, which does not look through all objects for a name that none has.

    Most annotations name a type of another library, and for each Sphinx compares the ends of all
    names.
    """

    _known: tuple[int, frozenset[str]] = (-1, frozenset())
    """Of how many objects, and the last part of the name of each."""

    def find_obj(
        self,
        env: BuildEnvironment,
        modname: str,
        classname: str,
        name: str,
        type: str | None,
        searchmode: int = 0,
    ) -> list[tuple[str, ObjectEntry]]:
        """As Sphinx's own: whatever it finds ends with the last part of ``name``."""
        count, last = self._known
        if count != len(self.objects):
            last = frozenset(full.rpartition(".")[2] for full in self.objects)
            self._known = len(self.objects), last
        if name.removesuffix("()").rpartition(".")[2] not in last:
            return []
        return super().find_obj(env, modname, classname, name, type, searchmode)


def titles_of(toc: nodes.bullet_list) -> nodes.bullet_list:
    """A document's contents without its sections and objects: its title and its lists of pages.

    Sphinx, asked for titles alone, copies everything and takes this away, for each page again.
    """
    out = toc.copy()
    for entry in toc.children:
        kept = entry.copy()
        for place, part in enumerate(entry.children):
            lists = list(part.findall(addnodes.toctree)) if place else []
            if place and not lists:
                continue
            copied = part.copy() if place else part.deepcopy()
            copied += [one.copy() for one in lists]
            kept += copied
        out += kept
    return out


def _quick_tree(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """The tree of pages beside a page is made of titles."""
    whole: Callable[..., str] | None = context.get("toctree")
    if whole is None:
        return
    titles: dict[str, nodes.bullet_list] | None = getattr(app, "_titles_of_pages", None)
    if titles is None:
        titles = {name: titles_of(toc) for name, toc in app.env.tocs.items()}
        app._titles_of_pages = titles  # type: ignore[attr-defined]

    def quick(**how: Any) -> str:
        if not how.get("titles_only"):
            return whole(**how)
        all_of_it, app.env.tocs = app.env.tocs, titles
        try:
            return whole(**how)
        finally:
            app.env.tocs = all_of_it

    context["toctree"] = quick


def _no_places(parser: Parser) -> None:
    """The lines of all definitions of a module: only `sphinx.ext.viewcode` asks for them."""
    parser.definitions = {}


def setup(app: Sphinx) -> dict[str, Any]:
    """For Sphinx."""
    Parser.parse_definition = _no_places  # type: ignore[method-assign]
    app.add_domain(QuickPythonDomain, override=True)
    app.connect("html-page-context", _quick_tree, priority=400)  # the theme asks at 500
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
