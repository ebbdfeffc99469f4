"""What is told of a surface after an edit agrees with what the surface's own room says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.edit.surfaces import sheet
from turnscan import edit
from turnscan.app import _encode_arrays as wire
from turnscan.edit._body import difference
from turnscan.mesh import Mesh, is_closed
from turnscan.workflows._session._grid import _taken_away, steps_taken_away
from turnscan.workflows._session._mesh import coarse_arrays, surface_arrays, surface_patches

CUBE = np.array([[x, y, z] for x in (0, 2) for y in (0, 3) for z in (0, 5)], np.float64)
SIDES = [
    *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]),
    *([0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]),
    *([0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
]


def _body() -> edit.Body:
    return edit.Body.of(Mesh(CUBE, np.array(SIDES, np.int32)))


def test_figures_of_a_box() -> None:
    box = _body()
    f = wire.figures(edit.figures(box))
    assert (f.vertices, f.faces, f.closed) == (8, 12, True)
    assert f.volume == pytest.approx(30.0)
    assert f.bounds == ((0, 0, 0), (2, 3, 5))


@pytest.mark.parametrize("gone", range(12))
def test_a_box_without_a_face_is_open(gone: int) -> None:
    body = edit.Alive(np.array([gone], np.int32), False).on(_body())
    f = wire.figures(edit.figures(body))
    assert (f.faces, f.closed, f.volume) == (11, False, None)
    assert f.closed == is_closed(edit.Compact.of(body).mesh)


def test_what_was_deleted_from_the_surface_is_deleted_in_its_grid() -> None:
    """A sheet of 8 × 8 points, one profile a row, of which the middle is deleted and comes back."""
    mesh = sheet(8)
    grid: Any = SimpleNamespace(
        laser="left", steps=np.arange(8)[::-1], flags=np.zeros((8, 8), np.uint16)
    )
    before = edit.Document.open(lambda *_: (mesh, ()))
    about = np.isin(mesh.faces, [27, 28]).any(axis=1)
    gone = edit.Delete(edit.Region.of(before.body, np.flatnonzero(about)))
    after, _ = before.add(gone)
    rows, lines = _taken_away(grid, after)
    assert {(int(grid.steps[r]), int(n)) for r, n in zip(rows, lines, strict=True)} == {
        (3, 3), (3, 4)
    }  # fmt: skip
    assert steps_taken_away(grid, before, after).tolist() == [3]
    assert steps_taken_away(grid, after, after.undo()[0]).tolist() == [3]
    assert not len(steps_taken_away(grid, after, after))
    grid.laser = "right"
    assert not len(_taken_away(grid, after)[0])


def test_nothing_left() -> None:
    body = edit.Alive(np.arange(12, dtype=np.int32), False).on(_body())
    f = wire.figures(edit.figures(body))
    assert (f.vertices, f.faces, f.bounds, f.closed) == (0, 0, None, False)


def test_patches_lead_a_browser_to_the_same_mesh() -> None:
    body = _body()
    before = edit.Compact.of(body)
    moved = Mesh(CUBE + [[0, 0, 1.0]] * 8, np.array([*SIDES[:11], [0, 1, 2]], np.int32))
    patches = difference(body, before, moved)
    after = body
    for patch in patches:
        after = patch.on(after)
    shown = {k: v.copy() for k, v in wire.encoded(surface_arrays(body)).items()}
    parts, arrays = wire.patch_parts(surface_patches(patches))
    for k, part in enumerate(parts):
        own = {n.removeprefix(f"{k}."): a for n, a in arrays.items() if n.startswith(f"{k}.")}
        match part.kind:
            case "verts":
                shown["positions"][own["ids"]] = own["positions"]
            case "alive":
                shown["alive"][own["faces"]] = part.value
            case "append":
                for name, array in own.items():
                    shown[name] = np.concatenate([shown[name], array])
                alive = np.ones(len(own["faces"]), np.uint8)
                shown["alive"] = np.concatenate([shown["alive"], alive])
            case _:
                raise AssertionError(part.kind)
    truth = wire.encoded(surface_arrays(after))
    assert {p.kind for p in parts} >= {"verts", "alive", "append"}
    for name, array in truth.items():
        np.testing.assert_array_equal(shown[name], array)


def test_a_stand_in_has_about_the_faces_asked_for() -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 200, endpoint=False), np.linspace(0.1, 3.0, 100))
    points = 40 * np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1)
    i, j = np.arange(99)[:, None] * 200, np.arange(200)[None]
    k = (j + 1) % 200
    faces = np.concatenate(
        [np.stack(t, -1).reshape(-1, 3) for t in ((i + j, i + k, i + 200 + j),
                                                  (i + k, i + 200 + k, i + 200 + j))]
    )  # fmt: skip
    ball = edit.Body.of(Mesh(points.reshape(-1, 3), faces.astype(np.int32)))
    coarse = coarse_arrays(ball, 4000)
    assert 2000 < len(coarse["faces"]) < 6000
    assert np.linalg.norm(coarse["positions"], axis=1).min() > 38
    assert len(coarse_arrays(ball, 10**6)["faces"]) == len(faces)
