"""DXF: a million faces written and read back, against ezdxf, and volumes as others read them."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from ezdxf.addons.r12writer import r12writer
from tests.formats.parts import box_with_hole, torus
from tests.formats.readers import READERS, volume
from tests.needs import NEEDS

from turnscan.formats import DxfForm, DxfVersion, ExportOptions, audit, export, read_dxf
from turnscan.mesh import Mesh

T = TypeVar("T")
_FORMS: tuple[tuple[DxfForm, DxfVersion], ...] = (
    ("3dface", "R12"),
    ("polyface", "R12"),
    ("3dface", "R2010"),
    ("polyface", "R2010"),
    ("mesh", "R2010"),
)


def _timed(do: Callable[[], T]) -> tuple[T, float]:
    start = time.perf_counter()
    result = do()
    return result, time.perf_counter() - start


def _with_ezdxf(mesh: Mesh) -> str:
    out = io.StringIO()
    triangles = mesh.triangles.tolist()
    with r12writer(out) as writer:
        for a, b, c in triangles:
            writer.add_3dface([a, b, c, c])
    return out.getvalue()


def run() -> None:
    """Print the figures."""
    million = torus(1000, 500)
    for form, version in _FORMS:
        options = ExportOptions(dxf_forms=(form,), dxf_version=version)
        export(torus(8, 8), ".dxf", options=options)  # compiles
        data, spent = _timed(partial(export, million, ".dxf", options=options))
        text = (
            f"{form} {version}: 1 000 000 faces written in {spent:.2f} s, {len(data) / 1e6:.0f} MB"
        )
        if version == "R12" or form == "mesh":
            read_dxf(export(torus(8, 8), ".dxf", options=options))
            remarks, checked = _timed(partial(audit, data, million, ".dxf", options=options))
            wrong = sum(r.severity == "error" for r in remarks)
            text += f"; re-read and compared in {checked:.2f} s, {wrong} errors"
        print(text)
        del data
    part = torus(400, 250)
    _, ours = _timed(lambda: export(part, ".dxf"))
    _, theirs = _timed(lambda: _with_ezdxf(part))
    print(
        f"3dface R12: 200 000 faces in {ours:.2f} s; ezdxf r12writer {theirs:.2f} s; "
        f"{theirs / ours:.0f} times as fast"
    )
    _volumes()


def _volumes() -> None:
    for name, part in (("torus", torus(100, 50)), ("box with hole", box_with_hole())):
        print(f"volume of the {name}, {len(part.faces)} faces: {part.volume:.6f} mm³; as read by")
        for form, version in _FORMS[:4]:
            options = ExportOptions(dxf_forms=(form,), dxf_version=version)
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "part.dxf"
                path.write_bytes(export(part, ".dxf", options=options))
                for reader, ask in READERS.items():
                    why = NEEDS[reader].missing()
                    found = 0.0 if why else volume(ask(path))
                    said = why or f"{found:.6f} mm³, {abs(found / part.volume - 1):.1e} off"
                    print(f"  {reader:7} {form} {version}: {said}")
    _far_away()


def _far_away() -> None:
    """What is left of a volume when the part lies many times its size from the origin."""
    near = box_with_hole()
    for times in (10, 100, 1000):
        part = Mesh(near.vertices + times * 31.7, near.faces)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "part.dxf"
            path.write_bytes(export(part, ".dxf"))
            off = [
                f"{reader} {abs(volume(ask(path)) / near.volume - 1):.1e}"
                for reader, ask in READERS.items()
                if not NEEDS[reader].missing()
            ]
        print(f"volume of a part {times} times its size from the origin: {', '.join(off)} off")


if __name__ == "__main__":
    run()
