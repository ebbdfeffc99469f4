"""Reports: one file, nothing loaded, nothing executed; pictures that show what they should."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image as Pillow

from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.workflows._pages import _html


def test_text_from_outside_is_never_markup() -> None:
    evil = "<script>alert(1)</script>"
    finding = Finding("scan.x", "warning", evil, evil, evil)
    text = _html.page(
        evil,
        [
            _html.heading(evil),
            _html.paragraph(evil),
            _html.table([evil], [[evil]]),
            _html.findings([finding]),
            _html.picture(np.zeros((2, 3), np.uint8), evil),
        ],
    )
    assert "<script" not in text
    assert text.count("&lt;script&gt;") == 11
    assert "http:" not in text
    assert "https:" not in text


def test_findings_stand_worst_first() -> None:
    text = _html.findings(
        [
            Finding("a.note", "note", "n"),
            Finding("a.bad", "error", "e"),
            Finding("a.w", "warning", "w"),
        ]
    )
    assert text.index("a.bad") < text.index("a.w") < text.index("a.note")


def test_png_round_trip() -> None:
    image = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    assert np.array_equal(np.asarray(Pillow.open(io.BytesIO(_html.png(image)))), image)


def _tetrahedron() -> Mesh:
    v = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
    return Mesh(v, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def test_render_fits_the_frame_and_tells_front_from_back() -> None:
    mesh = _tetrahedron()
    front = mesh.show(size=(120, 90)).pixels
    drawn = (front != 255).any(axis=2)
    assert 0.15 < drawn.mean() < 0.9
    assert not drawn[:, 0].any()
    assert not drawn[0].any()
    blue = front[drawn][:, 2].astype(int) > front[drawn][:, 0]
    assert blue.mean() > 0.95
    inside_out = Mesh(mesh.vertices, mesh.faces[:, ::-1]).show(size=(120, 90)).pixels
    rust = inside_out[drawn][:, 0].astype(int) > inside_out[drawn][:, 2]
    assert rust.mean() > 0.95


def test_render_draws_the_near_face_over_the_far_one() -> None:
    # Two walls facing the viewer at azimuth 0: the near one (smaller y) is red.
    wall = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    near, far = wall * 0.5 + [0, -1, 0], wall + [0, 1, 0]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(np.concatenate([far, near]), np.concatenate([faces, faces + 4]))
    colour = np.array([[0, 0, 255]] * 4 + [[255, 0, 0]] * 4)
    image = mesh.show(azimuth=0.0, elevation=0.0, size=(100, 100), colour=colour).pixels
    assert image[50, 50, 0] > 100
    assert image[50, 50, 2] == 0
    assert image[10, 50, 2] > 100


def test_render_of_nothing_is_white() -> None:
    assert (Mesh(np.zeros((0, 3)), np.zeros((0, 3))).show(size=(8, 6)).pixels == 255).all()
