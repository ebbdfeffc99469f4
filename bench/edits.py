"""Edits of a surface: milliseconds of CPU, and how undo compares with doing all edits again."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from turnscan.edit import (
    Close,
    Cut,
    Delete,
    Document,
    Edit,
    Fill,
    HoleName,
    Region,
    Smooth,
    action_from_json,
    action_to_json,
)
from turnscan.mesh import Mesh, Provenance

Result = TypeVar("Result")


def tube(n: int, m: int) -> Mesh:
    """The wall of a vase, 2n(m − 1) faces, open above and below."""
    a, z = np.meshgrid(np.linspace(0, 2 * np.pi, n, endpoint=False), np.linspace(0, 120, m))
    r = 40 + 8 * np.sin(z / 18) + 0.5 * np.cos(7 * a)
    vertices = np.stack([r * np.cos(a), r * np.sin(a), z], axis=-1).reshape(-1, 3)
    vertices += np.random.default_rng(0).normal(0, 0.01, vertices.shape)
    k = np.arange(n)
    lower = (np.arange(m - 1) * n)[:, None]
    p, q = lower + k, lower + (k + 1) % n
    faces = np.stack([p, q, q + n, p, q + n, p + n], axis=-1).reshape(-1, 3)
    v = len(vertices)
    step, line = (a.astype(np.int32) for a in (np.tile(k, m), np.repeat(np.arange(m), n)))
    laser = np.zeros(v, dtype=np.int32)
    return Mesh(vertices, faces, Provenance(np.full(v, 0.01), laser, step, line, ("left",)))


def _took(work: Callable[[], Result]) -> tuple[Result, float]:
    began = time.process_time()
    done = work()
    return done, 1e3 * (time.process_time() - began)


def _line(mesh: Mesh) -> None:
    print(f"{len(mesh.faces)} faces, ms of CPU")
    document, opening = _took(lambda: Document.open(lambda *_: (mesh, ())))
    print(f"  open {opening:8.1f}")
    away = np.linalg.norm(mesh.triangles.mean(axis=1) - (40, 0, 60), axis=1)
    faces = np.flatnonzero(away < 18)
    region, making = _took(lambda: Region.of(document.body, faces))
    text = action_to_json(document.history.add(Delete(region)))
    _, reading = _took(lambda: action_from_json(text))
    print(f"  region of {len(faces)} faces {making:.1f}, as JSON {len(text) / 1e3:.0f} kB, "
          f"read again {reading:.1f}")  # fmt: skip
    hole = HoleName((float(mesh.vertices[:, 0].max()), 0.0, 60.0), 30.0)
    edits: list[tuple[str, Edit]] = [
        ("delete", Delete(region)),
        ("fill", Fill((hole,))),
        ("smooth", Smooth(region)),
        ("cut", Cut((0.0, 0.0, 1.0), 10.0)),
        ("close", Close()),
    ]
    for name, edit in edits[: 5 if len(mesh.faces) < 500_000 else 4]:
        document = _told(document, name, edit)
    _, again = _took(lambda: Document.open(lambda *_: (mesh, ()), document.history))
    _, back = _took(document.undo)
    print(
        f"  all again {again:.1f}; undo of the last is {again / max(back, 1e-3):.0f} times faster"
    )
    other = Document.open(lambda *_: (tube(*_shape(mesh, 0.97)), ()))
    _, found = _took(lambda: region.find(other.body))
    print(f"  the region by place on another mesh {found:.1f}")


def _told(document: Document, name: str, edit: Edit) -> Document:
    document.add(edit)  # compiled by now
    (done, change), doing = _took(lambda: document.add(edit))
    assert change.patches, name
    (undone, _), back = _took(done.undo)
    _, forth = _took(undone.redo)
    print(f"  {name:8} {doing:8.1f}   undo {back:6.1f}   redo {forth:6.1f}")
    return done


def _shape(mesh: Mesh, scale: float) -> tuple[int, int]:
    side = int(np.sqrt(len(mesh.faces) / 2) * scale)
    return side, side


def run() -> None:
    """Print the figures for 200 000 and for a million faces."""
    for side in (317, 708):
        _line(tube(side, side))
