"""A self-contained HTML report: text, tables and pictures in one file that loads nothing."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from turnscan import __version__
from turnscan.arrays import Image
from turnscan.findings import Finding
from turnscan.remedy import plain_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8881; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2rem; }
table { border-collapse: collapse; margin: .5rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .8rem .25rem 0; text-align: left; }
figure { margin: 1rem 0; display: inline-block; vertical-align: top; max-width: 100%; }
figure img { max-width: 100%; background: #fff; border: 1px solid var(--line); }
figcaption { font-size: .9rem; opacity: .8; max-width: 40rem; }
.warning, .error { border-left: 4px solid #c60; padding-left: .6rem; background: var(--soft); }
.error { border-color: #c00; } .note { border-left: 4px solid #48c; padding-left: .6rem; }
footer { margin-top: 3rem; font-size: .85rem; opacity: .7; }
"""
_PACKED = 4
"""zlib's level: the best one takes nine times as long, for files a fifteenth smaller."""


def page(title: str, parts: Iterable[str]) -> str:
    """One HTML page from parts made by `heading`, `paragraph`, `table`, `picture`, `findings`."""
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{html.escape(title)}</h1>\n{body}\n"
        f"<footer>turnscan {html.escape(__version__)}</footer>\n</body>\n</html>\n"
    )


def heading(text: str) -> str:
    """A section's heading."""
    return f"<h2>{html.escape(text)}</h2>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; every cell is written as plain text."""
    top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    body = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows
    )
    return f"<table>\n<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"


def findings(found: Sequence[Finding]) -> str:
    """The findings, worst first; says so when there are none."""
    if not found:
        return paragraph("No findings.")
    order = {"error": 0, "warning": 1, "note": 2}
    lines = []
    for f in sorted(found, key=lambda f: order[f.severity]):
        where = f" [{html.escape(f.where)}]" if f.where else ""
        remedy = f"<br>→ {html.escape(plain_words(f.remedy))}" if f.remedy else ""
        lines.append(
            f'<p class="{f.severity}"><b>{html.escape(f.code)}</b>{where}: '
            f"{html.escape(f.message)}{remedy}</p>"
        )
    return "\n".join(lines)


def picture(image: Image | Figure | bytes, caption: str) -> str:
    """A picture with its caption: an array (H, W) or (H, W, 3) uint8, a figure, or a PNG file."""
    packed = image if isinstance(image, bytes) else png(image)
    data = base64.b64encode(packed).decode()
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def png(image: Image | Figure, packed: int = _PACKED) -> bytes:
    """The bytes of a PNG file of a picture or a figure; ``packed`` is zlib's level."""
    out = io.BytesIO()
    if hasattr(image, "savefig"):
        image.savefig(
            out, format="png", dpi=110, bbox_inches="tight", metadata={"Software": None},
            pil_kwargs={"compress_level": packed},
        )  # fmt: skip
        return out.getvalue()
    from PIL import Image as Pillow

    Pillow.fromarray(image).save(out, format="png", compress_level=packed)
    return out.getvalue()


def pixels(image: Image | Figure) -> Image:
    """What `png` shows, (H, W, 3)."""
    import numpy as np
    from PIL import Image as Pillow

    if hasattr(image, "savefig"):
        picture: Pillow.Image = Pillow.open(io.BytesIO(png(image, packed=0)))
    else:
        picture = Pillow.fromarray(image)
    return np.asarray(picture.convert("RGB"))
