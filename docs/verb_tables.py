"""Tables of what a verb takes, from the same schema as the forms of the browser.

``{verb-table} NAME`` shows the files, options and results of the verb, each with its flag.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

from turnscan.cli._words import flag_of
from turnscan.workflows import VERBS

HEAD = ("Name", "Flag", "Value", "Default", "What it is")
WIDTHS = (14, 16, 22, 14, 44)


def rows(verb: str) -> list[tuple[str, ...]]:
    """Name, flag, values, default and description of everything that a verb takes."""
    schema = VERBS[verb].json_schema()
    return [
        (
            name.replace("_", " "),
            flag_of(name) if p["role"] == "option" else "",
            _value(p),
            "needed" if name in schema["required"] else _default(p),
            p["description"],
        )
        for name, p in schema["properties"].items()
    ]


def _value(p: dict[str, Any]) -> str:
    one = p.get("items", p)
    if p["role"] == "input":
        text = " or ".join(p["accepts"])
    elif "enum" in one:
        text = ", ".join(c for c in one["enum"] if c is not None)
    else:
        kinds = one["type"] if isinstance(one["type"], list) else [one["type"]]
        text = {"boolean": "yes or no", "string": "text", "integer": "whole number"}.get(
            kinds[0], kinds[0]
        )
        for key, words in (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤")):
            text += f" {words} {one[key]:g}" if key in one else ""
        text += f" {p['unit']}" if "unit" in p else ""
    return f"{text}; several" if p["type"] == "array" and p["role"] != "output" else text


def _default(p: dict[str, Any]) -> str:
    value = p.get("default")
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    if p["role"] == "input":
        return "none"
    return "automatic" if value is None else str(value)


class VerbTable(SphinxDirective):
    """The table of one verb."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Build it. Raises ExtensionError for a verb that there is not."""
        verb = self.arguments[0]
        if verb not in VERBS:
            raise ExtensionError(f"{self.env.docname}: there is no verb {verb!r}")
        group = nodes.tgroup(cols=len(HEAD))
        group += [nodes.colspec(colwidth=w) for w in WIDTHS]
        head, body = nodes.thead(), nodes.tbody()
        head += _row(HEAD)
        body += [_row(row) for row in rows(verb)]
        group += [head, body]
        table = nodes.table()
        table += group
        return [nodes.paragraph(text=VERBS[verb].help), table]


def _row(texts: tuple[str, ...]) -> nodes.row:
    row = nodes.row()
    for column, text in enumerate(texts):
        shown = nodes.literal(text=text) if column == 1 and text.startswith("-") else None
        paragraph = nodes.paragraph() if shown is not None else nodes.paragraph(text=text)
        if shown is not None:
            paragraph += shown
        row += nodes.entry("", paragraph)
    return row


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx of the directive."""
    app.add_directive("verb-table", VerbTable)
    return {"parallel_read_safe": True}
