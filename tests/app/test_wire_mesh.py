"""What is told of a surface after an edit agrees with what the surface's own room says."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan import edit
from turnscan.app import _encode_arrays as wire
from turnscan.edit._body import difference
from turnscan.mesh import Mesh, is_closed
from turnscan.workflows._session_mesh import coarse_arrays, surface_arrays, surface_patches

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
    assert f.area == pytest.approx(62.0)
    assert f.volume == pytest.approx(30.0)
    assert f.bounds == ((0, 0, 0), (2, 3, 5))


@pytest.mark.parametrize("gone", range(12))
def test_a_box_without_a_face_is_open(gone: int) -> None:
    body = edit.Alive(np.array([gone], np.int32), False).on(_body())
    f = wire.figures(edit.figures(body))
    assert (f.faces, f.closed, f.volume) == (11, False, None)
    assert f.closed == is_closed(edit.Compact.of(body).mesh)


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
