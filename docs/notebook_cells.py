"""Notebooks as text: pages whose ``code-cell`` blocks are run when the docs are built.

Sphinx shows each cell with its outputs; a cell that raises ends the build. A page is a notebook in
MyST Markdown, which Jupyter opens with jupytext; `python docs/notebook_cells.py PAGE.md` runs it
without either and writes PAGE.ipynb with all outputs.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", re.M | re.S)


@dataclass(frozen=True)
class Output:
    """What a cell shows: its type as Jupyter calls it, and the text or the bytes."""

    kind: str
    data: str | bytes


class Notebook:
    """Runs cells one after the other, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "__notebook__"}

    def run(self, code: str) -> list[Output]:
        """Run a cell: what it prints, then what its last expression shows, if it is one."""
        tree = ast.parse(code)
        last = None
        if tree.body and isinstance(tree.body[-1], ast.Expr) and not code.rstrip().endswith(";"):
            last = ast.Expression(tree.body.pop().value)  # type: ignore[attr-defined]
        printed = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            exec(compile(tree, "<cell>", "exec"), self.names)
            value = None if last is None else eval(compile(last, "<cell>", "eval"), self.names)
            shown = [] if value is None else [shows(value)]
        said = printed.getvalue()
        return [*([Output("stream", said)] if said else []), *shown]


def shows(value: Any) -> Output:
    """What a notebook shows of a value: its HTML, its picture, or its text."""
    html = value._repr_html_() if hasattr(value, "_repr_html_") else None
    if html is not None:
        return Output("text/html", html)
    if hasattr(value, "_repr_png_"):
        return Output("image/png", value._repr_png_())
    if hasattr(value, "savefig"):
        out = io.BytesIO()
        value.savefig(out, format="png", dpi=90, metadata={"Software": None})
        return Output("image/png", out.getvalue())
    return Output("text/plain", repr(value))


def html_of(output: Output) -> str:
    """A picture or HTML as a part of a page."""
    if output.kind == "text/html":
        return f'<div class="cell-output">{output.data!s}</div>'
    assert isinstance(output.data, bytes)
    data = base64.b64encode(output.data).decode()
    return f'<img src="data:image/png;base64,{data}" alt="what the cell shows">'


class CodeCell(SphinxDirective):
    """A cell of the page's notebook: its code, and below it what came out."""

    has_content = True
    optional_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        code = "\n".join(self.content)
        shown: list[nodes.Node] = [nodes.literal_block(code, code, language="python")]
        if not self.config.run_cells:
            return shown
        book = self.env.temp_data.get("notebook")
        if book is None:
            folder = tempfile.TemporaryDirectory()  # removed when the page has been read
            self.env.temp_data["notebook folder"] = folder
            book = self.env.temp_data["notebook"] = Notebook(Path(folder.name))
        try:
            outputs = book.run(code)
        except Exception as e:
            raise ExtensionError(f"{self.env.docname}: a cell raised {e!r}:\n{code}") from e
        for output in outputs:
            if output.kind in ("stream", "text/plain"):
                text = str(output.data)
                shown.append(nodes.literal_block(text, text, language="none"))
            else:
                shown.append(nodes.raw("", html_of(output), format="html"))
        return shown


def pieces(page: str) -> Iterator[tuple[str, str]]:
    """The parts of a page in order: ("code" or "markdown", text)."""
    page = re.sub(r"\A---\n.*?^---\n", "", page, flags=re.M | re.S)
    at = 0
    for cell in CELL.finditer(page):
        if words := page[at : cell.start()].strip():
            yield "markdown", words
        yield "code", cell[1].rstrip("\n")
        at = cell.end()
    if words := page[at:].strip():
        yield "markdown", words


def as_ipynb(page: str, folder: Path) -> dict[str, Any]:
    """The notebook as Jupyter keeps it (nbformat 4.5), run in a folder."""
    book, cells = Notebook(folder), list[dict[str, Any]]()
    for kind, text in pieces(page):
        cell: dict[str, Any] = {
            "cell_type": kind, "id": f"cell-{len(cells)}", "metadata": {}, "source": text,
        }  # fmt: skip
        if kind == "code":
            count = sum(c["cell_type"] == "code" for c in cells) + 1
            outputs = [_jupyter(o, count) for o in book.run(text)]
            cell |= {"execution_count": count, "outputs": outputs}
        cells.append(cell)
    about = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return {"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 5}


def _jupyter(output: Output, count: int) -> dict[str, Any]:
    if output.kind == "stream":
        return {"output_type": "stream", "name": "stdout", "text": output.data}
    data = output.data
    text = base64.b64encode(data).decode() if isinstance(data, bytes) else data
    return {
        "output_type": "execute_result", "execution_count": count, "metadata": {},
        "data": {output.kind: text},
    }  # fmt: skip


def setup(app: Sphinx) -> dict[str, Any]:
    """For Sphinx."""
    app.add_directive("code-cell", CodeCell)
    app.add_config_value("run_cells", True, "env", bool)  # the tests run all notebooks, too
    return {"version": "1", "parallel_read_safe": True}


if __name__ == "__main__":
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as own:
            made = as_ipynb(Path(name).read_text(), Path(own))
        Path(name).with_suffix(".ipynb").write_text(json.dumps(made, indent=1, ensure_ascii=False))
        print(Path(name).with_suffix(".ipynb"), os.path.getsize(Path(name).with_suffix(".ipynb")))
